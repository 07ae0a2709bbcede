//! A recorded run done again comes out bit for bit; another gain is found at the first cycle that it changes.
#![cfg(all(feature = "sim", feature = "record"))]

mod recording_support;
mod rig_support;

use std::path::Path;

use magsteer::daemon::cycle_message;
use magsteer::recording::{Recording, RecordingWriter, ReplayError, ReplayReport, recorded_document, replay};
use recording_support::{Subject, complete, planar};

/// Faults that hold, that stop and that are refused, one after another.
const FAULTS: &str = "
    description = 'a hold, a refusal and a trip'

    [[faults]]
    at_s = 0.9
    target = 'poses'
    verb = 'intermittent'
    period_ms = 200.0
    off_fraction = 0.5
    for_s = 0.4

    [[faults]]
    at_s = 1.4
    target = 'poses'
    verb = 'garbage'
    garbage = 'nan'
    for_s = 0.05

    [[faults]]
    at_s = 1.6
    target = 'feedback'
    verb = 'garbage'
    garbage = 'huge'
    for_s = 0.2
";

/// Records a run; `keep` says which of its cycles are recorded.
fn record(subject: &Subject, file: &Path, plan: Option<&str>, keep: impl Fn(u64) -> bool) -> Recording {
    let mut writer: RecordingWriter = subject.writer(file);
    subject.steer(plan, &[[90.0, 70.0], [70.0, 90.0], [80.0, 80.0]], 0.5, |record| {
        if keep(record.tick.number) {
            writer.write(&cycle_message(record)).expect("room");
        }
    });
    writer.finish(&complete()).expect("room");
    Recording::open(file).expect("a recording")
}

fn equal(report: &ReplayReport) -> u64 {
    assert_eq!(report.difference, None);
    report.equal
}

/// Goal: with poses lost and refused, feedback that lies, a trip and a fault among it.
#[test]
fn a_run_with_faults_in_it_comes_out_bit_for_bit() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let recording = record(&subject, &folder.path().join("run.mcap"), Some(FAULTS), |_| true);
    let report = replay(&recording, None).expect("complete");
    let counts = recording.counts().expect("whole");
    assert_eq!(equal(&report), counts.cycles);
    assert!(report.trips >= 1 && report.commands > 1_000, "{report:?}");
    assert_eq!(report.requests, 6, "arm, go, three targets, the end");
    let refused = recording.cycles().expect("whole").filter_map(Result::ok);
    let refused = refused.filter(|cycle| cycle.pose_refused != 0).count();
    assert!(refused >= 5, "garbage was refused, and that is recorded: {refused}");
}

/// Goal: the first difference lies where the gain first acts, and not before: the first cycle that steers with
/// an error.
#[test]
fn a_changed_gain_is_reported_as_the_first_differing_cycle() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let recording = record(&subject, &folder.path().join("run.mcap"), None, |_| true);
    assert_eq!(equal(&replay(&recording, None).expect("complete")), 2_300);
    let mut document = recorded_document(&recording).expect("a configuration");
    let gain = document.number("control.disturbance.tracking_per_s").expect("a gain");
    assert!(document.set_number("control.disturbance.tracking_per_s", gain.with_value(1.01 * gain.value())));
    let report = replay(&recording, Some(&document)).expect("complete");
    let difference = report.difference.expect("another gain steers otherwise");
    assert_eq!(difference.cycle, report.equal);
    assert!(difference.fields[0].decides && difference.fields[0].field.starts_with("command"));
    assert_ne!(difference.fields[0].recorded, difference.fields[0].replayed);
    let steering =
        recording.cycles().expect("whole").filter_map(Result::ok).find(|cycle| cycle.directive == 4);
    let first = steering.expect("it steered").number;
    assert!((first..first + 20).contains(&difference.cycle), "{} after {first}", difference.cycle);
}

#[test]
fn a_recording_that_lacks_cycles_is_refused_with_the_place() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let holed = record(&subject, &folder.path().join("holed.mcap"), None, |number| number != 700);
    let refused = replay(&holed, None).expect_err("a hole");
    assert!(matches!(refused, ReplayError::Hole { before: 699, after: 701, .. }), "{refused}");
    let late = record(&subject, &folder.path().join("late.mcap"), None, |number| number >= 12);
    let refused = replay(&late, None).expect_err("no begin");
    assert!(matches!(refused, ReplayError::LateBegin { first: 12, .. }), "{refused}");
    let empty = record(&subject, &folder.path().join("empty.mcap"), None, |_| false);
    assert!(matches!(replay(&empty, None), Err(ReplayError::Empty { .. })));
}
