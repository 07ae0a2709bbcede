//! Faults of received commands, before the guard judges them. An order to cut the amplifiers always passes.

use std::time::Duration;

use crate::message::{CoilCommand, SCHEMA, order};

use super::checked::{Fault, FaultRefusal};
use super::kinds::{EpochChange, FaultVerb};
use super::plan::Scheduled;
use super::slots::{Events, Memory, Slots};

#[derive(Debug, Clone, Copy)]
pub(super) struct CommandMemory {
    held: Option<CoilCommand>,
    count: u64,
}

impl Memory for CommandMemory {
    fn at_begin(_: Duration) -> Self {
        Self { held: None, count: 0 }
    }
}

/// The commands of a rig on their way to the guard.
#[derive(Debug, Clone)]
pub(super) struct Commands {
    pub(super) slots: Slots<CommandMemory>,
    /// The last command before the faults that act.
    last: Option<CoilCommand>,
    pub(super) altered: u64,
}

impl Commands {
    pub(super) fn new(scheduled: &[Scheduled]) -> Self {
        Self { slots: Slots::new(scheduled, Fault::befalls_commands), last: None, altered: 0 }
    }

    pub(super) fn push(&mut self, scheduled: Scheduled) -> Result<(), FaultRefusal> {
        self.slots.push(scheduled)
    }

    /// What reaches the guard in place of `received`.
    pub(super) fn pass(&mut self, received: &CoilCommand, now: Duration, events: &mut Events) -> CoilCommand {
        self.slots.update(now, events);
        if received.order == order::DISABLE {
            return *received;
        }
        let onset = self.last.unwrap_or(*received);
        let mut command = *received;
        let mut acts = false;
        for (fault, memory) in self.slots.active() {
            acts = true;
            let held = *memory.held.get_or_insert(onset);
            memory.count += 1;
            match fault.verb() {
                FaultVerb::Repeated => command = held,
                FaultVerb::Backward => {
                    command.header.sequence = held.header.sequence.saturating_sub(memory.count).max(1);
                }
                FaultVerb::WrongEpoch(change) => {
                    let offset = if change == EpochChange::Other { 1 } else { memory.count };
                    command.header.epoch = command.header.epoch.saturating_sub(offset);
                }
                FaultVerb::WrongVersion => command.header.schema = SCHEMA + 1,
                _ => (),
            }
        }
        self.altered += u64::from(acts);
        if !acts {
            self.last = Some(*received);
        }
        command
    }
}
