//! Allocation: limits first, then the step, then currents and margin in what is left.

use magsteer_hal::Actuation;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::fixtures::{Rig, any_size, numbers, seeded};
use crate::control::{Allocation, AllocationKind, ControlConfig, FrameUse, MarginGuardConfig, Wish};

const ROWS: usize = 4;

/// An allocation under test on the shipped rig.
struct Bench {
    rig: Rig,
    allocation: Allocation,
    /// Range of each parameter, by which it is scaled.
    range: DVector<f64>,
}

impl Bench {
    fn new(kind: AllocationKind, frames: FrameUse) -> Self {
        let mut rig = Rig::shipped();
        (rig.control.allocation, rig.control.frame_angles) = (kind, frames);
        // Frames without a task of their own: what they do here is the primary task's and the margin's.
        let secondary = rig.control.secondary.as_mut().expect("shipped");
        (secondary.conditioning_max_deg_per_s, secondary.frame_centering_per_s) = (0.0, 0.0);
        let allocation = Allocation::new(&rig.control, &rig.description, ROWS);
        let mut range: Vec<f64> = rig.limits().iter().map(|[_, most, _]| *most).collect();
        if kind == AllocationKind::Bounded {
            let secondary = rig.control.secondary.as_ref().expect("shipped");
            let share = secondary.frame_share_deg.to_radians();
            range[rig.coils()..].fill(share);
        }
        Self { allocation, range: DVector::from_vec(range), rig }
    }

    /// A Jacobian of a few tenths of a radian over each range.
    fn jacobian(&self, random: &mut ChaCha8Rng) -> DMatrix<f64> {
        let columns = self.rig.parameters();
        let entries = numbers(ROWS * columns, 1.0, random);
        DMatrix::from_fn(ROWS, columns, |row, column| entries[row * columns + column] / self.range[column])
    }

    fn scaled(&self, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
        jacobian * DMatrix::from_diagonal(&self.range)
    }

    /// Allocates with a determinant in plenty; increments and the count of saturated parameters.
    fn allocate(
        &mut self,
        jacobian: &DMatrix<f64>,
        step: &[f64],
        admitted: &Actuation,
        period: f64,
    ) -> (DVector<f64>, u32) {
        self.allocate_at(jacobian, step, admitted, period, (10.0, &[0.0; 8]))
    }

    fn allocate_at(
        &mut self,
        jacobian: &DMatrix<f64>,
        step: &[f64],
        admitted: &Actuation,
        period: f64,
        stiffness: (f64, &[f64]),
    ) -> (DVector<f64>, u32) {
        self.allocate_near_a_fold(jacobian, step, admitted, period, stiffness, None)
    }

    fn allocate_near_a_fold(
        &mut self,
        jacobian: &DMatrix<f64>,
        step: &[f64],
        admitted: &Actuation,
        period: f64,
        (determinant, gradient): (f64, &[f64]),
        margin: Option<(f64, &[f64])>,
    ) -> (DVector<f64>, u32) {
        let by_rows: Vec<f64> = jacobian.transpose().as_slice().to_vec();
        let allocated = self.allocation.allocate(&Wish {
            jacobian: &by_rows,
            step,
            admitted,
            period,
            determinant,
            determinant_gradient: gradient,
            margin,
            expected_power: None,
            frame_angles: None,
        });
        (DVector::from_row_slice(self.allocation.increment()), allocated.saturated)
    }
}

