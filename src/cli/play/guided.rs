//! A session that is led: every step on a way that is planned from where the rig is.

use std::time::{Duration, Instant};

use anyhow::anyhow;
use magsteer::config::Until;
use magsteer::control::plan::{Guide, Leg, Order, Stance, Told};
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::{StopFlag, view};
use magsteer_hal::Stamp;
use magsteer_hal::operator::{Cause, OperatorRequest, StatusMessage, state, verb, verdict};

use super::session::{POLL, Seen, Session, UnderWay, stopped};
use super::watched::Watched;
use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::target_request;
use crate::cli::output;

/// Time at a waypoint on the way, for the rod to come to rest.
const PASS: Duration = Duration::from_millis(500);
/// How long the magnets may take to settle once the reference is at the target.
const SETTLE_MAX: Duration = Duration::from_secs(3);
/// How long a leg may take: frames turn half a turn in four seconds.
const LEG_MAX: Duration = Duration::from_secs(20);
/// How long a retreat may take: longer than the way that a daemon remembers.
const RETREAT_MAX: Duration = Duration::from_secs(30);
/// How long a hold lasts that ends by itself, at most: sensing that does not come back stops the daemon sooner.
const HOLD_MAX: Duration = Duration::from_secs(1);
/// How long to wait until the daemon is in another state: a ramp to zero takes some tenths of a second.
const STATE_WAIT: Duration = Duration::from_secs(10);

impl Session {
    /// Carries out the orders of `guide`, which has set out, to the end of a step; `None` when it was broken off. A step lasts for its
    /// duration once the magnets are there, or ends then if it is to end when they have settled. One that is given up ends so.
    ///
    /// # Errors
    /// When the daemon refuses what is asked, stops steering or falls silent.
    pub(super) fn lead(
        &mut self,
        guide: &mut Guide,
        under_way: &UnderWay<'_>,
    ) -> anyhow::Result<Option<StepResponse>> {
        let mut watched = Watched::new(Stamp::now(), under_way.target);
        loop {
            let status = self.free_status()?;
            let order = match guide.order(&stance(&status)) {
                Ok(Some(order)) => order,
                Ok(None) => return self.stay(under_way, &mut watched),
                Err(given_up) => {
                    output::note(format_args!("{}: {given_up}", under_way.label));
                    // So that there is something to judge, however soon it was given up.
                    return self.see(under_way, &mut watched, PASS);
                }
            };
            let told = match order {
                Order::Release => {
                    output::note(format_args!(
                        "{}: no way leads on from here: the currents are let go, and the next way begins at rest",
                        under_way.label
                    ));
                    if !self.release(under_way.stop)? {
                        return Ok(None);
                    }
                    Told::Released
                }
                Order::Retreat => {
                    let Some(told) = self.retreat(under_way, &mut watched)? else { return Ok(None) };
                    told
                }
                Order::Steer(leg) => {
                    let Some(told) = self.go(&leg, under_way, &mut watched)? else { return Ok(None) };
                    match told {
                        Told::Refused => output::note(format_args!(
                            "{}: the daemon refused a leg of the way, which is planned anew",
                            under_way.label
                        )),
                        Told::Missed => output::note(format_args!(
                            "{}: the way ended beside its goal, and is planned anew",
                            under_way.label
                        )),
                        Told::Held => output::note(format_args!(
                            "{}: the daemon holds near a snap-through: it goes back along its way, which is planned anew",
                            under_way.label
                        )),
                        Told::Arrived | Told::Retreated | Told::Released => {}
                    }
                    told
                }
            };
            guide.tell(told);
        }
    }

    /// Sends the loop along a leg; what became of it, `None` when it was broken off.
    fn go(
        &mut self,
        leg: &Leg,
        under_way: &UnderWay<'_>,
        watched: &mut Watched,
    ) -> anyhow::Result<Option<Told>> {
        self.send(target_request(&leg.waypoint.target(), under_way.rig), "target")?;
        let begin = Instant::now();
        let mut arrived = None;
        let mut told = Some(Told::Missed);
        let mut held_since = None;
        let stay = if leg.is_last { SETTLE_MAX } else { PASS };
        let seen = self.see_through(under_way, watched, |watched, status| {
            if status.target_verdict == verdict::REFUSED {
                told = Some(Told::Refused);
                return Seen::Refused { has_begun: false };
            }
            held_since = is_held_by_hand(status).then(|| held_since.unwrap_or_else(Instant::now));
            if held_since.is_some_and(|since: Instant| since.elapsed() > HOLD_MAX) {
                told = None;
                return Seen::Over;
            }
            let is_there = leg.has_arrived(&status.desired_direction, &status.admitted);
            let holds = status.cause == Cause::NearSnapThrough.code();
            arrived = if is_there || holds { arrived.or(Some(Instant::now())) } else { None };
            let has_stayed = arrived.is_some_and(|arrived| arrived.elapsed() >= stay);
            let is_done =
                if leg.is_last { (is_there || holds) && watched.judge.has_settled() } else { has_stayed };
            if is_done {
                told = Some(Told::Arrived);
            }
            // Held where the magnets are at the target already, they may settle there.
            let is_held = holds && !is_there && !(leg.is_last && watched.judge.is_within());
            if is_held {
                told = Some(Told::Held);
            }
            let is_over = is_done || is_held || has_stayed || begin.elapsed() >= LEG_MAX;
            if is_over { Seen::Over } else { Seen::UnderWay }
        })?;
        match (seen, told) {
            (None, _) => Ok(None),
            (Some(_), Some(told)) => Ok(Some(told)),
            (Some(_), None) => Err(held_by_hand()),
        }
    }

