//! `magsteer init`: a folder to begin with, that runs as it is.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::{Args, ValueEnum};

use super::exit::{Exit, Failure};
use super::output;

/// What every system extends.
const PLANAR: (&str, &str) = ("bigmag-planar.toml", include_str!("../../config/bigmag-planar.toml"));
const SPATIAL: (&str, &str) = ("bigmag-3d.toml", include_str!("../../config/bigmag-3d.toml"));
const FOURTEEN: (&str, &str) = ("bigmag-14.toml", include_str!("../../config/bigmag-14.toml"));
const STEPS: (&str, &str) = ("experiments/planar.toml", include_str!("../../config/experiments/planar.toml"));
const POINTING: (&str, &str) =
    ("experiments/pointing.toml", include_str!("../../config/experiments/pointing.toml"));

/// Make a folder with a configuration of your own, which extends a shipped one, and experiments to play.
///
/// Nothing that is there is written over.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer init my-rig --system bigmag && magsteer check my-rig/rig.toml && \
    magsteer demo --config my-rig/rig.toml"
)]
pub struct Init {
    /// The folder; made when it is not there.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// What to begin with.
    #[arg(long, value_enum, default_value = "bigmag")]
    system: System,
}

/// A shipped system.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum System {
    /// Six coils and two frames, two magnets steered in the plane.
    Bigmag,
    /// The same, steered in 3-D with the frames moving.
    #[value(name = "bigmag-3d")]
    Bigmag3d,
    /// Fourteen coils, two magnets steered in 3-D.
    #[value(name = "bigmag-14")]
    Bigmag14,
}

impl System {
    const fn base(self) -> (&'static str, &'static str) {
        match self {
            Self::Bigmag => PLANAR,
            Self::Bigmag3d => SPATIAL,
            Self::Bigmag14 => FOURTEEN,
        }
    }
}

impl Init {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let name = self.rig_name()?;
        let (base, _) = self.system.base();
        let own = format!(
            "# Your rig: what differs from {base}, which stands beside this file with every value, its unit and its source.\n\
             # `magsteer check` says what is wrong with a value, and where.\n\n\
             extends = \"{base}\"\n\n\
             [rig]\nname = \"{name}\"                         # part of every channel's name\n\n\
             # For example the modulus of your rubber, and the rate of the loop:\n\
             #\n\
             # [manipulator.materials.pmc770]\n\
             # young_modulus_mpa = 4.8\n\
             #\n\
             # [daemon]\n\
             # rate_hz = 1000.0\n"
        );
        let mut files = vec![("rig.toml", own.as_str()), PLANAR, STEPS, POINTING];
        if base != PLANAR.0 {
            files.push(self.system.base());
        }
        let taken: Vec<String> = files
            .iter()
            .map(|(file, _)| self.folder.join(file))
            .filter(|path| path.exists())
            .map(shown)
            .collect();
        if !taken.is_empty() {
            let message = anyhow!("{}: there already: must be a folder without them", taken.join(", "));
            return Err(Failure::with(Exit::CannotCreate, message));
        }
        let mut told = String::new();
        for (file, text) in files {
            let path = self.folder.join(file);
            create(&path, text)?;
            // Writing to a string does not fail.
            let _ = writeln!(told, "{}", path.display());
        }
        output::result(told)?;
        Ok(Exit::Success)
    }

    /// The folder's name, where it can name a rig.
    fn rig_name(&self) -> anyhow::Result<String> {
        let name = self.folder.file_name().and_then(|name| name.to_str()).unwrap_or("rig");
        let fits = |character: char| matches!(character, 'a'..='z' | '0'..='9' | '-');
        if name.is_empty() || name.len() > 40 || !name.chars().all(fits) {
            return Err(Failure::usage(format_args!(
                "{name:?}: names the rig too: must be lower-case letters, digits and hyphens, at most 40"
            )));
        }
        Ok(name.to_owned())
    }
}

fn shown(path: PathBuf) -> String {
    path.display().to_string()
}

fn create(path: &Path, text: &str) -> anyhow::Result<()> {
    let made =
        path.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(path, text));
    made.map_err(|error| {
        Failure::with(Exit::CannotCreate, anyhow!("{}: cannot be written: {error}", path.display()))
    })
}
