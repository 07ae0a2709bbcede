//! The log: lines on standard error, with priorities and fields where the journal listens.
//!
//! | standard error is | a line becomes |
//! |---|---|
//! | the journal's stream (`$JOURNAL_STREAM` names its device and inode) | an entry by the native protocol, with `PRIORITY` and fields |
//! | the same, but its socket refuses | the line with a prefix `<3>` to `<6>`, which the journal takes for its priority (`sd-daemon(3)`) |
//! | anything else | the plain line |
//!
//! Protocol: one datagram an entry, `KEY=value` a line; a value of several lines is announced by its key alone and a
//! little-endian length of eight bytes (systemd, "Native Journal Protocol"). So small that no dependency is needed for it.
//!
//! Nothing here may be called from a control cycle.

use std::fmt::{self, Display};
use std::io::{self, Write};
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::sync::OnceLock;

/// Where journald listens.
const JOURNAL: &str = "/run/systemd/journal/socket";

/// How grave a line is; numbers as syslog has them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Priority {
    /// Somebody must look.
    Error = 3,
    /// Something is not as it should be.
    Warning = 4,
    /// Ordinary, but of weight.
    Notice = 5,
    /// Ordinary.
    Info = 6,
}

/// A field of an entry: an upper-case key, and its value.
pub type Field<'a> = (&'static str, &'a dyn Display);

/// Where lines go.
#[derive(Debug)]
enum Sink {
    Plain,
    /// Prefixed for the journal, which reads standard error.
    Prefixed,
    Native(UnixDatagram),
}

impl Sink {
    /// `stream`: the environment's `JOURNAL_STREAM`.
    fn find(stream: Option<&str>, socket: &Path) -> Self {
        if !stream.is_some_and(is_standard_error) {
            return Self::Plain;
        }
        let connected = || {
            let connected = UnixDatagram::unbound()?;
            connected.connect(socket)?;
            // A journal that does not keep up costs fields, not time.
            connected.set_nonblocking(true)?;
            io::Result::Ok(connected)
        };
        connected().map_or(Self::Prefixed, Self::Native)
    }

    fn write(&self, priority: Priority, fields: &[Field<'_>], line: fmt::Arguments<'_>) {
        if let Self::Native(socket) = self
            && socket.send(&entry(priority, fields, line)).is_ok()
        {
            return;
        }
        let mut output = io::stderr().lock();
        // A closed standard error must not end the thread that logs.
        let _ = match self {
            Self::Plain => writeln!(output, "magsteer: {line}"),
            Self::Prefixed | Self::Native(_) => writeln!(output, "<{}>magsteer: {line}", priority as u8),
        };
    }
}

/// Whether `DEVICE:INODE` is what standard error is.
fn is_standard_error(stream: &str) -> bool {
    let named = stream
        .split_once(':')
        .and_then(|(device, inode)| Some((device.parse::<u64>().ok()?, inode.parse::<u64>().ok()?)));
    let own = rustix::fs::fstat(io::stderr()).map(|found| (found.st_dev, found.st_ino));
    own.is_ok_and(|own| named == Some(own))
}

/// One entry as the native protocol has it.
fn entry(priority: Priority, fields: &[Field<'_>], line: fmt::Arguments<'_>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(256);
    let level = priority as u8;
    let common: [Field<'_>; 3] =
        [("PRIORITY", &level), ("SYSLOG_IDENTIFIER", &"magsteer"), ("MESSAGE", &line)];
    for (key, value) in common.iter().chain(fields) {
        let value = value.to_string();
        bytes.extend_from_slice(key.as_bytes());
        if value.contains('\n') {
            bytes.push(b'\n');
            bytes.extend_from_slice(&(value.len() as u64).to_le_bytes());
        } else {
            bytes.push(b'=');
        }
        bytes.extend_from_slice(value.as_bytes());
        bytes.push(b'\n');
    }
    bytes
}

/// Logs one line.
pub fn tell(priority: Priority, fields: &[Field<'_>], line: fmt::Arguments<'_>) {
    static SINK: OnceLock<Sink> = OnceLock::new();
    let sink = SINK.get_or_init(|| {
        let stream = std::env::var("JOURNAL_STREAM").ok();
        Sink::find(stream.as_deref(), Path::new(JOURNAL))
    });
    sink.write(priority, fields, line);
}

#[cfg(test)]
mod tests {
    use std::io::stderr;
    use std::os::unix::net::UnixDatagram;
    use std::path::Path;

    use super::{Priority, Sink, entry};

    #[test]
    fn entry_carries_priority_message_and_fields_and_lengths_for_values_of_several_lines() {
        let cause = "two\nlines";
        let bytes =
            entry(Priority::Error, &[("MAGSTEER_STATE", &"fault"), ("A", &cause)], format_args!("x = y"));
        let mut expected =
            b"PRIORITY=3\nSYSLOG_IDENTIFIER=magsteer\nMESSAGE=x = y\nMAGSTEER_STATE=fault\nA\n".to_vec();
        expected.extend_from_slice(&[9, 0, 0, 0, 0, 0, 0, 0]);
        expected.extend_from_slice(b"two\nlines\n");
        assert_eq!(bytes, expected);
    }

    /// Device and inode of this process's standard error, as the journal would name them.
    fn own_stream() -> String {
        let found = rustix::fs::fstat(stderr()).expect("open");
        format!("{}:{}", found.st_dev, found.st_ino)
    }

    #[test]
    fn journal_is_used_only_when_it_reads_standard_error_and_prefixes_when_it_cannot_be_reached() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("journal");
        for other in [None, Some("1:2"), Some("nonsense"), Some("")] {
            assert!(matches!(Sink::find(other, &path), Sink::Plain), "{other:?}");
        }
        assert!(matches!(Sink::find(Some(&own_stream()), Path::new("/nowhere")), Sink::Prefixed));
        let journal = UnixDatagram::bind(&path).expect("own directory");
        let sink = Sink::find(Some(&own_stream()), &path);
        sink.write(Priority::Warning, &[("MAGSTEER_CAUSE", &208)], format_args!("the driver is gone"));
        let mut buffer = [0; 256];
        let length = journal.recv(&mut buffer).expect("sent");
        let text = std::str::from_utf8(&buffer[..length]).expect("text");
        assert_eq!(
            text,
            "PRIORITY=4\nSYSLOG_IDENTIFIER=magsteer\nMESSAGE=the driver is gone\nMAGSTEER_CAUSE=208\n"
        );
    }
}
