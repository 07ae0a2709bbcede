//! `magsteer runs show`: what a daemon saw before it tripped.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;
use magsteer::daemon::recorder::{Extract, Flight, Machine};
use magsteer_hal::operator::{cause, state};
use serde::Serialize;

use super::command::refused;
use super::{csv, table};
use crate::cli::exit::{Exit, Failure};
use crate::cli::output;

/// Rows of the table.
const ROWS: usize = 20;
/// Time before a trip that the table shows when nothing else is asked for, s; after it what is there.
const BEFORE_S: f64 = 1.0;

/// Show a flight: why it was written, the last second before the trip and what came of it, the worst values. Or a
/// recording: what it holds and what happened.
///
/// Ends with 0; with 65 when the file is no flight, of another version, or damaged: what stands before the
/// damage is shown; with 66 when there is no such file.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer runs show runs/daemon/20261122-091419-bigmag-planar-safe-stop-200.flight --picture trip.png"
)]
pub struct Show {
    /// The flight; or the recording of a run, or the run's folder.
    #[arg(value_name = "FILE")]
    flight: PathBuf,
    /// Show so many seconds before and after the trip in the table and the picture.
    #[arg(long, value_name = "S")]
    around: Option<f64>,
    /// Write every value of every cycle.
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Draw angles, currents, margin and lateness against time.
    #[cfg(feature = "figures")]
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `reason`, `from`, `to`, `cause`, `cause_code`, `trigger_cycle`, `trigger_time`,
/// `complete`, `records`, `extremes` and `rows`.
#[derive(Serialize)]
struct Answer<'a> {
    file: &'a PathBuf,
    reason: &'static str,
    from: &'static str,
    to: &'static str,
    cause: Option<&'static str>,
    cause_code: u32,
    worst_cause: Option<&'static str>,
    worst_cause_code: u32,
    trigger_cycle: u64,
    trigger_ns: u64,
    trigger_time: &'a str,
    rig: &'a str,
    rate_hz: f64,
    program: &'a str,
    config_sha256: &'a str,
    description_fingerprint: &'a str,
    started: &'a str,
    machine: &'a Machine,
    magnets: &'a [String],
    coils: &'a [String],
    frames: &'a [String],
    /// Records read.
    records: usize,
    /// Records written.
    records_written: u64,
    records_dropped: u64,
    /// Every checksum is right, to the end.
    complete: bool,
    /// How far it could be read, when not to its end.
    damage: Option<String>,
    #[serde(flatten)]
    extract: &'a Extract,
}

impl Show {
    pub fn run(&self) -> anyhow::Result<Exit> {
        if self.around.is_some_and(|around| !(around > 0.0 && around.is_finite())) {
            return Err(Failure::usage("--around: must be finite and > 0"));
        }
        #[cfg(feature = "record")]
        if super::recording::is_recording(&self.flight) {
            return super::recording::show(&self.flight, self.json);
        }
        let flight = Flight::read(&self.flight).map_err(refused)?;
        let (before, after) = self.around.map_or((BEFORE_S, f64::INFINITY), |around| (around, around));
        let extract = Extract::new(&flight, before, after, ROWS);
        if let Some(path) = &self.csv {
            csv::write(path, &flight)?;
        }
        self.draw(&flight)?;
        if self.json {
            output::json(&self.answer(&flight, &extract))?;
        } else {
            output::result(table::text(&flight, &extract))?;
        }
        match flight.ending.words() {
            None => Ok(Exit::Success),
            Some(words) => {
                let message = anyhow!(
                    "{}: {words}: {} of {} records are shown",
                    self.flight.display(),
                    flight.records(),
                    flight.header.records
                );
                Err(Failure::with(Exit::Data, message))
            }
        }
    }

    #[cfg(feature = "figures")]
    fn draw(&self, flight: &Flight) -> anyhow::Result<()> {
        self.picture.as_ref().map_or(Ok(()), |path| super::picture::draw(path, flight, self.around))
    }

    /// This build draws nothing.
    #[cfg(not(feature = "figures"))]
    fn draw(&self, _: &Flight) -> anyhow::Result<()> {
        Ok(())
    }

    fn answer<'a>(&'a self, flight: &'a Flight, extract: &'a Extract) -> Answer<'a> {
        let header = &flight.header;
        let words = |code: u32| (code != 0).then(|| cause::text(code));
        let damage = flight.ending.words();
        Answer {
            file: &self.flight,
            reason: header.reason.name(),
            from: state::name(header.from),
            to: state::name(header.to),
            cause: words(header.cause),
            cause_code: header.cause,
            worst_cause: words(header.worst_cause),
            worst_cause_code: header.worst_cause,
            trigger_cycle: header.trigger_cycle,
            trigger_ns: header.trigger_ns,
            trigger_time: &header.trigger_time,
            rig: &header.rig,
            rate_hz: header.rate_hz,
            program: &header.program,
            config_sha256: &header.config_sha256,
            description_fingerprint: &header.description_fingerprint,
            started: &header.started,
            machine: &header.machine,
            magnets: &header.magnets,
            coils: &header.coils,
            frames: &header.frames,
            records: flight.records(),
            records_written: header.records,
            records_dropped: header.records_dropped,
            complete: damage.is_none(),
            damage,
            extract,
        }
    }
}
