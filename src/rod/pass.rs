//! What one shooting pass yields, and the storage that it works in.

use nalgebra::{Matrix3, Vector3, Vector6};

use crate::magnetics::{FieldGradient, FieldSample, FieldSecondGradient, PARAMETERS_MAX};
use crate::math::{Lu, Pair, Triple};

use super::magnet::Wrenches;
use super::manipulator::{Manipulator, Part};
use super::stability::Chain;
use super::state::{Frame, State};
use super::transition::{Columns, PAIRS_CLAMPED, Rows};

/// Pairs of parameter columns that travel together.
pub(super) const PAIRS_BLOCK: usize = 4;
/// Blocks of parameter columns.
pub(super) const BLOCKS_MAX: usize = PARAMETERS_MAX.div_ceil(2 * PAIRS_BLOCK);

/// What a pass is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PassMode {
    /// True to yield Jacobians of rotations and positions beside those of tangents. Costs about half as much again.
    pub poses: bool,
    /// How wrenches enter the sensitivities.
    pub wrenches: Wrenches,
}

/// Dead loads at the tip, world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipLoad {
    /// Force, N.
    pub force: Vector3<f64>,
    /// Moment, N m.
    pub moment: Vector3<f64>,
}

impl TipLoad {
    /// A free tip.
    pub const NONE: Self = Self { force: Vector3::new(0.0, 0.0, 0.0), moment: Vector3::new(0.0, 0.0, 0.0) };
}

impl Default for TipLoad {
    fn default() -> Self {
        Self::NONE
    }
}

/// Rows x, y, z of a Jacobian, one column a parameter.
pub(super) type JacobianRows = [[f64; PARAMETERS_MAX]; 3];

/// One magnet at the end of a pass. SI, world.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnetPass {
    pub(super) center: Triple,
    pub(super) frame: Frame,
    pub(super) field: Vector3<f64>,
    pub(super) gradient: FieldGradient,
    pub(super) second_gradient: FieldSecondGradient,
    pub(super) force: Triple,
    pub(super) weight: Triple,
    pub(super) torque: Triple,
    pub(super) field_valid: bool,
    /// Variation of centre and rotation with the base unknowns and with the parameters.
    pub(super) center_by_base: Rows<PAIRS_CLAMPED>,
    pub(super) rotation_by_base: Rows<PAIRS_CLAMPED>,
    pub(super) center_by_parameters: [Rows<PAIRS_BLOCK>; BLOCKS_MAX],
    pub(super) rotation_by_parameters: [Rows<PAIRS_BLOCK>; BLOCKS_MAX],
    pub(super) tangent_rows: JacobianRows,
    pub(super) rotation_rows: JacobianRows,
    pub(super) position_rows: JacobianRows,
}

impl MagnetPass {
    fn new(frame: Frame) -> Self {
        let none = [[Pair::default(); PAIRS_CLAMPED]; 3];
        let block = [[Pair::default(); PAIRS_BLOCK]; 3];
        let zero = [[0.0; PARAMETERS_MAX]; 3];
        Self {
            center: Triple::default(),
            frame,
            field: Vector3::zeros(),
            gradient: FieldGradient::default(),
            second_gradient: FieldSecondGradient::default(),
            force: Triple::default(),
            weight: Triple::default(),
            torque: Triple::default(),
            field_valid: true,
            center_by_base: none,
            rotation_by_base: none,
            center_by_parameters: [block; BLOCKS_MAX],
            rotation_by_parameters: [block; BLOCKS_MAX],
            tangent_rows: zero,
            rotation_rows: zero,
            position_rows: zero,
        }
    }

    /// Centre, m.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.center.into()
    }

    /// Rotation from body to world; the third column is the tangent.
    #[must_use]
    pub fn rotation(&self) -> Matrix3<f64> {
        self.frame.rotation()
    }

    /// Tangent, unit.
    #[must_use]
    pub fn tangent(&self) -> Vector3<f64> {
        self.frame.tangent.into()
    }

    /// Applied field at the centre, T.
    #[must_use]
    pub fn field(&self) -> Vector3<f64> {
        self.field
    }

    /// Magnetic force, without weight, N.
    #[must_use]
    pub fn force(&self) -> Vector3<f64> {
        self.force.into()
    }

    /// Weight, N.
    #[must_use]
    pub fn weight(&self) -> Vector3<f64> {
        self.weight.into()
    }

    /// Magnetic torque, N m.
    #[must_use]
    pub fn torque(&self) -> Vector3<f64> {
        self.torque.into()
    }

    /// False when the magnet lies outside the field model's range.
    #[must_use]
    pub fn field_is_valid(&self) -> bool {
        self.field_valid
    }
}

/// Storage and results of shooting passes. Allocated once; every pass overwrites it.
#[derive(Debug, Clone)]
pub struct Pass {
    pub(super) unknowns: Vector6<f64>,
    pub(super) parameters: usize,
    pub(super) residual: [f64; 6],
    pub(super) newton_step: Option<Vector6<f64>>,
    /// Factors of dr/dxi in units of the residual.
    pub(super) jacobian: Option<Lu<6>>,
    pub(super) determinant: f64,
    pub(super) poses: bool,
    pub(super) magnets: Vec<MagnetPass>,
    /// d(unknowns)/d(parameters) by rows.
    pub(super) unknowns_rows: [[f64; PARAMETERS_MAX]; 6],
    /// State where each part begins, then at the tip.
    pub(super) states: Vec<State>,
    pub(super) gravity: Triple,
    pub(super) sample: FieldSample,
    pub(super) base: Columns<PAIRS_CLAMPED>,
    pub(super) actuation: [Columns<PAIRS_BLOCK>; BLOCKS_MAX],
    /// Orientation of every part's end at the last accepted step of a continuation.
    pub(super) accepted: Vec<Frame>,
    /// The second variation.
    pub(super) chain: Chain,
}

