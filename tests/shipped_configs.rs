//! Every file that is shipped loads, and says what its comments promise.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use magsteer::config::{Config, Document, Experiment};
use magsteer_hal::description::{HardwareDescription, PartDescription};
use nalgebra::Vector3;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config")
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|extension| extension == "toml")).collect();
    files.sort();
    files
}

fn load(name: &str) -> HardwareDescription {
    let loaded = Config::load(&root().join(name));
    loaded.unwrap_or_else(|problems| panic!("{problems}")).1.description
}

#[test]
fn every_configuration_loads() {
    let files = files(&root());
    assert!(files.len() >= 4, "{files:?}");
    for file in files {
        if let Err(problems) = Config::load(&file) {
            panic!("{}:\n{problems}", file.display());
        }
    }
}

#[test]
fn every_experiment_loads_for_the_two_magnets_of_the_default_rig() {
    let rig = load("bigmag-planar.toml");
    let files = files(&root().join("experiments"));
    assert!(!files.is_empty());
    for file in files {
        if let Err(problems) = Experiment::load(&file, &rig) {
            panic!("{}:\n{problems}", file.display());
        }
    }
}

#[test]
fn resolved_text_reads_back_to_the_same_configuration() {
    for file in files(&root()) {
        let (document, config) = Config::load(&file).unwrap();
        let resolved = document.resolved();
        let again = Document::from_text("resolved.toml", resolved.text.clone()).unwrap();
        assert_eq!(again.resolved(), resolved, "{}", file.display());
        assert_eq!(Config::from_document(&again).unwrap().description, config.description);
        assert!(!document.has("extends") && !resolved.text.contains("extends"));
    }
}

#[test]
fn each_file_says_what_it_is_and_where_the_numbers_of_its_rig_come_from() {
    for file in files(&root()) {
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("# "), "{} opens with what it is", file.display());
        let describes = ["[coil_types", "[[coils]]", "[manipulator"].iter().any(|table| text.contains(table));
        let sourced = ["[P]", "[C]", "[A]", "[R]"].iter().any(|tag| text.contains(tag));
        assert!(sourced || !describes, "{} describes a rig without a source", file.display());
    }
}

/// Goal: the command accepts what is shipped, the simulated plant's section included.
#[test]
fn check_accepts_every_configuration() {
    for file in files(&root()) {
        let command = Command::new(env!("CARGO_BIN_EXE_magsteer")).arg("check").arg(&file).output().unwrap();
        assert_eq!(command.status.code(), Some(0), "{command:?}");
        assert!(String::from_utf8_lossy(&command.stdout).contains("sha256 "), "{command:?}");
    }
}

/// Goal: the poses at frame angle zero are those of the actuation system, coil by coil.
#[test]
fn bigmag_has_its_six_coils_on_two_frames() {
    let rig = load("bigmag-planar.toml");
    assert_eq!(rig.coils.len(), 6);
    assert_eq!(rig.frames.iter().map(|frame| frame.name.as_str()).collect::<Vec<_>>(), ["bottom", "top"]);
    let frames: Vec<Option<usize>> = rig.coils.iter().map(|coil| coil.frame).collect();
    assert_eq!(frames, [0, 0, 1, 1, 0, 1].map(Some));
    // Each coil's axis points from its expansion point at the workspace centre.
    for coil in &rig.coils {
        let axis = Vector3::from(coil.rotation.map(|row| row[0]));
        let position = Vector3::from(coil.position);
        assert!((position + axis * position.norm()).norm() < 1e-12, "{}", coil.name);
    }
    let distances: Vec<f64> =
        rig.coils.iter().map(|coil| Vector3::from(coil.position).norm() * 1e3).collect();
    for (distance, expected) in distances.iter().zip([102.1, 103.3, 101.0, 103.0, 85.5, 85.5]) {
        assert!((distance - expected).abs() < 1e-9, "{distances:?}");
    }
}

