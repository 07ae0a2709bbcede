#![cfg(feature = "sim")]
mod rig_support;
use magsteer::daemon::Verb;
use rig_support::{Bench, Setup};
#[test]
fn probe() {
    let hold = std::env::var("HOLD").is_ok();
    let mut setup = Setup::shipped("bigmag-planar.toml");
    if hold {
        setup.config.control.as_mut().unwrap().frame_angles = magsteer::control::FrameUse::Hold;
    }
    if std::env::var("EXACT").is_ok() {
        setup.plant.errors.modulus_relative = 0.0;
        setup.plant.errors.moment_relative = 0.0;
        setup.plant.errors.coil_gain_relative = 0.0;
    }
    let mut bench = Bench::new(&setup);
    bench.run(0.5, |_, _| ());
    bench.request(Verb::Arm);
    bench.run(0.5, |_, _| ());
    bench.request(Verb::Go);
    bench.run(0.1, |_, _| ());
    let seq = [(90., 90.), (70., 70.), (110., 70.), (80., 110.), (60., 90.)];
    for (a, b) in seq {
        let d = |deg: f64| {
            let (s, c) = f64::to_radians(deg).sin_cos();
            [s, 0.0, c]
        };
        let mut t = [[0.0; 3]; 8];
        t[0] = d(a);
        t[1] = d(b);
        bench.request(Verb::SetTarget(t));
        let mut n = 0;
        bench.run(3.0, |r, rig| {
            if n % 50 == 0 && (a, b) == (60., 90.) || n == 2990 {
                let tr = rig.plant().truth();
                let f = |q: [f64; 4]| { let [x, y, z, w] = q; [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)] };
                let (t1, t2) = (f(tr.magnets[0].orientation_xyzw), f(tr.magnets[1].orientation_xyzw));
                println!("{n:5} st {} phi {:6.1} {:6.1} y {:6.3} {:6.3} | pred {:6.1} {:6.1} y {:6.3} {:6.3} | des {:6.1} {:6.1} I {:?} th {:.2?} cond {:.0} res {:.1e} p {} conv {}", r.decision.state,
                    t1[2].acos().to_degrees(), t2[2].acos().to_degrees(), t1[1], t2[1],
                    r.outcome.predicted[0][2].acos().to_degrees(), r.outcome.predicted[1][2].acos().to_degrees(), r.outcome.predicted[0][1], r.outcome.predicted[1][1],
                    r.outcome.desired[0][2].acos().to_degrees(), r.outcome.desired[1][2].acos().to_degrees(),
                    r.input.measured.current_a[..6].iter().map(|x| (x*100.0).round()/100.0).collect::<Vec<_>>(), [r.input.measured.angle_rad[0].to_degrees(), r.input.measured.angle_rad[1].to_degrees()], r.outcome.condition, r.outcome.model.residual, r.outcome.model.passes, r.outcome.model.converged);
            }
            n += 1;
        });
    }
}
