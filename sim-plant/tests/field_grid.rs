//! The truth of a winding against the simulated probe measurement `tests/reference/coil_grid.csv`, and the
//! controller's series fitted to the truth.

mod field_support;
mod validation;

use field_support::{AIR_CORE, GRID_WINDING, in_space, reference};
use magsteer_sim_plant::field::{Domain, Multipole, Table, Winding};
use nalgebra::{DMatrix, DVector, Vector3};
use validation::{Row, hold};

/// Standard deviation of a component: noise of 0.05 mT and rounding to 0.1 mT, mT.
const NOISE_MT: f64 = 0.057_735;

struct Grid {
    /// m, in the coil's frame.
    points: Vec<Vector3<f64>>,
    current: f64,
    /// mT, three components a point.
    measured: DVector<f64>,
}

impl Grid {
    fn read() -> Self {
        let text = reference("coil_grid.csv");
        let numbers = |line: &str| -> Vec<f64> {
            line.split(',').map(|value| value.parse().expect("a number")).collect()
        };
        let rows: Vec<Vec<f64>> = text.lines().skip(1).map(numbers).collect();
        let points = rows.iter().map(|row| Vector3::new(row[0], row[1], row[2]) * 1e-3).collect();
        let measured =
            DVector::from_iterator(3 * rows.len(), rows.iter().flat_map(|row| [row[4], row[5], row[6]]));
        Self { points, current: rows[0][3], measured }
    }

    /// What the truth has there, mT.
    fn truth(&self, winding: &Winding) -> DVector<f64> {
        // By the table, as the plant does.
        let domain = Domain { x_min: 0.043, x_max: 0.14, r_max: 0.055 };
        let table = Table::new(winding, domain).expect("a table");
        let flux = |point: &Vector3<f64>| {
            let field = |x: f64, r: f64| table.at(x, r * r).expect("the table holds the grid");
            in_space(field, &Vector3::x(), point).0 * (self.current * 1e3)
        };
        self.stacked(self.points.iter().map(flux))
    }

    fn stacked(&self, vectors: impl Iterator<Item = Vector3<f64>>) -> DVector<f64> {
        DVector::from_iterator(
            3 * self.points.len(),
            vectors.flat_map(|vector| [vector.x, vector.y, vector.z]),
        )
    }

    /// Norm over the components of the RMS over the points, mT.
    fn rms(&self, residual: &DVector<f64>) -> f64 {
        (residual.norm_squared() / self.points.len() as f64).sqrt()
    }

    /// Least-squares series of an order, per ampere, and what it makes on the grid, mT.
    fn fit(&self, order: usize, values: &DVector<f64>) -> (Vec<f64>, DVector<f64>) {
        let columns: Vec<DVector<f64>> = (1..=order)
            .map(|k| {
                let mut coefficients = vec![0.0; k];
                coefficients[k - 1] = 1.0;
                let series = Multipole::new(&coefficients);
                let flux = |point| in_space(|x, r| series.at(x, r * r), &Vector3::x(), point).0;
                self.stacked(self.points.iter().map(|point| flux(point) * (self.current * 1e3)))
            })
            .collect();
        // Columns of unit norm: coefficients differ by many orders of magnitude.
        let scales: Vec<f64> = columns.iter().map(|column| column.norm()).collect();
        let design =
            DMatrix::from_fn(values.len(), order, |row, column| columns[column][row] / scales[column]);
        let scaled =
            design.clone().svd(true, true).solve(values, 1e-12).expect("both factors were asked for");
        let coefficients = scaled.iter().zip(&scales).map(|(value, scale)| value / scale).collect();
        (coefficients, design * scaled)
    }
}

#[test]
fn the_truth_on_the_grid_is_the_measurement_within_its_noise() {
    let grid = Grid::read();
    let difference = grid.truth(&GRID_WINDING) - &grid.measured;
    let count = difference.len() as f64;
    let rms = difference.norm() / count.sqrt();
    // 1134 numbers: the RMS of pure noise has a standard deviation of 2 % of itself, and none lies beyond
    // five sigma.
    let rows = [
        Row::new("RMS of the difference over the noise, less 1", rms / NOISE_MT - 1.0, 0.08, ""),
        Row::new("mean difference", difference.mean(), 4.0 * NOISE_MT / count.sqrt(), "mT"),
        Row::new("greatest difference over the noise", difference.amax() / NOISE_MT, 5.0, ""),
    ];
    hold("field.md", "grid", &rows);
}

#[test]
fn the_series_fitted_to_the_truth_leaves_what_the_reference_states() {
    let grid = Grid::read();
    let truth = grid.truth(&GRID_WINDING);
    let mut rows = Vec::new();
    for (order, stated, digit) in
        [(1, 1.637, 1e-3), (2, 0.429, 1e-3), (3, 0.133, 1e-3), (4, 0.0982, 1e-4), (6, 0.0978, 1e-4)]
    {
        let (_, modelled) = grid.fit(order, &truth);
        let residual = grid.rms(&(modelled - &grid.measured));
        // The stated fit saw the noise: its `order` parameters took up a share of it, 1134 numbers in all.
        let taken = residual * (order as f64 + 3.0) / grid.measured.len() as f64;
        let what = format!("residual of the fit, P = {order}, against {stated} mT");
        rows.push(Row::new(what, residual - stated, digit + taken, "mT"));
    }
    let (coefficients, _) = grid.fit(4, &truth);
    // The stated fit has a standard deviation of about 0.3 % from the noise.
    let what = "a1 of the fit, P = 4, over 6.492e-7 T m^3/A, less 1";
    rows.push(Row::new(what, coefficients[0] / 6.492e-7 - 1.0, 0.01, ""));
    hold("field.md", "fit", &rows);
}

/// Goal: the shipped winding is the shipped series' own: what both make at the places where magnets are
/// differs by little.
#[test]
fn the_shipped_winding_makes_the_field_of_the_shipped_series() {
    let series =
        Multipole::new(&[6.422646756191375e-7, 1.870831551827e-8, 1.746090239903e-10, 5.183775351973e-13]);
    let worst = |x_min_mm: i32| {
        let mut worst = 0.0_f64;
        for x_mm in (x_min_mm..=140).step_by(5) {
            for r_mm in (0..=50).step_by(5) {
                let point = Vector3::new(f64::from(x_mm), f64::from(r_mm), 0.0) * 1e-3;
                let (found, _) = in_space(|x, r| AIR_CORE.at(x, r), &Vector3::x(), &point);
                let (expected, _) = in_space(|x, r| series.at(x, r * r), &Vector3::x(), &point);
                worst = worst.max((found - expected).norm() / expected.norm());
            }
        }
        worst
    };
    let rows = [
        Row::new("winding against series from 60 mm on", worst(60), 0.03, ""),
        Row::new("winding against series from 45 mm on", worst(45), 0.06, ""),
    ];
    hold("field.md", "shipped", &rows);
}
