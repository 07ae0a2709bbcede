//! Frames that steer, in lockstep.
#![cfg(feature = "sim")]

mod rig_support;

use magsteer::control::Directions;
use magsteer::daemon::lockstep::{PlayEnd, TimedTarget};
use magsteer::math::orthonormal_complement;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig_support::{Bench, Setup};
use std::ops::ControlFlow;

fn targets(rest: &Directions, cone_deg: f64, count: usize) -> Vec<Directions> {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut draw = |about: &[f64; 3]| -> [f64; 3] {
        let about = Vector3::from(*about);
        let cosine = 1.0 - random.random::<f64>() * (1.0 - cone_deg.to_radians().cos());
        let azimuth = random.random::<f64>() * std::f64::consts::TAU;
        let [first, second] = orthonormal_complement(&about);
        let across = first * azimuth.cos() + second * azimuth.sin();
        (about * cosine + across * (1.0 - cosine * cosine).sqrt()).into()
    };
    (0..count)
        .map(|_| {
            let mut directions = Directions::default();
            directions[0] = draw(&rest[0]);
            directions[1] = draw(&rest[1]);
            directions
        })
        .collect()
}

fn number(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|word| word.parse().ok()).unwrap_or(default)
}

#[test]
#[ignore = "a survey"]
fn survey() {
    let mut setup = Setup::shipped("bigmag-3d.toml");
    let control = setup.config.control.as_mut().unwrap();
    control.determinant_wanted = number("MARGIN", control.determinant_wanted);
    control.determinant_rate_per_s = number("MRATE", control.determinant_rate_per_s);
    control.current_release_per_s = number("RELEASE", control.current_release_per_s);
    control.reference_speed_max_deg_per_s = number("SPEED", control.reference_speed_max_deg_per_s);
    control.damping = number("DAMPING", control.damping);
    let secondary = control.secondary.as_mut().unwrap();
    secondary.conditioning_max_deg_per_s = number("COND", secondary.conditioning_max_deg_per_s);
    secondary.frame_centering_per_s = number("CENT", secondary.frame_centering_per_s);
    secondary.frame_share_deg = number("SHARE", secondary.frame_share_deg);
    secondary.disturbance_deg = number("EPS", secondary.disturbance_deg);
    if number("HOLD", 0.0) > 0.0 {
        control.frame_angles = magsteer::control::FrameUse::Hold;
    }
    let home = [number("BOTTOM", 45.0), number("TOP", 67.5)];
    for (name, angle) in ["bottom", "top"].iter().zip(home) {
        secondary.frame_home_deg.insert((*name).to_owned(), angle);
        setup.plant.motor.start_deg.as_mut().unwrap().insert((*name).to_owned(), angle);
    }
    let (theta1, theta2) = (110.8_f64.to_radians(), 115.4_f64.to_radians());
    let mut rest = Directions::default();
    rest[0] = [theta1.sin(), 0.0, theta1.cos()];
    rest[1] = [theta2.sin(), 0.0, theta2.cos()];
    let count = number("COUNT", 50.0) as usize;
    let (mut settled, mut stopped) = (0, 0);
    for (index, directions) in targets(&rest, number("CONE", 30.0), count).into_iter().enumerate() {
        let mut bench = Bench::new(&setup);
        let step = TimedTarget { target: directions.into(), duration: number("STAY", 6.0) };
        let mut last = None;
        let mut margin = f64::INFINITY;
        let mut worst_accel = 0.0_f64;
        let mut before: Option<([f64; 2], [f64; 2])> = None;
        let played = bench.lockstep.play(
            &[step],
            |rig| rig.plant().truth(),
            |seen| {
                margin = margin.min(seen.record.outcome.model.margin);
                let now = [seen.record.admitted.angle_rad[0], seen.record.admitted.angle_rad[1]];
                if let Some((angle, speed)) = before {
                    let next = [0, 1].map(|f| (now[f] - angle[f]) / 1e-3);
                    for f in 0..2 {
                        worst_accel = worst_accel.max(((next[f] - speed[f]) / 1e-3).abs());
                    }
                    before = Some((now, next));
                } else {
                    before = Some((now, [0.0; 2]));
                }
                last = Some((seen.record.admitted, seen.record.outcome.model, seen.record.outcome.condition));
                ControlFlow::Continue(())
            },
        );
        let (admitted, model, condition) = last.unwrap();
        let response = &played.steps[0].response;
        let ok = response.settled_s.is_some();
        settled += usize::from(ok);
        stopped += usize::from(played.end != PlayEnd::Complete);
        println!(
            "{index}: settled {:?} rms {:.2?} I max {:.2} end {:.1?} frames {:.1} {:.1} margin {:.2} min {:.2} cond {:.1} accel {:.0} {:?}",
            response.settled_s,
            response.error_rms_deg,
            response.current_max_a,
            &admitted.current_a[..6],
            admitted.angle_rad[0].to_degrees(),
            admitted.angle_rad[1].to_degrees(),
            model.margin,
            margin,
            condition,
            worst_accel.to_degrees(),
            played.end
        );
    }
    println!("settled {settled} of {count}, stopped {stopped}");
}
