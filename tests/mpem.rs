//! Calibrations of multipole electromagnet models: what their numbers mean, and what of them is refused.
#![cfg(feature = "mpem")]

mod field_support;

use magsteer::magnetics::mpem::{Calibration, CoilSources, PlacedCoil, Source, placed_coils, read, write};
use magsteer::magnetics::{CoilArray, CoilPose, Multipole};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const FIXTURE: &str = include_str!("reference/calibration.yaml");

fn vector(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

/// `P_n(c)` by Bonnet's recurrence.
fn legendre(n: usize, c: f64) -> f64 {
    let (mut before, mut now) = (1.0, c);
    for k in 2..=n {
        (before, now) = (now, ((2 * k - 1) as f64 * c * now - (k - 1) as f64 * before) / k as f64);
    }
    now
}

/// The potential of a source, as the format defines it: `sum_n (A_n r^n + B_n r^-(n+1)) P_n(cos)`.
fn potential(source: &Source, point: &Vector3<f64>) -> f64 {
    let d = point - source.position;
    let (r, c) = (d.norm(), d.normalize().dot(&source.direction));
    let falling = source.falling.iter().enumerate();
    let falling = falling.map(|(index, b)| b * r.powi(-(index as i32 + 2)) * legendre(index + 1, c));
    let rising = source.rising.iter().enumerate();
    let rising = rising.map(|(index, a)| a * r.powi(index as i32 + 1) * legendre(index + 1, c));
    falling.chain(rising).sum()
}

/// `-grad Phi` by central differences of the fourth order.
fn differences(source: &Source, point: &Vector3<f64>) -> Vector3<f64> {
    let h = 3e-4 * (point - source.position).norm();
    Vector3::from_fn(|axis, _| {
        let at = |steps: f64| {
            let mut moved = *point;
            moved[axis] += steps * h;
            potential(source, &moved)
        };
        (8.0 * (at(-1.0) - at(1.0)) - (at(-2.0) - at(2.0))) / (12.0 * h)
    })
}

fn series_field(source: &Source, point: &Vector3<f64>) -> Vector3<f64> {
    let pose = CoilPose { origin: source.position, axis: source.direction };
    Multipole::new(&source.series()).evaluate(&pose, point).column.field
}

fn direction(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.random_range(-1.0..1.0_f64)).normalize()
}

/// A source of some order whose terms weigh alike at 0.1 m.
fn source(random: &mut ChaCha8Rng, order: usize) -> Source {
    Source {
        name: "Src_0".to_owned(),
        line: 0,
        position: Vector3::from_fn(|_, _| random.random_range(-0.1..0.1)),
        direction: direction(random),
        rising: Vec::new(),
        falling: (1..=order)
            .map(|n| 1e-3 * 0.1_f64.powi(n as i32 + 2) * random.random_range(0.2..1.0))
            .collect(),
    }
}

/// Goal: our series has the field that the format means, `B = -grad Phi`, with no formula in common. The
/// differences are good to about 1e-10 at order 10: their step is 3e-4 r, and the fifth derivative of r^-11
/// is some 1e6 times r^-16.
#[test]
fn the_series_is_minus_the_gradient_of_the_potential() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for order in 1..=10 {
        for _ in 0..20 {
            let source = source(&mut random, order);
            let point = source.position + direction(&mut random) * random.random_range(0.08..0.3);
            let (found, expected) = (series_field(&source, &point), differences(&source, &point));
            let error = (found - expected).norm() / expected.norm();
            assert!(error < 1e-8, "order {order}: {found} instead of {expected}: {error:e}");
        }
    }
}

/// Goal: the field of a source as the file has it, rising terms and orders beyond ours included, is the same
/// gradient; and without rising terms it is that of our series.
#[test]
fn the_field_of_a_source_is_minus_the_gradient_of_its_potential() {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    for order in 1..=12 {
        for _ in 0..10 {
            let mut source = source(&mut random, order);
            let point = source.position + direction(&mut random) * random.random_range(0.08..0.3);
            if order <= 10 {
                let (found, expected) = (source.field(&point), series_field(&source, &point));
                assert!((found - expected).norm() < 1e-12 * expected.norm(), "order {order}");
            }
            source.rising = (1..=order)
                .map(|n| 1e-3 * 0.1_f64.powi(1 - n as i32) * random.random_range(0.2..1.0))
                .collect();
            let (found, expected) = (source.field(&point), differences(&source, &point));
            let error = (found - expected).norm() / expected.norm();
            assert!(error < 1e-8, "order {order}: {found} instead of {expected}: {error:e}");
        }
    }
    let uniform = Source { rising: vec![1e-3], falling: vec![], ..source(&mut random, 1) };
    assert!((uniform.field(&uniform.position) + uniform.direction * 1e-3).norm() < 1e-18);
}

