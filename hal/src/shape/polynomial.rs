//! One polynomial in space from base to tip, as the paper has it.
//!
//! | symbol | meaning |
//! |---|---|
//! | `P(s)` | centreline; `p_0`, `t_0` position and tangent of the clamp |
//! | `L`, `x` | length of the rod, `s / L` |
//! | `c_j` | parameters, vectors without unit |
//!
//! ```text
//! P(s) = p_0 + s t_0 + L x^2 sum_j c_j P_j(2 x - 1)                            (1)
//! |P'(s)| = 1 within SPEED at every station                                    (2)
//! ```
//!
//! (1) meets position and tangent of the clamp exactly. The points fix where the curve runs, not how fast;
//! (2) does. Expected beforehand: `c_j` of the size of the expected curvature, each order [`DECAY`] of the
//! one before, which keeps a hidden tip from swinging about.

use nalgebra::Vector3;

use super::frame::Frame;
use super::legendre::legendre;
use super::normal::NormalEquations;
use super::stations::{Centreline, Layout};

/// Standard deviation of the speed from 1 at one station.
const SPEED: f64 = 0.03;
/// Standard deviation of an order over that of the order before.
const DECAY: f64 = 0.5;

/// The model's constants and scratch.
#[derive(Debug, Clone)]
pub(super) struct PolynomialModel {
    base: Frame,
    orders: usize,
    /// `L x^2 P_j` at each station, m, and its slope by `s`; `orders` a station.
    values: Vec<f64>,
    slopes: Vec<f64>,
    /// `P'` at each station.
    velocity: Vec<Vector3<f64>>,
    /// Inverse variance of each order.
    weight: Vec<f64>,
}

impl PolynomialModel {
    pub fn new(base: Frame, layout: &Layout, degree: usize, curvature: f64) -> Self {
        let orders = degree - 1;
        let length = layout.length();
        let (mut values, mut slopes) = (vec![0.0; orders], vec![0.0; orders]);
        let mut model = Self {
            base,
            orders,
            values: Vec::new(),
            slopes: Vec::new(),
            velocity: vec![base.tangent(); layout.stations.len()],
            weight: Vec::new(),
        };
        for station in &layout.stations {
            let x = station.s / length;
            legendre(2.0 * x - 1.0, &mut values, &mut slopes);
            for (value, slope) in values.iter().zip(&slopes) {
                model.values.push(length * x * x * value);
                model.slopes.push(2.0 * x * value + 2.0 * x * x * slope);
            }
        }
        // The second derivative of L x^2 is 2 / L.
        let deviation = |order: usize| 0.5 * curvature * length * DECAY.powi(order as i32);
        model.weight = (0..orders).map(|order| deviation(order).powi(-2)).collect();
        model
    }

    pub fn parameter_count(&self) -> usize {
        3 * self.orders
    }

    pub fn place(&mut self, parameters: &[f64], layout: &Layout, centreline: &mut Centreline) {
        let straight = self.base.tangent();
        for (index, station) in layout.stations.iter().enumerate() {
            let range = index * self.orders..(index + 1) * self.orders;
            let (values, slopes) = (&self.values[range.clone()], &self.slopes[range]);
            let mut position = self.base.position + straight * station.s;
            let mut velocity = straight;
            for ((value, slope), c) in values.iter().zip(slopes).zip(parameters.chunks_exact(3)) {
                let c = Vector3::new(c[0], c[1], c[2]);
                position += c * *value; // (1)
                velocity += c * *slope;
            }
            let speed = velocity.norm().max(1e-3);
            let tangent = velocity / speed;
            self.velocity[index] = velocity;
            centreline.position[index] = position;
            centreline.tangent[index] = tangent;
            centreline.active[index] = 3 * self.orders;
            let (shifts, turns) = centreline.derivatives_mut(index);
            let columns = shifts.chunks_exact_mut(3).zip(turns.chunks_exact_mut(3));
            for ((value, slope), (shift, turn)) in values.iter().zip(slopes).zip(columns) {
                for axis in 0..3 {
                    shift[axis] = Vector3::ith(axis, *value);
                    turn[axis] = (Vector3::ith(axis, 1.0) - tangent * tangent[axis]) * (slope / speed);
                }
            }
        }
    }

    pub fn add_expectation(
        &self,
        parameters: &[f64],
        centreline: &Centreline,
        equations: &mut NormalEquations,
    ) {
        for (index, parameter) in parameters.iter().enumerate() {
            equations.add_single(index, self.weight[index / 3], -parameter);
        }
        // At most 12 orders.
        let mut row = [0.0; 36];
        for (index, velocity) in self.velocity.iter().enumerate() {
            let tangent = centreline.tangent[index];
            let slopes = &self.slopes[index * self.orders..(index + 1) * self.orders];
            for (entries, slope) in row.chunks_exact_mut(3).zip(slopes) {
                entries.copy_from_slice((tangent * *slope).as_slice());
            }
            let row = &row[..parameters.len()];
            equations.add_row(row, SPEED.powi(-2), 1.0 - velocity.norm()); // (2)
        }
    }
}
