//! `magsteer hal udp-driver`: the driver of hardware behind the UDP protocol.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use magsteer::config::Config;
use magsteer::daemon::StopFlag;
use magsteer_hal::driver::run;
use magsteer_hal::udp::UdpDevice;
use serde::Serialize;

use super::super::ending::{exit_of, watching};
use super::super::exit::Exit;
use super::super::output;
use super::super::rig_file::{RootArgs, channel_failure, keep_files_private};

/// Of the driver's loop.
const PERIOD: Duration = Duration::from_millis(1);

/// Drive amplifiers, motors and a tracker that speak magsteer's UDP protocol: a microcontroller, a program in
/// C.
///
/// SIGINT and SIGTERM end it, currents at zero, with 130 or 143.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer hal udp-driver config/bigmag-planar.toml --device 127.0.0.1:9077\n\n  \
    `magsteer hal new NAME --lang c` writes a device, and the protocol's specification beside it."
)]
pub struct UdpDriver {
    /// Configuration file (TOML) of the rig.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Address and port of the device.
    #[arg(long, value_name = "HOST:PORT")]
    device: SocketAddr,
    /// Without a request for so long the device goes to zero by itself.
    #[arg(long, value_name = "MS", default_value_t = 100)]
    validity_ms: u32,
    #[command(flatten)]
    root: RootArgs,
    /// Also end when standard input closes.
    #[arg(long)]
    end_with_stdin: bool,
    /// At the end, print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What the driver saw.
#[derive(Serialize)]
struct Answer {
    cycles: u64,
    commands_refused: u64,
    limit_breaks: u64,
    messages_unsent: u64,
    datagrams_malformed: u64,
    lateness_max_us: f64,
}

impl UdpDriver {
    pub fn run(&self) -> anyhow::Result<Exit> {
        keep_files_private();
        let (_, config) = Config::load(&self.file)?;
        let description = &config.description;
        let endpoint = self.root.endpoint(&description.rig)?;
        let validity = Duration::from_millis(self.validity_ms.into());
        let mut device =
            UdpDevice::connect(description, self.device, validity).context("no socket can be had")?;
        let stop = Arc::new(StopFlag::new());
        let ended = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&ended);
        let ask = move || flag.store(true, Ordering::Relaxed);
        let summary = watching(&stop, self.end_with_stdin, ask, || {
            output::note(format_args!("driver of {} is running, device at {}", description.rig, self.device));
            run(description, &endpoint, &mut device, PERIOD, &ended).map_err(channel_failure)
        })??;
        let answer = Answer {
            cycles: summary.cycles,
            commands_refused: summary.commands_refused,
            limit_breaks: summary.limit_breaks,
            messages_unsent: summary.messages_unsent,
            datagrams_malformed: device.malformed(),
            lateness_max_us: summary.lateness_max.as_secs_f64() * 1e6,
        };
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(format_args!(
                "{} cycles, late by at most {:.0} us; {} commands refused, {} beyond a limit; {} datagrams of \
                 something else\n",
                answer.cycles,
                answer.lateness_max_us,
                answer.commands_refused,
                answer.limit_breaks,
                answer.datagrams_malformed
            ))?;
        }
        Ok(exit_of(&stop))
    }
}
