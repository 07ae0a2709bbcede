//! Plays back a script of received messages and records what was sent.

use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::hardware::{Hardware, Sensed, WriteError};
use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
use crate::receive::{FeedbackReceiver, PoseReceiver};
use crate::send::CommandWriter;
use crate::time::Stamp;

/// What arrives at a moment; the messages are checked as any received ones, so a script may hold garbage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// When it arrives.
    pub at: Stamp,
    /// Poses, if any.
    pub pose: Option<PoseMessage>,
    /// Feedback, if any.
    pub feedback: Option<CoilFeedback>,
}

/// [`Hardware`] without a rig: reads come from a script, writes are recorded.
#[derive(Debug, Clone)]
pub struct ScriptedHardware {
    script: Vec<Step>,
    /// Steps that have arrived.
    arrived: usize,
    pose: PoseReceiver,
    feedback: FeedbackReceiver,
    writer: CommandWriter,
    commands: Vec<CoilCommand>,
    writes_fail: bool,
}

impl ScriptedHardware {
    /// Plays `script`, in the order of its times, and keeps the first `commands_max` commands sent.
    #[must_use]
    pub fn new(description: &HardwareDescription, mut script: Vec<Step>, commands_max: usize) -> Self {
        script.sort_by_key(|step| step.at);
        Self {
            script,
            arrived: 0,
            pose: PoseReceiver::new(description),
            feedback: FeedbackReceiver::new(description),
            writer: CommandWriter::new(description),
            commands: Vec::with_capacity(commands_max),
            writes_fail: false,
        }
    }

    /// From now on the transport refuses (or takes) commands.
    pub const fn set_writes_fail(&mut self, writes_fail: bool) {
        self.writes_fail = writes_fail;
    }

    /// The commands sent, oldest first.
    #[must_use]
    pub fn commands(&self) -> &[CoilCommand] {
        &self.commands
    }
}

impl Hardware for ScriptedHardware {
    fn read(&mut self, now: Stamp) -> Sensed {
        let (mut pose, mut feedback) = (None, None);
        while let Some(step) = self.script.get(self.arrived).filter(|step| step.at <= now) {
            pose = step.pose.or(pose);
            feedback = step.feedback.or(feedback);
            self.arrived += 1;
        }
        Sensed {
            pose: self.pose.receive(pose.as_ref(), now),
            feedback: self.feedback.receive(feedback.as_ref(), now),
        }
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        if self.writes_fail {
            return Err(WriteError::Transport);
        }
        let message = self.writer.message(command, now);
        if self.commands.len() < self.commands.capacity() {
            self.commands.push(message);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
