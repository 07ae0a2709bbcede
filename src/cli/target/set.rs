//! `magsteer target set`.

use std::collections::BTreeMap;
use std::time::Duration;

use clap::{Args, ValueEnum};
use magsteer::config::{Config, Document, Experiment, ExperimentStep, Until};
use magsteer::control::{Directions, ReferenceTarget};
use magsteer::daemon::target::{MagnetTarget, directions};
use magsteer_hal::Stamp;
use magsteer_hal::channels::OperatorClient;
use magsteer_hal::operator::{OperatorAnswer, StatusMessage, state, verdict};

use super::command::{await_status, present_target};
use super::dry_run::{DryRun, Start};
use super::play::{guide, play_and_tell, require_steering};
use crate::cli::actuation::Numbers;
use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::{connect, send, target_request, tell};
use crate::cli::output;
use crate::cli::plan::NamedAngles;
use crate::cli::rig_file::RigArgs;

/// How long to wait until the way to a target was looked at: a hundred times what it takes.
const VERDICT_WAIT: Duration = Duration::from_secs(3);

/// Set where magnets shall point.
///
/// A magnet that is not named keeps its target; where none was set, the direction in which it was measured.
/// While the daemon steers it looks at the way first, and refuses a target beyond a snap-through.
/// Ends with 0 when it was done, with 1 when the daemon refused or the magnets did not settle, with 69 when no daemon answers.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  magsteer target set m1=70deg m2=110deg --wait settled\n  \
    magsteer target set m2=1.2rad --axis 1,0,0\n  magsteer target set m1=0.95,0.25,-0.17 --frames bottom=45,top=60 --dry-run\n  \
    magsteer target set m1=0.95,0.25,-0.17 m2=0.2,0.3,-0.93 --plan")]
pub struct Set {
    /// Angle from z of a magnet by its name, with its unit, or its direction in the world.
    #[arg(value_name = "NAME=ANGLE|X,Y,Z", required = true)]
    targets: Vec<MagnetTarget>,
    /// Axis about which angles turn from z, world; right-handed. About y, 90 deg points along x.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,1,0", allow_hyphen_values = true)]
    axis: Numbers<3>,
    /// Where the frames shall stand when the magnets have arrived, deg; left to the daemon when left out.
    #[arg(long, value_name = "NAME=DEG,...", allow_hyphen_values = true)]
    frames: Option<NamedAngles>,
    /// Find the way: it is planned from where the rig is, with the frames where they suit, and planned anew when the daemon refuses a
    /// part of it or the magnets end beside the target. Where no way leads on, the currents go to zero and the next way begins at
    /// rest. Waits until the magnets have settled. Needs [control.plan].
    #[arg(long, conflicts_with_all = ["frames", "wait", "dry_run"])]
    plan: bool,
    /// Wait until the magnets are there.
    #[arg(long, value_name = "EVENT", conflicts_with = "dry_run")]
    wait: Option<WaitFor>,
    /// How long to wait at most, s.
    #[arg(long, value_name = "S", default_value = "10", requires = "wait", value_parser = patience)]
    timeout_s: f64,
    /// Ask the model alone whether the target can be reached, with which currents and how stably; sets nothing. Begins where a
    /// daemon's rig is, or at rest where no daemon answers.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    rig: RigArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What `--wait` waits for.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum WaitFor {
    /// Every magnet stays within 1 degree of its target for a quarter of a second.
    Settled,
}

impl Set {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let (document, config) = self.rig.document(None)?;
        let rig = &config.description;
        let frames = self.frames.as_ref().map(|frames| frames.for_rig("--frames", rig)).transpose()?;
        // What is wrong with the arguments is said whether or not a daemon is there.
        self.asked(&config, &Directions::default())?;
        let target = |status: Option<&StatusMessage>| {
            let present = status.map(present_target).unwrap_or_default();
            let directions = self.asked(&config, &present)?;
            anyhow::Ok(ReferenceTarget { directions, frame_angles: frames })
        };
        if self.dry_run {
            let status = connect(&self.rig, None).and_then(|mut client| await_status(&mut client)).ok();
            let mut run = DryRun::new(&document, &config, Start::of(status.as_ref()))?;
            let target = target(status.as_ref())?;
            run.step(&target);
            return run.tell(self.json);
        }
        let mut client = connect(&self.rig, None)?;
        let names_all = self.targets.len() == rig.magnets().count();
        let waits = self.plan || self.wait.is_some();
        let status = if names_all && !waits { None } else { Some(await_status(&mut client)?) };
        let target = target(status.as_ref())?;
        if let Some(status) = status.filter(|_| waits) {
            drop(client);
            return self.wait_settled(&document, &config, &target, &status);
        }
        let answer = send(&mut client, target_request(&target, rig))?;
        let steers = matches!(answer.state, state::ACTIVE | state::HOLDING);
        if answer.accepted == 0 || !steers {
            return tell(&answer, self.json);
        }
        let status = await_verdict(&mut client)?;
        self.tell_verdict(answer, &status)
    }

    /// What the arguments ask for.
    fn asked(&self, config: &Config, present: &Directions) -> anyhow::Result<Directions> {
        let magnets: Vec<&str> = config.description.magnets().map(|magnet| magnet.name.as_str()).collect();
        directions(&self.targets, self.axis.0, &magnets, present).map_err(Failure::usage)
    }

    fn tell_verdict(&self, answer: OperatorAnswer, status: &StatusMessage) -> anyhow::Result<Exit> {
        match status.target_verdict {
            verdict::REFUSED => {
                let refused =
                    OperatorAnswer { accepted: 0, cause: status.cause, state: status.state, ..answer };
                return tell(&refused, self.json);
            }
            verdict::OUT_OF_REACH => output::note(
                "the currents reach their limits before the target: the loop goes as far as they lead",
            ),
            _ => {}
        }
        tell(&answer, self.json)
    }

    /// Plays the target as a script of one step, which ends when it has settled.
    fn wait_settled(
        &self,
        document: &Document,
        config: &Config,
        target: &ReferenceTarget,
        status: &StatusMessage,
    ) -> anyhow::Result<Exit> {
        if status.state == state::HOLDING {
            output::note("the daemon holds: it goes on after `magsteer go`");
        }
        let rig = &config.description;
        let named = rig.magnets().map(|magnet| magnet.name.clone());
        let angles = target.frame_angles.unwrap_or_default().map(f64::to_degrees);
        let frames = rig.frames.iter().map(|frame| frame.name.clone()).zip(angles);
        let step = ExperimentStep {
            target_direction: named.zip(target.directions).collect(),
            frames_deg: if target.frame_angles.is_some() { frames.collect() } else { BTreeMap::new() },
            duration_s: self.timeout_s,
            until: Some(Until::Settled),
            ..ExperimentStep::default()
        };
        let experiment = Experiment {
            description: String::new(),
            axis: [0.0, 1.0, 0.0],
            zero_direction: [0.0, 0.0, 1.0],
            steps: vec![step],
        };
        if self.plan {
            require_steering(status)?;
        }
        let guide = self.plan.then(|| guide(document, config, &experiment)).transpose()?;
        play_and_tell(&self.rig, rig, &experiment, guide, self.json)
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

/// How long to wait, s.
fn patience(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "must be a number".to_owned())?;
    if value > 0.0 && value <= 3600.0 {
        Ok(value)
    } else {
        Err("must be above 0 and at most 3600".to_owned())
    }
}
