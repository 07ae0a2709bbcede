//! The contract between the magsteer daemon and whatever drives the coils.
//!
//! A driver author reads and links this crate alone: the messages that cross shared memory, the
//! [`Hardware`] trait that the control loop talks to, the description of the rig that both sides
//! hold, the command gate, the rules by which a driver guards itself, and the reconstruction of the
//! rod's shape for trackers that see its surface or feel its curvature.
//!
//! Conventions: SI units, radians and the world frame inside; where a value crosses a border
//! (message field, TOML key) its unit is the last word of its name. Quaternions are x, y, z, w.
//! What is absent: nothing here knows a field model, a rod or a control law.

pub mod binding;
pub mod channels;
pub mod config;
pub mod conformance;
pub mod description;
pub mod driver;
pub mod fault;
pub mod gate;
pub mod guard;
pub mod hardware;
pub mod invalid;
mod limits;
pub mod message;
pub mod operator;
pub mod receive;
pub mod record;
pub mod scripted;
mod seeded;
pub mod send;
pub mod shape;
pub mod time;
pub mod udp;
mod unit_slip;

pub use description::HardwareDescription;
pub use gate::{Admitted, AdmittedCommand, Authority, Gate, Limited, Refused};
pub use guard::{CommandGuard, Refusal, Setpoint};
pub use hardware::{Absent, Hardware, Reading, Sensed, WriteError};
pub use message::{
    Actuation, COILS_MAX, CoilCommand, CoilFeedback, Header, MAGNETS_MAX, MagnetPose, POSE_PARAMETERS_MAX,
    PoseMessage,
};
pub use receive::{FeedbackReceiver, PoseReceiver};
pub use send::{CommandWriter, HeaderWriter};
pub use time::Stamp;
