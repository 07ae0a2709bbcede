//! Field of the coil array and its wrench on the magnets, from Legendre polynomials.
//!
//! Each coil is azimuthally symmetric. In its local frame (x along the coil axis towards the
//! workspace, origin at the expansion point) order `k` of eq. (4) is the gradient of
//! `a_k (-1)^(k+1) k! r^-(k+1) P_k(c)`:
//!
//! | symbol | meaning |
//! |---|---|
//! | `p`, `r`, `n` | local point, its distance, `p / r` |
//! | `e`, `c` | coil axis (local x), `n . e` |
//! | `P_k` | Legendre polynomial; `P'`, `P''` its derivatives |
//! | `a_k` | coefficient per ampere, T m^(k+2) / A |
//! | `B`, `G` | flux density, T, and its gradient `dB_i/dx_j`, T/m |
//!
//! `B_k = a_k (-1)^k k! r^-(k+2) [ -(k+1) P_k n + P_k' (e - c n) ]`            (4)
//!
//! With `(k+1) P_k + c P_k' = P'_(k+1)` the sum over orders takes the form `B = u p + w e`,
//! `u = -sum A_k r^-(k+3) P'_(k+1)`, `w = sum A_k r^-(k+2) P'_k`, `A_k = a_k (-1)^k k!`, whose gradient
//! needs only the derivatives of the two scalars by `r` and `c`.
//!
//! The series holds only outside the source: each coil has a least local x. A sample taken nearer says
//! so, and is that of the nearest point at the least x: wrenches stay bounded where the series would
//! turn over and grow without limit.

use magsteer_hal::HardwareDescription;
use magsteer_hal::config::ORDER_MAX;
use magsteer_hal::description::{CoilDescription, FrameDescription};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::sample::Field;

/// One coil: its constants, and where it stands and what it carries now.
#[derive(Debug, Clone)]
struct Coil {
    /// `A_k` of the module's head, per ampere.
    factors: [f64; ORDER_MAX],
    order: usize,
    valid_from_x: f64,
    frame: Option<usize>,
    rotation_at_zero: Matrix3<f64>,
    position_at_zero: Vector3<f64>,
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
    current: f64,
}

/// All coils at their present currents and frame angles.
#[derive(Debug, Clone)]
pub struct CoilArray {
    frames: Vec<FrameDescription>,
    coils: Vec<Coil>,
}

impl CoilArray {
    /// All coils of the description at zero current and zero angle. `gains` multiply the field that
    /// each coil makes per ampere; a coil without an entry has gain 1.
    #[must_use]
    pub fn new(description: &HardwareDescription, gains: &[f64]) -> Self {
        let gain = |index: usize| gains.get(index).copied().unwrap_or(1.0);
        let build = |(index, coil): (usize, &CoilDescription)| Coil::new(coil, gain(index));
        Self {
            frames: description.frames.clone(),
            coils: description.coils.iter().enumerate().map(build).collect(),
        }
    }

    /// Sets currents, A, and frame angles, rad, in the order of the description.
    pub fn actuate(&mut self, currents: &[f64], angles: &[f64]) {
        for (coil, current) in self.coils.iter_mut().zip(currents) {
            coil.current = *current;
        }
        for (index, (frame, angle)) in self.frames.iter().zip(angles).enumerate() {
            let axis = Unit::new_unchecked(Vector3::from(frame.axis));
            let turn = *Rotation3::from_axis_angle(&axis, *angle).matrix();
            let pivot = Vector3::from(frame.pivot);
            for coil in self.coils.iter_mut().filter(|coil| coil.frame == Some(index)) {
                coil.rotation = turn * coil.rotation_at_zero;
                coil.position = pivot + turn * (coil.position_at_zero - pivot);
            }
        }
    }

    /// Field at `point` (m, world).
    #[must_use]
    pub fn at(&self, point: &Vector3<f64>) -> Field {
        let mut total = Field::zero();
        for coil in self.coils.iter().filter(|coil| coil.current != 0.0) {
            let mut local = coil.rotation.tr_mul(&(point - coil.position));
            total.valid &= local.x >= coil.valid_from_x;
            local.x = local.x.max(coil.valid_from_x);
            let (flux, gradient) = coil.local(&local);
            total.flux += coil.rotation * (flux * coil.current);
            total.gradient += coil.rotation * (gradient * coil.current) * coil.rotation.transpose();
        }
        total
    }
}

