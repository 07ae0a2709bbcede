//! What stands between a driver and its channels, and between its guard and its amplifiers.

use std::time::Duration;

use crate::description::HardwareDescription;
use crate::guard::Setpoint;
use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
use crate::seeded::Seeded;
use crate::send::HeaderWriter;
use crate::time::Stamp;

use super::checked::{Fault, FaultRefusal};
use super::commands::Commands;
use super::conditions::{ConditionChange, PlantFaults};
use super::content::Possible;
use super::kinds::{FaultTarget, Reach};
use super::plan::{FaultPlan, Scheduled};
use super::setpoints::Setpoints;
use super::slots::{Events, FaultEvent};
use super::stream::{Stream, StreamCounts};

/// Stream of the driver's seed from which faults draw, apart from the streams of its errors and sensors.
const RANDOM_STREAM: u64 = 4;

/// What faults did since the driver's start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FaultCounts {
    /// Faults that began.
    pub begun: u64,
    /// Faults that ended.
    pub ended: u64,
    /// Faults that act now.
    pub active: u64,
    /// Poses.
    pub poses: StreamCounts,
    /// Feedback.
    pub feedback: StreamCounts,
    /// Commands that reached the guard while a fault of commands acted.
    pub commands_altered: u64,
    /// Steps at which the amplifiers were given something else than the guard's set point.
    pub setpoints_altered: u64,
    /// Begins and ends of which nobody was told, because nobody asked in time.
    pub events_lost: u64,
}

/// Makes faults happen. See the [module](super) for what each does.
///
/// Everything that it will ever need is allocated at construction. The first stamp that it is given counts as
/// the driver's start.
#[derive(Debug, Clone)]
pub struct Injector {
    start: Option<Stamp>,
    reach: Reach,
    description: HardwareDescription,
    possible: Possible,
    poses: Stream<PoseMessage>,
    feedback: Stream<CoilFeedback>,
    commands: Commands,
    setpoints: Setpoints,
    plant: PlantFaults,
    events: Events,
}

impl Injector {
    /// The faults of `plan` on the rig of `description`; what is random comes from `seed`.
    #[must_use]
    pub fn new(description: &HardwareDescription, plan: &FaultPlan, seed: u64) -> Self {
        let mut random = Seeded::stream(seed, RANDOM_STREAM);
        let scheduled = plan.scheduled();
        let of = |target: FaultTarget| move |fault: &Fault| fault.target() == target;
        Self {
            start: None,
            reach: plan.reach(),
            description: description.clone(),
            possible: Possible::new(description),
            poses: Stream::new(scheduled, of(FaultTarget::Poses), random.fork()),
            feedback: Stream::new(scheduled, of(FaultTarget::Feedback), random.fork()),
            commands: Commands::new(scheduled),
            setpoints: Setpoints::new(scheduled, random.fork()),
            plant: PlantFaults::new(scheduled),
            events: Events::new(),
        }
    }

    /// Starts the clock of the plan, unless it runs already.
    pub fn start(&mut self, now: Stamp) {
        self.start.get_or_insert(now);
    }

    fn elapsed(&mut self, now: Stamp) -> Duration {
        now.since(*self.start.get_or_insert(now))
    }

    /// How deep faults on request may go.
    #[must_use]
    pub const fn reach(&self) -> Reach {
        self.reach
    }

    /// The rig that it was made for.
    #[must_use]
    pub const fn description(&self) -> &HardwareDescription {
        &self.description
    }

    /// Lets a fault begin now, for a time or until it is cleared.
    ///
    /// # Errors
    /// When too many faults of its target wait or act already, or it is one of the plant and this is not one.
    pub fn begin(&mut self, fault: Fault, lasts: Option<Duration>, now: Stamp) -> Result<(), FaultRefusal> {
        let from = self.elapsed(now);
        let scheduled = Scheduled { fault, from, lasts };
        match fault.target() {
            FaultTarget::Poses => self.poses.push(scheduled),
            FaultTarget::Feedback => self.feedback.push(scheduled),
            FaultTarget::Actuators if fault.befalls_commands() => self.commands.push(scheduled),
            FaultTarget::Actuators => self.setpoints.push(scheduled),
            FaultTarget::Coil | FaultTarget::Frame if self.reach == Reach::Channels => {
                Err(FaultRefusal::PlantOnly { verb: fault.verb().name() })
            }
            FaultTarget::Coil | FaultTarget::Frame => self.plant.push(scheduled),
        }
    }