/// Goal: the first coefficient is `mu_0 m / 4 pi` of a dipole along the direction, sign included.
#[test]
fn the_first_coefficient_is_that_of_a_dipole() {
    let strength = 1e-7 * 65.0;
    let dipole = Source {
        name: String::new(),
        line: 0,
        position: vector(0.0, 0.0, 0.1),
        direction: vector(0.0, 0.0, -1.0),
        rising: Vec::new(),
        falling: vec![strength],
    };
    let on_axis = series_field(&dipole, &vector(0.0, 0.0, -0.1));
    assert!((on_axis - vector(0.0, 0.0, -2.0 * strength / 8e-3)).norm() < 1e-12, "{on_axis}");
    let beside = series_field(&dipole, &vector(0.2, 0.0, 0.1));
    assert!((beside - vector(0.0, 0.0, strength / 8e-3)).norm() < 1e-12, "{beside}");
}

#[test]
fn coefficients_differ_by_signed_factorials() {
    let source = Source::of_series("", vector(0.0, 0.0, 0.0), Vector3::x(), &[1.0; 5]);
    assert_eq!(source.falling, [1.0, -2.0, 6.0, -24.0, 120.0]);
    assert_eq!(source.series(), [1.0; 5]);
}

#[test]
fn a_source_turned_round_has_the_same_field() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for order in 1..=10 {
        let source = source(&mut random, order);
        let turned = source.turned_round();
        assert_eq!(turned.direction, -source.direction);
        let point = source.position + direction(&mut random) * 0.1;
        let (found, expected) = (series_field(&turned, &point), series_field(&source, &point));
        assert!((found - expected).norm() < 1e-13 * expected.norm(), "order {order}");
    }
}

fn fixture() -> (Calibration, Vec<PlacedCoil>) {
    let calibration = read(FIXTURE.as_bytes()).unwrap_or_else(|refusal| panic!("{refusal}"));
    let coils = placed_coils(&calibration).unwrap_or_else(|refusal| panic!("{refusal}"));
    (calibration, coils)
}

#[test]
fn a_file_is_read_in_the_order_of_its_list() {
    let (calibration, coils) = fixture();
    assert_eq!(calibration.name, "three coils");
    assert_eq!(calibration.workspace, [[-0.02, 0.02], [-0.02, 0.03], [-0.01, 0.02]]);
    let names: Vec<&str> = coils.iter().map(|coil| coil.name.as_str()).collect();
    assert_eq!(names, ["West", "Below", "South"]);
    let orders: Vec<usize> = coils.iter().map(|coil| coil.coefficients.len()).collect();
    assert_eq!(orders, [3, 2, 1]);
    assert_eq!(coils[0].coefficients, [2.5e-6, 1.25e-7 / 2.0, 4e-9 / 6.0]);
    assert_eq!(coils[0].pose.origin, vector(-0.1, -0.03, 0.004));
    // The nearest corner of the box, (-0.02, -0.02, any), along (0.96, 0.28, 0).
    assert!((coils[0].box_from_x - (0.08 * 0.96 + 0.01 * 0.28)).abs() < 1e-15);
    // B_1 of a direction that points down is that of its opposite with the other sign; B_2 stays.
    assert_eq!(coils[1].pose.axis, Vector3::z());
    assert_eq!(coils[1].coefficients, [3e-6, 1e-7]);
}

/// Goal: the coils of a file have the field that its potentials have, whichever way their directions point.
#[test]
fn coils_have_the_field_of_the_file() {
    let (calibration, coils) = fixture();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for (listed, coil) in calibration.coils.iter().zip(&coils) {
        let series = Multipole::new(&coil.coefficients);
        for _ in 0..10 {
            let point = Vector3::from_fn(|axis, _| {
                let [least, greatest] = calibration.workspace[axis];
                random.random_range(least..greatest)
            });
            let expected = differences(&listed.sources[0], &point);
            let found = series.evaluate(&coil.pose, &point).column.field;
            assert!((found - expected).norm() < 1e-9 * expected.norm(), "{}", coil.name);
        }
    }
}

