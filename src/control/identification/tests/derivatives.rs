//! Every column of the fit against central differences of full re-solves.

use super::fixtures::{PRIORS, Rig, drawn};
use crate::control::identification::equilibria::{Model, Modelled};
use crate::control::identification::{Parameters, Priors, Sample, Stiffness};
use crate::math::SplitMix;
use crate::rod::RodConfig;

fn at(
    parameters: &Parameters,
    rod: &RodConfig,
    values: &[f64],
    sample: &Sample,
    near: Option<&Modelled>,
) -> Modelled {
    Model::new(parameters, rod, values).expect("near").at(sample, near).expect("an equilibrium")
}

/// Greatest deviation, relative to the greatest entry of its column.
fn deviation(parameters: &Parameters, rod: &RodConfig, values: &[f64], sample: &Sample) -> f64 {
    let here = at(parameters, rod, values, sample, None);
    let mut worst = 0.0_f64;
    for parameter in 0..values.len() {
        // Turns the magnets by about 1e-4 rad: truncation and rounding then stay below 1e-7 of the column.
        let turn = here.magnets.iter().map(|magnet| magnet.tangent_by[parameter].norm()).fold(0.0, f64::max);
        let step = f64::min(1e-4 / turn, 0.1 * parameters.deviations()[parameter]);
        let mut sums = vec![[nalgebra::Vector3::zeros(); 2]; here.magnets.len()];
        for (offset, weight) in [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)] {
            let mut other = values.to_vec();
            other[parameter] += offset * step;
            let there = at(parameters, rod, &other, sample, Some(&here));
            for (sum, magnet) in sums.iter_mut().zip(&there.magnets) {
                sum[0] += magnet.tangent * (weight / (12.0 * step));
                sum[1] += magnet.position * (weight / (12.0 * step));
            }
        }
        let (mut off, mut size) = ([0.0_f64; 2], [0.0_f64; 2]);
        for (sum, magnet) in sums.iter().zip(&here.magnets) {
            let found = [magnet.tangent_by[parameter], magnet.position_by[parameter]];
            for sort in 0..2 {
                off[sort] = off[sort].max((found[sort] - sum[sort]).norm());
                size[sort] = size[sort].max(sum[sort].norm());
            }
        }
        // What moves nothing has no relative error: below a hundredth of a degree or a micrometre for a
        // prior deviation.
        let floor = [1e-4, 1e-6].map(|least| least / parameters.deviations()[parameter]);
        for sort in 0..2 {
            worst = worst.max(off[sort] / size[sort].max(floor[sort]));
        }
    }
    worst
}

#[test]
fn every_derivative_equals_differences_of_full_solves() {
    let mut rig = Rig::shipped();
    rig.rod.residual_tolerance = 1e-13;
    let mut stream = SplitMix::new(5);
    let parameters = rig.parameters(&PRIORS);
    let excitations = rig.excitations(8, 3);
    for actuation in &excitations {
        // Away from the nominal values too, where the clamp's turn is not small.
        let values = drawn(&parameters, 0.5, &mut stream);
        let sample = Sample { line: 1, actuation: *actuation, magnets: Vec::new() };
        let worst = deviation(&parameters, &rig.rod, &values, &sample);
        assert!(worst < 1e-6, "{worst}");
    }
}

#[test]
fn derivatives_hold_per_material_and_for_sections_given_by_their_stiffness() {
    let mut rig = Rig::shipped();
    rig.rod.residual_tolerance = 1e-13;
    let text = r#"
        [[parts]]
        section = { material = "pmc770", length_mm = 25.0, diameter_mm = 3.0, extensible = false }
        [[parts]]
        magnet = { name = "m1", length_mm = 5.0, diameter_mm = 4.0, density_kg_per_m3 = 7500.0, moment_body_a_m2 = [0.0, 0.01, 0.06] }
        [[parts]]
        stiffness_section = { length_mm = 10.0, diameter_mm = 3.0, bending_n_m2 = 2e-5, torsion_n_m2 = 1.5e-5, shear_n = 13.0, axial_n = 38.0, mass_kg_per_m = 0.007, precurvature_per_m = [3.0, -2.0, 1.0] }
        [[parts]]
        section = { material = "soft", length_mm = 15.0, diameter_mm = 3.0, extensible = true }
        [[parts]]
        magnet = { name = "m2", length_mm = 5.0, diameter_mm = 4.0, density_kg_per_m3 = 7500.0, moment_body_a_m2 = [0.0, 0.0, -0.065] }
    "#;
    #[derive(serde::Deserialize)]
    struct Parts {
        parts: Vec<magsteer_hal::config::PartConfig>,
    }
    let manipulator = &mut rig.hardware.manipulator;
    manipulator.parts = toml::from_str::<Parts>(text).expect("right").parts;
    let mut soft = manipulator.materials["pmc770"].clone();
    soft.young_modulus_mpa = 4.0;
    manipulator.materials.insert("soft".to_owned(), soft);
    manipulator.base_tangent = [0.9, 0.1, 0.2];
    manipulator.base_roll_deg = 30.0;
    rig.description = rig.hardware.build().expect("right");
    let priors = Priors { modulus: 0.1, ..PRIORS };
    let parameters = Parameters::new(&rig.hardware, &priors, Stiffness::PerMaterial);
    let names = parameters.names()[..3].join(", ");
    assert_eq!(names, "modulus pmc770, modulus of sections given by stiffness, modulus soft");
    let mut stream = SplitMix::new(6);
    for actuation in &rig.excitations(4, 4) {
        let values = drawn(&parameters, 0.5, &mut stream);
        let sample = Sample { line: 1, actuation: *actuation, magnets: Vec::new() };
        let worst = deviation(&parameters, &rig.rod, &values, &sample);
        assert!(worst < 1e-6, "{worst}");
    }
}
