//! Goal: what each kind of sensor says of the magnets against the plant's truth, over the rests of the planar
//! experiment and out-of-plane shapes, held to the table in `docs/sensing.md`.

#[path = "../src/fixture.rs"]
mod fixture;
mod sensing_support;
mod validation;

use std::time::Duration;

use magsteer_hal::shape::CentrelineKind;
use magsteer_hal::{Actuation, Stamp};
use magsteer_sim_plant::sensing::{
    FibreCharacter, Occlusion, PoseSensor, SensorSettings, StereoCharacter, Timing, TrackerCharacter,
};
use magsteer_sim_plant::{Plant, PlantConfig};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sensing_support::stereo;
use validation::{Row, hold};

const PERIOD: Duration = Duration::from_millis(10);
const TIMING: Timing = Timing { period: PERIOD, latency: Duration::ZERO, dropout_probability: 0.0 };

/// Targets of the planar experiment, deg from z, and the currents (A) with which the closed loop holds a
/// plant without parameter errors there; without (110, 70), which does not rest when nobody steers.
const PLANAR: [([f64; 2], [f64; 6]); 6] = [
    ([90.0, 90.0], [-0.467, 0.679, 0.536, -0.610, 0.026, -0.084]),
    ([70.0, 70.0], [-1.334, 0.822, 0.656, -1.807, 0.127, 0.458]),
    ([80.0, 110.0], [0.402, 2.233, -0.406, -2.324, 0.594, -0.824]),
    ([60.0, 90.0], [1.167, 1.797, 0.528, -2.623, 0.602, -1.270]),
    ([90.0, 60.0], [-2.159, 0.166, 0.476, 0.976, -0.356, 0.689]),
    ([90.0, 120.0], [0.079, 2.229, -0.569, -1.534, 0.439, -0.626]),
];
/// Out-of-plane shapes.
const BENT_ASIDE: usize = 14;

fn rest_at(rest: &Plant, currents: [f64; 6], angles: [f64; 2]) -> Option<Plant> {
    let mut actuation = Actuation::default();
    actuation.current_a[..6].copy_from_slice(&currents);
    actuation.angle_rad[..2].copy_from_slice(&angles);
    let mut plant = rest.clone();
    plant.settle_at(&actuation).then_some(plant)
}

/// The rests of the planar experiment.
fn planar(rest: &Plant) -> Vec<Plant> {
    let plants = PLANAR.map(|(targets, currents)| {
        let ramp = (1..=8).map(|part| currents.map(|current| current * f64::from(part) / 8.0));
        let plant =
            ramp.fold(rest.clone(), |plant, currents| rest_at(&plant, currents, [0.0; 2]).expect("rests"));
        for (magnet, target) in plant.truth().magnets.iter().zip(targets) {
            let angle = magnet.tangent()[2].acos().to_degrees();
            // Other parameters of the field or the rod may move the rests somewhat.
            assert!((angle - target).abs() < 5.0, "{angle} instead of {target}");
        }
        plant
    });
    plants.into()
}

/// Rests at random currents and frame angles, within 60 degrees of the unloaded direction.
fn aside(rest: &Plant) -> Vec<Plant> {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut plants = Vec::new();
    while plants.len() < BENT_ASIDE {
        let currents = [0; 6].map(|_| random.random_range(-3.0..3.0));
        let angles = [0; 2].map(|_| random.random_range(-0.9..0.9));
        let Some(plant) = rest_at(rest, currents, angles) else { continue };
        if plant.truth().magnets[..2].iter().all(|magnet| magnet.tangent()[0] > 0.5) {
            plants.push(plant);
        }
    }
    plants
}

/// What a sensor said of both magnets, over many exposures.
#[derive(Default)]
struct Accuracy {
    exposures: f64,
    /// Messages with a magnet that is not seen.
    refused: f64,
    /// Of m1, m2.
    seen: [f64; 2],
    angle_squares: [f64; 2],
    distance_squares: [f64; 2],
}

impl Accuracy {
    fn of(settings: &SensorSettings, plants: &[Plant], exposures: u64) -> Self {
        let mut accuracy = Self::default();
        let description = fixture::bigmag();
        for (seed, plant) in (100..).zip(plants) {
            let mut sensor = PoseSensor::new(settings, &description.manipulator, seed, Stamp::default())
                .expect("a sensor for this rod");
            let mut now = Stamp::default();
            for _ in 0..exposures {
                now = now.after(PERIOD);
                sensor.expose(plant.rod(), now);
                accuracy.take(&sensor.take_due(now).expect("without latency"), plant);
            }
        }
        accuracy
    }

    fn take(&mut self, message: &magsteer_hal::PoseMessage, plant: &Plant) {
        let truth = plant.truth();
        self.exposures += 1.0;
        let pairs = message.magnets.iter().zip(&truth.magnets).take(2);
        self.refused += f64::from(u8::from(pairs.clone().any(|(seen, _)| seen.valid == 0)));
        for (index, (seen, truth)) in pairs.enumerate().filter(|(_, (seen, _))| seen.valid == 1) {
            let angle = Vector3::from(seen.tangent()).angle(&Vector3::from(truth.tangent()));
            self.seen[index] += 1.0;
            self.angle_squares[index] += angle.to_degrees().powi(2);
            let apart = Vector3::from(seen.position_m) - Vector3::from(truth.position_m);
            self.distance_squares[index] += apart.norm_squared() * 1e6;
        }
    }

