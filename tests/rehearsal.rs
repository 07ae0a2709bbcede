//! A rehearsed script is what the loop's own scout finds when it is played: the same verdicts, margins and currents, on the plant with its
//! errors; and what is rehearsed are equilibria.
#![cfg(feature = "sim")]

mod rig_support;

use magsteer::control::plan::{Obstacle, Rehearsal, Rehearsed};
use magsteer::control::{ReferenceTarget, Verdict};
use magsteer::daemon::Verb;
use magsteer::magnetics::CoilArray;
use magsteer::math::angle_between;
use magsteer::rod::{Pass, PassMode, TipLoad};
use nalgebra::Vector3;
use rig_support::{Bench, Setup, directions_planar};

fn rehearsal(setup: &Setup) -> Rehearsal {
    let config = &setup.config;
    let control = config.control.as_ref().expect("a controller");
    let scout = control.scout.as_ref().expect("a scout");
    let manipulator = config.manipulator.clone().expect("a rod");
    Rehearsal::new(scout, control, &config.description, manipulator)
}

fn target(angles_deg: [f64; 2]) -> ReferenceTarget {
    directions_planar(angles_deg).into()
}

/// What the scout said of each target when the loop steered to it.
fn played(setup: &Setup, targets_deg: &[[f64; 2]]) -> Vec<Verdict> {
    let mut bench = Bench::new(setup);
    bench.run(0.3, |_, _| ());
    bench.request(Verb::Arm);
    bench.run(0.2, |_, _| ());
    bench.request(Verb::Go);
    bench.run(0.1, |_, _| ());
    let mut verdicts = Vec::new();
    for angles in targets_deg {
        bench.request(Verb::SetTarget(target(*angles)));
        let mut verdict = Verdict::Unchecked;
        bench.run(1.5, |record, _| verdict = record.decision.verdict);
        verdicts.push(verdict);
    }
    verdicts
}

/// Goal: margins and currents agree as far as the model's bias, which the scout knows and a rehearsal does not, lets them.
#[test]
fn rehearsal_foresees_what_the_scout_finds() {
    let setup = Setup::shipped("bigmag-planar.toml");
    let targets = [[90.0, 90.0], [70.0, 70.0], [110.0, 70.0], [80.0, 110.0], [60.0, 90.0]];
    let mut rehearsal = rehearsal(&setup);
    for (angles, verdict) in targets.iter().zip(played(&setup, &targets)) {
        let Rehearsed { obstacle, current_max, margin_min, error, .. } = rehearsal.step(&target(*angles));
        let Verdict::Clear { margin_min: margin_found, current_max: current_found } = verdict else {
            panic!("{angles:?}: {verdict:?}");
        };
        assert_eq!(obstacle, None, "{angles:?}");
        assert!(error.to_degrees() < 1.0, "{angles:?}: {error}");
        assert!((margin_min - margin_found).abs() < 0.15, "{angles:?}: {margin_min} and {margin_found}");
        assert!((current_max - current_found).abs() < 0.8, "{angles:?}: {current_max} and {current_found}");
    }
}

#[test]
fn rehearsal_ends_where_the_scout_refuses() {
    let setup = Setup::shipped("bigmag-snap.toml");
    let targets = [[90.0, 90.0], [80.0, 90.0], [60.0, 90.0]];
    let verdicts = played(&setup, &targets);
    let mut rehearsal = rehearsal(&setup);
    let obstacles = targets.map(|angles| rehearsal.step(&target(angles)).obstacle);
    assert!(
        matches!(verdicts[..], [Verdict::Clear { .. }, Verdict::Clear { .. }, Verdict::Refused { .. }]),
        "{verdicts:?}"
    );
    assert_eq!(obstacles[..2], [None, None]);
    let (obstacle, share) = obstacles[2].expect("beyond a snap-through");
    assert!(matches!(obstacle, Obstacle::NearSnapThrough | Obstacle::BranchEnds), "{obstacle:?}");
    assert!(share > 0.2 && share < 1.0, "{share}");
}

/// Goal: where a rehearsal says that the rod stands, the statics solved afresh at those currents stand too; and one that begins there
/// goes on as the first would.
#[test]
fn rehearsed_postures_are_equilibria_and_good_to_begin_at() {
    let setup = Setup::shipped("bigmag-planar.toml");
    let mut first = rehearsal(&setup);
    let there = first.step(&target([75.0, 100.0]));
    let actuation = there.posture.equilibrium.actuation;
    let rig = &setup.config.description;
    let manipulator = setup.config.manipulator.as_ref().expect("a rod");
    let posed = CoilArray::new(rig).posed(&actuation.angle_rad[..rig.frames.len()]);
    let mut pass = Pass::new(manipulator);
    let field = posed.actuated(&actuation.current_a[..rig.coils.len()]);
    assert!(manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass).converged());
    for (magnet, direction) in pass.magnets().iter().zip(&there.posture.directions) {
        let apart = angle_between(&magnet.tangent(), &Vector3::from(*direction));
        assert!(apart < 1e-6, "{apart}");
    }
    let mut second = rehearsal(&setup);
    second.begin_at(&there.posture.equilibrium).expect("an equilibrium");
    let next = target([90.0, 110.0]);
    let [one, other] = [first.step(&next), second.step(&next)];
    assert_eq!((one.obstacle, other.obstacle), (None, None));
    assert!((one.current_max - other.current_max).abs() < 0.1, "{} {}", one.current_max, other.current_max);
    assert!((one.margin_min - other.margin_min).abs() < 0.02, "{} {}", one.margin_min, other.margin_min);
}
