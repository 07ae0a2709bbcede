//! `magsteer hal describe`: a rig's numbers for a driver in another language.

use std::path::PathBuf;

use clap::Args;
use magsteer::config::Config;
use magsteer_hal::binding::RigSheet;

use super::super::exit::Exit;
use super::super::output;

/// Print what a driver must know of a rig as one JSON object: counts, limits and the fingerprint of its
/// description.
///
/// Drivers in Rust read the configuration themselves. Others read this object, and need it anew when the
/// description changes: its fingerprint is part of what they publish.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer hal describe config/bigmag-planar.toml > rig.json")]
pub struct Describe {
    /// Configuration file (TOML).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// As everywhere; this command prints nothing else.
    #[arg(long)]
    json: bool,
}

impl Describe {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let (_, config) = Config::load(&self.file)?;
        let text = serde_json::to_string_pretty(&RigSheet::of(&config.description))?;
        output::result(format_args!("{text}\n"))?;
        Ok(Exit::Success)
    }
}
