//! Where bytes from outside come in: one function each, which must not panic, whatever the bytes are.
//!
//! Each also asserts what is promised of what it lets through. Used by the fuzz targets beside it and by
//! `tests/fuzz_corpus.rs`. `texts`: what people and programs write; `peers`: messages of processes and
//! devices; `files`: what this program wrote, and a disk damaged; `rig`: what all of it is about.

mod files;
mod peers;
mod rig;
mod texts;

pub use files::{flight, journal, recording};
pub use peers::{cloud, datagrams, messages, operator_requests};
pub use texts::{
    calibration_csv, calibration_yaml, config, experiment, experiment_csv, fault_plan, identify_csv,
    target_lines, targets_csv,
};
