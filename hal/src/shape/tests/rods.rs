//! Rods of known shape, and clouds of their surface.

use nalgebra::Vector3;

use crate::description::{MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription};
use crate::seeded::Seeded;

pub(super) const NOISE: f64 = 0.3e-3;
pub(super) const VIEWERS: [[f64; 3]; 2] = [[-0.05, -0.3, 0.1], [0.05, -0.3, 0.1]];

fn section(length: f64) -> PartDescription {
    PartDescription::Section(SectionDescription {
        length,
        radius: 1.5e-3,
        bending_stiffness: 2e-5,
        torsion_stiffness: 1.5e-5,
        extensible: None,
        mass_per_length: 7e-3,
        precurvature: [0.0; 3],
    })
}

fn magnet(length: f64) -> PartDescription {
    PartDescription::Magnet(MagnetDescription {
        name: "m".to_owned(),
        length,
        radius: 2e-3,
        mass: 4.7e-4,
        moment_body: [0.0, 0.0, 0.065],
    })
}

/// Two sections, two magnets, 60 mm, along x from (-55, 0, 0) mm: body x is down, body y is y.
pub(super) fn manipulator() -> ManipulatorDescription {
    ManipulatorDescription {
        base_position: [-0.055, 0.0, 0.0],
        base_rotation: [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
        parts: vec![section(25e-3), magnet(5e-3), section(25e-3), magnet(5e-3)],
    }
}

/// A section between two short magnets: nearly all of it bends.
pub(super) fn plain() -> ManipulatorDescription {
    ManipulatorDescription { parts: vec![section(60e-3)], ..manipulator() }
}

/// A rod as finely integrated points.
pub(super) struct Truth {
    pub position: Vec<Vector3<f64>>,
    pub tangent: Vec<Vector3<f64>>,
    radius: Vec<f64>,
    length: f64,
}

/// Steps of the integration.
const STEPS: usize = 6000;

impl Truth {
    /// Integrates `curvature(s)` (about body x, body y and twist, 1/m), which magnets do not follow. Rotates
    /// the three body axes by the midpoint rule, with another formula than the code under test: 1e-5 m steps
    /// leave 1e-9.
    pub fn of(manipulator: &ManipulatorDescription, curvature: impl Fn(f64) -> [f64; 3]) -> Self {
        let mut ends = Vec::new();
        let mut length = 0.0;
        for part in &manipulator.parts {
            let (own, radius, bends) = match part {
                PartDescription::Section(section) => (section.length, section.radius, true),
                PartDescription::Magnet(magnet) => (magnet.length, magnet.radius, false),
            };
            length += own;
            ends.push((length, radius, bends));
        }
        let step = length / STEPS as f64;
        let rows = manipulator.base_rotation;
        let mut axes = [0, 1, 2].map(|axis| Vector3::from(rows.map(|row| row[axis])));
        let mut at = Vector3::from(manipulator.base_position);
        let mut truth = Self { position: vec![at], tangent: vec![axes[2]], radius: vec![1.5e-3], length };
        for index in 0..STEPS {
            let s = (index as f64 + 0.5) * step;
            let (_, radius, bends) = ends.iter().copied().find(|(end, ..)| s < *end).expect("on the rod");
            let [x, y, twist] = if bends { curvature(s) } else { [0.0; 3] };
            let spin = axes[0] * x + axes[1] * y + axes[2] * twist;
            let half = axes.map(|axis| axis + spin.cross(&axis) * (0.5 * step));
            let spin = half[0] * x + half[1] * y + half[2] * twist;
            let middle = axes[2] + spin.cross(&axes[2]) * (0.5 * step);
            axes = axes.map(|axis| {
                let turned = axis + spin.cross(&(axis + spin.cross(&axis) * (0.5 * step))) * step;
                turned.normalize()
            });
            at += middle.normalize() * step;
            truth.position.push(at);
            truth.tangent.push(axes[2]);
            truth.radius.push(radius);
        }
        truth
    }

    pub fn at(&self, s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let index = (s / self.length * STEPS as f64).round() as usize;
        (self.position[index], self.tangent[index])
    }
}

/// How a cloud comes about.
#[derive(Clone, Copy)]
pub(super) struct Scene {
    pub points: usize,
    pub noise: f64,
    pub outliers: f64,
    /// Hidden part of the length, as shares.
    pub hidden: (f64, f64),
    pub seed: u64,
}

impl Scene {
    pub fn clean() -> Self {
        Self { points: 2000, noise: 0.0, outliers: 0.0, hidden: (0.0, 0.0), seed: 1 }
    }

    pub fn noisy(seed: u64) -> Self {
        Self { noise: NOISE, seed, ..Self::clean() }
    }

    /// Points on the surface that both viewers see, and outliers in a box 10 mm about the rod.
    pub fn of(&self, truth: &Truth) -> Vec<[f64; 3]> {
        let mut random = Seeded::new(self.seed);
        let mut points = Vec::new();
        let outliers = (self.outliers * self.points as f64) as usize;
        while points.len() < self.points - outliers {
            let share = random.unit();
            let index = (share * STEPS as f64) as usize;
            let (at, tangent) = (truth.position[index], truth.tangent[index]);
            let direction = Vector3::new(random.within(1.0), random.within(1.0), random.within(1.0));
            let Some(normal) = (direction - tangent * tangent.dot(&direction)).try_normalize(1e-3) else {
                continue;
            };
            let surface = at + normal * truth.radius[index];
            if VIEWERS.iter().any(|viewer| (Vector3::from(*viewer) - surface).dot(&normal) < 0.0) {
                continue;
            }
            let noise = Vector3::from([0; 3].map(|_| normal_number(&mut random))) * self.noise;
            // Hidden points are drawn and lost, as a camera loses them.
            if share < self.hidden.0 || share >= self.hidden.1 {
                points.push((surface + noise).into());
            } else {
                points.push([f64::NAN; 3]);
            }
        }
        let least = truth.position.iter().fold(truth.position[0], |least, at| least.inf(at));
        let most = truth.position.iter().fold(truth.position[0], |most, at| most.sup(at));
        for _ in 0..outliers {
            let at = [0, 1, 2].map(|k| least[k] - 0.01 + random.unit() * (most[k] - least[k] + 0.02));
            points.push(at);
        }
        points.retain(|point| point[0].is_finite());
        points
    }
}

/// Normal with deviation 1, of Irwin and Hall: twelve uniforms, less their mean.
fn normal_number(random: &mut Seeded) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}

/// Angle between a pose's tangent and the truth, deg.
pub(super) fn off_deg(tangent: [f64; 3], truth: Vector3<f64>) -> f64 {
    Vector3::from(tangent).angle(&truth).to_degrees()
}
