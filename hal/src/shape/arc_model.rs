//! An inextensible centreline: curvature as a polynomial in each section, magnets straight.
//!
//! | symbol | meaning |
//! |---|---|
//! | `R(s)`, `P(s)` | frame without twist about its tangent, and centreline |
//! | `k_a(s)` | curvature about body axis `a` (x, y), 1/m |
//! | `c_(g,j,a)` | parameters: coefficient of the Legendre polynomial `P_j` in section `g`, 1/m |
//! | `x` | place within a section, -1 at its beginning, 1 at its end |
//!
//! ```text
//! k_a(s) = sum_j c_(g,j,a) P_j(x),  R' = R (k_x, k_y, 0)^,  P' = R e_z          (1)
//! dP(s)/dc = a(s) x P(s) - b(s),  dT(s)/dc = a(s) x T(s)                        (2)
//! a(s) = int P_j R e_a ds',  b(s) = int P_j R e_a x P ds'  from 0 to s           (3)
//! ```
//!
//! (2) says that bending a little at `s'` turns all beyond it about `P(s')`. (1) is integrated with one
//! curvature a span, (3) by the midpoint rule.
//!
//! Expected beforehand, for a section of length `l` and stiffness `EI` with `n` magnets beyond it, each
//! subject to a force of the size `F`, as standard deviations:
//!
//! ```text
//! c_(g,0): k      c_(g,1): f = n F l / (2 EI)      c_(g,2): k f l / 6      c_(g,j): DECAY c_(g,j-1)      (4)
//! ```
//!
//! The slope of `EI k_a` along a section is the transverse force in it, and without load on the section
//! itself that is constant: so curvature is linear, but for the force turning against the bent section,
//! `k_a'' = (N / EI) k_a` with the axial force `N`. This is what carries a hidden tip: the slope alone,
//! extrapolated from points with noise, would be off by several degrees.

use nalgebra::Vector3;

use super::frame::Frame;
use super::legendre::legendre;
use super::normal::NormalEquations;
use super::outline::Piece;
use super::stations::{Centreline, Layout};

/// Standard deviation of an order of the curvature, from the third on, over that of the order before.
const DECAY: f64 = 0.1;

/// The model's constants and scratch.
#[derive(Debug, Clone)]
pub(super) struct ArcModel {
    base: Frame,
    orders: usize,
    /// First parameter of each piece; for a magnet that of the next section.
    first: Vec<usize>,
    parameters: usize,
    /// Values of the basis at the middle of each span, `orders` a span; empty for magnets' spans.
    basis: Vec<f64>,
    /// Inverse variance of each parameter.
    weight: Vec<f64>,
    /// `a` and `b` so far.
    sums: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl ArcModel {
    pub fn new(base: Frame, layout: &Layout, degree: usize, curvature: f64, force: f64) -> Self {
        let orders = degree + 1;
        let mut first = Vec::new();
        let mut weight = Vec::new();
        for piece in &layout.pieces {
            first.push(weight.len());
            if piece.is_flexible {
                let deviations = expected(piece, orders, curvature, force);
                weight.extend(deviations.flat_map(|deviation| [deviation.powi(-2); 2]));
            }
        }
        let parameters = weight.len();
        let mut basis = vec![0.0; layout.spans.len() * orders];
        let mut slopes = vec![0.0; orders];
        for (index, span) in layout.spans.iter().enumerate() {
            let piece = &layout.pieces[span.piece];
            let middle = layout.stations[index].s + span.length / 2.0;
            let x = (middle - piece.middle()) / (piece.length / 2.0);
            legendre(x, &mut basis[index * orders..(index + 1) * orders], &mut slopes);
        }
        Self {
            base,
            orders,
            first,
            parameters,
            basis,
            weight,
            sums: vec![(Vector3::zeros(), Vector3::zeros()); parameters],
        }
    }

    pub fn parameter_count(&self) -> usize {
        self.parameters
    }

    pub fn place(&mut self, parameters: &[f64], layout: &Layout, centreline: &mut Centreline) {
        self.sums.fill((Vector3::zeros(), Vector3::zeros()));
        let mut frame = self.base;
        centreline.position[0] = frame.position;
        centreline.tangent[0] = frame.tangent();
        centreline.active[0] = 0;
        let mut active = 0;
        for (index, span) in layout.spans.iter().enumerate() {
            let first = self.first[span.piece];
            let next = if layout.pieces[span.piece].is_flexible {
                let basis = &self.basis[index * self.orders..(index + 1) * self.orders];
                let own = &parameters[first..first + 2 * self.orders];
                let mut curvature = Vector3::zeros();
                for (value, pair) in basis.iter().zip(own.chunks_exact(2)) {
                    curvature.x += value * pair[0]; // (1)
                    curvature.y += value * pair[1];
                }
                let next = frame.advanced(&curvature, span.length);
                let middle = (frame.position + next.position) * 0.5;
                let axes = (frame.rotation + next.rotation) * (0.5 * span.length);
                let arms = [0, 1].map(|axis| {
                    let axis = axes.column(axis).into_owned();
                    (axis, axis.cross(&middle))
                });
                let sums = self.sums[first..first + 2 * self.orders].chunks_exact_mut(2);
                for (value, pair) in basis.iter().zip(sums) {
                    for (sum, arm) in pair.iter_mut().zip(&arms) {
                        sum.0 += arm.0 * *value; // (3)
                        sum.1 += arm.1 * *value;
                    }
                }
                active = first + 2 * self.orders;
                next
            } else {
                Frame { position: frame.position + frame.tangent() * span.length, ..frame }
            };
            frame = next;
            let station = index + 1;
            let (position, tangent) = (frame.position, frame.tangent());
            centreline.position[station] = position;
            centreline.tangent[station] = tangent;
            centreline.active[station] = active;
            let (shifts, turns) = centreline.derivatives_mut(station);
            for ((shift, turn), (a, b)) in shifts.iter_mut().zip(turns).zip(&self.sums) {
                *shift = a.cross(&position) - b; // (2)
                *turn = a.cross(&tangent);
            }
        }
    }

    pub fn add_expectation(&self, parameters: &[f64], equations: &mut NormalEquations) {
        for (index, (parameter, weight)) in parameters.iter().zip(&self.weight).enumerate() {
            equations.add_single(index, *weight, -parameter); // (4)
        }
    }
}

/// Standard deviations of a section's orders, 1/m.
fn expected(piece: &Piece, orders: usize, curvature: f64, force: f64) -> impl Iterator<Item = f64> {
    let linear = piece.magnets_beyond.max(1) as f64 * force * piece.length / (2.0 * piece.stiffness);
    let quadratic = curvature * linear * piece.length / 6.0;
    (0..orders).map(move |order| match order {
        0 => curvature, // (4)
        1 => linear,
        _ => quadratic * DECAY.powi(order as i32 - 2),
    })
}