impl Coil {
    fn new(description: &CoilDescription, gain: f64) -> Self {
        let order = description.coefficients.len().min(ORDER_MAX);
        let mut factors = [0.0; ORDER_MAX];
        let mut signed_factorial = 1.0;
        for (index, coefficient) in description.coefficients.iter().take(order).enumerate() {
            signed_factorial *= -((index + 1) as f64);
            factors[index] = gain * signed_factorial * coefficient;
        }
        let rotation = Matrix3::from_row_iterator(description.rotation.into_iter().flatten());
        let position = Vector3::from(description.position);
        Self {
            factors,
            order,
            valid_from_x: description.valid_from_x,
            frame: description.frame,
            rotation_at_zero: rotation,
            position_at_zero: position,
            rotation,
            position,
            current: 0.0,
        }
    }

    /// B and G for 1 A at a local point.
    fn local(&self, p: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let r = p.norm();
        let reciprocal = 1.0 / r;
        let n = p * reciprocal;
        let c = n.x;
        // P, P' and P'' of the orders k - 1 and k, from order 0 and 1.
        let (mut p_last, mut p_now) = (1.0, c);
        let (mut d_last, mut d_now) = (0.0, 1.0);
        let (mut dd_last, mut dd_now) = (0.0, 0.0);
        let (mut u, mut u_r, mut u_c) = (0.0, 0.0, 0.0);
        let (mut w, mut w_r, mut w_c) = (0.0, 0.0, 0.0);
        let mut power = reciprocal * reciprocal;
        for (index, factor) in self.factors.iter().take(self.order).enumerate() {
            let k = (index + 1) as f64;
            let p_next = ((2.0 * k + 1.0) * c * p_now - k * p_last) / (k + 1.0);
            let d_next = d_last + (2.0 * k + 1.0) * p_now;
            let dd_next = dd_last + (2.0 * k + 1.0) * d_now;
            power *= reciprocal; // r^-(k+2)
            let along_axis = factor * power;
            let along_point = -along_axis * reciprocal; // -A_k r^-(k+3)
            u += along_point * d_next; // (4)
            u_r -= (k + 3.0) * reciprocal * along_point * d_next;
            u_c += along_point * dd_next;
            w += along_axis * d_now; // (4)
            w_r -= (k + 2.0) * reciprocal * along_axis * d_now;
            w_c += along_axis * dd_now;
            (p_last, p_now) = (p_now, p_next);
            (d_last, d_now) = (d_now, d_next);
            (dd_last, dd_now) = (dd_now, dd_next);
        }
        let axis = Vector3::x();
        let c_gradient = (axis - n * c) * reciprocal;
        let u_gradient = n * u_r + c_gradient * u_c;
        let w_gradient = n * w_r + c_gradient * w_c;
        let flux = p * u + axis * w;
        let gradient =
            Matrix3::from_diagonal_element(u) + p * u_gradient.transpose() + axis * w_gradient.transpose();
        (flux, gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    fn vector(x: f64, y: f64, z: f64) -> Vector3<f64> {
        Vector3::new(x, y, z)
    }

    #[test]
    fn one_coil_in_its_own_frame_agrees_with_the_reference_vectors() {
        let description = fixture::bigmag();
        let air = Coil::new(&description.coils[4], 1.0);
        let (flux, gradient) = air.local(&vector(0.08, 0.02, -0.013));
        assert!((flux - vector(7.3184e-4, 1.7779e-4, -1.1557e-4)).norm() < 2e-8);
        let expected = Matrix3::new(
            -0.016425, -0.005208, 0.003386, -0.005208, 0.007938, 0.000619, 0.003386, 0.000619, 0.008487,
        );
        assert!((gradient - expected).amax() < 1e-6);
        let iron = Coil::new(&description.coils[0], 1.0);
        let (flux, gradient) = iron.local(&vector(0.05, 0.0, 0.0));
        assert!((flux - vector(1.144_543e-2, 0.0, 0.0)).norm() < 1e-8);
        let expected = Matrix3::from_diagonal(&vector(-0.386_194, 0.193_097, 0.193_097));
        assert!((gradient - expected).amax() < 1e-6);
    }

    /// Field of each coil of BigMag at 1 A, mT.
    fn columns(point: Vector3<f64>, bottom_deg: f64, top_deg: f64) -> Vec<Vector3<f64>> {
        let mut array = CoilArray::new(&fixture::bigmag(), &[]);
        (0..6)
            .map(|coil| {
                let mut currents = [0.0; 6];
                currents[coil] = 1.0;
                array.actuate(&currents, &[bottom_deg.to_radians(), top_deg.to_radians()]);
                array.at(&point).flux * 1e3
            })
            .collect()
    }

    #[test]
    fn every_coil_of_the_array_agrees_with_the_reference_table() {
        let x = [-2.105_592, 2.072_903, -2.189_702, 2.088_892, 0.0, 0.0];
        let z = [1.431_496, 1.357_503, -1.422_009, -1.363_811, 0.712_599, -0.712_599];
        for (coil, field) in columns(Vector3::zeros(), 0.0, 0.0).into_iter().enumerate() {
            assert!((field - vector(x[coil], 0.0, z[coil])).amax() < 2e-6, "coil {coil}: {field}");
        }
        let x = [-3.568_104, 1.547_67, -0.765_141, 1.220_814, 0.239_142, 0.101_491];
        let y = [-2.172_848, 0.863_916, 1.523_86, -0.689_881, 0.119_571, 0.050_745];
        let z = [2.852_145, 0.593_322, -1.546_604, -1.065_856, 0.924_062, -0.478_856];
        for (coil, field) in columns(vector(0.02, 0.01, -0.015), 30.0, -45.0).into_iter().enumerate() {
            assert!((field - vector(x[coil], y[coil], z[coil])).amax() < 2e-6, "coil {coil}: {field}");
        }
    }

    #[test]
    fn gradient_is_the_derivative_of_the_field_up_to_order_ten() {
        let mut description = fixture::bigmag();
        for coil in &mut description.coils {
            coil.coefficients = (0..10).map(|k| 1e-6 * 0.02_f64.powi(k) / f64::from(k + 1)).collect();
        }
        let mut array = CoilArray::new(&description, &[]);
        array.actuate(&[1.0, -2.0, 3.0, 0.5, -4.0, 2.5], &[0.3, -0.8]);
        let point = vector(0.012, -0.007, 0.015);
        let gradient = array.at(&point).gradient;
        let scale = gradient.amax();
        assert!(gradient.trace().abs() < 1e-12 * scale);
        assert!((gradient - gradient.transpose()).amax() < 1e-12 * scale);
        // Central differences at 1e-5 m: truncation near (1e-5 / 0.08)^2 of the value.
        let step = 1e-5;
        for axis in 0..3 {
            let offset = Vector3::ith(axis, step);
            let difference =
                (array.at(&(point + offset)).flux - array.at(&(point - offset)).flux) / (2.0 * step);
            assert!((difference - gradient.column(axis)).amax() < 1e-6 * scale);
        }
    }

    #[test]
    fn force_and_torque_are_derivatives_of_the_dipole_energy() {
        let mut array = CoilArray::new(&fixture::bigmag(), &[]);
        array.actuate(&[3.0, -2.0, 1.0, 4.0, -5.0, 2.0], &[0.2, -0.4]);
        let (point, moment) = (vector(0.01, 0.004, -0.006), vector(0.02, -0.05, 0.03));
        let wrench = array.at(&point).wrench(&moment);
        let energy = |point: Vector3<f64>, moment: Vector3<f64>| -moment.dot(&array.at(&point).flux);
        let step = 1e-5;
        for axis in 0..3 {
            let offset = Vector3::ith(axis, step);
            let force = -(energy(point + offset, moment) - energy(point - offset, moment)) / (2.0 * step);
            assert!((force - wrench.force[axis]).abs() < 1e-6 * wrench.force.norm());
            let turn = |sign: f64| Rotation3::new(offset * sign) * moment;
            let torque = -(energy(point, turn(1.0)) - energy(point, turn(-1.0))) / (2.0 * step);
            assert!((torque - wrench.torque[axis]).abs() < 1e-6 * wrench.torque.norm());
        }
    }

    #[test]
    fn a_point_inside_a_coil_is_reported() {
        let mut array = CoilArray::new(&fixture::bigmag(), &[]);
        array.actuate(&[0.0, 0.0, 0.0, 0.0, 1.0, 0.0], &[0.0, 0.0]);
        assert!(array.at(&Vector3::zeros()).valid);
        assert!(!array.at(&vector(0.0, 0.0, -0.05)).valid);
    }

    #[test]
    fn a_coil_gain_scales_the_field_of_that_coil_alone() {
        let description = fixture::bigmag();
        let mut exact = CoilArray::new(&description, &[]);
        let mut off = CoilArray::new(&description, &[1.02]);
        exact.actuate(&[1.0], &[]);
        off.actuate(&[1.0], &[]);
        let point = vector(0.01, 0.0, 0.0);
        assert!((off.at(&point).flux - exact.at(&point).flux * 1.02).norm() < 1e-15);
        exact.actuate(&[0.0, 1.0], &[]);
        off.actuate(&[0.0, 1.0], &[]);
        assert_eq!(off.at(&point), exact.at(&point));
    }
}
