//! The clauses that need no command: what a driver publishes while nobody steers it.
//!
//! Every message is judged as it came, before any receiver could refuse it.

use std::time::Duration;

use super::clause::Clause;
use super::finding::{Outcome, found, not_tried};
use super::harness::{Heard, Rig};
use super::trial::{CYCLE, median_interval, milliseconds, require};
use crate::description::HardwareDescription;
use crate::hardware::Absent;
use crate::message::{CoilFeedback, Header, PoseMessage, SCHEMA, driver_state};
use crate::receive::{FeedbackReceiver, PoseReceiver};
use crate::time::Stamp;

/// How long the suite listens.
const LISTEN: Duration = Duration::from_millis(1_500);
/// Half of all intervals between messages must be shorter where no rate is stated.
const FEEDBACK_INTERVAL_MAX: Duration = Duration::from_millis(20);
const POSE_INTERVAL_MAX: Duration = Duration::from_millis(200);
/// From source to publish stamp.
const FEEDBACK_DELAY_MAX: Duration = Duration::from_millis(100);
const POSE_DELAY_MAX: Duration = Duration::from_millis(500);
/// From publish stamp to receipt: far above what any machine takes, far below a wrong clock.
const RECEIPT_DELAY_MAX: Duration = Duration::from_secs(1);
/// How far a measured angle may lie outside of its range.
const RANGE_TOLERANCE_DEG: f64 = 1.0;
/// Relative deviation from a stated rate.
const RATE_TOLERANCE: f64 = 0.1;

