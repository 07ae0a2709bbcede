//! A rig and what plans its ways.

use std::path::Path;

use magsteer::config::Config;
use magsteer::control::plan::Planner;
use magsteer_hal::HardwareDescription;

/// A rig with its planner.
pub struct Subject {
    /// The rig in SI.
    pub description: HardwareDescription,
    /// Plans for it.
    pub planner: Planner,
}

impl Subject {
    /// Reads the rig that a file describes, which must say how it is planned for.
    ///
    /// # Errors
    /// What the configuration refuses; a file without `[rod]`, `[control]` or `[control.plan]`.
    pub fn load(file: &Path) -> anyhow::Result<Self> {
        let (document, config) = Config::load(file)?;
        let manipulator = document.require("rod", &config.manipulator)?.clone();
        let control = document.require("control", &config.control)?;
        let plan = document.require("control.plan", &control.plan)?;
        let planner = Planner::new(plan, control, &config.description, manipulator);
        Ok(Self { description: config.description, planner })
    }

    /// Names of the magnets from base to tip.
    pub fn magnets(&self) -> Vec<&str> {
        self.description.magnets().map(|magnet| magnet.name.as_str()).collect()
    }
}
