//! Gains are learnt as far as measurements tell of them, and no farther.

use magsteer_hal::{Actuation, COILS_MAX, MAGNETS_MAX};
use nalgebra::{DMatrix, DVector, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Gains, GainsConfig, across};
use crate::control::Model;
use crate::control::disturbance::Sighting;
use crate::control::tests::fixtures::{Rig, numbers, seeded};
use crate::math::angle_between;

/// Time between exposures, s.
const SPAN: f64 = 5e-3;
const MAGNETS: usize = 2;

fn config() -> GainsConfig {
    GainsConfig {
        common_deviation: 0.15,
        own_deviation: 0.03,
        error_deg: 1.0,
        error_max_deg: 10.0,
        error_turn_deg: 20.0,
        noise_deg: 0.5,
        noise_time_constant_ms: 250.0,
        forgetting_time_s: 1e6,
    }
}

fn model(rig: &Rig) -> Model {
    Model::new(&rig.description, rig.manipulator.clone(), rig.control.passes_max)
}

/// Leads models from rest to an actuation; false where one of them does not come there on a stable branch.
fn lead(models: &mut [&mut Model], actuation: &Actuation) -> bool {
    (1..=100).all(|step| {
        let mut there = *actuation;
        there.current_a.iter_mut().for_each(|current| *current *= f64::from(step) / 100.0);
        models.iter_mut().all(|model| {
            let report = model.follow(&there);
            report.converged && report.margin > 0.2
        })
    })
}

/// Currents of up to 3 A.
fn some_currents(rig: &Rig, random: &mut ChaCha8Rng) -> Actuation {
    let mut values = numbers(rig.coils(), 3.0, random);
    values.extend(numbers(rig.parameters() - rig.coils(), 0.7, random));
    rig.actuation(&values)
}

/// A model and a rod whose coils make nine tenths, some degrees apart under currents.
fn apart(rig: &Rig, random: &mut ChaCha8Rng) -> (Model, Model, Actuation) {
    let (mut believed, mut rod) = (model(rig), model(rig));
    rod.set_gains(&gains(&[0.9; 6]));
    loop {
        let actuation = some_currents(rig, random);
        if lead(&mut [&mut believed, &mut rod], &actuation)
            && angle_between(&believed.tangent(1), &rod.tangent(1)) > 0.02
        {
            return (believed, rod, actuation);
        }
    }
}

/// What a sensor shows of a rod that is another model.
fn seen(model: &Model, rod: &Model, lag: f64) -> [Option<Sighting>; MAGNETS_MAX] {
    let mut seen = [None; MAGNETS_MAX];
    for (magnet, sighting) in seen.iter_mut().enumerate().take(MAGNETS) {
        let (predicted, measured) = (model.tangent(magnet), rod.tangent(magnet));
        *sighting = Some(Sighting { predicted, measured, lag, span: SPAN });
    }
    seen
}

fn gains(coils: &[f64]) -> [f64; COILS_MAX] {
    let mut gains = [1.0; COILS_MAX];
    gains[..coils.len()].copy_from_slice(coils);
    gains
}

fn greatest_error(found: &[f64; COILS_MAX], wanted: &[f64; COILS_MAX]) -> f64 {
    found.iter().zip(wanted).fold(0.0, |most, (found, wanted)| most.max((found - wanted).abs()))
}

