//! `magsteer fault`: makes the driver of a rig go wrong, now.

use std::time::Duration;

use clap::{Args, Subcommand};
use magsteer_hal::channels::{FaultClient, FaultClientError};
use magsteer_hal::fault::{
    EpochChange, FaultAnswer, FaultConfig, FaultRequest, FaultTarget, Garbage, Reach, Scheduled, VerbName,
    refusal_text,
};
use magsteer_hal::invalid::{Checks, Invalid};
use serde::de::value::{Error as WordError, StrDeserializer};
use serde::{Deserialize, Serialize};

use super::exit::{Exit, Failure};
use super::operator::ANSWER_WAIT;
use super::output;
use super::rig_file::{RigArgs, channel_failure};

/// How long to look for a driver.
const DRIVER_WAIT: Duration = Duration::from_millis(500);

/// Make the driver of a rig go wrong, to see the daemon answer.
///
/// The driver must have been started to allow it (`sim-plant --allow-faults`). Faults of real amplifiers stay
/// within the rig's limits, and a cut always passes. Ends with 0 when it was done, with 1 when the driver
/// refused, with 69 when there is no driver, with 77 when it does not allow faults.
#[derive(Debug, Args)]
#[command(
    after_help = "Verbs of poses, feedback and actuators: off, stuck, garbage, slow, delayed, intermittent, repeated, backward,\n\
    wrong-epoch, wrong-version; of a coil: open, shorted, stuck-amplifier; of a frame: stalled.\n\nExamples:\n  \
    magsteer fault poses off --for 0.1\n  magsteer fault poses stuck --magnet m2\n  \
    magsteer fault feedback delayed --delay-ms 300 --for 2\n  magsteer fault actuators garbage --garbage random --coil air-top\n  \
    magsteer fault clear"
)]
pub struct Fault {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// What the sensor says of the magnets.
    Poses(Begin),
    /// What the driver says of currents, angles and itself.
    Feedback(Begin),
    /// Commands on their way to the driver's guard, and set points on their way to amplifiers and motors.
    Actuators(Begin),
    /// One coil with its amplifier, in a simulated plant.
    Coil(Begin),
    /// One frame with its motor, in a simulated plant.
    Frame(Begin),
    /// End every fault, and forget those that a plan still holds.
    Clear(Clear),
}

#[derive(Debug, Args)]
struct Begin {
    /// What it does.
    #[arg(value_name = "VERB", value_parser = word::<VerbName>)]
    verb: VerbName,
    /// How long it lasts, s; until it is cleared when left out.
    #[arg(long = "for", value_name = "S")]
    for_s: Option<f64>,
    /// The one magnet, by name; all of them when left out.
    #[arg(long, value_name = "NAME")]
    magnet: Option<String>,
    /// The one coil, by name.
    #[arg(long, value_name = "NAME")]
    coil: Option<String>,
    /// The one frame, by name.
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Kind of garbage: nan, huge, quaternion or random.
    #[arg(long, value_name = "KIND", value_parser = word::<Garbage>)]
    garbage: Option<Garbage>,
    /// Of slow: messages a second; for actuators, corner frequency of the lag.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Of delayed, ms.
    #[arg(long, value_name = "MS")]
    delay_ms: Option<f64>,
    /// Of intermittent, ms.
    #[arg(long, value_name = "MS")]
    period_ms: Option<f64>,
    /// Share of the period in which intermittent is off.
    #[arg(long, value_name = "SHARE")]
    off_fraction: Option<f64>,
    /// How wrong-epoch is wrong: other or every-message.
    #[arg(long, value_name = "HOW", value_parser = word::<EpochChange>)]
    epoch: Option<EpochChange>,
    /// Share of the turns that are shorted.
    #[arg(long, value_name = "SHARE")]
    turns_fraction: Option<f64>,
    #[command(flatten)]
    rig: RigArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Clear {
    #[command(flatten)]
    rig: RigArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `accepted`, `active`, `cleared` and `reason`.
#[derive(Serialize)]
struct Answer {
    accepted: bool,
    /// Faults that act now, one that begins with this request not yet included.
    active: u32,
    /// Faults that were cleared.
    cleared: u32,
    /// Why it was refused.
    reason: Option<&'static str>,
}

impl Fault {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.action {
            Action::Poses(begin) => begin.run(FaultTarget::Poses),
            Action::Feedback(begin) => begin.run(FaultTarget::Feedback),
            Action::Actuators(begin) => begin.run(FaultTarget::Actuators),
            Action::Coil(begin) => begin.run(FaultTarget::Coil),
            Action::Frame(begin) => begin.run(FaultTarget::Frame),
            Action::Clear(clear) => {
                let answer = ask(&clear.rig, FaultRequest::clear())?;
                tell(&answer, clear.json, format_args!("faults cleared: {}", answer.cleared))
            }
        }
    }
}

impl Begin {
    fn run(&self, target: FaultTarget) -> anyhow::Result<Exit> {
        let Scheduled { fault, lasts, .. } = self.scheduled(target)?;
        let answer = ask(&self.rig, FaultRequest::begin(&fault, lasts))?;
        let time = match lasts {
            Some(lasts) => format!("for {} s", lasts.as_secs_f64()),
            None => "until it is cleared".to_owned(),
        };
        tell(&answer, self.json, format_args!("{fault}, {time}"))
    }

