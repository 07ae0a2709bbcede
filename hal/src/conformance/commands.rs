//! The clauses about commands that a driver must not obey as they are.

use super::finding::{Outcome, found, not_tried};
use super::garbage::Garbage;
use super::harness::Rig;
use super::trial::{CYCLE, Trial, cycles, require, require_state};
use crate::guard::SLEW_JITTER;
use crate::message::{Actuation, driver_state};
use crate::time::Stamp;

/// A rig that cannot be sent anything but admitted commands.
const ADMITTED_ALONE: &str = "the rig takes admitted commands alone";

/// How far beyond its greatest current a coil is asked to go.
const EXCESS: f64 = 1.5;

pub(super) fn garbage_command_is_refused<R: Rig>(rig: &mut R, garbage: Garbage) -> Outcome {
    if garbage.needs_frame() && rig.description().frames.is_empty() || rig.description().coils.is_empty() {
        return not_tried("the rig has none");
    }
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    if garbage == Garbage::ClaimWithCurrent {
        return claim_with_current_is_refused(&mut trial);
    }
    let still = *trial.gate.previous();
    let before = trial.drive(&still)?;
    let Some(after) = trial.send_spoilt(&|command, now| garbage.spoil(command, now))? else {
        return not_tried(ADMITTED_ALONE);
    };
    require(after.accepted_epoch == before.accepted_epoch, || {
        format!("epoch {} was accepted", after.accepted_epoch)
    })?;
    require(after.accepted_sequence == before.accepted_sequence, || {
        format!("it was obeyed: sequence {} accepted", after.accepted_sequence)
    })?;
    let counted = after.commands_refused.saturating_sub(before.commands_refused);
    require(counted > 0, || "no refusal was counted".to_owned())?;
    let goes_on = trial.drive(&still)?;
    require_state(&goes_on, driver_state::DRIVEN)?;
    trial.require_zero(&goes_on)?;
    found(format!("{counted} refused, the holder goes on"))
}

/// Tried while nobody holds authority, since everybody's claim is refused while somebody does.
fn claim_with_current_is_refused<R: Rig>(trial: &mut Trial<'_, R>) -> Outcome {
    let release = trial.gate.release(trial.authority);
    trial.send(&release)?;
    let before = trial.rest()?;
    let spoilt = trial.send_spoilt(&|command, now| Garbage::ClaimWithCurrent.spoil(command, now))?;
    let Some(after) = spoilt else { return not_tried(ADMITTED_ALONE) };
    require(after.state != driver_state::DRIVEN, || "authority was granted".to_owned())?;
    require(after.commands_refused > before.commands_refused, || "no refusal was counted".to_owned())?;
    found("refused")
}

pub(super) fn former_epoch_is_refused<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    let former = trial.authority;
    trial.claim_after_release()?;
    let release = trial.gate.release(trial.authority);
    trial.send(&release)?;
    let before = trial.rest()?.commands_refused;
    let claim = trial.gate.claim(former);
    let after = trial.send(&claim)?;
    require(after.state != driver_state::DRIVEN, || "a former epoch was granted authority".to_owned())?;
    require(after.commands_refused > before, || "no refusal was counted".to_owned())?;
    found("refused")
}

/// The whole effort in one message, and from there to its opposite.
pub(super) fn jump_is_slewed<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    let breaks_before = trial.rest()?.limit_breaks;
    let mut feedback = trial.claim()?;
    trial.trace = vec![feedback];
    let effort = trial.effort();
    let mut is_jump = false;
    let mut standing = Actuation::default();
    for sign in [1.0, -1.0] {
        let wanted = Actuation { current_a: effort.current_a.map(|current| sign * current), ..effort };
        let before = trial.sent;
        for _ in 0..cycles(trial.ramp_time() * 2 + trial.rig.settling()) {
            let jumped = trial.send_spoilt(&|command, _| command.actuation.current_a = wanted.current_a)?;
            let Some(jumped) = jumped else { return not_tried(ADMITTED_ALONE) };
            feedback = jumped;
            is_jump |= before != trial.sent && trial.exceeds_slew(&standing, &wanted, before);
            if trial.require_currents(&feedback, &wanted).is_ok() {
                break;
            }
        }
        standing = wanted;
    }
    let steepest = trial.require_slew()?;
    let counted = feedback.limit_breaks.saturating_sub(breaks_before);
    // After a pause that was long enough for the change it is none.
    require(counted > 0 || !is_jump, || "the jump was not counted in limit_breaks".to_owned())?;
    found(format!("{steepest:.0} A/s at most over 10 messages, counted {counted} times"))
}

/// Too much current in one message, which the slew limit lets nobody see unless the driver has none.
pub(super) fn over_limit_is_held<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    let breaks_before = trial.rest()?.limit_breaks;
    let claimed = trial.claim()?;
    let most: Vec<f64> = trial.rig.description().coils.iter().map(|coil| coil.current_max).collect();
    trial.trace = vec![claimed];
    let asked = trial.send_spoilt(&|command, _| {
        for (current, most) in command.actuation.current_a.iter_mut().zip(&most) {
            *current = EXCESS * most;
        }
    })?;
    let Some(_) = asked else { return not_tried(ADMITTED_ALONE) };
    let still = *trial.gate.previous();
    let mut feedback = claimed;
    for _ in 0..20 {
        // Zero again.
        feedback = trial.drive(&still)?;
    }
    let counted = feedback.limit_breaks.saturating_sub(breaks_before);
    require(counted > 0, || "it was not counted in limit_breaks".to_owned())?;
    let mut greatest = 0.0_f64;
    for feedback in &trial.trace {
        for (index, most) in most.iter().enumerate() {
            let measured = feedback.measured.current_a[index].abs();
            greatest = greatest.max(measured / most);
            let allowed = most + trial.rig.current_tolerance(index);
            require(measured <= allowed, || {
                format!("coil {index} measured {measured:.3} A, {most} A at most")
            })?;
        }
    }
    trial.require_slew()?;
    found(format!("{:.0} % of the greatest current at most, counted {counted} times", greatest * 100.0))
}

impl<R: Rig> Trial<'_, R> {
    /// True when the newest command, sent after one at `before`, left slew no time for the change.
    fn exceeds_slew(&self, from: &Actuation, to: &Actuation, before: Stamp) -> bool {
        let elapsed = (self.sent.since(before) + SLEW_JITTER + CYCLE).as_secs_f64();
        let coils = self.rig.description().coils.iter().enumerate();
        coils.into_iter().any(|(index, coil)| {
            (to.current_a[index] - from.current_a[index]).abs() > coil.slew_max * elapsed
        })
    }

    /// Gives authority up at zero current and claims anew, under a later epoch.
    fn claim_after_release(&mut self) -> Result<(), String> {
        let release = self.gate.release(self.authority);
        self.send(&release)?;
        self.pass(CYCLE)?;
        self.claim().map(|_| ())
    }
}

pub(super) fn release_frees<R: Rig>(rig: &mut R) -> Outcome {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    let release = trial.gate.release(trial.authority);
    require_state(&trial.send(&release)?, driver_state::IDLE)?;
    trial.claim()?;
    found("idle, claimed anew")
}