/// Goal: an array written and read again has the same field, to twelve digits, with its frames turned.
#[test]
fn an_array_survives_writing_and_reading() {
    let rig = field_support::bigmag();
    let array = CoilArray::new(&rig).posed(&[30_f64.to_radians(), (-45_f64).to_radians()]);
    let calibration = Calibration::of_array(&rig, &array);
    let text = write(&calibration, &["one remark".to_owned()]).unwrap();
    let again = read(text.as_bytes()).unwrap_or_else(|refusal| panic!("{refusal}\n{text}"));
    assert_eq!(again.workspace, calibration.workspace);
    let coils = placed_coils(&again).unwrap_or_else(|refusal| panic!("{refusal}\n{text}"));
    assert_eq!(coils.len(), rig.coils.len());
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for (index, (coil, described)) in coils.iter().zip(&rig.coils).enumerate() {
        assert_eq!(coil.name, described.name);
        let (before, after) = (Multipole::new(&described.coefficients), Multipole::new(&coil.coefficients));
        for _ in 0..50 {
            let point = Vector3::from_fn(|_, _| random.random_range(-0.03..0.03));
            let expected = before.evaluate(&array.coil_pose(index), &point);
            let found = after.evaluate(&coil.pose, &point);
            let error = (found.column.field - expected.column.field).norm();
            assert!(error < 1e-12 * expected.column.field.norm(), "{}: {error:e}", coil.name);
            let (found, expected) = (found.column.gradient.matrix(), expected.column.gradient.matrix());
            assert!((found - expected).norm() < 1e-12 * expected.norm(), "{}: gradient", coil.name);
        }
    }
}

#[test]
fn the_box_of_an_array_lies_inside_its_workspace() {
    let rig = field_support::bigmag();
    let calibration = Calibration::of_array(&rig, &CoilArray::new(&rig).posed(&[]));
    let center = Vector3::from(rig.workspace.center);
    let corner = Vector3::from_fn(|axis, _| calibration.workspace[axis][1]);
    assert!(((corner - center).norm() - rig.workspace.radius).abs() < 1e-15);
}

#[test]
fn numbers_are_written_as_every_yaml_reads_them() {
    let (mut calibration, _) = fixture();
    calibration.coils[0].sources[0].falling = vec![1.0, 1e-6, -2.5e-123, 3e21, 0.1];
    calibration.name = "2nd: \"odd\" \\ name".to_owned();
    let text = write(&calibration, &[]).unwrap();
    for number in ["- 1.0e+00\n", "- 1.0e-06\n", "- -2.5e-123\n", "- 3.0e+21\n", "- 1.0e-01\n"] {
        assert!(text.contains(number), "{number}: {text}");
    }
    let again = read(text.as_bytes()).unwrap_or_else(|refusal| panic!("{refusal}\n{text}"));
    assert_eq!(again.coils[0].sources[0].falling, calibration.coils[0].sources[0].falling);
    assert_eq!(again.name, calibration.name);
}

#[test]
fn names_that_the_format_takes_for_something_else_are_not_written() {
    for name in ["Coil_List", "Offset coil", "Workspace_Dimensions"] {
        let (mut calibration, _) = fixture();
        calibration.coils[1].name = name.to_owned();
        let refusal = write(&calibration, &[]).unwrap_err().to_string();
        assert!(refusal.contains(name) && refusal.contains("another name"), "{refusal}");
    }
}

/// One coil of some dipoles (position, moment) before a box of 40 mm about the origin.
fn dipoles(placed: &[(Vector3<f64>, Vector3<f64>)]) -> Calibration {
    let source = |(index, (position, moment)): (usize, &(Vector3<f64>, Vector3<f64>))| Source {
        name: format!("Src_{index}"),
        line: 0,
        position: *position,
        direction: moment.normalize(),
        rising: Vec::new(),
        falling: vec![moment.norm()],
    };
    let sources = placed.iter().enumerate().map(source).collect();
    Calibration {
        name: "dipoles".to_owned(),
        workspace: [[-0.02, 0.02]; 3],
        coils: vec![CoilSources { name: "Coil_0".to_owned(), line: 7, sources }],
        background: None,
        ends_with_line_end: true,
    }
}

fn one_source(calibration: &Calibration) -> (Calibration, f64) {
    let (found, substitutes) =
        calibration.with_one_source_each(1.0).unwrap_or_else(|refusal| panic!("{refusal}"));
    let [substitute] = substitutes.as_slice() else { panic!("{substitutes:?}") };
    assert_eq!(substitute.source_count, calibration.coils[0].sources.len());
    (found, substitute.left)
}

/// Part of the field that `found` leaves at random points of the box.
fn left_at_random(found: &Calibration, calibration: &Calibration) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let mut sums = [0.0; 2];
    for _ in 0..500 {
        let point = Vector3::from_fn(|_, _| random.random_range(-0.02..0.02));
        let expected = calibration.coils[0].field(&point);
        sums[0] += (found.coils[0].field(&point) - expected).norm_squared();
        sums[1] += expected.norm_squared();
    }
    (sums[0] / sums[1]).sqrt()
}

