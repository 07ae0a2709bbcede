//! Equilibria of a shipped manipulator, with both Jacobians of the tangents by the currents.

use std::path::Path;

use magsteer::config::Config;
use magsteer::control::ControlConfig;
use magsteer::magnetics::{ActuatedArray, CoilArray};
use magsteer::rod::{Manipulator, Pass, PassMode, TipLoad, Wrenches};
use magsteer_hal::{Actuation, HardwareDescription};
use nalgebra::{DMatrix, Vector2, Vector3};

pub struct Rig {
    pub description: HardwareDescription,
    pub manipulator: Manipulator,
    /// That of the file, or of the one that it extends.
    pub control: ControlConfig,
    array: CoilArray,
}

/// An equilibrium.
pub struct State {
    pub actuation: Actuation,
    pub pass: Pass,
}

/// Rows of tangents x, y, z or of angles, a magnet after the other; a column a current.
pub struct Jacobians {
    pub exact: DMatrix<f64>,
    pub frozen: DMatrix<f64>,
}

impl Jacobians {
    /// Rows of the angles from z in the x-z plane, one a magnet.
    pub fn planar(&self, pass: &Pass) -> Self {
        let rows = |jacobian: &DMatrix<f64>| {
            DMatrix::from_fn(pass.magnets().len(), jacobian.ncols(), |magnet, column| {
                let turn = jacobian.fixed_view::<3, 1>(3 * magnet, column);
                across(&pass.magnets()[magnet].tangent()).dot(&turn)
            })
        };
        Self { exact: rows(&self.exact), frozen: rows(&self.frozen) }
    }
}

impl Jacobians {
    /// Rows of the turns about two axes across each magnet's tangent.
    pub fn spatial(&self, pass: &Pass) -> Self {
        let rows = |jacobian: &DMatrix<f64>| {
            DMatrix::from_fn(2 * pass.magnets().len(), jacobian.ncols(), |row, column| {
                let turn = jacobian.fixed_view::<3, 1>(3 * (row / 2), column);
                pass.magnets()[row / 2].rotation().column(row % 2).dot(&turn)
            })
        };
        Self { exact: rows(&self.exact), frozen: rows(&self.frozen) }
    }
}

/// Derivative of a planar tangent with its angle from z.
fn across(tangent: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(tangent.z, 0.0, -tangent.x)
}

/// Angles of both magnets from z in the x-z plane, deg.
pub fn planar_angles_deg(pass: &Pass) -> [f64; 2] {
    [0, 1].map(|magnet| {
        let tangent = pass.magnets()[magnet].tangent();
        tangent.x.atan2(tangent.z).to_degrees()
    })
}

impl Rig {
    pub fn load(file: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(file);
        let (_, config) = Config::load(&path).expect("shipped");
        let array = CoilArray::new(&config.description);
        Self {
            manipulator: config.manipulator.expect("has a model"),
            control: config.control.expect("has a controller"),
            description: config.description,
            array,
        }
    }

    fn with_field<T>(&self, actuation: &Actuation, work: impl FnOnce(&ActuatedArray<'_>) -> T) -> T {
        let posed = self.array.posed(&actuation.angle_rad[..self.array.frame_count()]);
        work(&posed.actuated(&actuation.current_a[..self.array.coil_count()]))
    }

    /// The stable equilibrium that the rod comes to from rest, within the field model's range.
    pub fn led_from_rest(&self, currents: &[f64], angles: &[f64]) -> Option<State> {
        let mut actuation = Actuation::default();
        actuation.current_a[..currents.len()].copy_from_slice(currents);
        actuation.angle_rad[..angles.len()].copy_from_slice(angles);
        let mut pass = Pass::new(&self.manipulator);
        let solution = self.with_field(&actuation, |field| {
            self.manipulator.solve_from_rest(field, &TipLoad::NONE, PassMode::default(), &mut pass)
        });
        let found = solution.converged() && !solution.lost_stability && pass.field_valid();
        // Nearer to a snap-through every Jacobian is without bound.
        (found && pass.determinant() > 0.05).then_some(State { actuation, pass })
    }

    /// The equilibrium at planar angles, deg from z, reached from rest by least changes of the currents.
    pub fn at_target(&self, target_deg: [f64; 2]) -> State {
        let mut state = self.led_from_rest(&[0.0; 6], &[0.0; 2]).expect("rests");
        let start = planar_angles_deg(&state.pass);
        for step in 1..=60 {
            let share = f64::min(f64::from(step) / 50.0, 1.0);
            let wanted = [0, 1].map(|magnet| start[magnet] + share * (target_deg[magnet] - start[magnet]));
            let present = planar_angles_deg(&state.pass);
            let left = Vector2::new(wanted[0] - present[0], wanted[1] - present[1]).map(f64::to_radians);
            let planar = self.jacobians(&state).planar(&state.pass);
            let inverse = planar.exact.pseudo_inverse(1e-9).expect("of full rank");
            for (current, change) in state.actuation.current_a.iter_mut().zip((inverse * left).iter()) {
                *current += change;
            }
            let guess = state.pass.unknowns();
            let solution = self.with_field(&state.actuation, |field| {
                self.manipulator.solve(field, &TipLoad::NONE, &guess, PassMode::default(), &mut state.pass)
            });
            assert!(solution.converged(), "{target_deg:?}: {solution:?}");
        }
        state
    }

    /// Both Jacobians of the tangents by the currents.
    pub fn jacobians(&self, state: &State) -> Jacobians {
        let mut pass = state.pass.clone();
        let mut by_currents = |wrenches| {
            let mode = PassMode { poses: false, wrenches };
            let unknowns = state.pass.unknowns();
            self.with_field(&state.actuation, |field| {
                self.manipulator.pass(field, &TipLoad::NONE, &unknowns, mode, &mut pass);
            });
            DMatrix::from_fn(3 * pass.magnets().len(), self.array.coil_count(), |row, column| {
                pass.tangent_jacobian(row / 3)[row % 3][column]
            })
        };
        Jacobians { exact: by_currents(Wrenches::Following), frozen: by_currents(Wrenches::Frozen) }
    }

    /// Planar tangents of the equilibrium of an actuation near that in `pass`; `None` when it is lost.
    pub fn follow(&self, actuation: &Actuation, pass: &mut Pass) -> Option<()> {
        let guess = pass.unknowns();
        let solution = self.with_field(actuation, |field| {
            self.manipulator.solve(field, &TipLoad::NONE, &guess, PassMode::default(), pass)
        });
        solution.converged().then_some(())
    }
}
