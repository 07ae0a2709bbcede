//! What the supervisor makes of an operator's request in each state.

use magsteer_hal::operator::Cause;

use super::Supervisor;
use crate::daemon::state::{Answers, NearSnap, Request, State, Verb};
use crate::daemon::watch::Observation;

impl Supervisor {
    pub(super) fn take(&mut self, request: Request, seen: &Observation, answers: &mut Answers) {
        let verdict = match request.verb {
            Verb::Arm => match self.arm(request.id, seen) {
                // A claim is answered once the driver confirms it.
                Ok(()) if matches!(self.state, State::Arming { .. }) => return,
                verdict => verdict,
            },
            Verb::Go => self.go(seen),
            Verb::Hold => self.hold(),
            Verb::Retreat => self.retreat(seen),
            Verb::Stop => self.stop(Cause::OperatorStop, seen, answers),
            Verb::Terminate => {
                self.ending = true;
                self.stop(Cause::Terminated, seen, answers)
            }
            Verb::Reset => self.reset(seen),
            Verb::EmergencyStop => {
                self.trip(Cause::EmergencyStop, seen.now, answers);
                Ok(())
            }
            // Taken before, whatever the state.
            Verb::SetTarget(_) | Verb::StreamTarget(..) => return,
        };
        answers.push(request.id, verdict.err());
    }

    fn arm(&mut self, request_id: u32, seen: &Observation) -> Result<(), Cause> {
        match self.state {
            State::Armed => Ok(()),
            State::Arming { .. } => Err(Cause::Busy),
            State::SafeStop { cause, .. } | State::Fault { cause } => Err(cause),
            State::Active | State::Holding { .. } => Err(Cause::WrongState),
            State::Boot => Err(self.watch.forbids_leaving_boot(seen).unwrap_or(Cause::WrongState)),
            State::Idle if self.ending => Err(Cause::Ending),
            State::Idle => match self.watch.forbids_arming(self.realtime_missing, seen) {
                Some(cause) => Err(cause),
                None => {
                    self.enter_arming(request_id, seen.now);
                    Ok(())
                }
            },
        }
    }

    fn go(&mut self, seen: &Observation) -> Result<(), Cause> {
        // What would have stopped an active daemon keeps a passive one from going.
        if let (Some(cause), true) = (self.judgements.present, self.state.holds_authority()) {
            return Err(cause);
        }
        match self.state {
            State::Armed => match self.watch.forbids_steering(seen) {
                Some(cause) => Err(cause),
                None => {
                    self.watch.note_motion(seen);
                    self.enter_active();
                    Ok(())
                }
            },
            State::Active => Ok(()),
            // Another target is needed, or a retreat.
            State::Holding { near_snap: NearSnap::Kept | NearSnap::Retreating, .. } => {
                Err(Cause::NearSnapThrough)
            }
            State::Holding { sensing_lost, .. } => {
                self.cause = self.cause.filter(|cause| *cause != Cause::StreamEnded);
                if sensing_lost {
                    self.enter_holding(false, true, NearSnap::No);
                } else {
                    self.enter_active();
                }
                Ok(())
            }
            State::SafeStop { cause, .. } | State::Fault { cause } => Err(cause),
            State::Boot | State::Idle | State::Arming { .. } => Err(Cause::WrongState),
        }
    }

    fn hold(&mut self) -> Result<(), Cause> {
        match self.state {
            State::Active => self.enter_holding(true, false, NearSnap::No),
            State::Holding { sensing_lost, near_snap: NearSnap::Retreating, .. } => {
                self.cause = Some(Cause::NearSnapThrough);
                self.enter_holding(true, sensing_lost, NearSnap::Kept);
            }
            State::Holding { sensing_lost, near_snap, .. } => {
                self.enter_holding(true, sensing_lost, near_snap);
            }
            State::SafeStop { cause, .. } | State::Fault { cause } => return Err(cause),
            State::Boot | State::Idle | State::Arming { .. } | State::Armed => return Err(Cause::WrongState),
        }
        Ok(())
    }

    fn retreat(&mut self, seen: &Observation) -> Result<(), Cause> {
        match self.state {
            State::Holding { near_snap: NearSnap::Retreating, .. } => Ok(()),
            State::Holding { near_snap: NearSnap::Kept, .. } if seen.trail_ended => {
                Err(Cause::NearSnapThrough)
            }
            State::Holding { by_operator, sensing_lost, near_snap: NearSnap::Kept } => {
                self.cause = Some(Cause::Retreating);
                self.enter_holding(by_operator, sensing_lost, NearSnap::Retreating);
                Ok(())
            }
            State::SafeStop { cause, .. } | State::Fault { cause } => Err(cause),
            _ => Err(Cause::WrongState),
        }
    }

    fn stop(&mut self, cause: Cause, seen: &Observation, answers: &mut Answers) -> Result<(), Cause> {
        match self.state {
            State::Boot | State::Idle => {}
            // Whoever asks for a stop does not want to wait.
            State::SafeStop { since, hold_until, cause } => {
                self.enter_safe_stop(cause, since, hold_until.min(seen.now));
            }
            State::Arming { request_id, .. } => {
                answers.refuse(request_id, cause);
                self.enter_idle(seen.now);
            }
            State::Armed | State::Active | State::Holding { .. } => {
                self.enter_safe_stop(cause, seen.now, seen.now);
            }
            State::Fault { cause } => return Err(cause),
        }
        Ok(())
    }

    fn reset(&mut self, seen: &Observation) -> Result<(), Cause> {
        match self.state {
            State::Idle => {
                self.cause = None;
                self.judgements.forget();
            }
            State::Fault { cause } => {
                // The latched cause may be over while a milder one holds.
                let present = self.watch.persists(cause, seen).then_some(cause);
                if let Some(cause) = present.or(self.watch.trip(&self.state, self.epoch, seen).acts) {
                    return Err(cause);
                }
                self.enter_idle(seen.now);
                self.cause = None;
                self.judgements.forget();
            }
            _ => return Err(Cause::WrongState),
        }
        Ok(())
    }
}