    /// Ends every fault and forgets those that wait; how many that were.
    pub fn clear(&mut self, now: Stamp) -> usize {
        let elapsed = self.elapsed(now);
        let events = &mut self.events;
        self.poses.slots.clear(elapsed, events)
            + self.feedback.slots.clear(elapsed, events)
            + self.commands.slots.clear(elapsed, events)
            + self.setpoints.slots.clear(elapsed, events)
            + self.plant.slots.clear(elapsed, events)
    }

    /// The driver has poses to publish; their header has only the source stamp and the validity.
    pub fn offer_pose(&mut self, message: PoseMessage, now: Stamp) {
        let elapsed = self.elapsed(now);
        self.poses.offer(message, elapsed, &mut self.events);
    }

    /// The next poses to publish now, complete with the header that `header` writes: ask until there are
    /// none.
    pub fn take_pose(&mut self, header: &mut HeaderWriter, now: Stamp) -> Option<PoseMessage> {
        let elapsed = self.elapsed(now);
        self.poses.take(header, &self.possible, elapsed, now, &mut self.events)
    }

    /// As [`Injector::offer_pose`], for feedback.
    pub fn offer_feedback(&mut self, message: CoilFeedback, now: Stamp) {
        let elapsed = self.elapsed(now);
        self.feedback.offer(message, elapsed, &mut self.events);
    }

    /// As [`Injector::take_pose`], for feedback.
    pub fn take_feedback(&mut self, header: &mut HeaderWriter, now: Stamp) -> Option<CoilFeedback> {
        let elapsed = self.elapsed(now);
        self.feedback.take(header, &self.possible, elapsed, now, &mut self.events)
    }

    /// What the guard is to be offered in place of a received command. An order to cut passes unaltered.
    pub fn command(&mut self, received: &CoilCommand, now: Stamp) -> CoilCommand {
        let elapsed = self.elapsed(now);
        self.commands.pass(received, elapsed, &mut self.events)
    }

    /// What the amplifiers and motors are to follow in place of the guard's set point, `period_s` after the
    /// former call: always within the rig's limits on current, slew, angle and speed. A cut passes at once.
    pub fn setpoint(&mut self, setpoint: &Setpoint, now: Stamp, period_s: f64) -> Setpoint {
        let elapsed = self.elapsed(now);
        self.setpoints.pass(setpoint, &self.possible, elapsed, period_s, &mut self.events)
    }

    /// The next physical condition that the plant is to take on or to lose: ask until there is none.
    pub fn next_condition(&mut self, now: Stamp) -> Option<ConditionChange> {
        let elapsed = self.elapsed(now);
        self.plant.next_change(elapsed, &mut self.events)
    }

    /// The oldest begin or end of a fault that was not taken yet. For outside of the driver's cycle: telling
    /// takes time.
    pub fn take_event(&mut self) -> Option<FaultEvent> {
        self.events.take()
    }

    /// What faults did so far.
    #[must_use]
    pub fn counts(&self) -> FaultCounts {
        let active = self.poses.slots.active_count()
            + self.feedback.slots.active_count()
            + self.commands.slots.active_count()
            + self.setpoints.slots.active_count()
            + self.plant.slots.active_count();
        FaultCounts {
            begun: self.events.begun,
            ended: self.events.ended,
            active: active as u64,
            poses: self.poses.counts,
            feedback: self.feedback.counts,
            commands_altered: self.commands.altered,
            setpoints_altered: self.setpoints.altered,
            events_lost: self.events.lost,
        }
    }
}
