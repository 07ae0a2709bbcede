//! All coils and frames of the rig, followed as one, and the driver that watches over them.

use magsteer_hal::description::HardwareDescription;
use magsteer_hal::{Actuation, COILS_MAX, POSE_PARAMETERS_MAX, Setpoint};

use super::coils::{Coils, CoilsSettings};
use super::condition::{CoilCondition, FrameCondition};
use super::fault::Fault;
use super::motor::{Motor, MotorCharacter};
use super::watch::{DriverWatch, Seen, WatchSettings};

/// What coils, amplifiers, motors and the driver's watch are like.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuationSettings {
    /// Coils and amplifiers.
    pub coils: CoilsSettings,
    /// Frame motors.
    pub motor: MotorCharacter,
    /// Angles at which the frames stand at first, rad.
    pub frame_start: [f64; POSE_PARAMETERS_MAX],
    /// When the driver finds fault.
    pub watch: WatchSettings,
}

/// Coils, amplifiers and motors at work.
#[derive(Debug, Clone)]
pub struct Actuators {
    coils: Coils,
    motors: Vec<Motor>,
    watch: DriverWatch,
    actual: Actuation,
    measured: Actuation,
    field_currents: [f64; COILS_MAX],
}

impl Actuators {
    /// All currents at zero, all frames at rest where they start. `step` in s; sensor errors come from `seed`.
    #[must_use]
    pub fn new(
        description: &HardwareDescription,
        settings: &ActuationSettings,
        step: f64,
        seed: u64,
    ) -> Self {
        let motor = |(frame, start): (_, &f64)| Motor::new(frame, settings.motor, *start, step);
        let mut actuators = Self {
            coils: Coils::new(description, &settings.coils, step, seed),
            motors: description.frames.iter().zip(&settings.frame_start).map(motor).collect(),
            watch: DriverWatch::new(settings.watch, step),
            actual: Actuation::default(),
            measured: Actuation::default(),
            field_currents: [0.0; COILS_MAX],
        };
        actuators.take_note();
        actuators
    }

    /// True currents, and true angles of the frames.
    #[must_use]
    pub fn actual(&self) -> &Actuation {
        &self.actual
    }

    /// Currents and angles as the driver's sensors say.
    #[must_use]
    pub fn measured(&self) -> &Actuation {
        &self.measured
    }

    /// Currents, A, with which coils as described would make the field of these: less than the true ones
    /// where turns are shorted.
    #[must_use]
    pub fn field_currents(&self) -> &[f64; COILS_MAX] {
        &self.field_currents
    }

    /// Follows a set point for one step; the fault that the driver found in it. As long as
    /// [`Actuators::fault`] stands the caller is to cut the bridges.
    pub fn follow(&mut self, setpoint: &Setpoint) -> Option<Fault> {
        self.obey(setpoint, setpoint)
    }

    /// As [`Actuators::follow`], while a fault of the actuators is played: they obey `obeyed`, and the
    /// driver judges them by `asked`, which is what its guard asks for.
    pub fn obey(&mut self, obeyed: &Setpoint, asked: &Setpoint) -> Option<Fault> {
        let is_cut = matches!(obeyed, Setpoint::Disable(_));
        let set = obeyed.actuation();
        self.coils.follow(&set.current_a, is_cut);
        for (motor, set) in self.motors.iter_mut().zip(&set.angle_rad) {
            motor.follow(*set);
        }
        self.take_note();
        self.watch.judge(&Seen {
            wanted: asked.actuation(),
            measured: &self.measured,
            counts: (self.coils.count(), self.motors.len()),
            hottest: self.hottest(),
            is_cut,
        })
    }

    /// The driver's fault that stands, if any.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.watch.fault()
    }

    /// Index and temperature, K, of the hottest coil; `None` on a rig without any.
    #[must_use]
    pub fn hottest(&self) -> Option<(usize, f64)> {
        let temperatures = (0..self.coils.count()).map(|coil| (coil, self.coils.temperature(coil)));
        temperatures.reduce(|hottest, next| if next.1 > hottest.1 { next } else { hottest })
    }

    /// Temperature of a coil's winding, K; `None` when there is no such coil.
    #[must_use]
    pub fn temperature(&self, coil: usize) -> Option<f64> {
        (coil < self.coils.count()).then(|| self.coils.temperature(coil))
    }

    /// The coils, for their circuits.
    #[must_use]
    pub fn coils(&self) -> &Coils {
        &self.coils
    }

    /// Sets what is wrong with a coil from now on. False, and nothing done, when there is no such coil or the
    /// condition is [not valid](CoilCondition::is_valid).
    pub fn set_coil_condition(&mut self, coil: usize, condition: CoilCondition) -> bool {
        let is_possible = coil < self.coils.count() && condition.is_valid();
        if is_possible {
            self.coils.set_condition(coil, condition);
            self.take_note();
        }
        is_possible
    }

    /// Sets what is wrong with a frame from now on. False when there is no such frame.
    pub fn set_frame_condition(&mut self, frame: usize, condition: FrameCondition) -> bool {
        let motor = self.motors.get_mut(frame);
        motor.map(|motor| motor.set_condition(condition)).is_some()
    }

    fn take_note(&mut self) {
        self.actual.current_a = *self.coils.currents();
        self.measured.current_a = *self.coils.measured();
        for (coil, current) in self.field_currents.iter_mut().enumerate().take(self.coils.count()) {
            *current = self.coils.field_current(coil);
        }
        for (frame, motor) in self.motors.iter().enumerate() {
            self.actual.angle_rad[frame] = motor.frame_angle();
            self.measured.angle_rad[frame] = motor.measured_angle();
        }
    }
}
