//! The process of `bridge foxglove`: address, loop, end.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::anyhow;
use clap::{Args, Subcommand};
use foxglove::{Context, WebSocketServer};
use magsteer::daemon::StopFlag;
use magsteer::live::{Link, Viewer};
use magsteer_hal::Stamp;

use super::topics::Topics;
use crate::cli::ending::{exit_of, watching};
use crate::cli::exit::{Exit, Failure};
use crate::cli::output;
use crate::cli::rig_file::RigArgs;
use crate::cli::viewing::give_way;

/// Between two messages of a topic.
const PERIOD: Duration = Duration::from_millis(50);

/// Show a rig in other programs.
#[derive(Debug, Args)]
pub struct Bridge {
    #[command(subcommand)]
    to: To,
}

#[derive(Debug, Subcommand)]
enum To {
    Foxglove(Foxglove),
}

/// Serve a rig's poses, currents, timing and a 3-D scene to Foxglove, by its WebSocket protocol.
///
/// For looking alone: no command comes through it. config/magsteer.foxglove-layout.json is a layout for
/// Foxglove that shows everything. Waits for a daemon that is not there yet, and goes on with one that was
/// started anew.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer bridge foxglove config/bigmag-planar.toml")]
struct Foxglove {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    rig: RigArgs,
    /// Address and port to serve; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8765")]
    bind: SocketAddr,
    /// Serve an address that other machines reach too.
    #[arg(long)]
    allow_remote_viewing: bool,
    /// Folder of the daemon's journal, in place of the configuration's.
    #[arg(long, value_name = "FOLDER")]
    journal: Option<PathBuf>,
}

impl Bridge {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let To::Foxglove(foxglove) = &self.to;
        foxglove.run()
    }
}

impl Foxglove {
    fn run(&self) -> anyhow::Result<Exit> {
        if !self.bind.ip().is_loopback() && !self.allow_remote_viewing {
            return Err(Failure::usage(format_args!(
                "{}: other machines would reach this address: give a loopback address, or --allow-remote-viewing",
                self.bind.ip()
            )));
        }
        let config = self.rig.load(self.file.as_deref())?;
        let endpoint = self.rig.endpoint(self.file.as_deref())?;
        give_way();
        let mut viewer = Viewer::new(endpoint, &config, self.journal.clone());
        let stop = Arc::new(StopFlag::new());
        watching(
            &stop,
            false,
            || (),
            || {
                let context = Context::new();
                let server = WebSocketServer::new()
                    .name(format!("magsteer {}", config.description.rig))
                    .bind(self.bind.ip().to_string(), self.bind.port())
                    .context(&context);
                let server = server.start_blocking().map_err(|error| {
                    Failure::with(Exit::CannotCreate, anyhow!("{}: cannot be served: {error}", self.bind))
                })?;
                let host = SocketAddr::new(self.bind.ip(), server.port());
                output::result(format_args!("ws://{host}\n"))?;
                serve(&mut viewer, &mut Topics::new(&context, &config)?, &stop);
                server.stop().wait_blocking();
                Ok(exit_of(&stop))
            },
        )?
    }
}

/// Publishes what is present; of a silent daemon there is nothing to publish.
fn serve(viewer: &mut Viewer, topics: &mut Topics, stop: &StopFlag) {
    while stop.requested().is_none() {
        let now = Stamp::now();
        viewer.look(now);
        let figures = viewer.figures(now, true);
        if let Some(status) = viewer.newest().filter(|_| figures.link == Link::Attached) {
            topics.publish(viewer.rig(), status, &figures);
        }
        topics.tell(viewer.rig(), viewer.events());
        std::thread::sleep(PERIOD);
    }
}
