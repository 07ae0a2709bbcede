//! A harness for a driver that runs elsewhere, behind the channels, in real time.
//!
//! Time passes by sleeping. A driver takes the newest command once a cycle and tells of it in the message
//! after that; so a step of the suite ends with the second message after it began.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::harness::{Heard, Rig, Spoil, StatedRates};
use super::trial::CYCLE;
use crate::channels::{ChannelError, Endpoint, ProbeEnd};
use crate::description::HardwareDescription;
use crate::gate::{AdmittedCommand, Authority, Gate};
use crate::hardware::{Hardware, Reading, Sensed, WriteError};
use crate::message::{CoilFeedback, PoseMessage, driver_state};
use crate::receive::{FeedbackReceiver, PoseReceiver};
use crate::time::Stamp;

/// Between two looks at the channels.
const LOOK: Duration = Duration::from_micros(500);
/// A driver that publishes nothing for so long has fallen silent.
const SILENCE_MAX: Duration = Duration::from_millis(1_000);
/// How many messages show that a command was taken.
const MESSAGES: u32 = 2;
/// How long the way to zero may take at the end, beyond validity, slew and settling, before the amplifiers
/// are cut.
const END_MAX: Duration = Duration::from_millis(500);
/// How long the amplifiers may take to lose their current once cut.
const CUT_MAX: Duration = Duration::from_millis(500);

/// What the suite allows for on a real rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Of measured currents, as part of each coil's greatest.
    pub current_share: f64,
    /// Of measured angles, rad.
    pub angle: f64,
    /// How long currents may take to follow set points that stand still.
    pub settling: Duration,
    /// How long angles may.
    pub angle_settling: Duration,
    /// How long each command of the suite stays good; longer than the machine stops a process now and then.
    pub validity: Duration,
}

impl Tolerances {
    /// For the coils of `description`: 2 % of each greatest current, five of the longest electrical time
    /// constants to settle; half a degree and two seconds for frames; commands that stay good for 250 ms.
    #[must_use]
    pub fn of(description: &HardwareDescription) -> Self {
        const TIME_CONSTANTS: f64 = 5.0;
        let constants = description.coils.iter().map(|coil| coil.inductance / coil.resistance);
        let longest = constants.fold(0.0, f64::max);
        Self {
            current_share: 0.02,
            angle: 0.5_f64.to_radians(),
            settling: Duration::try_from_secs_f64(TIME_CONSTANTS * longest).unwrap_or_default(),
            angle_settling: Duration::from_secs(2),
            validity: Duration::from_millis(250),
        }
    }
}

/// How a rig was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// Idle or disabled, every current at zero.
    AtZero,
    /// Current flows, or nothing is heard any more.
    NotAtZero,
}

/// [`Hardware`] over the channels, as of the end of the latest step.
#[derive(Debug)]
pub struct RunningHardware {
    end: ProbeEnd,
    pose: PoseReceiver,
    feedback: FeedbackReceiver,
    sensed: Sensed,
    heard: Heard,
    /// In whose name commands were sent.
    authorities: Vec<Authority>,
    newest_authority: Option<Authority>,
    /// Longest time between two messages of the driver, as this process saw them.
    longest_gap: Duration,
    last_feedback: Stamp,
}

impl RunningHardware {
    fn note_write(&mut self, authority: Authority) {
        if self.authorities.last() != Some(&authority) {
            self.authorities.retain(|known| known.epoch != authority.epoch);
            self.authorities.push(authority);
        }
        self.newest_authority = Some(authority);
    }

    /// Takes everything that arrived.
    fn pump(&mut self) {
        let Self { end, pose, feedback, sensed, heard, longest_gap, last_feedback, .. } = self;
        end.drain(
            Stamp::now(),
            |message| {
                // Its own moment for each: one may be published while another is taken.
                let now = Stamp::now();
                let reading = feedback.receive(Some(message), now);
                let fresh = sensed.feedback.fresh || reading.fresh;
                sensed.feedback = Reading { fresh, ..reading };
                *longest_gap = (*longest_gap).max(now.since(*last_feedback));
                *last_feedback = now;
                heard.feedback.push((*message, now));
            },
            |message| {
                let now = Stamp::now();
                let reading = pose.receive(Some(message), now);
                let fresh = sensed.pose.fresh || reading.fresh;
                sensed.pose = Reading { fresh, ..reading };
                heard.poses.push((*message, now));
            },
        );
    }
}

impl Hardware for RunningHardware {
    fn read(&mut self, _now: Stamp) -> Sensed {
        let sensed = self.sensed;
        self.sensed.pose.fresh = false;
        self.sensed.feedback.fresh = false;
        sensed
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        self.note_write(command.authority());
        self.end.send(command, now, |_| ())
    }
}

/// A driver that runs elsewhere. When dropped, every authority taken is given up.
#[derive(Debug)]
pub struct RunningRig {
    description: HardwareDescription,
    hardware: RunningHardware,
    tolerances: Tolerances,
    rates: StatedRates,
    interrupted: Arc<AtomicBool>,
}

