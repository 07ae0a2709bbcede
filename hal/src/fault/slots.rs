//! The faults of one target: which wait, which act, which are over.
//!
//! Times are counted from the driver's start.

use std::collections::VecDeque;
use std::time::Duration;

use super::checked::{Fault, FaultRefusal};
use super::plan::Scheduled;

/// Most faults of one target that may wait or act at a time.
pub const FAULTS_MAX: usize = 32;

/// Most events kept for whoever tells of them; later ones are lost, and counted.
const EVENTS_MAX: usize = 128;

/// A fault that began or ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultEvent {
    /// Which.
    pub fault: Fault,
    /// True when it began, false when it ended.
    pub began: bool,
    /// When, since the driver's start.
    pub at: Duration,
}

/// Events that nobody took yet, and how many there were.
#[derive(Debug, Clone)]
pub(super) struct Events {
    queue: VecDeque<FaultEvent>,
    pub(super) begun: u64,
    pub(super) ended: u64,
    pub(super) lost: u64,
}

impl Events {
    pub(super) fn new() -> Self {
        Self { queue: VecDeque::with_capacity(EVENTS_MAX), begun: 0, ended: 0, lost: 0 }
    }

    pub(super) fn take(&mut self) -> Option<FaultEvent> {
        self.queue.pop_front()
    }

    fn note(&mut self, event: FaultEvent) {
        if event.began {
            self.begun += 1;
        } else {
            self.ended += 1;
        }
        if self.queue.len() < EVENTS_MAX {
            self.queue.push_back(event);
        } else {
            self.lost += 1;
        }
    }
}

/// What a fault remembers while it acts.
pub(super) trait Memory: Copy {
    /// At its begin.
    fn at_begin(now: Duration) -> Self;
}

impl Memory for () {
    fn at_begin(_: Duration) -> Self {}
}

#[derive(Debug, Clone, Copy)]
struct Slot<M> {
    scheduled: Scheduled,
    /// Its memory once it has begun.
    memory: Option<M>,
}

/// The faults of one target, in the order in which they were given.
#[derive(Debug, Clone)]
pub(super) struct Slots<M> {
    slots: Vec<Slot<M>>,
}

impl<M: Memory> Slots<M> {
    /// Those of `scheduled` that `belongs` picks.
    pub(super) fn new(scheduled: &[Scheduled], belongs: impl Fn(&Fault) -> bool) -> Self {
        let mut slots = Vec::with_capacity(FAULTS_MAX);
        let own = scheduled.iter().filter(|scheduled| belongs(&scheduled.fault));
        slots.extend(own.take(FAULTS_MAX).map(|scheduled| Slot { scheduled: *scheduled, memory: None }));
        Self { slots }
    }

    pub(super) fn push(&mut self, scheduled: Scheduled) -> Result<(), FaultRefusal> {
        if self.slots.len() >= FAULTS_MAX {
            return Err(FaultRefusal::TooMany { max: FAULTS_MAX });
        }
        self.slots.push(Slot { scheduled, memory: None });
        Ok(())
    }

    /// Lets faults begin and end; those that are over are forgotten. One that is both within a single step is
    /// told of all the same.
    pub(super) fn update(&mut self, now: Duration, events: &mut Events) {
        self.slots.retain_mut(|slot| {
            let Scheduled { fault, from, lasts } = slot.scheduled;
            if slot.memory.is_none() && now >= from {
                slot.memory = Some(M::at_begin(now));
                events.note(FaultEvent { fault, began: true, at: now });
            }
            let over = lasts.is_some_and(|lasts| now >= from.saturating_add(lasts));
            if over {
                events.note(FaultEvent { fault, began: false, at: now });
            }
            !over
        });
    }

    /// Ends every fault and forgets those that wait; how many that were.
    pub(super) fn clear(&mut self, now: Duration, events: &mut Events) -> usize {
        let count = self.slots.len();
        for slot in self.slots.drain(..) {
            if slot.memory.is_some() {
                events.note(FaultEvent { fault: slot.scheduled.fault, began: false, at: now });
            }
        }
        count
    }

    /// The faults that act, with what they remember.
    pub(super) fn active(&mut self) -> impl Iterator<Item = (Fault, &mut M)> {
        self.slots.iter_mut().filter_map(|slot| Some((slot.scheduled.fault, slot.memory.as_mut()?)))
    }

    /// How many act.
    pub(super) fn active_count(&self) -> usize {
        self.slots.iter().filter(|slot| slot.memory.is_some()).count()
    }
}

/// Whether an intermittent fault that remembers its begin is off now.
pub(super) fn is_off(since_begin: Duration, period: Duration, off_fraction: f64) -> bool {
    // A period is at least some milliseconds: checked where faults are made. Whole nanoseconds, so that
    // phases are exact.
    let phase = since_begin.as_nanos() % period.as_nanos().max(1);
    (phase as f64) < off_fraction * period.as_nanos() as f64
}
