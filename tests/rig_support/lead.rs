//! A loop in lockstep that a guide leads from target to target, judged by the plant's truth.

use std::ops::ControlFlow;
use std::time::Instant;

use magsteer::control::plan::{Guide, Leg, Order, Planner, Stance, Told};
use magsteer::control::{Directions, Verdict};
use magsteer::daemon::step_response::{Judge, Observation};
use magsteer::daemon::{CycleRecord, Verb};
use magsteer::math::angle_between;
use magsteer_hal::PoseMessage;
use magsteer_hal::operator::{Cause, state};
use nalgebra::Vector3;

use super::{Bench, Setup};

const MAGNETS: usize = 2;
/// Time at a waypoint on the way after the reference has arrived, s.
const PASS: f64 = 0.5;
/// Time at a target after the reference has arrived, s.
const STAY: f64 = 2.0;
/// Cycles until a request shows: the first one takes it.
const BEGUN: f64 = 3.0;
/// Longest time of a leg, s: frames turn half a turn in four.
const LEG_MAX: f64 = 15.0;
/// Time for the currents to go and the rod to rest, s.
const RELEASE: f64 = 3.0;
/// Longest time of a retreat, s: what the loop remembers of its way.
const RETREAT_MAX: f64 = 25.0;
/// Speed of a magnet that no leg asks for, rad/s: the rod has snapped, or shakes.
const SNAP_SPEED: f64 = 500.0_f64.to_radians();

/// A loop that a guide leads on the simulated plant.
pub struct Lead<'a> {
    setup: &'a Setup,
    planner: Planner,
    guide: Guide,
    bench: Bench,
    /// Targets at which the magnets settled on the first way.
    pub at_first: usize,
    /// How often the currents were let go.
    pub released: usize,
    /// How often the loop stopped by itself.
    pub stopped: usize,
    /// Legs on which a magnet turned as fast as no leg asks for while the loop steered it: a rod whose currents are let go swings home.
    pub snapped: usize,
    /// Longest time that the guide took for an order, s.
    pub slowest_order: f64,
}

impl<'a> Lead<'a> {
    /// A rig that steers, at rest.
    pub fn new(setup: &'a Setup, planner: Planner) -> Self {
        Self {
            guide: Guide::new(planner.clone()),
            bench: started(setup),
            setup,
            planner,
            at_first: 0,
            released: 0,
            stopped: 0,
            snapped: 0,
            slowest_order: 0.0,
        }
    }

    /// Leads to a target; true when the magnets have settled there by the plant's truth, and what is to be told of the way. A loop that
    /// stopped by itself is followed by a new rig at rest.
    pub fn to(&mut self, target: &Directions) -> (bool, Vec<String>) {
        self.guide.set_out(target);
        let mut story = Vec::new();
        let settled = loop {
            let stance = stance(&self.bench.lockstep.cycle());
            let clock = Instant::now();
            let order = self.guide.order(&stance);
            self.slowest_order = self.slowest_order.max(clock.elapsed().as_secs_f64());
            match order {
                Ok(None) => break true,
                Err(given_up) => {
                    story.push(given_up.to_string());
                    break false;
                }
                Ok(Some(Order::Release)) => {
                    self.release();
                    story.push("released".to_owned());
                    self.guide.tell(Told::Released);
                }
                Ok(Some(Order::Retreat)) => {
                    story.push(format!("went back to margin {:.2}", self.retreat()));
                    self.guide.tell(Told::Retreated);
                }
                Ok(Some(Order::Steer(leg))) => {
                    let (told, words) = self.steer(&leg);
                    story.extend(words);
                    self.guide.tell(told);
                }
            }
            if !steers(&self.bench) {
                story.push(format!("stopped: {:?}", self.bench.lockstep.cycle().decision.cause));
                self.stopped += 1;
                self.bench = started(self.setup);
                self.guide = Guide::new(self.planner.clone());
                break false;
            }
        };
        self.at_first += usize::from(settled && story.is_empty());
        (settled, story)
    }

    /// Lets the currents go and arms again.
    fn release(&mut self) {
        self.released += 1;
        self.bench.request(Verb::Stop);
        self.run(RELEASE, |_, _, _| ControlFlow::Continue(()));
        let _ = self.bench.lockstep.play(&[], |rig| rig.plant().truth(), |_| ControlFlow::Continue(()));
    }

