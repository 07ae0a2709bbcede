//! A rig and what plans its ways.

use std::path::Path;

use magsteer::config::{Config, Document};
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
        let planner = planner(&document, &config)?;
        Ok(Self { description: config.description, planner })
    }

    /// Names of the magnets from base to tip.
    pub fn magnets(&self) -> Vec<&str> {
        self.description.magnets().map(|magnet| magnet.name.as_str()).collect()
    }
}

/// The planner of a rig.
///
/// # Errors
/// A configuration without `[rod]`, `[control]` or `[control.plan]`.
pub fn planner(document: &Document, config: &Config) -> anyhow::Result<Planner> {
    let manipulator = document.require("rod", &config.manipulator)?.clone();
    let control = document.require("control", &config.control)?;
    let plan = document.require("control.plan", &control.plan)?;
    Ok(Planner::new(plan, control, &config.description, manipulator))
}
