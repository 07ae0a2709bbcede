//! What must hold for any coil array: Maxwell's equations, derivatives, symmetry, energy.

mod field_support;

use std::f64::consts::PI;

use field_support::{bigmag, difference, largest, second_gradient_matrices};
use magsteer::magnetics::{
    ActuationMatrix, AppliedField, CoilArray, CoilPose, Dipole, FieldSample, Multipole, PosedArray, Wrench,
    field_to_wrench, stacked_field,
};
use magsteer_hal::HardwareDescription;
use magsteer_hal::description::FrameDescription;
use nalgebra::{DVector, Matrix3, Rotation3, Unit, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Sixth-order differences with steps of 2e-3 of the scale: their truncation is a few 1e-12 of the derivative
/// up to order 10, their rounding about 1e-12.
const DIFFERENCE_TOLERANCE: f64 = 1e-10;
const RELATIVE_STEP: f64 = 2e-3;

fn generator() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(20_211)
}

fn random_vector(random: &mut ChaCha8Rng, half_width: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.random_range(-half_width..half_width))
}

fn random_unit(random: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let candidate = random_vector(random, 1.0);
        if (0.1..1.0).contains(&candidate.norm()) {
            return candidate.normalize();
        }
    }
}

/// A coil whose terms are all of like size at 80 mm.
fn random_coil(random: &mut ChaCha8Rng, order: usize) -> Multipole {
    let mut factorial = 1.0;
    let coefficients: Vec<f64> = (1..=order)
        .map(|k| {
            factorial *= (k + 1) as f64;
            random.random_range(0.3..1.0) * 1e-3 * 0.08_f64.powi(k as i32 + 2) / factorial
        })
        .collect();
    Multipole::new(&coefficients)
}

/// Seven coils of different orders, one of them fixed, on two frames with tilted axes off the origin.
fn irregular_rig(random: &mut ChaCha8Rng) -> HardwareDescription {
    let mut rig = bigmag();
    let mut coil = rig.coils[1].clone();
    coil.frame = None;
    coil.coefficients.truncate(2);
    rig.coils.push(coil);
    rig.coils[3].coefficients.truncate(1);
    rig.coils[5].coefficients.extend([3e-16, -2e-17]);
    for frame in &mut rig.frames {
        let FrameDescription { axis, pivot, .. } = frame;
        *axis = random_unit(random).into();
        *pivot = random_vector(random, 0.02).into();
    }
    rig
}

fn sample_at(posed: &PosedArray, currents: &[f64], point: &Vector3<f64>) -> FieldSample {
    let mut sample = FieldSample::default();
    posed.actuated(currents).evaluate(point, &mut sample);
    sample
}

#[test]
fn field_is_free_of_divergence_and_curl_for_every_order() {
    let mut random = generator();
    for order in 1..=10 {
        let coil = random_coil(&mut random, order);
        let pose = CoilPose { origin: random_vector(&mut random, 0.05), axis: random_unit(&mut random) };
        let point = pose.origin + random_unit(&mut random) * 0.08;
        let field = |p: &Vector3<f64>| coil.evaluate(&pose, p).column.field;
        let jacobian = Matrix3::from_columns(
            &[0, 1, 2]
                .map(|axis| difference(RELATIVE_STEP * 0.08, |h| field(&(point + Vector3::ith(axis, h))))),
        );
        let tolerance = DIFFERENCE_TOLERANCE * jacobian.amax();
        assert!(jacobian.trace().abs() < tolerance, "divergence, order {order}");
        assert!((jacobian - jacobian.transpose()).amax() < tolerance, "curl, order {order}");
    }
}

#[test]
fn both_gradients_are_derivatives_for_every_order_and_direction() {
    let mut random = generator();
    for order in 1..=10 {
        let coil = random_coil(&mut random, order);
        for trial in 0..20 {
            let pose = CoilPose { origin: random_vector(&mut random, 0.05), axis: random_unit(&mut random) };
            let aside = random_vector(&mut random, 1.0);
            // On the axis, next to it, behind the coil, and anywhere.
            let direction = match trial {
                0 => pose.axis,
                1 => (pose.axis + aside * 1e-9).normalize(),
                2 => -pose.axis,
                _ => aside.normalize(),
            };
            let r = random.random_range(0.05..0.15);
            let point = pose.origin + direction * r;
            let at = |axis, h| coil.evaluate(&pose, &(point + Vector3::ith(axis, h)));
            let made = coil.evaluate(&pose, &point);
            let second = second_gradient_matrices(&made.second_gradient);
            for axis in 0..3 {
                let step = RELATIVE_STEP * r;
                let slope = difference(step, |h| at(axis, h).column.field);
                let error = (made.column.gradient.matrix().column(axis) - slope).amax();
                let scale = largest(&made.column.gradient);
                assert!(error < DIFFERENCE_TOLERANCE * scale, "order {order}: gradient {error} of {scale}");
                let slope = difference(step, |h| at(axis, h).column.gradient.matrix());
                let error = (second[axis] - slope).amax();
                let scale = second.iter().map(Matrix3::amax).fold(0.0, f64::max);
                assert!(error < DIFFERENCE_TOLERANCE * scale, "order {order}: second {error} of {scale}");
            }
        }
    }
}

