//! `magsteer sim-plant`: the simulated rig as a driver process.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use clap::Args;
use magsteer::config::{Config, Problems};
use magsteer::daemon::StopFlag;
use magsteer::daemon::kernel::{RealtimeRequest, request_realtime};
use magsteer_sim_plant::actuation::{Fault, fault_code};
use magsteer_sim_plant::{PlantConfig, process};
use serde::{Deserialize, Serialize};

use super::ending::{exit_told, watching};
use super::exit::Exit;
use super::managed::managed;
use super::output;
use super::rig_file::{RootArgs, channel_failure, keep_files_private};
use super::sim_faults::{FaultArgs, FaultReport, join, telling};

/// Kelvin of zero degrees Celsius.
const CELSIUS_ZERO: f64 = 273.15;

/// Run the simulated rig as a driver: BigMag's coils, a dynamic rod, a pose sensor.
///
/// It guards itself like a driver of real coils: without a valid command in time it ramps all currents to zero. SIGINT,
/// SIGTERM and SIGHUP end it, currents at zero, with 130 or 143.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer sim-plant config/bigmag-planar.toml &\n  magsteer run config/bigmag-planar.toml\n\n  \
    magsteer sim-plant config/bigmag-planar.toml --allow-faults --fault-plan config/faults/tour.toml"
)]
pub struct SimPlant {
    /// Configuration file (TOML) with a `[plant]` table.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Seed in place of the configured one.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    faults: FaultArgs,
    #[command(flatten)]
    root: RootArgs,
    /// Also end when standard input closes, for a plant that must not outlive who started it.
    #[arg(long)]
    end_with_stdin: bool,
    /// At the end, print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What the plant saw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlantReport {
    /// Steps of the simulation.
    pub steps: u64,
    /// Steps whose equations were not solved.
    pub steps_unsolved: u64,
    /// Simulated time left out because the machine held the process up.
    pub left_out_s: f64,
    /// Longest delay of a wake-up.
    pub lateness_max_us: f64,
    /// Largest current of any coil.
    pub current_max_a: f64,
    /// Highest temperature of any coil; absent on a rig without any.
    pub coil_temperature_max_celsius: Option<f64>,
    /// Faults that the driver found with its own hardware.
    pub driver_faults: u64,
    /// Code of the last of them, 0 for none.
    pub driver_fault_code: u32,
    /// The same in words.
    pub driver_fault: Option<String>,
    /// Commands beyond a current or slew limit.
    pub limit_breaks: u64,
    /// Commands refused.
    pub commands_refused: u64,
    /// The last way to zero current after authority was lost: from its loss; absent when there was none.
    pub ramp_down_ms: Option<f64>,
    /// The same, from the last command that was obeyed.
    pub ramp_down_from_last_command_ms: Option<f64>,
    /// The longest of all ways to zero, from the last command that was obeyed; 0 when there was none.
    #[serde(default)]
    pub ramp_down_longest_ms: f64,
    /// What faults did; absent when they were not allowed.
    #[serde(default)]
    pub faults: Option<FaultReport>,
    /// True when every coil was at zero at the end.
    pub ended_currentless: bool,
}

impl SimPlant {
    pub fn run(&self) -> anyhow::Result<Exit> {
        keep_files_private();
        let (document, config) = Config::load(&self.file)?;
        let mut settings = document.section::<PlantConfig>("plant")?;
        if let Some(seed) = self.seed {
            settings.seed = seed;
        }
        let built = settings.build_as(&config.description, &config.nominal(&document)?);
        let mut plant = match built {
            Ok(plant) => plant,
            Err(refused) => {
                return Err(Problems::refuse(document.refuse(refused), ()).expect_err("refused").into());
            }
        };
        let injector = self.faults.injector(&config.description, settings.seed)?;
        let endpoint = self.root.endpoint(&config.description.rig)?;
        let stop = Arc::new(StopFlag::new());
        let ended = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&ended);
        let ask = move || flag.store(true, Ordering::Relaxed);
        let summary = watching(&stop, self.end_with_stdin, ask, || {
            let mut end = join(&endpoint, injector).map_err(channel_failure)?;
            output::note(format_args!(
                "simulated rig {} is running, sensor {}",
                endpoint.rig(),
                settings.sensor
            ));
            let (real_time, wakes) = (&settings.real_time, AtomicU64::new(0));
            anyhow::Ok(managed(&stop, &wakes, "running", || {
                telling(|tell| {
                    ask_for_real_time(real_time.priority);
                    process::run(&mut plant, real_time, &mut end, &ended, &wakes, tell)
                })
            }))
        })??;
        let report = PlantReport::of(&summary);
        let told = if self.json {
            // For people who read the messages alone, as those of a demonstration that was killed.
            output::note(format_args!("simulated rig {} {}", endpoint.rig(), report.verdict()));
            output::json(&report)
        } else {
            output::result(report.text()).map_err(anyhow::Error::from)
        };
        let exit = exit_told(&stop, told)?;
        Ok(if report.ended_currentless { exit } else { Exit::No })
    }
}

