//! Texts of people and programs: configurations, experiments, scripts, tables of measurements.

use magsteer::config::{Config, Document, Experiment, Problems, TargetLines, experiment_of_csv};
use magsteer::control::plan::parse_targets;
use magsteer::control::{Directions, identification};
use magsteer::magnetics::{fit, mpem};
use magsteer_hal::Stamp;
use magsteer_hal::fault::{FaultPlanConfig, Injector, Reach};
use magsteer_sim_plant::PlantConfig;

use super::rig::{RIG, run};

fn text(bytes: &[u8]) -> Option<Document> {
    let document = Document::from_text("fuzzed.toml", std::str::from_utf8(bytes).ok()?);
    document.map_err(|problems| words(&problems)).ok()
}

/// Problems are made to be read: writing them must not fail either.
fn words(problems: &Problems) {
    assert!(!problems.to_string().is_empty());
}

/// A rig's configuration, with the simulated plant's section.
pub fn config(bytes: &[u8]) {
    let Some(document) = text(bytes) else { return };
    let resolved = document.resolved();
    let again = Document::from_text("resolved", resolved.text.clone()).expect("what was resolved is TOML");
    assert_eq!(again.resolved(), resolved, "resolving changes nothing twice");
    match Config::from_document(&document) {
        Err(problems) => words(&problems),
        Ok(config) => {
            Config::from_document(&again).expect("the resolved text means the same");
            if let Ok(plant) = document.section::<PlantConfig>("plant") {
                let _ = plant.build(&config.description);
            }
        }
    }
}

/// An experiment.
pub fn experiment(bytes: &[u8]) {
    let Some(document) = text(bytes) else { return };
    match Experiment::from_document(&document, &RIG) {
        Err(problems) => words(&problems),
        Ok(experiment) => {
            look_at_targets(&experiment);
        }
    }
}

fn look_at_targets(experiment: &Experiment) {
    for step in &experiment.steps {
        assert!(step.duration_s > 0.0 && step.duration_s.is_finite());
        let target = experiment.target(step, &RIG);
        assert!(target.directions.iter().flatten().all(|component| component.is_finite()));
    }
}

/// An experiment as a table.
pub fn experiment_csv(bytes: &[u8]) {
    match experiment_of_csv(bytes, &RIG) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(experiment) => look_at_targets(&experiment),
    }
}

/// Lines of another program that streams targets.
pub fn target_lines(bytes: &[u8]) {
    let mut present = Directions::default();
    present[..2].copy_from_slice(&[[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    let mut lines = TargetLines::new(&RIG, [0.0, 1.0, 0.0], present);
    for line in String::from_utf8_lossy(bytes).lines() {
        match lines.target(line) {
            Err(refused) => assert!(!refused.is_empty()),
            Ok(target) => {
                for direction in &target.directions[..RIG.magnets().count()] {
                    let norm = direction.iter().map(|component| component * component).sum::<f64>().sqrt();
                    assert!((norm - 1.0).abs() < 1e-12, "{line}: {direction:?}");
                }
                for (angle, frame) in target.frame_angles.iter().flatten().zip(&RIG.frames) {
                    let slack = 1e-9 * (frame.angle_max - frame.angle_min);
                    assert!((frame.angle_min - slack..=frame.angle_max + slack).contains(angle), "{line}");
                }
            }
        }
    }
}

/// A script of faults.
pub fn fault_plan(bytes: &[u8]) {
    let Some(document) = text(bytes) else { return };
    match document.read::<FaultPlanConfig>() {
        Err(problems) => words(&problems),
        Ok(config) => {
            if let Ok(plan) = config.build(&RIG, Reach::Plant) {
                let mut injector = Injector::new(&RIG, &plan, 1);
                injector.start(Stamp::from_nanoseconds(1));
                run(&mut injector);
            }
        }
    }
}

/// Targets of a plan.
pub fn targets_csv(bytes: &[u8]) {
    match parse_targets(bytes, &["m1", "m2"]) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(found) => {
            for direction in found.targets.iter().flat_map(|target| &target[..2]) {
                let norm = direction.iter().map(|component| component * component).sum::<f64>().sqrt();
                assert!((norm - 1.0).abs() < 1e-12, "{direction:?}");
            }
        }
    }
}

/// Calibration of one coil or of an array.
pub fn calibration_csv(bytes: &[u8]) {
    match fit::parse(bytes) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(found) => {
            assert!(!found.readings.is_empty());
            for reading in &found.readings {
                let vectors = reading.position.iter().chain(&reading.field);
                assert!(vectors.chain(&reading.currents).all(|value| value.is_finite()));
                assert_eq!(reading.currents.len(), found.coil_count());
            }
        }
    }
}

/// Equilibria for the identification.
pub fn identify_csv(bytes: &[u8]) {
    match identification::parse(bytes, &RIG) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(found) => assert!(!found.samples.is_empty()),
    }
}

/// A calibration of a multipole electromagnet model: what is let through is written and read back the same.
pub fn calibration_yaml(bytes: &[u8]) {
    let calibration = match mpem::read(bytes) {
        Ok(calibration) => calibration,
        Err(refusal) => {
            assert!(!refusal.to_string().is_empty());
            return;
        }
    };
    match mpem::placed_coils(&calibration) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(coils) => {
            for coil in &coils {
                assert!(coil.coefficients.iter().all(|coefficient| coefficient.is_finite()), "{coil:?}");
                assert!(coil.field_at_center.iter().all(|component| component.is_finite()), "{coil:?}");
            }
        }
    }
    let written = mpem::write(&calibration, &[]).expect("the names were read from a file");
    let again = mpem::read(written.as_bytes()).expect("its own");
    let sources = |calibration: &mpem::Calibration| {
        calibration.coils.iter().flat_map(|coil| coil.sources.clone()).collect::<Vec<_>>()
    };
    let (before, after) = (sources(&calibration), sources(&again));
    assert_eq!(before.len(), after.len());
    for (before, after) in before.iter().zip(&after) {
        assert_eq!((&before.rising, &before.falling), (&after.rising, &after.falling));
        assert_eq!(before.position, after.position);
        // Made a unit vector once more, which rounds.
        assert!((before.direction - after.direction).norm() < 1e-15, "{before:?}");
    }
}
