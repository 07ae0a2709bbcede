//! `magsteer target`: where the magnets are to point.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::{Args, Subcommand};
use magsteer::config::Experiment;
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::target::{AngleTarget, directions};
use magsteer::daemon::{StopFlag, TimingSummary};
use magsteer_hal::Stamp;
use magsteer_hal::channels::OperatorClient;
use magsteer_hal::operator::{OperatorAnswer, OperatorRequest, StatusMessage, state, verb, verdict};
use serde::Serialize;

use super::actuation::Numbers;
use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure};
use super::operator::{connect, send, tell};
use super::output;
use super::play::{Session, table, timing_line};
use super::rig_file::RigArgs;

/// How long to wait for a status of a daemon that is there.
const STATUS_WAIT: Duration = Duration::from_millis(1_500);
/// How long to wait until the way to a target was looked at: a hundred times what it takes.
const VERDICT_WAIT: Duration = Duration::from_secs(3);

/// Where the magnets are to point.
#[derive(Debug, Args)]
pub struct Target {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Set(Set),
    Play(Play),
}

/// Set the angles of magnets from global z.
///
/// A magnet that is not named keeps its target; where none was set, the direction in which it was measured.
/// While the daemon steers it looks at the way first, and refuses a target beyond a snap-through.
/// Ends with 0 when it was done, with 1 when the daemon refused, with 69 when no daemon answers.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer target set m1=70deg m2=110deg\n  magsteer target set m2=1.2rad --axis 1,0,0"
)]
struct Set {
    /// Angle of a magnet by its name, with its unit.
    #[arg(value_name = "NAME=ANGLE", required = true)]
    targets: Vec<AngleTarget>,
    /// Axis about which the targets turn from z, world; right-handed. About y, 90 deg points along x.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,1,0", allow_hyphen_values = true)]
    axis: Numbers<3>,
    #[command(flatten)]
    rig: RigArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Target {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.action {
            Action::Set(set) => set.run(),
            Action::Play(play) => play.run(),
        }
    }
}

/// Play an experiment: set its targets one after another, and judge how each was reached.
///
/// The daemon must be steering (`arm`, `go`). Steps are judged by measured tangents, or by the true ones of a simulated rig. The last
/// targets stay set. Ends with 0 when every step settled, with 1 when one did not or the daemon stopped steering.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer arm && magsteer go && magsteer target play config/experiments/planar.toml"
)]
struct Play {
    /// Experiment (TOML).
    #[arg(value_name = "STEPS")]
    experiment: PathBuf,
    #[command(flatten)]
    rig: RigArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are those of `demo --json`; `files` is empty.
#[derive(Serialize)]
struct PlayAnswer<'a> {
    all_settled: bool,
    steps: Vec<&'a StepResponse>,
    #[serde(rename = "loop")]
    timing: Option<&'a TimingSummary>,
    files: [&'a str; 0],
    judged_by_truth: bool,
}

impl Play {
    fn run(&self) -> anyhow::Result<Exit> {
        let description = self.rig.load(None)?.description;
        let experiment = Experiment::load(&self.experiment, &description).map_err(Failure::data)?;
        let endpoint = self.rig.endpoint(None)?;
        let stop = Arc::new(StopFlag::new());
        let played = watching(
            &stop,
            false,
            || (),
            || {
                let mut session = Session::open(&endpoint, STATUS_WAIT)?;
                let status = session.wait_for_status(STATUS_WAIT)?;
                if !matches!(status.state, state::ACTIVE | state::HOLDING) {
                    let message = anyhow::anyhow!(
                        "the daemon is {}: arm it and let it go before playing",
                        state::name(status.state)
                    );
                    return Err(Failure::with(Exit::No, message));
                }
                session.play(&experiment, &description, &stop)
            },
        )??;
        if stop.requested().is_some() {
            output::note("broken off; the last targets stay set");
            return Ok(exit_of(&stop));
        }
        if self.json {
            output::json(&PlayAnswer {
                all_settled: played.all_settled(),
                steps: played.steps.iter().map(|step| &step.response).collect(),
                timing: played.timing.as_ref(),
                files: [],
                judged_by_truth: played.judged_by_truth,
            })?;
        } else {
            let timing = played.timing.as_ref().map_or(String::new(), timing_line);
            output::result(format_args!("\n{}\n{timing}", table(&played)))?;
        }
        Ok(if played.all_settled() { Exit::Success } else { Exit::No })
    }
}

impl Set {
    fn run(&self) -> anyhow::Result<Exit> {
        let description = self.rig.load(None)?.description;
        let magnets: Vec<&str> = description.magnets().map(|magnet| magnet.name.as_str()).collect();
        let asked =
            |present: &_| directions(&self.targets, self.axis.0, &magnets, present).map_err(Failure::usage);
        // What is wrong with the arguments is said whether or not a daemon is there.
        asked(&Default::default())?;
        let mut client = connect(&self.rig, None)?;
        let present = if self.targets.len() < magnets.len() {
            present_target(&await_status(&mut client)?)
        } else {
            Default::default()
        };
        let count = u32::try_from(magnets.len()).unwrap_or(u32::MAX);
        let direction = asked(&present)?;
        let message =
            OperatorRequest { verb: verb::SET_TARGET, magnet_count: count, direction, ..Default::default() };
        let answer = send(&mut client, message)?;
        let steers = matches!(answer.state, state::ACTIVE | state::HOLDING);
        if answer.accepted == 0 || !steers {
            return tell(&answer, self.json);
        }
        let status = await_verdict(&mut client)?;
        match status.target_verdict {
            verdict::REFUSED => tell(
                &OperatorAnswer { accepted: 0, cause: status.cause, state: status.state, ..answer },
                self.json,
            ),
            verdict::OUT_OF_REACH => {
                output::note(
                    "the currents reach their limits before the target: the loop goes as far as they lead",
                );
                tell(&answer, self.json)
            }
            _ => tell(&answer, self.json),
        }
    }
}

/// The first status after the daemon looked at the way to the target that it took just now.
fn await_verdict(client: &mut OperatorClient) -> anyhow::Result<StatusMessage> {
    // A cycle that begins from now on knows of the target.
    let taken = Stamp::now();
    loop {
        let status = await_status(client)?;
        let knows = status.header.source_stamp() > taken;
        if knows && status.target_verdict != verdict::CHECKING {
            return Ok(status);
        }
        if Stamp::now().since(taken) > VERDICT_WAIT {
            let message =
                anyhow::anyhow!("the target was taken, but the way to it was not looked at in time");
            return Err(Failure::with(Exit::Unavailable, message));
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The target as set, or where none was set the measured tangents.
fn present_target(status: &StatusMessage) -> magsteer::control::Directions {
    let is_set = status.target_direction[0] != [0.0; 3];
    if is_set { status.target_direction } else { status.measured_direction }
}

/// The daemon's next status.
pub fn await_status(client: &mut OperatorClient) -> anyhow::Result<StatusMessage> {
    let begin = Instant::now();
    loop {
        if let Some(status) = client.newest_status(Stamp::now()) {
            return Ok(status);
        }
        if begin.elapsed() > STATUS_WAIT {
            let message = anyhow::anyhow!("no daemon publishes its status on this rig");
            return Err(Failure::with(Exit::Unavailable, message));
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