impl RunningRig {
    /// Takes the daemon's place on the rig and waits up to `wait` for its driver. The suite ends early, by
    /// the same way to zero, once `interrupted` is set.
    ///
    /// # Errors
    /// When the rig has a daemon, no driver appears in time, or the transport fails.
    pub fn open(
        endpoint: &Endpoint,
        description: HardwareDescription,
        tolerances: Tolerances,
        rates: StatedRates,
        wait: Duration,
        interrupted: Arc<AtomicBool>,
    ) -> Result<Self, ChannelError> {
        let end = ProbeEnd::open(endpoint, &description, wait)?;
        let now = Stamp::now();
        let hardware = RunningHardware {
            end,
            pose: PoseReceiver::new(&description),
            feedback: FeedbackReceiver::new(&description),
            sensed: Sensed { pose: Reading::never(), feedback: Reading::never() },
            heard: Heard::default(),
            authorities: Vec::new(),
            newest_authority: None,
            longest_gap: Duration::ZERO,
            last_feedback: now,
        };
        Ok(Self { description, hardware, tolerances, rates, interrupted })
    }

    /// Gives up every authority, waits until no current is left, and cuts the amplifiers when that takes too
    /// long.
    pub fn end(&mut self) -> Ending {
        // What only listened leaves no current behind.
        let Some(last) = self.hardware.newest_authority else { return Ending::AtZero };
        self.release_all();
        let slew = self.description.coils.iter().map(|coil| coil.current_max / coil.slew_max);
        let ramp = Duration::try_from_secs_f64(slew.fold(0.0, f64::max)).unwrap_or_default();
        let time = self.tolerances.validity + ramp + self.tolerances.settling + END_MAX;
        if self.is_at_zero_within(time) {
            return Ending::AtZero;
        }
        let mut gate = Gate::new(&self.description);
        for authority in self.hardware.authorities.iter().copied().chain([last]).collect::<Vec<_>>() {
            let cut = gate.disable(authority);
            // One that cannot be sent leaves the others to try.
            let _ = self.hardware.write(&cut, Stamp::now());
            self.advance(CYCLE);
        }
        if self.is_at_zero_within(CUT_MAX) { Ending::AtZero } else { Ending::NotAtZero }
    }

    fn is_at_zero_within(&mut self, time: Duration) -> bool {
        let start = Stamp::now();
        loop {
            self.advance(CYCLE);
            let feedback = self.hardware.sensed.feedback.last;
            let is_at_zero = feedback.is_some_and(|feedback| {
                feedback.state != driver_state::DRIVEN
                    && (0..self.description.coils.len())
                        .all(|coil| feedback.measured.current_a[coil].abs() <= self.current_tolerance(coil))
            });
            if is_at_zero || Stamp::now().since(start) > time {
                return is_at_zero;
            }
        }
    }
}

impl Drop for RunningRig {
    fn drop(&mut self) {
        self.release_all();
    }
}

impl Rig for RunningRig {
    type H = RunningHardware;

    fn hardware(&mut self) -> &mut RunningHardware {
        &mut self.hardware
    }

    fn description(&self) -> &HardwareDescription {
        &self.description
    }

    fn now(&self) -> Stamp {
        Stamp::now()
    }

    fn advance(&mut self, duration: Duration) {
        // Whoever waited since the former step took its time elsewhere.
        self.hardware.pump();
        let start = Stamp::now();
        let mut last = self.hardware.heard.feedback.len();
        let mut messages = 0;
        loop {
            thread::sleep(LOOK);
            self.hardware.pump();
            let now = Stamp::now();
            for (feedback, _) in &self.hardware.heard.feedback[last..] {
                messages += u32::from(feedback.header.publish_stamp_ns > start.nanoseconds());
            }
            last = self.hardware.heard.feedback.len();
            if now.since(start) >= duration && messages >= MESSAGES {
                return;
            }
            if now.since(start) > duration + SILENCE_MAX {
                // Neither what was heard before nor a message of a clock of its own is the present.
                self.hardware.sensed.feedback = Reading::never();
                return;
            }
        }
    }

    fn inject_pose(&mut self, _message: PoseMessage) -> bool {
        false
    }

    fn inject_feedback(&mut self, _message: CoilFeedback) -> bool {
        false
    }

    fn send_spoilt(&mut self, command: &AdmittedCommand, spoil: Spoil<'_>) -> bool {
        let now = Stamp::now();
        self.hardware.note_write(command.authority());
        self.hardware.end.send(command, now, |message| spoil(message, now)).is_ok()
    }

    fn heard(&mut self) -> Option<Heard> {
        Some(std::mem::take(&mut self.hardware.heard))
    }

    fn stated_rates(&self) -> StatedRates {
        self.rates
    }

    fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }

    fn was_held_up(&mut self) -> bool {
        let gap = std::mem::take(&mut self.hardware.longest_gap);
        gap * 4 > self.tolerances.validity
    }

    fn release_all(&mut self) {
        let mut gate = Gate::new(&self.description);
        for authority in self.hardware.authorities.clone() {
            let release = gate.release(authority);
            // What does not arrive lapses.
            let _ = self.hardware.write(&release, Stamp::now());
            // The driver takes the newest alone: it is to see each.
            self.advance(CYCLE);
        }
        // One that the driver did not obey stays known until the end.
        let held =
            self.hardware.sensed.feedback.last.filter(|feedback| feedback.state == driver_state::DRIVEN);
        self.hardware.authorities.retain(|known| held.is_some_and(|held| held.accepted_epoch == known.epoch));
    }

    fn starts_silent(&self) -> bool {
        false
    }

    fn current_tolerance(&self, coil: usize) -> f64 {
        self.description.coils.get(coil).map_or(0.0, |coil| coil.current_max * self.tolerances.current_share)
    }

    fn angle_tolerance(&self) -> f64 {
        self.tolerances.angle
    }

    fn settling(&self) -> Duration {
        self.tolerances.settling
    }

    fn angle_settling(&self) -> Duration {
        self.tolerances.angle_settling
    }

    fn validity(&self) -> Duration {
        self.tolerances.validity
    }
}
