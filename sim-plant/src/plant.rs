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
    Actuation, COILS_MAX, CoilCommand, CoilFeedback, CommandGuard, HardwareDescription, POSE_PARAMETERS_MAX,
    PoseMessage, Refusal, Setpoint, Stamp,
};

use crate::circuit::Amplifier;
use crate::errors::ErrorMagnitudes;
use crate::field::CoilArray;
use crate::motor::Motor;
use crate::ramp::{Ramp, RampWatch};
use crate::rod::{Meshing, Pose, Rod, Stepping};
use crate::sensor::{PoseSensor, SensorCharacter, message_of};

/// Everything that a plant is built from, validated.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Everything random comes from it.
    pub seed: u64,
    /// The fixed step.
    pub step: Duration,
    /// How finely the rod is cut.
    pub meshing: Meshing,
    /// Damping ratio of the rod's first mode about rest.
    pub first_mode_damping_ratio: f64,
    /// Of the current controllers, rad/s.
    pub amplifier_bandwidth: f64,
    /// How far the true parameters are off.
    pub errors: ErrorMagnitudes,
    /// The sensor that is mounted.
    pub sensor: SensorCharacter,
}

/// Why a plant could not be built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PlantError {
    /// Nothing that moves has mass.
    #[error("the manipulator has no mass")]
    Weightless,
    /// The rod did not come to rest under its own weight.
    #[error("the manipulator does not come to rest under its own weight")]
    NoRest,
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
}

/// The simulated rig.
#[derive(Debug, Clone)]
pub struct Plant {
    now: Stamp,
    step: Duration,
    guard: CommandGuard,
    amplifiers: Vec<Amplifier>,
    motors: Vec<Motor>,
    measured: Actuation,
    array: CoilArray,
    rod: Rod,
    sensor: PoseSensor,
    ramp: RampWatch,
    counts: Counts,
}

impl Plant {
    /// A plant at rest under gravity, without current, its clock at zero.
    ///
    /// # Errors
    /// When the manipulator has no mass, or finds no rest.
    pub fn new(description: &HardwareDescription, settings: &Settings) -> Result<Self, PlantError> {
        let step = settings.step.as_secs_f64();
        let parameters = settings.errors.apply(description, settings.seed);
        let motors: Vec<_> = description.frames.iter().map(|frame| Motor::new(frame, step)).collect();
        let mut measured = Actuation::default();
        for (angle, motor) in measured.angle_rad.iter_mut().zip(&motors) {
            *angle = motor.angle();
        }
        let mut array = CoilArray::new(description, &parameters.coil_gains);
        array.actuate(&measured.current_a, &measured.angle_rad);
        let undamped = Stepping { step, retardation: 0.0 };
        let mut rod = Rod::new(&parameters.manipulator, description.gravity, settings.meshing, undamped);
        if rod.moving_mass() <= 0.0 {
            return Err(PlantError::Weightless);
        }
        if !rod.settle(|point| array.at(point)) {
            return Err(PlantError::NoRest);
        }
        let mode = rod.first_mode().ok_or(PlantError::NoRest)?;
        let retardation = mode.retardation(settings.first_mode_damping_ratio);
        rod.set_stepping(Stepping { step, retardation });
        let amplifier = |coil| Amplifier::new(coil, settings.amplifier_bandwidth, step);
        Ok(Self {
            now: Stamp::default(),
            step: settings.step,
            guard: CommandGuard::new(description, &measured.angle_rad),
            amplifiers: description.coils.iter().map(amplifier).collect(),
            motors,
            measured,
            array,
            rod,
            sensor: PoseSensor::new(settings.sensor, settings.seed, Stamp::default()),
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
        self.now = self.now.after(self.step);
        let setpoint = self.guard.setpoint(self.now, self.step.as_secs_f64());
        self.drive(&setpoint);
        self.array.actuate(&self.measured.current_a, &self.measured.angle_rad);
        let array = &self.array;
        let solve = self.rod.step(|point| array.at(point));
        self.count(solve.converged);
        self.ramp.step(self.is_driven(), &self.measured.current_a, self.now);
        if self.sensor.wants_exposure(self.now) {
            let rod = &self.rod;
            let poses = (0..rod.magnet_count()).map(|index| rod.magnet_pose(index));
            self.sensor.expose(poses, self.now);
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

    /// Currents, angles and the guard's state at the plant's clock; the header has only the source stamp.
    #[must_use]
    pub fn feedback(&self) -> CoilFeedback {
        let mut feedback = CoilFeedback { measured: self.measured, ..CoilFeedback::default() };
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

    /// True currents and angles.
    #[must_use]
    pub fn measured(&self) -> &Actuation {
        &self.measured
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

    /// True when no coil carries a current worth speaking of ([`crate::ramp::CURRENT_ZERO`]).
    #[must_use]
    pub fn is_currentless(&self) -> bool {
        crate::ramp::is_zero(&self.measured.current_a)
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

    fn drive(&mut self, setpoint: &Setpoint) {
        let wanted: &Actuation = setpoint.actuation();
        let is_cut = matches!(setpoint, Setpoint::Disable(_));
        let currents: &mut [f64; COILS_MAX] = &mut self.measured.current_a;
        for ((amplifier, wanted), current) in self.amplifiers.iter_mut().zip(&wanted.current_a).zip(currents)
        {
            if is_cut {
                amplifier.discharge();
            } else {
                amplifier.follow(*wanted);
            }
            *current = amplifier.current();
        }
        let angles: &mut [f64; POSE_PARAMETERS_MAX] = &mut self.measured.angle_rad;
        for ((motor, wanted), angle) in self.motors.iter_mut().zip(&wanted.angle_rad).zip(angles) {
            motor.follow(*wanted);
            *angle = motor.angle();
        }
    }

    fn count(&mut self, is_solved: bool) {
        self.counts.steps += 1;
        self.counts.steps_unsolved += u64::from(!is_solved);
        self.counts.steps_outside_field_model += u64::from(!self.rod.field_was_valid());
        for current in self.measured.current_a {
            self.counts.current_max = self.counts.current_max.max(current.abs());
        }
    }
}
