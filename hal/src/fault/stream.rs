//! Faults of published messages: poses or feedback.
//!
//! A message passes three stages: *flow* decides whether and when one goes out (off, intermittent, slow,
//! delayed), *content* what is in it (stuck, garbage, and whatever befalls a single part), *header* what
//! stands over it (repeated, backward, epoch, version). Within a stage faults act in the order in which they
//! were given.

use std::time::Duration;

use crate::message::SCHEMA;
use crate::seeded::Seeded;
use crate::send::HeaderWriter;
use crate::time::Stamp;

use super::checked::{Fault, FaultRefusal};
use super::content::{Content, Possible};
use super::history::History;
use super::kinds::{EpochChange, FaultVerb};
use super::plan::Scheduled;
use super::slots::{Events, Memory, Slots, is_off};

/// What happened to the messages of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StreamCounts {
    /// Messages that were never published.
    pub withheld: u64,
    /// Messages published while a fault acted, other than the driver made them or at another time.
    pub altered: u64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct StreamMemory<T> {
    began: Duration,
    /// When the fault last let something through.
    last: Option<Duration>,
    held: Option<T>,
    count: u64,
}

impl<T: Copy> Memory for StreamMemory<T> {
    fn at_begin(now: Duration) -> Self {
        Self { began: now, last: None, held: None, count: 0 }
    }
}

impl<T> StreamMemory<T> {
    /// True as often as `rate_hz` a second, at its first call to begin with.
    fn is_due(&mut self, now: Duration, rate_hz: f64) -> bool {
        let due = self.last.is_none_or(|last| (now.saturating_sub(last)).as_secs_f64() * rate_hz >= 1.0);
        if due {
            self.last = Some(now);
        }
        due
    }
}

/// One stream of messages.
#[derive(Debug, Clone)]
pub(super) struct Stream<T> {
    pub(super) slots: Slots<StreamMemory<T>>,
    history: History<T>,
    offered: Option<T>,
    published: Option<T>,
    random: Seeded,
    pub(super) counts: StreamCounts,
}

impl<T: Content> Stream<T> {
    pub(super) fn new(scheduled: &[Scheduled], belongs: impl Fn(&Fault) -> bool, random: Seeded) -> Self {
        Self {
            slots: Slots::new(scheduled, belongs),
            history: History::new(),
            offered: None,
            published: None,
            random,
            counts: StreamCounts::default(),
        }
    }

    pub(super) fn push(&mut self, scheduled: Scheduled) -> Result<(), FaultRefusal> {
        self.slots.push(scheduled)
    }

    /// The driver has a message to publish.
    pub(super) fn offer(&mut self, message: T, now: Duration, events: &mut Events) {
        self.slots.update(now, events);
        let is_delayed = |(fault, _): (Fault, &mut _)| matches!(fault.verb(), FaultVerb::Delayed { .. });
        if self.slots.active().any(is_delayed) {
            self.history.push(now, message);
        } else {
            self.history.clear();
        }
        self.offered = Some(message);
    }

    /// The next message to publish now, if any: ask until there is none.
    pub(super) fn take(
        &mut self,
        header: &mut HeaderWriter,
        possible: &Possible,
        now: Duration,
        stamp: Stamp,
        events: &mut Events,
    ) -> Option<T> {
        self.slots.update(now, events);
        while let Some(mut message) = self.due(now) {
            if self.is_withheld(now) {
                self.counts.withheld += 1;
                continue;
            }
            self.spoil_content(&mut message, possible, now);
            header.write(message.header_mut(), stamp);
            self.spoil_header(&mut message);
            self.counts.altered += u64::from(self.slots.active_count() > 0);
            self.published = Some(message);
            return Some(message);
        }
        None
    }

    /// The message that is next in time: what the driver has now, or what it had a delay ago.
    fn due(&mut self, now: Duration) -> Option<T> {
        let offered = self.offered.take();
        for (fault, memory) in self.slots.active() {
            let (FaultVerb::Delayed { by }, None) = (fault.verb(), fault.part()) else { continue };
            let from = memory.last.or(memory.began.checked_sub(Duration::from_nanos(1)));
            let until = now.checked_sub(by)?;
            let (time, message) = self.history.next(from.unwrap_or_default(), until)?;
            memory.last = Some(time);
            return Some(message);
        }
        offered
    }

    fn is_withheld(&mut self, now: Duration) -> bool {
        let mut withheld = false;
        for (fault, memory) in self.slots.active().filter(|(fault, _)| fault.part().is_none()) {
            withheld |= match fault.verb() {
                FaultVerb::Off => true,
                FaultVerb::Intermittent { period, off_fraction } => {
                    is_off(now.saturating_sub(memory.began), period, off_fraction)
                }
                FaultVerb::Slow { rate_hz } => !memory.is_due(now, rate_hz),
                _ => false,
            };
        }
        withheld
    }

    fn spoil_content(&mut self, message: &mut T, possible: &Possible, now: Duration) {
        let sound = *message;
        for (fault, memory) in self.slots.active() {
            let part = fault.part();
            match (fault.verb(), part) {
                (FaultVerb::Stuck, _) => {
                    let held = *memory.held.get_or_insert(*message);
                    message.take_content(&held, part);
                }
                (FaultVerb::Garbage(kind), _) => message.garble(part, kind, possible, &mut self.random),
                (FaultVerb::Off, Some(part)) => message.blank(part),
                (FaultVerb::Intermittent { period, off_fraction }, Some(part))
                    if is_off(now.saturating_sub(memory.began), period, off_fraction) =>
                {
                    message.blank(part);
                }
                (FaultVerb::Slow { rate_hz }, Some(_)) => {
                    if memory.is_due(now, rate_hz) {
                        memory.held = Some(sound);
                    }
                    message.take_content(&memory.held.unwrap_or(sound), part);
                }
                (FaultVerb::Delayed { by }, Some(_)) => {
                    let onset = *memory.held.get_or_insert(sound);
                    let then = now.checked_sub(by).and_then(|then| self.history.at(then));
                    message.take_content(then.unwrap_or(&onset), part);
                }
                _ => (),
            }
        }
    }

    fn spoil_header(&mut self, message: &mut T) {
        for (fault, memory) in self.slots.active() {
            match fault.verb() {
                FaultVerb::Repeated => {
                    let held = self.published.unwrap_or(*message);
                    *message = *memory.held.get_or_insert(held);
                }
                FaultVerb::Backward => {
                    let onset = *memory.held.get_or_insert(self.published.unwrap_or(*message));
                    memory.count += 1;
                    let sequence = onset.header().sequence.saturating_sub(memory.count);
                    message.header_mut().sequence = sequence.max(1);
                }
                FaultVerb::WrongEpoch(change) => {
                    memory.count += 1;
                    let offset = if change == EpochChange::Other { 1 } else { memory.count };
                    let header = message.header_mut();
                    header.epoch = header.epoch.wrapping_add(offset);
                }
                FaultVerb::WrongVersion => message.header_mut().schema = SCHEMA + 1,
                _ => (),
            }
        }
    }
}
