//! What stands in a recording beside its cycles: the rig, the configuration, the machine, why it was made.

use std::collections::BTreeMap;
use std::time::{SystemTime, UNIX_EPOCH};

use magsteer_hal::{HardwareDescription, Stamp};

use super::convert::Sizes;
use crate::daemon::recorder::Machine;

/// Name of the metadata with the keys of [`Info`].
pub const METADATA: &str = "magsteer";
/// Name of the metadata with which a recording ends.
pub const METADATA_END: &str = "magsteer-end";
/// Name of the attachment with the resolved configuration.
pub const CONFIG: &str = "config.toml";
/// Name of the attachment with what the operator said of the run.
pub const DESCRIPTION: &str = "description.txt";

/// What a recording says of itself at its begin.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Info {
    /// Version of the program that recorded.
    pub program: String,
    /// Name of the rig.
    pub rig: String,
    /// Configured rate of the loop.
    pub rate_hz: f64,
    /// When the recording began, RFC 3339.
    pub started: String,
    /// To be added to a stamp of `CLOCK_MONOTONIC` for nanoseconds since 1970, by the clock on the wall when
    /// the recording began.
    pub wall_offset_ns: u64,
    /// SHA-256 of the resolved configuration.
    pub config_sha256: String,
    /// Fingerprint of the rig's description, hexadecimal.
    pub description_fingerprint: String,
    /// What the operator said of the run.
    pub description: String,
    /// Where it was recorded.
    pub machine: Machine,
    /// Names of the coils, in their order.
    pub coils: Vec<String>,
    /// Names of the frames, in their order.
    pub frames: Vec<String>,
    /// Names of the magnets, base to tip.
    pub magnets: Vec<String>,
    /// True when the daemon refused to arm because real time was missing.
    pub realtime_missing: bool,
}

impl Info {
    /// Of a rig, now and here.
    #[must_use]
    pub fn here(rig: &HardwareDescription, rate_hz: f64, config_sha256: &str, description: &str) -> Self {
        let wall = SystemTime::now();
        let mut info = Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            rig: rig.rig.clone(),
            rate_hz,
            started: crate::daemon::recorder::rfc_3339(wall),
            wall_offset_ns: 0,
            config_sha256: config_sha256.to_owned(),
            description_fingerprint: format!("{:016x}", rig.fingerprint()),
            description: description.to_owned(),
            machine: Machine::this(),
            coils: rig.coils.iter().map(|coil| coil.name.clone()).collect(),
            frames: rig.frames.iter().map(|frame| frame.name.clone()).collect(),
            magnets: rig.magnets().map(|magnet| magnet.name.clone()).collect(),
            realtime_missing: false,
        };
        info.set_wall_offset(Stamp::now().nanoseconds());
        info
    }

    /// Takes the clock on this machine's wall for that of a stamp that was true just now, be it of another machine's
    /// monotonic clock.
    pub fn set_wall_offset(&mut self, stamp_ns: u64) {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        self.wall_offset_ns = u64::try_from(since).unwrap_or(u64::MAX).saturating_sub(stamp_ns);
    }

    /// How many coils, frames and magnets there are.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        Sizes { coils: self.coils.len(), frames: self.frames.len(), magnets: self.magnets.len() }
    }

    /// As the metadata of a recording.
    #[must_use]
    pub fn to_metadata(&self) -> BTreeMap<String, String> {
        let list = |names: &[String]| serde_json::to_string(names).unwrap_or_default();
        let entries = [
            ("program", self.program.clone()),
            ("rig", self.rig.clone()),
            ("rate_hz", self.rate_hz.to_string()),
            ("started", self.started.clone()),
            ("wall_offset_ns", self.wall_offset_ns.to_string()),
            ("config_sha256", self.config_sha256.clone()),
            ("description_fingerprint", self.description_fingerprint.clone()),
            ("description", self.description.clone()),
            ("host", self.machine.host.clone()),
            ("kernel", self.machine.kernel.clone()),
            ("processor", self.machine.processor.clone()),
            ("processors", self.machine.processors.to_string()),
            ("coils", list(&self.coils)),
            ("frames", list(&self.frames)),
            ("magnets", list(&self.magnets)),
            ("realtime_missing", self.realtime_missing.to_string()),
        ];
        entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// From the metadata of a recording; what is not there is empty.
    #[must_use]
    pub fn of_metadata(entries: &BTreeMap<String, String>) -> Self {
        let text = |key: &str| entries.get(key).cloned().unwrap_or_default();
        let list = |key: &str| serde_json::from_str(&text(key)).unwrap_or_default();
        Self {
            program: text("program"),
            rig: text("rig"),
            rate_hz: text("rate_hz").parse().unwrap_or_default(),
            started: text("started"),
            wall_offset_ns: text("wall_offset_ns").parse().unwrap_or_default(),
            config_sha256: text("config_sha256"),
            description_fingerprint: text("description_fingerprint"),
            description: text("description"),
            machine: Machine {
                host: text("host"),
                kernel: text("kernel"),
                processor: text("processor"),
                processors: text("processors").parse().unwrap_or_default(),
            },
            coils: list("coils"),
            frames: list("frames"),
            magnets: list("magnets"),
            realtime_missing: text("realtime_missing") == "true",
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::{SystemTime, UNIX_EPOCH};

    use magsteer_hal::scripted::example_description;

    use super::Info;

    #[test]
    fn what_a_recording_says_of_itself_survives_its_metadata() {
        let mut info = Info::here(&example_description(), 987.5, "abc", "a \"first\" try\nwith two lines");
        info.realtime_missing = true;
        assert_eq!(Info::of_metadata(&info.to_metadata()), info);
        assert!(info.wall_offset_ns > 0 && !info.coils.is_empty());
    }

    /// Goal: what was recorded of a machine whose clock stands elsewhere bears the time that it was here.
    #[test]
    fn stamp_of_another_machine_is_told_by_the_clock_on_this_wall() {
        let wall_ns =
            || u64::try_from(SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos());
        for stamp_ns in [1, 250_000_000_000_000] {
            let mut info = Info::default();
            let before = wall_ns().expect("before 2554");
            info.set_wall_offset(stamp_ns);
            let after = wall_ns().expect("before 2554");
            assert!((before..=after).contains(&(stamp_ns + info.wall_offset_ns)), "{}", info.wall_offset_ns);
        }
    }
}