    /// Has the daemon go back from a hold near a snap-through, as far as it can; `None` when it was broken off.
    fn retreat(&mut self, under_way: &UnderWay<'_>, watched: &mut Watched) -> anyhow::Result<Option<Told>> {
        // One that no longer holds, or has nothing to go back along, refuses, and is planned with as it stands.
        let request = OperatorRequest { verb: verb::RETREAT, ..OperatorRequest::default() };
        if self.ask(request, "retreat")?.accepted == 0 {
            return Ok(Some(Told::Retreated));
        }
        let begin = Instant::now();
        let mut ended = None;
        let seen = self.see_through(under_way, watched, |_, status| {
            let goes = status.cause == Cause::Retreating.code();
            ended = if goes { None } else { ended.or(Some(Instant::now())) };
            let is_at_rest = ended.is_some_and(|ended| ended.elapsed() >= PASS);
            if is_at_rest || begin.elapsed() >= RETREAT_MAX { Seen::Over } else { Seen::UnderWay }
        })?;
        Ok(seen.map(|_| Told::Retreated))
    }

    /// The status of a daemon that steers, and that nobody holds.
    fn free_status(&mut self) -> anyhow::Result<StatusMessage> {
        const AFTER_A_LEG: [u32; 5] =
            [state::ACTIVE, state::HOLDING, state::IDLE, state::SAFE_STOP, state::FAULT];
        let begin = Instant::now();
        loop {
            let status = self.wait_for(&AFTER_A_LEG, STATE_WAIT)?;
            if !matches!(status.state, state::ACTIVE | state::HOLDING) {
                return Err(stopped(&status));
            }
            if !is_held_by_hand(&status) {
                return Ok(status);
            }
            if begin.elapsed() > HOLD_MAX {
                return Err(held_by_hand());
            }
            std::thread::sleep(POLL);
        }
    }

    /// Lets the currents go to zero, then arms and goes; false, and the daemon left idle, when it was broken off.
    fn release(&mut self, stop: &StopFlag) -> anyhow::Result<bool> {
        self.request(verb::STOP, "stop")?;
        self.wait_for(&[state::IDLE], STATE_WAIT)?;
        if stop.requested().is_some() {
            return Ok(false);
        }
        self.arm(STATE_WAIT)?;
        self.request(verb::GO, "go")?;
        self.wait_for(&[state::ACTIVE, state::HOLDING], STATE_WAIT)?;
        Ok(true)
    }

    /// Stays at a target that was reached.
    fn stay(
        &mut self,
        under_way: &UnderWay<'_>,
        watched: &mut Watched,
    ) -> anyhow::Result<Option<StepResponse>> {
        if under_way.step.until == Some(Until::Settled) {
            return Ok(Some(watched.judge.verdict()));
        }
        self.see(under_way, watched, Duration::from_secs_f64(under_way.step.duration_s))
    }

    /// Watches for a time.
    fn see(
        &mut self,
        under_way: &UnderWay<'_>,
        watched: &mut Watched,
        time: Duration,
    ) -> anyhow::Result<Option<StepResponse>> {
        let begin = Instant::now();
        let seen = self.see_through(under_way, watched, |_, _| {
            if begin.elapsed() >= time { Seen::Over } else { Seen::UnderWay }
        })?;
        Ok(seen.map(|_| watched.judge.verdict()))
    }
}

/// True when the daemon holds, and not because a snap-through is near: because somebody asked it to, or for a moment without sensing.
fn is_held_by_hand(status: &StatusMessage) -> bool {
    status.state == state::HOLDING && status.cause != Cause::NearSnapThrough.code()
}

/// Whoever holds the rig has the last word.
fn held_by_hand() -> anyhow::Error {
    let message = anyhow!("the daemon holds, and is not led on: `magsteer go`, then once more");
    Failure::with(Exit::No, message)
}

fn stance(status: &StatusMessage) -> Stance {
    Stance {
        equilibrium: view::equilibrium(status),
        predicted: status.predicted_direction,
        measured: status.measured_direction,
        gains: status.coil_gain,
    }
}
