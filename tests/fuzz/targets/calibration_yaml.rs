//! Bytes through `entry_points::calibration_yaml`.

#![no_main]

#[path = "../entry_points/mod.rs"]
#[allow(dead_code)]
mod entry_points;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| entry_points::calibration_yaml(bytes));
