//! The present shape with its frozen wrenches, and one problem beside it.
//!
//! | symbol | meaning |
//! |---|---|
//! | `I`, `theta` | currents, A; frame angles, rad |
//! | `p`, `q`, `mu` | position and rotation of a magnet, its moment in the world |
//! | `T` | current-to-wrench map, eq. (13), torque above force |
//! | `w`, `dw = (dtau, df)` | wrenches of the present shape; their change by a step |
//! | `xi` | base unknowns: force, then moment |
//! | `p_0` | the clamp |

use magsteer_hal::{Actuation, HardwareDescription, MAGNETS_MAX};
use nalgebra::{DMatrixView, Matrix3, Vector3, Vector6};

use crate::magnetics::{ActuationMatrix, CoilArray, Dipole, PosedArray, Wrench};
use crate::rod::{HeldOptions, HeldShape, HeldSolution, Manipulator};

/// Pose of a magnet, world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldPose {
    /// Centre, m.
    pub position: Vector3<f64>,
    /// Rotation from body to world.
    pub rotation: Matrix3<f64>,
}

impl Default for HeldPose {
    fn default() -> Self {
        Self { position: Vector3::zeros(), rotation: Matrix3::identity() }
    }
}

/// What Algorithm 1 begins from.
#[derive(Debug, Clone, Copy)]
pub struct Present {
    /// Present currents and angles.
    pub actuation: Actuation,
    /// Base unknowns of the present shape, or a guess: force (N), then moment (N m).
    pub unknowns: Vector6<f64>,
    /// Poses at which the wrenches are frozen; entries past the last magnet are not read.
    pub poses: [HeldPose; MAGNETS_MAX],
}

/// Constants that all problems share.
#[derive(Debug)]
pub(super) struct Rules {
    pub manipulator: Manipulator,
    pub array: CoilArray,
    pub coils: usize,
    pub frames: usize,
    /// `p_0`, m.
    pub clamp: Vector3<f64>,
    /// Dipole moments in body axes, A m^2.
    pub moments_body: Vec<Vector3<f64>>,
    /// `dI`, A.
    pub current_step: f64,
    /// `dtheta`, rad.
    pub angle_step: f64,
    pub informed_guess: bool,
    pub held: HeldOptions,
}

impl Rules {
    pub fn parameters(&self) -> usize {
        self.coils + self.frames
    }

    /// Step of a parameter, A or rad.
    pub fn step(&self, parameter: usize) -> f64 {
        if parameter < self.coils { self.current_step } else { self.angle_step }
    }

    /// Storage for a current-to-wrench map.
    fn matrix(&self) -> ActuationMatrix {
        ActuationMatrix::new(self.moments_body.len(), &self.array.posed(&[]).actuated(&[]))
    }

    pub fn wrenches(&self) -> Vec<Wrench> {
        vec![Wrench { torque: Vector3::zeros(), force: Vector3::zeros() }; self.moments_body.len()]
    }
}

/// Moments of the magnets of a description, A m^2, body axes.
pub(super) fn moments_body(description: &HardwareDescription) -> Vec<Vector3<f64>> {
    description.magnets().map(|magnet| Vector3::from(magnet.moment_body)).collect()
}

/// The present shape, the wrenches that are frozen in it, and their map.
#[derive(Debug)]
pub(super) struct Base {
    pub actuation: Actuation,
    /// `p` and `mu` of every magnet.
    pub dipoles: Vec<Dipole>,
    pub wrenches: Vec<Wrench>,
    pub shape: HeldShape,
    /// `T` at the present angles.
    matrix: ActuationMatrix,
    posed: PosedArray,
}

impl Base {
    pub fn new(rules: &Rules) -> Self {
        Self {
            actuation: Actuation::default(),
            dipoles: vec![
                Dipole { position: Vector3::zeros(), moment: Vector3::zeros() };
                rules.moments_body.len()
            ],
            wrenches: rules.wrenches(),
            shape: HeldShape::default(),
            matrix: rules.matrix(),
            posed: rules.array.posed(&[]),
        }
    }

