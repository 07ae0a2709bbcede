//! The Jacobian under BigMag's coils against differences of full re-solves.
//!
//! Goal: the exact Jacobian is the derivative of the equilibrium with every current and every frame angle to 1e-6 relative, at random
//! equilibria; the frozen-wrench Jacobian is what Algorithm 1 of the paper tends to, and far from the true one.
//!
//! Relative means: norm of the deviation of a column over the norm of that column, a column being the tangents of both magnets
//! (or both rotation vectors, or both positions) with one parameter.

#[path = "exact_jacobian/dead_wrenches.rs"]
mod dead_wrenches;

use std::path::Path;

use dead_wrenches::{DeadWrench, Oracle};
use magsteer::config::Config;
use magsteer::magnetics::{ActuatedArray, AppliedField, CoilArray, FieldSample};
use magsteer::rod::{Manipulator, Pass, PassMode, RodConfig, TipLoad, Wrenches};
use magsteer_hal::{Actuation, HardwareDescription};
use nalgebra::{DVector, Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const POSES: PassMode = PassMode { poses: true, wrenches: Wrenches::Following };
const FROZEN: PassMode = PassMode { poses: true, wrenches: Wrenches::Frozen };

/// Mesh of the shipped configuration, mm.
const MESH_SHIPPED_MM: f64 = 3.2;

/// Margins within which differences can follow: nearer to a snap-through (0) the derivative itself is without bound, and under pulls so
/// strong that the determinant is huge differences drown in the rounding that shooting amplifies.
const MARGINS: std::ops::Range<f64> = 0.05..1e4;

/// Turn of the magnets, rad, by one step of a difference of fourth order: truncation, some 1e-17 times a
/// fifth derivative, and rounding, 1e-15 / 7e-5 times the amplification of shooting, then stay below 1e-7.
const TURN: f64 = 7e-5;

/// Offsets and weights of the central difference of fourth order.
const STENCIL: [(f64, f64); 4] =
    [(-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0)];

/// BigMag and its manipulator on some mesh.
struct Rig {
    description: HardwareDescription,
    array: CoilArray,
    manipulator: Manipulator,
}

impl Rig {
    fn bigmag(segment_length_max_mm: f64) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        let (_, config) = Config::load(&path).expect("shipped");
        // Residuals near rounding, so that differences of solutions are clean.
        let rod = RodConfig {
            segment_length_max_mm,
            residual_tolerance: 1e-12,
            iterations_max: 50,
            rotation_step_max_deg: 20.0,
            passes_max: 20_000,
        };
        let manipulator = rod.build(&config.description).expect("shipped");
        let array = CoilArray::new(&config.description);
        Self { description: config.description, array, manipulator }
    }

    fn parameters(&self) -> usize {
        self.array.coil_count() + self.array.frame_count()
    }

    fn steered(&self, actuation: &Actuation, parameter: usize, by: f64) -> Actuation {
        let mut steered = *actuation;
        if parameter < self.array.coil_count() {
            steered.current_a[parameter] += by;
        } else {
            steered.angle_rad[parameter - self.array.coil_count()] += by;
        }
        steered
    }

    /// Runs `work` with the field under an actuation.
    fn with_field<T>(&self, actuation: &Actuation, work: impl FnOnce(&ActuatedArray<'_>) -> T) -> T {
        let posed = self.array.posed(&actuation.angle_rad[..self.array.frame_count()]);
        work(&posed.actuated(&actuation.current_a[..self.array.coil_count()]))
    }

    /// A random actuation and its equilibrium, found from rest to the floor of rounding, in `pass`.
    fn equilibrium(&self, current_max: f64, random: &mut ChaCha8Rng, pass: &mut Pass) -> Option<Actuation> {
        let mut actuation = Actuation::default();
        for current in &mut actuation.current_a[..self.array.coil_count()] {
            *current = random.random_range(-current_max..current_max);
        }
        for (angle, frame) in actuation.angle_rad.iter_mut().zip(&self.description.frames) {
            *angle = random.random_range(frame.angle_min..frame.angle_max);
        }
        let found = self.with_field(&actuation, |field| {
            let solution = self.manipulator.solve_from_rest(field, &TipLoad::NONE, POSES, pass);
            let regular = MARGINS.contains(&pass.determinant()) && pass.field_valid();
            let found = solution.converged() && !solution.lost_stability && regular;
            found && self.polish(field, pass)
        });
        found.then_some(actuation)
    }

    /// One Newton step more than the tolerance asks for.
    fn polish(&self, field: &ActuatedArray<'_>, pass: &mut Pass) -> bool {
        let Some(step) = pass.newton_step() else { return false };
        let unknowns = pass.unknowns() + step;
        self.manipulator.pass(field, &TipLoad::NONE, &unknowns, POSES, pass);
        true
    }

    /// Columns of tangents, rotation vectors and positions with one parameter, by differences between full re-solves.
    fn differences(
        &self,
        actuation: &Actuation,
        parameter: usize,
        at: &Pass,
        scratch: &mut Pass,
    ) -> [DVector<f64>; 3] {
        let step = step(at, parameter);
        let mut sums = [(); 3].map(|()| DVector::zeros(3 * at.magnets().len()));
        for (offset, weight) in STENCIL {
            let steered = self.steered(actuation, parameter, offset * step);
            self.with_field(&steered, |field| {
                let guess = at.unknowns();
                let solution = self.manipulator.solve(field, &TipLoad::NONE, &guess, POSES, scratch);
                assert!(solution.converged(), "{solution:?}");
                assert!(self.polish(field, scratch));
            });
            for (index, (there, here)) in scratch.magnets().iter().zip(at.magnets()).enumerate() {
                let turn = rotation_between(&here.rotation(), &there.rotation());
                for (sum, part) in sums.iter_mut().zip([there.tangent(), turn, there.position()]) {
                    let mut rows = sum.rows_mut(3 * index, 3);
                    rows += part * (weight / step);
                }
            }
        }
        sums
    }
}

/// A step of a parameter that turns the magnets by [`TURN`].
fn step(pass: &Pass, parameter: usize) -> f64 {
    TURN / columns(pass, parameter)[1].norm()
}

/// Columns of tangents, rotation vectors and positions with one parameter, as the pass says.
fn columns(pass: &Pass, parameter: usize) -> [DVector<f64>; 3] {
    let mut columns = [(); 3].map(|()| DVector::zeros(3 * pass.magnets().len()));
    for magnet in 0..pass.magnets().len() {
        let blocks = [
            pass.tangent_jacobian(magnet),
            pass.rotation_jacobian(magnet).expect("asked for"),
            pass.position_jacobian(magnet).expect("asked for"),
        ];
        for (column, rows) in columns.iter_mut().zip(blocks) {
            for (axis, row) in rows.iter().enumerate() {
                column[3 * magnet + axis] = row[parameter];
            }
        }
    }
    columns
}

/// Rotation vector that takes `from` to `to`, world, by the skew part: exact to rounding for small angles.
fn rotation_between(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Vector3<f64> {
    let r = to * from.transpose();
    let sine = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) * 0.5;
    let length = sine.norm();
    if length > 0.0 { sine * (length.asin() / length) } else { sine }
}

/// Worst relative deviation of a column of tangents, rotations and positions over `count` random equilibria.
fn worst_deviations(rig: &Rig, count: u32, seed: u64) -> [f64; 3] {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut pass, mut scratch) = (Pass::new(&rig.manipulator), Pass::new(&rig.manipulator));
    let (mut worst, mut checked, mut skipped) = ([0.0_f64; 3], 0, 0);
    while checked < count {
        let Some(actuation) = rig.equilibrium(3.0, &mut random, &mut pass) else {
            skipped += 1;
            assert!(skipped < 20 * count, "the draws have hardly any equilibria");
            continue;
        };
        checked += 1;
        for parameter in 0..rig.parameters() {
            let exact = columns(&pass, parameter);
            let expected = rig.differences(&actuation, parameter, &pass, &mut scratch);
            for (worst, (exact, expected)) in worst.iter_mut().zip(exact.iter().zip(&expected)) {
                *worst = worst.max((exact - expected).norm() / expected.norm());
            }
        }
    }
    println!("{checked} equilibria, {skipped} draws skipped: tangents, rotations, positions {worst:?}");
    worst
}

