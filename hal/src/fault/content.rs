//! What stream faults do to the content of messages.

use crate::description::HardwareDescription;
use crate::limits::Limits;
use crate::message::{CoilFeedback, Header, MAGNETS_MAX, MagnetPose, PoseMessage};
use crate::seeded::Seeded;

use super::kinds::{Garbage, Part};

/// Finite, and nothing that a coil carries or a magnet reaches.
const HUGE: f64 = 1e300;

/// What is possible on the rig, for values that could be true.
#[derive(Debug, Clone)]
pub(super) struct Possible {
    pub(super) limits: Limits,
    magnet_count: usize,
    workspace_center: [f64; 3],
    workspace_radius: f64,
}

impl Possible {
    pub(super) fn new(description: &HardwareDescription) -> Self {
        Self {
            limits: Limits::new(description),
            magnet_count: description.magnets().count().min(MAGNETS_MAX),
            workspace_center: description.workspace.center,
            workspace_radius: description.workspace.radius,
        }
    }

    /// A current that the coil may carry, A.
    pub(super) fn current(&self, coil: usize, random: &mut Seeded) -> f64 {
        random.within(self.limits.current_max[coil])
    }

    /// An angle within the frame's range, rad.
    pub(super) fn angle(&self, frame: usize, random: &mut Seeded) -> f64 {
        let (least, most) = (self.limits.angle_min[frame], self.limits.angle_max[frame]);
        least + (most - least) * random.unit()
    }

    /// A point of the workspace and any orientation.
    fn pose(&self, random: &mut Seeded) -> MagnetPose {
        // A cube inside the sphere.
        let reach = self.workspace_radius / 3.0_f64.sqrt();
        let position_m = self.workspace_center.map(|center| center + random.within(reach));
        let orientation_xyzw = unit_quaternion(random);
        MagnetPose { position_m, orientation_xyzw, valid: 1, reserved: 0 }
    }
}

/// Uniform over all rotations (Shoemake, Graphics Gems III, 1992).
fn unit_quaternion(random: &mut Seeded) -> [f64; 4] {
    let (share, first, second) =
        (random.unit(), random.unit() * std::f64::consts::TAU, random.unit() * std::f64::consts::TAU);
    let (inner, outer) = ((1.0 - share).sqrt(), share.sqrt());
    [inner * first.sin(), inner * first.cos(), outer * second.sin(), outer * second.cos()]
}

/// A message whose content can go wrong, in whole or in part.
pub(super) trait Content: Copy {
    fn header(&self) -> &Header;
    fn header_mut(&mut self) -> &mut Header;
    /// Takes over the content of another message: one part, or everything but the header.
    fn take_content(&mut self, from: &Self, part: Option<Part>);
    /// One part is not seen, or reads zero.
    fn blank(&mut self, part: Part);
    /// One part, or every entry in use, is wrong.
    fn garble(&mut self, part: Option<Part>, kind: Garbage, possible: &Possible, random: &mut Seeded);
}

impl Content for PoseMessage {
    fn header(&self) -> &Header {
        &self.header
    }

    fn header_mut(&mut self) -> &mut Header {
        &mut self.header
    }

    fn take_content(&mut self, from: &Self, part: Option<Part>) {
        match part {
            Some(Part::Magnet(magnet)) => self.magnets[magnet] = from.magnets[magnet],
            _ => *self = Self { header: self.header, ..*from },
        }
    }

    fn blank(&mut self, part: Part) {
        if let Part::Magnet(magnet) = part {
            self.magnets[magnet] = MagnetPose::default();
        }
    }

    fn garble(&mut self, part: Option<Part>, kind: Garbage, possible: &Possible, random: &mut Seeded) {
        for (index, magnet) in self.magnets.iter_mut().enumerate().take(possible.magnet_count) {
            if part.is_some_and(|part| part != Part::Magnet(index)) {
                continue;
            }
            match kind {
                Garbage::Nan => {
                    (magnet.position_m, magnet.orientation_xyzw) = ([f64::NAN; 3], [f64::NAN; 4]);
                }
                Garbage::Huge => magnet.position_m = [HUGE; 3],
                Garbage::Quaternion => magnet.orientation_xyzw = [1.0; 4],
                Garbage::Random => *magnet = possible.pose(random),
            }
        }
    }
}

impl Content for CoilFeedback {
    fn header(&self) -> &Header {
        &self.header
    }

    fn header_mut(&mut self) -> &mut Header {
        &mut self.header
    }

    fn take_content(&mut self, from: &Self, part: Option<Part>) {
        let (own, other) = (&mut self.measured, &from.measured);
        match part {
            Some(Part::Coil(coil)) => own.current_a[coil] = other.current_a[coil],
            Some(Part::Frame(frame)) => own.angle_rad[frame] = other.angle_rad[frame],
            _ => *self = Self { header: self.header, ..*from },
        }
    }

    fn blank(&mut self, part: Part) {
        match part {
            Part::Coil(coil) => self.measured.current_a[coil] = 0.0,
            Part::Frame(frame) => self.measured.angle_rad[frame] = 0.0,
            Part::Magnet(_) => (),
        }
    }

    fn garble(&mut self, part: Option<Part>, kind: Garbage, possible: &Possible, random: &mut Seeded) {
        let meant = |candidate: Part| part.is_none_or(|part| part == candidate);
        for coil in (0..possible.limits.coil_count).filter(|coil| meant(Part::Coil(*coil))) {
            self.measured.current_a[coil] = match kind {
                Garbage::Nan => f64::NAN,
                Garbage::Huge => HUGE,
                Garbage::Quaternion | Garbage::Random => possible.current(coil, random),
            };
        }
        for frame in (0..possible.limits.frame_count).filter(|frame| meant(Part::Frame(*frame))) {
            self.measured.angle_rad[frame] = match kind {
                Garbage::Nan => f64::NAN,
                Garbage::Huge => HUGE,
                Garbage::Quaternion | Garbage::Random => possible.angle(frame, random),
            };
        }
    }
}
