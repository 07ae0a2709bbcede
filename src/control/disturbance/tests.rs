//! What the estimate promises: it learns what lasts, and takes neither motion nor lies for it.

use magsteer_hal::MagnetPose;
use nalgebra::UnitQuaternion;

use super::*;
use crate::math::angle_between;

const PERIOD: f64 = 1e-3;

fn config() -> DisturbanceConfig {
    DisturbanceConfig {
        tracking_per_s: 20.0,
        time_constant_ms: 100.0,
        mode_frequency_hz: 4.0,
        mode_damping_ratio: 0.2,
        mode_softening: 1.0,
        delay_ms: 0.0,
        innovation_max_deg: 10.0,
    }
}

fn tangent(degrees: f64) -> Vector3<f64> {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    Vector3::new(sine, 0.0, cosine)
}

/// Two magnets at angles from z.
fn tangents(degrees: [f64; 2]) -> Directions {
    let mut directions = Directions::default();
    (directions[0], directions[1]) = (tangent(degrees[0]).into(), tangent(degrees[1]).into());
    directions
}

fn pose(degrees: [f64; 2], valid: [u32; 2]) -> PoseMessage {
    let mut pose = PoseMessage { magnet_count: 2, ..PoseMessage::default() };
    for ((magnet, degrees), valid) in pose.magnets.iter_mut().zip(degrees).zip(valid) {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
        *magnet = MagnetPose { orientation_xyzw: turn.coords.into(), valid, ..MagnetPose::default() };
    }
    pose
}

fn predict(disturbance: &mut Disturbance, degrees: [f64; 2], period: f64) {
    disturbance.predict(&Prediction { tangents: &tangents(degrees), converged: true, margin: 1.0, period });
}

fn bias_deg(disturbance: &Disturbance) -> [f64; 2] {
    [0, 1].map(|magnet| disturbance.bias()[magnet][1].to_degrees())
}

/// Goal: a lasting difference is learnt with the time constant, to the last, whatever the sensor's rate;
/// corrected predictions are then what is measured.
#[test]
fn lasting_differences_are_learnt_with_the_time_constant() {
    for every in [5, 33] {
        let mut disturbance = Disturbance::new(&config(), 0.0, 2);
        predict(&mut disturbance, [90.0, 100.0], PERIOD);
        disturbance.learn(&pose([90.0, 100.0], [1, 1]), 0.0);
        assert!(bias_deg(&disturbance).iter().all(|bias| bias.abs() < 1e-9));
        for number in 1..=1980 {
            predict(&mut disturbance, [90.0, 100.0], PERIOD);
            if number % every == 0 {
                disturbance.learn(&pose([93.0, 98.0], [1, 1]), 0.0);
                let learnt = 1.0 - (-f64::from(number) * 0.01).exp();
                let [first, second] = bias_deg(&disturbance);
                assert!((first - 3.0 * learnt).abs() < 1e-6, "{every}, {number}: {first}");
                assert!((second + 2.0 * learnt).abs() < 1e-6, "{every}, {number}: {second}");
            }
        }
        let corrected = disturbance.corrected(0, &tangent(90.0));
        assert!(angle_between(&corrected, &tangent(93.0)) < 1e-6);
    }
}

/// Goal: a rod that answers as its mode, seen late, has no bias however it swings, where its field or the prediction comes late as well;
/// compared with a prediction of another moment it would seem to have one of several degrees.
#[test]
fn a_swinging_rod_seen_late_has_no_bias() {
    for (age_cycles, lag_cycles, delay_cycles) in
        [(5, 0, 0), (60, 0, 0), (200, 0, 0), (5, 0, 20), (60, 0, 30), (10, 10, 0), (60, 20, 30)]
    {
        let config = DisturbanceConfig { delay_ms: delay_cycles as f64 * PERIOD * 1e3, ..config() };
        let mut disturbance = Disturbance::new(&config, lag_cycles as f64 * PERIOD, 2);
        // The oracle: the same equation in 20 small steps a cycle.
        let (w, z) = (std::f64::consts::TAU * 4.0, 0.2);
        let (mut place, mut speed) = (90.0_f64, 0.0_f64);
        let mut were = Vec::new();
        let mut most = 0.0_f64;
        for number in 0..3000_usize {
            // A step of half a degree every 0.4 s: so small that chords are arcs.
            let resting_at = |number: usize| if (number / 400).is_multiple_of(2) { 90.0 } else { 90.5 };
            let resting = resting_at(number.saturating_sub(delay_cycles));
            for _ in 0..20 {
                speed += (w * w * (resting - place) - 2.0 * z * w * speed) * PERIOD / 20.0;
                place += speed * PERIOD / 20.0;
            }
            were.push(place);
            predict(&mut disturbance, [resting_at(number.saturating_sub(lag_cycles)), 90.0], PERIOD);
            if number >= age_cycles && number % 5 == 0 {
                let then = were[number - age_cycles];
                disturbance.learn(&pose([then, 90.0], [1, 1]), age_cycles as f64 * PERIOD);
            }
            most = most.max(bias_deg(&disturbance)[0].abs());
        }
        assert!(most < 2e-3, "{age_cycles} {lag_cycles} {delay_cycles}: {most}");
    }
}

