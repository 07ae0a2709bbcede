//! Goal: whatever the cloud holds, the outcome is an answer or a named reason, never a panic, and the next
//! good cloud is reconstructed.

use super::rods::{NOISE, Scene, Truth, VIEWERS, manipulator};
use crate::description::{ManipulatorDescription, PartDescription};
use crate::seeded::Seeded;
use crate::shape::{CAPACITY, CentrelineKind, CloudSettings, CloudShape, SettingsError, Unreconstructed};

const KINDS: [CentrelineKind; 2] =
    [CentrelineKind::Curvature { degree: 2 }, CentrelineKind::Polynomial { degree: 6 }];

fn settings(kind: CentrelineKind) -> CloudSettings {
    CloudSettings::new(kind, &manipulator(), NOISE, &VIEWERS)
}

fn good() -> Vec<[f64; 3]> {
    Scene { outliers: 0.1, ..Scene::noisy(1) }.of(&Truth::of(&manipulator(), |_| [0.0, 10.0, 0.0]))
}

#[test]
fn spoiled_clouds_have_named_outcomes_and_do_no_lasting_harm() {
    let mut random = Seeded::new(4);
    let noise: Vec<[f64; 3]> = (0..2000).map(|_| [0; 3].map(|_| random.within(0.1))).collect();
    let axis: Vec<[f64; 3]> = (0..2000).map(|index| [-0.055 + 3e-5 * f64::from(index), 0.0, 0.0]).collect();
    let cases: Vec<(&str, Vec<[f64; 3]>)> = vec![
        ("empty", Vec::new()),
        ("few", good()[..10].to_vec()),
        ("not numbers", vec![[f64::NAN, 0.0, f64::INFINITY]; 500]),
        ("all equal", vec![[0.0, 0.0, 0.0]; 2000]),
        ("all at the clamp", vec![manipulator().base_position; 2000]),
        ("outliers alone", noise),
        ("far away", good().iter().map(|point| point.map(|x| x + 10.0)).collect()),
        ("absurd", good().iter().map(|point| point.map(|x| x * 1e300)).collect()),
        ("the axis itself", axis),
    ];
    for kind in KINDS {
        let mut shape = CloudShape::new(&manipulator(), settings(kind)).expect("sound");
        for (name, cloud) in &cases {
            shape.reconstruct(&good()).expect("a good cloud");
            let outcome = shape.reconstruct(cloud);
            assert!(outcome.is_err(), "{kind:?}, {name}: {outcome:?}");
            let too_few = matches!(outcome, Err(Unreconstructed::TooFewPoints { .. }));
            assert_eq!(too_few, ["empty", "few", "not numbers"].contains(name), "{name}: {outcome:?}");
            assert!(!outcome.unwrap_err().to_string().is_empty());
            let after = shape.reconstruct(&good()).expect("a good cloud again");
            assert!(!after.quality.is_warm && after.quality.inlier_share > 0.8, "{name}");
        }
    }
}

/// More spans away than a number of stations can hold, from wherever the walk to the foot is.
#[test]
fn points_at_absurd_distances_are_outliers_like_others() {
    let mut cloud = good();
    for point in cloud.iter_mut().skip(3).step_by(7) {
        *point = point.map(|coordinate| coordinate * 1e30);
    }
    for kind in KINDS {
        let mut shape = CloudShape::new(&manipulator(), settings(kind)).expect("sound");
        let found = shape.reconstruct(&cloud).expect("six points of seven are good");
        assert!(found.magnets().iter().all(|magnet| magnet.pose.valid == 1), "{kind:?}");
    }
}

#[test]
fn points_that_are_not_finite_are_left_out_and_counted() {
    let mut cloud = good();
    let clean = CloudShape::new(&manipulator(), settings(KINDS[0])).expect("sound").reconstruct(&cloud);
    cloud.insert(7, [f64::NAN; 3]);
    cloud.insert(1000, [0.0, f64::NEG_INFINITY, 0.0]);
    let found = CloudShape::new(&manipulator(), settings(KINDS[0])).expect("sound").reconstruct(&cloud);
    let (clean, found) = (clean.expect("a shape"), found.expect("a shape"));
    assert_eq!((found.quality.points, found.quality.points_not_finite), (2000, 2));
    assert_eq!(found.magnets, clean.magnets);
}

#[test]
fn a_larger_cloud_is_thinned_evenly() {
    let truth = Truth::of(&manipulator(), |_| [0.0, 10.0, 0.0]);
    let cloud = Scene { points: 20_000, outliers: 0.1, ..Scene::noisy(1) }.of(&truth);
    let mut shape = CloudShape::new(&manipulator(), settings(KINDS[0])).expect("sound");
    let found = shape.reconstruct(&cloud).expect("a shape");
    assert_eq!((found.quality.points, found.quality.points_over_capacity), (CAPACITY, 20_000 - CAPACITY));
    // The outliers stand together at the end: thinned evenly, their share stays.
    assert!((found.quality.inlier_share - 0.88).abs() < 0.03, "{}", found.quality.inlier_share);
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    type Spoil = fn(&mut CloudSettings);
    let cases: [(Spoil, &str); 11] = [
        (|settings| settings.kind = CentrelineKind::Polynomial { degree: 2 }, "degree 2"),
        (|settings| settings.kind = CentrelineKind::Curvature { degree: 7 }, "degree 7"),
        (|settings| settings.noise = 0.0, "noise = 0: must be finite and > 0"),
        (|settings| settings.curvature = f64::NAN, "curvature = NaN"),
        (|settings| settings.force = -1.0, "force = -1"),
        (|settings| settings.unseen_max = 0.0, "unseen_max = 0"),
        (|settings| settings.tangent_deviation_max = f64::INFINITY, "tangent_deviation_max = inf"),
        (|settings| settings.inlier_share_min = 1.5, "inlier_share_min = 1.5: must be from 0 to 1"),
        (|settings| settings.capacity = 0, "capacity = 0"),
        (|settings| settings.iterations_max = 0, "iterations_max = 0"),
        (|settings| settings.viewers[1][2] = f64::NAN, "viewers = NaN"),
    ];
    for (spoil, expected) in cases {
        let mut settings = settings(KINDS[0]);
        spoil(&mut settings);
        let refusal = CloudShape::new(&manipulator(), settings).expect_err(expected).to_string();
        assert!(refusal.starts_with(expected), "{refusal}");
    }
}

#[test]
fn a_rod_that_nothing_can_be_seen_of_is_refused() {
    let with_parts = |keep: fn(&PartDescription) -> bool| {
        let mut rod = manipulator();
        rod.parts.retain(keep);
        rod
    };
    let refused =
        |rod: &ManipulatorDescription| CloudShape::new(rod, settings(KINDS[0])).expect_err("refused");
    assert_eq!(refused(&with_parts(|_| false)), SettingsError::NoLength);
    assert_eq!(refused(&with_parts(|part| matches!(part, PartDescription::Magnet(_)))), SettingsError::Rigid);
    let mut thin = manipulator();
    if let PartDescription::Section(section) = &mut thin.parts[2] {
        section.radius = 0.0;
    }
    assert_eq!(refused(&thin), SettingsError::Radius { part: 2, radius: 0.0 });
}
