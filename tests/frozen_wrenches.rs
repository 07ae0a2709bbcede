//! What freezing the wrenches does: to the Jacobian of Algorithm 1, and to a loop that is closed with it.
//!
//! Goal: the numbers of `src/control/docs/frozen_wrenches.md` are those of the present code, and its claims hold.

#[path = "frozen_wrenches/delayed.rs"]
mod delayed;
mod page_table;
#[path = "frozen_wrenches/statics.rs"]
mod statics;

use delayed::DelayedRig;
use magsteer::control::JacobianKind;
use nalgebra::DMatrix;
use page_table::{Row, hold};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statics::{Jacobians, Rig, planar_angles_deg};

const PAGE: &str = "src/control/docs/frozen_wrenches.md";

/// Planar targets, deg from z, that the shipped rod reaches on a stable branch by least currents.
const TARGETS_DEG: [[f64; 2]; 5] = [[90.0, 90.0], [75.0, 80.0], [105.0, 95.0], [110.0, 70.0], [90.0, 120.0]];

/// Deviation of the current columns in Frobenius norm, then the least and greatest ratio of their lengths and the least and greatest angle
/// between them, deg.
fn deviations(jacobians: &Jacobians) -> [f64; 5] {
    let [exact, frozen] = [&jacobians.exact, &jacobians.frozen];
    let columns = || exact.column_iter().zip(frozen.column_iter());
    let ratios: Vec<f64> = columns().map(|(exact, frozen)| frozen.norm() / exact.norm()).collect();
    let angles: Vec<f64> = columns()
        .map(|(exact, frozen)| (exact.dot(&frozen) / (exact.norm() * frozen.norm())).acos().to_degrees())
        .collect();
    let least = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    [(exact - frozen).norm() / exact.norm(), least(&ratios), most(&ratios), least(&angles), most(&angles)]
}

#[test]
fn the_frozen_jacobian_is_far_from_the_exact_one() {
    let shipped = Rig::load("bigmag-planar.toml");
    let reference = Rig::load("reference-two-magnets.toml");
    let mut rows = Vec::new();
    let named = [
        (
            "reference manipulator at (-2, 0, -0.5, 2.5, 2, 2.5) A",
            &reference,
            [-2.0, 0.0, -0.5, 2.5, 2.0, 2.5],
        ),
        ("shipped manipulator at (-3, 0, 3, 2.5, 1, 3) A", &shipped, [-3.0, 0.0, 3.0, 2.5, 1.0, 3.0]),
    ];
    for (name, rig, currents) in named {
        let found =
            deviations(&rig.jacobians(&rig.led_from_rest(&currents, &[0.0, 0.0]).expect("an equilibrium")));
        assert!(found[0] > 1.0, "more than its own size away: {found:?}");
        rows.push(Row { name: name.to_owned(), numbers: found.to_vec() });
    }
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut all = Vec::new();
    while all.len() < 200 {
        let currents: Vec<f64> = (0..6).map(|_| random.random_range(-3.0..3.0)).collect();
        let angles: Vec<f64> = (0..2).map(|_| random.random_range(-1.5..1.5)).collect();
        all.extend(
            shipped.led_from_rest(&currents, &angles).map(|state| deviations(&shipped.jacobians(&state))),
        );
    }
    for (name, share) in [("least", 0.0), ("median", 0.5), ("most", 1.0)] {
        let of = |index: usize| {
            let mut values: Vec<f64> = all.iter().map(|found| found[index]).collect();
            values.sort_by(f64::total_cmp);
            values[((values.len() - 1) as f64 * share) as usize]
        };
        let numbers = (0..5).map(of).collect();
        rows.push(Row { name: format!("shipped manipulator, 200 random states to 3 A: {name}"), numbers });
    }
    assert!(rows[3].numbers[0] > 0.3, "half of all states are more than a third off");
    hold(PAGE, "jacobian", &rows);
}

