//! The fit of the field, against readings whose coefficients are known and against a coil made of current
//! loops.

mod field_fit_support;
mod field_support;

use field_fit_support::{AIR, AUTO, at_home, exactly, field, grid, normal, reading, readings, winding};
use magsteer::magnetics::fit::{
    Expectation, FitError, FitRequest, OrderChoice, Reading, check_units, fit, parse,
};
use magsteer::magnetics::{CoilArray, CoilPose, Multipole};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn relative(found: f64, expected: f64) -> f64 {
    (found - expected).abs() / expected.abs()
}

/// Goal: the oracle of these tests is the coil of the reference grid: what is left is noise of 0.05 mT and
/// rounding to 0.1 mT, which together are sqrt(3 (0.05^2 + 0.1^2 / 12)) = 0.1 mT.
#[test]
fn the_sum_of_loops_is_the_coil_of_the_reference_grid() {
    let grid = grid();
    let squares = grid
        .readings
        .iter()
        .map(|reading| (reading.field - winding(&reading.position) * reading.currents[0]).norm_squared());
    let norm = (squares.sum::<f64>() / grid.readings.len() as f64).sqrt();
    assert!((norm - 0.1e-3).abs() < 0.005e-3, "{norm}");
}

/// Goal: the numbers of an independent least-squares fit, to three digits.
#[test]
fn the_reference_grid_gives_the_reference_residuals() {
    let found = fit(&[at_home()], &grid().readings, &AUTO).unwrap();
    for (order, expected_mt) in [(1, 1.637), (2, 0.429), (3, 0.133), (4, 0.0982), (6, 0.0978)] {
        let report = &found.orders[order - 1];
        assert_eq!(report.order, order);
        let half_a_digit = if expected_mt > 0.1 { 0.5e-3 } else { 0.5e-4 };
        let norm = report.rms_norm * 1e3;
        assert!((norm - expected_mt).abs() < half_a_digit, "order {order}: {norm}");
        let by_components = report.rms.iter().map(|rms| rms * rms).sum::<f64>().sqrt();
        assert!(relative(by_components, report.rms_norm) < 1e-9, "order {order}");
    }
    let dipole_strength = found.orders[3].coefficients[0][0];
    assert!((dipole_strength - 6.492e-7).abs() < 0.0005e-7, "{dipole_strength}");
}

/// Goal: the order chosen from readings in one plane foretells the field off that plane, where the coil made
/// of loops is the judge: 0.02 mT at 4 A, and no order below does.
#[test]
fn the_chosen_order_holds_off_the_measured_plane() {
    let found = fit(&[at_home()], &grid().readings, &AUTO).unwrap();
    let mut points = Vec::new();
    for x in 0..18 {
        for y in -5..=5 {
            for z in [-5, -4, -3, -2, -1, 1, 2, 3, 4, 5] {
                let at = |steps: i32| f64::from(steps) * 0.01;
                points.push(Vector3::new(0.045 + 0.5 * at(x), at(y), at(z)));
            }
        }
    }
    let error_mt = |order: usize| {
        let coefficients = &found.orders[order - 1].coefficients[0];
        let error = |point: &Vector3<f64>| (field(coefficients, 0.0, point) - winding(point)).norm_squared();
        4e3 * (points.iter().map(error).sum::<f64>() / points.len() as f64).sqrt()
    };
    assert!(error_mt(found.order) < 0.02, "order {}: {} mT", found.order, error_mt(found.order));
    for order in 1..found.order {
        assert!(error_mt(order) > 0.1, "order {order}: {} mT", error_mt(order));
    }
}

/// Goal: without noise, coefficients come back to rounding, whatever their order, and the order itself is
/// found.
#[test]
fn known_coefficients_come_back() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let six = [6.4e-7, 1.9e-8, -1.7e-10, 5.2e-13, 1.1e-14, -2.3e-16];
    for order in 1..=six.len() {
        let readings = readings(&six[..order], 0.0, 60, &mut random);
        let found = fit(&[at_home()], &readings, &AUTO).unwrap();
        assert_eq!(found.order, order);
        for (a, expected) in found.coils[0].coefficients.iter().zip(&six) {
            assert!(relative(*a, *expected) < 1e-10, "order {order}: {a} {expected}");
        }
        let higher = fit(&[at_home()], &readings, &exactly(8)).unwrap();
        assert!(relative(higher.coils[0].coefficients[0], six[0]) < 1e-7);
    }
}

