use super::*;

/// The winding of the reference grid.
const GRID_WINDING: Winding =
    Winding { inner_radius: 0.024, outer_radius: 0.046, length: 0.05, turns: 1700.0 };
/// Points in front of it and beside it, on the axis and off it, m; none nearer than 20 mm.
const PLACES: [(f64, f64); 7] =
    [(0.02, 0.0), (0.02, 0.035), (0.05, 1e-9), (0.043, 0.03), (0.1, 0.06), (-0.02, 0.075), (-0.3, 0.2)];

/// A sum of fields, each with its weight.
fn sum(parts: impl Iterator<Item = (Axial, f64)>) -> Axial {
    parts.fold(Axial::default(), |sum, (part, weight)| Axial {
        along: sum.along + weight * part.along,
        radial: sum.radial + weight * part.radial,
        slope: sum.slope + weight * part.slope,
        bend: sum.bend + weight * part.bend,
    })
}

/// Largest of the relative differences of field and gradient, each by its greatest component.
fn off(found: &Axial, expected: &Axial, r: f64) -> f64 {
    let u = r * r;
    let field = |axial: &Axial| [axial.along, axial.radial * r];
    let gradient = |axial: &Axial| [axial.along_slope(u), axial.radial, axial.slope * r, axial.bend * u];
    let relative = |found: &[f64], expected: &[f64]| {
        let scale = expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        found.iter().zip(expected).fold(0.0_f64, |most, (f, e)| most.max((f - e).abs() / scale))
    };
    relative(&field(found), &field(expected)).max(relative(&gradient(found), &gradient(expected)))
}

#[test]
fn a_sheet_is_the_sum_of_its_loops() {
    let sheet = Sheet { radius: 0.03, from: -0.05, to: 0.0 };
    for (x, r) in PLACES.into_iter().chain([(-0.02, 0.0), (-0.02, 0.01)]) {
        let loops = gauss_legendre::<64>(sheet.from, sheet.to);
        let summed =
            sum(loops.iter().map(|(at, weight)| (LoopField::new(0.03, x - at, r).axial(r * r), *weight)));
        let deviation = off(&sheet.at(x, r), &summed, r);
        assert!(deviation < 1e-11, "at {x}, {r}: {deviation:e}");
    }
}

#[test]
fn a_winding_is_the_sum_of_its_loops() {
    let Winding { inner_radius, outer_radius, length, .. } = GRID_WINDING;
    for (x, r) in PLACES {
        let radii = gauss_legendre::<48>(inner_radius, outer_radius);
        let loops = radii.iter().flat_map(|(radius, by_radius)| {
            gauss_legendre::<48>(-length, 0.0).map(|(at, by_place)| {
                let weight = by_radius * by_place * GRID_WINDING.density();
                (LoopField::new(*radius, x - at, r).axial(r * r), weight)
            })
        });
        let deviation = off(&GRID_WINDING.at(x, r), &sum(loops), r);
        assert!(deviation < 1e-11, "at {x}, {r}: {deviation:e}");
    }
}

/// Goal: what [`SHEETS`] says of the number of nodes.
#[test]
fn the_nodes_over_the_thickness_suffice_from_ten_millimetres_on() {
    let Winding { inner_radius, outer_radius, length, .. } = GRID_WINDING;
    let near = [(0.01, 0.0), (0.01, 0.024), (0.01, 0.035), (0.01, 0.046), (-0.02, 0.056), (-0.02, 0.014)];
    for (x, r) in near {
        let sheets = gauss_legendre::<96>(inner_radius, outer_radius);
        let summed = sum(sheets.iter().map(|(radius, weight)| {
            let sheet = Sheet { radius: *radius, from: -length, to: 0.0 };
            (sheet.at(x, r), weight * GRID_WINDING.density())
        }));
        let deviation = off(&GRID_WINDING.at(x, r), &summed, r);
        assert!(deviation < 1e-9, "at {x}, {r}: {deviation:e}");
    }
}