/// Goal: a rod that loads have softened answers late, and has no bias for that, swinging or creeping; with the stiffness of the
/// unloaded rod it would seem to have one of degrees.
#[test]
fn a_softened_rod_has_no_bias() {
    for (damping, margin) in [(0.2, 0.5), (0.2, 0.1), (0.4, 0.16), (0.5, 0.1)] {
        let most = |told: f64, mode_softening: f64| {
            let with = DisturbanceConfig { mode_damping_ratio: damping, mode_softening, ..config() };
            let mut disturbance = Disturbance::new(&with, 0.0, 2);
            // The oracle: the equation in 20 small steps a cycle.
            let w = std::f64::consts::TAU * 4.0;
            let (mut place, mut speed, mut most) = (90.0_f64, 0.0_f64, 0.0_f64);
            for number in 0..2000_usize {
                // Steadily on, by 30 deg/s, and to rest.
                let resting = 90.0 + 0.03 * number.min(400) as f64;
                for _ in 0..20 {
                    speed += (margin * w * w * (resting - place) - 2.0 * damping * w * speed) * PERIOD / 20.0;
                    place += speed * PERIOD / 20.0;
                }
                let tangents = tangents([resting, 90.0]);
                disturbance.predict(&Prediction {
                    tangents: &tangents,
                    converged: true,
                    margin: told,
                    period: PERIOD,
                });
                disturbance.learn(&pose([place, 90.0], [1, 1]), 0.0);
                most = most.max(bias_deg(&disturbance)[0].abs());
            }
            most
        };
        let (known, unknown) = (most(margin, 1.0), most(1.0, 1.0));
        assert_eq!(most(margin, 0.0), unknown, "softening that is not counted on");
        assert!(known < 0.02 && unknown > 20.0 * known, "{damping} {margin}: {known} {unknown}");
    }
}

/// Goal: whatever is told for a margin, the estimate stays finite.
#[test]
fn every_margin_is_answered() {
    for margin in [f64::NAN, f64::NEG_INFINITY, -1.0, 0.0, 1e300, f64::INFINITY] {
        let mut disturbance = Disturbance::new(&config(), 0.0, 2);
        for degrees in [90.0, 95.0, 95.0] {
            let tangents = tangents([degrees, 90.0]);
            disturbance.predict(&Prediction { tangents: &tangents, converged: true, margin, period: PERIOD });
            disturbance.learn(&pose([degrees, 90.0], [1, 1]), 0.0);
        }
        assert!(bias_deg(&disturbance).iter().all(|bias| bias.is_finite()), "{margin}");
    }
}

/// Goal: magnets that the sensor did not see keep their bias, the others learn.
#[test]
fn unseen_magnets_keep_their_bias() {
    let mut disturbance = Disturbance::new(&config(), 0.0, 2);
    predict(&mut disturbance, [90.0, 90.0], PERIOD);
    disturbance.learn(&pose([91.0, 92.0], [1, 1]), 0.0);
    for _ in 0..1000 {
        predict(&mut disturbance, [90.0, 90.0], PERIOD);
        disturbance.learn(&pose([95.0, 45.0], [1, 0]), 0.0);
    }
    let [first, second] = bias_deg(&disturbance);
    assert!((first - 5.0).abs() < 1e-3 && (second - 2.0).abs() < 1e-9, "{first} {second}");
}

/// Goal: a sensor that lies by 90 degrees for 20 ms, or is silent for a second and then wrong once, moves the
/// estimate by no more than what is credible would.
#[test]
fn jumps_and_pauses_move_the_estimate_little() {
    let mut disturbance = Disturbance::new(&config(), 0.0, 2);
    let mut run = |cycles: u32, degrees: Option<f64>| {
        for _ in 0..cycles {
            predict(&mut disturbance, [90.0, 90.0], PERIOD);
            if let Some(degrees) = degrees {
                disturbance.learn(&pose([degrees, 90.0], [1, 1]), 0.0);
            }
        }
        bias_deg(&disturbance)[0]
    };
    assert!(run(100, Some(90.0)).abs() < 1e-9);
    let lied = run(20, Some(180.0));
    // 10 degrees for 20 ms of 100.
    assert!(lied > 1.0 && lied < 2.0 + 1e-6, "{lied}");
    assert!(run(2000, Some(90.0)).abs() < 1e-6);
    run(1000, None);
    let once = run(1, Some(180.0));
    // Half a time constant of 10 degrees.
    assert!((once - 10.0 * (1.0 - (-0.5_f64).exp())).abs() < 1e-6, "{once}");
}

