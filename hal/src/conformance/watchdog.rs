//! The clauses about commands that cease: authority lapses at the time stated in the last command, and
//! currents ramp to zero.
//!
//! Judged by the driver's own stamps, which are of one clock with those of the commands: a driver that the
//! machine held up publishes nothing meanwhile, and is judged by what it says on waking.

use std::time::Duration;

use super::clause::Clause;
use super::finding::{Outcome, found};
use super::harness::Rig;
use super::trial::{CYCLE, Trial, cycles, milliseconds, require, require_state};
use crate::message::{CoilFeedback, driver_state};
use crate::time::Stamp;

/// After the validity: a driver that has not noticed by then never does.
const PATIENCE: Duration = Duration::from_millis(300);
/// Stamps of command and feedback are taken at two moments of a cycle.
const GRACE: Duration = Duration::from_millis(2);

/// When authority was lost after the last command.
struct Lapse {
    /// When the last command ran out.
    deadline: Stamp,
    /// From the last command to the first message without authority.
    after: Duration,
}

pub(super) fn lapse_ends_authority<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    let still = *trial.gate.previous();
    for _ in 0..20 {
        trial.drive(&still)?;
    }
    let lapse = await_lapse(&mut trial)?;
    former_epoch_is_out(&mut trial)?;
    require_state(&trial.rest()?, driver_state::IDLE)?;
    trial.claim()?;
    found(format!(
        "{:.1} ms after the last command, valid for {:.0} ms; claimed anew",
        milliseconds(lapse.after),
        milliseconds(trial.rig.validity())
    ))
}

/// Under current: the whole way to zero, and how it goes.
pub(super) fn lapse_ramps_down<R: Rig>(rig: &mut R) -> Vec<(Clause, Outcome)> {
    let mut slew = Err("no way to zero was seen".to_owned());
    let ramp = ramp_after_lapse(rig, &mut slew);
    vec![(Clause::LapseRampsDown, ramp), (Clause::LapseRampKeepsSlew, slew)]
}

fn ramp_after_lapse<R: Rig>(rig: &mut R, slew: &mut Outcome) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let effort = trial.effort();
    // The slew is that of the way to zero alone.
    let last = trial.drive(&effort)?;
    trial.trace = vec![last];
    let sent = trial.sent;
    let lapse = await_lapse(&mut trial)?;
    let zero = trial.time_to_zero(lapse.deadline);
    *slew = trial
        .require_slew()
        .and_then(|steepest| found(format!("{steepest:.0} A/s at most over 10 messages")));
    let zero = zero?;
    former_epoch_is_out(&mut trial)?;
    let rested = trial.rest()?;
    require_state(&rested, driver_state::IDLE)?;
    trial.require_zero(&rested)?;
    trial.claim()?;
    found(format!(
        "ramp begins {:.1} ms after the last command, valid for {:.0} ms; zero after {:.1} ms",
        milliseconds(lapse.after),
        milliseconds(trial.rig.validity()),
        milliseconds(lapse.deadline.since(sent) + zero)
    ))
}

/// Sends nothing until authority is lost, which must not be early nor late.
fn await_lapse<R: Rig>(trial: &mut Trial<'_, R>) -> Result<Lapse, String> {
    let (sent, validity) = (trial.sent, trial.rig.validity());
    let deadline = sent.after(validity);
    let mut last_driven = sent;
    for _ in 0..cycles(validity + PATIENCE) {
        let from = trial.trace.len();
        trial.pass(CYCLE)?;
        for feedback in &trial.trace[from..] {
            // What a driver says of its state is true when it says so; what it measured may be older.
            let stamp = Stamp::from_nanoseconds(feedback.header.publish_stamp_ns);
            if stamp <= sent {
                continue;
            }
            if feedback.state == driver_state::DRIVEN {
                last_driven = stamp;
                continue;
            }
            return lapse(stamp, sent, deadline, last_driven, trial.feedback_period());
        }
    }
    Err(format!(
        "still driven {:.0} ms after the last command, valid for {:.0} ms: no watchdog",
        milliseconds(last_driven.since(sent)),
        milliseconds(validity)
    ))
}

fn lapse(
    lost: Stamp,
    sent: Stamp,
    deadline: Stamp,
    last_driven: Stamp,
    period: Duration,
) -> Result<Lapse, String> {
    let after = lost.since(sent);
    let validity = milliseconds(deadline.since(sent));
    require(lost.after(GRACE) >= deadline, || {
        format!(
            "authority lost {:.1} ms after the last command, valid for {validity:.0} ms",
            milliseconds(after)
        )
    })?;
    require(last_driven <= deadline.after(GRACE + period * 2), || {
        let driven = milliseconds(last_driven.since(sent));
        format!("still driven {driven:.1} ms after the last command, valid for {validity:.0} ms")
    })?;
    Ok(Lapse { deadline, after })
}

/// The epoch that lapsed commands nothing any more.
fn former_epoch_is_out<R: Rig>(trial: &mut Trial<'_, R>) -> Result<(), String> {
    let still = *trial.gate.previous();
    let late = trial.drive(&still)?;
    require(late.state != driver_state::DRIVEN, || "the former epoch took over again".to_owned())
}

/// Ordered down, the rig keeps authority.
pub(super) fn order_ramps_down<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.drive_up()?;
    let mut start = None;
    let mut feedback = CoilFeedback::default();
    for _ in 0..cycles(trial.ramp_time() + trial.rig.settling()) {
        let ramp = trial.gate.ramp_to_zero(CYCLE.as_secs_f64(), trial.authority);
        feedback = trial.send(&ramp)?;
        start.get_or_insert(trial.sent);
        require_state(&feedback, driver_state::DRIVEN)?;
        if trial.require_zero(&feedback).is_ok() {
            break;
        }
    }
    trial.require_zero(&feedback)?;
    let taken = feedback.header.source_stamp().since(start.unwrap_or_default());
    found(format!("zero {:.1} ms after the order, authority kept", milliseconds(taken)))
}
