//! Random equilibria of BigMag's manipulator, and the wrenches there.

use std::path::Path;

use magsteer::config::Config;
use magsteer::control::{Algorithm1Config, HeldPose, Present};
use magsteer::magnetics::{ActuatedArray, AppliedField, CoilArray, FieldSample, Wrench};
use magsteer::rod::{Manipulator, Pass, PassMode, RodConfig, TipLoad};
use magsteer_hal::{Actuation, HardwareDescription, MAGNETS_MAX};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::dead_wrenches::DeadWrench;

/// BigMag and its manipulator on some mesh.
pub struct Rig {
    pub description: HardwareDescription,
    pub manipulator: Manipulator,
    pub algorithm_1: Algorithm1Config,
    array: CoilArray,
}

pub fn seeded(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

impl Rig {
    pub fn shipped(segment_length_max_mm: f64) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        let (_, config) = Config::load(&path).expect("shipped");
        // Residuals near rounding, so that shapes compare.
        let rod = RodConfig {
            segment_length_max_mm,
            residual_tolerance: 1e-12,
            iterations_max: 50,
            rotation_step_max_deg: 20.0,
            passes_max: 20_000,
        };
        let control = config.control.expect("shipped");
        Self {
            manipulator: rod.build(&config.description).expect("shipped"),
            array: CoilArray::new(&config.description),
            description: config.description,
            algorithm_1: control.algorithm_1.expect("shipped"),
        }
    }

    pub fn parameters(&self) -> usize {
        self.array.coil_count() + self.array.frame_count()
    }

    pub fn steered(&self, actuation: &Actuation, parameter: usize, by: f64) -> Actuation {
        let mut steered = *actuation;
        match parameter.checked_sub(self.array.coil_count()) {
            None => steered.current_a[parameter] += by,
            Some(frame) => steered.angle_rad[frame] += by,
        }
        steered
    }

    /// Runs `work` with the field under an actuation.
    pub fn with_field<T>(&self, actuation: &Actuation, work: impl FnOnce(&ActuatedArray<'_>) -> T) -> T {
        let posed = self.array.posed(&actuation.angle_rad[..self.array.frame_count()]);
        work(&posed.actuated(&actuation.current_a[..self.array.coil_count()]))
    }

    /// The next stable equilibrium of random actuation, and the pass there.
    pub fn equilibrium(&self, current_max: f64, random: &mut ChaCha8Rng) -> (Present, Pass) {
        let mut pass = Pass::new(&self.manipulator);
        for _ in 0..100 {
            let mut actuation = Actuation::default();
            for current in &mut actuation.current_a[..self.array.coil_count()] {
                *current = random.random_range(-current_max..current_max);
            }
            for (angle, frame) in actuation.angle_rad.iter_mut().zip(&self.description.frames) {
                *angle = random.random_range(frame.angle_min..frame.angle_max);
            }
            let solution = self.with_field(&actuation, |field| {
                self.manipulator.solve_from_rest(field, &TipLoad::NONE, PassMode::default(), &mut pass)
            });
            // Nearer to a snap-through, or under pulls that make the determinant huge, shapes drown in rounding.
            let regular = (0.05..1e4).contains(&pass.determinant()) && pass.field_valid();
            if solution.converged() && !solution.lost_stability && regular {
                return (present(actuation, &pass), pass);
            }
        }
        panic!("the draws have hardly any equilibria");
    }
}

fn present(actuation: Actuation, pass: &Pass) -> Present {
    let mut poses = [HeldPose::default(); MAGNETS_MAX];
    for (pose, magnet) in poses.iter_mut().zip(pass.magnets()) {
        *pose = HeldPose { position: magnet.position(), rotation: magnet.rotation() };
    }
    Present { actuation, unknowns: pass.unknowns(), poses }
}

/// Wrenches of a field on the magnets held where they are in `pass`.
pub fn wrenches(rig: &Rig, pass: &Pass, field: &ActuatedArray<'_>) -> Vec<Wrench> {
    let mut sample = FieldSample::default();
    let magnets = pass.magnets().iter().zip(rig.description.magnets());
    magnets
        .map(|(magnet, described)| {
            field.evaluate(&magnet.position(), &mut sample);
            let moment = magnet.rotation() * Vector3::from(described.moment_body);
            Wrench { force: sample.gradient.matrix() * moment, torque: moment.cross(&sample.field) }
        })
        .collect()
}

/// The same for the oracle.
pub fn held_wrenches(rig: &Rig, pass: &Pass, field: &ActuatedArray<'_>) -> Vec<DeadWrench> {
    let wrenches = wrenches(rig, pass, field);
    wrenches.iter().map(|wrench| DeadWrench { force: wrench.force, torque: wrench.torque }).collect()
}
