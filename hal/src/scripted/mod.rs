//! Rigs inside the process, for tests of whatever talks to [`crate::Hardware`]: a playback of a script, an ideal rig
//! that echoes commands, and a small description to go with them.

mod echo;
mod example;
mod playback;

pub use echo::EchoHardware;
pub use example::example_description;
pub use playback::{ScriptedHardware, Step};