#[test]
fn field_on_the_axis_is_the_closed_form() {
    let pose = CoilPose { origin: Vector3::zeros(), axis: Vector3::x() };
    for order in 1..=10 {
        let mut coefficients = vec![0.0; order];
        coefficients[order - 1] = 1.0;
        let x: f64 = 0.07;
        let made = Multipole::new(&coefficients).evaluate(&pose, &Vector3::new(x, 0.0, 0.0));
        // d^(k+1)/dx^(k+1) of 1/x, and two more derivatives.
        let derivative = |count: usize| {
            let factorial: f64 = (1..=count).map(|factor| factor as f64).product();
            factorial * (-1.0_f64).powi(count as i32) * x.powi(-(count as i32 + 1))
        };
        let expected = [order + 1, order + 2, order + 3].map(derivative);
        let actual = [made.column.field.x, made.column.gradient.xx, made.second_gradient.xxx];
        for (actual, expected) in actual.iter().zip(expected) {
            // At order 10 the terms of the second gradient are about 300 times their sum.
            assert!(
                (actual - expected).abs() < 1e-12 * expected.abs(),
                "order {order}: {actual}, {expected}"
            );
        }
        assert_eq!(made.column.field.yz(), nalgebra::Vector2::zeros());
        assert_eq!(made.local_x, x);
    }
}

#[test]
fn array_is_the_sum_of_its_coils_at_their_currents() {
    let mut random = generator();
    let rig = irregular_rig(&mut random);
    let posed = CoilArray::new(&rig).posed(&[0.4, -0.9]);
    let currents: Vec<f64> = rig.coils.iter().map(|_| random.random_range(-8.0..8.0)).collect();
    for _ in 0..20 {
        let point = random_vector(&mut random, 0.03);
        let sample = sample_at(&posed, &currents, &point);
        let mut field = Vector3::zeros();
        let mut gradient = Matrix3::zeros();
        let mut second = [Matrix3::zeros(); 3];
        for (index, coil) in rig.coils.iter().enumerate() {
            let alone = Multipole::new(&coil.coefficients).evaluate(&posed.coil_pose(index), &point);
            // The neighbour in the pair may have more terms: zeros are added, nothing else.
            assert_eq!(sample.columns[index], alone.column);
            field += alone.column.field * currents[index];
            gradient += alone.column.gradient.matrix() * currents[index];
            for (sum, part) in second.iter_mut().zip(second_gradient_matrices(&alone.second_gradient)) {
                *sum += part * currents[index];
            }
        }
        assert!((sample.field - field).amax() < 1e-14 * field.amax());
        assert!((sample.gradient.matrix() - gradient).amax() < 1e-14 * gradient.amax());
        for (actual, expected) in second_gradient_matrices(&sample.second_gradient).iter().zip(second) {
            assert!((actual - expected).amax() < 1e-13 * second[0].amax());
        }
    }
}

#[test]
fn frame_angle_columns_are_derivatives() {
    let mut random = generator();
    for rig in [bigmag(), irregular_rig(&mut random)] {
        let array = CoilArray::new(&rig);
        let currents: Vec<f64> = rig.coils.iter().map(|_| random.random_range(-8.0..8.0)).collect();
        for _ in 0..20 {
            let angles = [random.random_range(-PI..PI), random.random_range(-PI..PI)];
            let point = random_vector(&mut random, 0.02);
            let sample = sample_at(&array.posed(&angles), &currents, &point);
            for frame in 0..2 {
                let turned = |h: f64| {
                    let mut angles = angles;
                    angles[frame] += h;
                    sample_at(&array.posed(&angles), &currents, &point)
                };
                // The angle changes the field about as fast as a move of its arm, 0.1 m a radian.
                let column = sample.columns[rig.coils.len() + frame];
                let field = difference(RELATIVE_STEP, |h| turned(h).field);
                let error = (column.field - field).amax();
                assert!(error < DIFFERENCE_TOLERANCE * field.amax(), "field, frame {frame}: {error}");
                let gradient = difference(RELATIVE_STEP, |h| turned(h).gradient.matrix());
                let error = (column.gradient.matrix() - gradient).amax();
                assert!(error < DIFFERENCE_TOLERANCE * gradient.amax(), "gradient, frame {frame}: {error}");
            }
        }
    }
}

