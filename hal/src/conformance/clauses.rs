//! The clauses. Each gets a rig of its own.

use super::harness::{Clause, Rig};
use super::trial::{CYCLE, Outcome, Trial, VALIDITY, cycles, require, require_state};
use crate::gate::{Authority, Gate};
use crate::hardware::Reading;
use crate::message::{CoilFeedback, Header, PoseMessage, driver_state};
use crate::time::Stamp;

type Attempt<R> = fn(&mut R) -> Outcome;

/// Every clause with the attempt to break it.
pub(super) fn all<R: Rig>() -> [(Clause, Attempt<R>); 10] {
    [
        (Clause::NothingIsNever, nothing_is_never),
        (Clause::FeedbackArrives, feedback_arrives),
        (Clause::NoDriveWithoutClaim, no_drive_without_claim),
        (Clause::ClaimIsEchoed, claim_is_echoed),
        (Clause::CurrentsFollowWithinSlew, currents_follow_within_slew),
        (Clause::AuthorityIsExclusive, authority_is_exclusive),
        (Clause::LapseRampsDown, lapse_ramps_down),
        (Clause::ReleaseRampsDown, release_ramps_down),
        (Clause::DisableLatches, disable_latches),
        (Clause::GarbageIsRefused, garbage_is_refused),
    ]
}

fn nothing_is_never<R: Rig>(rig: &mut R) -> Outcome {
    if !rig.starts_silent() {
        return Ok(());
    }
    let sensed = Trial::new(rig).read();
    require(sensed.pose == Reading::never(), || format!("poses: {:?}", sensed.pose))?;
    require(sensed.feedback == Reading::never(), || format!("feedback: {:?}", sensed.feedback))
}

fn feedback_arrives<R: Rig>(rig: &mut R) -> Outcome {
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
    Ok(())
}

fn no_drive_without_claim<R: Rig>(rig: &mut R) -> Outcome {
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
    require(feedback.accepted_epoch != trial.authority.epoch, || "its epoch was accepted".to_owned())
}

fn claim_is_echoed<R: Rig>(rig: &mut R) -> Outcome {
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
    Ok(())
}

fn currents_follow_within_slew<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    let mut before = trial.claim()?;
    trial.gate.seed(&before.measured);
    let effort = trial.effort();
    // Noise of both measurements, and stamps that need not fall on the cycles.
    let tolerance = 2.0 * trial.rig.current_tolerance();
    for _ in 0..cycles(trial.ramp_time() + trial.rig.settling()) {
        let now = trial.drive(&effort)?;
        let elapsed = now.header.source_stamp().since(before.header.source_stamp()).as_secs_f64();
        for (index, coil) in trial.rig.description().coils.iter().enumerate() {
            let change = (now.measured.current_a[index] - before.measured.current_a[index]).abs();
            let greatest = coil.slew_max * elapsed * (1.0 + 1e-9) + tolerance;
            require(change <= greatest, || format!("coil {index} changed by {change} A in {elapsed} s"))?;
        }
        before = now;
    }
    trial.require_currents(&before, &effort)?;
    require(before.limit_breaks == 0, || format!("{} breaks of a limit counted", before.limit_breaks))
}

fn authority_is_exclusive<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let effort = trial.effort();
    let mut other = Gate::new(trial.rig.description());
    let rival = Authority { epoch: trial.authority.epoch + 1, token: 0x7269_7661, validity: VALIDITY };
    for _ in 0..20 {
        let feedback = trial.send(&other.claim(rival))?;
        require(feedback.accepted_epoch == trial.authority.epoch, || {
            "a rival was granted authority".to_owned()
        })?;
        trial.drive(&effort)?;
    }
    let feedback = trial.drive(&effort)?;
    require_state(&feedback, driver_state::DRIVEN)?;
    trial.require_currents(&feedback, &effort)
}

fn lapse_ramps_down<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    for _ in 0..cycles(VALIDITY) {
        trial.pass(CYCLE)?;
    }
    let ramping = trial.pass(CYCLE * 2)?;
    require(ramping.state != driver_state::DRIVEN, || "still driven after validity ran out".to_owned())?;
    let effort = trial.effort();
    let late = trial.drive(&effort)?;
    require(late.state != driver_state::DRIVEN, || "the former epoch took over again".to_owned())?;
    let rested = trial.rest()?;
    require_state(&rested, driver_state::IDLE)?;
    trial.require_zero(&rested)?;
    trial.claim().map(|_| ())
}

fn release_ramps_down<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let release = trial.gate.release(trial.authority);
    let feedback = trial.send(&release)?;
    require(feedback.state != driver_state::DRIVEN, || "still driven after release".to_owned())?;
    let rested = trial.rest()?;
    require_state(&rested, driver_state::IDLE)?;
    trial.require_zero(&rested)?;
    trial.claim().map(|_| ())
}

fn disable_latches<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let disable = trial.gate.disable(trial.authority);
    require_state(&trial.send(&disable)?, driver_state::DISABLED)?;
    let effort = trial.effort();
    for _ in 0..20 {
        require_state(&trial.drive(&effort)?, driver_state::DISABLED)?;
    }
    let rested = trial.rest()?;
    require_state(&rested, driver_state::DISABLED)?;
    trial.require_zero(&rested)?;
    trial.claim().map(|_| ())
}

fn garbage_is_refused<R: Rig>(rig: &mut R) -> Outcome {
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
            break;
        }
        let reading = trial.read().feedback;
        require(reading.refused.is_some(), || format!("feedback with {what} was not refused"))?;
        require(reading.last == Some(feedback), || format!("feedback with {what} replaced the last one"))?;
    }
    let Some(pose) = trial.read().pose.last else {
        return Ok(());
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
    trial.pass(CYCLE).map(|_| ())
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
