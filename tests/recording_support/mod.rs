//! Runs in lockstep, recorded.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]

use std::path::Path;

use magsteer::config::{Config, Document};
use magsteer::daemon::{CycleRecord, Verb, cycle_message};
use magsteer::recording::{Cycle, End, Info, RecordingWriter};

use crate::rig_support::{Bench, Setup, directions_planar};

/// The shipped rig with its resolved text.
pub struct Subject {
    pub document: Document,
    pub setup: Setup,
}

pub fn planar() -> Subject {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    let (document, _) = Config::load(&path).expect("shipped");
    Subject { document, setup: Setup::shipped("bigmag-planar.toml") }
}

impl Subject {
    pub fn info(&self, description: &str) -> Info {
        let rate_hz = self.setup.config.daemon.as_ref().expect("a daemon").rate_hz;
        Info::here(&self.setup.config.description, rate_hz, &self.document.resolved().sha256, description)
    }

    pub fn writer(&self, file: &Path) -> RecordingWriter {
        RecordingWriter::create(file, self.info("a test"), &self.document.resolved().text).expect("a folder")
    }

    /// The cycle as it is recorded.
    pub fn cycle(&self, record: &CycleRecord) -> Cycle {
        Cycle::of_message(&cycle_message(record), self.info("").sizes())
    }

    /// Arms, goes, steers to some pairs of angles for a time each; `look` sees every cycle.
    pub fn steer(
        &self,
        plan: Option<&str>,
        targets_deg: &[[f64; 2]],
        each_s: f64,
        mut look: impl FnMut(&CycleRecord),
    ) {
        let mut bench = Bench::with_faults(&self.setup, plan);
        bench.run(0.3, |record, _| look(record));
        bench.request(Verb::Arm);
        bench.run(0.2, |record, _| look(record));
        bench.request(Verb::Go);
        bench.run(0.1, |record, _| look(record));
        for target in targets_deg {
            bench.request(Verb::SetTarget(directions_planar(*target).into()));
            bench.run(each_s, |record, _| look(record));
        }
        bench.request(Verb::Terminate);
        bench.run(0.2, |record, _| look(record));
    }
}

/// An end with everything there.
pub fn complete() -> End {
    End { lost: 0, dropped: 0, is_complete: true }
}
