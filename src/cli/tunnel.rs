//! `magsteer tunnel`: a rig watched from another machine.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::{Args, Subcommand};
use magsteer::daemon::StopFlag;
use magsteer::tunnel::{Address, Side, Tunnel as Running, TunnelError, TunnelPlan, find};
use magsteer_hal::Stamp;
use magsteer_hal::channels::{Endpoint, SharedEnd, TunnelFacts, WatchedEnd};
use magsteer_hal::operator::{Cause, OperatorAnswer, state};

use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure};
use super::output;
use super::rig_file::{RigArgs, channel_failure, keep_files_private};
use super::viewing::give_way;

/// Between two looks for requests, and at the tunnel.
const POLL: Duration = Duration::from_millis(5);
/// A rig that was not heard for so long is told of.
const SILENCE: Duration = Duration::from_secs(3);

/// Watch and record a rig from another machine.
///
/// The transport's own tunnel, iox2-link-tunnel-zenoh, carries the status and every cycle from the rig's
/// machine to those that watch. No command passes it: a rig is commanded on its own machine. The loop does
/// not notice.
#[derive(Debug, Args)]
#[command(after_help = "Example, by ssh so that nobody else can look:\n  rig$ magsteer tunnel share\n  \
    desk$ ssh -N -L 7447:127.0.0.1:7447 rig &\n  desk$ magsteer tunnel watch &\n  desk$ magsteer top\n\n\
    To command from afar, do so on the rig's machine:\n  desk$ ssh rig magsteer stop")]
pub struct Tunnel {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Share(Share),
    Watch(Watch),
}

/// Let other machines watch this machine's rig.
///
/// Whoever reaches the address can watch and record, and can do nothing else. Waits for a daemon that is not
/// there yet.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer tunnel share config/bigmag-planar.toml --listen 10.0.0.5:7447")]
struct Share {
    #[command(flatten)]
    common: Common,
    /// Address and port at which watching machines come in. Nothing is encrypted.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:7447")]
    listen: Address,
}

/// Watch a rig that another machine shares.
///
/// While it runs `status`, `top`, `web` and `record` work here as they do there, with the same configuration
/// file; requests are refused. Stamps are told by this machine's clock: an age is what came on top of the
/// shortest way here.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer tunnel watch config/bigmag-planar.toml --connect 10.0.0.5:7447")]
struct Watch {
    #[command(flatten)]
    common: Common,
    /// Where the rig's machine listens.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:7447")]
    connect: Address,
}

#[derive(Debug, Args)]
struct Common {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    rig: RigArgs,
    /// The tunnel's program; iox2-link-tunnel-zenoh on PATH when left out.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
}

impl Tunnel {
    pub fn run(&self) -> anyhow::Result<Exit> {
        keep_files_private();
        give_way();
        match &self.action {
            Action::Share(share) => share.run(),
            Action::Watch(watch) => watch.run(),
        }
    }
}

impl Share {
    fn run(&self) -> anyhow::Result<Exit> {
        let (endpoint, program) = self.common.found()?;
        let side = Side::Share { listen: self.listen.clone() };
        run(&endpoint, &program, side, || {
            let end = SharedEnd::open(&endpoint).map_err(channel_failure)?;
            let (listen, rig) = (&self.listen, endpoint.rig());
            output::note(format_args!(
                "sharing rig {rig} at {listen}: its status and every cycle; no commands"
            ));
            if !listen.is_loopback() {
                output::note("nothing is encrypted there, and whoever reaches it can watch");
            }
            // Held for as long as the tunnel runs.
            Ok(move || _ = &end)
        })
    }
}

impl Watch {
    fn run(&self) -> anyhow::Result<Exit> {
        let (endpoint, program) = self.common.found()?;
        let side = Side::Watch { connect: self.connect.clone() };
        run(&endpoint, &program, side, || {
            let mut end = WatchedEnd::create(&endpoint).map_err(channel_failure)?;
            let (connect, rig) = (&self.connect, endpoint.rig());
            output::note(format_args!("watching rig {rig} at {connect}; commands are refused here"));
            let mut heard = Heard { since: Instant::now(), sequence: None, is_told: None };
            Ok(move || serve(&mut end, &mut heard))
        })
    }
}

/// Refuses what is asked for on a watching machine, and says whether the rig is heard.
fn serve(end: &mut WatchedEnd, heard: &mut Heard) {
    let status = end.newest_status(Stamp::now());
    while let Some(request) = end.next_request() {
        let state = status.map_or(state::BOOT, |status| status.state);
        let cause = Cause::OnlyWatched.code();
        // Whoever asked may be gone by now; then nothing is lost.
        let _ = request.answer(OperatorAnswer { cause, state, ..OperatorAnswer::default() });
    }
    match heard.take(status.map(|status| (status.header.epoch, status.header.sequence))) {
        Some(true) => output::note("the rig is heard"),
        Some(false) => output::note(
            "nothing is heard of the rig: is its daemon running, and `magsteer tunnel share` there, by the same \
            version of magsteer?",
        ),
        None => {}
    }
}

/// Whether the rig is heard, told when it changes.
struct Heard {
    since: Instant,
    sequence: Option<(u64, u64)>,
    is_told: Option<bool>,
}

impl Heard {
    fn take(&mut self, sequence: Option<(u64, u64)>) -> Option<bool> {
        if sequence != self.sequence {
            (self.sequence, self.since) = (sequence, Instant::now());
        }
        let is_silent = self.since.elapsed() > SILENCE;
        let is_heard = sequence.is_some() && !is_silent;
        if self.is_told == Some(is_heard) || !is_heard && !is_silent {
            return None;
        }
        self.is_told = Some(is_heard);
        self.is_told
    }
}

impl Common {
    /// The channels and the program.
    fn found(&self) -> anyhow::Result<(Endpoint, PathBuf)> {
        let endpoint = self.rig.endpoint(self.file.as_deref())?;
        let path = std::env::var_os("PATH");
        let program = find(self.program.as_deref(), path.as_deref()).map_err(failure)?;
        Ok((endpoint, program))
    }
}

/// Takes this machine's place on the channels, runs the tunnel until told to end, and looks again and again
/// meanwhile.
fn run<L: FnMut()>(
    endpoint: &Endpoint,
    program: &Path,
    side: Side,
    begin: impl FnOnce() -> anyhow::Result<L>,
) -> anyhow::Result<Exit> {
    let facts = TunnelFacts::of(endpoint).map_err(channel_failure)?;
    let plan = TunnelPlan { rig: endpoint.rig().to_owned(), side, facts };
    let stop = Arc::new(StopFlag::new());
    let work = || {
        // In place before the tunnel looks for the topics, and until it has ended.
        let mut look = begin()?;
        let mut tunnel = Running::start(program, &plan, endpoint).map_err(failure)?;
        while stop.requested().is_none() {
            if let Some(status) = tunnel.ended() {
                let message = anyhow!("the tunnel ended by itself, with {status}");
                return Err(Failure::with(Exit::Unavailable, message));
            }
            look();
            std::thread::sleep(POLL);
        }
        Ok(exit_of(&stop))
    };
    // Signals are blocked before any thread starts, those of the channels included.
    watching(&stop, false, || (), work)?
}

/// A tunnel that is not there, with its exit code.
fn failure(error: TunnelError) -> anyhow::Error {
    let exit = match &error {
        TunnelError::NoProgram(_) | TunnelError::Version { .. } | TunnelError::Start { .. } => {
            Exit::Unavailable
        }
        TunnelError::Files { .. } => Exit::CannotCreate,
    };
    Failure::with(exit, anyhow!("{error}"))
}
