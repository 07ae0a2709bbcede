#![cfg(feature = "sim")]
mod rig_support;
use magsteer::magnetics::CoilArray;
use magsteer::rod::{Pass, PassMode, TipLoad};
use nalgebra::{DMatrix, DVector, Vector3};
use rig_support::Setup;
#[test]
fn probe() {
    let setup = Setup::shipped("bigmag-planar.toml");
    let man = setup.config.manipulator.clone().unwrap();
    let array = CoilArray::new(&setup.config.description);
    let posed = array.posed(&[0.0, 0.0]);
    let mut pass = Pass::new(&man);
    let gamma: f64 = std::env::var("G").map(|g| g.parse().unwrap()).unwrap_or(0.02);
    let sgain: f64 = std::env::var("S").map(|g| g.parse().unwrap()).unwrap_or(0.0);
    let mut u = DVector::<f64>::zeros(6);
    let f = posed.actuated(u.as_slice());
    man.solve_from_rest(&f, &TipLoad::NONE, PassMode::default(), &mut pass);
    let mut xi = pass.unknowns();
    let solve = |u: &DVector<f64>, xi: &mut nalgebra::Vector6<f64>, pass: &mut Pass| -> bool {
        let f = posed.actuated(u.as_slice());
        let s = man.solve(&f, &TipLoad::NONE, xi, PassMode::default(), pass);
        if s.converged() {
            *xi = pass.unknowns();
        }
        s.converged()
    };
    let mut phi = [110.8_f64, 115.4];
    for goal in
        [(90., 90.), (70., 70.), (110., 70.), (80., 110.), (60., 90.), (90., 60.), (90., 120.), (90., 90.)]
    {
        let start = phi;
        let n = 400;
        for k in 1..=2 * n {
            let w = (k as f64 / n as f64).min(1.0);
            let d = [start[0] + w * (goal.0 - start[0]), start[1] + w * (goal.1 - start[1])];
            if !solve(&u, &mut xi, &mut pass) {
                println!("lost at {k} of {goal:?} det {}", pass.determinant());
                return;
            }
            let det0 = pass.determinant();
            let mut j = DMatrix::zeros(2, 6);
            let mut e = DVector::zeros(2);
            for m in 0..2 {
                let t: Vector3<f64> = pass.magnets()[m].tangent();
                let ph = t.x.atan2(t.z);
                let rows = pass.tangent_jacobian(m);
                for c in 0..6 {
                    j[(m, c)] = ph.cos() * rows[0][c] - ph.sin() * rows[2][c];
                }
                e[m] = d[m].to_radians() - ph;
                phi[m] = ph.to_degrees();
            }
            // gradient of det
            let mut grad = DVector::zeros(6);
            if sgain > 0.0 {
                for c in 0..6 {
                    let mut up = u.clone();
                    up[c] += 1e-4;
                    let mut x2 = xi;
                    let mut p2 = pass.clone();
                    solve(&up, &mut x2, &mut p2);
                    grad[c] = (p2.determinant() - det0) / 1e-4;
                }
            }
            let svd = j.clone().svd(true, true);
            let sv: Vec<f64> = svd.singular_values.iter().map(|s: &f64| s.to_degrees()).collect();
            let pinv = svd.pseudo_inverse(1e-9).unwrap();
            let null = DMatrix::identity(6, 6) - &pinv * &j;
            let push = if det0 < std::env::var("T").map(|t| t.parse::<f64>().unwrap()).unwrap_or(0.35) {
                sgain
            } else {
                0.0
            };
            u += &pinv * &e + &null * (&u * (-gamma) + grad * push);
            if k % 100 == 0 {
                println!(
                    "{goal:?} {k} phi {:.1} {:.1} det {:.3} |I| {:.2} {:.2?} sv {:.2?}",
                    phi[0],
                    phi[1],
                    det0,
                    u.amax(),
                    u.as_slice(),
                    sv
                );
            }
        }
    }
}