/// Goal: whatever is wished, no parameter leaves its range or exceeds its rate; one that is beyond its range already is
/// not led further.
#[test]
fn increments_never_leave_the_box_of_value_and_rate() {
    let mut random = seeded(1);
    let mut at_limits = 0;
    for kind in [AllocationKind::Bounded, AllocationKind::TruncatedSvd] {
        for frames in [FrameUse::Steer, FrameUse::Hold] {
            let mut bench = Bench::new(kind, frames);
            let (limits, parameters) = (bench.rig.limits(), bench.rig.parameters());
            for _ in 0..3000 {
                let mut jacobian = bench.jacobian(&mut random) * any_size(1e-6, 1e3, &mut random);
                if random.random_bool(0.2) {
                    // Two rows alike: a singular Jacobian.
                    let row = jacobian.row(0).into_owned();
                    jacobian.set_row(1, &row);
                }
                let step = numbers(ROWS, any_size(1e-9, 1e3, &mut random), &mut random);
                let reach = if random.random_bool(0.1) { 1.2 } else { 1.0 };
                let values: Vec<f64> = limits
                    .iter()
                    .map(|[_, most, _]| most * reach * random.random_range(-1.0..=1.0))
                    .collect();
                let admitted = bench.rig.actuation(&values);
                let period = any_size(1e-5, 0.1, &mut random);
                let margin = random.random_range(-1.0..2.0);
                let gradient = numbers(parameters, any_size(1e-3, 1e3, &mut random), &mut random);
                let (increment, saturated) =
                    bench.allocate_at(&jacobian, &step, &admitted, period, (margin, &gradient));
                at_limits += saturated;
                for (index, change) in increment.iter().enumerate() {
                    let [least, most, rate] = limits[index];
                    // Rounding of a few operations on numbers of the size of the range.
                    let slack = 1e-14 * most;
                    assert!(change.abs() <= rate * period + slack, "rate of {index}: {change}");
                    let next = values[index] + change;
                    let (least, most) = (least.min(values[index]), most.max(values[index]));
                    assert!((least - slack..=most + slack).contains(&next), "range of {index}: {next}");
                }
            }
        }
    }
    assert!(at_limits > 10_000, "the wishes must meet limits: {at_limits}");
}

/// Goal: a frame that may not move is at no limit, so that it excuses no controller that comes no nearer.
#[test]
fn held_frames_count_as_no_parameters_at_a_limit() {
    let mut random = seeded(12);
    let mut bench = Bench::new(AllocationKind::Bounded, FrameUse::Hold);
    for _ in 0..100 {
        let jacobian = bench.jacobian(&mut random);
        let step = numbers(ROWS, 1e-9, &mut random);
        let (_, saturated) = bench.allocate(&jacobian, &step, &Actuation::default(), 0.1);
        assert_eq!(saturated, 0);
    }
}

/// Goal: where no limit is met the step is reached, but for what damping takes. With singular values `s_i` of the scaled
/// Jacobian, damping `d` leaves the share `d / (s_i^2 + d)` of each component of the step.
#[test]
fn bounded_reaches_the_step_where_limits_allow() {
    let mut random = seeded(2);
    let mut bench = Bench::new(AllocationKind::Bounded, FrameUse::Steer);
    let damping = bench.rig.control.damping;
    for _ in 0..1000 {
        let jacobian = bench.jacobian(&mut random);
        let step = DVector::from_vec(numbers(ROWS, 1e-4, &mut random));
        let (increment, saturated) = bench.allocate(&jacobian, step.as_slice(), &Actuation::default(), 0.1);
        assert_eq!(saturated, 0);
        let least = bench.scaled(&jacobian).singular_values().min();
        let left = (&jacobian * increment - &step).norm();
        let share = damping / (least * least + damping);
        assert!(left <= share * step.norm() * (1.0 + 1e-9) + 1e-15, "{left} {share}");
    }
}

/// Goal: within the limits the paper's allocation is the pseudoinverse, of a singular Jacobian as well; at a limit the whole step is
/// shortened to the first limit, its direction kept.
#[test]
fn truncated_svd_is_the_pseudoinverse_shortened_as_a_whole() {
    let mut random = seeded(3);
    let mut bench = Bench::new(AllocationKind::TruncatedSvd, FrameUse::Steer);
    let (period, mut shortened) = (1e-2, 0);
    let limits = bench.rig.limits();
    for case in 0..1000 {
        let mut jacobian = bench.jacobian(&mut random);
        if case % 2 == 0 {
            let row = jacobian.row(0) * 2.0;
            jacobian.set_row(1, &row);
        }
        let size = any_size(1e-5, 10.0, &mut random);
        let step = DVector::from_vec(numbers(ROWS, size, &mut random));
        let (increment, saturated) =
            bench.allocate(&jacobian, step.as_slice(), &Actuation::default(), period);
        let scaled = bench.scaled(&jacobian);
        // (19): 1e-5 of the largest, as configured.
        let kept = scaled.singular_values().max() / bench.rig.control.singular_ratio_max;
        let wanted = scaled.pseudo_inverse(kept).expect("not negative") * &step; // (18)
        let whole = wanted.component_mul(&bench.range);
        let bound = |index: usize| f64::min(limits[index][2] * period, limits[index][1]);
        let over = |index: usize| whole[index].abs() / bound(index);
        let most = (0..whole.len()).map(over).fold(0.0, f64::max);
        let expected = &whole / most.max(1.0);
        // Condition of the kept part, at most some 1e3 here, times rounding.
        assert!((&increment - &expected).norm() <= 1e-10 * expected.norm(), "{increment} {expected}");
        assert_eq!(saturated > 0, most > 1.0);
        shortened += u32::from(saturated > 0);
    }
    assert!((200..800).contains(&shortened), "both cases must occur: {shortened}");
}

