//! Two codes, one physics: the plant at rest against the controller's statics.
//!
//! Goal: under constant actuation and without model errors, the dynamic rod of the simulated plant comes to rest where the
//! controller's shooting says that it should: angles within 0.05 degrees, positions within 0.05 mm. The two share data alone, so that
//! a wrong equation on either side shows here.
//!
//! Method: seeded random currents and frame angles. Currents rise from zero in steps with the frames already turned, in the
//! plant as in the controller's continuation, so that both follow the branch of equilibria that begins at rest. Draws without
//! such an equilibrium, or too near the end of its branch, are counted and not compared.
#![cfg(feature = "sim")]

use std::path::Path;

use magsteer::config::Config;
use magsteer::magnetics::CoilArray;
use magsteer::rod::{Pass, PassMode, TipLoad};
use magsteer_hal::{Actuation, HardwareDescription, PoseMessage};
use magsteer_sim_plant::config::CoilTruthConfig;
use magsteer_sim_plant::{Plant, PlantConfig};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What is promised, deg and mm.
const ANGLE_MAX_DEG: f64 = 0.05;
const POSITION_MAX_MM: f64 = 0.05;

/// Least margin of stability, 1 at rest and 0 at a snap-through, of an equilibrium that is compared. A deflection answers a
/// disturbance in proportion to about its reciprocal: the two meshes' small errors are compared as they are up to ten times larger.
const MARGIN_MIN: f64 = 0.1;

/// Steps in which the plant's currents rise.
const RAMP_STEPS: u32 = 8;

/// A shipped rig, as the controller and as a plant without errors know it.
struct Rig {
    config: Config,
    plant: PlantConfig,
    array: CoilArray,
}

/// Largest disagreements, and how many draws had no equilibrium to compare.
#[derive(Debug, Default)]
struct Comparison {
    angle_deg: f64,
    position_mm: f64,
    skipped: u32,
    /// Greatest turn of a magnet away from rest, deg: shows that the draws do something.
    turned_deg: f64,
    margin_min: f64,
}

impl Comparison {
    fn assert_agrees(&self) {
        assert!(self.angle_deg < ANGLE_MAX_DEG && self.position_mm < POSITION_MAX_MM, "{self:?}");
        assert!(self.turned_deg > 30.0, "the actuations must bend the rod: {self:?}");
    }
}

impl Rig {
    fn shipped(name: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(name);
        let (document, config) = Config::load(&path).expect("shipped");
        let mut plant = document.section::<PlantConfig>("plant").expect("shipped");
        plant.errors.modulus_relative = 0.0;
        plant.errors.moment_relative = 0.0;
        plant.errors.coil_gain_relative = 0.0;
        plant.errors.coil_axis_deg = 0.0;
        plant.errors.coil_position_mm = 0.0;
        // The series that the controller knows, in place of windings and of cores that saturate.
        for truth in plant.field.values_mut() {
            *truth = CoilTruthConfig::Multipole;
        }
        // The controller's statics leave the magnets' forces on each other out.
        plant.rod.magnet_interaction = false;
        let array = CoilArray::new(&config.description);
        Self { config, plant, array }
    }

    fn rig(&self) -> &HardwareDescription {
        &self.config.description
    }

    /// Currents up to `current_max` and frame angles anywhere in their range.
    fn draw(&self, current_max: f64, random: &mut ChaCha8Rng) -> Actuation {
        let mut actuation = Actuation::default();
        for current in &mut actuation.current_a[..self.rig().coils.len()] {
            *current = random.random_range(-current_max..current_max);
        }
        for (angle, frame) in actuation.angle_rad.iter_mut().zip(&self.rig().frames) {
            *angle = random.random_range(frame.angle_min..frame.angle_max);
        }
        actuation
    }