#[test]
fn exact_jacobian_equals_differences_of_full_solves_on_the_shipped_mesh() {
    for worst in worst_deviations(&Rig::bigmag(MESH_SHIPPED_MM), 100, 1) {
        assert!(worst < 1e-6, "{worst}");
    }
}

#[test]
fn exact_jacobian_equals_differences_of_full_solves_on_a_fine_mesh() {
    for worst in worst_deviations(&Rig::bigmag(1.0), 100, 2) {
        assert!(worst < 1e-6, "{worst}");
    }
}

/// Goal: the frozen-wrench Jacobian is the derivative of a rod under dead wrenches that change with the actuation where the magnets
/// were: the limit of Algorithm 1 for small steps. The dead-wrench rod is integrated by code of this test's own.
#[test]
fn frozen_wrench_jacobian_is_the_limit_of_algorithm_1() {
    let rig = Rig::bigmag(0.5);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut pass = Pass::new(&rig.manipulator);
    let (mut worst, mut checked) = (0.0_f64, 0);
    while checked < 5 {
        let Some(actuation) = rig.equilibrium(3.0, &mut random, &mut pass) else { continue };
        checked += 1;
        let unknowns = pass.unknowns();
        rig.with_field(&actuation, |field| {
            rig.manipulator.pass(field, &TipLoad::NONE, &unknowns, FROZEN, &mut pass);
        });
        let mut oracle = Oracle::new(&rig.description, 0.5e-3);
        for parameter in 0..rig.parameters() {
            let step = step(&pass, parameter);
            let mut sum = DVector::zeros(3 * pass.magnets().len());
            for (offset, weight) in STENCIL {
                let steered = rig.steered(&actuation, parameter, offset * step);
                let wrenches =
                    rig.with_field(&steered, |field| held_wrenches(&rig.description, &pass, field));
                let tangents = oracle.tangents(&wrenches, &unknowns);
                sum += tangents * (weight / step);
            }
            let frozen = &columns(&pass, parameter)[0];
            worst = worst.max((frozen - &sum).norm() / sum.norm());
        }
    }
    println!("frozen-wrench Jacobian against dead wrenches: {worst:.2e}");
    // Both integrate by Runge-Kutta with steps of 0.5 mm, a fiftieth of a section: 1e-8 at most.
    assert!(worst < 1e-6, "{worst}");
}

