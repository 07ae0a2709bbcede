//! What a sender writes into its messages: sequence, epoch, stamps and validity. Pure state, no transport.

use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::message::{COILS_MAX, CoilCommand, Header, POSE_PARAMETERS_MAX, SCHEMA};
use crate::time::Stamp;

/// Numbers and stamps the messages of one channel of a driver's life.
#[derive(Debug, Clone)]
pub struct HeaderWriter {
    epoch: u64,
    sequence: u64,
}

impl HeaderWriter {
    /// A writer for one life of its sender; `epoch` must differ from, and rise over, those of former lives.
    #[must_use]
    pub const fn new(epoch: u64) -> Self {
        Self { epoch, sequence: 0 }
    }

    /// Fills in sequence, epoch, schema and publish stamp; source stamp and validity stay the caller's.
    pub fn write(&mut self, header: &mut Header, now: Stamp) {
        self.sequence += 1;
        header.sequence = self.sequence;
        header.epoch = self.epoch;
        header.schema = SCHEMA;
        header.flags = 0;
        header.publish_stamp_ns = now.nanoseconds();
    }
}

/// Turns admitted commands into messages: the sending half of every [`crate::Hardware::write`].
#[derive(Debug, Clone)]
pub struct CommandWriter {
    coil_count: u32,
    pose_parameter_count: u32,
    header: HeaderWriter,
}

impl CommandWriter {
    /// A writer for the coils and frames of `description`.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        Self {
            coil_count: count(description.coils.len(), COILS_MAX),
            pose_parameter_count: count(description.frames.len(), POSE_PARAMETERS_MAX),
            header: HeaderWriter::new(0),
        }
    }

    /// The message for `command`, published at `now`. The sequence rises across epochs too.
    pub fn message(&mut self, command: &AdmittedCommand, now: Stamp) -> CoilCommand {
        let authority = command.authority();
        self.header.epoch = authority.epoch;
        let mut message = CoilCommand {
            token: authority.token,
            order: command.order(),
            coil_count: self.coil_count,
            pose_parameter_count: self.pose_parameter_count,
            actuation: *command.actuation(),
            ..CoilCommand::default()
        };
        self.header.write(&mut message.header, now);
        message.header.source_stamp_ns = command.pose_source_stamp().nanoseconds();
        message.header.valid_until_ns = now.after(authority.validity).nanoseconds();
        message
    }
}

/// `length` as a message counts it, cut to the capacity.
pub(crate) fn count(length: usize, capacity: usize) -> u32 {
    u32::try_from(length.min(capacity)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{CommandWriter, HeaderWriter};
    use crate::gate::{Authority, Gate};
    use crate::message::{Header, SCHEMA, order};
    use crate::scripted::example_description as description;
    use crate::time::Stamp;

    #[test]
    fn sequence_starts_at_one_and_rises_within_and_across_epochs() {
        let description = description();
        let (mut gate, mut writer) = (Gate::new(&description), CommandWriter::new(&description));
        let authority = |epoch| Authority { epoch, token: 7, validity: Duration::from_millis(100) };
        let now = Stamp::from_nanoseconds(5_000_000);
        let sequences: Vec<u64> = [3, 3, 9, 9, 9]
            .into_iter()
            .map(|epoch| writer.message(&gate.claim(authority(epoch)), now).header.sequence)
            .collect();
        assert_eq!(sequences, [1, 2, 3, 4, 5]);
    }

    #[test]
    fn command_carries_counts_stamps_and_validity() {
        let description = description();
        let (mut gate, mut writer) = (Gate::new(&description), CommandWriter::new(&description));
        let authority = Authority { epoch: 3, token: 7, validity: Duration::from_millis(100) };
        let message = writer.message(&gate.claim(authority), Stamp::from_nanoseconds(5_000_000));
        assert_eq!((message.order, message.token, message.header.epoch), (order::CLAIM, 7, 3));
        assert_eq!((message.coil_count, message.pose_parameter_count), (3, 2));
        assert_eq!(
            (message.header.publish_stamp_ns, message.header.valid_until_ns),
            (5_000_000, 105_000_000)
        );
        assert_eq!(message.header.schema, SCHEMA);
    }

    #[test]
    fn header_writer_leaves_source_stamp_and_validity_alone() {
        let mut header = Header { source_stamp_ns: 4, valid_until_ns: 9, ..Header::default() };
        HeaderWriter::new(2).write(&mut header, Stamp::from_nanoseconds(6));
        assert_eq!((header.source_stamp_ns, header.valid_until_ns), (4, 9));
        assert_eq!((header.sequence, header.epoch, header.publish_stamp_ns), (1, 2, 6));
    }
}