/// Goal: a gain and its current enter as a product: a model with gains has the shape, and per ampere the gain's share of the Jacobian,
/// of one without under as many times the currents; whoever takes it up has them too.
#[test]
fn a_gain_is_a_factor_of_its_current() {
    let (rig, mut random) = (Rig::shipped(), seeded(11));
    let mut checked = 0;
    while checked < 10 {
        let amplified =
            gains(&numbers(rig.coils(), 0.3, &mut random).iter().map(|it| 1.0 + it).collect::<Vec<_>>());
        let actuation = some_currents(&rig, &mut random);
        let mut product = actuation;
        product.current_a.iter_mut().zip(&amplified).for_each(|(current, gain)| *current *= gain);
        let (mut plain, mut with) = (model(&rig), model(&rig));
        with.set_gains(&amplified);
        if !(lead(&mut [&mut with], &actuation) && lead(&mut [&mut plain], &product)) {
            continue;
        }
        // Newton's steps of two more cycles leave rounding.
        (0..2 * rig.parameters()).for_each(|_| {
            plain.follow(&product);
            with.follow(&actuation);
        });
        for magnet in 0..MAGNETS {
            assert!((with.tangent(magnet) - plain.tangent(magnet)).norm() < 1e-10);
            for (with, plain) in with.tangent_jacobian(magnet).iter().zip(plain.tangent_jacobian(magnet)) {
                for (coil, (with, plain)) in with.iter().zip(plain).enumerate() {
                    let expected = plain * if coil < rig.coils() { amplified[coil] } else { 1.0 };
                    assert!((with - expected).abs() < 1e-8 * plain.abs().max(1e-3), "{with} {expected}");
                }
            }
        }
        assert!((with.stability().margin - plain.stability().margin).abs() < 1e-9);
        assert!((with.determinant() - plain.determinant()).abs() < 1e-9 * plain.determinant());
        // Probes are one-sided, over steps that the gains stretch.
        for (coil, gain) in amplified.iter().enumerate().take(rig.coils()) {
            let [found, wanted] =
                [with.determinant_gradient()[coil], plain.determinant_gradient()[coil] * gain];
            assert!((found - wanted).abs() < 0.02 * wanted.abs().max(1.0), "{found} {wanted}");
        }
        let mut other = model(&rig);
        other.take_up(&with);
        assert_eq!(other.gains(), with.gains());
        let report = other.follow(&actuation);
        assert!(report.converged && report.passes == 1, "{report:?}");
        assert!((other.tangent(0) - with.tangent(0)).norm() < 1e-9);
        checked += 1;
    }
}

/// Goal: gains that change under an equilibrium lead it along: one pass a cycle keeps up with an estimate that learns.
#[test]
fn an_equilibrium_is_led_along_with_its_gains() {
    let (rig, mut random) = (Rig::shipped(), seeded(12));
    let mut model = model(&rig);
    let actuation = loop {
        let actuation = some_currents(&rig, &mut random);
        if lead(&mut [&mut model], &actuation) {
            break actuation;
        }
        model = self::model(&rig);
    };
    for step in 1..=100 {
        model.set_gains(&gains(&vec![1.0 - 0.001 * f64::from(step); rig.coils()]));
        let report = model.follow(&actuation);
        assert!(report.converged && report.passes == 1, "{step}: {report:?}");
    }
    let mut fresh = self::model(&rig);
    fresh.set_gains(model.gains());
    assert!(lead(&mut [&mut fresh], &actuation));
    assert!((fresh.tangent(1) - model.tangent(1)).norm() < 1e-4);
}

/// Goal: of a rod with other gains they are found, the more of them the more postures were seen, until the model is the rod.
#[test]
fn gains_of_a_rod_are_found_from_how_it_bends() {
    let (rig, mut random) = (Rig::shipped(), seeded(13));
    let wanted = gains(&[0.93, 0.97, 0.91, 0.95, 0.98, 0.92]);
    let mut learnt = Gains::new(&GainsConfig { error_deg: 0.3, ..config() }, rig.coils(), MAGNETS);
    let mut errors = Vec::new();
    while errors.len() < 60 {
        let actuation = some_currents(&rig, &mut random);
        let (mut believed, mut rod) = (model(&rig), model(&rig));
        believed.set_gains(&learnt.gains());
        rod.set_gains(&wanted);
        if !lead(&mut [&mut believed, &mut rod], &actuation) {
            continue;
        }
        // Two seconds in each posture.
        for _ in 0..400 {
            learnt.learn(&believed, &actuation.current_a, &seen(&believed, &rod, 0.0));
            believed.set_gains(&learnt.gains());
            believed.follow(&actuation);
        }
        errors.push(greatest_error(&learnt.gains(), &wanted));
    }
    println!(
        "greatest error after 1, 5, 20, 60 postures: {:.4} {:.4} {:.4} {:.4}",
        errors[0], errors[4], errors[19], errors[59]
    );
    assert!(errors[4] < 0.03 && errors[59] < 0.01, "{errors:?}");
}