/// Goal: held frames stay exactly, and the currents do the whole step as though there were no frames.
#[test]
fn held_frames_never_move_and_take_no_share() {
    let mut random = seeded(4);
    for kind in [AllocationKind::Bounded, AllocationKind::TruncatedSvd] {
        let mut bench = Bench::new(kind, FrameUse::Hold);
        let coils = bench.rig.coils();
        for _ in 0..300 {
            // Angle columns that would tempt: ten times the currents'.
            let mut jacobian = bench.jacobian(&mut random);
            jacobian.columns_mut(coils, 2).scale_mut(10.0);
            let step = numbers(ROWS, 1e-3, &mut random);
            let values = numbers(8, 1.0, &mut random);
            let admitted = bench.rig.actuation(&values);
            let gradient = numbers(8, 1.0, &mut random);
            let (increment, _) = bench.allocate_at(&jacobian, &step, &admitted, 0.1, (0.5, &gradient));
            assert_eq!(increment.rows(coils, 2).amax(), 0.0);
            let mut frameless = jacobian.clone();
            frameless.columns_mut(coils, 2).fill(0.0);
            let (alone, _) = bench.allocate_at(&frameless, &step, &admitted, 0.1, (0.5, &gradient));
            assert_eq!(increment, alone);
        }
    }
}

/// Goal: with nothing to turn, currents decay to the least that hold the magnets where they are, and the magnets do not turn on the way.
#[test]
fn current_release_ends_at_the_least_currents_that_hold_the_magnets() {
    let mut random = seeded(5);
    let mut bench = Bench::new(AllocationKind::Bounded, FrameUse::Hold);
    let (coils, period) = (bench.rig.coils(), 1e-2);
    for _ in 0..10 {
        let mut jacobian = bench.jacobian(&mut random);
        jacobian.columns_mut(coils, 2).fill(0.0);
        let mut values = numbers(8, 5.0, &mut random);
        values[coils..].fill(0.0);
        let start = DVector::from_vec(values.clone());
        let scaled = bench.scaled(&jacobian);
        let inverse = scaled.pseudo_inverse(1e-9).expect("not negative");
        let least = (inverse * (&jacobian * &start)).component_mul(&bench.range);
        let mut norm = f64::INFINITY;
        // Forty seconds at 0.5 1/s: exp(-20) of what can go is left.
        for _ in 0..4000 {
            let admitted = bench.rig.actuation(&values);
            let (increment, _) = bench.allocate(&jacobian, &[0.0; ROWS], &admitted, period);
            // In the null space to rounding of numbers of order one.
            assert!((&jacobian * &increment).norm() < 1e-13, "the magnets turn");
            for (value, change) in values.iter_mut().zip(&increment) {
                *value += change;
            }
            let now = DVector::from_row_slice(&values).component_div(&bench.range).norm();
            assert!(now <= norm * (1.0 + 1e-14), "the currents grow");
            norm = now;
        }
        let end = DVector::from_vec(values);
        assert!((&end - &least).norm() < 1e-7 * start.norm(), "{end} {least}");
    }
}

