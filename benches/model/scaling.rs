//! How the exact pass and the control cycle grow with magnets and coils.

use divan::black_box;
use magsteer::config::Config;
use magsteer::control::{Cycle, CycleInput, Directions, Step};
use magsteer::magnetics::CoilArray;
use magsteer::rod::{Pass, PassMode, TipLoad};
use magsteer_hal::{Actuation, MagnetPose, PoseMessage};

use crate::subjects::{ANGLES, CURRENTS, enlarged, load};
use crate::turns::{Timed, medians, timed};

const TURNS: usize = 300;
const MAGNETS: [usize; 4] = [2, 4, 6, 8];
const COILS: [usize; 5] = [6, 8, 14, 20, 32];

/// Prints both tables.
pub fn report() {
    table("pass, us", |magnets, coils| pass(&enlarged(magnets, coils)));
    table("control cycle, steering, us", |magnets, coils| cycle(&enlarged(magnets, coils)));
}

fn table(title: &str, subject: impl Fn(usize, usize) -> Timed) {
    let mut calls: Vec<Timed> =
        MAGNETS.iter().flat_map(|magnets| COILS.map(|coils| subject(*magnets, coils))).collect();
    let times = medians(&mut calls, TURNS);
    print!("\n{title:<34}");
    COILS.iter().for_each(|coils| print!("{:>9}", format!("{coils} coils")));
    println!("   beside a straight line");
    for (row, magnets) in times.chunks(COILS.len()).zip(MAGNETS) {
        print!("{:<34}", format!("{magnets} magnets, 2 frames"));
        row.iter().for_each(|time| print!("{:>9.2}", time * 1e6));
        println!("   {:.0} %", 100.0 * bend(&COILS.map(|coils| coils as f64), row));
    }
    print!("{:<34}", "beside a straight line");
    for column in 0..COILS.len() {
        let times: Vec<f64> = times.chunks(COILS.len()).map(|row| row[column]).collect();
        print!("{:>9}", format!("{:.0} %", 100.0 * bend(&MAGNETS.map(|magnets| magnets as f64), &times)));
    }
    let largest = times[times.len() - 1];
    println!("\n8 magnets and 32 coils: {:.1} kHz on one core.", 1e-3 / largest);
}

/// Greatest distance from the least-squares line, as a share of the greatest value.
fn bend(x: &[f64], y: &[f64]) -> f64 {
    let count = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / count, y.iter().sum::<f64>() / count);
    let slope = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>()
        / x.iter().map(|x| (x - mean_x).powi(2)).sum::<f64>();
    let off = x.iter().zip(y).map(|(x, y)| (y - mean_y - slope * (x - mean_x)).abs());
    off.fold(0.0, f64::max) / y.iter().copied().fold(0.0, f64::max)
}

fn pass(config: &Config) -> Timed {
    let manipulator = config.manipulator.clone().expect("has a model");
    let posed = CoilArray::new(&config.description).posed(&ANGLES);
    let mut pass = Pass::new(&manipulator);
    let found = manipulator.solve_from_rest(
        &posed.actuated(&CURRENTS),
        &TipLoad::NONE,
        PassMode::default(),
        &mut pass,
    );
    assert!(found.converged(), "{found:?}");
    let unknowns = pass.unknowns();
    timed(move || {
        let field = black_box(&posed).actuated(black_box(&CURRENTS));
        manipulator.pass(&field, &TipLoad::NONE, black_box(&unknowns), PassMode::default(), &mut pass);
        black_box(&pass);
    })
}

/// Steers towards directions beside those of rest, currents wandering as a closed loop's do.
fn cycle(config: &Config) -> Timed {
    let control = load("bigmag-planar.toml").control.expect("has a controller");
    let manipulator = config.manipulator.clone().expect("has a model");
    let mut cycle = Cycle::new(&control, &config.description, manipulator);
    let coils = config.description.coils.len();
    let target = {
        let rest = cycle.step(&input(Actuation::default(), Directions::default(), false)).predicted;
        let mut target = rest;
        for direction in &mut target {
            // By some 6 degrees.
            direction[2] += 0.1;
        }
        target
    };
    let mut number = 0_u32;
    let mut converged = 0_u32;
    for _ in 0..200 {
        number += 1;
        converged += u32::from(cycle.step(&input(wandering(coils, number), target, true)).model.converged);
    }
    assert!(converged > 190, "{converged} of 200");
    timed(move || {
        number = number.wrapping_add(1);
        black_box(cycle.step(black_box(&input(wandering(coils, number), target, true))));
    })
}

/// Up to 0.02 A in each coil, 1 Hz, begun gently: 32 coils in one place pull strongly together.
fn wandering(coils: usize, number: u32) -> Actuation {
    let mut actuation = Actuation::default();
    for (index, current) in actuation.current_a[..coils].iter_mut().enumerate() {
        let gently = f64::from(number.min(100)) / 100.0;
        *current = 0.02 * gently * (f64::from(number) * 6e-3 + index as f64).sin();
    }
    actuation
}

fn input(present: Actuation, target: Directions, engaged: bool) -> CycleInput {
    // Tangents along x.
    let along_x = std::f64::consts::FRAC_1_SQRT_2;
    let pose =
        MagnetPose { orientation_xyzw: [0.0, along_x, 0.0, along_x], valid: 1, ..MagnetPose::default() };
    CycleInput {
        period: 1e-3,
        pose: Some(PoseMessage { magnet_count: 8, magnets: [pose; 8], ..PoseMessage::default() }),
        pose_is_fresh: true,
        pose_age: 5e-3,
        measured: present,
        admitted: present,
        target: target.into(),
        engaged,
    }
}