    /// The fault, checked like one of a plan.
    fn scheduled(&self, target: FaultTarget) -> anyhow::Result<Scheduled> {
        let description = self.rig.load(None)?.description;
        let config = FaultConfig {
            magnet: self.magnet.clone(),
            coil: self.coil.clone(),
            frame: self.frame.clone(),
            garbage: self.garbage,
            rate_hz: self.rate_hz,
            delay_ms: self.delay_ms,
            period_ms: self.period_ms,
            off_fraction: self.off_fraction,
            epoch: self.epoch,
            turns_fraction: self.turns_fraction,
            ..FaultConfig::immediate(target, self.verb, self.for_s)
        };
        let mut checks = Checks::new();
        // Whether the driver's faults go as deep as a plant is the driver's to say.
        let built = config.build("", &description, Reach::Plant, &mut checks);
        match (built, checks.into_result(())) {
            (Some(scheduled), Ok(())) => Ok(scheduled),
            (_, refused) => {
                let words: Vec<String> = refused.err().unwrap_or_default().iter().map(as_argument).collect();
                Err(Failure::usage(words.join("\n")))
            }
        }
    }
}

/// A refused key as it stands on the command line.
fn as_argument(refused: &Invalid) -> String {
    let Invalid { key, value, expected } = refused;
    let argument = match key.as_str() {
        "verb" => "VERB".to_owned(),
        "for_s" => "--for".to_owned(),
        key => format!("--{}", key.replace('_', "-")),
    };
    format!("{argument} = {value}: must be {expected}")
}

fn ask(rig: &RigArgs, request: FaultRequest) -> anyhow::Result<FaultAnswer> {
    let endpoint = rig.endpoint(None)?;
    let mut client = FaultClient::open(&endpoint, DRIVER_WAIT).map_err(failure)?;
    client.send(request, ANSWER_WAIT).map_err(failure)
}

/// A request without an answer, with its exit code.
fn failure(error: FaultClientError) -> anyhow::Error {
    let exit = match error {
        FaultClientError::Channel(error) => return channel_failure(error),
        FaultClientError::NoDriver { .. } | FaultClientError::NoAnswer { .. } => Exit::Unavailable,
        FaultClientError::NotAllowed { .. } => Exit::NoPermission,
        FaultClientError::Transport { .. } => Exit::Io,
    };
    Failure::with(exit, anyhow::anyhow!("not done: {error}"))
}

fn tell(answer: &FaultAnswer, json: bool, done: std::fmt::Arguments<'_>) -> anyhow::Result<Exit> {
    let accepted = answer.accepted == 1;
    let reason = refusal_text(answer.reason);
    if json {
        output::json(&Answer {
            accepted,
            active: answer.active,
            cleared: answer.cleared,
            reason: (!accepted).then_some(reason),
        })?;
    } else if accepted {
        output::result(format_args!("{done}\n"))?;
    }
    if accepted {
        return Ok(Exit::Success);
    }
    output::error(format_args!("the driver refused: {reason}"));
    Ok(Exit::No)
}

/// One of the words of a plan's file.
fn word<T: for<'word> Deserialize<'word>>(text: &str) -> Result<T, WordError> {
    T::deserialize(StrDeserializer::new(text))
}