    /// Goes back from a hold as far as the loop does; the margin there.
    fn retreat(&mut self) -> f64 {
        self.bench.request(Verb::Retreat);
        let begun = BEGUN * self.period();
        self.run(RETREAT_MAX, |record, time, _| {
            let is_over = time > begun && record.decision.cause != Some(Cause::Retreating);
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        self.run(PASS, |_, _, _| ControlFlow::Continue(()));
        self.bench.lockstep.cycle().outcome.model.margin
    }

    /// Steers along a leg; what is to be told besides.
    fn steer(&mut self, leg: &Leg) -> (Told, Option<String>) {
        self.bench.request(Verb::SetTarget(leg.waypoint.target()));
        let Seen { told, error_deg, verdict } = self.watch(leg);
        let place = if leg.is_last { "" } else { "on the way " };
        let words = match told {
            Told::Refused => Some(format!("{verdict:?}")),
            Told::Missed => Some(format!("{error_deg:.1?} deg beside it, {verdict:?}")),
            Told::Held => Some("held near a snap-through".to_owned()),
            Told::Arrived | Told::Retreated | Told::Released => None,
        };
        let words = words.map(|words| format!("{place}{words}"));
        (told, words)
    }

    /// Runs the loop until the leg is gone or refused, or the time is over.
    fn watch(&mut self, leg: &Leg) -> Seen {
        let mut judge = Judge::new(&leg.waypoint.directions[..MAGNETS]);
        let mut seen = Seen { told: Told::Missed, error_deg: Vec::new(), verdict: Verdict::Unchecked };
        let (mut arrived, begun) = (None, BEGUN * self.period());
        self.run(LEG_MAX, |record, time, tangent| {
            judge.take(&Observation { time, tangent: *tangent, current: 0.0 });
            seen.verdict = record.outcome.verdict;
            let has_begun = time > begun;
            if has_begun && matches!(seen.verdict, Verdict::Refused { .. }) {
                seen.told = Told::Refused;
                return ControlFlow::Break(());
            }
            let is_there = leg.has_arrived(&record.outcome.desired, &record.admitted);
            let holds = has_begun && record.decision.cause == Some(Cause::NearSnapThrough);
            // Held where the magnets are at the target already, they may settle there.
            let is_near = leg.is_last && judge.is_within();
            if holds && !is_there && !is_near {
                seen.told = Told::Held;
                return ControlFlow::Break(());
            }
            arrived = if is_there || holds { arrived.or(Some(time)) } else { None };
            let stay = if leg.is_last { STAY } else { PASS };
            if arrived.is_none_or(|arrived| time < arrived + stay) {
                return ControlFlow::Continue(());
            }
            if !leg.is_last || judge.has_settled() {
                seen.told = Told::Arrived;
            }
            ControlFlow::Break(())
        });
        seen.error_deg = judge.verdict().error_rms_deg;
        seen
    }

    /// Runs the loop for a time, s, or until `each` has seen enough of its cycles, the time since the first one and the magnets'
    /// true tangents.
    fn run(&mut self, most: f64, mut each: impl FnMut(&CycleRecord, f64, &Directions) -> ControlFlow<()>) {
        let (mut time, mut speed) = (0.0, 0.0_f64);
        let mut before: Option<Directions> = None;
        let period = self.period();
        let _ = self.bench.lockstep.run(most, |record, rig| {
            let tangent = tangents(&rig.plant().truth());
            for (before, now) in before.iter().flatten().zip(&tangent).take(MAGNETS) {
                let turned = angle_between(&Vector3::from(*before), &Vector3::from(*now));
                speed = if is_steering(record.decision.state) { speed.max(turned / period) } else { speed };
            }
            before = Some(tangent);
            time += period;
            each(record, time, &tangent)
        });
        self.snapped += usize::from(speed > SNAP_SPEED);
    }

    /// Of the loop, s.
    fn period(&self) -> f64 {
        self.setup.config.daemon.as_ref().expect("has a daemon").period().as_secs_f64()
    }
}

/// What became of a leg.
struct Seen {
    told: Told,
    /// RMS error of each magnet, deg.
    error_deg: Vec<f64>,
    verdict: Verdict,
}

fn started(setup: &Setup) -> Bench {
    let mut bench = Bench::new(setup);
    let _ = bench.lockstep.play(&[], |rig| rig.plant().truth(), |_| ControlFlow::Continue(()));
    bench
}

fn steers(bench: &Bench) -> bool {
    is_steering(bench.lockstep.control_loop().state().code())
}

fn is_steering(code: u32) -> bool {
    matches!(code, state::ACTIVE | state::HOLDING)
}

fn stance(record: &CycleRecord) -> Stance {
    Stance {
        equilibrium: record.outcome.equilibrium,
        predicted: record.outcome.predicted,
        measured: record.outcome.measured,
        gains: record.outcome.gains,
    }
}

fn tangents(poses: &PoseMessage) -> Directions {
    let mut tangents = Directions::default();
    for (tangent, magnet) in tangents.iter_mut().zip(&poses.magnets).take(MAGNETS) {
        *tangent = magnet.tangent();
    }
    tangents
}
