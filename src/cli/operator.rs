//! `magsteer arm`, `go`, `hold`, `retreat`, `stop`, `reset`, `estop`: one request to the daemon and its answer.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use magsteer::control::ReferenceTarget;
use magsteer_hal::HardwareDescription;
use magsteer_hal::channels::{ClientError, OperatorClient};
use magsteer_hal::operator::{Cause, OperatorAnswer, OperatorRequest, cause, state, verb};
use serde::Serialize;

use super::exit::{Exit, Failure};
use super::output;
use super::rig_file::{RigArgs, channel_failure};

/// How long to look for a daemon.
const DAEMON_WAIT: Duration = Duration::from_millis(500);
/// The daemon answers within 200 ms, or not at all; the rest is for a machine that stops processes.
pub const ANSWER_WAIT: Duration = Duration::from_millis(400);

/// The rig that a request is for.
#[derive(Debug, Args)]
#[command(
    after_help = "Ends with 0 when it was done, with 1 when the daemon refused and says why, with 69 when no daemon answers: \
    then it was not done.\n\nExample:\n  magsteer arm && magsteer target set m1=90deg m2=70deg && magsteer go"
)]
pub struct RequestArgs {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    rig: RigArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `accepted`, `state`, `cause` and `cause_code`.
#[derive(Serialize)]
struct Answer {
    accepted: bool,
    /// State after the request.
    state: &'static str,
    /// Why it was refused.
    cause: Option<&'static str>,
    cause_code: u32,
    /// Epoch that the daemon holds, 0 without authority.
    epoch: u64,
}

impl RequestArgs {
    /// Sends a request without content; one of [`magsteer_hal::operator::verb`].
    pub fn run(&self, verb: u32) -> anyhow::Result<Exit> {
        let mut client = connect(&self.rig, self.file.as_deref())?;
        request(&mut client, OperatorRequest { verb, ..OperatorRequest::default() }, self.json)
    }
}

/// Finds the daemon of a rig.
pub fn connect(rig: &RigArgs, file: Option<&Path>) -> anyhow::Result<OperatorClient> {
    OperatorClient::open(&rig.endpoint(file)?, DAEMON_WAIT).map_err(channel_failure)
}

/// The request for a target, which stays until the next one.
pub fn target_request(target: &ReferenceTarget, rig: &HardwareDescription) -> OperatorRequest {
    let count = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
    OperatorRequest {
        verb: verb::SET_TARGET,
        magnet_count: count(rig.magnets().count()),
        direction: target.directions,
        pose_parameter_count: count(target.frame_angles.map_or(0, |_| rig.frames.len())),
        angle_rad: target.frame_angles.unwrap_or_default(),
        ..OperatorRequest::default()
    }
}

/// Sends `request` and prints the answer.
pub fn request(client: &mut OperatorClient, request: OperatorRequest, json: bool) -> anyhow::Result<Exit> {
    tell(&send(client, request)?, json)
}

/// Sends `request` and returns the answer.
pub fn send(client: &mut OperatorClient, request: OperatorRequest) -> anyhow::Result<OperatorAnswer> {
    client.send(request, ANSWER_WAIT).map_err(client_failure)
}

/// A request without an answer, with its exit code.
fn client_failure(error: ClientError) -> anyhow::Error {
    let exit = match &error {
        ClientError::NoDaemon | ClientError::NoAnswer { .. } => Exit::Unavailable,
        ClientError::Transport { .. } => Exit::Io,
    };
    Failure::with(exit, anyhow::Error::new(error).context("not done"))
}

/// What helps where the cause alone does not say it.
fn remedy(answer: &OperatorAnswer) -> Option<&'static str> {
    let cause = Cause::from_code(answer.cause)?;
    match (answer.state, cause) {
        (_, Cause::RampTimeout | Cause::FeedbackStale) => Some(
            "start the driver where it has died: once it reports coils without current, `magsteer reset` \
             and `magsteer arm` go on",
        ),
        (state::FAULT, _) => Some("once that is mended, `magsteer reset` ends the fault"),
        _ => None,
    }
}

/// Prints an answer; its exit code.
pub fn tell(answer: &OperatorAnswer, json: bool) -> anyhow::Result<Exit> {
    let accepted = answer.accepted == 1;
    let (state, reason) = (state::name(answer.state), cause::text(answer.cause));
    if json {
        output::json(&Answer {
            accepted,
            state,
            cause: (!accepted).then_some(reason),
            cause_code: answer.cause,
            epoch: answer.epoch,
        })?;
    } else if accepted {
        output::result(format_args!("{state}\n"))?;
    }
    if accepted {
        return Ok(Exit::Success);
    }
    let remedy = remedy(answer).map_or(String::new(), |remedy| format!("; {remedy}"));
    output::error(format_args!("refused while {state}: {reason} (cause {}){remedy}", answer.cause));
    Ok(Exit::No)
}