    /// Freezes the wrenches and solves for the present shape under them.
    pub fn freeze(&mut self, rules: &Rules, present: &Present) -> HeldSolution {
        self.actuation = present.actuation;
        for ((dipole, pose), moment) in self.dipoles.iter_mut().zip(&present.poses).zip(&rules.moments_body) {
            *dipole = Dipole { position: pose.position, moment: pose.rotation * moment };
        }
        rules.array.pose_into(&self.actuation.angle_rad[..rules.frames], &mut self.posed);
        let currents = &self.actuation.current_a[..rules.coils];
        self.matrix.update(&self.posed.actuated(currents), &self.dipoles);
        apply(self.matrix.currents(), currents, &mut self.wrenches); // (13)
        rules.manipulator.solve_held(&self.wrenches, &present.unknowns, &rules.held, &mut self.shape)
    }

    /// Base unknowns to be expected under other wrenches on the same shape.
    fn informed_guess(&self, clamp: &Vector3<f64>, wrenches: &[Wrench]) -> Vector6<f64> {
        let mut guess = self.shape.unknowns;
        for ((wrench, present), dipole) in wrenches.iter().zip(&self.wrenches).zip(&self.dipoles) {
            let df = wrench.force - present.force;
            let dtau = wrench.torque - present.torque;
            let moment = dtau + (dipole.position - clamp).cross(&df);
            guess += Vector6::new(df.x, df.y, df.z, moment.x, moment.y, moment.z); // (14)
        }
        guess
    }
}

/// One problem: the statics with one parameter stepped.
#[derive(Debug)]
pub(super) struct Problem {
    pub parameter: usize,
    pub shape: HeldShape,
    pub solution: Option<HeldSolution>,
    wrenches: Vec<Wrench>,
    /// `T` at a stepped angle.
    matrix: ActuationMatrix,
    posed: PosedArray,
}

impl Problem {
    pub fn new(rules: &Rules) -> Self {
        Self {
            parameter: 0,
            shape: HeldShape::default(),
            solution: None,
            wrenches: rules.wrenches(),
            matrix: rules.matrix(),
            posed: rules.array.posed(&[]),
        }
    }

    /// Lines 4 to 9 and 15 to 18 for [`Self::parameter`].
    pub fn solve(&mut self, rules: &Rules, base: &Base) {
        let mut stepped = base.actuation;
        let map = match self.parameter.checked_sub(rules.coils) {
            None => {
                stepped.current_a[self.parameter] += rules.current_step; // line 4
                base.matrix.currents()
            }
            Some(frame) => {
                stepped.angle_rad[frame] += rules.angle_step; // line 15
                rules.array.pose_into(&stepped.angle_rad[..rules.frames], &mut self.posed);
                let field = self.posed.actuated(&stepped.current_a[..rules.coils]);
                self.matrix.update(&field, &base.dipoles); // line 16
                self.matrix.currents()
            }
        };
        apply(map, &stepped.current_a[..rules.coils], &mut self.wrenches); // lines 5, 17
        let guess = if rules.informed_guess {
            base.informed_guess(&rules.clamp, &self.wrenches)
        } else {
            base.shape.unknowns
        };
        let solution = rules.manipulator.solve_held(&self.wrenches, &guess, &rules.held, &mut self.shape);
        self.solution = Some(solution);
    }
}

/// `w = T I`, (13).
fn apply(map: DMatrixView<'_, f64>, currents: &[f64], wrenches: &mut [Wrench]) {
    for (magnet, wrench) in wrenches.iter_mut().enumerate() {
        let row = |axis: usize| {
            let row = 6 * magnet + axis;
            currents.iter().enumerate().map(|(coil, current)| map[(row, coil)] * current).sum::<f64>()
        };
        *wrench = Wrench {
            torque: Vector3::new(row(0), row(1), row(2)),
            force: Vector3::new(row(3), row(4), row(5)),
        };
    }
}