/// Goal: a lost determinant is regained to first order at the configured rate, without turning the magnets; a sufficient one asks for nothing.
#[test]
fn a_lost_determinant_is_regained_without_turning_the_magnets() {
    let mut random = seeded(6);
    let mut bench = Bench::new(AllocationKind::Bounded, FrameUse::Steer);
    let (wanted, rate) = (bench.rig.control.determinant_wanted, bench.rig.control.determinant_rate_per_s);
    let (period, none) = (1e-3, Actuation::default());
    for _ in 0..300 {
        let jacobian = bench.jacobian(&mut random);
        let gradient = DVector::from_vec(numbers(8, 1.0, &mut random));
        let determinant = wanted - random.random_range(1e-3..0.02);
        let (increment, saturated) =
            bench.allocate_at(&jacobian, &[0.0; ROWS], &none, period, (determinant, gradient.as_slice()));
        assert!((&jacobian * &increment).norm() < 1e-13, "the magnets turn");
        let gained = gradient.dot(&increment);
        assert!(gained > 0.0);
        if saturated == 0 {
            // All of the loss at the rate, less where the determinant hardly depends on what is free: currents that turn nothing, and
            // frames with the currents that follow them.
            let scaled = bench.scaled(&jacobian);
            let coils = bench.rig.coils();
            let seen = gradient.component_mul(&bench.range);
            let (authority, frames) = (scaled.columns(0, coils).into_owned(), scaled.columns(coils, 2));
            let inverse = authority.clone().pseudo_inverse(1e-9).expect("not negative");
            let (current, turn) = (seen.rows(0, coils).into_owned(), seen.rows(coils, 2));
            let free = &current - &inverse * (authority * &current);
            let turning = turn - (inverse * frames).transpose() * &current;
            let slope = free.norm_squared() + turning.norm_squared();
            let expected = (wanted - determinant) * rate * period * slope.min(1.0);
            assert!((gained / expected - 1.0).abs() < 1e-9, "{gained} {expected}");
        }
        let (increment, _) =
            bench.allocate_at(&jacobian, &[0.0; ROWS], &none, period, (wanted, gradient.as_slice()));
        assert_eq!(increment.amax(), 0.0);
    }
}

/// Goal: whatever the tasks and the wish would do to the margin of stability, it falls to first order no faster than its guard lets it, the magnets
/// turn as without the guard, and where it does not fall that fast nothing changes.
#[test]
fn the_margin_falls_no_faster_than_its_guard_lets_it() {
    // A step of frames that steer is for the solver to choose: with them the tasks alone are looked at.
    for (frames, size) in [(FrameUse::Steer, 0.0), (FrameUse::Hold, 1e-3)] {
        let mut random = seeded(7);
        let [mut plain, mut guarded] = [(); 2].map(|()| Bench::new(AllocationKind::Bounded, frames));
        let guard = MarginGuardConfig { floor: 0.1, rate_per_s: 10.0 };
        let control = ControlConfig { margin_guard: Some(guard), ..guarded.rig.control.clone() };
        guarded.allocation = Allocation::new(&control, &guarded.rig.description, ROWS);
        let (coils, period, none) = (plain.rig.coils(), 1e-3, Actuation::default());
        let (mut left_alone, mut held) = (0, 0);
        for _ in 0..300 {
            let jacobian = plain.jacobian(&mut random);
            let stiffening = numbers(8, 1.0, &mut random);
            let stiffness = (control.determinant_wanted - random.random_range(0.0..0.5), &stiffening[..]);
            let steadying = numbers(8, 1.0, &mut random);
            let margin = guard.floor + random.random_range(-0.02..0.1);
            let step = numbers(ROWS, size, &mut random);
            let [without, with] = [&mut plain, &mut guarded].map(|bench| {
                bench.allocation.rest();
                let near = Some((margin, &steadying[..]));
                bench.allocate_near_a_fold(&jacobian, &step, &none, period, stiffness, near).0
            });
            let slew = &plain.rig.description.coils[0].slew_max;
            if with.rows(0, coils).amax().max(without.rows(0, coils).amax()) > 0.99 * slew * period {
                continue;
            }
            assert!((&jacobian * (&with - &without)).norm() < 1e-12, "the magnets turn otherwise");
            let gradient = DVector::from_column_slice(&steadying);
            // The guard counts on the whole step; the damping holds a part of it back.
            let scaled = plain.scaled(&jacobian).columns(0, coils).into_owned();
            let step = DVector::from_column_slice(&step);
            let square = &scaled * scaled.transpose();
            let by = |damping: f64| {
                let damped = &square + DMatrix::identity(ROWS, ROWS) * damping;
                scaled.transpose() * damped.lu().solve(&step).expect("regular")
            };
            let slopes = gradient.component_mul(&plain.range).rows(0, coils).into_owned();
            let held_back = slopes.dot(&(by(control.damping) - by(0.0)));
            let least = -guard.rate_per_s * (margin - guard.floor) * period + held_back;
            let (before, after) = (gradient.dot(&without), gradient.dot(&with));
            if before >= least {
                assert_eq!(with, without);
                left_alone += 1;
            } else {
                assert!((after - least).abs() < 1e-9, "{after} in place of {least}, {before} without");
                held += 1;
            }
        }
        assert!(left_alone > 50 && held > 50, "{left_alone} {held}");
    }
}
