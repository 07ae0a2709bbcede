//! The whole rig, advanced by one fixed step at a time. Start reading here.
//!
//! ```text
//! command ──▶ guard ──▶ amplifiers ──▶ currents ─┐
//!                  └──▶ motors ─────▶ angles ────┴──▶ field ──▶ rod ──▶ sensor ──▶ poses
//! ```
//!
//! Time is what the caller says: the plant has a clock of its own that each step advances, and never
//! reads the machine's. After construction nothing here allocates.

use std::time::Duration;

use magsteer_hal::message::driver_state;
use magsteer_hal::{
    Actuation, CoilCommand, CoilFeedback, CommandGuard, HardwareDescription, PoseMessage, Refusal, Setpoint,
    Stamp,
};

use crate::actuation::{ActuationSettings, Actuators, CoilCondition, Fault, FrameCondition, fault_code};
use crate::errors::ErrorMagnitudes;
use crate::field::{CoilArray, CoilTruth};
use crate::ramp::{Ramp, RampWatch};
use crate::rod::{Pose, Rod, RodSettings, Stepping};
use crate::sensing::{PoseSensor, SensorError, SensorSettings, message_of};

/// Everything that a plant is built from, validated.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Everything random comes from it.
    pub seed: u64,
    /// The fixed step.
    pub step: Duration,
    /// Mesh and damping of the rod.
    pub rod: RodSettings,
    /// Amplifiers and motors.
    pub actuation: ActuationSettings,
    /// What each coil is in truth, in the order of the description.
    pub coil_truths: Vec<CoilTruth>,
    /// How far the true parameters are off.
    pub errors: ErrorMagnitudes,
    /// The sensor that is mounted.
    pub sensor: SensorSettings,
}

/// Why a plant could not be built.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// Nothing that moves has mass.
    #[error("the manipulator has no mass")]
    Weightless,
    /// The rod did not come to rest under its own weight.
    #[error("the manipulator does not come to rest under its own weight")]
    NoRest,
    /// The sensor cannot be mounted on this manipulator.
    #[error(transparent)]
    Sensor(#[from] SensorError),
}

/// What happened since the plant was built.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Counts {
    /// Steps taken.
    pub steps: u64,
    /// Steps whose equations were not solved; the rod was stopped where it was.
    pub steps_unsolved: u64,
    /// Steps in which a magnet was nearer to a driven coil than its series holds.
    pub steps_outside_field_model: u64,
    /// Largest magnitude of any coil's current, A.
    pub current_max: f64,
    /// Highest temperature of any coil, K; `None` before the first step and on a rig without any.
    pub coil_temperature_max: Option<f64>,
    /// Faults that the driver found with its own hardware.
    pub driver_faults: u64,
    /// The last of them.
    pub last_driver_fault: Option<Fault>,
}

/// The simulated rig.
#[derive(Debug, Clone)]
pub struct Plant {
    now: Stamp,
    step: Duration,
    guard: CommandGuard,
    actuators: Actuators,
    array: CoilArray,
    rod: Rod,
    sensor: PoseSensor,
    ramp: RampWatch,
    counts: Counts,
}

