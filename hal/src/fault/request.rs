//! Faults on request: what crosses shared memory between whoever asks and the driver.
//!
//! Codes never change their meaning. A driver serves these requests only when it was started to allow faults.

use std::time::Duration;

use iceoryx2::prelude::ZeroCopySend;

use crate::description::HardwareDescription;
use crate::time::Stamp;

use super::checked::{Fault, FaultRefusal};
use super::injector::Injector;
use super::kinds::{Condition, EpochChange, FaultTarget, FaultVerb, Garbage, Part, Reach, TIME_MAX};

/// What a [`FaultRequest`] asks for; the codes of [`FaultRequest::action`].
pub mod action {
    /// Let a fault begin now.
    pub const BEGIN: u32 = 1;
    /// End every fault and forget those that wait.
    pub const CLEAR: u32 = 2;
}

/// A fault to begin now, or the end of all.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("magsteer_fault_request_v1")]
pub struct FaultRequest {
    /// One of [`action`].
    pub action: u32,
    /// Poses 1, feedback 2, actuators 3, coil 4, frame 5.
    pub target: u32,
    /// All of the target 0, one magnet 1, one coil 2, one frame 3.
    pub part: u32,
    /// Which magnet, coil or frame.
    pub index: u32,
    /// Off 1, stuck 2, garbage 3, slow 4, delayed 5, intermittent 6, repeated 7, backward 8, wrong epoch 9,
    /// wrong version 10, open 11, shorted 12, stuck amplifier 13, stalled 14.
    pub verb: u32,
    /// Of garbage: nan 1, huge 2, quaternion 3, random 4. Of wrong epoch: other 1, every message 2.
    pub kind: u32,
    /// How long it lasts; 0 until it is cleared.
    pub lasts_ns: u64,
    /// Delay, or period of an intermittent fault.
    pub time_ns: u64,
    /// Rate in Hz, share that is off, or share of shorted turns.
    pub value: f64,
}

/// The driver's answer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("magsteer_fault_answer_v1")]
pub struct FaultAnswer {
    /// 1 when it was done, 0 when refused.
    pub accepted: u32,
    /// Why it was refused; see [`refusal_text`]. 0 when accepted.
    pub reason: u32,
    /// Faults that act now.
    pub active: u32,
    /// Faults that were cleared, acting or waiting.
    pub cleared: u32,
}

impl FaultRequest {
    /// Asks for a fault now, for a time or until it is cleared.
    #[must_use]
    pub fn begin(fault: &Fault, lasts: Option<Duration>) -> Self {
        let (part, index) = match fault.part() {
            None => (0, 0),
            Some(Part::Magnet(index)) => (1, index),
            Some(Part::Coil(index)) => (2, index),
            Some(Part::Frame(index)) => (3, index),
        };
        let (verb, kind, time, value) = parts_of(&fault.verb());
        Self {
            action: action::BEGIN,
            target: match fault.target() {
                FaultTarget::Poses => 1,
                FaultTarget::Feedback => 2,
                FaultTarget::Actuators => 3,
                FaultTarget::Coil => 4,
                FaultTarget::Frame => 5,
            },
            part,
            index: u32::try_from(index).unwrap_or(u32::MAX),
            verb,
            kind,
            lasts_ns: lasts.map_or(0, nanoseconds),
            time_ns: nanoseconds(time),
            value,
        }
    }

    /// Asks for the end of all faults.
    #[must_use]
    pub fn clear() -> Self {
        Self { action: action::CLEAR, ..Self::default() }
    }

    /// The fault that is asked for and how long it is to last, checked like one of a file.
    ///
    /// # Errors
    /// Codes that this build does not know, and whatever [`Fault::new`] refuses.
    pub fn fault(
        &self,
        description: &HardwareDescription,
        reach: Reach,
    ) -> Result<(Fault, Option<Duration>), FaultRefusal> {
        let target = match self.target {
            1 => FaultTarget::Poses,
            2 => FaultTarget::Feedback,
            3 => FaultTarget::Actuators,
            4 => FaultTarget::Coil,
            5 => FaultTarget::Frame,
            _ => return Err(FaultRefusal::Unknown),
        };
        let part = match (self.part, self.index as usize) {
            (0, _) => None,
            (1, index) => Some(Part::Magnet(index)),
            (2, index) => Some(Part::Coil(index)),
            (3, index) => Some(Part::Frame(index)),
            _ => return Err(FaultRefusal::Unknown),
        };
        let lasts = (self.lasts_ns != 0).then(|| Duration::from_nanos(self.lasts_ns));
        if lasts.is_some_and(|lasts| lasts > TIME_MAX) {
            return Err(FaultRefusal::Unknown);
        }
        Ok((Fault::new(target, part, self.verb()?, description, reach)?, lasts))
    }

