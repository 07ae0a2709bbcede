//! Parameters recovered from the model's own equilibria.

use nalgebra::Vector3;

use super::fixtures::{PRIORS, Rig, blur, drawn, stated, visible};
use crate::control::identification::{IdentifyError, IdentifyRequest, Noise, NoiseLevel, Priors, identify};
use crate::math::SplitMix;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Goal: from noiseless equilibria all that they determine is found to 1e-6. Two directions no equilibrium
/// shows, and both are named: the clamp's turn about its own tangent, and moments that are greater by as
/// much as all coils are weaker.
#[test]
fn noiseless_equilibria_give_the_parameters_back() {
    let mut rig = Rig::shipped();
    rig.rod.residual_tolerance = 1e-13;
    let parameters = rig.parameters(&PRIORS);
    let mut stream = SplitMix::new(11);
    let truth = visible(&parameters, drawn(&parameters, 0.6, &mut stream));
    let samples = rig.samples(&parameters, &truth, &rig.excitations(40, 12));
    let found = identify(&rig.hardware, &rig.rod, &samples, &stated(1e-6, 1e-8), |_| {}).expect("enough");
    assert!(found.converged);
    for (estimate, truth) in found.estimates.iter().zip(&truth) {
        assert!((estimate.value - truth).abs() < 1e-6, "{}: {} {truth}", estimate.name, estimate.value);
    }
    assert_eq!(found.undetermined.len(), 2, "{:?}", found.undetermined);
    assert!(found.undetermined.iter().all(|direction| direction.ratio > 0.999));
    assert!(found.rms_after.angle.expect("measured") < 1e-7 && found.outliers.is_empty());
    assert!(found.rms_before.angle.expect("measured") > DEGREE);
}

/// Goal: without weight one scale of modulus, moments and gains is not seen; the direction is named, and
/// the estimates keep to the nominal scale.
#[test]
fn the_common_scale_of_a_weightless_rod_is_left_to_the_prior_and_named() {
    let mut rig = Rig::shipped();
    rig.hardware.rig.gravity_m_per_s2 = [0.0; 3];
    rig.description = rig.hardware.build().expect("weightless");
    let priors = Priors { base_position: 0.0, base_rotation: 0.0, ..PRIORS };
    let parameters = rig.parameters(&priors);
    let samples = rig.samples(&parameters, &vec![0.02; parameters.free().len()], &rig.excitations(30, 13));
    let request = IdentifyRequest { priors, ..stated(1e-4, 1e-5) };
    let found = identify(&rig.hardware, &rig.rod, &samples, &request, |_| {}).expect("enough");
    // Stiffer by a factor and more magnetic by it; or more magnetic and with weaker coils: both show nothing.
    assert_eq!(found.undetermined.len(), 2, "{:?}", found.undetermined);
    assert!(found.undetermined.iter().all(|direction| direction.ratio > 0.99));
    assert!(found.undetermined.iter().any(|direction| direction.parts.iter().any(|(index, _)| *index == 0)));
}

/// Goal: one block in ten that is grossly wrong moves no estimate by more than its few deviations, and each
/// is named.
#[test]
fn gross_errors_are_named_and_pull_little() {
    let rig = Rig::shipped();
    let parameters = rig.parameters(&PRIORS);
    let mut stream = SplitMix::new(21);
    let truth = drawn(&parameters, 0.5, &mut stream);
    let mut samples = rig.samples(&parameters, &truth, &rig.excitations(40, 22));
    let (orientation, position) = (0.2 * DEGREE, 1e-4);
    blur(&mut samples, orientation, position, &mut stream);
    let mut spoiled = Vec::new();
    for (index, sample) in samples.iter_mut().enumerate().step_by(5) {
        let Some(reading) = &mut sample.magnets[0] else { continue };
        // The wrong way round, and far away.
        reading.tangent = -reading.tangent;
        reading.position = reading.position.map(|center| center + Vector3::new(0.0, 0.01, 0.005));
        spoiled.push(index);
    }
    let estimated = NoiseLevel::Estimated;
    let request =
        IdentifyRequest { noise: Noise { orientation: estimated, position: estimated }, ..stated(1.0, 1.0) };
    let found = identify(&rig.hardware, &rig.rod, &samples, &request, |_| {}).expect("enough");
    assert!(found.converged);
    for sample in spoiled {
        let named =
            found.outliers.iter().filter(|outlier| outlier.sample == sample && outlier.magnet == 0).count();
        assert_eq!(named, 2, "sample {sample}");
    }
    assert!(found.outliers.len() <= 18, "{:?}", found.outliers);
    for (estimate, truth) in found.estimates.iter().zip(&truth) {
        let off = (estimate.value - truth) / estimate.deviation;
        assert!(off.abs() < 5.0, "{}: {off} deviations", estimate.name);
    }
    for (found, true_noise) in found.noise.iter().zip([orientation, position]) {
        assert!((0.85..1.15).contains(&(found / true_noise)), "{found} {true_noise}");
    }
}

/// Goal: a magnet that was never seen, positions that were never measured and lines without some magnet are
/// no obstacle.
#[test]
fn missing_measurements_are_left_out() {
    let mut rig = Rig::shipped();
    rig.rod.residual_tolerance = 1e-13;
    let priors = Priors { base_position: 0.0, base_rotation: 0.0, ..PRIORS };
    let parameters = rig.parameters(&priors);
    let mut stream = SplitMix::new(31);
    let truth = visible(&parameters, drawn(&parameters, 0.5, &mut stream));
    let mut samples = rig.samples(&parameters, &truth, &rig.excitations(40, 32));
    for (index, sample) in samples.iter_mut().enumerate() {
        for reading in sample.magnets.iter_mut().flatten() {
            reading.position = None;
        }
        sample.magnets[index % 2] = sample.magnets[index % 2].filter(|_| index % 3 != 0);
    }
    let request = IdentifyRequest { priors, ..stated(1e-6, 1.0) };
    let found = identify(&rig.hardware, &rig.rod, &samples, &request, |_| {}).expect("enough");
    for (estimate, truth) in found.estimates.iter().zip(&truth) {
        assert!((estimate.value - truth).abs() < 1e-6, "{}: {} {truth}", estimate.name, estimate.value);
    }
    assert_eq!(found.rms_after.distance, None);
}

#[test]
fn what_cannot_be_estimated_is_refused_with_a_reason() {
    let rig = Rig::shipped();
    let parameters = rig.parameters(&PRIORS);
    let samples = rig.samples(&parameters, &vec![0.0; parameters.free().len()], &rig.excitations(4, 41));
    let error = |samples: &[_], request: &IdentifyRequest| {
        identify(&rig.hardware, &rig.rod, samples, request, |_| {}).expect_err("refused")
    };
    let few = error(&samples[..2], &stated(1e-3, 1e-4));
    assert_eq!(few, IdentifyError::TooFew { samples: 2, equations: 20, parameters: 15, least: 3 });
    let held = Priors { modulus: 0.0, moment: 0.0, gain: 0.0, base_position: 0.0, base_rotation: 0.0 };
    let request = IdentifyRequest { priors: held, ..stated(1e-3, 1e-4) };
    assert_eq!(error(&samples, &request), IdentifyError::NothingFree);
    let mut wild = samples.clone();
    for sample in &mut wild {
        sample.actuation.current_a[..6].copy_from_slice(&[8.0, -8.0, -8.0, 8.0, -8.0, 8.0]);
    }
    let lost = error(&wild, &stated(1e-3, 1e-4));
    assert!(matches!(lost, IdentifyError::NoEquilibrium { lost: 4, samples: 4, first: 0 }), "{lost}");
}
