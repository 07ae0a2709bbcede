//! The command line: one file a subcommand, each a type that clap fills and whose `run` prints and returns an [`exit::Exit`].
//!
//! Results go to standard output, everything else to standard error. A subcommand is added by its file and its line in
//! [`command::Command`]. What is absent: logic that a test would want to call; that lives in the library.

mod actuation;
mod check;
mod command;
mod exit;
mod field;
mod operator;
mod output;
mod rig_file;
mod run;
mod shape;
mod shape_answer;
mod shipped;
mod status;
mod target;

pub use command::run;