/// Goal: an expansion point that is not where the frame says is found, with the coefficients about it.
#[test]
fn an_expansion_point_that_moved_is_found() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for origin in [-0.031, -0.004, 0.0, 0.0123] {
        for order in 1..=4 {
            let readings = readings(&AIR[..order], origin, 60, &mut random);
            let request = FitRequest { fit_origin: true, ..exactly(order) };
            let found = fit(&[at_home()], &readings, &request).unwrap();
            let coil = &found.coils[0];
            assert!((coil.origin - origin).abs() < 1e-8, "order {order}: {} {origin}", coil.origin);
            for (a, expected) in coil.coefficients.iter().zip(&AIR) {
                assert!(relative(*a, *expected) < 1e-5, "order {order}: {a} {expected}");
            }
            if origin != 0.0 {
                let fixed = fit(&[at_home()], &readings, &exactly(order)).unwrap();
                assert!(fixed.rms_norm > 1e3 * found.rms_norm.max(1e-12), "order {order}, {origin}");
            }
        }
    }
}

/// Goal: a dipole fits the reference grid ten times better when its place is fitted too, and lies inside the
/// winding, which is 50 mm long.
#[test]
fn a_dipole_that_may_move_lies_inside_the_winding() {
    let request = FitRequest { fit_origin: true, ..exactly(1) };
    let found = fit(&[at_home()], &grid().readings, &request).unwrap();
    let origin = found.coils[0].origin;
    assert!((-0.050..0.0).contains(&origin), "{origin}");
    assert!(found.rms_norm < 0.163e-3, "{}", found.rms_norm);
}

/// Six coils of BigMag at turned frames, and readings of all at once.
fn array(count: usize, random: &mut ChaCha8Rng) -> (Vec<CoilPose>, Vec<Vec<f64>>, Vec<Reading>) {
    let rig = field_support::bigmag();
    let posed = CoilArray::new(&rig).posed(&[0.5, -0.8]);
    let poses: Vec<CoilPose> = (0..rig.coils.len()).map(|coil| posed.coil_pose(coil)).collect();
    // No two coils are built alike.
    let scaled = |(index, coil): (usize, &magsteer_hal::description::CoilDescription)| {
        coil.coefficients.iter().map(|a| a * (1.0 + 0.03 * index as f64)).collect()
    };
    let coefficients: Vec<Vec<f64>> = rig.coils.iter().enumerate().map(scaled).collect();
    let readings = superposed(&poses, &coefficients, count, random);
    (poses, coefficients, readings)
}

fn superposed(
    poses: &[CoilPose],
    coefficients: &[Vec<f64>],
    count: usize,
    random: &mut ChaCha8Rng,
) -> Vec<Reading> {
    let mut one = |_| {
        let position = Vector3::from_fn(|_, _| random.random_range(-0.03..0.03));
        let currents: Vec<f64> = poses.iter().map(|_| random.random_range(-8.0..8.0)).collect();
        let coils = poses.iter().zip(coefficients).zip(&currents);
        let fields = coils
            .map(|((pose, a), current)| Multipole::new(a).evaluate(pose, &position).column.field * *current);
        let field = fields.sum();
        Reading { line: 0, position, currents, field }
    };
    (0..count).map(&mut one).collect()
}

/// Goal: superposed currents separate into the coils by one linear least squares.
#[test]
fn every_coil_of_an_array_comes_back_from_superposed_currents() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let (poses, coefficients, readings) = array(150, &mut random);
    let found = fit(&poses, &readings, &AUTO).unwrap();
    assert_eq!(found.order, 4);
    for (coil, expected) in found.coils.iter().zip(&coefficients) {
        for (a, expected) in coil.coefficients.iter().zip(expected) {
            assert!(relative(*a, *expected) < 1e-8, "{a} {expected}");
        }
    }
}