#[test]
fn the_fourteen_coils_are_bigmag_and_eight_more_each_on_its_side() {
    let (six, fourteen) = (load("bigmag-planar.toml"), load("bigmag-14.toml"));
    assert_eq!(fourteen.coils.len(), 14);
    assert_eq!(fourteen.coils[..6], six.coils);
    assert_eq!(fourteen.frames, six.frames);
    assert_eq!(fourteen.manipulator, six.manipulator);
    for coil in &fourteen.coils {
        let side = if coil.position[2] < 0.0 { "bottom" } else { "top" };
        assert_eq!(fourteen.frames[coil.frame.unwrap()].name, side, "{}", coil.name);
    }
    let iron = &six.coils[0].coefficients;
    for coil in &fourteen.coils[6..] {
        assert_eq!(coil.coefficients, *iron);
        assert!((Vector3::from(coil.position).norm() - 0.103).abs() < 1e-12);
        let [x, y, z] = coil.position;
        assert!((x.abs() - y.abs()).abs() < 1e-12, "{}: azimuth", coil.name);
        assert!((z.abs() - 0.103 * 33.0_f64.to_radians().sin()).abs() < 1e-12, "{}: elevation", coil.name);
    }
}

/// Goal: the rod of the reference cases, computed here from their statement and not by the configuration's code.
#[test]
fn the_two_magnet_reference_is_the_rod_of_the_reference_cases() {
    use std::f64::consts::PI;
    let rig = load("reference-two-magnets.toml");
    let manipulator = &rig.manipulator;
    assert_eq!(manipulator.base_position, [-0.03, 0.0, 0.0]);
    assert_eq!(manipulator.base_rotation, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]);
    let close = |actual: f64, expected: f64| (actual - expected).abs() <= 1e-12 * expected.abs();
    let radius: f64 = 1e-3;
    let (area, second_moment) = (PI * radius.powi(2), PI * radius.powi(4) / 4.0);
    let (young, shear) = (2.0e6, 2.0e6 / 3.0);
    let mu0 = 4e-7 * PI;
    let lengths = [0.025, 0.004, 0.020, 0.004];
    let signs = [1.0, -1.0];
    assert_eq!(manipulator.parts.len(), 4);
    for (index, (part, length)) in manipulator.parts.iter().zip(lengths).enumerate() {
        match part {
            PartDescription::Section(section) => {
                let stiffness = section.extensible.expect("the reference rod stretches and shears");
                assert!(close(section.length, length) && close(section.radius, radius));
                assert!(close(section.bending_stiffness, young * second_moment));
                assert!(close(section.torsion_stiffness, 2.0 * shear * second_moment));
                assert!(close(stiffness.axial, young * area) && close(stiffness.shear, shear * area));
                assert!(close(section.mass_per_length, 1030.0 * area));
            }
            PartDescription::Magnet(magnet) => {
                let moment = signs[index / 2] * 1.32 * area * length / mu0;
                assert!(close(magnet.length, length) && close(magnet.mass, 7500.0 * area * length));
                assert_eq!(magnet.moment_body[..2], [0.0, 0.0]);
                assert!((magnet.moment_body[2] - moment).abs() < 1e-12, "{moment}");
            }
        }
    }
    assert_eq!(rig.coils, load("bigmag-planar.toml").coils);
}

#[test]
fn the_reference_cantilever_is_a_weightless_inextensible_metre() {
    let rig = load("reference-cantilever.toml");
    assert!(rig.coils.is_empty() && rig.frames.is_empty() && rig.magnets().next().is_none());
    assert_eq!(rig.manipulator.base_rotation, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let [PartDescription::Section(section)] = &rig.manipulator.parts[..] else { panic!("one section") };
    assert_eq!((section.length, section.bending_stiffness, section.torsion_stiffness), (1.0, 1.0, 1.0));
    assert_eq!((section.extensible, section.mass_per_length), (None, 0.0));
    assert!(rig.workspace.radius >= 1.0);
}

#[test]
fn the_planar_experiment_plays_its_eight_steps_in_the_plane() {
    let rig = load("bigmag-planar.toml");
    let experiment = Experiment::load(&root().join("experiments/planar.toml"), &rig).unwrap();
    let steps = [(90, 90), (70, 70), (110, 70), (80, 110), (60, 90), (90, 60), (90, 120), (90, 90)];
    assert_eq!(experiment.steps.len(), steps.len());
    for (step, (first, second)) in experiment.steps.iter().zip(steps) {
        assert_eq!((step.target_deg["m1"], step.target_deg["m2"]), (f64::from(first), f64::from(second)));
        for (direction, angle) in experiment.target(step, &rig).directions.iter().zip([first, second]) {
            let (sine, cosine) = f64::from(angle).to_radians().sin_cos();
            let error = (Vector3::from(*direction) - Vector3::new(sine, 0.0, cosine)).norm();
            assert!(error < 1e-15, "{direction:?} at {angle} degrees from z");
        }
    }
}
