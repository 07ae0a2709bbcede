//! The recorder fed by a loop under stepped time; its files in folders that vanish, fill and lie.

mod disk;
mod flights;
mod journals;

use std::io;
use std::path::{Path, PathBuf};

use magsteer_hal::scripted::{EchoHardware, example_description};
use magsteer_hal::{Actuation, HardwareDescription};

use super::config::RecorderConfig;
use super::files::Folder;
use super::{FlightLabel, Recorder, RecorderPlan};
use crate::control::{CycleInput, CycleOutcome, Step};
use crate::daemon::config::tests::shipped;
use crate::daemon::cycle_record::CycleRecord;
use crate::daemon::lockstep::Lockstep;
use crate::daemon::state::Verb;

pub(super) const RATE_HZ: f64 = 1_000.0;

/// Asks for currents that change, and for what is no number when told to.
pub(super) struct Scripted {
    pub failing: bool,
    cycles: u32,
}

impl Step for Scripted {
    fn step(&mut self, input: &CycleInput) -> CycleOutcome {
        self.cycles += 1;
        let mut request = Actuation::default();
        request.current_a[0] = if self.failing { f64::NAN } else { (f64::from(self.cycles) * 0.01).sin() };
        request.current_a[1] = 0.5;
        let mut outcome =
            CycleOutcome { desired: input.target.directions, ..CycleOutcome::asking_for(request) };
        outcome.model.residual = 1e-12 * f64::from(self.cycles);
        outcome
    }
}

/// A loop under stepped time, its recorder, and all that it was given.
pub(super) struct Bench {
    pub lockstep: Lockstep<EchoHardware, Scripted>,
    pub recorder: Recorder,
    pub records: Vec<CycleRecord>,
}

pub(super) fn rig() -> HardwareDescription {
    example_description()
}

pub(super) fn plan(folder: &Path) -> RecorderPlan {
    let config = RecorderConfig { folder: folder.to_owned(), seconds: 1.0, flights_max: 3 };
    RecorderPlan { config, config_sha256: "c0ffee".to_owned() }
}

pub(super) fn store(folder: &Path) -> Folder {
    Folder { path: folder.to_owned(), flights_max: 3 }
}

impl Bench {
    /// Writes into `folder`.
    pub fn new(folder: &Path) -> Self {
        let recorder = Recorder::with_store(store(folder), &plan(folder), &rig(), RATE_HZ);
        Self::recording(recorder)
    }

    pub fn recording(recorder: io::Result<Recorder>) -> Self {
        let controller = Scripted { failing: false, cycles: 0 };
        let lockstep = Lockstep::new(EchoHardware::new(&rig()), controller, &rig(), &shipped());
        Self { lockstep, recorder: recorder.expect("a thread"), records: Vec::new() }
    }

    pub fn run(&mut self, cycles: usize) {
        for _ in 0..cycles {
            let record = self.lockstep.cycle();
            self.recorder.take(&record);
            self.records.push(record);
        }
    }

    pub fn ask(&mut self, verb: Verb) {
        self.lockstep.request(verb).expect("one request a cycle");
        self.run(1);
    }

    /// From boot to steering, for so many cycles.
    pub fn steer(&mut self, cycles: usize) {
        self.run(20);
        self.ask(Verb::Arm);
        self.run(20);
        self.ask(Verb::Go);
        self.run(cycles);
    }

    /// Trips by a request that is no number, and lets its flight become due.
    pub fn trip(&mut self) {
        self.lockstep.control_loop_mut().controller_mut().failing = true;
        self.run(700);
        self.lockstep.control_loop_mut().controller_mut().failing = false;
    }

    /// The cycle in which the state became `state`, the last time that it did.
    pub fn entered(&self, state: u32) -> &CycleRecord {
        let enters = |record: &&CycleRecord| record.decision.transition.is_some_and(|it| it.to == state);
        self.records.iter().rfind(enters).expect("that state was entered")
    }
}

/// The flights in a folder, the oldest name first.
pub(super) fn flights(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut paths: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|it| it == "flight")).collect();
    paths.sort();
    paths
}

/// Their heads.
pub(super) fn labels(folder: &Path) -> Vec<FlightLabel> {
    flights(folder).iter().map(|path| FlightLabel::read(path).expect("a flight")).collect()
}