/// Goal: after any rows the estimate is the least squares of all of them with the prior, (P0^-1 + sum h h'/R)^-1 sum h e/R, and so is its
/// covariance.
#[test]
fn the_filter_is_least_squares_with_a_prior() {
    let mut random = seeded(14);
    let mut learnt = Gains::new(&config(), 5, MAGNETS);
    let size = learnt.state.len();
    let mut information = learnt.covariance.clone().try_inverse().expect("positive definite");
    let mut right = DVector::zeros(size);
    for _ in 0..40 {
        learnt.row = DVector::from_vec(numbers(size, 2.0, &mut random));
        let (seen, variance) = (random.random_range(-0.05..0.05), random.random_range(0.01..1.0));
        let row = learnt.row.clone();
        learnt.update(seen, variance);
        information += &row * row.transpose() / variance;
        right += &row * (seen / variance);
    }
    let covariance: DMatrix<f64> = information.try_inverse().expect("positive definite");
    assert!((&learnt.covariance - &covariance).amax() < 1e-12 * covariance.amax().max(1.0));
    assert!((&learnt.state - &covariance * right).amax() < 1e-12);
}

/// One component of a tangent that was seen.
struct Seen {
    magnet: usize,
    /// What the magnet had turned until then, rad.
    turn: f64,
    axis: Vector3<f64>,
    /// `h`.
    sensitivity: DVector<f64>,
    /// `e + h' y`.
    off: f64,
}

/// Goal: what is learnt on a way of postures is the generalised least squares of everything seen, with noise that postures have in common
/// the more the less lies between them: x = P0 H' (H P0 H' + N)^-1 z, N = s^2 exp(-f / F) a a' of one magnet, plus R of each exposure.
#[test]
fn an_error_of_a_posture_is_noise_that_neighbours_share() {
    let (rig, mut random) = (Rig::shipped(), seeded(17));
    let config = GainsConfig { noise_deg: 0.1, error_max_deg: 180.0, ..config() };
    let mut learnt = Gains::new(&config, rig.coils(), MAGNETS);
    let prior = learnt.covariance.view((0, 0), (rig.coils(), rig.coils())).clone_owned();
    let mut rows: Vec<Seen> = Vec::new();
    let mut turn = [0.0; MAGNETS];
    let mut before = [Vector3::zeros(); MAGNETS];
    while rows.len() < 60 {
        let (mut model, there) = (model(&rig), some_currents(&rig, &mut random));
        if !lead(&mut [&mut model], &there) {
            continue;
        }
        for exposure in 0..3 {
            let mut shown = [None; MAGNETS_MAX];
            let y = learnt.state.rows(0, rig.coils()).clone_owned();
            for (magnet, sighting) in shown.iter_mut().enumerate().take(MAGNETS) {
                let predicted = model.tangent(magnet);
                if exposure == 0 {
                    let turned = (predicted - before[magnet]).norm();
                    assert!(turned > 0.02, "another seed");
                    turn[magnet] += turned;
                    before[magnet] = predicted;
                }
                let jacobian = model.tangent_jacobian(magnet);
                let mut measured = predicted;
                for axis in across(&predicted) {
                    let sensitivity = DVector::from_fn(rig.coils(), |coil, _| {
                        let column = Vector3::from([0, 1, 2].map(|it| jacobian[it][coil]));
                        axis.dot(&column) * there.current_a[coil]
                    });
                    let off = random.random_range(-0.03..0.1);
                    measured += axis * (off - sensitivity.dot(&y));
                    rows.push(Seen { magnet, turn: turn[magnet], axis, sensitivity, off });
                }
                *sighting = Some(Sighting { predicted, measured, lag: 0.0, span: SPAN });
            }
            learnt.learn(&model, &there.current_a, &shown);
        }
    }
    let error = config.error_deg.to_radians();
    let passing = 2.0 * config.noise_deg.to_radians().powi(2) * config.noise_time_constant_ms * 1e-3 / SPAN;
    let count = rows.len();
    let noise = DMatrix::from_fn(count, count, |one, other| {
        let same = if one == other { passing } else { 0.0 };
        let (one, other) = (&rows[one], &rows[other]);
        let apart = (one.turn - other.turn).abs() / config.error_turn_deg.to_radians();
        let common = error.powi(2) * (-apart).exp() * one.axis.dot(&other.axis);
        same + if one.magnet == other.magnet { common } else { 0.0 }
    });
    let sensitivity = DMatrix::from_fn(count, rig.coils(), |row, coil| rows[row].sensitivity[coil]);
    let seen = DVector::from_iterator(count, rows.iter().map(|row| row.off));
    let covaried = &prior * sensitivity.transpose();
    let total = (&sensitivity * &covaried + noise).try_inverse().expect("positive definite");
    let expected = covaried * total * seen;
    assert!(expected.amax() > 0.01, "{expected}");
    let found = learnt.state.rows(0, rig.coils());
    assert!((found - &expected).amax() < 1e-6, "{found} {expected}");
}

