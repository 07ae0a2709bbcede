//! The flight recorder: the last seconds of every cycle in memory, written out when something went wrong, and
//! a journal of what happened.
//!
//! ```text
//!  loop ── one record a cycle, wait-free ──▶ telemetry thread ──────────────▶ files thread
//!          (pushed with or without           keeper: encodes into a ring,     journal: events.jsonl
//!           a recorder)                      sees trips, hands a ring on      minutes: minutes.jsonl
//!                                                                             flights: *.flight
//! ```
//!
//! Terms: a *flight* is a file with the records of some seconds before and half a second after a trip; the
//! *journal* is a text file with a line for every event; a *trip* is a stop that nobody wished for.
//!
//! Method: two rings are allocated and touched before the loop starts. One records; when a flight is due it
//! is handed to the files thread as it is, and the other goes on. So nothing is copied and nothing waits.
//! When the files cannot be written the ring, the queue of events and then nothing more is kept; each is
//! counted, shown in the status, and tried again.
//!
//! What is absent: anything in the loop's thread; a wait of the telemetry thread for a file.
//!
//! | file | does |
//! |---|---|
//! | `config` | `[daemon.recorder]` |
//! | `columns` | what a record holds: one table that writes, names and explains it |
//! | `refusal` | why poses or feedback were refused, as values of a record |
//! | `ring` | the last records in one piece of memory |
//! | `header`, `flight` | the file format, and its writer |
//! | `reading` | its reader, as far as a damaged file goes |
//! | `extract` | extremes and a short table of a flight |
//! | `lines` | files of lines that rotate |
//! | `journal`, `minutes` | events, and timing minute by minute, as lines, and their readers |
//! | `trigger` | when a flight is due |
//! | `keeper` | the telemetry thread's end |
//! | `files` | the files thread: writes, counts what failed, tries again |
//! | `checksum`, `wall` | CRC-32, and times of day as text |

mod checksum;
mod columns;
mod config;
mod extract;
mod files;
mod flight;
mod header;
mod journal;
mod keeper;
mod lines;
mod minutes;
mod reading;
mod refusal;
mod ring;
#[cfg(test)]
mod tests;
mod trigger;
mod wall;

pub use checksum::Crc32;
pub use columns::NONE;
pub use config::RecorderConfig;
pub use extract::{Extract, Extreme, Row, tangent_deg};
pub use files::{RecorderState, Store};
pub use flight::{FLIGHT_SUFFIX, PARTIAL_SUFFIX};
pub use header::{Column, Header, Machine, Reason};
pub use journal::{Entry, JOURNAL, JournalPage, JournalTail, event, journal_files, read_journal};
pub use keeper::{Recorder, RecorderPlan};
pub use lines::Lines;
pub use minutes::{MINUTES, Minute, read_minutes};
pub use reading::{Ending, Flight, FlightError, FlightLabel};
pub use refusal::refusal_text;
pub use wall::{compact, rfc_3339};
