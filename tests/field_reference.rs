//! The field and wrench against numbers that were made without this project: the BigMag vectors and `tests/reference/`.

mod field_support;

use field_support::{
    AxialMoments, MU_0, bigmag, from_z_axis, gauss_legendre, loop_field, matrix, number, reference,
    second_gradient_matrices, vector,
};
use magsteer::magnetics::{AppliedField, CoilArray, CoilPose, FieldSample, Multipole, Wrench};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use std::f64::consts::PI;

const ALONG_X: CoilPose = CoilPose { origin: Vector3::new(0.0, 0.0, 0.0), axis: Vector3::new(1.0, 0.0, 0.0) };

/// The field of a coil at the origin along x.
fn local_field(multipole: &Multipole, point: Vector3<f64>) -> Vector3<f64> {
    multipole.evaluate(&ALONG_X, &point).column.field
}

/// The term `psi_k` alone, with unit coefficient.
fn basis(order: usize) -> Multipole {
    let mut coefficients = vec![0.0; order];
    coefficients[order - 1] = 1.0;
    Multipole::new(&coefficients)
}

#[test]
fn air_coil_meets_the_local_vector() {
    let air = Multipole::new(&bigmag().coils[4].coefficients);
    let made = air.evaluate(&ALONG_X, &Vector3::new(0.08, 0.02, -0.013)).column;
    // The vectors are printed to 1e-8 T and 1e-6 T/m: half a unit of the last digit.
    assert!((made.field - Vector3::new(7.3184e-4, 1.7779e-4, -1.1557e-4)).amax() < 0.5e-8);
    let gradient = Matrix3::new(
        -0.016425, -0.005208, 0.003386, -0.005208, 0.007938, 0.000619, 0.003386, 0.000619, 0.008487,
    );
    assert!((made.gradient.matrix() - gradient).amax() < 0.5e-6);
}

#[test]
fn iron_coil_meets_the_local_vector_on_its_axis() {
    let iron = Multipole::new(&bigmag().coils[0].coefficients);
    let made = iron.evaluate(&ALONG_X, &Vector3::new(0.05, 0.0, 0.0)).column;
    assert!((made.field - Vector3::new(1.144543e-2, 0.0, 0.0)).amax() < 0.5e-8);
    let gradient = Matrix3::from_diagonal(&Vector3::new(-0.386194, 0.193097, 0.193097));
    assert!((made.gradient.matrix() - gradient).amax() < 0.5e-6);
}

/// Compares the field columns of BigMag's currents, mT/A, printed to six decimals.
fn assert_columns(angles_deg: [f64; 2], point_mm: [f64; 3], expected: [[f64; 6]; 3]) {
    let array = CoilArray::new(&bigmag());
    let posed = array.posed(&angles_deg.map(f64::to_radians));
    let mut sample = FieldSample::default();
    posed.actuated(&[]).evaluate(&Vector3::from(point_mm.map(|mm| mm * 1e-3)), &mut sample);
    for (row, expected) in expected.iter().enumerate() {
        for (coil, expected) in expected.iter().enumerate() {
            let actual = sample.columns[coil].field[row] * 1e3;
            // Half a unit of the last digit, and rounding.
            assert!((actual - expected).abs() < 0.51e-6, "row {row}, coil {coil}: {actual}, not {expected}");
        }
    }
    assert!(sample.valid);
}

#[test]
fn array_meets_the_table_at_the_centre() {
    assert_columns(
        [0.0, 0.0],
        [0.0, 0.0, 0.0],
        [
            [-2.105592, 2.072903, -2.189702, 2.088892, 0.0, 0.0],
            [0.0; 6],
            [1.431496, 1.357503, -1.422009, -1.363811, 0.712599, -0.712599],
        ],
    );
}

#[test]
fn array_meets_the_table_off_centre_with_turned_frames() {
    assert_columns(
        [30.0, -45.0],
        [20.0, 10.0, -15.0],
        [
            [-3.568104, 1.54767, -0.765141, 1.220814, 0.239142, 0.101491],
            [-2.172848, 0.863916, 1.52386, -0.689881, 0.119571, 0.050745],
            [2.852145, 0.593322, -1.546604, -1.065856, 0.924062, -0.478856],
        ],
    );
}

#[test]
fn multipole_basis_meets_the_reference() {
    let cases = reference("multipole_basis");
    for row in cases["rows"].as_array().expect("rows") {
        let point = vector(&row["p"]);
        let order = number(&row["k"]) as usize;
        let made = basis(order).evaluate(&ALONG_X, &point);
        let gradient = vector(&row["grad"]);
        // The sums of a few terms of like size lose two or three digits of sixteen.
        assert!((made.column.field - gradient).norm() < 1e-13 * gradient.norm(), "field, k = {order}");
        let h = &row["hess_unique_xx_xy_xz_yy_yz"];
        let [xx, xy, xz, yy, yz] = [0, 1, 2, 3, 4].map(|index| number(&h[index]));
        let hessian = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy);
        let actual = made.column.gradient.matrix();
        assert!((actual - hessian).norm() < 1e-13 * hessian.norm(), "gradient, k = {order}");
        if order >= 2 {
            // psi_k = d psi_(k-1) / dx, so that the Hessian of psi_k is the x slice of the second gradient before it.
            let before = basis(order - 1).evaluate(&ALONG_X, &point).second_gradient;
            let slice = second_gradient_matrices(&before)[0];
            assert!((slice - hessian).norm() < 1e-13 * hessian.norm(), "second gradient, k = {}", order - 1);
        }
    }
}