impl Pass {
    /// Storage for passes over `manipulator`.
    #[must_use]
    pub fn new(manipulator: &Manipulator) -> Self {
        let state = State {
            position: manipulator.base_position,
            frame: manipulator.base_frame,
            force: Triple::default(),
            moment: Triple::default(),
        };
        let magnets = manipulator.parts.iter().filter(|part| matches!(part, Part::Magnet(_)));
        let cuts = manipulator.parts.len() + 1;
        Self {
            unknowns: Vector6::zeros(),
            parameters: 0,
            residual: [f64::NAN; 6],
            newton_step: None,
            jacobian: None,
            determinant: f64::NAN,
            poses: false,
            unknowns_rows: [[0.0; PARAMETERS_MAX]; 6],
            magnets: magnets.map(|_| MagnetPass::new(state.frame)).collect(),
            states: vec![state; cuts],
            gravity: manipulator.gravity,
            sample: FieldSample::default(),
            base: Columns::default(),
            actuation: core::array::from_fn(|_| Columns::default()),
            accepted: vec![state.frame; cuts],
            chain: Chain::new(&manipulator.parts),
        }
    }

    /// The base unknowns that the pass ran with: internal force (N), then moment (N m) at the clamp, world.
    /// In equilibrium they are the sum of all loads.
    #[must_use]
    pub fn unknowns(&self) -> Vector6<f64> {
        self.unknowns
    }

    /// The force transmitted at the clamp, the sum of all loads in equilibrium, N.
    #[must_use]
    pub fn base_force(&self) -> Vector3<f64> {
        self.unknowns.fixed_rows::<3>(0).into()
    }

    /// The moment transmitted at the clamp, the moment of all loads about it in equilibrium, N m.
    #[must_use]
    pub fn base_moment(&self) -> Vector3<f64> {
        self.unknowns.fixed_rows::<3>(3).into()
    }

    /// Norm of the residual, forces in units of EI/L^2 and moments of EI/L ([`Manipulator::residual_units`]).
    #[must_use]
    pub fn residual(&self) -> f64 {
        self.residual.iter().map(|entry| entry * entry).sum::<f64>().sqrt()
    }

    /// What to add to the unknowns to come closer to equilibrium; `None` when the Jacobian of the residual is singular.
    #[must_use]
    pub fn newton_step(&self) -> Option<Vector6<f64>> {
        self.newton_step
    }

    /// How the base unknowns of the equilibrium change with one parameter: force (N), then moment (N m), per ampere or radian.
    /// Meaningful when the pass had a Newton step.
    #[must_use]
    pub fn unknowns_derivative(&self, parameter: usize) -> Vector6<f64> {
        Vector6::from_fn(|row, _| self.unknowns_rows[row][parameter])
    }

    /// Determinant of d(residual)/d(unknowns): 1 for the unloaded rod, 0 where an equilibrium loses its stability (buckling,
    /// snap-through). It is the product of all eigenvalues of which [`Manipulator::stability`] finds the lowest, so that deformations that
    /// loads stiffen raise it and an even number of unstable ones leaves its sign. Zero as well when the matrix is singular to
    /// working precision.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        self.determinant
    }

    /// Number of actuation parameters of the pass.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.parameters
    }

    /// The magnets from base to tip.
    #[must_use]
    pub fn magnets(&self) -> &[MagnetPass] {
        &self.magnets
    }

    /// False when some magnet lies outside the field model's range.
    #[must_use]
    pub fn field_valid(&self) -> bool {
        self.magnets.iter().all(|magnet| magnet.field_valid)
    }

    /// Tip position, m.
    #[must_use]
    pub fn tip_position(&self) -> Vector3<f64> {
        self.tip().position.into()
    }

    /// Tip tangent, unit.
    #[must_use]
    pub fn tip_tangent(&self) -> Vector3<f64> {
        self.tip().frame.tangent.into()
    }

    /// Rotation of the tip from body to world.
    #[must_use]
    pub fn tip_rotation(&self) -> Matrix3<f64> {
        self.tip().frame.rotation()
    }

    /// Derivatives of a magnet's tangent with every parameter: rows x, y, z; per ampere or radian.
    /// Meaningful when the pass had a Newton step.
    #[must_use]
    pub fn tangent_jacobian(&self, magnet: usize) -> [&[f64]; 3] {
        self.magnets[magnet].tangent_rows.each_ref().map(|row| &row[..self.parameters])
    }

    /// Derivatives of a magnet's rotation vector (world), rad per ampere or radian; `None` unless the
    /// pass was asked for poses.
    #[must_use]
    pub fn rotation_jacobian(&self, magnet: usize) -> Option<[&[f64]; 3]> {
        let rows = self.magnets[magnet].rotation_rows.each_ref().map(|row| &row[..self.parameters]);
        self.poses.then_some(rows)
    }

    /// Derivatives of a magnet's centre, m per ampere or radian; `None` unless the pass was asked for poses.
    #[must_use]
    pub fn position_jacobian(&self, magnet: usize) -> Option<[&[f64]; 3]> {
        let rows = self.magnets[magnet].position_rows.each_ref().map(|row| &row[..self.parameters]);
        self.poses.then_some(rows)
    }

    pub(super) fn tip(&self) -> &State {
        // One state more than parts: never empty.
        &self.states[self.states.len() - 1]
    }
}
