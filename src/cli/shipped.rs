//! The configuration and the experiment that are meant when none is named.

use std::path::Path;

#[cfg(feature = "sim")]
use magsteer::config::Experiment;
use magsteer::config::{Document, Problems};
#[cfg(feature = "sim")]
use magsteer_hal::HardwareDescription;

/// The rig that is meant when none is named.
const CONFIG: &str = "config/bigmag-planar.toml";
/// The same, for a working directory that does not have it.
const CONFIG_TEXT: &str = include_str!("../../config/bigmag-planar.toml");

/// Reads the file named, else the default one, else the copy of it in this program.
pub fn config(file: Option<&Path>) -> Result<Document, Problems> {
    read(file, CONFIG, CONFIG_TEXT)
}

/// The experiment that is meant when none is named.
#[cfg(feature = "sim")]
const EXPERIMENT: &str = "config/experiments/planar.toml";
/// The same, for a working directory that does not have it.
#[cfg(feature = "sim")]
const EXPERIMENT_TEXT: &str = include_str!("../../config/experiments/planar.toml");

/// Reads the experiment named, else the default one, else the copy of it in this program.
#[cfg(feature = "sim")]
pub fn experiment(file: Option<&Path>, rig: &HardwareDescription) -> Result<Experiment, Problems> {
    Experiment::from_document(&read(file, EXPERIMENT, EXPERIMENT_TEXT)?, rig)
}

fn read(file: Option<&Path>, default: &str, text: &str) -> Result<Document, Problems> {
    match file {
        Some(file) => Document::load(file),
        None if Path::new(default).exists() => Document::load(Path::new(default)),
        None => Document::from_text(format!("{default} (in this program)"), text),
    }
}