#[test]
fn loop_coefficients_meet_the_reference() {
    let case = reference("loop_multipole_coefficients");
    let mut moments = AxialMoments::none();
    moments.add_loop(0.04, 0.0, 1.0);
    let expected = case["a"].as_array().expect("coefficients");
    for (actual, expected) in moments.coefficients(6).iter().zip(expected) {
        let expected = number(expected);
        assert!((actual - expected).abs() <= 1e-14 * expected.abs(), "{actual}, not {expected}");
    }
}

#[test]
fn loop_series_errs_by_the_stated_truncation() {
    // The entry's errors are relative to the loop's field at a distance r along (0.8, 0.6, 0).
    let mut moments = AxialMoments::none();
    moments.add_loop(0.04, 0.0, 1.0);
    let case = reference("loop_multipole_coefficients");
    for row in case["truncation_error"].as_array().expect("rows") {
        let point = Vector3::new(0.8, 0.6, 0.0) * number(&row["r"]);
        let exact = loop_field(0.04, 0.0, &point);
        for (order, expected) in row["rel_err"].as_object().expect("errors by order") {
            let series = Multipole::new(&moments.coefficients(order.parse().expect("an order")));
            let error = (local_field(&series, point) - exact).norm() / exact.norm();
            let expected = number(expected);
            // Printed to six digits; the elliptic integrals here carry 1e-14.
            assert!((error - expected).abs() < 5e-6 * expected, "P = {order}: {error}, not {expected}");
        }
    }
}

#[test]
fn loop_field_of_the_tests_meets_the_reference() {
    // The oracle of the other tests is itself checked: against mpmath, for a loop and a Helmholtz pair.
    for row in reference("current_loop")["rows"].as_array().expect("rows") {
        let (point, expected) = (from_z_axis(vector(&row["p"])), from_z_axis(vector(&row["B"])));
        let actual = loop_field(0.04, 0.0, &point);
        assert!((actual - expected).norm() < 1e-14 + 1e-13 * expected.norm(), "{actual} is not {expected}");
    }
    for row in reference("helmholtz")["rows"].as_array().expect("rows") {
        let (point, expected) = (from_z_axis(vector(&row["p"])), from_z_axis(vector(&row["B"])));
        let actual = loop_field(0.1, -0.05, &point) + loop_field(0.1, 0.05, &point);
        assert!((actual - expected).norm() < 1e-13 * expected.norm(), "{actual} is not {expected}");
    }
}

/// Goal: up to each order, the series errs by no more than the terms left out, and some terms do help.
fn assert_series_converges(moments: &AxialMoments, point: Vector3<f64>, exact: Vector3<f64>) {
    let error = |order| (local_field(&Multipole::new(&moments.coefficients(order)), point) - exact).norm();
    for order in 1..=10 {
        let tail = moments.field_tail(order, point.norm()) + 1e-13 * exact.norm();
        assert!(error(order) <= tail, "P = {order} at {point}: {} exceeds {tail}", error(order));
    }
    assert!(error(9) < 0.5 * error(1), "no better with order 9 at {point}");
}

#[test]
fn multipoles_of_a_loop_reproduce_it_to_their_truncation() {
    let mut moments = AxialMoments::none();
    moments.add_loop(0.04, 0.0, 1.0);
    let series = Multipole::new(&moments.coefficients(9));
    let mut compared = 0;
    for row in reference("current_loop")["rows"].as_array().expect("rows") {
        let (point, exact) = (from_z_axis(vector(&row["p"])), from_z_axis(vector(&row["B"])));
        let r = point.norm();
        if r <= moments.reach {
            continue;
        }
        compared += 1;
        assert_series_converges(&moments, point, exact);
        if row["gradB"].is_array() {
            let in_z = matrix(&row["gradB"]);
            let exact = Matrix3::from_fn(|i, j| in_z[([2, 0, 1][i], [2, 0, 1][j])]);
            let actual = series.evaluate(&ALONG_X, &point).column.gradient.matrix();
            // As the field's tail, with the factor (k+2)/r that one more derivative brings on the axis.
            let terms = moments.moments.iter().enumerate().skip(9);
            let tail: f64 = terms
                .map(|(index, moment)| (index + 3) as f64 * moment.abs() * r.powi(-(index as i32 + 4)))
                .sum();
            assert!((actual - exact).amax() < tail, "gradient at {point}");
        }
    }
    assert_eq!(compared, 3);
}

