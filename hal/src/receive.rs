//! What every receiver of poses and feedback checks before use, field by field. Pure state, no transport.
//!
//! A message is copied out of shared memory first and judged then: its sender can write any bits. One that fails
//! a check is reported in [`Reading::refused`] and never replaces [`Reading::last`].

use std::time::Duration;

use crate::description::{HardwareDescription, Workspace};
use crate::hardware::{Absent, Reading};
use crate::message::{
    COILS_MAX, CoilFeedback, Header, MAGNETS_MAX, MagnetPose, POSE_PARAMETERS_MAX, PoseMessage, SCHEMA,
    driver_state,
};
use crate::send::count;
use crate::time::Stamp;

/// How far a stamp may lie ahead of the receiver's clock: both read one clock, but not at one instant.
pub const FUTURE_TOLERANCE: Duration = Duration::from_millis(1);

/// How far a quaternion's norm may lie off 1; within it is normalised at receipt.
pub const QUATERNION_NORM_TOLERANCE: f64 = 1e-3;

/// A magnet is believed up to so many radii of the workspace from its centre. What left the workspace by less
/// is for the field model's range to judge; what lies further off is a sensor's mistake.
pub const POSITION_RADII_MAX: f64 = 2.0;

/// A message that begins with the common header.
trait Headed: Copy {
    fn header(&self) -> &Header;
}

impl Headed for PoseMessage {
    fn header(&self) -> &Header {
        &self.header
    }
}

impl Headed for CoilFeedback {
    fn header(&self) -> &Header {
        &self.header
    }
}

/// The accepted messages of one channel: the last one, and their order.
#[derive(Debug, Clone)]
struct Track<M> {
    last: Option<M>,
    restarts: u64,
}

impl<M: Headed> Track<M> {
    const fn new() -> Self {
        Self { last: None, restarts: 0 }
    }

    fn check(&self, header: &Header, now: Stamp) -> Result<(), Absent> {
        if header.schema != SCHEMA {
            return Err(Absent::Schema { expected: SCHEMA, actual: header.schema });
        }
        let latest = header.source_stamp_ns.max(header.publish_stamp_ns);
        if latest > now.after(FUTURE_TOLERANCE).nanoseconds() {
            return Err(Absent::FutureStamp { ahead_ns: latest - now.nanoseconds() });
        }
        if header.valid_until_ns != 0 && now.nanoseconds() >= header.valid_until_ns {
            return Err(Absent::Expired { late_ns: now.nanoseconds() - header.valid_until_ns });
        }
        match self.last.as_ref().map(Headed::header) {
            Some(last) if header.sequence == 0 => Err(Absent::Sequence { last: last.sequence, actual: 0 }),
            Some(last) if last.epoch == header.epoch && header.sequence <= last.sequence => {
                Err(Absent::Sequence { last: last.sequence, actual: header.sequence })
            }
            Some(last) if last.epoch != header.epoch && header.publish_stamp_ns < last.publish_stamp_ns => {
                Err(Absent::FormerEpoch { last: last.epoch, actual: header.epoch })
            }
            None if header.sequence == 0 => Err(Absent::Sequence { last: 0, actual: 0 }),
            _ => Ok(()),
        }
    }

    /// The reading that follows from what was judged, if anything arrived.
    fn take(&mut self, judged: Option<Result<M, Absent>>) -> Reading<M> {
        let (fresh, refused) = match judged {
            None => (false, None),
            Some(Ok(message)) => {
                let epoch = message.header().epoch;
                self.restarts += u64::from(self.last.is_some_and(|last| last.header().epoch != epoch));
                self.last = Some(message);
                (true, None)
            }
            Some(Err(absent)) => (false, Some(absent)),
        };
        Reading { last: self.last, fresh, refused }
    }

    /// The reading when the transport failed to deliver.
    const fn failed(&self) -> Reading<M> {
        Reading { last: self.last, fresh: false, refused: Some(Absent::Transport) }
    }
}

/// Checks received poses.
#[derive(Debug, Clone)]
pub struct PoseReceiver {
    magnet_count: u32,
    workspace: Workspace,
    track: Track<PoseMessage>,
}