/// Goal: while the model has not caught up, and for poses from before it had, nothing is learnt.
#[test]
fn a_model_astray_teaches_nothing() {
    let mut disturbance = Disturbance::new(&config(), 0.0, 2);
    predict(&mut disturbance, [90.0, 90.0], PERIOD);
    disturbance.learn(&pose([90.0, 90.0], [1, 1]), 0.0);
    let astray =
        Prediction { tangents: &tangents([89.0, 90.0]), converged: false, margin: 1.0, period: PERIOD };
    for _ in 0..50 {
        disturbance.predict(&astray);
        disturbance.learn(&pose([95.0, 90.0], [1, 1]), 0.0);
    }
    for _ in 0..20 {
        predict(&mut disturbance, [90.0, 90.0], PERIOD);
        disturbance.learn(&pose([95.0, 90.0], [1, 1]), 0.03);
    }
    assert!(bias_deg(&disturbance).iter().all(|bias| bias.abs() < 1e-9));
    (0..20).for_each(|_| predict(&mut disturbance, [90.0, 90.0], PERIOD));
    disturbance.learn(&pose([95.0, 90.0], [1, 1]), 0.03);
    assert!(bias_deg(&disturbance)[0] > 0.1);
}

/// Goal: predictions that leap back and forth, as those of an angle that is measured wrongly, neither teach
/// nor are steered by; what moves as fast as a rod may and with the noise of currents does.
#[test]
fn leaping_predictions_are_not_steered_by() {
    let mut disturbance = Disturbance::new(&config(), 0.0, 2);
    predict(&mut disturbance, [90.0, 90.0], PERIOD);
    disturbance.learn(&pose([91.0, 90.0], [1, 1]), 0.0);
    for number in 0..200 {
        let noise = if number % 2 == 0 { 0.3 } else { -0.3 };
        predict(&mut disturbance, [90.0 + 0.4 * f64::from(number) + noise, 90.0], PERIOD);
        assert!(disturbance.is_sound(), "{number}");
    }
    let before = bias_deg(&disturbance);
    for number in 0..200 {
        predict(&mut disturbance, [170.0, if number % 2 == 0 { 60.0 } else { 120.0 }], PERIOD);
        disturbance.learn(&pose([170.0, 90.0], [1, 1]), 0.0);
        assert!(!disturbance.is_sound());
    }
    assert_eq!(bias_deg(&disturbance), before);
    (0..99).for_each(|_| predict(&mut disturbance, [170.0, 120.0], PERIOD));
    assert!(!disturbance.is_sound());
    (0..3).for_each(|_| predict(&mut disturbance, [170.0, 120.0], PERIOD));
    assert!(disturbance.is_sound());
}

/// Goal: the mode's answer is that of the equation, in one period or in many.
#[test]
fn the_modes_answer_does_not_depend_on_the_period() {
    let answer = |period: f64| {
        let mut mode = Mode::new(4.0, 0.2);
        mode.answer(&tangents([90.0, 90.0]), 2, 1.0, period);
        let mut found = Directions::default();
        for _ in 0..(0.1 / period).round() as usize {
            found = mode.answer(&tangents([95.0, 90.0]), 2, 1.0, period);
        }
        Vector3::from(found[0])
    };
    let expected = answer(1e-4);
    for period in [1e-3, 1e-2, 0.1] {
        assert!((answer(period) - expected).norm() < 1e-12, "{period}");
    }
    // Seen 0.1 s after a step of 5 degrees: 1 - exp(-z w t) (cos + z / sqrt(1 - z^2) sin)(w sqrt(1 - z^2) t)
    // = 1.398.
    let turned = angle_between(&expected, &tangent(90.0)).to_degrees();
    let (decay, phase) =
        ((-0.2_f64 * 0.8 * std::f64::consts::PI).exp(), 0.8 * std::f64::consts::PI * 0.96_f64.sqrt());
    let exact = 5.0 * (1.0 - decay * (phase.cos() + 0.2 / 0.96_f64.sqrt() * phase.sin()));
    // The chord instead of the arc.
    assert!((turned - exact).abs() < 0.02, "{turned} {exact}");
}