    /// RMS tangent error of a magnet, deg.
    fn tangent(&self, magnet: usize) -> f64 {
        (self.angle_squares[magnet] / self.seen[magnet]).sqrt()
    }

    /// RMS distance of a magnet, mm.
    fn distance(&self, magnet: usize) -> f64 {
        (self.distance_squares[magnet] / self.seen[magnet]).sqrt()
    }

    /// Rows of both tangents.
    fn tangents(&self, rows: &mut Vec<Row>, what: &str, bars: [f64; 2]) {
        for (magnet, bar) in bars.into_iter().enumerate() {
            rows.push(Row::new(
                format!("{what}: tangent of m{}", magnet + 1),
                self.tangent(magnet),
                bar,
                "deg",
            ));
        }
    }
}

fn cloud(character: StereoCharacter) -> SensorSettings {
    SensorSettings::Stereo(TIMING, character)
}

/// Goal: the bar of 0.7 degrees at both magnets, with 0.3 mm noise, 10 % outliers and 20 % of the rod hidden,
/// and what each other condition costs.
#[test]
fn point_cloud_meets_its_bar_on_planar_and_bent_shapes() {
    let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
    let rest = config.build(&fixture::bigmag()).expect("valid");
    let (planar, aside) = (planar(&rest), aside(&rest));
    let all: Vec<Plant> = planar.iter().chain(&aside).cloned().collect();
    let mut rows = Vec::new();
    let shipped = cloud(stereo());
    for (name, plants) in [("planar rests", &planar), ("out of plane", &aside)] {
        let found = Accuracy::of(&shipped, plants, 40);
        found.tangents(&mut rows, &format!("camera, {name}"), [0.7, 0.7]);
        rows.push(Row::new(format!("camera, {name}: position of m2"), found.distance(1), 0.1, "mm"));
        let refused = found.refused / found.exposures;
        rows.push(Row::new(format!("camera, {name}: messages with a magnet not seen"), refused, 0.03, ""));
    }
    let open = StereoCharacter { occlusion: Occlusion::Random { share: 0.0 }, ..stereo() };
    Accuracy::of(&cloud(open.clone()), &all, 15).tangents(&mut rows, "camera, nothing hidden", [0.7, 0.7]);
    let middle = StereoCharacter { occlusion: Occlusion::Fixed { share: 0.2, from: 0.36 }, ..stereo() };
    Accuracy::of(&cloud(middle), &all, 15).tangents(&mut rows, "camera, m1 and about it hidden", [0.7, 0.7]);
    let tip = StereoCharacter { occlusion: Occlusion::Fixed { share: 0.2, from: 0.8 }, ..stereo() };
    let found = Accuracy::of(&cloud(tip), &all, 15);
    rows.push(Row::new("camera, m2 and before it hidden: tangent of m1", found.tangent(0), 0.7, "deg"));
    let passes = found.seen[1] / found.exposures;
    rows.push(Row::new("camera, m2 and before it hidden: m2 passes for seen", passes, 0.01, ""));
    let deep = StereoCharacter { noise_depth: 0.6e-3, ..stereo() };
    Accuracy::of(&cloud(deep), &all, 15).tangents(&mut rows, "camera, 0.6 mm in depth", [1.0, 1.4]);
    for degree in [6, 8] {
        let centreline = CentrelineKind::Polynomial { degree };
        let character = StereoCharacter {
            centreline,
            tangent_deviation_max: std::f64::consts::FRAC_PI_2,
            ..open.clone()
        };
        let name = format!("camera, polynomial of degree {degree}, nothing hidden");
        Accuracy::of(&cloud(character), &all, 15).tangents(&mut rows, &name, [1.5, 2.5]);
    }
    others(&mut rows, &all);
    hold("sensing.md", "accuracy", &rows);
}

/// The tracker and the fibre on the same shapes.
fn others(rows: &mut Vec<Row>, plants: &[Plant]) {
    let tracker = TrackerCharacter { orientation_noise: 0.2_f64.to_radians(), position_noise: 1e-4 };
    let found = Accuracy::of(&SensorSettings::Tracker(TIMING, tracker), plants, 40);
    // Two tilts, three coordinates.
    found.tangents(rows, "tracker", [0.2 * 1.5, 0.2 * 1.5]);
    rows.push(Row::new("tracker: position of m2", found.distance(1), 0.1 * 1.8, "mm"));
    let fibre = FibreCharacter { stations: 100, noise: 0.5, offset: 0.3, measures_twist: true };
    let found = Accuracy::of(&SensorSettings::Fibre(TIMING, fibre), plants, 40);
    found.tangents(rows, "fibre", [0.3, 0.5]);
    rows.push(Row::new("fibre: position of m2", found.distance(1), 0.3, "mm"));
    let noiseless = FibreCharacter { noise: 0.0, offset: 0.0, ..fibre };
    let exact = Accuracy::of(&SensorSettings::Fibre(TIMING, noiseless), plants, 1);
    exact.tangents(rows, "fibre without noise", [0.1, 0.1]);
}