impl Plant {
    /// A plant at rest under gravity, without current, its clock at zero. It is driven as `description` says,
    /// and is in truth what `nominal` says, before its errors.
    ///
    /// # Errors
    /// When the manipulator has no mass, finds no rest, or cannot carry the sensor.
    pub fn new(
        description: &HardwareDescription,
        nominal: &HardwareDescription,
        settings: &Settings,
    ) -> Result<Self, PlantError> {
        let step = settings.step.as_secs_f64();
        let sensor =
            PoseSensor::new(&settings.sensor, &description.manipulator, settings.seed, Stamp::default())?;
        let parameters = settings.errors.apply(nominal, settings.seed);
        let actuators = Actuators::new(description, &settings.actuation, step, settings.seed);
        let actual = actuators.actual();
        let mut array = CoilArray::new(nominal, &settings.coil_truths, &parameters.coils);
        array.actuate(actuators.field_currents(), &actual.angle_rad);
        let undamped = Stepping { step, retardation: 0.0 };
        let mut rod = Rod::new(&parameters.manipulator, nominal.gravity, settings.rod.meshing, undamped);
        rod.set_magnet_interaction(settings.rod.magnet_interaction);
        rod.set_contact(settings.rod.contact.clone());
        if rod.moving_mass() <= 0.0 {
            return Err(PlantError::Weightless);
        }
        if !rod.settle(|point| array.at(point)) {
            return Err(PlantError::NoRest);
        }
        let mode = rod.first_mode().ok_or(PlantError::NoRest)?;
        let retardation = mode.retardation(settings.rod.first_mode_damping_ratio);
        rod.set_stepping(Stepping { step, retardation });
        Ok(Self {
            now: Stamp::default(),
            step: settings.step,
            guard: CommandGuard::new(description, &actuators.measured().angle_rad),
            actuators,
            array,
            rod,
            sensor,
            ramp: RampWatch::default(),
            counts: Counts::default(),
        })
    }

    /// The plant's clock.
    #[must_use]
    pub fn now(&self) -> Stamp {
        self.now
    }

    /// The fixed step.
    #[must_use]
    pub fn step_duration(&self) -> Duration {
        self.step
    }

    /// Sets the clock without anything moving: at the start, and over time that is left out.
    /// Exposures under way are lost.
    pub fn set_clock(&mut self, now: Stamp) {
        self.now = now;
        self.sensor.restart(now);
    }

    /// Hands over a received command; `now` is the receiver's clock.
    ///
    /// # Errors
    /// Why the guard does not obey it; it has been counted.
    pub fn offer(&mut self, command: &CoilCommand, now: Stamp) -> Result<(), Refusal> {
        self.guard.offer(command, now)?;
        self.ramp.command_accepted(now);
        Ok(())
    }

    /// Advances everything by one fixed step.
    pub fn advance(&mut self) {
        self.advance_through(|setpoint, _| *setpoint);
    }

    /// As [`Plant::advance`], with `alter` between the guard's set point of the new time and what amplifiers and motors
    /// follow: where faults of actuators act.
    pub fn advance_through(&mut self, alter: impl FnOnce(&Setpoint, Stamp) -> Setpoint) {
        self.now = self.now.after(self.step);
        let setpoint = self.guard.setpoint(self.now, self.step.as_secs_f64());
        let found = self.actuators.obey(&alter(&setpoint, self.now), &setpoint);
        if self.actuators.fault().is_some() {
            // As long as it stands: a claim meanwhile is granted nothing.
            self.guard.trip();
        }
        self.array.actuate(self.actuators.field_currents(), &self.actuators.actual().angle_rad);
        let array = &self.array;
        let solve = self.rod.step(|point| array.at(point));
        self.count(solve.converged, found);
        self.ramp.step(self.is_driven(), &self.actuators.actual().current_a, self.now);
        if self.sensor.wants_exposure(self.now) {
            self.sensor.expose(&self.rod, self.now);
        }
    }

    /// Advances by whole steps as far as `until` allows.
    pub fn advance_to(&mut self, until: Stamp) {
        while self.now.after(self.step) <= until {
            self.advance();
        }
    }

    /// The oldest pose message that the sensor has ready, if any; its header has only the source stamp.
    pub fn take_pose(&mut self) -> Option<PoseMessage> {
        self.sensor.take_due(self.now)
    }

    /// Measured currents and angles, the driver's fault and the guard's state at the plant's clock; the header
    /// has only the source stamp.
    #[must_use]
    pub fn feedback(&self) -> CoilFeedback {
        let mut feedback = CoilFeedback {
            measured: *self.actuators.measured(),
            fault: self.actuators.fault().map_or(fault_code::NONE, Fault::code),
            ..CoilFeedback::default()
        };
        self.guard.report(&mut feedback);
        feedback.header.source_stamp_ns = self.now.nanoseconds();
        feedback
    }