/// Goal: origins of several coils are found together.
#[test]
fn every_origin_of_an_array_comes_back() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let (poses, coefficients, _) = array(1, &mut random);
    let origins = [0.004, -0.006, 0.0, 0.002, -0.003, 0.005];
    let moved: Vec<CoilPose> = poses
        .iter()
        .zip(origins)
        .map(|(pose, origin)| CoilPose { origin: pose.origin + pose.axis * origin, axis: pose.axis })
        .collect();
    let two: Vec<Vec<f64>> = coefficients.iter().map(|a| a[..2].to_vec()).collect();
    let readings = superposed(&moved, &two, 120, &mut random);
    let found = fit(&poses, &readings, &FitRequest { fit_origin: true, ..exactly(2) }).unwrap();
    for (coil, origin) in found.coils.iter().zip(origins) {
        assert!((coil.origin - origin).abs() < 1e-7, "{} {origin}", coil.origin);
    }
}

/// Goal: neither the fit nor the folds depend on the order of the rows, to the last bit.
#[test]
fn the_fit_does_not_depend_on_the_order_of_the_rows() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut rows = grid().readings;
    let expected = fit(&[at_home()], &rows, &AUTO).unwrap();
    for _ in 0..3 {
        for last in (1..rows.len()).rev() {
            rows.swap(last, random.random_range(0..=last));
        }
        assert_eq!(fit(&[at_home()], &rows, &AUTO).unwrap(), expected);
    }
}

fn noisy(readings: &[Reading], sigma: f64, random: &mut ChaCha8Rng) -> Vec<Reading> {
    let spoil = |clean: &Reading| Reading { field: clean.field + normal(random) * sigma, ..clean.clone() };
    readings.iter().map(spoil).collect()
}

/// Goal: the stated standard deviations are the spread of the coefficients over repeated measurements, and of
/// the origin. The spread of n trials is itself known to 1 / sqrt(2 n); four times that is let pass.
#[test]
fn stated_deviations_are_the_spread_over_repeated_measurements() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let clean = readings(&AIR[..2], -0.01, 24, &mut random);
    for (fit_origin, trials) in [(false, 200), (true, 80)] {
        let pose = CoilPose { origin: Vector3::new(-0.01, 0.0, 0.0), axis: Vector3::x() };
        let request = FitRequest { fit_origin, ..exactly(2) };
        let mut errors = vec![Vec::new(); 3];
        let mut stated = [0.0; 3];
        for _ in 0..trials {
            let found = fit(&[pose], &noisy(&clean, 5e-5, &mut random), &request).unwrap();
            let coil = &found.coils[0];
            for (index, a) in coil.coefficients.iter().enumerate() {
                errors[index].push(a - AIR[index]);
                stated[index] += coil.deviations[index].powi(2) / f64::from(trials);
            }
            errors[2].push(coil.origin);
            stated[2] += coil.origin_deviation.unwrap_or(0.0).powi(2) / f64::from(trials);
        }
        for index in 0..if fit_origin { 3 } else { 2 } {
            let square = errors[index].iter().map(|error| error * error).sum::<f64>() / f64::from(trials);
            let ratio = (square / stated[index]).sqrt();
            assert!(
                (ratio - 1.0).abs() < 4.0 / f64::from(2 * trials).sqrt(),
                "unknown {index}, origin {fit_origin}: {ratio}"
            );
        }
    }
}

/// Goal: the same noise, twice as large, doubles every stated deviation: the fit is linear.
#[test]
fn stated_deviations_grow_with_the_noise() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let clean = readings(&AIR, 0.0, 60, &mut random);
    let of = |sigma: f64| {
        let noisy = noisy(&clean, sigma, &mut ChaCha8Rng::seed_from_u64(8));
        fit(&[at_home()], &noisy, &exactly(4)).unwrap()
    };
    let (once, twice) = (of(5e-5), of(1e-4));
    assert!((once.noise / 5e-5 - 1.0).abs() < 0.2, "{}", once.noise);
    assert!(relative(twice.noise, 2.0 * once.noise) < 1e-6);
    for (a, b) in once.coils[0].deviations.iter().zip(&twice.coils[0].deviations) {
        assert!(relative(*b, 2.0 * a) < 1e-6, "{a} {b}");
    }
    let coil = &once.coils[0];
    for (k, deviation) in coil.deviations.iter().enumerate() {
        assert!(relative(coil.covariance[k][k].sqrt(), *deviation) < 1e-12);
    }
}

