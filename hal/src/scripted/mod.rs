//! Rigs inside the process, for tests of whatever talks to [`crate::Hardware`]: a playback of a script, an ideal rig
//! that echoes commands with a small description to go with it, and the two halves of channels for rigs of one's own.

mod echo;
mod example;
mod loopback;
mod playback;

pub use echo::EchoHardware;
pub use example::example_description;
pub use loopback::Loopback;
pub use playback::{ScriptedHardware, Step};
