//! Which targets a rig can take, whatever the way there.

use magsteer_hal::HardwareDescription;

use crate::control::{Directions, ReferenceTarget};

/// How far from 1 a norm may be: looser than any rounding on the way here, tight enough that a forgotten normalisation shows.
const NORM_TOLERANCE: f64 = 1e-3;

/// What the targets of one rig must keep.
#[derive(Debug, Clone)]
pub(super) struct TargetRules {
    magnets: usize,
    /// Least and greatest angle of each frame, rad.
    angles: Vec<(f64, f64)>,
}

impl TargetRules {
    pub(super) fn new(rig: &HardwareDescription) -> Self {
        Self {
            magnets: rig.magnets().count(),
            angles: rig.frames.iter().map(|frame| (frame.angle_min, frame.angle_max)).collect(),
        }
    }

    /// The target with its directions normalised; `None` when the rig cannot take it.
    pub(super) fn usable(&self, target: &ReferenceTarget) -> Option<ReferenceTarget> {
        let directions = self.unit_directions(&target.directions)?;
        let mut angles = target.frame_angles.iter().flat_map(|angles| angles.iter().zip(&self.angles));
        // Not a number lies in no range.
        let within = angles.all(|(angle, (least, most))| (least..=most).contains(&angle));
        within.then_some(ReferenceTarget { directions, ..*target })
    }

    /// The directions normalised; `None` unless there is one finite unit vector a magnet.
    fn unit_directions(&self, directions: &Directions) -> Option<Directions> {
        let mut units = Directions::default();
        for (unit, direction) in units.iter_mut().zip(directions).take(self.magnets) {
            let norm = direction.iter().map(|component| component * component).sum::<f64>().sqrt();
            // Not a number lies in no range.
            if !(1.0 - NORM_TOLERANCE..=1.0 + NORM_TOLERANCE).contains(&norm) {
                return None;
            }
            *unit = direction.map(|component| component / norm);
        }
        Some(units)
    }
}