    fn verb(&self) -> Result<FaultVerb, FaultRefusal> {
        let time = Duration::from_nanos(self.time_ns);
        Ok(match (self.verb, self.kind) {
            (1, _) => FaultVerb::Off,
            (2, _) => FaultVerb::Stuck,
            (3, 1) => FaultVerb::Garbage(Garbage::Nan),
            (3, 2) => FaultVerb::Garbage(Garbage::Huge),
            (3, 3) => FaultVerb::Garbage(Garbage::Quaternion),
            (3, 4) => FaultVerb::Garbage(Garbage::Random),
            (4, _) => FaultVerb::Slow { rate_hz: self.value },
            (5, _) => FaultVerb::Delayed { by: time },
            (6, _) => FaultVerb::Intermittent { period: time, off_fraction: self.value },
            (7, _) => FaultVerb::Repeated,
            (8, _) => FaultVerb::Backward,
            (9, 1) => FaultVerb::WrongEpoch(EpochChange::Other),
            (9, 2) => FaultVerb::WrongEpoch(EpochChange::EveryMessage),
            (10, _) => FaultVerb::WrongVersion,
            (11, _) => FaultVerb::Physical(Condition::Open),
            (12, _) => FaultVerb::Physical(Condition::Shorted { fraction: self.value }),
            (13, _) => FaultVerb::Physical(Condition::StuckAmplifier),
            (14, _) => FaultVerb::Physical(Condition::Stalled),
            _ => return Err(FaultRefusal::Unknown),
        })
    }
}

/// Codes and parameters of a verb: verb, kind, time, value.
const fn parts_of(verb: &FaultVerb) -> (u32, u32, Duration, f64) {
    const NONE: Duration = Duration::ZERO;
    match *verb {
        FaultVerb::Off => (1, 0, NONE, 0.0),
        FaultVerb::Stuck => (2, 0, NONE, 0.0),
        FaultVerb::Garbage(Garbage::Nan) => (3, 1, NONE, 0.0),
        FaultVerb::Garbage(Garbage::Huge) => (3, 2, NONE, 0.0),
        FaultVerb::Garbage(Garbage::Quaternion) => (3, 3, NONE, 0.0),
        FaultVerb::Garbage(Garbage::Random) => (3, 4, NONE, 0.0),
        FaultVerb::Slow { rate_hz } => (4, 0, NONE, rate_hz),
        FaultVerb::Delayed { by } => (5, 0, by, 0.0),
        FaultVerb::Intermittent { period, off_fraction } => (6, 0, period, off_fraction),
        FaultVerb::Repeated => (7, 0, NONE, 0.0),
        FaultVerb::Backward => (8, 0, NONE, 0.0),
        FaultVerb::WrongEpoch(EpochChange::Other) => (9, 1, NONE, 0.0),
        FaultVerb::WrongEpoch(EpochChange::EveryMessage) => (9, 2, NONE, 0.0),
        FaultVerb::WrongVersion => (10, 0, NONE, 0.0),
        FaultVerb::Physical(Condition::Open) => (11, 0, NONE, 0.0),
        FaultVerb::Physical(Condition::Shorted { fraction }) => (12, 0, NONE, fraction),
        FaultVerb::Physical(Condition::StuckAmplifier) => (13, 0, NONE, 0.0),
        FaultVerb::Physical(Condition::Stalled) => (14, 0, NONE, 0.0),
    }
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

impl FaultAnswer {
    /// Carries a request out on `injector` and says what came of it.
    #[must_use]
    pub fn to(request: &FaultRequest, injector: &mut Injector, now: Stamp) -> Self {
        let done = match request.action {
            action::CLEAR => Ok(injector.clear(now)),
            action::BEGIN => request
                .fault(injector.description(), injector.reach())
                .and_then(|(fault, lasts)| injector.begin(fault, lasts, now))
                .map(|()| 0),
            _ => Err(FaultRefusal::Unknown),
        };
        let count = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
        Self {
            accepted: u32::from(done.is_ok()),
            reason: done.as_ref().err().map_or(0, reason),
            active: count(injector.counts().active),
            cleared: count(done.unwrap_or(0) as u64),
        }
    }
}

/// The stable code of a refusal.
const fn reason(refusal: &FaultRefusal) -> u32 {
    match refusal {
        FaultRefusal::Unknown => 1,
        FaultRefusal::NotApplicable { .. } => 2,
        FaultRefusal::UnsafeGarbage => 3,
        FaultRefusal::NoQuaternion => 4,
        FaultRefusal::PartKind { .. } => 5,
        FaultRefusal::PartMissing { .. } => 6,
        FaultRefusal::NoSuchPart { .. } => 7,
        FaultRefusal::Range { .. } => 8,
        FaultRefusal::PlantOnly { .. } => 9,
        FaultRefusal::TooMany { .. } => 10,
    }
}

/// What a person reads for [`FaultAnswer::reason`]; empty for 0.
#[must_use]
pub const fn refusal_text(reason: u32) -> &'static str {
    match reason {
        0 => "",
        1 => "the driver does not know this request; is it another version?",
        2 => "the verb does not apply to the target",
        3 => "coils must never see more than their limits: `random` garbage alone",
        4 => "feedback has no quaternions",
        5 => "this fault cannot be limited to such a part",
        6 => "a fault of a coil or a frame must say which",
        7 => "the driver's rig has no such part",
        8 => "a parameter is out of its range",
        9 => "physical conditions exist in a simulated plant alone",
        10 => "too many faults wait or act already: clear them first",
        _ => "a reason that this version does not know",
    }
}
