//! `magsteer field`: the field of the coils, and their coefficients from measurements of it.

mod at;
mod coil_types;
mod fit;
mod fit_answer;
#[cfg(feature = "figures")]
mod picture;

use clap::{Args, Subcommand};

use super::exit::Exit;

/// The field of the coil array: its value at a point, and its coefficients from measurements.
#[derive(Debug, Args)]
pub struct Field {
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, Subcommand)]
enum Question {
    At(at::At),
    Fit(fit::Fit),
}

impl Field {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.question {
            Question::At(at) => at.run(),
            Question::Fit(fit) => fit.run(),
        }
    }
}
