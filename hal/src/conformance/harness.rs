//! What the suite needs of a rig.

use std::time::Duration;

use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::hardware::Hardware;
use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
use crate::time::Stamp;

/// Changes a command just before it is sent at the given stamp, to test how a driver takes it.
pub type Spoil<'a> = &'a dyn Fn(&mut CoilCommand, Stamp);

/// Every message of a stretch of time, unchecked, each with the stamp of its receipt.
#[derive(Debug, Clone, Default)]
pub struct Heard {
    /// Feedback, oldest first.
    pub feedback: Vec<(CoilFeedback, Stamp)>,
    /// Poses, oldest first.
    pub poses: Vec<(PoseMessage, Stamp)>,
}

/// Rates that a driver's author states, Hz.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StatedRates {
    /// Of feedback.
    pub feedback_hz: Option<f64>,
    /// Of poses.
    pub pose_hz: Option<f64>,
}

/// A rig with its clock, as the suite drives it.
pub trait Rig: 'static {
    /// The implementation under test.
    type H: Hardware;

    /// The implementation under test.
    fn hardware(&mut self) -> &mut Self::H;

    /// What the rig is.
    fn description(&self) -> &HardwareDescription;

    /// Time as the rig's stamps count it.
    fn now(&self) -> Stamp;

    /// Lets time pass, stepped or real. When it returns, the driver has taken the newest command, lived through
    /// `duration` and published feedback, and poses if its sensor made any.
    fn advance(&mut self, duration: Duration);

    /// Makes the sensor side publish exactly these poses; false when the rig cannot.
    fn inject_pose(&mut self, message: PoseMessage) -> bool {
        let _ = message;
        false
    }

    /// Makes the driver publish exactly this feedback; false when the rig cannot.
    fn inject_feedback(&mut self, message: CoilFeedback) -> bool {
        let _ = message;
        false
    }

    /// Sends `command` after `spoil` changed its message; false when the rig cannot.
    fn send_spoilt(&mut self, command: &AdmittedCommand, spoil: Spoil<'_>) -> bool {
        let _ = (command, spoil);
        false
    }

    /// Every message since the former call; `None` when the rig shows the newest alone.
    fn heard(&mut self) -> Option<Heard> {
        None
    }

    /// Rates that the driver's author states.
    fn stated_rates(&self) -> StatedRates {
        StatedRates::default()
    }

    /// True when whoever runs the suite wants it to end.
    fn is_interrupted(&self) -> bool {
        false
    }

    /// Gives up every authority that the suite may still hold; what the rig does not obey lapses.
    fn release_all(&mut self) {}

    /// True when the suite or the driver was held up since the former call, so that authority may have lapsed by no
    /// fault of the driver.
    fn was_held_up(&mut self) -> bool {
        false
    }

    /// True when nothing was published before the first [`Rig::advance`].
    fn starts_silent(&self) -> bool {
        true
    }

    /// How far the measured current of `coil` may lie off the true one: noise, gain and quantisation of the sensor, A.
    fn current_tolerance(&self, coil: usize) -> f64 {
        let _ = coil;
        1e-6
    }

    /// How far a measured angle may lie off the true one, rad.
    fn angle_tolerance(&self) -> f64 {
        1e-6
    }

    /// How long measured currents may take to follow set points that stand still: some time constants of the coils.
    fn settling(&self) -> Duration {
        Duration::ZERO
    }

    /// How long measured angles may take to follow set points that stand still.
    fn angle_settling(&self) -> Duration {
        Duration::ZERO
    }

    /// How long the commands of the suite stay good.
    fn validity(&self) -> Duration {
        Duration::from_millis(100)
    }
}
