//! How long a reconstruction of the rod's shape takes: `cargo bench -p magsteer-hal`.
//!
//! A rod of 60 mm with two magnets, bent into an arc in a tilted plane, seen by two cameras: points with 0.3
//! mm noise, a tenth of them outliers. *Cold* starts from the base, *warm* from the shape of the exposure
//! before, 3 degrees away at the tip.

use divan::{Bencher, black_box};
use magsteer_hal::description::{
    MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription,
};
use magsteer_hal::shape::{CentrelineKind, CloudSettings, CloudShape, CurvatureShape};

const NOISE: f64 = 0.3e-3;
const LENGTH: f64 = 60e-3;
const VIEWERS: [[f64; 3]; 2] = [[-0.05, -0.3, 0.1], [0.05, -0.3, 0.1]];
const ARCS: CentrelineKind = CentrelineKind::Curvature { degree: 2 };
const POLYNOMIAL: CentrelineKind = CentrelineKind::Polynomial { degree: 6 };

fn main() {
    divan::main();
}

#[divan::bench(args = [500, 1000, 2000, 4000])]
fn cold_curvature(bencher: Bencher, points: usize) {
    cold(bencher, ARCS, points);
}

#[divan::bench(args = [500, 1000, 2000, 4000])]
fn warm_curvature(bencher: Bencher, points: usize) {
    warm(bencher, ARCS, points);
}

#[divan::bench(args = [2000])]
fn cold_polynomial(bencher: Bencher, points: usize) {
    cold(bencher, POLYNOMIAL, points);
}

#[divan::bench(args = [2000])]
fn warm_polynomial(bencher: Bencher, points: usize) {
    warm(bencher, POLYNOMIAL, points);
}

#[divan::bench]
fn fibre_of_100_stations(bencher: Bencher) {
    let stations: Vec<f64> = (0..100).map(|index| LENGTH * (f64::from(index) + 0.5) / 100.0).collect();
    let mut shape = CurvatureShape::new(&manipulator(), &stations).expect("sound");
    let readings = [[10.0, 20.0, 3.0]; 100];
    bencher.bench_local(|| shape.reconstruct(black_box(&readings)).expect("a shape"));
}

fn cold(bencher: Bencher, kind: CentrelineKind, points: usize) {
    let cloud = cloud(15.0, points, 1);
    let mut shape = shape(kind);
    bencher.bench_local(|| {
        shape.forget();
        shape.reconstruct(black_box(&cloud)).expect("a shape")
    });
}

fn warm(bencher: Bencher, kind: CentrelineKind, points: usize) {
    let clouds = [cloud(15.0, points, 1), cloud(16.0, points, 2)];
    let mut shape = shape(kind);
    shape.reconstruct(&clouds[1]).expect("a shape");
    let mut turn = 0;
    bencher.bench_local(|| {
        turn = 1 - turn;
        shape.reconstruct(black_box(&clouds[turn])).expect("a shape")
    });
}

fn shape(kind: CentrelineKind) -> CloudShape {
    let manipulator = manipulator();
    let settings = CloudSettings::new(kind, &manipulator, NOISE, &VIEWERS);
    CloudShape::new(&manipulator, settings).expect("sound")
}

fn manipulator() -> ManipulatorDescription {
    let section = PartDescription::Section(SectionDescription {
        length: 25e-3,
        radius: 1.5e-3,
        bending_stiffness: 2e-5,
        torsion_stiffness: 1.5e-5,
        extensible: None,
        mass_per_length: 7e-3,
        precurvature: [0.0; 3],
    });
    let magnet = PartDescription::Magnet(MagnetDescription {
        name: "m".to_owned(),
        length: 5e-3,
        radius: 2e-3,
        mass: 4.7e-4,
        moment_body: [0.0, 0.0, 0.065],
    });
    ManipulatorDescription {
        base_position: [-0.055, 0.0, 0.0],
        base_rotation: [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
        parts: vec![section.clone(), magnet.clone(), section, magnet],
    }
}

/// Uniform in [0, 1), by the golden ratio of 64 bits: Steele, Lea and Flood's SplitMix64, 2014.
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The half facing -y and z of a rod in an arc of `curvature` (1/m) that leaves x towards (0, 0.6, -0.8),
/// less its ends.
fn cloud(curvature: f64, points: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = Uniform(seed);
    let outliers = points / 10;
    (0..points)
        .map(|index| {
            if index < outliers {
                return [0.06, 0.03, 0.06].map(|width| (random.next() - 0.5) * width);
            }
            let s = LENGTH * random.next();
            let (sine, cosine) = (curvature * s).sin_cos();
            let (along, aside) = (sine / curvature, (1.0 - cosine) / curvature);
            let is_magnet = (0.025..0.03).contains(&s) || s > 0.055;
            let radius = if is_magnet { 2e-3 } else { 1.5e-3 };
            // Across the tangent: in the plane of the arc, and out of it.
            let angle = (random.next() - 0.5) * 2.6;
            let (up, out) = (radius * angle.sin(), radius * angle.cos());
            let mut noise = || (0..12).map(|_| random.next()).sum::<f64>() - 6.0;
            [
                -0.055 + along + up * sine + NOISE * noise(),
                0.6 * (aside - up * cosine) - 0.8 * out + NOISE * noise(),
                -0.8 * (aside - up * cosine) - 0.6 * out + NOISE * noise(),
            ]
        })
        .collect()
}
