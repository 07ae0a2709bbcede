//! The rod's centre line as a polyline, for pictures.

use nalgebra::Vector3;

use super::manipulator::{Manipulator, Part};
use super::pass::Pass;

/// A point of the centre line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Position, m, world.
    pub position: Vector3<f64>,
    /// Tangent, unit, world.
    pub tangent: Vector3<f64>,
    /// Index of the magnet that the stretch before this station is part of; `None` in a section.
    pub magnet: Option<usize>,
}

impl Manipulator {
    /// The centre line at the mesh's points, as of the last pass: the clamp, then the end of every step and of every
    /// magnet. Allocates.
    #[must_use]
    pub fn shape(&self, pass: &Pass) -> Vec<Station> {
        let start = &pass.states[0];
        let mut stations = vec![Station {
            position: start.position.into(),
            tangent: start.frame.tangent.into(),
            magnet: None,
        }];
        let mut magnets = 0;
        for (index, part) in self.parts.iter().enumerate() {
            match part {
                Part::Section(section) => {
                    section.trace(&pass.states[index], pass.gravity, |position, tangent| {
                        let (position, tangent) = (position.into(), tangent.into());
                        stations.push(Station { position, tangent, magnet: None });
                    })
                }
                Part::Magnet(_) => {
                    let end = &pass.states[index + 1];
                    stations.push(Station {
                        position: end.position.into(),
                        tangent: end.frame.tangent.into(),
                        magnet: Some(magnets),
                    });
                    magnets += 1;
                }
            }
        }
        stations
    }
}
