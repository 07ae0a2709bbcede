//! The loop of a driver: everything that must not be forgotten, around the hardware of one rig.
//!
//! Implement [`Device`], call [`run`]. The loop takes commands, judges them ([`CommandGuard`]), hands set
//! points that keep every limit to the device, and publishes what the device measured. When commands cease
//! it ramps to zero; when told to stop it takes no more commands, ramps to zero and ends.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use crate::channels::{ChannelError, DriverEnd, Endpoint};
use crate::description::HardwareDescription;
use crate::guard::{CommandGuard, Setpoint};
use crate::message::{Actuation, CoilFeedback, POSE_PARAMETERS_MAX, PoseMessage, driver_state};
use crate::time::Stamp;

/// After it was told to stop: a ramp that takes longer is cut.
const END_MAX: Duration = Duration::from_secs(3);

/// What a device measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// When.
    pub stamp: Stamp,
    /// Currents, A, and angles, rad, in the order of the description.
    pub actuation: Actuation,
    /// The device's own fault code, 0 for none; any other cuts the amplifiers.
    pub fault: u32,
}

/// Amplifiers, motors and sensors of a rig. Nothing here may wait.
pub trait Device {
    /// Amplifiers and motors must follow these currents, A, and angles, rad, from now on, `period_s` after
    /// the former call; they keep every limit already.
    fn follow(&mut self, setpoint: &Actuation, period_s: f64);

    /// Takes the current away at once; asked again each cycle while the rig is disabled.
    fn cut(&mut self);

    /// The newest measurement since the former call; `None` publishes nothing, for which the daemon stops in
    /// time.
    fn measure(&mut self) -> Option<Measurement>;

    /// The newest poses since the former call, with their count and the source stamp of their exposure.
    fn poses(&mut self) -> Option<PoseMessage>;
}

/// What a run came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Cycles of the loop.
    pub cycles: u64,
    /// Commands refused for any reason.
    pub commands_refused: u64,
    /// Commands that broke a current or slew limit.
    pub limit_breaks: u64,
    /// Messages that the transport refused.
    pub messages_unsent: u64,
    /// Longest delay of a wake-up behind its deadline.
    pub lateness_max: Duration,
}

/// Becomes the rig's driver and runs `device` every `period` until `stop` is set and no current is commanded.
///
/// # Errors
/// When the rig has a driver already, or the transport fails.
pub fn run(
    description: &HardwareDescription,
    endpoint: &Endpoint,
    device: &mut impl Device,
    period: Duration,
    stop: &AtomicBool,
) -> Result<Summary, ChannelError> {
    let mut end = DriverEnd::create(endpoint)?;
    let mut cycle = Cycle {
        guard: CommandGuard::new(description, &[0.0; POSE_PARAMETERS_MAX]),
        before: Stamp::now(),
        has_angles: false,
        description,
        messages_unsent: 0,
    };
    let mut summary = Summary {
        cycles: 0,
        commands_refused: 0,
        limit_breaks: 0,
        messages_unsent: 0,
        lateness_max: Duration::ZERO,
    };
    let mut deadline = Stamp::now();
    let mut stopped: Option<Stamp> = None;
    loop {
        let due = deadline.after(period);
        deadline = next_deadline(deadline, period);
        thread::sleep(deadline.since(Stamp::now()));
        let now = Stamp::now();
        summary.lateness_max = summary.lateness_max.max(now.since(due));
        if stop.load(Ordering::Relaxed) {
            stopped.get_or_insert(now);
        }
        cycle.step(&mut end, device, now, stopped.is_none());
        summary.cycles += 1;
        let Some(since) = stopped.map(|since| now.since(since)) else { continue };
        if cycle.is_currentless() || since > END_MAX {
            device.cut();
            summary.commands_refused = cycle.guard.refusals().total();
            summary.limit_breaks = cycle.guard.limit_breaks();
            summary.messages_unsent = cycle.messages_unsent;
            return Ok(summary);
        }
    }
}

/// The first deadline after now on the grid of `period`: a late process skips whole periods, it never bursts.
fn next_deadline(deadline: Stamp, period: Duration) -> Stamp {
    let behind = Stamp::now().since(deadline).as_nanos() / period.as_nanos().max(1);
    let periods = u32::try_from(behind).unwrap_or(u32::MAX).saturating_add(1);
    deadline.after(period.saturating_mul(periods))
}

struct Cycle<'a> {
    description: &'a HardwareDescription,
    guard: CommandGuard,
    before: Stamp,
    /// True once the frames' angles were measured.
    has_angles: bool,
    messages_unsent: u64,
}

impl Cycle<'_> {
    fn step(&mut self, end: &mut DriverEnd, device: &mut impl Device, now: Stamp, takes_commands: bool) {
        let measurement = device.measure();
        if let Some(measurement) = &measurement {
            self.take_over(measurement);
        }
        // Before the first measurement nobody knows where the frames stand.
        if let Some(command) = end.take_command(now)
            && takes_commands
            && self.has_angles
        {
            // The guard counts what it refuses and says so in the feedback.
            let _ = self.guard.offer(&command, now);
        }
        let period = now.since(self.before).as_secs_f64();
        self.before = now;
        let setpoint = self.guard.setpoint(now, period);
        if matches!(setpoint, Setpoint::Disable(_)) {
            device.cut();
        } else if self.has_angles {
            device.follow(setpoint.actuation(), period);
        }
        if let Some(measurement) = measurement {
            let mut feedback = CoilFeedback {
                measured: measurement.actuation,
                fault: measurement.fault,
                ..CoilFeedback::default()
            };
            feedback.header.source_stamp_ns = measurement.stamp.nanoseconds();
            self.guard.report(&mut feedback);
            let sent = end.publish_feedback(feedback, Stamp::now());
            self.messages_unsent += u64::from(sent.is_err());
        }
        if let Some(poses) = device.poses() {
            let sent = end.publish_pose(poses, Stamp::now());
            self.messages_unsent += u64::from(sent.is_err());
        }
    }

    /// Takes the first measured angles for those that the frames hold; a fault cuts.
    fn take_over(&mut self, measurement: &Measurement) {
        if !self.has_angles {
            self.has_angles = true;
            self.guard = CommandGuard::new(self.description, &measurement.actuation.angle_rad);
        }
        if measurement.fault != 0 && self.guard.state() != driver_state::DISABLED {
            self.guard.trip();
        }
    }

    fn is_currentless(&mut self) -> bool {
        let now = Stamp::now();
        let setpoint = self.guard.setpoint(now, 0.0);
        self.guard.state() != driver_state::DRIVEN
            && setpoint.actuation().current_a.iter().all(|current| *current == 0.0)
    }
}
