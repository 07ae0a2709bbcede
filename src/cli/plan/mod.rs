//! `magsteer plan`: frame angles, currents and ways for a set of targets.
//!
//! `subject` is the rig with its planner, `choice` which targets are meant, `search` plans them on all cores, `frames` reads frame
//! angles from the command line and `answer` is what is printed.

mod answer;
mod choice;
mod command;
mod frames;
mod search;
mod subject;

pub use command::Plan;
