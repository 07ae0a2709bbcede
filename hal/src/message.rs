//! What crosses shared memory: fixed-size messages, each with the common header first.
//!
//! Rules for every message: `#[repr(C)]` without implicit padding, `u32` codes instead of `bool`
//! and `enum` (a peer can write any bits), unused array entries zero. A receiver copies the message out,
//! then checks every field before use.

use iceoryx2::prelude::ZeroCopySend;

use crate::time::Stamp;

/// Most coils that a rig can have.
pub const COILS_MAX: usize = 32;
/// Most pose parameters (frame angles) that a rig can have.
pub const POSE_PARAMETERS_MAX: usize = 8;
/// Most magnets that a manipulator can carry.
pub const MAGNETS_MAX: usize = 8;

/// Version of the layouts below; a receiver refuses any other.
pub const SCHEMA: u32 = 1;

/// First in every message, 48 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
pub struct Header {
    /// Rises by at least one with every message of a sender's epoch, and is never 0.
    pub sequence: u64,
    /// When the content was true: for a pose, the moment of exposure.
    pub source_stamp_ns: u64,
    /// When the message was handed to the transport.
    pub publish_stamp_ns: u64,
    /// The sender's life: another value after each restart (poses, feedback) or claim (commands).
    pub epoch: u64,
    /// [`SCHEMA`] of the sender.
    pub schema: u32,
    /// Reserved, zero.
    pub flags: u32,
    /// The content must not be acted upon after this stamp; 0 sets no limit.
    pub valid_until_ns: u64,
}

impl Header {
    /// When the content was true.
    #[must_use]
    pub const fn source_stamp(&self) -> Stamp {
        Stamp::from_nanoseconds(self.source_stamp_ns)
    }
}

/// Pose of one magnet's centre in the world frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
pub struct MagnetPose {
    /// Centre of the magnet.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w that turns body axes into world axes; body z is the tangent.
    pub orientation_xyzw: [f64; 4],
    /// 1 when the sensor saw this magnet, 0 when it did not.
    pub valid: u32,
    /// Reserved, zero.
    pub reserved: u32,
}

impl MagnetPose {
    /// The magnet's tangent in the world frame: body z, the third column of the rotation. A unit vector when the quaternion is one.
    #[must_use]
    pub fn tangent(&self) -> [f64; 3] {
        let [x, y, z, w] = self.orientation_xyzw;
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)]
    }
}

/// Measured poses of all magnets, driver to daemon.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("magsteer_pose_v1")]
pub struct PoseMessage {
    /// Common header.
    pub header: Header,
    /// Entries of `magnets` in use.
    pub magnet_count: u32,
    /// Reserved, zero.
    pub reserved: u32,
    /// Poses in the order of the description, base to tip.
    pub magnets: [MagnetPose; MAGNETS_MAX],
}

impl Default for PoseMessage {
    fn default() -> Self {
        Self {
            header: Header::default(),
            magnet_count: 0,
            reserved: 0,
            magnets: [MagnetPose::default(); MAGNETS_MAX],
        }
    }
}

/// Coil currents and frame angles, in the order of the description.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
pub struct Actuation {
    /// Current of each coil.
    pub current_a: [f64; COILS_MAX],
    /// Angle of each frame.
    pub angle_rad: [f64; POSE_PARAMETERS_MAX],
}

/// What a [`CoilCommand`] asks of the driver; the codes of [`CoilCommand::order`].
pub mod order {
    /// The sender gives up authority; the driver ramps to zero.
    pub const RELEASE: u32 = 0;
    /// The sender asks for authority with a new epoch and token; all currents must be zero.
    pub const CLAIM: u32 = 1;
    /// Follow the currents and angles of the message.
    pub const DRIVE: u32 = 2;
    /// Ramp to zero within the slew limit, frames hold, authority kept.
    pub const RAMP_DOWN: u32 = 3;
    /// Cut the amplifiers now.
    pub const DISABLE: u32 = 4;
}

/// Commanded currents and angles, daemon to driver.
///
/// A driver obeys only the epoch and token that it accepted with [`order::CLAIM`], only a rising
/// sequence, and only while `now < valid_until_ns`; else it ramps to zero alone.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("magsteer_coil_command_v1")]
pub struct CoilCommand {
    /// Common header; `source_stamp_ns` is that of the pose the command was computed from.
    pub header: Header,
    /// Names the holder of authority within the epoch.
    pub token: u64,
    /// One of [`order`].
    pub order: u32,
    /// Entries of `actuation.current_a` in use.
    pub coil_count: u32,
    /// Entries of `actuation.angle_rad` in use.
    pub pose_parameter_count: u32,
    /// Reserved, zero.
    pub reserved: u32,
    /// Set points.
    pub actuation: Actuation,
}

/// State of a driver; the codes of [`CoilFeedback::state`].
pub mod driver_state {
    /// No authority granted, currents at or ramping to zero.
    pub const IDLE: u32 = 0;
    /// Authority granted, following commands.
    pub const DRIVEN: u32 = 1;
    /// Authority lost or given up, ramping to zero alone.
    pub const RAMPING_DOWN: u32 = 2;
    /// Amplifiers cut.
    pub const DISABLED: u32 = 3;
}

/// Measured currents and angles and the state of the driver, driver to daemon.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("magsteer_coil_feedback_v2")]
pub struct CoilFeedback {
    /// Common header.
    pub header: Header,
    /// Sequence of the last accepted command.
    pub accepted_sequence: u64,
    /// Epoch of the last accepted command.
    pub accepted_epoch: u64,
    /// Fingerprint of the description that the driver was started with.
    pub description_fingerprint: u64,
    /// Commands refused since the driver's start, for any reason.
    pub commands_refused: u64,
    /// Commands that broke a current or slew limit of the description; a correct daemon causes none.
    pub limit_breaks: u64,
    /// Exposure of the newest poses that an accepted command was computed from, as the command said; 0 before
    /// the first.
    pub answered_pose_stamp_ns: u64,
    /// When the first accepted command computed from those poses was received, by the driver's clock; 0
    /// before the first.
    pub answer_received_stamp_ns: u64,
    /// One of [`driver_state`].
    pub state: u32,
    /// 0, or the driver's own fault code.
    pub fault: u32,
    /// Entries of `measured.current_a` in use.
    pub coil_count: u32,
    /// Entries of `measured.angle_rad` in use.
    pub pose_parameter_count: u32,
    /// Measured currents and angles.
    pub measured: Actuation,
}

#[cfg(test)]
mod tests {
    use super::MagnetPose;

    #[test]
    fn tangent_is_body_z_turned_into_the_world() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let quarter_turns = [
            ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0]),
            ([half, 0.0, 0.0, half], [0.0, -1.0, 0.0]),
            ([0.0, half, 0.0, half], [1.0, 0.0, 0.0]),
            ([0.0, 0.0, half, half], [0.0, 0.0, 1.0]),
        ];
        for (orientation_xyzw, expected) in quarter_turns {
            let found = MagnetPose { orientation_xyzw, ..MagnetPose::default() }.tangent();
            let off = found.iter().zip(expected).map(|(found, expected)| (found - expected).abs());
            assert!(off.fold(0.0, f64::max) < 1e-15, "{orientation_xyzw:?}: {found:?}");
        }
    }
}
