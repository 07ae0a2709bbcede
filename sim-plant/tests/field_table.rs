//! What the table of a winding errs by, against the sum that it was made from.

mod field_support;
mod validation;

use field_support::{AIR_CORE, GRID_WINDING, in_space};
use magsteer_sim_plant::field::{Domain, Table, Winding};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use validation::{Row, hold};

/// Where magnets may be before the shipped air cores: from the boundary of their series to 1.2 times the
/// workspace.
const SHIPPED: Domain = Domain { x_min: 0.043, x_max: 0.152, r_max: 0.066 };

/// Greatest errors of field and gradient, each over its magnitude at the same point.
fn errors(winding: &Winding, domain: Domain) -> [f64; 2] {
    let table = Table::new(winding, domain).expect("a table");
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut worst = [0.0_f64; 2];
    for index in 0..20_000 {
        let x = random.random_range(domain.x_min..domain.x_max);
        // Every tenth on the axis or at the face, where derivatives are taken at the edge of the table.
        let (x, r) = match index % 20 {
            0 => (x, 0.0),
            10 => (domain.x_min, random.random_range(0.0..domain.r_max)),
            _ => (x, random.random_range(0.0..domain.r_max)),
        };
        let point = Vector3::new(x, 0.6 * r, -0.8 * r);
        let tabulated = |x: f64, r: f64| table.at(x, r * r).expect("inside");
        let (flux, gradient) = in_space(tabulated, &Vector3::x(), &point);
        let (exact_flux, exact_gradient) = in_space(|x, r| winding.at(x, r), &Vector3::x(), &point);
        worst[0] = worst[0].max((flux - exact_flux).norm() / exact_flux.norm());
        worst[1] = worst[1].max((gradient - exact_gradient).norm() / exact_gradient.norm());
    }
    worst
}

#[test]
fn the_table_keeps_its_bounds_everywhere() {
    let mut rows = Vec::new();
    let near = Domain { x_min: 0.02, x_max: 0.1, r_max: 0.05 };
    for (name, winding, domain) in [
        ("shipped air core from 43 mm", AIR_CORE, SHIPPED),
        ("winding of the grid from 43 mm", GRID_WINDING, SHIPPED),
        ("winding of the grid from 20 mm", GRID_WINDING, near),
    ] {
        let [flux, gradient] = errors(&winding, domain);
        rows.push(Row::new(format!("{name}: field"), flux, 1e-6, ""));
        rows.push(Row::new(format!("{name}: gradient"), gradient, 1e-4, ""));
    }
    hold("field.md", "table", &rows);
}

/// Goal: no jump in field or gradient where cells meet or where the sum takes over from the table.
#[test]
fn field_and_gradient_go_on_across_cells() {
    let table = Table::new(&AIR_CORE, SHIPPED).expect("a table");
    let tabulated = |x: f64, r: f64| table.at(x, r * r).expect("inside");
    let at = |x: f64, r: f64| in_space(tabulated, &Vector3::x(), &Vector3::new(x, r, 0.0));
    let step = 1e-9;
    for index in 0..4000 {
        let share = f64::from(index) / 4000.0;
        let (x, r) = (0.0431 + 0.1 * share, 0.001 + 0.06 * share);
        let ((flux, gradient), (flux_next, gradient_next)) = (at(x, r), at(x + step, r + step));
        // The gradient changes by about 3 / 43 mm of itself a metre: by 1e-7 in a nanometre.
        assert!((flux_next - flux).norm() < 1e-6 * flux.norm());
        assert!((gradient_next - gradient).norm() < 1e-6 * gradient.norm());
    }
}

#[test]
fn outside_of_the_table_nothing_is_made_up() {
    let table = Table::new(&AIR_CORE, SHIPPED).expect("a table");
    for (x, r) in [(0.0429, 0.0), (0.152, 0.0), (0.1, 0.066), (f64::NAN, 0.0), (0.1, f64::NAN)] {
        assert_eq!(table.at(x, r * r), None);
    }
    assert!(Table::new(&AIR_CORE, Domain { x_min: 0.043, x_max: 0.04, r_max: 0.066 }).is_none());
}
