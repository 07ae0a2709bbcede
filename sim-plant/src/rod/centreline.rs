//! The rod between its bodies: pose and curvature at any arc length.
//!
//! Arc length counts along the unstretched rod from the base. Within a body the rod is straight. Within an element it is
//! that of constant curvature `phi / h` which the element's strains mean: the rotation a share `x` along it is
//! `R_i exp(x phi)`, and the position the cubic that meets both ends with their tangents, off the arc by
//! `h phi^4 / 384 / 4` (1e-9 m for ten degrees an element of 2.5 mm).

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

    /// Curvature about body x and y and twist about the tangent at the arc length `s` (m), 1/m; zero in magnets.
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
