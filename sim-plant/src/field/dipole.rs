//! Field of a point dipole, and what two dipoles do to each other.
//!
//! A magnet that is small beside the distance acts as a dipole. For a cylinder of length `L` and radius `a`,
//! magnetised along its axis, the next term is `(L^2 - 3 a^2) / (2 r^2)` of the field on the axis: 0.7 % for
//! the shipped magnets (5 mm long, 4 mm thick) 30 mm apart.
//!
//! | symbol | meaning |
//! |---|---|
//! | `m` | moment, A m^2, world |
//! | `r`, `n` | distance from the dipole to the point, its direction |
//! | `c` | `mu0 / (4 pi)` |
//! | `B`, `G` | flux density, T, and its gradient `dB_i/dx_j`, T/m |
//!
//! `B = c r^-3 [3 (m.n) n - m]`                                                          (F12)
//!
//! `G = 3 c r^-4 [m n^T + n m^T + (m.n)(1 - 5 n n^T)]`                                    (F13)
//!
//! Wrench of the first on the second, about the second's centre: `f = G m_2`, `t = m_2 x B`       (F14)
//!
//! Source: Jackson, Classical Electrodynamics, 3rd ed., eqs. (5.56), (5.69), (5.71).

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::sample::{Field, MU0, Wrench};

/// `c` of the module's head, T m / A.
const MU0_OVER_4_PI: f64 = MU0 / (4.0 * PI);

/// A point dipole in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dipole {
    /// m, world.
    pub position: Vector3<f64>,
    /// A m^2, world.
    pub moment: Vector3<f64>,
}

impl Dipole {
    /// Field at a point (m, world). At the dipole itself, where there is none, it is zero and not valid.
    #[must_use]
    pub fn field_at(&self, point: &Vector3<f64>) -> Field {
        let offset = point - self.position;
        let distance_squared = offset.norm_squared();
        if distance_squared == 0.0 {
            return Field { valid: false, ..Field::zero() };
        }
        let reciprocal = 1.0 / distance_squared.sqrt();
        let n = offset * reciprocal;
        let m = &self.moment;
        let along = m.dot(&n);
        let scale = MU0_OVER_4_PI * reciprocal.powi(3);
        let outer = m * n.transpose();
        let isotropic = Matrix3::from_diagonal_element(along);
        Field {
            flux: (n * (3.0 * along) - m) * scale, // (F12)
            gradient: (outer + outer.transpose() + isotropic - n * n.transpose() * (5.0 * along))
                * (3.0 * scale * reciprocal), // (F13)
            valid: true,
        }
    }

    /// Wrench of this dipole on another, about the other's position.
    #[must_use]
    pub fn wrench_on(&self, other: &Self) -> Wrench {
        self.field_at(&other.position).wrench(&other.moment) // (F14)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> [Dipole; 2] {
        [
            Dipole { position: Vector3::new(0.01, -0.02, 0.005), moment: Vector3::new(0.02, 0.05, -0.03) },
            Dipole { position: Vector3::new(0.035, -0.01, 0.02), moment: Vector3::new(-0.04, 0.01, 0.06) },
        ]
    }

    #[test]
    fn gradient_is_symmetric_traceless_and_the_derivative_of_the_field() {
        let [dipole, other] = pair();
        let gradient = dipole.field_at(&other.position).gradient;
        let scale = gradient.amax();
        assert!(gradient.trace().abs() < 1e-14 * scale);
        assert!((gradient - gradient.transpose()).amax() < 1e-14 * scale);
        // Central differences at 1e-6 m: truncation near (1e-6 / 0.03)^2 of the value, rounding below 1e-10.
        let step = 1e-6;
        for axis in 0..3 {
            let flux = |sign: f64| dipole.field_at(&(other.position + Vector3::ith(axis, sign * step))).flux;
            let difference = (flux(1.0) - flux(-1.0)) / (2.0 * step);
            assert!((difference - gradient.column(axis)).amax() < 3e-8 * scale);
        }
    }

    #[test]
    fn two_dipoles_push_each_other_with_opposite_forces_and_conserve_angular_momentum() {
        let [first, second] = pair();
        let (on_second, on_first) = (first.wrench_on(&second), second.wrench_on(&first));
        let scale = on_second.force.norm();
        assert!((on_second.force + on_first.force).norm() < 1e-14 * scale);
        let arm = second.position - first.position;
        let total = on_second.torque + on_first.torque + arm.cross(&on_second.force);
        assert!(total.norm() < 1e-13 * on_second.torque.norm());
    }

    #[test]
    fn two_magnets_in_line_attract_with_the_textbook_force() {
        let at = |x: f64| Dipole { position: Vector3::x() * x, moment: Vector3::x() * 0.065 };
        let force = at(0.0).wrench_on(&at(0.03)).force;
        // 6 c m^2 / r^4
        let expected = -6.0 * 1e-7 * 0.065 * 0.065 / 0.03_f64.powi(4);
        assert!((force.x / expected - 1.0).abs() < 1e-14 && force.yz().norm() == 0.0);
    }

    #[test]
    fn the_dipole_itself_is_no_point_of_its_field() {
        let [dipole, _] = pair();
        let field = dipole.field_at(&dipole.position);
        assert!(!field.valid && field.flux == Vector3::zeros() && field.gradient == Matrix3::zeros());
    }
}