/// Listens, and judges everything heard.
pub(super) fn listen<R: Rig>(rig: &mut R) -> Vec<(Clause, Outcome)> {
    let heard = hear(rig);
    let description = rig.description().clone();
    let rates = rig.stated_rates();
    let all: [(Clause, Judge<'_>); 12] = [
        (Clause::LayoutVersion, &|heard| layout_version(heard)),
        (Clause::Fingerprint, &|heard| fingerprint(heard, &description)),
        (Clause::FeedbackSequence, &|heard| sequence(&headers(&heard.feedback))),
        (Clause::FeedbackStamps, &|heard| stamps(&headers(&heard.feedback), FEEDBACK_DELAY_MAX)),
        (Clause::FeedbackContents, &|heard| feedback_contents(heard, &description)),
        (Clause::FeedbackRate, &|heard| {
            rate(&headers(&heard.feedback), rates.feedback_hz, FEEDBACK_INTERVAL_MAX)
        }),
        (Clause::CurrentAtRest, &|heard| current_at_rest(heard, rig)),
        (Clause::AnglesInRange, &|heard| angles_in_range(heard, &description)),
        (Clause::PoseSequence, &|heard| of_poses(heard, sequence)),
        (Clause::PoseStamps, &|heard| of_poses(heard, |headers| stamps(headers, POSE_DELAY_MAX))),
        (Clause::PoseContents, &|heard| pose_contents(heard, &description)),
        (Clause::PoseRate, &|heard| {
            of_poses(heard, |headers| rate(headers, rates.pose_hz, POSE_INTERVAL_MAX))
        }),
    ];
    all.into_iter()
        .map(|(clause, judge)| {
            let outcome = match &heard {
                None => not_tried("the rig shows its newest messages alone"),
                Some(heard) if heard.feedback.is_empty() => Err("no feedback was heard".to_owned()),
                Some(heard) => judge(heard),
            };
            (clause, outcome)
        })
        .collect()
}

type Judge<'a> = &'a dyn Fn(&Heard) -> Outcome;

/// Everything said in a while; `None` from a rig that cannot tell.
fn hear<R: Rig>(rig: &mut R) -> Option<Heard> {
    rig.advance(CYCLE);
    // What was said before may have been said by a former driver.
    rig.heard()?;
    let mut all = Heard::default();
    let start = rig.now();
    while rig.now().since(start) < LISTEN && !rig.is_interrupted() {
        rig.advance(CYCLE * 10);
        let heard = rig.heard()?;
        all.feedback.extend(heard.feedback);
        all.poses.extend(heard.poses);
    }
    Some(all)
}

/// A header and when its message was received.
type Received = (Header, Stamp);

fn headers<M: HasHeader>(messages: &[(M, Stamp)]) -> Vec<Received> {
    messages.iter().map(|(message, at)| (message.header(), *at)).collect()
}

trait HasHeader {
    fn header(&self) -> Header;
}

impl HasHeader for CoilFeedback {
    fn header(&self) -> Header {
        self.header
    }
}

impl HasHeader for PoseMessage {
    fn header(&self) -> Header {
        self.header
    }
}

fn of_poses(heard: &Heard, judge: impl FnOnce(&[Received]) -> Outcome) -> Outcome {
    require(!heard.poses.is_empty(), || "no poses were heard".to_owned())?;
    judge(&headers(&heard.poses))
}

fn layout_version(heard: &Heard) -> Outcome {
    let all = headers(&heard.feedback).into_iter().chain(headers(&heard.poses));
    for (header, _) in all {
        require(header.schema == SCHEMA, || format!("version {}, {SCHEMA} expected", header.schema))?;
    }
    found(format!("version {SCHEMA}"))
}

fn fingerprint(heard: &Heard, description: &HardwareDescription) -> Outcome {
    let expected = description.fingerprint();
    for (feedback, _) in &heard.feedback {
        let actual = feedback.description_fingerprint;
        require(actual == expected, || format!("{actual:016x}, {expected:016x} expected"))?;
    }
    found(format!("{expected:016x}"))
}

fn sequence(messages: &[Received]) -> Outcome {
    let first = &messages[0].0;
    require(first.sequence > 0, || "sequence 0".to_owned())?;
    for pair in messages.windows(2) {
        let (last, next) = (&pair[0].0, &pair[1].0);
        require(next.epoch == last.epoch, || format!("epoch changed from {} to {}", last.epoch, next.epoch))?;
        require(next.sequence > last.sequence, || {
            format!("sequence went from {} to {}", last.sequence, next.sequence)
        })?;
    }
    let last = messages[messages.len() - 1].0.sequence;
    found(format!("{} to {last} in {} messages", first.sequence, messages.len()))
}

fn stamps(messages: &[Received], delay_max: Duration) -> Outcome {
    let mut delay = Duration::ZERO;
    for (header, received) in messages {
        let publish = Stamp::from_nanoseconds(header.publish_stamp_ns);
        let ahead = publish.since(received.after(CYCLE));
        require(ahead.is_zero(), || format!("published {:.0} ms in the future", milliseconds(ahead)))?;
        let old = received.since(publish);
        require(old <= RECEIPT_DELAY_MAX, || {
            format!("published {:.1} s before receipt: another clock?", old.as_secs_f64())
        })?;
        let early = header.source_stamp().since(publish);
        require(early.is_zero(), || {
            format!("source stamp {:.3} ms after the publish stamp", milliseconds(early))
        })?;
        let held = publish.since(header.source_stamp());
        require(held <= delay_max, || format!("content {:.1} ms old when published", milliseconds(held)))?;
        delay = delay.max(held);
    }
    for pair in messages.windows(2) {
        let (last, next) = (&pair[0].0, &pair[1].0);
        require(next.source_stamp_ns > last.source_stamp_ns, || {
            let back = last.source_stamp_ns - next.source_stamp_ns;
            format!(
                "source stamp did not advance (back by {back} ns) from message {} to {}",
                last.sequence, next.sequence
            )
        })?;
    }
    found(format!("advancing, content at most {:.2} ms old when published", milliseconds(delay)))
}

/// Counted by sequence and publish stamps, so that a message this process slept through still counts.
fn rate(messages: &[Received], stated: Option<f64>, interval_max: Duration) -> Outcome {
    let stamps: Vec<Stamp> =
        messages.iter().map(|(header, _)| Stamp::from_nanoseconds(header.publish_stamp_ns)).collect();
    require(stamps.len() > 2, || format!("{} messages in {:.1} s", stamps.len(), LISTEN.as_secs_f64()))?;
    let interval = median_interval(&stamps);
    let hertz = 1.0 / interval.as_secs_f64();
    let (first, last) = (messages[0].0, messages[messages.len() - 1].0);
    let elapsed = stamps[stamps.len() - 1].since(stamps[0]).as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "messages of some seconds")]
    let mean = (last.sequence - first.sequence) as f64 / elapsed;
    match stated {
        Some(stated) => require((hertz / stated - 1.0).abs() <= RATE_TOLERANCE, || {
            format!("{hertz:.1} Hz (mean {mean:.1}), {stated} Hz stated")
        })?,
        None => require(interval <= interval_max, || format!("{hertz:.1} Hz (mean {mean:.1})"))?,
    }
    found(format!("{hertz:.1} Hz, mean {mean:.1} Hz"))
}

