//! Recordings open unchanged with the public Python packages for MCAP and ROS 2.
//!
//! `MAGSTEER_PYTHON` names the interpreter, `python3` when it is not set; `tests/scripts/recording_in_python.py` says what to
//! install. Without Python or the packages the test says so and passes.
#![cfg(all(feature = "sim", feature = "record"))]

mod recording_support;
mod rig_support;

use std::path::Path;
use std::process::Command;

use magsteer::daemon::cycle_message;
use magsteer::recording::{Choice, Cycle, Recording, export_npz};
use recording_support::{complete, planar};
use serde_json::Value;

/// What the packages found; `None`, with the reason printed, when they are not there.
fn in_python(file: &Path, table: &Path) -> Option<Value> {
    let python = std::env::var_os("MAGSTEER_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts/recording_in_python.py");
    let output = match Command::new(&python).arg(script).arg(file).arg(table).output() {
        Ok(output) => output,
        Err(error) => {
            println!("not tried: {} cannot be started: {error}", python.display());
            return None;
        }
    };
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(3) {
        println!("not tried: {}", said.trim());
        return None;
    }
    assert!(output.status.success(), "{said}");
    Some(serde_json::from_slice(&output.stdout).expect("one object"))
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn numbers(value: &Value) -> Vec<u64> {
    value.as_array().expect("a list").iter().map(|number| number.as_u64().expect("bits")).collect()
}

/// Goal: three independent readers count as many cycles as the loop ran, and read the last one's commands to the
/// last bit; NumPy opens the exported arrays.
#[test]
fn public_packages_read_every_cycle_to_the_last_bit() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("recording.mcap");
    let (mut writer, mut last, mut count) = (subject.writer(&file), Cycle::default(), 0_u64);
    subject.steer(None, &[[90.0, 70.0]], 0.4, |record| {
        writer.write(&cycle_message(record)).expect("room");
        last = subject.cycle(record);
        count += 1;
    });
    writer.finish(&complete()).expect("room");
    let recording = Recording::open(&file).expect("a recording");
    let table = folder.path().join("cycles.npz");
    export_npz(&recording, &table, &Choice::default()).expect("room");
    let Some(found) = in_python(&file, &table) else { return };
    let rig = recording.info().rig.replace('-', "_");
    for package in ["mcap", "mcap_ros2", "rosbags"] {
        let topics = &found[package]["topics"];
        assert_eq!(topics[format!("/{rig}/cycle")].as_u64(), Some(count), "{package}: {topics}");
        for view in ["measured_js", "setpoint_js", "m1/measured_cp", "m2/setpoint_cp"] {
            assert!(
                topics[format!("/{rig}/{view}")].as_u64() > Some(count / 20),
                "{package}: {view}: {topics}"
            );
        }
        assert!(topics[format!("/{rig}/events")].as_u64() > Some(4), "{package}: {topics}");
    }
    assert_eq!(found["mcap"]["profile"], "ros2");
    assert_eq!(found["mcap"]["statistics"], recording.counts().expect("whole").messages);
    assert_eq!(found["mcap"]["attachments"], serde_json::json!(["config.toml", "description.txt"]));
    assert_eq!(found["mcap_ros2"]["joints"].as_array().expect("names").len(), 6 + 2);
    for package in ["mcap_ros2", "rosbags"] {
        assert_eq!(found[package]["last_number"], last.number);
        assert_eq!(numbers(&found[package]["last_commanded_bits"]), bits(&last.commanded_a), "{package}");
    }
    let orientation: Vec<f64> = last.orientation.iter().flatten().copied().collect();
    assert_eq!(numbers(&found["mcap_ros2"]["last_orientation_bits"]), bits(&orientation));
    let Some(arrays) = found.get("numpy") else {
        println!("not tried: numpy");
        return;
    };
    assert_eq!(arrays["commanded_shape"], serde_json::json!([count, 6]));
    assert_eq!(arrays["orientation_shape"], serde_json::json!([count, 2, 4]));
    assert_eq!(arrays["coils"], serde_json::json!(recording.info().coils));
    assert_eq!(arrays["kinds"], serde_json::json!(["uint64", "uint32", "float64"]));
    assert_eq!(numbers(&arrays["last_commanded_bits"]), bits(&last.commanded_a));
}