/// Goal: what is seen for two minutes of a rod that stands teaches hardly more than what is seen of it in five seconds: of errors that no
/// gain explains as of those that one does, though what was learnt fades meanwhile and the model trembles.
#[test]
fn standing_teaches_once() {
    let (rig, mut random) = (Rig::shipped(), seeded(18));
    let (mut model, rod, actuation) = apart(&rig, &mut random);
    let forgetful = GainsConfig { forgetting_time_s: 60.0, ..config() };
    let mut learnt = Gains::new(&forgetful, rig.coils(), MAGNETS);
    let mut after = |poses: u32| {
        for _ in 0..poses {
            let mut shown = seen(&model, &rod, 0.0);
            for (sighting, sag) in shown.iter_mut().flatten().zip([0.03, -0.02]) {
                let trembling = Vector3::from_vec(numbers(3, 1e-3, &mut random));
                sighting.predicted += trembling;
                sighting.measured += trembling + across(&sighting.predicted)[0] * sag;
            }
            learnt.learn(&model, &actuation.current_a, &shown);
            model.set_gains(&learnt.gains());
            model.follow(&actuation);
        }
        learnt.gains()
    };
    let soon = after(1000);
    assert!(greatest_error(&soon, &[1.0; COILS_MAX]) > 0.02, "{soon:?}");
    let late = after(24_000);
    assert!(greatest_error(&late, &soon) < 0.01, "{late:?} {soon:?}");
}