#[test]
fn turning_everything_about_z_turns_the_field() {
    let mut random = generator();
    let rig = bigmag();
    let array = CoilArray::new(&rig);
    let currents = [3.0, -2.0, 5.0, 1.0, -7.0, 4.0];
    for _ in 0..20 {
        let turn = random.random_range(-PI..PI);
        let angles: [f64; 2] = [random.random_range(-1.0..1.0), random.random_range(-1.0..1.0)];
        let point = random_vector(&mut random, 0.03);
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
        let still = sample_at(&array.posed(&angles), &currents, &point);
        let turned =
            sample_at(&array.posed(&angles.map(|angle| angle + turn)), &currents, &(rotation * point));
        let field = rotation * still.field;
        assert!((turned.field - field).amax() < 1e-13 * field.amax());
        let gradient = rotation * still.gradient.matrix() * rotation.inverse();
        assert!((turned.gradient.matrix() - gradient).amax() < 1e-13 * gradient.amax());
    }
}

#[test]
fn wrench_is_the_derivative_of_the_energy() {
    let mut random = generator();
    let posed = CoilArray::new(&bigmag()).posed(&[0.3, -0.7]);
    let currents = [3.0, -2.0, 5.0, 1.0, -7.0, 4.0];
    for _ in 0..20 {
        let point = random_vector(&mut random, 0.03);
        let moment = random_unit(&mut random) * 0.065;
        let energy = |moment: &Vector3<f64>, point: &Vector3<f64>| {
            nalgebra::Vector1::new(-moment.dot(&sample_at(&posed, &currents, point).field))
        };
        let sample = sample_at(&posed, &currents, &point);
        let wrench = Wrench::on_dipole(&moment, &sample.field, &sample.gradient);
        for axis in 0..3 {
            let along = Vector3::ith(axis, 1.0);
            let slope = difference(RELATIVE_STEP * 0.08, |h| energy(&moment, &(point + along * h)));
            let error = (wrench.force[axis] + slope.x).abs();
            assert!(error < DIFFERENCE_TOLERANCE * wrench.force.norm(), "force {axis}: {error}");
            let turned = |h| Rotation3::from_axis_angle(&Unit::new_unchecked(along), h) * moment;
            let slope = difference(0.01, |h| energy(&turned(h), &point));
            let error = (wrench.torque[axis] + slope.x).abs();
            assert!(error < DIFFERENCE_TOLERANCE * wrench.torque.norm(), "torque {axis}: {error}");
        }
    }
}

#[test]
fn field_to_wrench_map_is_the_dipole_wrench() {
    let mut random = generator();
    let posed = CoilArray::new(&bigmag()).posed(&[0.3, -0.7]);
    let sample = sample_at(&posed, &[1.0; 6], &Vector3::new(0.01, -0.02, 0.005));
    for column in &sample.columns[..8] {
        let moment = random_unit(&mut random) * 0.065;
        let mapped = field_to_wrench(&moment) * stacked_field(column);
        let direct = Wrench::on_dipole(&moment, &column.field, &column.gradient).stacked();
        assert!((mapped - direct).amax() < 1e-15 * direct.amax() + 1e-300);
    }
}