fn feedback_contents(heard: &Heard, description: &HardwareDescription) -> Outcome {
    for (feedback, received) in &heard.feedback {
        // A receiver of its own for each: order and stamps are other clauses' matters, and so are these of a
        // header.
        let header = clean_header(*received);
        let message =
            CoilFeedback { header, description_fingerprint: description.fingerprint(), ..*feedback };
        let reading = FeedbackReceiver::new(description).receive(Some(&message), *received);
        if let Some(refused) = reading.refused {
            return Err(refused.to_string());
        }
        require(feedback.fault == 0, || format!("the driver reports fault {}", feedback.fault))?;
    }
    found(format!("{} coils, {} frames, no fault", description.coils.len(), description.frames.len()))
}

fn pose_contents(heard: &Heard, description: &HardwareDescription) -> Outcome {
    require(!heard.poses.is_empty(), || "no poses were heard".to_owned())?;
    let mut unseen = 0;
    for (pose, received) in &heard.poses {
        let message = PoseMessage { header: clean_header(*received), ..*pose };
        match PoseReceiver::new(description).receive(Some(&message), *received).refused {
            Some(Absent::NotSeen { .. }) => unseen += 1,
            Some(refused) => return Err(refused.to_string()),
            None => (),
        }
    }
    let total = heard.poses.len();
    require(unseen * 2 <= total, || format!("{unseen} of {total} messages lack a magnet"))?;
    found(format!("{} magnets, {unseen} of {total} messages lack one", description.magnets().count()))
}

fn clean_header(received: Stamp) -> Header {
    let now = received.nanoseconds();
    Header {
        sequence: 1,
        source_stamp_ns: now,
        publish_stamp_ns: now,
        schema: SCHEMA,
        epoch: 1,
        ..Header::default()
    }
}

fn current_at_rest<R: Rig>(heard: &Heard, rig: &R) -> Outcome {
    let mut greatest = 0.0_f64;
    for (feedback, _) in &heard.feedback {
        require(feedback.state == driver_state::IDLE, || {
            format!("state {}, {} (idle) expected", feedback.state, driver_state::IDLE)
        })?;
        for index in 0..rig.description().coils.len() {
            let (measured, tolerance) = (feedback.measured.current_a[index], rig.current_tolerance(index));
            require(measured.abs() <= tolerance, || {
                format!("coil {index} measures {measured:.4} A, zero expected within {tolerance:.3}")
            })?;
            greatest = greatest.max(measured.abs());
        }
    }
    found(format!("idle, {:.1} mA at most", greatest * 1e3))
}

fn angles_in_range(heard: &Heard, description: &HardwareDescription) -> Outcome {
    let tolerance = RANGE_TOLERANCE_DEG.to_radians();
    for (feedback, _) in &heard.feedback {
        for (index, frame) in description.frames.iter().enumerate() {
            let angle = feedback.measured.angle_rad[index];
            let is_in = (frame.angle_min - tolerance..=frame.angle_max + tolerance).contains(&angle);
            require(is_in, || {
                let (least, most) = (frame.angle_min, frame.angle_max);
                format!("frame {index} measures {angle:.3} rad, {least:.3} to {most:.3} expected; degrees?")
            })?;
        }
    }
    let last = heard.feedback[heard.feedback.len() - 1].0.measured.angle_rad;
    let text: Vec<String> =
        last[..description.frames.len()].iter().map(|angle| format!("{:.2}", angle.to_degrees())).collect();
    found(format!("[{}] deg", text.join(", ")))
}
