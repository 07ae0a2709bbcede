//! `magsteer target`: where the magnets are to point.
//!
//! `set` names one target, `play` a script of them, `stream` takes them from another program as they come, `joystick` from a hand.
//! `dry_run` walks targets in the model before anything moves.

mod command;
mod dry_run;
#[cfg(feature = "joystick")]
mod hand;
#[cfg(feature = "joystick")]
mod joystick;
mod play;
mod set;
mod stream;

pub use command::{Target, await_status};
