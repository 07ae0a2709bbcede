//! `magsteer completions` and `magsteer man`: what a shell and `man` know of the commands, from the commands themselves.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Args;
use clap_complete::Shell;

use super::exit::{Exit, Failure};
use super::output;

/// Print completions for a shell.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer completions bash > ~/.local/share/bash-completion/completions/magsteer"
)]
pub struct Completions {
    /// The shell.
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

impl Completions {
    pub fn run(&self, mut commands: clap::Command) -> anyhow::Result<Exit> {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut commands, "magsteer", &mut text);
        output::result(String::from_utf8_lossy(&text))?;
        Ok(Exit::Success)
    }
}

/// Write a manual page for every command.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer man ~/.local/share/man/man1 && man magsteer-run")]
pub struct Man {
    /// Folder for the pages; made when it is not there.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

impl Man {
    pub fn run(&self, commands: clap::Command) -> anyhow::Result<Exit> {
        let write = |folder: &Path| {
            std::fs::create_dir_all(folder)?;
            clap_mangen::generate_to(commands.disable_help_subcommand(true), folder)
        };
        write(&self.folder).map_err(|error| {
            let message = anyhow!("{}: cannot be written: {error}", self.folder.display());
            Failure::with(Exit::CannotCreate, message)
        })?;
        output::result(format_args!("{}\n", self.folder.display()))?;
        Ok(Exit::Success)
    }
}
