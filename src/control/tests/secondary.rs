//! Frames that move while the currents hold the targets: in the model, quasi-statically, one cycle after another.

use magsteer_hal::Actuation;
use magsteer_hal::invalid::Checks;
use nalgebra::DVector;

use super::fixtures::{Rig, numbers, seeded};
use crate::control::{Allocation, FrameUse, MarginGuardConfig, Model, Wish};

const PERIOD: f64 = 1e-3;
const ROWS: usize = 4;

/// A model under its own allocation, which wants nothing of the magnets.
struct Bench {
    rig: Rig,
    model: Model,
    allocation: Allocation,
    at: Actuation,
}

impl Bench {
    /// At an actuation, reached from rest in small steps; `conditioning` in deg/s, `centering` in 1/s.
    fn new(values: &[f64], conditioning: f64, centering: f64) -> Self {
        let mut rig = Rig::shipped();
        rig.control.frame_angles = FrameUse::Steer;
        rig.control.determinant_wanted = 0.0;
        let secondary = rig.control.secondary.as_mut().expect("shipped");
        secondary.conditioning_max_deg_per_s = conditioning;
        secondary.frame_centering_per_s = centering;
        let mut model = Model::new(&rig.description, rig.manipulator.clone(), rig.control.passes_max);
        model.follow_expected_power(secondary.disturbance_deg.to_radians());
        for step in 1..=500 {
            let share = f64::from(step) / 500.0;
            let there: Vec<f64> = values.iter().map(|value| value * share).collect();
            assert!(model.follow(&rig.actuation(&there)).converged);
        }
        let at = rig.actuation(values);
        for _ in 0..rig.parameters() {
            model.follow(&at);
        }
        let allocation = Allocation::new(&rig.control, &rig.description, ROWS);
        Self { rig, model, allocation, at }
    }

    /// Rows of the orientation Jacobian: two components of each tangent's change across it.
    fn jacobian(&self) -> Vec<f64> {
        let mut rows = Vec::new();
        for magnet in 0..2 {
            let tangent = self.model.tangent(magnet);
            let across = crate::math::orthonormal_complement(&tangent);
            let [x, y, z] = self.model.tangent_jacobian(magnet);
            for axis in across {
                rows.extend((0..x.len()).map(|u| axis.x * x[u] + axis.y * y[u] + axis.z * z[u]));
            }
        }
        rows
    }

    /// One cycle with this wish for the rows; the increments.
    fn step(&mut self, step: &[f64]) -> Vec<f64> {
        let jacobian = self.jacobian();
        self.allocation.allocate(&Wish {
            jacobian: &jacobian,
            step,
            admitted: &self.at,
            period: PERIOD,
            determinant: self.model.determinant(),
            determinant_gradient: self.model.determinant_gradient(),
            frame_angles: None,
            margin: None,
            expected_power: self.model.expected_power(),
        });
        let increment = self.allocation.increment().to_vec();
        let values = self.rig.values(&self.at);
        let next: Vec<f64> = values.iter().zip(&increment).map(|(value, change)| value + change).collect();
        self.at = self.rig.actuation(&next);
        assert!(self.model.follow(&self.at).converged);
        increment
    }

    fn angles_deg(&self) -> [f64; 2] {
        [0, 1].map(|frame| self.at.angle_rad[frame].to_degrees())
    }
}

/// A posture out of the plane, frames apart, with currents that are far from the least.
const POSTURE: [f64; 8] = [1.0, -0.8, -1.2, -0.6, 0.7, -0.9, 0.8, 1.2];

/// Goal: while nothing is wanted of the magnets, what frames and currents do together lies in the null space of the Jacobian to
/// rounding, within the frames' speed and acceleration, and it lowers `V` from cycle to cycle until a setting is reached
/// around which `V` is flat along the frames.
#[test]
fn frames_lower_the_expected_power_without_turning_the_magnets() {
    let mut bench = Bench::new(&POSTURE, 20.0, 0.0);
    let tangents = [0, 1].map(|magnet| bench.model.tangent(magnet));
    let first = bench.model.expected_power().expect("followed").0;
    let acceleration = bench.rig.control.reference_frame_acceleration_max_deg_per_s2.to_radians();
    let (mut power, mut speed) = (first, [0.0; 2]);
    for cycle in 0..20_000 {
        let jacobian = bench.jacobian();
        let increment = bench.step(&[0.0; ROWS]);
        let (mut largest, mut turned) = (0.0_f64, 0.0_f64);
        for row in jacobian.chunks_exact(8) {
            turned = turned.max(row.iter().zip(&increment).map(|(a, b)| a * b).sum::<f64>().abs());
            largest = largest.max(row.iter().zip(&increment).map(|(a, b)| (a * b).abs()).sum());
        }
        // Rounding of the decomposition, whose condition is some tens here.
        assert!(turned <= 1e-11 * largest + 1e-16, "cycle {cycle}: {turned} of {largest}");
        for frame in 0..2 {
            let next = increment[6 + frame] / PERIOD;
            assert!((next - speed[frame]).abs() <= acceleration * PERIOD * (1.0 + 1e-9), "cycle {cycle}");
            assert!(next.abs() <= 45.0_f64.to_radians());
            speed[frame] = next;
        }
        let now = bench.model.expected_power().expect("followed").0;
        // Entries of the gradient are up to eight cycles old, and the frames brake no faster than they may.
        assert!(now <= power * (1.0 + 1e-5), "cycle {cycle}: {power} grows to {now}");
        power = now;
    }
    println!("V from {first:.2} to {power:.2} A^2, frames at {:.1?} deg", bench.angles_deg());
    assert!(power < 0.8 * first, "{first} {power}");
    assert!(speed.iter().all(|speed| speed.abs() < 1.0_f64.to_radians()), "still on the way: {speed:?}");
    // To first order nothing turns the magnets; what is left is second order in some 10 um of steps, 20 000 of them.
    for (magnet, tangent) in tangents.iter().enumerate() {
        let off = (bench.model.tangent(magnet) - tangent).norm();
        assert!(off < 0.02, "magnet {magnet} turned by {off}");
    }
}

