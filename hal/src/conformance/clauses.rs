//! The clauses about authority and the way to zero. Each attempt begins at rest.

use std::time::Duration;

use super::finding::{Outcome, found, not_tried};
use super::harness::Rig;
use super::trial::{CYCLE, Trial, cycles, milliseconds, require, require_state};
use crate::gate::{Authority, Gate};
use crate::hardware::Reading;
use crate::message::{CoilFeedback, Header, PoseMessage, driver_state};
use crate::time::Stamp;

/// Token of the suite's rival claims.
const RIVAL: u64 = 0x7269_7661;

pub(super) fn nothing_is_never<R: Rig>(rig: &mut R) -> Outcome {
    if !rig.starts_silent() {
        return not_tried("the rig was running before");
    }
    let sensed = Trial::new(rig).read();
    require(sensed.pose == Reading::never(), || format!("poses: {:?}", sensed.pose))?;
    require(sensed.feedback == Reading::never(), || format!("feedback: {:?}", sensed.feedback))?;
    found("nothing")
}

pub(super) fn feedback_arrives<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    let mut before = trial.rest()?;
    require_state(&before, driver_state::IDLE)?;
    trial.require_zero(&before)?;
    let again = trial.read().feedback;
    require(!again.fresh && again.last == Some(before), || "a message was fresh twice".to_owned())?;
    for _ in 0..10 {
        let now = trial.pass(CYCLE)?;
        let (last, next) = (before.header, now.header);
        require(next.epoch == last.epoch && next.sequence > last.sequence, || {
            format!("sequence went from {} to {}", last.sequence, next.sequence)
        })?;
        require(next.source_stamp_ns >= last.source_stamp_ns, || "feedback went back in time".to_owned())?;
        before = now;
    }
    found("state idle, zero current, 10 messages once each")
}

pub(super) fn no_drive_without_claim<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    let refused_before = trial.rest()?.commands_refused;
    let effort = trial.effort();
    let mut feedback = CoilFeedback::default();
    for _ in 0..50 {
        feedback = trial.drive(&effort)?;
        require_state(&feedback, driver_state::IDLE)?;
    }
    let settled = trial.rest()?;
    trial.require_zero(&settled)?;
    require(feedback.commands_refused > refused_before, || "no refusal was counted".to_owned())?;
    require(feedback.accepted_epoch != trial.authority.epoch, || "its epoch was accepted".to_owned())?;
    found(format!("{} commands counted as refused, no current", settled.commands_refused - refused_before))
}

pub(super) fn claim_is_echoed<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    let mut before = trial.claim()?;
    for _ in 0..20 {
        let held = *trial.gate.previous();
        let now = trial.drive(&held)?;
        require_state(&now, driver_state::DRIVEN)?;
        require(now.accepted_epoch == trial.authority.epoch, || {
            format!("epoch {} echoed", now.accepted_epoch)
        })?;
        require(now.accepted_sequence > before.accepted_sequence, || {
            format!("accepted sequence stays at {}", now.accepted_sequence)
        })?;
        trial.require_zero(&now)?;
        before = now;
    }
    found(format!("epoch echoed, sequence echoed up to {}, no current", before.accepted_sequence))
}

pub(super) fn currents_follow_within_slew<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    let breaks_before = trial.rest()?.limit_breaks;
    let mut before = trial.claim()?;
    trial.trace = vec![before];
    let effort = trial.effort();
    for _ in 0..cycles(trial.ramp_time() + trial.rig.settling()) {
        before = trial.drive(&effort)?;
    }
    let steepest = trial.require_slew()?;
    trial.require_currents(&before, &effort)?;
    require(before.limit_breaks == breaks_before, || {
        format!("{} breaks of a limit counted, there were none", before.limit_breaks - breaks_before)
    })?;
    found(format!("every coil got there, at {steepest:.0} A/s at most"))
}

pub(super) fn authority_is_exclusive<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let effort = trial.effort();
    let refused = refuse_rival(&mut trial)?;
    let feedback = trial.drive(&effort)?;
    require_state(&feedback, driver_state::DRIVEN)?;
    trial.require_currents(&feedback, &effort)?;
    found(format!("{refused} claims of a rival refused, currents as they were"))
}

pub(super) fn rival_is_refused<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    let refused = refuse_rival(&mut trial)?;
    let still = *trial.gate.previous();
    require_state(&trial.drive(&still)?, driver_state::DRIVEN)?;
    found(format!("{refused} claims of a rival refused"))
}

/// Claims under another epoch between commands of the holder; how many were counted as refused.
fn refuse_rival<R: Rig>(trial: &mut Trial<'_, R>) -> Result<u64, String> {
    let held = *trial.gate.previous();
    let before = trial.drive(&held)?.commands_refused;
    let mut other = Gate::new(trial.rig.description());
    let epoch = trial.authority.epoch + 1;
    let rival = Authority { epoch, token: RIVAL, ..trial.authority };
    let mut feedback = CoilFeedback::default();
    for _ in 0..20 {
        feedback = trial.send(&other.claim(rival))?;
        require(feedback.accepted_epoch == trial.authority.epoch, || {
            "a rival was granted authority".to_owned()
        })?;
        trial.drive(&held)?;
    }
    let refused = feedback.commands_refused.saturating_sub(before);
    require(refused > 0, || "no claim of the rival was counted as refused".to_owned())?;
    Ok(refused)
}

