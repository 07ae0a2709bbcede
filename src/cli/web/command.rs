//! The process: address, threads, end.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use magsteer::daemon::StopFlag;
use magsteer::live::Viewer;
use tokio::net::TcpListener;
use tokio::runtime;

use super::desk::Desk;
use super::guard::Guard;
use super::routes;
use crate::cli::ending::{SetAtEnd, exit_of, watching};
use crate::cli::exit::{Exit, Failure};
use crate::cli::output;
use crate::cli::rig_file::RigArgs;
use crate::cli::viewing::give_way;

/// How often the server looks whether it is to end.
const POLL: Duration = Duration::from_millis(50);

/// Show a rig on a page: plots, the rod, currents, targets, a large STOP; and /metrics as OpenMetrics text.
///
/// Prints the address with its key: whoever has that may command the rig; other users of this machine may look. The page
/// fetches nothing from elsewhere. Waits for a daemon that is not there yet, and goes on with one that was started anew. To
/// end it never stops the rig.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer web config/bigmag-planar.toml\n  magsteer web --bind 127.0.0.1:8090\n  \
    ssh -L 8080:127.0.0.1:8080 rig    (watch and command from another machine, safely)"
)]
pub struct Web {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    rig: RigArgs,
    /// Address and port to serve; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    bind: SocketAddr,
    /// Serve an address that other machines reach too, for looking alone: commands are off.
    #[arg(long)]
    allow_remote_viewing: bool,
    /// Folder of the daemon's journal, in place of the configuration's.
    #[arg(long, value_name = "FOLDER")]
    journal: Option<PathBuf>,
}

impl Web {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let local = self.bind.ip().is_loopback();
        if !local && !self.allow_remote_viewing {
            return Err(Failure::usage(format_args!(
                "{}: other machines would reach this address: give a loopback address, or --allow-remote-viewing, \
                which turns commands off",
                self.bind.ip()
            )));
        }
        let config = self.rig.load(self.file.as_deref())?;
        let endpoint = self.rig.endpoint(self.file.as_deref())?;
        give_way();
        let stop = Arc::new(StopFlag::new());
        watching(
            &stop,
            false,
            || (),
            || {
                let runtime = runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
                let listener =
                    runtime.block_on(TcpListener::bind(self.bind)).map_err(|error| self.unbound(&error))?;
                let address = listener.local_addr()?;
                let guard = Guard::new(address, self.allow_remote_viewing)?;
                let key = if guard.commands() { format!("#key={}", guard.token()) } else { String::new() };
                let (desk, drawer) = Desk::new(guard.commands(), guard.boot().to_owned());
                let ended = std::sync::atomic::AtomicBool::new(false);
                std::thread::scope(|scope| {
                    // A viewer belongs to the thread that makes it.
                    let viewer = || Viewer::new(endpoint, &config, self.journal.clone());
                    scope.spawn(|| drawer.serve(viewer(), &ended));
                    let _ended = SetAtEnd(&ended);
                    output::result(format_args!("http://{address}/{key}\n"))?;
                    runtime.block_on(serve(listener, desk, guard, &stop))
                })?;
                Ok(exit_of(&stop))
            },
        )?
    }

    fn unbound(&self, error: &std::io::Error) -> anyhow::Error {
        let exit = match error.kind() {
            ErrorKind::PermissionDenied => Exit::NoPermission,
            _ => Exit::CannotCreate,
        };
        Failure::with(exit, anyhow!("{}: cannot be served: {error}", self.bind))
    }
}

/// Serves until told to end; connections that are open then are cut, since pages stay open for hours.
async fn serve(listener: TcpListener, desk: Desk, guard: Guard, stop: &StopFlag) -> anyhow::Result<()> {
    let server = tokio::spawn(axum::serve(listener, routes::router(desk, guard)).into_future());
    while stop.requested().is_none() && !server.is_finished() {
        tokio::time::sleep(POLL).await;
    }
    if server.is_finished() {
        server.await??;
    }
    Ok(())
}