#[test]
fn derivatives_along_the_axis_are_difference_quotients() {
    for (x, r) in PLACES {
        let (jet, step) = (GRID_WINDING.jet(x, r), 1e-5);
        let [after, before] = [x + step, x - step].map(|x| GRID_WINDING.at(x, r));
        let slope_by_x = (after.slope - before.slope) / (2.0 * step);
        let bend_by_x = (after.bend - before.bend) / (2.0 * step);
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-5 * expected.abs();
        assert!(near(jet.slope_by_x, slope_by_x), "at {x}, {r}: {} {slope_by_x}", jet.slope_by_x);
        // Near the axis t is a difference over u: 1e-9 m are too near for a quotient.
        if r == 0.0 || r > 1e-3 {
            assert!(near(jet.bend_by_x, bend_by_x), "at {x}, {r}: {} {bend_by_x}", jet.bend_by_x);
        }
    }
}

#[test]
fn the_bend_on_the_axis_is_the_limit_from_beside_it() {
    for x in [0.02, 0.05, 0.12] {
        let (on, beside) = (GRID_WINDING.jet(x, 0.0), GRID_WINDING.jet(x, 1e-4));
        // The next term is smaller by (r / 30 mm)^2, and u = 1e-8 m^2 leaves six digits of t.
        assert!((on.axial.bend / beside.axial.bend - 1.0).abs() < 1e-4, "at {x}");
        assert!((on.bend_by_x / beside.bend_by_x - 1.0).abs() < 1e-4, "at {x}");
    }
}

#[test]
fn mutual_inductance_is_symmetric_maxwells_and_that_of_dipoles_far_away() {
    let other = Winding { inner_radius: 0.045, outer_radius: 0.063, length: 0.043, turns: 642.0 };
    let mutual = mutual_inductance(&GRID_WINDING, &other, 0.1);
    assert!((mutual / mutual_inductance(&other, &GRID_WINDING, 0.1) - 1.0).abs() < 1e-12);

    // Two loops: Maxwell's (2 / k - k) K - (2 / k) E with K and E at k = 0.8 from tables.
    let (a, k) = (0.05, 0.8_f64);
    let apart = 2.0 * a * (1.0 / (k * k) - 1.0_f64).sqrt();
    let thin = Winding { inner_radius: a - 1e-7, outer_radius: a + 1e-7, length: 2e-7, turns: 1.0 };
    let (integral_k, integral_e) = (1.995_302_777_664_729_6, 1.276_349_943_169_906_4);
    let maxwell = MU0 * a * ((2.0 / k - k) * integral_k - 2.0 / k * integral_e);
    let found = mutual_inductance(&thin, &thin, apart - 2e-7);
    // The loops have a thickness of 1e-7 m: second order in 1e-7 / 0.05.
    assert!((found / maxwell - 1.0).abs() < 1e-9, "{found} {maxwell}");

    let gap = 5.0;
    let dipoles = MU0 * GRID_WINDING.moment() * other.moment() / (2.0 * PI * (gap + 0.0465_f64).powi(3));
    let far = mutual_inductance(&GRID_WINDING, &other, gap);
    // Sizes of 0.06 m at 5 m: (0.06 / 5)^2.
    assert!((far / dipoles - 1.0).abs() < 5e-4, "{far} {dipoles}");
}

/// Goal: the number that `docs/field.md` gives for the two air cores of the shipped rig, which face each
/// other at 171 mm.
#[test]
fn the_shipped_air_cores_share_six_tenths_of_a_millihenry() {
    let air = Winding { inner_radius: 0.045, outer_radius: 0.063, length: 0.043, turns: 642.0 };
    let mutual = mutual_inductance(&air, &air, 0.171);
    assert!((mutual / 6.194e-4 - 1.0).abs() < 1e-4, "{mutual:e}");
}