    /// The controller's equilibrium; false when there is none that can be compared.
    fn predict(&self, actuation: &Actuation, pass: &mut Pass) -> bool {
        let manipulator = self.config.manipulator.as_ref().expect("has a model");
        let posed = self.array.posed(&actuation.angle_rad[..self.rig().frames.len()]);
        let field = posed.actuated(&actuation.current_a[..self.rig().coils.len()]);
        let solution = manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), pass);
        solution.converged()
            && !solution.lost_stability
            && pass.field_valid()
            && pass.determinant() >= MARGIN_MIN
    }

    /// The plant's rest under the same actuation.
    fn settle(&self, actuation: &Actuation) -> PoseMessage {
        let mut plant: Plant = self.plant.build(self.rig()).expect("shipped");
        for step in 1..=RAMP_STEPS {
            let share = f64::from(step) / f64::from(RAMP_STEPS);
            let mut part = *actuation;
            part.current_a.iter_mut().for_each(|current| *current *= share);
            assert!(plant.settle_at(&part), "the plant finds no rest under {actuation:?}");
        }
        plant.truth()
    }

    /// Compares `count` equilibria under random actuations.
    fn compare(&self, count: u32, current_max: f64, seed: u64) -> Comparison {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut pass = Pass::new(self.config.manipulator.as_ref().expect("has a model"));
        assert!(self.predict(&Actuation::default(), &mut pass), "the rod has a rest");
        let rest: Vec<Vector3<f64>> = pass.magnets().iter().map(|magnet| magnet.tangent()).collect();
        let mut comparison = Comparison { margin_min: f64::INFINITY, ..Comparison::default() };
        let mut compared = 0;
        while compared < count {
            let actuation = self.draw(current_max, &mut random);
            if !self.predict(&actuation, &mut pass) {
                comparison.skipped += 1;
                assert!(comparison.skipped < 20 * count, "the draws have hardly any equilibria");
                continue;
            }
            compared += 1;
            comparison.margin_min = comparison.margin_min.min(pass.determinant());
            let truth = self.settle(&actuation);
            assert_eq!(truth.magnet_count as usize, pass.magnets().len());
            for (index, predicted) in pass.magnets().iter().enumerate() {
                let seen = &truth.magnets[index];
                let angle = degrees_between(&seen.tangent().into(), &predicted.tangent());
                let position = (Vector3::from(seen.position_m) - predicted.position()).norm() * 1e3;
                comparison.angle_deg = comparison.angle_deg.max(angle);
                comparison.position_mm = comparison.position_mm.max(position);
                let turned = degrees_between(&predicted.tangent(), &rest[index]);
                comparison.turned_deg = comparison.turned_deg.max(turned);
            }
        }
        comparison
    }
}

fn degrees_between(first: &Vector3<f64>, second: &Vector3<f64>) -> f64 {
    first.cross(second).norm().atan2(first.dot(second)).to_degrees()
}

#[test]
fn plant_at_rest_is_where_the_controllers_statics_say() {
    let comparison = Rig::shipped("bigmag-planar.toml").compare(50, 2.5, 1);
    println!("bigmag-planar, 50 actuations: {comparison:?}");
    comparison.assert_agrees();
}

/// Goal: the same with sections that stretch and shear, which both sides describe by other equations than Kirchhoff's.
#[test]
fn extensible_plant_at_rest_is_where_the_controllers_statics_say() {
    let comparison = Rig::shipped("reference-two-magnets.toml").compare(10, 2.5, 2);
    println!("reference-two-magnets, 10 actuations: {comparison:?}");
    comparison.assert_agrees();
}

/// Goal: the comparison is sharp: rubber one per cent stiffer than the controller believes does not pass.
#[test]
fn a_plant_one_per_cent_stiffer_is_told_apart() {
    let mut rig = Rig::shipped("bigmag-planar.toml");
    rig.plant.errors.modulus_relative = 0.01;
    let comparison = rig.compare(5, 2.5, 1);
    println!("bigmag-planar, 1 % stiffer: {comparison:?}");
    assert!(comparison.angle_deg > ANGLE_MAX_DEG && comparison.position_mm > POSITION_MAX_MM);
}
