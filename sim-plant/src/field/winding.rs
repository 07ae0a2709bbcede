//! Field of a thin solenoid and of a thick winding: integrals of current loops.
//!
//! | symbol | meaning |
//! |---|---|
//! | `a`, `j` | radius of a cylindrical current sheet, its current per length, A/m |
//! | `x_1`, `x_2` | where the sheet begins and ends along the axis |
//! | `xi_i`, `r` | `x - x_i`, distance from the axis |
//! | `b_0`, `q_0`, `s_0`, `h_0` | `b`, `q`, `s`, `h` of a loop of 1 A, (F3) to (F6) |
//!
//! A sheet is a row of loops, so that integrals along it of derivatives along it are differences of its ends:
//!
//! `q = j [h_0(xi_2) - h_0(xi_1)]`, `db/dx = j [b_0(xi_1) - b_0(xi_2)]`, `s = j [q_0(xi_1) - q_0(xi_2)]`
//!
//! `b = (mu0 j / pi) a / (a + r) [g(xi_1) - g(xi_2)]`, `g(xi) = xi / beta cel(kc, y^2, 1, y)`,
//! `y = (a - r) / (a + r)`                                                                (F7)
//!
//! A winding of `N` turns between radii `a_1` and `a_2` carries a uniform current density; per ampere it is
//! an integral of sheets, done by Gauss-Legendre over the radius with [`SHEETS`] nodes `a_i` and weights
//! `w_i`:
//!
//! `field = sum_i w_i sheet(a_i, j = N / (length (a_2 - a_1)))`                               (F8)
//!
//! The integrand is analytic in the radius outside of the winding: the rule converges geometrically, the
//! slower the nearer the point is in units of the thickness. Inside the winding it does not hold.
//!
//! Source: Derby and Olbert, American Journal of Physics 78 (2010) 229, for `b`.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::axial::Axial;
use super::current_loop::{LoopField, bends_on_axis};
use super::elliptic::{Complete, cel};
use super::quadrature::gauss_legendre;
use super::sample::MU0;

/// Nodes over the thickness: errors below 1e-9 from half a thickness away from the winding on, and below
/// 1e-13 from one on.
const SHEETS: usize = 16;
/// Nodes over thickness and length of each winding of a mutual inductance.
const NODES_OF_INDUCTANCE: usize = 8;

/// A cylindrical current sheet about the x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// m.
    pub radius: f64,
    /// Lesser end along the axis, m.
    pub from: f64,
    /// Greater end, m.
    pub to: f64,
}

/// A uniformly wound coil of rectangular section; its face is the plane `x = 0`, its body lies at negative
/// `x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Winding {
    /// m.
    pub inner_radius: f64,
    /// m.
    pub outer_radius: f64,
    /// m.
    pub length: f64,
    /// Turns in all.
    pub turns: f64,
}

/// The field and its derivatives along the axis, as an interpolation by derivatives needs them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jet {
    /// The field.
    pub axial: Axial,
    /// `ds/dx`, T/m^3.
    pub slope_by_x: f64,
    /// `dt/dx`, T/m^4.
    pub bend_by_x: f64,
}

impl Sheet {
    /// Field of 1 A/m at `x` along the axis and `r` from it, m; anywhere but on the sheet.
    #[must_use]
    pub fn at(&self, x: f64, r: f64) -> Axial {
        self.jet(x, r).axial
    }

    fn jet(&self, x: f64, r: f64) -> Jet {
        let ends = [x - self.from, x - self.to];
        let [near, far] = ends.map(|xi| LoopField::new(self.radius, xi, r));
        let [first, last] = ends.map(|xi| self.wall(xi, r));
        let u = r * r;
        let along = MU0 / PI * self.radius / (self.radius + r) * (first - last);
        let radial = far.potential - near.potential;
        let along_slope = near.along - far.along;
        let slope = near.radial - far.radial;
        let slope_by_x = near.radial_slope - far.radial_slope;
        let mut axial = Axial::from_slopes(along, radial, along_slope, slope, u); // (F7)
        let along_bend = near.along_slope - far.along_slope;
        let mut bend_by_x = if u > 0.0 { -(along_bend + 2.0 * slope) / u } else { 0.0 };
        if u == 0.0 {
            // On the axis q = -b'/2 + u b''' / 16.
            let [near, far] = ends.map(|xi| bends_on_axis(self.radius, xi));
            axial.bend = (near[0] - far[0]) / 8.0;
            bend_by_x = (near[1] - far[1]) / 8.0;
        }
        Jet { axial, slope_by_x, bend_by_x }
    }

