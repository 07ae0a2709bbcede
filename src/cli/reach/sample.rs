//! Targets drawn ring by ring.

use magsteer::control::Directions;
use magsteer::control::plan::draw_direction;
use magsteer::math::{SplitMix, angle_between};
use nalgebra::Vector3;

/// Width of a ring, rad.
const RING: f64 = 15.0_f64.to_radians();

/// A target, and what it stands for.
#[derive(Debug, Clone)]
pub struct Sample {
    pub target: Directions,
    /// Angle of each magnet's direction from rest, rad.
    pub from_rest: Vec<f64>,
    /// Greatest angle between the directions of neighbouring magnets, rad; zero for one magnet.
    pub bend: f64,
    /// Outermost ring.
    pub ring: usize,
    pub weight: f64,
}

/// Edges of the rings of a cone, rad; one more than rings.
pub fn edges(cone: f64) -> Vec<f64> {
    let rings = (cone / RING - 1e-9).ceil().max(1.0) as usize;
    (0..=rings).map(|ring| (ring as f64 * RING).min(cone)).collect()
}

/// `count` samples in a cone about the rest directions of `magnets` magnets.
pub fn draw(rest: &Directions, magnets: usize, cone: f64, count: usize, seed: u64) -> Vec<Sample> {
    let edges = edges(cone);
    let rings = edges.len() - 1;
    let mut random = SplitMix::new(seed);
    let mut one = || {
        let mut sample = Sample {
            target: Directions::default(),
            from_rest: Vec::with_capacity(magnets),
            bend: 0.0,
            ring: 0,
            weight: 1.0,
        };
        for (magnet, axis) in rest.iter().enumerate().take(magnets) {
            let axis = Vector3::from(*axis);
            // Never the number of rings: a unit number is below 1.
            let ring = (random.unit() * rings as f64) as usize;
            let direction = draw_direction(&axis, [edges[ring], edges[ring + 1]], &mut random);
            let solid = |from: f64, to: f64| from.cos() - to.cos();
            sample.weight *= rings as f64 * solid(edges[ring], edges[ring + 1]) / solid(0.0, cone);
            sample.ring = sample.ring.max(ring);
            sample.from_rest.push(angle_between(&axis, &direction));
            sample.target[magnet] = direction.into();
        }
        for pair in sample.target[..magnets].windows(2) {
            let bend = angle_between(&Vector3::from(pair[0]), &Vector3::from(pair[1]));
            sample.bend = sample.bend.max(bend);
        }
        sample
    };
    (0..count).map(|_| one()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const REST: Directions = [[0.8, 0.0, -0.6]; magsteer_hal::MAGNETS_MAX];

    /// Goal: weights turn draws by rings into draws by solid angle: of a cone of 60 deg about two magnets, the inner one of 30 deg holds
    /// `((1 - cos 30) / (1 - cos 60))^2`.
    #[test]
    fn weights_stand_for_solid_angles() {
        let samples = draw(&REST, 2, 60.0_f64.to_radians(), 20_000, 3);
        let sum: f64 = samples.iter().map(|sample| sample.weight).sum();
        let inner: f64 = samples.iter().filter(|sample| sample.ring < 2).map(|sample| sample.weight).sum();
        let expected = ((1.0 - 30.0_f64.to_radians().cos()) / 0.5).powi(2);
        assert!((sum / 20_000.0 - 1.0).abs() < 0.03, "{sum}");
        assert!((inner / sum - expected).abs() < 0.05 * expected, "{}", inner / sum);
    }

    #[test]
    fn every_sample_lies_in_its_ring() {
        let edges = edges(40.0_f64.to_radians());
        assert_eq!(edges.len(), 4);
        for sample in draw(&REST, 2, 40.0_f64.to_radians(), 300, 5) {
            let farthest = sample.from_rest.iter().copied().fold(0.0, f64::max);
            let (least, most) = (edges[sample.ring] - 1e-9, edges[sample.ring + 1] + 1e-9);
            assert!((least..=most).contains(&farthest), "{farthest} in ring {}", sample.ring);
        }
    }
}
