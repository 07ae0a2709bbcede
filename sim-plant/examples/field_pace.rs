//! What the true field costs: nanoseconds a point for all six coils of BigMag, and for one coil of each kind.
//!
//! `cargo run --release -p magsteer-sim-plant --example field_pace`

#[path = "../src/fixture.rs"]
mod fixture;

use std::hint::black_box;
use std::time::Instant;

use magsteer_sim_plant::errors::CoilError;
use magsteer_sim_plant::field::{
    Axial, CoilArray, CoilTruth, Domain, Multipole, Saturation, Source, Table, Winding,
};
use nalgebra::Vector3;

/// Points of one measurement; the least of [`REPEATS`] measurements counts.
const POINTS: u32 = 100_000;
const REPEATS: u32 = 20;
const AIR_CORE: Winding = Winding { inner_radius: 0.045, outer_radius: 0.063, length: 0.043, turns: 642.0 };
const DOMAIN: Domain = Domain { x_min: 0.043, x_max: 0.152, r_max: 0.066 };

/// Least time of one call, ns.
fn nanoseconds(points: u32, mut call: impl FnMut(f64)) -> f64 {
    let measure = || {
        let start = Instant::now();
        for index in 0..points {
            call(f64::from(index) / f64::from(points));
        }
        start.elapsed().as_secs_f64() * 1e9 / f64::from(points)
    };
    std::iter::repeat_with(measure).take(REPEATS as usize).fold(f64::INFINITY, f64::min)
}

fn array(truths: [CoilTruth; 6]) -> CoilArray {
    let mut array = CoilArray::new(&fixture::bigmag(), &truths, &[CoilError::NONE; 6]);
    array.actuate(&[1.0, -2.0, 3.0, 0.5, -4.0, 2.5], &[0.3, -0.8]);
    array
}

fn one(source: &Source) -> f64 {
    let sample = |share: f64| -> Axial { source.at(0.05 + 0.08 * share, 0.002 * share) };
    nanoseconds(POINTS, |share| {
        black_box(sample(black_box(share)));
    })
}

fn main() {
    let series = [CoilTruth::Multipole(Saturation::None); 6];
    let mut shipped = [CoilTruth::Multipole(Saturation::Knee(12.5)); 6];
    shipped[4..].fill(CoilTruth::Winding(AIR_CORE));
    for (name, truths) in [("six series", series), ("four series, two windings", shipped)] {
        let array = array(truths);
        let each = nanoseconds(POINTS, |share| {
            let point = Vector3::new(0.02, -0.01, 0.015) * black_box(share);
            black_box(array.at(&point));
        });
        println!("{name}: {each:.0} ns a point");
    }
    let air = fixture::bigmag().coils[4].coefficients.clone();
    println!("one series: {:.0} ns", one(&Source::Multipole(Multipole::new(&air))));
    println!("one winding, table: {:.0} ns", one(&Source::winding(AIR_CORE, DOMAIN)));
    let sum = nanoseconds(POINTS / 100, |share| {
        black_box(AIR_CORE.at(0.05 + 0.08 * black_box(share), 0.04 * share));
    });
    println!("one winding, sum: {sum:.0} ns");
    let table = nanoseconds(1, |_| {
        black_box(Table::new(&AIR_CORE, DOMAIN));
    });
    println!("its table, made: {:.1} ms", table * 1e-6);
}