    /// `g` of (F7).
    fn wall(&self, xi: f64, r: f64) -> f64 {
        let (difference, sum) = (self.radius - r, self.radius + r);
        let beta = sum.hypot(xi);
        let kc = difference.hypot(xi) / beta;
        let y = difference / sum;
        if y == 0.0 {
            // The mean of the limits from within and without, which differ by what the other end takes away
            // again.
            let integrals = Complete::new(kc);
            return xi / beta * (integrals.b + integrals.d);
        }
        xi / beta * cel(kc, y * y, 1.0, y)
    }
}

impl Winding {
    /// Field of 1 A at `x` along the axis and `r` from it, m, by the sum (F8); anywhere outside the winding.
    #[must_use]
    pub fn at(&self, x: f64, r: f64) -> Axial {
        self.jet(x, r).axial
    }

    /// The same with its derivatives along the axis.
    #[must_use]
    pub fn jet(&self, x: f64, r: f64) -> Jet {
        static RULE: LazyLock<[(f64, f64); SHEETS]> = LazyLock::new(|| gauss_legendre(0.0, 1.0));
        let thickness = self.outer_radius - self.inner_radius;
        let mut sum = Jet::default();
        for (place, weight) in RULE.iter() {
            let radius = self.inner_radius + thickness * place;
            let jet = Sheet { radius, from: -self.length, to: 0.0 }.jet(x, r);
            let weight = weight * self.turns / self.length;
            sum.axial.along += weight * jet.axial.along; // (F8)
            sum.axial.radial += weight * jet.axial.radial;
            sum.axial.slope += weight * jet.axial.slope;
            sum.axial.bend += weight * jet.axial.bend;
            sum.slope_by_x += weight * jet.slope_by_x;
            sum.bend_by_x += weight * jet.bend_by_x;
        }
        sum
    }

    /// Dipole moment of 1 A, m^2.
    #[must_use]
    pub fn moment(&self) -> f64 {
        let (inner, outer) = (self.inner_radius, self.outer_radius);
        self.turns * PI * (inner * inner + inner * outer + outer * outer) / 3.0
    }

    /// Turns per length and thickness, 1/m^2.
    fn density(&self) -> f64 {
        self.turns / (self.length * (self.outer_radius - self.inner_radius))
    }

    /// Loops that stand for the winding, as (radius, x, turns).
    fn loops(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        let radii = gauss_legendre::<NODES_OF_INDUCTANCE>(self.inner_radius, self.outer_radius);
        let places = gauss_legendre::<NODES_OF_INDUCTANCE>(-self.length, 0.0);
        let density = self.density();
        radii.into_iter().flat_map(move |(radius, by_radius)| {
            places.into_iter().map(move |(x, by_place)| (radius, x, density * by_radius * by_place))
        })
    }
}

/// Mutual inductance (H) of two windings on one axis that face each other, `gap` (m) between their faces:
/// flux through the second that has the direction of its own, per ampere in the first, when both currents
/// turn the same way about the common axis.
///
/// The vector potential (F6) integrated round every turn, which for two loops is Maxwell's formula:
/// `M = 2 pi a_2^2 h(a_1, x, a_2) = 8 mu0 a_1^2 a_2^2 C / beta^3`                              (F17)
#[must_use]
pub fn mutual_inductance(first: &Winding, second: &Winding, gap: f64) -> f64 {
    let pairs = first.loops().flat_map(|left| second.loops().map(move |right| (left, right)));
    pairs
        .map(|((first_radius, first_x, first_turns), (second_radius, second_x, second_turns))| {
            let apart = gap - first_x - second_x;
            let potential = LoopField::new(first_radius, apart, second_radius).potential;
            first_turns * second_turns * 2.0 * PI * second_radius * second_radius * potential // (F17)
        })
        .sum()
}

#[cfg(test)]
mod tests;