pub(super) fn release_ramps_down<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let release = trial.gate.release(trial.authority);
    let feedback = trial.send(&release)?;
    require(feedback.state != driver_state::DRIVEN, || "still driven after release".to_owned())?;
    let sent = trial.sent;
    let zero = trial.time_to_zero(sent)?;
    let rested = trial.rest()?;
    require_state(&rested, driver_state::IDLE)?;
    trial.require_zero(&rested)?;
    trial.claim()?;
    found(format!("zero {:.1} ms after the release, free again", milliseconds(zero)))
}

pub(super) fn disable_latches<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let zero = stay_disabled(&mut trial)?;
    found(format!("zero {:.1} ms after the order, disabled until the next claim", milliseconds(zero)))
}

pub(super) fn disable_is_kept<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    stay_disabled(&mut trial)?;
    found("disabled until the next claim")
}

/// Cuts, goes on commanding what stood before, claims anew; the time to zero.
fn stay_disabled<R: Rig>(trial: &mut Trial<'_, R>) -> Result<Duration, String> {
    let before = *trial.gate.previous();
    let disable = trial.gate.disable(trial.authority);
    require_state(&trial.send(&disable)?, driver_state::DISABLED)?;
    let zero = trial.time_to_zero(trial.sent)?;
    for _ in 0..20 {
        require_state(&trial.drive(&before)?, driver_state::DISABLED)?;
    }
    let rested = trial.rest()?;
    require_state(&rested, driver_state::DISABLED)?;
    trial.require_zero(&rested)?;
    trial.claim()?;
    Ok(zero)
}

pub(super) fn garbage_is_refused<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    let feedback = trial.rest()?;
    let now = trial.rig.now();
    let header = |last: Header| Header {
        sequence: last.sequence + 1_000,
        source_stamp_ns: now.nanoseconds(),
        publish_stamp_ns: now.nanoseconds(),
        ..last
    };
    for (what, spoil) in feedback_garbage() {
        let mut garbage = CoilFeedback { header: header(feedback.header), ..feedback };
        spoil(&mut garbage, now);
        if !trial.rig.inject_feedback(garbage) {
            return not_tried("nothing can be put into the mouth of this driver");
        }
        let reading = trial.read().feedback;
        require(reading.refused.is_some(), || format!("feedback with {what} was not refused"))?;
        require(reading.last == Some(feedback), || format!("feedback with {what} replaced the last one"))?;
    }
    let Some(pose) = trial.read().pose.last else {
        return found("feedback alone: the rig has no poses");
    };
    for (what, spoil) in pose_garbage() {
        let mut garbage = PoseMessage { header: header(pose.header), ..pose };
        spoil(&mut garbage, now);
        if !trial.rig.inject_pose(garbage) {
            break;
        }
        let reading = trial.read().pose;
        require(reading.refused.is_some(), || format!("poses with {what} were not refused"))?;
        require(reading.last == Some(pose), || format!("poses with {what} replaced the last ones"))?;
    }
    trial.pass(CYCLE)?;
    found("14 kinds refused")
}

type Spoil<T> = fn(&mut T, Stamp);

fn feedback_garbage() -> [(&'static str, Spoil<CoilFeedback>); 7] {
    [
        ("another schema", |message, _| message.header.schema += 1),
        ("a sequence that fell", |message, _| message.header.sequence = 0),
        ("a stamp in the future", |message, now| {
            message.header.source_stamp_ns = now.nanoseconds() + 1_000_000_000;
        }),
        ("another description", |message, _| message.description_fingerprint ^= 1),
        ("too many coils", |message, _| message.coil_count += 1),
        ("a current that is no number", |message, _| message.measured.current_a[0] = f64::NAN),
        ("an unknown state", |message, _| message.state = u32::MAX),
    ]
}

fn pose_garbage() -> [(&'static str, Spoil<PoseMessage>); 7] {
    [
        ("another schema", |message, _| message.header.schema += 1),
        ("a sequence that fell", |message, _| message.header.sequence = 0),
        ("a stamp in the future", |message, now| {
            message.header.source_stamp_ns = now.nanoseconds() + 1_000_000_000;
        }),
        ("too many magnets", |message, _| message.magnet_count += 1),
        ("a position that is no number", |message, _| message.magnets[0].position_m[1] = f64::NAN),
        ("a quaternion of no length", |message, _| message.magnets[0].orientation_xyzw = [0.0; 4]),
        ("an unknown valid flag", |message, _| message.magnets[0].valid = 7),
    ]
}
