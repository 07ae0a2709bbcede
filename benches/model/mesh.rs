//! How far the timed mesh is from the continuum: against one ten times finer.

use magsteer::magnetics::CoilArray;
use magsteer::rod::{Manipulator, Pass, PassMode, RodConfig, TipLoad};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::subjects::shipped;

/// Equilibria to compare.
const COUNT: usize = 100;
/// Greatest current, A, and angle of a frame, rad.
const CURRENT_MAX: f64 = 3.0;
const ANGLE_MAX: f64 = 1.0;

/// Prints the greatest difference of magnets and tip over random equilibria.
pub fn report() {
    let (document, config) = shipped();
    let rod: RodConfig = document.section("rod").expect("shipped");
    let fine = RodConfig { segment_length_max_mm: rod.segment_length_max_mm / 10.0, ..rod };
    let coarse = rod.build(&config.description).expect("shipped");
    let fine = fine.build(&config.description).expect("shipped");
    let array = CoilArray::new(&config.description);
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut passes = [Pass::new(&coarse), Pass::new(&fine)];
    let (mut worst_m, mut worst_rad, mut compared, mut tried) = (0.0_f64, 0.0_f64, 0, 0);
    while compared < COUNT {
        tried += 1;
        let angles: Vec<f64> =
            (0..array.frame_count()).map(|_| random.random_range(-ANGLE_MAX..ANGLE_MAX)).collect();
        let currents: Vec<f64> =
            (0..array.coil_count()).map(|_| random.random_range(-CURRENT_MAX..CURRENT_MAX)).collect();
        let posed = array.posed(&angles);
        let field = posed.actuated(&currents);
        let mode = PassMode::default();
        let [near, exact] = &mut passes;
        // A snap-through on the way leaves the two meshes free to land on different equilibria.
        let found = coarse.solve_from_rest(&field, &TipLoad::NONE, mode, near);
        if !found.converged() || found.lost_stability {
            continue;
        }
        let found = fine.solve(&field, &TipLoad::NONE, &near.unknowns(), mode, exact);
        assert!(found.converged(), "{found:?}");
        compared += 1;
        for ((position, rotation), (true_position, true_rotation)) in states(near).zip(states(exact)) {
            worst_m = worst_m.max((position - true_position).norm());
            worst_rad = worst_rad.max(angle(&(rotation.transpose() * true_rotation)));
        }
    }
    println!(
        "Mesh of {:.1} mm, {} steps, against one ten times finer: at most {worst_m:.1e} m and {worst_rad:.1e} rad \
         over magnets and tip of {COUNT} equilibria at up to {CURRENT_MAX} A ({tried} tried).",
        rod.segment_length_max_mm,
        steps(&coarse, rod.segment_length_max_mm),
    );
}

/// Position and rotation of every magnet and of the tip.
fn states(pass: &Pass) -> impl Iterator<Item = (Vector3<f64>, Matrix3<f64>)> {
    let magnets = pass.magnets().iter().map(|magnet| (magnet.position(), magnet.rotation()));
    magnets.chain(std::iter::once((pass.tip_position(), pass.tip_rotation())))
}

/// Angle of a small rotation, from its antisymmetric part.
fn angle(rotation: &Matrix3<f64>) -> f64 {
    let half = |i: usize, j: usize| 0.5 * (rotation[(i, j)] - rotation[(j, i)]);
    Vector3::new(half(2, 1), half(0, 2), half(1, 0)).norm().asin()
}

fn steps(manipulator: &Manipulator, length_max_mm: f64) -> String {
    let steps =
        manipulator.sections().map(|section| (section.length / (length_max_mm * 1e-3)).ceil().to_string());
    steps.collect::<Vec<_>>().join(" + ")
}