/// Goal: the loop with Algorithm 1's Jacobian turns a wanted step `s` into `J_exact J_frozen^+ s`. The eigenvalues of that map multiply
/// the law's gain; and what the frozen Jacobian takes for its null space does turn the magnets.
#[test]
fn the_loop_gain_changes_by_the_ratio_of_the_jacobians() {
    let rig = Rig::load("bigmag-planar.toml");
    let mut rows = Vec::new();
    for target in TARGETS_DEG {
        let state = rig.at_target(target);
        let [first, second] = planar_angles_deg(&state.pass);
        assert!((first - target[0]).abs() < 1e-3 && (second - target[1]).abs() < 1e-3);
        let margin = state.pass.determinant();
        let planar = rig.jacobians(&state).planar(&state.pass);
        let map = &planar.exact * pseudo_inverse(&planar.frozen);
        let gains = map.complex_eigenvalues();
        let size = |index: usize| gains[index].norm();
        let null = DMatrix::identity(6, 6) - pseudo_inverse(&planar.frozen) * &planar.frozen;
        let leak = 100.0 * (&planar.exact * null).norm() / planar.exact.norm();
        let [low, high] = if size(0) < size(1) { [0, 1] } else { [1, 0] };
        let numbers = vec![margin, size(low), size(high), gains[high].arg().abs().to_degrees(), leak];
        // Positive real parts: a small gain converges with either Jacobian.
        assert!(margin > 0.0 && gains.iter().all(|gain| gain.re > 0.0), "{target:?}: {numbers:?}");
        rows.push(Row { name: format!("({}, {})", target[0], target[1]), numbers });
    }
    let most = rows.iter().map(|row| row.numbers[2]).fold(0.0, f64::max);
    assert!(most > 1.3, "somewhere the loop is much faster than its gain says: {most}");
    hold(PAGE, "gains", &rows);
}

/// Goal: the same in three dimensions, at random states: how far the gain is off, and whether any direction is steered the wrong way.
#[test]
fn in_three_dimensions_the_loop_gain_is_spread_further() {
    let rig = Rig::load("bigmag-planar.toml");
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let (mut least, mut most, mut astray) = (Vec::new(), Vec::new(), 0);
    while most.len() < 200 {
        let currents: Vec<f64> = (0..6).map(|_| random.random_range(-3.0..3.0)).collect();
        let angles: Vec<f64> = (0..2).map(|_| random.random_range(-1.5..1.5)).collect();
        let Some(state) = rig.led_from_rest(&currents, &angles) else { continue };
        let spatial = rig.jacobians(&state).spatial(&state.pass);
        let gains = (&spatial.exact * pseudo_inverse(&spatial.frozen)).complex_eigenvalues();
        least.push(gains.iter().map(|gain| gain.norm()).fold(f64::INFINITY, f64::min));
        most.push(gains.iter().map(|gain| gain.norm()).fold(0.0, f64::max));
        astray += u32::from(gains.iter().any(|gain| gain.re <= 0.0));
    }
    let mut rows = Vec::new();
    for (name, mut values) in [("least gain", least), ("greatest gain", most)] {
        values.sort_by(f64::total_cmp);
        let numbers = [0, 19, 99, 179, 199].map(|index| values[index]).to_vec();
        rows.push(Row { name: name.to_owned(), numbers });
    }
    assert_eq!(astray, 0, "no direction is steered the wrong way");
    assert!(rows[0].numbers[2] < 0.7, "half of all states have a direction at less than 0.7 of the gain");
    assert!(rows[1].numbers[3] > 2.0, "a tenth of all states have one at more than twice the gain");
    hold(PAGE, "spatial", &rows);
}

fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    matrix.clone().pseudo_inverse(1e-9).expect("of full rank")
}

/// Goal: behind a pure delay the greatest stable gain with either Jacobian is what those eigenvalues say, so that freezing moves the gain margin by
/// their ratio.
#[test]
fn the_gain_margin_moves_with_the_loop_gain() {
    let rig = Rig::load("bigmag-planar.toml");
    let mut rows = Vec::new();
    for target in TARGETS_DEG {
        let state = rig.at_target(target);
        let planar = rig.jacobians(&state).planar(&state.pass);
        let gains = (&planar.exact * pseudo_inverse(&planar.frozen)).complex_eigenvalues();
        let limits = gains.iter().map(|gain| DelayedRig::greatest_gain(gain.norm(), gain.arg()));
        let expected_frozen = limits.fold(f64::INFINITY, f64::min);
        let expected_exact = DelayedRig::greatest_gain(1.0, 0.0);
        let exact = DelayedRig::new(&rig, &state, JacobianKind::Exact).measured_greatest_gain();
        let frozen = DelayedRig::new(&rig, &state, JacobianKind::Algorithm1).measured_greatest_gain();
        // A bisection to 2 %, trials that end before the slowest growth shows, and columns by steps that are not infinitesimal.
        assert!((exact / expected_exact - 1.0).abs() < 0.05, "{target:?}: {exact} {expected_exact}");
        assert!((frozen / expected_frozen - 1.0).abs() < 0.05, "{target:?}: {frozen} {expected_frozen}");
        let name = format!("({}, {})", target[0], target[1]);
        rows.push(Row { name, numbers: vec![exact, frozen, expected_frozen, frozen / exact] });
    }
    hold(PAGE, "margin", &rows);
}
