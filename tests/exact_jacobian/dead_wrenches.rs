//! A Kirchhoff rod under dead wrenches, integrated on its own: an oracle for the paper's Algorithm 1.
//!
//! Shares no code with the product: rotation matrices integrated entry by entry, and the boundary condition solved by
//! Newton with differenced derivatives.
//! ```text
//! p' = t,  R' = R [K^-1 R^T m]x,  n' = -rho A g,  m' = -t x n
//! across a magnet: c = p + (l/2) t,  n+ = n - F - M g,  m+ = m - T - (l/2) t x (n + n+)
//! n(L) = 0,  m(L) = 0
//! ```

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::PartDescription;
use nalgebra::{DVector, Matrix3, Matrix6, Vector3, Vector6};

/// Force (N) and torque (N m) at a magnet's centre, constant in the world.
#[derive(Debug, Clone, Copy)]
pub struct DeadWrench {
    pub force: Vector3<f64>,
    pub torque: Vector3<f64>,
}

/// The rod of a description, straight inextensible sections only.
pub struct Oracle<'a> {
    description: &'a HardwareDescription,
    step_max: f64,
}

#[derive(Clone, Copy)]
struct State {
    rotation: Matrix3<f64>,
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

impl State {
    fn plus(&self, rate: &Self, step: f64) -> Self {
        Self {
            rotation: self.rotation + rate.rotation * step,
            force: self.force + rate.force * step,
            moment: self.moment + rate.moment * step,
        }
    }
}

impl<'a> Oracle<'a> {
    pub fn new(description: &'a HardwareDescription, step_max: f64) -> Self {
        Self { description, step_max }
    }

    /// Tangents of all magnets in equilibrium under the wrenches, one below the other. `guess` is the force and moment at
    /// the clamp from which the search begins.
    pub fn tangents(&mut self, wrenches: &[DeadWrench], guess: &Vector6<f64>) -> DVector<f64> {
        let mut unknowns = *guess;
        // Units of force and moment in which the six unknowns are alike: 1 mN, 0.1 mN m.
        let unit = |index: usize| if index < 3 { 1e-3 } else { 1e-4 };
        let jacobian = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|index| {
            let beside = Vector6::ith(index, unit(index) * 1e-4);
            let change =
                self.shoot(wrenches, &(unknowns + beside)).0 - self.shoot(wrenches, &(unknowns - beside)).0;
            change / (2.0 * beside[index])
        }));
        let inverse = jacobian.try_inverse().expect("not at a buckling load");
        // With one Jacobian for all steps the error shrinks some thousandfold in each.
        for _ in 0..12 {
            unknowns -= inverse * self.shoot(wrenches, &unknowns).0;
        }
        let (residual, tangents) = self.shoot(wrenches, &unknowns);
        assert!(residual.fixed_rows::<3>(0).norm() < 1e-12 && residual.fixed_rows::<3>(3).norm() < 1e-13);
        tangents
    }

    /// Force and moment left at the tip, and the magnets' tangents.
    fn shoot(&self, wrenches: &[DeadWrench], unknowns: &Vector6<f64>) -> (Vector6<f64>, DVector<f64>) {
        let [first, second, third] = self.description.manipulator.base_rotation;
        let gravity = Vector3::from(self.description.gravity);
        let mut state = State {
            rotation: Matrix3::from_rows(&[first.into(), second.into(), third.into()]),
            force: unknowns.fixed_rows::<3>(0).into(),
            moment: unknowns.fixed_rows::<3>(3).into(),
        };
        let mut tangents = Vec::new();
        let mut wrenches = wrenches.iter();
        for part in &self.description.manipulator.parts {
            match part {
                PartDescription::Section(section) => {
                    assert!(section.extensible.is_none() && section.precurvature == [0.0; 3]);
                    let bending = 1.0 / section.bending_stiffness;
                    let compliance = Vector3::new(bending, bending, 1.0 / section.torsion_stiffness);
                    let weight = gravity * section.mass_per_length;
                    let steps = (section.length / self.step_max).ceil();
                    let step = section.length / steps;
                    for _ in 0..steps as usize {
                        state = runge_kutta(&state, step, &compliance, &weight);
                    }
                }
                PartDescription::Magnet(magnet) => {
                    let wrench = wrenches.next().expect("one a magnet");
                    let tangent: Vector3<f64> = state.rotation.column(2).into();
                    let after = state.force - wrench.force - gravity * magnet.mass;
                    let couple = tangent.cross(&(state.force + after)) * (0.5 * magnet.length);
                    state.moment -= wrench.torque + couple;
                    state.force = after;
                    tangents.extend(tangent.iter());
                }
            }
        }
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&state.force);
        residual.fixed_rows_mut::<3>(3).copy_from(&state.moment);
        (residual, DVector::from_vec(tangents))
    }
}

fn rate(state: &State, compliance: &Vector3<f64>, weight: &Vector3<f64>) -> State {
    let strain = compliance.component_mul(&(state.rotation.transpose() * state.moment));
    let tangent: Vector3<f64> = state.rotation.column(2).into();
    State {
        rotation: state.rotation * strain.cross_matrix(),
        force: -weight,
        moment: -tangent.cross(&state.force),
    }
}

/// The classical step of fourth order.
fn runge_kutta(state: &State, step: f64, compliance: &Vector3<f64>, weight: &Vector3<f64>) -> State {
    let first = rate(state, compliance, weight);
    let second = rate(&state.plus(&first, 0.5 * step), compliance, weight);
    let third = rate(&state.plus(&second, 0.5 * step), compliance, weight);
    let fourth = rate(&state.plus(&third, step), compliance, weight);
    let mut next = *state;
    for (rate, share) in [(first, 1.0), (second, 2.0), (third, 2.0), (fourth, 1.0)] {
        next = next.plus(&rate, step * share / 6.0);
    }
    next
}