/// Goal: with noise, orders above the truth's are not chosen, though they fit the readings better.
#[test]
fn hold_out_does_not_take_noise_for_signal() {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let mut chosen = Vec::new();
    for _ in 0..10 {
        let clean = readings(&AIR[..2], 0.0, 60, &mut random);
        let found = fit(&[at_home()], &noisy(&clean, 5e-5, &mut random), &AUTO).unwrap();
        assert!(found.orders.windows(2).all(|pair| pair[1].rms_norm <= pair[0].rms_norm * (1.0 + 1e-9)));
        chosen.push(found.order);
    }
    assert!(chosen.iter().filter(|order| **order == 2).count() >= 8, "{chosen:?}");
    assert!(chosen.iter().all(|order| (2..=4).contains(order)), "{chosen:?}");
}

/// Goal: readings off the plane of the rest, and those nearest to the coil, are foretold as well as noise
/// lets.
#[test]
fn regions_are_left_out_as_a_whole() {
    let mut random = ChaCha8Rng::seed_from_u64(10);
    let mut rows = grid().readings;
    for _ in 0..60 {
        let position = field_fit_support::place(&mut random);
        rows.push(reading(position, 4.0, winding(&position) * 4.0));
    }
    let found = fit(&[at_home()], &rows, &AUTO).unwrap();
    let off_plane = found.regions.iter().position(|region| region.name == "off the plane").unwrap();
    assert_eq!(found.regions[off_plane].readings, 60);
    let of = |order: usize| found.orders[order - 1].region_rms_norms[off_plane].unwrap();
    assert!(of(found.order) < 0.02e-3, "{}", of(found.order));
    assert!(of(1) > 1e-3, "{}", of(1));
}

/// Goal: where the range begins, the true error is about the share asked for, and a little nearer it is
/// larger; further away it is smaller everywhere.
#[test]
fn the_range_begins_where_the_error_reaches_its_share() {
    let grid = grid();
    for (order, share) in [(3, 0.05), (4, 0.02), (4, 0.05), (5, 0.05)] {
        let request = FitRequest { share, ..exactly(order) };
        let found = fit(&[at_home()], &grid.readings, &request).unwrap();
        let coil = &found.coils[0];
        let error = |x: f64| {
            let off = |rho: f64| {
                let point = Vector3::new(x, rho, 0.0);
                (field(&coil.coefficients, 0.0, &point) - winding(&point)).norm()
            };
            let axis = winding(&Vector3::new(x, 0.0, 0.0)).norm();
            (0..=10).map(|step| off(0.005 * f64::from(step))).fold(0.0, f64::max) / axis
        };
        let from = coil.range.from_x;
        assert!(from < 0.046, "order {order}: {from}");
        let mut x = from;
        while x < 0.085 {
            assert!(error(x) < 1.5 * share, "order {order} to {share}: {} at {x}", error(x));
            x += 0.001;
        }
        assert!(error(from - 0.008) > share, "order {order} to {share}: {}", error(from - 0.008));
    }
}

/// Goal: coefficients in use at BigMag turn over near 40 mm and are not to be used below 43 mm; a series says
/// so by itself.
#[test]
fn the_published_series_turns_over_where_it_is_known_to() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let readings = readings(&AIR, 0.0, 80, &mut random);
    let found = fit(&[at_home()], &readings, &AUTO).unwrap();
    let turns_over = found.coils[0].range.turns_over_x.unwrap();
    assert!((0.038..0.042).contains(&turns_over), "{turns_over}");
    assert!(found.coils[0].range.from_x >= turns_over);
    let slope = |x: f64| {
        let along = |x: f64| field(&AIR, 0.0, &Vector3::new(x, 0.0, 0.0)).x;
        along(x + 1e-6) - along(x - 1e-6)
    };
    assert!(slope(turns_over - 2e-4) > 0.0 && slope(turns_over + 2e-4) < 0.0);
}