#[test]
fn actuation_matrix_times_currents_is_every_magnets_wrench() {
    let mut random = generator();
    let rig = irregular_rig(&mut random);
    let posed = CoilArray::new(&rig).posed(&[1.1, 0.2]);
    let currents: Vec<f64> = rig.coils.iter().map(|_| random.random_range(-8.0..8.0)).collect();
    let field = posed.actuated(&currents);
    let magnets = [0, 1, 2].map(|_| Dipole {
        position: random_vector(&mut random, 0.03),
        moment: random_unit(&mut random) * 0.065,
    });
    let mut matrix = ActuationMatrix::new(magnets.len(), &field);
    assert!(matrix.update(&field, &magnets));
    assert_eq!((matrix.currents().shape(), matrix.angles().shape()), ((18, 7), (18, 2)));
    let wrenches = matrix.currents() * DVector::from_column_slice(&currents);
    for (index, magnet) in magnets.iter().enumerate() {
        let sample = sample_at(&posed, &currents, &magnet.position);
        let expected = Wrench::on_dipole(&magnet.moment, &sample.field, &sample.gradient).stacked();
        let actual = wrenches.fixed_rows::<6>(6 * index);
        assert!((actual - expected).amax() < 1e-14 * expected.amax());
    }
}

#[test]
fn angle_columns_of_the_actuation_matrix_are_derivatives_of_the_wrench() {
    let mut random = generator();
    let rig = irregular_rig(&mut random);
    let array = CoilArray::new(&rig);
    let currents = [3.0, -2.0, 5.0, 1.0, -7.0, 4.0, 2.0];
    let magnet =
        Dipole { position: Vector3::new(0.01, 0.02, -0.01), moment: Vector3::new(0.02, -0.05, 0.03) };
    let angles = [0.6, -1.3];
    let posed = array.posed(&angles);
    let field = posed.actuated(&currents);
    let mut matrix = ActuationMatrix::new(1, &field);
    matrix.update(&field, &[magnet]);
    for frame in 0..2 {
        let slope = difference(RELATIVE_STEP, |h| {
            let mut angles = angles;
            angles[frame] += h;
            let sample = sample_at(&array.posed(&angles), &currents, &magnet.position);
            Wrench::on_dipole(&magnet.moment, &sample.field, &sample.gradient).stacked()
        });
        let error = (matrix.angles().column(frame) - slope).amax();
        assert!(error < DIFFERENCE_TOLERANCE * slope.amax(), "frame {frame}: {error}");
    }
}

#[test]
fn reposing_an_array_equals_posing_it_anew() {
    let mut random = generator();
    let array = CoilArray::new(&irregular_rig(&mut random));
    let mut posed = array.posed(&[2.0, -1.0]);
    array.pose_into(&[0.5, 0.25, 99.0], &mut posed);
    assert_eq!(posed, array.posed(&[0.5, 0.25]));
    assert_ne!(posed, array.posed(&[0.5]));
    assert_eq!(array.posed(&[0.5]), array.posed(&[0.5, 0.0]));
}

#[test]
fn point_too_close_to_a_coil_is_reported_with_coil_and_distance() {
    let posed = CoilArray::new(&bigmag()).posed(&[0.0, 0.0]);
    // Coil 4 looks up from z = -85.5 mm; its series holds from 43 mm on.
    let inside = Vector3::new(0.0, 0.0, -0.0424);
    let outside = Vector3::new(0.0, 0.0, -0.0426);
    assert!(sample_at(&posed, &[], &inside).valid);
    assert_eq!(posed.outside(inside).count(), 0);
    assert!(!sample_at(&posed, &[], &outside).valid);
    let reports: Vec<_> = posed.outside(outside).collect();
    assert_eq!((reports.len(), reports[0].coil), (1, 4));
    assert!((reports[0].local_x - 0.0429).abs() < 1e-15);
    assert!((reports[0].shortfall() - 1e-4).abs() < 1e-15);
    assert_eq!(
        reports[0].to_string(),
        "coils[4]: local x = 42.90 mm: must be at least 43.00 mm, 0.10 mm more, for the field model to hold"
    );
}

#[test]
fn reports_agree_with_the_samples_flag_everywhere() {
    let mut random = generator();
    let array = CoilArray::new(&bigmag());
    let mut counts = [0; 2];
    for _ in 0..500 {
        let posed = array.posed(&[random.random_range(-PI..PI), random.random_range(-PI..PI)]);
        let point = random_vector(&mut random, 0.055);
        let valid = sample_at(&posed, &[], &point).valid;
        assert_eq!(valid, posed.outside(point).next().is_none(), "at {point}");
        counts[usize::from(valid)] += 1;
    }
    assert!(counts[0] > 50 && counts[1] > 50, "{counts:?} do not try both answers");
    let nowhere = Vector3::new(f64::NAN, 0.0, 0.0);
    let posed = array.posed(&[]);
    assert!(!sample_at(&posed, &[], &nowhere).valid);
    assert_eq!(posed.outside(nowhere).count(), 6);
}