/// Goal: without conditioning the frames return home, and stand.
#[test]
fn frames_return_home_when_nothing_else_moves_them() {
    let mut bench = Bench::new(&[0.4, -0.3, -0.5, -0.2, 0.3, -0.3, 0.3, 0.2], 0.0, 2.0);
    for _ in 0..6000 {
        bench.step(&[0.0; ROWS]);
    }
    let [bottom, top] = bench.angles_deg();
    assert!((bottom - 45.0).abs() < 0.1 && (top - 67.5).abs() < 0.1, "{bottom} {top}");
}

/// Goal: where frames are told where to go, currents decay as on the ways that planner and scout walk, whatever the expected power would have.
#[test]
fn currents_decay_as_on_planned_ways_where_frames_are_told() {
    let bench = Bench::new(&POSTURE, 20.0, 0.1);
    let jacobian = bench.jacobian();
    let increment = |told: bool, expected_power| {
        let mut allocation = bench.allocation.clone();
        allocation.allocate(&Wish {
            jacobian: &jacobian,
            step: &[0.0; ROWS],
            admitted: &bench.at,
            period: PERIOD,
            determinant: bench.model.determinant(),
            determinant_gradient: bench.model.determinant_gradient(),
            frame_angles: told.then_some(&bench.at.angle_rad),
            margin: None,
            expected_power,
        });
        allocation.increment().to_vec()
    };
    let known = bench.model.expected_power();
    assert!(known.is_some());
    let decay = increment(true, None);
    assert!(decay.iter().any(|change| change.abs() > 1e-6), "or nothing is seen of it: {decay:?}");
    assert_eq!(increment(true, known), decay);
    assert_ne!(increment(false, known)[..6], decay[..6]);
}

/// Goal: never at the cost of the primary task: what a wish of the rows leaves undone is the same with the tasks of the frames and
/// without, to what the damping makes of rounding, where no limit is met.
#[test]
fn the_primary_task_is_met_alike_with_and_without_the_tasks_of_the_frames() {
    let mut random = seeded(21);
    let [mut with, mut without] = [(20.0, 1.0), (0.0, 0.0)]
        .map(|(conditioning, centering)| Bench::new(&POSTURE, conditioning, centering));
    for _ in 0..50 {
        let step = numbers(ROWS, 1e-4, &mut random);
        let left = [&mut with, &mut without].map(|bench| {
            // Both from the same posture; the frames' speed is kept.
            bench.at = bench.rig.actuation(&POSTURE);
            while !bench.model.follow(&bench.at).converged {}
            bench.model.follow(&bench.at);
            let jacobian = bench.jacobian();
            let increment = bench.step(&step);
            let done =
                jacobian.chunks_exact(8).map(|row| row.iter().zip(&increment).map(|(a, b)| a * b).sum());
            DVector::from_vec(step.clone()) - DVector::from_iterator(ROWS, done)
        });
        let apart = (&left[0] - &left[1]).norm();
        assert!(apart < 1e-10, "{apart}: {} {}", left[0], left[1]);
        assert!(left[1].norm() < 1e-5);
    }
    let moved = with.angles_deg();
    assert!((moved[0] - 0.8_f64.to_degrees()).abs() > 1e-3, "the frames must have moved: {moved:?}");
}

#[test]
fn each_bad_value_of_the_guard_is_named_by_its_key() {
    let right = MarginGuardConfig { floor: 0.1, rate_per_s: 10.0 };
    for (config, key) in [
        (MarginGuardConfig { floor: -1.5, ..right }, "floor"),
        (MarginGuardConfig { floor: f64::NAN, ..right }, "floor"),
        (MarginGuardConfig { rate_per_s: 0.0, ..right }, "rate_per_s"),
        (MarginGuardConfig { rate_per_s: f64::INFINITY, ..right }, "rate_per_s"),
    ] {
        let mut checks = Checks::new();
        config.check(&mut checks);
        let found = checks.into_result(()).expect_err("refused");
        let keys: Vec<&str> = found.iter().map(|invalid| invalid.key.as_str()).collect();
        assert_eq!(keys, [format!("control.margin_guard.{key}")]);
    }
}
