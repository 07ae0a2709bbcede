//! `magsteer target stream`: targets of another program, as they come.

use std::io::BufRead;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use anyhow::anyhow;
use clap::{Args, value_parser};
use magsteer::config::TargetLines;
use magsteer::daemon::StopFlag;
use magsteer_hal::channels::OperatorClient;
use magsteer_hal::operator::{OperatorRequest, cause, state};
use serde::Serialize;

use super::command::{await_status, present_target};
use crate::cli::actuation::Numbers;
use crate::cli::ending::{exit_of, watching};
use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::{connect, send, target_request};
use crate::cli::output;
use crate::cli::rig_file::RigArgs;

/// How often signals are looked at while no line comes.
const POLL: Duration = Duration::from_millis(50);

/// Take targets from standard input, a JSON object a line, as they come.
///
/// A magnet that a line does not name keeps its target. When lines come faster than the daemon takes targets, the newest wins. When
/// none comes for the time that a target is valid the daemon holds, whatever became of this program, and goes on after `magsteer go`.
/// Ends with 0 at the end of the input, with 65 at a line that is refused, with 1 when the daemon refuses.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    echo '{\"target_deg\": {\"m1\": 80, \"m2\": 100}}' | magsteer target stream\n\n\
    Keys of a line, as in an experiment: target_deg (angle from z by magnet), target_direction (x, y, z by magnet),\n\
    frames_deg (all frames or none).")]
pub struct Stream {
    /// How long a target is valid, ms; with 0 the last one stays.
    #[arg(long, value_name = "MS", default_value = "200", value_parser = value_parser!(u32).range(0..=60_000))]
    valid_ms: u32,
    /// Axis about which angles turn from z, world; right-handed. About y, 90 deg points along x.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,1,0", allow_hyphen_values = true)]
    axis: Numbers<3>,
    #[command(flatten)]
    rig: RigArgs,
    /// At the end, print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What became of the lines. The keys are stable.
#[derive(Debug, Default, Serialize)]
struct Tally {
    lines: u64,
    /// Targets that the daemon took.
    sent: u64,
    /// Lines that a newer one replaced before they were sent.
    skipped: u64,
}

impl Stream {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let rig = self.rig.load(None)?.description;
        let axis = self.axis.0;
        if axis.iter().map(|component| component * component).sum::<f64>() < 1e-18 {
            return Err(Failure::usage("--axis: must be finite and not zero"));
        }
        let mut client = connect(&self.rig, None)?;
        let present = present_target(&await_status(&mut client)?);
        let reader = TargetLines::new(&rig, axis, present);
        let stop = Arc::new(StopFlag::new());
        let (lines, input) = channel();
        std::thread::Builder::new().name("magsteer-lines".to_owned()).spawn(move || read_lines(&lines))?;
        let tally = watching(&stop, false, || (), || self.serve(&mut client, reader, &input, &stop))??;
        if self.json {
            output::json(&tally)?;
        } else {
            let ending = if self.valid_ms > 0 { "the daemon holds" } else { "the last target stays" };
            let Tally { lines, sent, skipped } = tally;
            output::note(format_args!("{lines} lines, {sent} targets set, {skipped} skipped; {ending}"));
        }
        Ok(exit_of(&stop))
    }

    /// Sends the newest target again and again, until the input or the program ends.
    fn serve(
        &self,
        client: &mut OperatorClient,
        mut reader: TargetLines<'_>,
        input: &Receiver<std::io::Result<String>>,
        stop: &StopFlag,
    ) -> anyhow::Result<Tally> {
        let mut tally = Tally::default();
        let mut told_holding = false;
        while stop.requested().is_none() {
            let first = match input.recv_timeout(POLL) {
                Ok(line) => line,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let mut newest = None;
            for line in std::iter::once(first).chain(input.try_iter()) {
                tally.lines += 1;
                tally.skipped += u64::from(newest.is_some());
                let number = tally.lines;
                let target = reader.target(&line?);
                let refuse = |what| Failure::with(Exit::Data, anyhow!("line {number}: {what}"));
                newest = Some(target.map_err(refuse)?);
            }
            let Some(target) = newest else { continue };
            let request =
                OperatorRequest { valid_ms: self.valid_ms, ..target_request(&target, reader.rig()) };
            let answer = send(client, request)?;
            if answer.accepted != 1 {
                let message = anyhow!("line {}: refused: {}", tally.lines, cause::text(answer.cause));
                return Err(Failure::with(Exit::No, message));
            }
            tally.sent += 1;
            if answer.state != state::ACTIVE && !told_holding {
                told_holding = true;
                let state = state::name(answer.state);
                output::note(format_args!("the daemon is {state}: it steers after `magsteer go`"));
            }
        }
        Ok(tally)
    }
}

/// Hands lines over until the input ends, or nobody takes them any more.
fn read_lines(lines: &Sender<std::io::Result<String>>) {
    for line in std::io::stdin().lock().lines() {
        let failed = line.is_err();
        let is_blank = line.as_ref().is_ok_and(|text| text.trim().is_empty());
        if !is_blank && lines.send(line).is_err() || failed {
            return;
        }
    }
}
