//! `magsteer target`: where the magnets are to point.

use std::time::{Duration, Instant};

use clap::{Args, Subcommand};
use magsteer::daemon::target::{AngleTarget, directions};
use magsteer_hal::Stamp;
use magsteer_hal::channels::OperatorClient;
use magsteer_hal::operator::{OperatorRequest, StatusMessage, verb};

use super::actuation::Numbers;
use super::exit::{Exit, Failure};
use super::operator::{connect, request};
use super::rig_file::RigArgs;

/// How long to wait for a status of a daemon that is there.
const STATUS_WAIT: Duration = Duration::from_millis(1_500);

/// Where the magnets are to point.
#[derive(Debug, Args)]
pub struct Target {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Set(Set),
}

/// Set the angles of magnets from global z.
///
/// A magnet that is not named keeps its target; where none was set, the direction in which it was measured.
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
        }
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
        let message = OperatorRequest { verb: verb::SET_TARGET, magnet_count: count, direction };
        request(&mut client, message, self.json)
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