    /// True poses at the plant's clock; the header has only the source stamp.
    #[must_use]
    pub fn truth(&self) -> PoseMessage {
        let poses = (0..self.rod.magnet_count()).map(|index| self.rod.magnet_pose(index));
        let mut message = message_of(poses);
        message.header.source_stamp_ns = self.now.nanoseconds();
        message
    }

    /// True pose of the free end.
    #[must_use]
    pub fn tip(&self) -> Pose {
        self.rod.tip_pose()
    }

    /// The true rod.
    #[must_use]
    pub fn rod(&self) -> &Rod {
        &self.rod
    }

    /// True currents and angles.
    #[must_use]
    pub fn actual(&self) -> &Actuation {
        self.actuators.actual()
    }

    /// The guard, with its counts.
    #[must_use]
    pub fn guard(&self) -> &CommandGuard {
        &self.guard
    }

    /// True while somebody holds authority.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        self.guard.state() == driver_state::DRIVEN
    }

    /// What happened so far.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// The last way to zero current after authority was lost or given up, once it is complete.
    #[must_use]
    pub fn last_ramp(&self) -> Option<Ramp> {
        self.ramp.last()
    }

    /// The longest way to zero so far, from the last command that was obeyed; zero without any.
    #[must_use]
    pub fn longest_ramp(&self) -> Duration {
        self.ramp.longest_from_last_command()
    }

    /// True when no coil carries a current worth speaking of ([`crate::ramp::CURRENT_ZERO`]).
    #[must_use]
    pub fn is_currentless(&self) -> bool {
        crate::ramp::is_zero(&self.actuators.actual().current_a)
    }

    /// Coils, amplifiers, motors and the driver's watch over them.
    #[must_use]
    pub fn actuators(&self) -> &Actuators {
        &self.actuators
    }

    /// Sets what is wrong with a coil or its amplifier from now on. False, and nothing done, when there is no
    /// such coil or the condition is [not valid](CoilCondition::is_valid).
    pub fn set_coil_condition(&mut self, coil: usize, condition: CoilCondition) -> bool {
        self.actuators.set_coil_condition(coil, condition)
    }

    /// Sets what is wrong with a frame from now on. False when there is no such frame.
    pub fn set_frame_condition(&mut self, frame: usize, condition: FrameCondition) -> bool {
        self.actuators.set_frame_condition(frame, condition)
    }

    /// Cuts the amplifiers.
    pub fn trip(&mut self) {
        self.guard.trip();
    }

    /// Holds currents (A) and angles (rad) as given, without amplifiers, motors or limits, and lets the rod come to
    /// rest there: the equilibrium to compare with statics. Returns whether it did.
    pub fn settle_at(&mut self, actuation: &Actuation) -> bool {
        self.array.actuate(&actuation.current_a, &actuation.angle_rad);
        let array = &self.array;
        self.rod.settle(|point| array.at(point))
    }

    fn count(&mut self, is_solved: bool, found: Option<Fault>) {
        self.counts.steps += 1;
        self.counts.steps_unsolved += u64::from(!is_solved);
        self.counts.steps_outside_field_model += u64::from(!self.rod.field_was_valid());
        for current in self.actuators.actual().current_a {
            self.counts.current_max = self.counts.current_max.max(current.abs());
        }
        if let Some((_, hottest)) = self.actuators.hottest() {
            let most = self.counts.coil_temperature_max.unwrap_or(hottest);
            self.counts.coil_temperature_max = Some(most.max(hottest));
        }
        self.counts.driver_faults += u64::from(found.is_some());
        self.counts.last_driver_fault = found.or(self.counts.last_driver_fault);
    }
}