/// Goal: a dipole is not to be trusted anywhere near this coil.
#[test]
fn a_dipole_is_valid_only_far_away() {
    let found = fit(&[at_home()], &grid().readings, &exactly(1)).unwrap();
    assert!(found.coils[0].range.from_x > 0.08, "{:?}", found.coils[0].range);
    assert!(found.coils[0].range.misfit_x.is_some());
}

#[test]
fn readings_that_determine_nothing_are_refused_by_name() {
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let refused =
        |readings: &[Reading], request: &FitRequest| fit(&[at_home()], readings, request).unwrap_err();
    let at_one_place: Vec<Reading> =
        (0..20).map(|_| reading(Vector3::new(0.06, 0.0, 0.0), 4.0, Vector3::x() * 8e-3)).collect();
    let undetermined = FitError::Undetermined { order: 2, coil: 0, term: 2 };
    assert_eq!(refused(&at_one_place, &AUTO), undetermined);
    assert_eq!(refused(&at_one_place, &exactly(2)), undetermined);
    assert!(fit(&[at_home()], &at_one_place, &exactly(1)).is_ok());
    let few = readings(&AIR, 0.0, 2, &mut random);
    let too_few = FitError::TooFew { order: 7, readings: 2, equations: 6, unknowns: 7, least: 3 };
    assert_eq!(refused(&few, &exactly(7)), too_few);
    let off: Vec<Reading> = few.iter().map(|row| reading(row.position, 0.0, row.field)).collect();
    assert_eq!(refused(&off, &AUTO), FitError::Undriven { coil: 0 });
    let request = FitRequest { order: OrderChoice::Exactly(2), fit_origin: true, share: 0.05 };
    assert!(matches!(refused(&at_one_place, &request), FitError::Undetermined { .. }));
    // Two coils in one place are one coil to a probe.
    let twice: Vec<Reading> = readings(&AIR, 0.0, 40, &mut random)
        .into_iter()
        .map(|row| Reading { currents: vec![row.currents[0], 2.0 * row.currents[0]], ..row })
        .collect();
    let error = fit(&[at_home(), at_home()], &twice, &AUTO).unwrap_err();
    assert!(matches!(error, FitError::Undetermined { order: 1, .. }), "{error}");
}

/// Goal: whatever bytes a file has, reading and fitting it ends with an answer or a refusal. The file is a
/// sixth of the reference grid with a few bytes changed, cut or doubled.
#[test]
fn no_bytes_make_the_fit_fail_otherwise_than_by_a_refusal() {
    let mut random = ChaCha8Rng::seed_from_u64(13);
    let rows = field_fit_support::GRID.lines().enumerate();
    let rows = rows.filter(|(index, _)| *index == 0 || index % 6 == 1).map(|(_, row)| format!("{row}\n"));
    let sound: Vec<u8> = rows.collect::<String>().into_bytes();
    let (mut refused, mut fitted) = (0, 0);
    for _ in 0..300 {
        let mut bytes = sound.clone();
        for _ in 0..random.random_range(0..4) {
            let at = random.random_range(0..bytes.len());
            match random.random_range(0..4) {
                0 => bytes[at] = random.random(),
                1 => bytes[at] = b"0123456789.-+eE,\n"[random.random_range(0..17)],
                2 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, bytes[at]),
            }
        }
        let found = parse(&bytes)
            .and_then(|readings| check_units(&readings, &Expectation::Dipole).map(|()| readings));
        match found.map(|readings| fit(&[at_home()], &readings.readings, &AUTO)) {
            Ok(Ok(found)) => {
                fitted += 1;
                assert!(found.rms_norm.is_finite() && found.coils[0].range.from_x > 0.0);
            }
            Ok(Err(_)) | Err(_) => refused += 1,
        }
    }
    assert!(refused > 50 && fitted > 50, "{refused} refused, {fitted} fitted");
}
