//! Recordings: every cycle of a run in an MCAP file, written by a process of its own, read back, mended,
//! exported, and done again.
//!
//! # Reading one
//! ```no_run
//! use magsteer::recording::Recording;
//!
//! # fn main() -> Result<(), magsteer::recording::RecordingError> {
//! // A run's folder or its `recording.mcap`; a recording that was cut is read as far as it is whole.
//! let recording = Recording::open("runs/run-20261122-141500".as_ref())?;
//! println!("{} at {} Hz, {}", recording.info().rig, recording.info().rate_hz, recording.description());
//! // Nothing but the head was read so far. Cycles come one by one, with memory for a chunk.
//! for cycle in recording.cycles()? {
//!     let cycle = cycle?;
//!     println!("{} {:?} A, tip points {:?}", cycle.number, cycle.measured_a, cycle.measured.last());
//! }
//! let counts = recording.counts()?; // cycles, holes, whether it is whole
//! let events = recording.events()?; // changes of state, requests, losses
//! # let _ = (counts, events, recording.config_text(), recording.metadata()?);
//! # Ok(())
//! # }
//! ```
//!
//! # What is in a file
//! Profile `ros2`: CDR messages with `ros2msg` schemas. `/RIG/cycle` (`magsteer_msgs/msg/Cycle`) holds every
//! cycle with all that it was given and made of it, bit for bit: [`Cycle`]. Views of it for other programs,
//! every 10 ms at most: `/RIG/MAGNET/measured_cp` and `setpoint_cp` (`geometry_msgs/msg/PoseStamped`),
//! `/RIG/measured_js` and `setpoint_js` (`sensor_msgs/msg/JointState`; joints `NAME_a` are currents,
//! `NAME_rad` angles). `/RIG/events` (`rcl_interfaces/msg/Log`): what happened. Attachments: the resolved
//! configuration and the description; metadata `magsteer`: [`Info`]; `magsteer-end`: how it ended.
//!
//! | file | does |
//! |---|---|
//! | `cycle` | what is recorded of a cycle: one table that is struct, message and columns |
//! | `convert` | from the published message, and back to what the loop was given |
//! | `value`, `cdr` | fields and their encoding |
//! | `schemas`, `topics` | definitions of the messages; views in standard ones |
//! | `info` | what a recording says of itself |
//! | `writer`, `sink` | a file that grows by whole pieces |
//! | `recorder` | the process that records |
//! | `container`, `lengths` | the records of a file, as far as they are whole and their lengths no lies |
//! | `reader` | a recording as its cycles, events and counts |
//! | `recover` | a whole file of one that was cut |
//! | `export`, `npz` | cycles as tables |
//! | `choice` | which cycles and columns a table has |
//! | `replay` | a run done again, bit for bit |
//!
//! What is absent: anything in the daemon's process; a clock in what reads.

mod cdr;
mod choice;
mod container;
mod convert;
mod cycle;
mod error;
mod export;
mod info;
mod lengths;
mod npz;
mod reader;
mod recorder;
mod recover;
mod replay;
mod schemas;
mod sink;
mod topics;
mod value;
mod writer;

pub use cdr::CdrError;
pub use choice::{Choice, UnknownColumn};
pub use container::Ending;
pub use convert::Sizes;
pub use cycle::{Cycle, Field};
pub use error::RecordingError;
pub use export::{Exported, export_csv, export_npz};
pub use info::Info;
pub use reader::{Counts, Cycles, Event, MetadataMap, Recording, follows};
pub use recorder::{RECORDING, RecordReport, RecorderError, RecordingPlan, Why, record, recording_in};
pub use recover::{Recovered, recover};
pub use replay::{Difference, FieldDifference, ReplayError, ReplayReport, recorded_document, replay};
pub use topics::level;
pub use value::{Number, Per};
pub use writer::{End, RecordingWriter};
