//! `magsteer plan`: frame angles, currents and ways for a set of targets.
//!
//! `subject` is the rig with its planner, `choice` which targets are meant, `search` plans them on all cores, `frames` reads frame
//! angles from the command line, `answer` is what is printed and `way` what is written.

mod answer;
mod choice;
mod command;
mod frames;
mod search;
mod subject;
mod way;

pub use choice::half_angle;
pub use command::Plan;
pub use frames::NamedAngles;
pub use search::{Search, in_threads};
pub use subject::{Subject, planner};