/// Goal: nothing is learnt without currents, from a prior without doubt, without a time between exposures, and of what is no number.
#[test]
fn what_tells_nothing_teaches_nothing() {
    let (rig, mut random) = (Rig::shipped(), seeded(15));
    let still = self::model(&rig);
    let (model, rod, actuation) = apart(&rig, &mut random);
    let nothing = [1.0; COILS_MAX];
    let shown = seen(&model, &rod, 0.0);
    let learnt = |config: &GainsConfig,
                  model: &Model,
                  currents: &[f64; COILS_MAX],
                  shown: &[Option<Sighting>; MAGNETS_MAX]| {
        let mut learnt = Gains::new(config, rig.coils(), MAGNETS);
        (0..100).for_each(|_| learnt.learn(model, currents, shown));
        learnt.gains()
    };
    let currents = &actuation.current_a;
    assert!(greatest_error(&learnt(&config(), &model, currents, &shown), &nothing) > 0.01);
    let certain = GainsConfig { common_deviation: 0.0, own_deviation: 0.0, ..config() };
    assert_eq!(learnt(&certain, &model, currents, &shown), nothing);
    assert_eq!(learnt(&config(), &still, &[0.0; COILS_MAX], &shown), nothing);
    let altered = |alter: &dyn Fn(&mut Sighting)| {
        let mut altered = shown;
        altered.iter_mut().flatten().for_each(alter);
        learnt(&config(), &model, currents, &altered)
    };
    assert_eq!(altered(&|sighting| sighting.span = 0.0), nothing);
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(altered(&|sighting| sighting.lag = bad), nothing, "lag {bad}");
        assert_eq!(altered(&|sighting| sighting.measured.x = bad), nothing, "measured {bad}");
        assert_eq!(altered(&|sighting| sighting.predicted.y = bad), nothing, "predicted {bad}");
        let mut wrong = *currents;
        wrong[2] = bad;
        assert_eq!(learnt(&config(), &model, &wrong, &shown), nothing, "current {bad}");
    }
}

/// Goal: while the rod lags behind less is learnt; what a rod cannot be is not learnt in any time; what was learnt long ago is learnt anew.
#[test]
fn lag_bounds_and_time_are_heeded() {
    let (rig, mut random) = (Rig::shipped(), seeded(16));
    let (model, rod, actuation) = apart(&rig, &mut random);
    let currents = &actuation.current_a;
    let after = |learnt: &mut Gains, lag: f64, poses: u32| {
        (0..poses).for_each(|_| learnt.learn(&model, currents, &seen(&model, &rod, lag)));
        greatest_error(&learnt.gains(), &[1.0; COILS_MAX])
    };
    let fresh = || Gains::new(&config(), rig.coils(), MAGNETS);
    let [at_rest, moving] = [0.0, 0.2].map(|lag| after(&mut fresh(), lag, 10));
    assert!(moving < 0.1 * at_rest && moving > 0.0, "{moving} {at_rest}");

    // Where no posture errs by itself, a sensor that lies for an hour: by as much as is believed, and by more.
    let lied_to = |by: f64| {
        let mut lie = seen(&model, &rod, 0.0);
        for sighting in lie.iter_mut().flatten() {
            let [one, other] = across(&sighting.predicted);
            sighting.measured = sighting.predicted + (one + other) * by;
        }
        let certain = GainsConfig { error_deg: 0.01, ..config() };
        let mut learnt = Gains::new(&certain, rig.coils(), MAGNETS);
        (0..720_000).for_each(|_| learnt.learn(&model, currents, &lie));
        learnt.gains()
    };
    let most = (3.0 * 0.15_f64.hypot(0.03)).exp();
    let believed = lied_to(9.0_f64.to_radians());
    let farthest = believed.iter().map(|gain| gain.max(gain.recip())).fold(1.0, f64::max);
    assert!((farthest - most).abs() < 1e-9, "{believed:?}");
    assert_eq!(lied_to(11.0_f64.to_radians()), [1.0; COILS_MAX]);

    let forgetful = GainsConfig { forgetting_time_s: 1.0, ..config() };
    let mut learnt = Gains::new(&forgetful, rig.coils(), MAGNETS);
    let prior = learnt.covariance.clone();
    after(&mut learnt, 0.0, 100);
    let known = learnt.covariance.trace();
    (0..2000).for_each(|_| learnt.learn(&model, &[0.0; COILS_MAX], &seen(&model, &model, 0.0)));
    assert!(known < 0.9 * prior.trace(), "{known} {}", prior.trace());
    let of_coils = ((0, 0), (rig.coils(), rig.coils()));
    let [now, before] = [&learnt.covariance, &prior].map(|it| it.view(of_coils.0, of_coils.1));
    assert!((now - before).amax() < 1e-4 * before.amax());
}
