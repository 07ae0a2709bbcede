//! The model's equilibria at every sample, and how they change with the parameters.
//!
//! | parameter | derivative of a pose X |
//! |---|---|
//! | gain of coil j, logarithm | `I_j dX/dI_j`, the pass's own column |
//! | modulus of a group | the sum over its sections of `dX/dln(stiffness)` |
//! | moment, clamp's position | the columns of [`ByConstants`] |
//! | clamp's rotation vector w, R = exp(w) R_0 | `dX/dphi J_l(w)`, phi the small turn in the world of the clamp as it is |
//!
//! `J_l(w) = 1 + (1 - cos a)/a^2 [w] + (a - sin a)/a^3 [w]^2`, a = |w|.

use magsteer_hal::HardwareDescription;
use nalgebra::{Matrix3, Vector3, Vector6};

use crate::magnetics::{ActuatedArray, CoilArray};
use crate::rod::{ByConstants, Constant, Manipulator, Pass, PassMode, RodConfig, TipLoad, Wrenches};

use super::error::IdentifyError;
use super::parameters::{Parameter, Parameters};
use super::sample::Sample;

const POSES: PassMode = PassMode { poses: true, wrenches: Wrenches::Following };

/// A magnet of the model at one sample.
#[derive(Debug, Clone)]
pub(super) struct ModelledMagnet {
    pub tangent: Vector3<f64>,
    pub position: Vector3<f64>,
    /// With each free parameter.
    pub tangent_by: Vec<Vector3<f64>>,
    pub position_by: Vec<Vector3<f64>>,
}

/// An equilibrium of the model.
#[derive(Debug, Clone)]
pub(super) struct Modelled {
    pub magnets: Vec<ModelledMagnet>,
    unknowns: Vector6<f64>,
}

/// The model with given parameters.
pub(super) struct Model<'a> {
    parameters: &'a Parameters,
    description: HardwareDescription,
    array: CoilArray,
    manipulator: Manipulator,
    /// J_l at the clamp's rotation vector.
    turning: Matrix3<f64>,
    pass: Pass,
    by: ByConstants,
}

impl<'a> Model<'a> {
    /// The model of the rig with these values on the mesh of `rod`.
    ///
    /// # Errors
    /// Tables that cannot be built.
    pub fn new(parameters: &'a Parameters, rod: &RodConfig, values: &[f64]) -> Result<Self, IdentifyError> {
        let words = |refused: Vec<magsteer_hal::invalid::Invalid>| {
            let all: Vec<String> = refused.iter().map(ToString::to_string).collect();
            IdentifyError::Tables(all.join("; "))
        };
        let description = parameters.applied(values).build().map_err(words)?;
        let manipulator = rod.build(&description).map_err(words)?;
        Ok(Self {
            parameters,
            array: CoilArray::new(&description),
            turning: turning(&parameters.base_rotation(values)),
            pass: Pass::new(&manipulator),
            by: ByConstants::new(&manipulator),
            manipulator,
            description,
        })
    }

    /// The stable equilibrium at a sample, near an earlier one where there is one, else the one that is
    /// reached from rest; `None` when there is none.
    pub fn at(&mut self, sample: &Sample, near: Option<&Modelled>) -> Option<Modelled> {
        let coils = self.description.coils.len();
        let posed = self.array.posed(&sample.actuation.angle_rad[..self.description.frames.len()]);
        let field = posed.actuated(&sample.actuation.current_a[..coils]);
        if !self.solve(&field, near) || !self.manipulator.differentiate(&field, &mut self.pass, &mut self.by)
        {
            return None;
        }
        let magnets = (0..self.pass.magnets().len()).map(|magnet| self.magnet(magnet, sample)).collect();
        Some(Modelled { magnets, unknowns: self.pass.unknowns() })
    }

    fn solve(&mut self, field: &ActuatedArray<'_>, near: Option<&Modelled>) -> bool {
        let (manipulator, pass) = (&self.manipulator, &mut self.pass);
        if let Some(near) = near {
            let solution = manipulator.solve(field, &TipLoad::NONE, &near.unknowns, POSES, pass);
            if solution.converged() && pass.determinant() > 0.0 {
                return true;
            }
        }
        let solution = manipulator.solve_from_rest(field, &TipLoad::NONE, POSES, pass);
        solution.converged() && !solution.lost_stability
    }

    fn magnet(&self, magnet: usize, sample: &Sample) -> ModelledMagnet {
        let found = &self.pass.magnets()[magnet];
        let tangents = self.pass.tangent_jacobian(magnet);
        let positions = self.pass.position_jacobian(magnet).unwrap_or(tangents);
        let by_current = |rows: [&[f64]; 3], coil: usize| {
            Vector3::from(rows.map(|row| row[coil])) * sample.actuation.current_a[coil]
        };
        let column = |constants: &[Vector3<f64>], rows: [&[f64]; 3], parameter: Parameter| match parameter {
            Parameter::Gain { coil } => by_current(rows, coil),
            Parameter::Modulus { group } => {
                let sections = self.parameters.sections(group).iter();
                sections.map(|section| self.constant(constants, Constant::Stiffness(*section))).sum()
            }
            Parameter::Moment { magnet } => self.constant(constants, Constant::Moment(magnet)),
            Parameter::BasePosition { axis } => self.constant(constants, Constant::BasePosition(axis)),
            Parameter::BaseRotation { axis } => (0..3)
                .map(|world| {
                    self.constant(constants, Constant::BaseRotation(world)) * self.turning[(world, axis)]
                })
                .sum(),
        };
        let free = || self.parameters.free().iter();
        ModelledMagnet {
            tangent: found.tangent(),
            position: found.position(),
            tangent_by: free().map(|of| column(self.by.tangent(magnet), tangents, *of)).collect(),
            position_by: free().map(|of| column(self.by.position(magnet), positions, *of)).collect(),
        }
    }

    fn constant(&self, derivatives: &[Vector3<f64>], constant: Constant) -> Vector3<f64> {
        let found = self.by.constants().iter().position(|known| *known == constant);
        found.map_or_else(Vector3::zeros, |index| derivatives[index])
    }
}

/// The left Jacobian of the rotation vector.
fn turning(vector: &Vector3<f64>) -> Matrix3<f64> {
    let angle = vector.norm();
    let cross = vector.cross_matrix();
    // Series below 1e-3 rad: truncation under 1e-14.
    let (first, second) = if angle < 1e-3 {
        let square = angle * angle;
        (0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0)
    } else {
        ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3))
    };
    Matrix3::identity() + cross * first + cross * cross * second
}