impl PoseReceiver {
    /// A receiver for the magnets of `description`.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        let magnet_count = count(description.magnets().count(), MAGNETS_MAX);
        Self { magnet_count, workspace: description.workspace.clone(), track: Track::new() }
    }

    /// The reading at `now`, given the newest message received since the former one, if any.
    pub fn receive(&mut self, message: Option<&PoseMessage>, now: Stamp) -> Reading<PoseMessage> {
        let judged = message.map(|message| self.judge(message, now));
        self.track.take(judged)
    }

    /// The reading when the transport failed to deliver.
    #[must_use]
    pub const fn failed(&self) -> Reading<PoseMessage> {
        self.track.failed()
    }

    /// How often the sender was followed by another one (its epoch changed).
    #[must_use]
    pub const fn restarts(&self) -> u64 {
        self.track.restarts
    }

    /// The message as it may be used: checked, unit quaternions, unused entries zero.
    fn judge(&self, message: &PoseMessage, now: Stamp) -> Result<PoseMessage, Absent> {
        self.track.check(&message.header, now)?;
        check_count("magnets", self.magnet_count, message.magnet_count)?;
        let mut usable = PoseMessage {
            header: message.header,
            magnet_count: message.magnet_count,
            ..PoseMessage::default()
        };
        let used = self.magnet_count as usize;
        for (index, (pose, checked)) in message.magnets.iter().zip(&mut usable.magnets).take(used).enumerate()
        {
            *checked = usable_pose(pose, &self.workspace, count(index, MAGNETS_MAX))?;
        }
        Ok(usable)
    }
}

fn usable_pose(pose: &MagnetPose, workspace: &Workspace, index: u32) -> Result<MagnetPose, Absent> {
    match pose.valid {
        0 => return Err(Absent::NotSeen { magnet: index }),
        1 => (),
        _ => return Err(Absent::Implausible { what: "valid flag", index }),
    }
    let offsets = pose.position_m.iter().zip(&workspace.center).map(|(value, center)| value - center);
    let distance = offsets.map(|offset| offset * offset).sum::<f64>().sqrt();
    // Written so that a distance that is not a number is refused too.
    let near = distance <= POSITION_RADII_MAX * workspace.radius;
    if !near {
        return Err(Absent::Implausible { what: "position", index });
    }
    let norm = pose.orientation_xyzw.iter().map(|value| value * value).sum::<f64>().sqrt();
    // Written so that a norm that is not a number is refused too.
    let unit = (norm - 1.0).abs() <= QUATERNION_NORM_TOLERANCE;
    if !unit {
        return Err(Absent::Implausible { what: "quaternion", index });
    }
    let orientation_xyzw = pose.orientation_xyzw.map(|value| value / norm);
    Ok(MagnetPose { orientation_xyzw, reserved: 0, ..*pose })
}

/// Checks received feedback.
#[derive(Debug, Clone)]
pub struct FeedbackReceiver {
    coil_count: u32,
    pose_parameter_count: u32,
    fingerprint: u64,
    track: Track<CoilFeedback>,
}

impl FeedbackReceiver {
    /// A receiver for the coils and frames of `description`.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        Self {
            coil_count: count(description.coils.len(), COILS_MAX),
            pose_parameter_count: count(description.frames.len(), POSE_PARAMETERS_MAX),
            fingerprint: description.fingerprint(),
            track: Track::new(),
        }
    }

    /// The reading at `now`, given the newest message received since the former one, if any.
    pub fn receive(&mut self, message: Option<&CoilFeedback>, now: Stamp) -> Reading<CoilFeedback> {
        let judged = message.map(|message| self.judge(message, now));
        self.track.take(judged)
    }

    /// The reading when the transport failed to deliver.
    #[must_use]
    pub const fn failed(&self) -> Reading<CoilFeedback> {
        self.track.failed()
    }

    /// How often the sender was followed by another one (its epoch changed).
    #[must_use]
    pub const fn restarts(&self) -> u64 {
        self.track.restarts
    }

    fn judge(&self, message: &CoilFeedback, now: Stamp) -> Result<CoilFeedback, Absent> {
        self.track.check(&message.header, now)?;
        let (expected, actual) = (self.fingerprint, message.description_fingerprint);
        if actual != expected {
            return Err(Absent::Description { expected, actual });
        }
        check_count("coils", self.coil_count, message.coil_count)?;
        check_count("frames", self.pose_parameter_count, message.pose_parameter_count)?;
        if message.state > driver_state::DISABLED {
            return Err(Absent::Implausible { what: "state code", index: 0 });
        }
        let latest = message.answered_pose_stamp_ns.max(message.answer_received_stamp_ns);
        if latest > now.after(FUTURE_TOLERANCE).nanoseconds() {
            return Err(Absent::Implausible { what: "receipt stamp", index: 0 });
        }
        let (coils, frames) = (self.coil_count as usize, self.pose_parameter_count as usize);
        check_finite("current", &message.measured.current_a[..coils])?;
        check_finite("angle", &message.measured.angle_rad[..frames])?;
        let mut usable = *message;
        usable.measured.current_a[coils..].fill(0.0);
        usable.measured.angle_rad[frames..].fill(0.0);
        Ok(usable)
    }
}

fn check_count(what: &'static str, expected: u32, actual: u32) -> Result<(), Absent> {
    if actual == expected { Ok(()) } else { Err(Absent::Count { what, expected, actual }) }
}

fn check_finite(what: &'static str, values: &[f64]) -> Result<(), Absent> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(Absent::Implausible { what, index: count(index, COILS_MAX) }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
