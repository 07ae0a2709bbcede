//! Whether the stated deviations are those of the errors.

use super::fixtures::{Rig, blur, drawn, stated};
use crate::control::identification::{
    Estimate, Identified, IdentifyRequest, Noise, NoiseLevel, Priors, identify,
};
use crate::math::SplitMix;

/// Deviation from how much samples disagree over that of independent noise: those of one fit, on the average.
fn disagreement(found: &Identified) -> f64 {
    let ratio = |estimate: &Estimate| estimate.deviation_between_samples / estimate.deviation;
    found.estimates.iter().map(ratio).sum::<f64>() / found.estimates.len() as f64
}

/// Errors over their stated deviations of many noisy data sets, parameter by parameter; truths drawn from
/// the prior.
fn normalised_errors(runs: usize, request: &IdentifyRequest, noise: [f64; 2]) -> Vec<Vec<f64>> {
    let rig = Rig::shipped();
    let parameters = rig.parameters(&request.priors);
    let excitations = rig.excitations(10, 52);
    let mut stream = SplitMix::new(53);
    let mut errors = vec![Vec::new(); parameters.free().len()];
    for _ in 0..runs {
        let truth = drawn(&parameters, 1.0, &mut stream);
        let mut samples = rig.samples(&parameters, &truth, &excitations);
        blur(&mut samples, noise[0], noise[1], &mut stream);
        let found = identify(&rig.hardware, &rig.rod, &samples, request, |_| {}).expect("enough");
        assert!(found.converged);
        // Nothing but independent noise is there: both deviations say the same, as far as ten samples can
        // tell.
        let disagreement = disagreement(&found);
        assert!((0.6..1.5).contains(&disagreement), "{disagreement}");
        for ((errors, estimate), truth) in errors.iter_mut().zip(&found.estimates).zip(&truth) {
            errors.push((estimate.value - truth) / estimate.deviation);
        }
    }
    errors
}

fn deviation(errors: impl Iterator<Item = f64>) -> (f64, f64) {
    let (count, squares) = errors.fold((0.0, 0.0), |(count, sum), error| (count + 1.0, sum + error * error));
    (f64::sqrt(squares / count), count)
}

/// Narrower than the command's: rods drawn from those snap through now and then.
const NARROW: Priors =
    Priors { modulus: 0.04, moment: 0.02, gain: 0.02, base_position: 1e-3, base_rotation: 0.02 };
const NOISE: [f64; 2] = [3.5e-3, 1e-4];

fn assert_honest(errors: &[Vec<f64>]) {
    let (all, count) = deviation(errors.iter().flatten().copied());
    println!("normalised errors have deviation {all:.3} over {count} estimates");
    // Estimates of one run depend on each other: count the runs, not the estimates.
    assert!((0.9..1.1).contains(&all), "{all}");
    for (parameter, errors) in errors.iter().enumerate() {
        let (one, count) = deviation(errors.iter().copied());
        // Five standard errors of a deviation.
        assert!((one - 1.0).abs() < 5.0 / (2.0 * count).sqrt(), "parameter {parameter}: {one}");
    }
}

/// Goal: over truths drawn from the prior and noise drawn anew, errors have the deviations that are stated
/// with them, all together and parameter by parameter.
#[test]
fn errors_have_the_deviations_that_are_stated_with_them() {
    assert_honest(&normalised_errors(
        80,
        &IdentifyRequest { priors: NARROW, ..stated(NOISE[0], NOISE[1]) },
        NOISE,
    ));
}

/// Goal: the same when the noise is estimated from the data, which costs a little: few data know their
/// noise to some percent.
#[test]
fn errors_have_the_stated_deviations_with_estimated_noise_too() {
    let noise = Noise { orientation: NoiseLevel::Estimated, position: NoiseLevel::Estimated };
    let request = IdentifyRequest { noise, priors: NARROW, ..stated(1.0, 1.0) };
    assert_honest(&normalised_errors(80, &request, NOISE));
}
