//! `magsteer field`: the field of the coils, and their coefficients from measurements of it or in the files of
//! other systems.

mod at;
mod coil_types;
#[cfg(feature = "mpem")]
mod export;
mod fit;
mod fit_answer;
#[cfg(feature = "mpem")]
mod import;
#[cfg(feature = "mpem")]
mod import_text;
#[cfg(feature = "figures")]
mod picture;

use clap::{Args, Subcommand};

use super::exit::Exit;

/// The field of the coil array: its value at a point, and its coefficients from measurements or other systems.
#[derive(Debug, Args)]
pub struct Field {
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, Subcommand)]
enum Question {
    At(at::At),
    Fit(fit::Fit),
    #[cfg(feature = "mpem")]
    Import(import::Import),
    #[cfg(feature = "mpem")]
    Export(export::Export),
}

impl Field {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.question {
            Question::At(at) => at.run(),
            Question::Fit(fit) => fit.run(),
            #[cfg(feature = "mpem")]
            Question::Import(import) => import.run(),
            #[cfg(feature = "mpem")]
            Question::Export(export) => export.run(),
        }
    }
}