/// Goal: parts of one dipole at one place are found to be that dipole.
#[test]
fn parts_of_one_dipole_are_that_dipole() {
    let (place, moment) = (vector(-0.11, 0.02, 0.05), vector(2e-6, -3e-7, -8e-7));
    let calibration = dipoles(&[(place, moment * 0.3), (place, moment * -0.5), (place, moment * 1.2)]);
    let (found, left) = one_source(&calibration);
    assert!(left < 1e-6, "{left:e}");
    let [source] = found.coils[0].sources.as_slice() else { panic!("{found:?}") };
    assert!((source.position - place).norm() < 1e-6, "{}", source.position);
    assert!((source.direction * source.falling[0] - moment).norm() < 1e-5 * moment.norm(), "{source:?}");
    assert_eq!(placed_coils(&found).unwrap()[0].coefficients.len(), 1);
}

/// Goal: a coil as a ring of dipoles, which is the same all round its axis but for the number of dipoles, is
/// one series; and what is said to be left is what is left at other points than those of the fit.
#[test]
fn a_ring_of_dipoles_is_one_series() {
    let axis = vector(0.8, 0.0, 0.6);
    let (first, second) = (vector(0.0, 1.0, 0.0), vector(-0.6, 0.0, 0.8));
    let ring = |radius: f64| {
        let place = move |index: usize| {
            let angle = std::f64::consts::TAU * index as f64 / 12.0;
            (axis * -0.12 + (first * angle.cos() + second * angle.sin()) * radius, axis * 3e-7)
        };
        dipoles(&(0..12).map(place).collect::<Vec<_>>())
    };
    let (found, left) = one_source(&ring(0.04));
    assert!(left < 1e-4, "{left:e}");
    assert!(left_at_random(&found, &ring(0.04)) < 1e-4);
    let source = &found.coils[0].sources[0];
    assert!(source.direction.dot(&axis).abs() > 1.0 - 1e-9, "{}", source.direction);
    assert!(source.falling.len() > 1, "a ring is more than a dipole: {source:?}");
}

/// Goal: what is left of a field without an axis is told as it is, does not depend on how the world is
/// turned, and is no more than what the nearest dipole at a plausible place leaves.
#[test]
fn what_is_left_of_a_field_without_an_axis_is_told() {
    let placed = [
        (vector(-0.10, 0.03, 0.01), vector(2e-6, 0.0, 3e-7)),
        (vector(-0.09, -0.05, 0.02), vector(1e-6, 8e-7, 0.0)),
        (vector(-0.02, 0.02, -0.11), vector(2e-7, 1e-7, 6e-7)),
    ];
    let calibration = dipoles(&placed);
    let (found, left) = one_source(&calibration);
    assert!((0.005..0.2).contains(&left), "{left}");
    let elsewhere = left_at_random(&found, &calibration);
    // The grid of the fit reaches to the corners, where most is left.
    assert!((0.3 * left..1.05 * left).contains(&elsewhere), "{elsewhere} {left}");
    let turned = |v: &Vector3<f64>| vector(v.y, v.z, v.x);
    let turned = dipoles(&placed.map(|(place, moment)| (turned(&place), turned(&moment))));
    let (_, left_turned) = one_source(&turned);
    assert!((left_turned - left).abs() < 0.02 * left, "{left_turned} {left}");
    let refusal = calibration.with_one_source_each(0.5 * left).unwrap_err();
    assert_eq!((refusal.line, refusal.column.as_str()), (7, "Coil_0"));
    assert!(refusal.value.contains("in place of 3"), "{refusal}");
}

#[test]
fn a_single_source_stays_as_it_is() {
    let (calibration, _) = fixture();
    let (found, substitutes) = calibration.with_one_source_each(0.01).unwrap();
    assert_eq!(found, calibration);
    assert_eq!(substitutes, []);
}

#[test]
fn sources_without_a_field_that_falls_off_are_refused() {
    let mut calibration = dipoles(&[(vector(0.1, 0.0, 0.0), vector(1e-6, 0.0, 0.0)); 2]);
    calibration.coils[0].sources[1] = calibration.coils[0].sources[0].turned_round();
    calibration.coils[0].sources[1].falling[0] *= -1.0;
    let refusal = calibration.with_one_source_each(1.0).unwrap_err();
    assert!(refusal.value.contains("without a finite field"), "{refusal}");
    // A grid point of the fit is a source.
    let calibration = dipoles(&[(vector(0.02, 0.02, 0.02), vector(1e-6, 0.0, 0.0)); 2]);
    let refusal = calibration.with_one_source_each(1.0).unwrap_err();
    assert!(refusal.value.contains("without a finite field"), "{refusal}");
}
