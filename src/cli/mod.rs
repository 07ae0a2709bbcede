//! The command line: one file a subcommand, each a type that clap fills and whose `run` prints and returns an [`exit::Exit`].
//!
//! Results go to standard output, everything else to standard error. A subcommand is added by its file and its line in
//! [`command::Command`]. What is absent: logic that a test would want to call; that lives in the library.

mod actuation;
#[cfg(feature = "foxglove")]
mod bridge;
#[cfg(feature = "sim")]
mod campaign;
mod check;
mod command;
mod counting;
mod data_file;
#[cfg(feature = "sim")]
mod demo;
mod doctor;
mod ending;
mod events;
mod exit;
mod fault;
mod field;
#[cfg(feature = "figures")]
#[cfg_attr(
    not(feature = "sim"),
    expect(dead_code, reason = "pictures of demonstrations and campaigns are not drawn")
)]
mod figures;
mod hal;
mod init;
#[cfg(feature = "sim")]
mod managed;
#[cfg(all(feature = "figures", feature = "record"))]
mod model_shapes;
mod operator;
mod output;
mod overlay;
#[cfg(feature = "sim")]
mod pair;
mod plan;
mod play;
mod reach;
#[cfg(feature = "record")]
mod record;
#[cfg(feature = "record")]
mod replay;
#[cfg(all(feature = "figures", feature = "record"))]
mod report;
mod rig_file;
mod run;
#[cfg(feature = "record")]
mod run_files;
#[cfg(any(feature = "sim", feature = "record"))]
mod run_folder;
mod runs;
mod shape;
mod shape_answer;
#[cfg(feature = "shell")]
mod shell;
mod shipped;
#[cfg(feature = "sim")]
mod sim_faults;
#[cfg(feature = "sim")]
mod sim_plant;
#[cfg(feature = "sim")]
mod soak;
mod status;
mod target;
#[cfg(feature = "top")]
mod top;
mod tune;
mod tunnel;
mod viewing;
#[cfg(feature = "web")]
mod web;

pub use command::run;