/// Asks for real time for the calling thread, and says when it is not to be had.
fn ask_for_real_time(priority: u32) {
    if priority == 0 {
        return;
    }
    let report = request_realtime(&RealtimeRequest { priority, cpu: None, lock_memory: false });
    if !report.is_granted() {
        output::note(format_args!("the simulated rig runs without all of real time: {report}"));
    }
}

impl PlantReport {
    fn of(summary: &process::Summary) -> Self {
        let milliseconds = |duration: std::time::Duration| duration.as_secs_f64() * 1e3;
        Self {
            steps: summary.counts.steps,
            steps_unsolved: summary.counts.steps_unsolved,
            left_out_s: summary.left_out.as_secs_f64(),
            lateness_max_us: summary.lateness_max.as_secs_f64() * 1e6,
            current_max_a: summary.counts.current_max,
            coil_temperature_max_celsius: summary
                .counts
                .coil_temperature_max
                .map(|kelvin| kelvin - CELSIUS_ZERO),
            driver_faults: summary.counts.driver_faults,
            driver_fault_code: summary.counts.last_driver_fault.map_or(fault_code::NONE, Fault::code),
            driver_fault: summary.counts.last_driver_fault.map(|fault| fault.to_string()),
            limit_breaks: summary.limit_breaks,
            commands_refused: summary.commands_refused,
            ramp_down_ms: summary.last_ramp.map(|ramp| milliseconds(ramp.from_loss)),
            ramp_down_from_last_command_ms: summary
                .last_ramp
                .map(|ramp| milliseconds(ramp.from_last_command)),
            ramp_down_longest_ms: milliseconds(summary.longest_ramp),
            faults: summary.faults.as_ref().map(FaultReport::of),
            ended_currentless: summary.ended_currentless,
        }
    }

    fn text(&self) -> String {
        let ramp = match (self.ramp_down_ms, self.ramp_down_from_last_command_ms) {
            (Some(from_loss), Some(from_last)) => format!(
                "last ramp to zero: {from_loss:.1} ms after authority was lost, {from_last:.1} ms after the last command\n"
            ),
            _ => String::new(),
        };
        let faults = self.faults.as_ref().map_or(String::new(), FaultReport::text);
        let heat = self
            .coil_temperature_max_celsius
            .map_or(String::new(), |celsius| format!(", warmest coil {celsius:.1} degrees Celsius"));
        let fault = self.driver_fault.as_ref().map_or(String::new(), |fault| {
            format!(
                "the driver cut its amplifiers {} times on its own account, last: {fault}\n",
                self.driver_faults
            )
        });
        format!(
            "{} steps, {} unsolved, {:.3} s left out, late by at most {:.0} us\n\
             largest current {:.2} A{heat}, {} commands beyond a limit, {} refused\n{fault}{ramp}{faults}{}\n",
            self.steps,
            self.steps_unsolved,
            self.left_out_s,
            self.lateness_max_us,
            self.current_max_a,
            self.limit_breaks,
            self.commands_refused,
            self.verdict(),
        )
    }

    fn verdict(&self) -> &'static str {
        if self.ended_currentless { "ended at zero current" } else { "ended NOT at zero current" }
    }
}
