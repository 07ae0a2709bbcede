//! The energy ledger: what the coils put in is stored, or lost where the ledger says.

#[path = "../src/fixture.rs"]
mod fixture;
mod validation;

use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use magsteer_sim_plant::field::{CoilArray, Field};
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use nalgebra::Vector3;
use validation::Row;

/// The shipped step, mesh and damping of the plant.
const STEP: f64 = 5e-4;
const MESHING: Meshing = Meshing { element_length_max: 2.5e-3 };
const DAMPING_RATIO: f64 = 0.2;

/// The shipped rod at rest under gravity.
fn resting(step: f64, damping_ratio: f64) -> Rod {
    rod(&fixture::bigmag().manipulator, step, damping_ratio)
}

fn rod(manipulator: &ManipulatorDescription, step: f64, damping_ratio: f64) -> Rod {
    let gravity = fixture::bigmag().gravity;
    let undamped = Stepping { step, retardation: 0.0 };
    let mut rod = Rod::new(manipulator, gravity, MESHING, undamped);
    rod.set_magnet_interaction(true);
    assert!(rod.settle(|_| Field::zero()));
    let mode = rod.first_mode().expect("has mass");
    rod.set_stepping(Stepping { step, retardation: mode.retardation(damping_ratio) });
    rod
}

/// What ten driven seconds did.
struct Account {
    coils: f64,
    damping: f64,
    numerical: f64,
    stored: f64,
}

impl Account {
    /// What is missing, as a share of what came in.
    fn missing(&self) -> f64 {
        (self.coils - self.stored - self.damping - self.numerical) / self.coils
    }
}

/// Drives the rod for ten seconds by coil currents of an amplitude, each coil at its own pace, with the frames at angles.
fn drive(amplitude: f64, pace: f64, angles: [f64; 2], step: f64) -> Account {
    let mut array = CoilArray::as_described(&fixture::bigmag());
    let mut rod = resting(step, DAMPING_RATIO);
    let start = rod.energy().total();
    for index in 0..(10.0 / step) as u32 {
        let time = f64::from(index) * step;
        let currents: Vec<f64> =
            (0..6).map(|coil| amplitude * (time * pace * (3.0 + f64::from(coil))).sin()).collect();
        array.actuate(&currents, &angles);
        assert!(rod.step(|point| array.at(point)).converged);
    }
    let ledger = rod.ledger();
    let stored = rod.energy().total() - start;
    Account { coils: ledger.coils, damping: ledger.damping, numerical: ledger.numerical, stored }
}

#[test]
fn work_of_the_coils_is_stored_or_lost_where_the_ledger_says() {
    let mut rows = Vec::new();
    for (what, amplitude, pace, angles) in [
        ("slow waves of 0.8 A in the plane", 0.8, 1.0, [0.0, 0.0]),
        ("waves of 0.8 A in space, near the first modes", 0.8, 5.0, [0.8, -0.8]),
        ("waves of 3 A in space", 3.0, 2.0, [0.8, -0.8]),
    ] {
        let account = drive(amplitude, pace, angles, STEP);
        println!("{what}: {} J in, {} J stored", account.coils, account.stored);
        rows.push(Row::new(format!("missing, {what}"), 100.0 * account.missing(), 0.1, "%"));
        let share = 100.0 * account.numerical / account.coils;
        rows.push(Row::new(format!("numerical loss, {what}"), share, 1.0, "%"));
        assert!(account.coils > 0.0 && account.damping > 0.5 * account.coils);
    }
    validation::hold("rod.md", "energy", &rows);
}

#[test]
fn what_the_ledger_misses_falls_at_least_with_the_square_of_the_step() {
    let coarse = drive(3.0, 2.0, [0.8, -0.8], STEP).missing();
    let fine = drive(3.0, 2.0, [0.8, -0.8], STEP / 2.0).missing();
    println!("{coarse} {fine}");
    assert!(fine.abs() < 0.3 * coarse.abs(), "{coarse} {fine}");
}

#[test]
fn free_swing_of_magnets_that_feel_each_other_loses_what_the_ledger_says() {
    // Half as far apart as shipped, and released from a field that bends the rod between them.
    let mut manipulator = fixture::bigmag().manipulator;
    if let PartDescription::Section(section) = &mut manipulator.parts[2] {
        section.length = 10e-3;
    }
    let field = |_: &Vector3<f64>| Field { flux: Vector3::new(0.0, 15e-3, -20e-3), ..Field::zero() };
    let swing = |step: f64| {
        let mut rod = rod(&manipulator, step, 0.0);
        let rest = rod.energy();
        assert!(rod.settle(field));
        let start = rod.energy();
        let mut exchanged: f64 = 0.0;
        for _ in 0..(0.3 / step) as u32 {
            assert!(rod.step(|_| Field::zero()).converged);
            exchanged = exchanged.max((rod.energy().pairs - start.pairs).abs());
        }
        let swing = start.total() - rest.total();
        let missing = (start.total() - rod.energy().total() - rod.ledger().numerical) / swing;
        (missing, exchanged / swing)
    };
    let (coarse, exchanged) = swing(2.0 * STEP);
    let (fine, _) = swing(STEP);
    println!("missing {coarse} at 1 ms, {fine} at 0.5 ms; exchanged {exchanged}");
    assert!(exchanged > 0.01, "the magnets' own field must take part: {exchanged}");
    // One hundredth of what passes through the magnets' fields.
    assert!(coarse.abs().max(fine.abs()) < 0.01 * exchanged, "{coarse} {fine}");
}