#[test]
fn multipoles_of_a_helmholtz_pair_reproduce_it_far_away() {
    let mut moments = AxialMoments::none();
    moments.add_loop(0.1, -0.05, 1.0);
    moments.add_loop(0.1, 0.05, 1.0);
    for direction in [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.6, -0.8], [-0.8, 0.0, 0.6]] {
        let point = Vector3::from(direction) * 0.3;
        let exact = loop_field(0.1, -0.05, &point) + loop_field(0.1, 0.05, &point);
        assert_series_converges(&moments, point, exact);
    }
}

#[test]
fn multipoles_of_solenoids_reproduce_them_to_their_truncation() {
    // Moments of the windings by quadrature over loops; 24 nodes integrate the polynomials in use exactly.
    let mut thin = AxialMoments::none();
    for (center, length) in gauss_legendre(24, -0.03, 0.03) {
        thin.add_loop(0.02, center, 1e4 * length);
    }
    thin.reach = 0.02_f64.hypot(0.03);
    let mut thick = AxialMoments::none();
    for (center, length) in gauss_legendre(24, -0.03, 0.03) {
        for (radius, width) in gauss_legendre(24, 0.02, 0.04) {
            thick.add_loop(radius, center, 5e5 * length * width);
        }
    }
    thick.reach = 0.04_f64.hypot(0.03);
    let mut compared = 0;
    for (entry, moments) in [("thin_solenoid", thin), ("thick_coil", thick)] {
        for row in reference(entry)["rows"].as_array().expect("rows") {
            let (point, exact) = (from_z_axis(vector(&row["p"])), from_z_axis(vector(&row["B"])));
            if point.norm() > moments.reach {
                compared += 1;
                assert_series_converges(&moments, point, exact);
            }
        }
    }
    assert_eq!(compared, 4);
}

#[test]
fn two_dipoles_meet_the_reference() {
    let case = reference("dipole_dipole");
    let (source, moment) = (vector(&case["m1"]), vector(&case["m2"]));
    // With P = 1 the series is a dipole of moment 4 pi a_1 / mu_0.
    let pose = CoilPose { origin: Vector3::zeros(), axis: source.normalize() };
    let dipole = Multipole::new(&[MU_0 / (4.0 * PI) * source.norm()]);
    let made = dipole.evaluate(&pose, &Vector3::new(0.03, 0.01, 0.04)).column;
    let field = vector(&case["B"]);
    assert!((made.field - field).norm() < 1e-14 * field.norm());
    let gradient = matrix(&case["gradB"]);
    assert!((made.gradient.matrix() - gradient).norm() < 1e-14 * gradient.norm());
    let wrench = Wrench::on_dipole(&moment, &made.field, &made.gradient);
    let (force, torque) = (vector(&case["force_on_m2"]), vector(&case["torque_on_m2"]));
    assert!((wrench.force - force).norm() < 1e-14 * force.norm());
    assert!((wrench.torque - torque).norm() < 1e-14 * torque.norm());
}

/// Least-squares fit of eq. (5) to the grid measurement: coefficients per ampere and the norm over the
/// components of the RMS residuals, mT.
fn fit_grid(order: usize) -> (Vec<f64>, f64) {
    let text = include_str!("reference/coil_grid.csv");
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|value| value.parse().expect("a number")).collect())
        .collect();
    let point = |row: &[f64]| Vector3::new(row[0], row[1], row[2]) * 1e-3;
    let current = rows[0][3];
    // Columns of unit norm: the coefficients differ by many orders of magnitude.
    let mut design = DMatrix::zeros(3 * rows.len(), order);
    for (index, row) in rows.iter().enumerate() {
        for k in 1..=order {
            let column = local_field(&basis(k), point(row)) * current;
            design.fixed_view_mut::<3, 1>(3 * index, k - 1).copy_from(&column);
        }
    }
    let scales: Vec<f64> = design.column_iter().map(|column| column.norm()).collect();
    for (mut column, scale) in design.column_iter_mut().zip(&scales) {
        column /= *scale;
    }
    let measured =
        DVector::from_iterator(3 * rows.len(), rows.iter().flat_map(|row| [row[4], row[5], row[6]]));
    let scaled = design.clone().svd(true, true).solve(&measured, 1e-12).expect("both factors were asked for");
    let residual = design * &scaled - measured;
    let rms_norm = (residual.norm_squared() / rows.len() as f64).sqrt();
    let coefficients = scaled.iter().zip(&scales).map(|(value, scale)| value / scale * 1e-3).collect();
    (coefficients, rms_norm)
}

#[test]
fn fit_of_the_grid_measurement_leaves_the_stated_residuals() {
    for (order, expected, last_digit) in
        [(1, 1.637, 1e-3), (2, 0.429, 1e-3), (3, 0.133, 1e-3), (4, 0.0982, 1e-4), (6, 0.0978, 1e-4)]
    {
        let (_, rms_norm) = fit_grid(order);
        assert!((rms_norm - expected).abs() < 0.51 * last_digit, "P = {order}: {rms_norm}, not {expected}");
    }
    let (coefficients, _) = fit_grid(4);
    assert!((coefficients[0] - 6.492e-7).abs() < 0.51e-10, "a1 = {}", coefficients[0]);
}
