//! A winding's field from a table: cubic interpolation in the half plane, sixty times faster than the sum.
//!
//! | symbol | meaning |
//! |---|---|
//! | `x`, `u` | place along the axis, squared distance from it: the field is smooth in both |
//! | `b`, `q`, `s`, `t` | as in `axial` |
//! | `X`, `U` | place within a cell, 0 to 1 each way |
//!
//! Nodes of a regular grid hold `b` and `q` with their derivatives by `x`, by `u` and by both, exact from the
//! winding's sum:
//! `b, db/dx, s/2, (ds/dx)/2` and `q, s, t/2, (dt/dx)/2`. In a cell, with `p` one of `b` and `q`,
//!
//! `p(X, U) = sum_ij [H_i(X) H_j(U) p + K_i(X) H_j(U) p_x + H_i(X) K_j(U) p_u + K_i(X) K_j(U) p_xu]_ij`  (F16)
//!
//! over the four corners, with Hermite's cubics `H_0 = (1 + 2 X)(1 - X)^2`, `K_0 = X (1 - X)^2`,
//! `H_1(X) = H_0(1 - X)`, `K_1(X) = -K_0(1 - X)` (derivatives in units of the cell). It is continuously
//! differentiable across cells; `s = dq/dx` and `t = 2 dq/du` are taken from it, and `db/dx` from (F9), so
//! that the gradient stays symmetric and traceless to rounding.
//! `B` itself has an error of fourth order in the cell, the gradient of third order.
//!
//! The cells shrink with the distance between the winding and the table, on whose ratio the error depends.

use super::axial::Axial;
use super::winding::{Jet, Winding};

/// Size of a cell over the least distance between winding and table, along the axis and across it.
const CELL: f64 = 0.05;
/// Most cells each way: a table nearer to its winding would cost more than it saves.
const CELLS_MAX: f64 = 200.0;

/// Part of the half plane of a winding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    /// Least place along the axis, in front of the face, m.
    pub x_min: f64,
    /// Greatest place along the axis, m.
    pub x_max: f64,
    /// Greatest distance from the axis, m.
    pub r_max: f64,
}

/// `b` or `q` with derivatives in units of the cell: value, by `x`, by `u`, by both.
type Node = [[f64; 4]; 2];

/// The field of one winding over a domain.
#[derive(Debug, Clone)]
pub struct Table {
    domain: Domain,
    u_max: f64,
    rows: usize,
    x_scale: f64,
    u_scale: f64,
    /// Row by row of equal `u` for each `x`.
    nodes: Vec<Node>,
}

impl Table {
    /// Tabulates a winding; `None` when the domain is empty, or so near to the winding that a table would
    /// have too many cells.
    #[must_use]
    pub fn new(winding: &Winding, domain: Domain) -> Option<Self> {
        let Domain { x_min, x_max, r_max } = domain;
        let cell = CELL * x_min;
        // The shortest length across the axis is at the winding, where u changes by 2 r for each unit of r.
        let radius = winding.outer_radius.min(r_max);
        let columns = ((x_max - x_min) / cell).ceil();
        let u_max = r_max * r_max;
        let rows = (u_max / (2.0 * radius * cell)).ceil();
        let holds = |count: f64| (1.0..=CELLS_MAX).contains(&count);
        if !(holds(columns) && holds(rows)) {
            return None;
        }
        let (x_step, u_step) = ((x_max - x_min) / columns, u_max / rows);
        let (columns, rows) = (columns as usize, rows as usize);
        let node = |index: usize| {
            let (column, row) = (index / (rows + 1), index % (rows + 1));
            let u = u_step * row as f64;
            let jet = winding.jet(x_min + x_step * column as f64, u.sqrt());
            Self::node(&jet, u, x_step, u_step)
        };
        let nodes = (0..(columns + 1) * (rows + 1)).map(node).collect();
        Some(Self { domain, u_max, rows, x_scale: 1.0 / x_step, u_scale: 1.0 / u_step, nodes })
    }

    fn node(jet: &Jet, u: f64, x_step: f64, u_step: f64) -> Node {
        let Jet { axial, slope_by_x, bend_by_x } = *jet;
        let (by_u, by_both) = (0.5 * u_step, 0.5 * u_step * x_step);
        [
            [axial.along, axial.along_slope(u) * x_step, axial.slope * by_u, slope_by_x * by_both],
            [axial.radial, axial.slope * x_step, axial.bend * by_u, bend_by_x * by_both],
        ]
    }

    /// The field of 1 A at `x` along the axis and squared distance `u` from it; `None` outside of the table.
    #[must_use]
    pub fn at(&self, x: f64, u: f64) -> Option<Axial> {
        let Domain { x_min, x_max, .. } = self.domain;
        if !(x >= x_min && x < x_max && u < self.u_max) {
            return None;
        }
        let (x, u) = ((x - x_min) * self.x_scale, u * self.u_scale);
        let (column, row) = (x as usize, (u as usize).min(self.rows - 1));
        let (x, u) = (x - column as f64, u - row as f64);
        let first = column * (self.rows + 1) + row;
        let second = first + self.rows + 1;
        let [near, near_next] = self.nodes.get(first..first + 2)? else { return None };
        let [far, far_next] = self.nodes.get(second..second + 2)? else { return None };
        let (by_x, by_u) = (hermite(x), hermite(u));
        let (dx, du) = (hermite_slopes(x), hermite_slopes(u));
        // Along x first: value and u-derivative at both rows of nodes.
        let along_x = |part: usize, weights: &[f64; 4]| {
            let at_row = |near: &Node, far: &Node, entry: usize| {
                weights[0] * near[part][entry]
                    + weights[1] * near[part][entry + 1]
                    + weights[2] * far[part][entry]
                    + weights[3] * far[part][entry + 1]
            };
            [
                at_row(near, far, 0),
                at_row(near, far, 2),
                at_row(near_next, far_next, 0),
                at_row(near_next, far_next, 2),
            ]
        };
        let radial = along_x(1, &by_x);
        Some(Axial {
            along: dot(&along_x(0, &by_x), &by_u), // (F16)
            radial: dot(&radial, &by_u),           // (F16)
            slope: dot(&along_x(1, &dx), &by_u) * self.x_scale,
            bend: 2.0 * dot(&radial, &du) * self.u_scale,
        })
    }
}

fn dot(left: &[f64; 4], right: &[f64; 4]) -> f64 {
    left[0] * right[0] + left[1] * right[1] + left[2] * right[2] + left[3] * right[3]
}

/// `H_0`, `K_0`, `H_1`, `K_1`.
fn hermite(x: f64) -> [f64; 4] {
    let rest = 1.0 - x;
    let (square, rest_square) = (x * x, rest * rest);
    [(1.0 + 2.0 * x) * rest_square, x * rest_square, (1.0 + 2.0 * rest) * square, -rest * square]
}

/// Their derivatives.
fn hermite_slopes(x: f64) -> [f64; 4] {
    let rest = 1.0 - x;
    let product = 6.0 * x * rest;
    [-product, rest * (1.0 - 3.0 * x), product, x * (3.0 * x - 2.0)]
}
