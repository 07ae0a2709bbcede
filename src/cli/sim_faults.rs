//! Faults of the simulated rig: the plan, who tells of them, and what came of them.

use std::path::{Path, PathBuf};
use std::sync::mpsc;

use clap::Args;
use magsteer::config::{Document, Problems};
use magsteer_hal::HardwareDescription;
use magsteer_hal::channels::{ChannelError, DriverEnd, DriverServices, Endpoint};
use magsteer_hal::fault::{FaultCounts, FaultEvent, FaultPlan, FaultPlanConfig, Injector, Reach};
use serde::{Deserialize, Serialize};

use super::exit::Failure;
use super::output;

/// Events under way to whoever prints them; the rig's loop never waits for a terminal.
const EVENTS_MAX: usize = 256;

/// Whether faults may happen, and which.
#[derive(Debug, Args)]
pub struct FaultArgs {
    /// Let faults happen: those of a plan, and those asked for with `magsteer fault`.
    #[arg(long)]
    allow_faults: bool,
    /// Faults by script (TOML), timed from the start of the simulated rig.
    #[arg(long, value_name = "PLAN", requires = "allow_faults")]
    fault_plan: Option<PathBuf>,
}

/// What faults did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FaultReport {
    /// Faults that began.
    pub begun: u64,
    /// Faults that ended.
    pub ended: u64,
    /// Poses that were not published.
    pub poses_withheld: u64,
    /// Poses published while a fault of them acted.
    pub poses_altered: u64,
    /// Feedback that was not published.
    pub feedback_withheld: u64,
    /// Feedback published while a fault of it acted.
    pub feedback_altered: u64,
    /// Commands that reached the guard while a fault of them acted.
    pub commands_altered: u64,
    /// Steps at which amplifiers and motors were given something else than the guard's set point.
    pub setpoints_altered: u64,
}

impl FaultArgs {
    /// What makes faults happen, when they may.
    pub fn injector(&self, description: &HardwareDescription, seed: u64) -> anyhow::Result<Option<Injector>> {
        if !self.allow_faults {
            return Ok(None);
        }
        let plan = match &self.fault_plan {
            Some(path) => load(path, description).map_err(Failure::data)?,
            None => FaultPlan::empty(Reach::Plant),
        };
        Ok(Some(Injector::new(description, &plan, seed)))
    }
}

/// Reads a plan for a simulated rig.
pub fn load(path: &Path, description: &HardwareDescription) -> Result<FaultPlan, Problems> {
    let document = Document::load(path)?;
    let config: FaultPlanConfig = document.read()?;
    match config.build(description, Reach::Plant) {
        Ok(plan) => Ok(plan),
        Err(refused) => {
            Err(Problems::refuse(document.refuse(refused), ()).expect_err("refused for a reason"))
        }
    }
}

/// Becomes the rig's driver.
pub fn join(endpoint: &Endpoint, injector: Option<Injector>) -> Result<DriverEnd, ChannelError> {
    let services = DriverServices::create(endpoint)?;
    match injector {
        Some(injector) => {
            output::note(format_args!("faults are allowed on rig {}", endpoint.rig()));
            services.allow_faults(endpoint, injector)?.into_ports()
        }
        None => services.into_ports(),
    }
}

/// Runs `work`, which hands begins and ends of faults to another thread that prints them.
pub fn telling<T>(work: impl FnOnce(&dyn Fn(FaultEvent)) -> T) -> T {
    let (sender, receiver) = mpsc::sync_channel::<FaultEvent>(EVENTS_MAX);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for FaultEvent { fault, began, at } in receiver {
                let what = if began { "begins" } else { "ends" };
                output::note(format_args!("fault {what} at {:.3} s: {fault}", at.as_secs_f64()));
            }
        });
        // A terminal that does not keep up costs lines, not time.
        let result = work(&|event| _ = sender.try_send(event));
        drop(sender);
        result
    })
}

impl FaultReport {
    pub fn of(counts: &FaultCounts) -> Self {
        Self {
            begun: counts.begun,
            ended: counts.ended,
            poses_withheld: counts.poses.withheld,
            poses_altered: counts.poses.altered,
            feedback_withheld: counts.feedback.withheld,
            feedback_altered: counts.feedback.altered,
            commands_altered: counts.commands_altered,
            setpoints_altered: counts.setpoints_altered,
        }
    }

    pub fn text(&self) -> String {
        format!(
            "faults: {} began, {} ended; poses {} withheld, {} altered; feedback {} withheld, {} altered; {} commands and {} set points \
             altered\n",
            self.begun,
            self.ended,
            self.poses_withheld,
            self.poses_altered,
            self.feedback_withheld,
            self.feedback_altered,
            self.commands_altered,
            self.setpoints_altered,
        )
    }
}
