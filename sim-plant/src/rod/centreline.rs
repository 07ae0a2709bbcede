//! The rod between its bodies: pose and curvature at any arc length.
//!
//! Arc length counts along the unstretched rod from the base. Within a body the rod is straight. Within an
//! element it is that of constant curvature `phi / h` which the element's strains mean: the rotation a share
//! `x` along it is `R_i exp(x phi)`, and the position the cubic that meets both ends with their tangents, off
//! the arc by `h phi^4 / 384 / 4` (1e-9 m for ten degrees an element of 2.5 mm).

use nalgebra::{UnitQuaternion, Vector3};

use super::chain::Pose;
use super::dynamics::Rod;
use super::rotation::{exponential, logarithm};

/// A place in the chain.
enum Place {
    /// At `offset` (m) along the tangent of a rigid pose.
    Rigid { pose: Pose, offset: f64 },
    /// At the share `x` of element `index` between two ends.
    Elastic { index: usize, x: f64, left: Pose, right: Pose },
}

impl Rod {
    /// Pose of the centreline at the arc length `s` (m); base or tip when it lies beyond.
    #[must_use]
    pub fn centreline_pose(&self, s: f64) -> Pose {
        match self.place(s) {
            Place::Rigid { pose, offset } => Pose { position: pose.along(offset), ..pose },
            Place::Elastic { x, left, right, .. } => {
                let turn = logarithm(&(left.rotation.inverse() * right.rotation));
                let chord = right.position - left.position;
                // Slopes as long as the arc, stretched as the chord is.
                let arc = chord.norm() * (1.0 + turn.norm_squared() / 24.0);
                let slopes = [left, right].map(|end| tangent(&end.rotation) * arc);
                let along = hermite(x, &chord, &slopes);
                Pose { position: left.position + along, rotation: left.rotation * exponential(&(turn * x)) }
            }
        }
    }

    /// Curvature about body x and y and twist about the tangent at the arc length `s` (m), 1/m; zero in
    /// magnets.
    #[must_use]
    pub fn centreline_curvature(&self, s: f64) -> Vector3<f64> {
        match self.place(s) {
            Place::Rigid { .. } => Vector3::zeros(),
            Place::Elastic { index, .. } => {
                self.strains[index].moment_like + self.chain.elements[index].precurvature
            }
        }
    }

    fn place(&self, s: f64) -> Place {
        let base = self.chain.base;
        let mut start = (self.chain.clamp.position - base.position).norm();
        if s < start || self.chain.elements.is_empty() {
            return Place::Rigid { pose: base, offset: s.clamp(0.0, start) };
        }
        let mut left = self.chain.clamp;
        for (index, element) in self.chain.elements.iter().enumerate() {
            let (body, pose) = (&self.chain.bodies[index], self.motions[index].pose);
            let into = s - start;
            if into < element.length {
                let right = Pose { position: pose.along(body.proximal), ..pose };
                return Place::Elastic { index, x: into / element.length, left, right };
            }
            start += element.length;
            let rigid = body.distal - body.proximal;
            let is_last = index + 1 == self.chain.elements.len();
            if s - start < rigid || is_last {
                return Place::Rigid { pose, offset: body.proximal + (s - start).min(rigid) };
            }
            start += rigid;
            left = Pose { position: pose.along(body.distal), ..pose };
        }
        Place::Rigid { pose: left, offset: 0.0 }
    }
}

fn tangent(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    rotation * Vector3::z()
}

/// The cubic from zero to `chord` with two end slopes.
fn hermite(x: f64, chord: &Vector3<f64>, slopes: &[Vector3<f64>; 2]) -> Vector3<f64> {
    let rest = 1.0 - x;
    chord * (x * x * (3.0 - 2.0 * x)) + slopes[0] * (x * rest * rest) - slopes[1] * (x * x * rest)
}

#[cfg(test)]
mod tests {
    use super::super::{Meshing, Rod, Stepping};
    use super::*;
    use crate::field::Field;
    use crate::fixture;

    /// BigMag's rod at rest under gravity, bent sideways by a uniform field on its magnets.
    fn bent() -> Rod {
        let description = fixture::bigmag();
        let meshing = Meshing { element_length_max: 2.5e-3 };
        let stepping = Stepping { step: 5e-4, retardation: 0.0 };
        let mut rod = Rod::new(&description.manipulator, description.gravity, meshing, stepping);
        let field = Field { flux: Vector3::new(0.0, 4e-3, 3e-3), ..Field::zero() };
        assert!(rod.settle(|_| field));
        rod
    }

    #[test]
    fn magnets_and_tip_lie_on_the_centreline() {
        let rod = bent();
        for (pose, s) in
            [(rod.magnet_pose(0), 27.5e-3), (rod.magnet_pose(1), 57.5e-3), (rod.tip_pose(), 60e-3)]
        {
            let found = rod.centreline_pose(s);
            assert!((found.position - pose.position).norm() < 1e-12, "{s}");
            assert!(found.rotation.angle_to(&pose.rotation) < 1e-7, "{s}");
        }
        assert_eq!(rod.centreline_pose(-1.0).position, Vector3::new(-0.055, 0.0, 0.0));
        assert!((rod.centreline_pose(1.0).position - rod.tip_pose().position).norm() < 1e-12);
    }

    #[test]
    fn centreline_runs_along_its_tangent_at_unit_speed() {
        let rod = bent();
        let step = 1e-5;
        for index in 1..5999 {
            let s = step * f64::from(index);
            let slope = (rod.centreline_pose(s + step).position - rod.centreline_pose(s - step).position)
                / (2.0 * step);
            // Axial stretch under the weight, shear of the elements, and the rotation over a step.
            let tangent = tangent(&rod.centreline_pose(s).rotation);
            assert!((slope - tangent).norm() < 3e-3, "{s}: {}", (slope - tangent).norm());
        }
    }

    #[test]
    fn curvature_is_the_rate_at_which_the_frame_turns_and_none_in_magnets() {
        let rod = bent();
        for s in [1e-3, 0.0115, 0.024, 0.0312, 0.0506] {
            let step = 1e-6;
            let (before, after) = (rod.centreline_pose(s - step), rod.centreline_pose(s + step));
            let rate = logarithm(&(before.rotation.inverse() * after.rotation)) / (2.0 * step);
            let found = rod.centreline_curvature(s);
            assert!((rate - found).norm() < 1e-6 * found.norm() + 1e-6, "{s}: {rate} {found}");
            assert!(found.norm() > 0.5, "bent at {s}");
        }
        assert_eq!(rod.centreline_curvature(27e-3), Vector3::zeros());
    }
}