/// Wrenches of a field on the magnets held where they are in `pass`.
fn held_wrenches(
    description: &HardwareDescription,
    pass: &Pass,
    field: &ActuatedArray<'_>,
) -> Vec<DeadWrench> {
    let mut sample = FieldSample::default();
    let magnets = pass.magnets().iter().zip(description.magnets());
    magnets
        .map(|(magnet, described)| {
            field.evaluate(&magnet.position(), &mut sample);
            let moment = magnet.rotation() * Vector3::from(described.moment_body);
            DeadWrench { force: sample.gradient.matrix() * moment, torque: moment.cross(&sample.field) }
        })
        .collect()
}

/// Goal: what `Algorithm 1` leaves out matters: in BigMag's gradients, at no more than 3 A, the frozen-wrench Jacobian is
/// far from the true one.
#[test]
fn frozen_wrenches_mislead_in_strong_gradients() {
    let rig = Rig::bigmag(MESH_SHIPPED_MM);
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut pass = Pass::new(&rig.manipulator);
    let mut ratios = Vec::new();
    while ratios.len() < 100 {
        let Some(actuation) = rig.equilibrium(3.0, &mut random, &mut pass) else { continue };
        let coils = rig.array.coil_count();
        let tangents = |pass: &Pass| -> Vec<DVector<f64>> {
            (0..coils).map(|parameter| columns(pass, parameter)[0].clone()).collect()
        };
        let exact = tangents(&pass);
        let unknowns = pass.unknowns();
        rig.with_field(&actuation, |field| {
            rig.manipulator.pass(field, &TipLoad::NONE, &unknowns, FROZEN, &mut pass);
        });
        let frozen = tangents(&pass);
        let squared = |columns: &mut dyn Iterator<Item = f64>| columns.map(|norm| norm * norm).sum::<f64>();
        let off = squared(&mut exact.iter().zip(&frozen).map(|(exact, frozen)| (exact - frozen).norm()));
        let whole = squared(&mut exact.iter().map(|exact| exact.norm()));
        ratios.push((off / whole).sqrt());
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "frozen against exact, Frobenius norm of the current columns: least {:.3}, median {:.3}, most {:.3}",
        ratios[0], ratios[50], ratios[99]
    );
    assert!(ratios[99] > 0.2, "somewhere it must be more than a fifth off: {}", ratios[99]);
}
