//! `magsteer tune`: what the rig is, from measurements of it.

#[cfg(feature = "sim")]
mod excite;
mod identify;
mod identify_answer;
mod overlay;
mod verdict;

use clap::{Args, Subcommand};

use super::exit::Exit;

/// Make the model fit the rig: parameters from measured equilibria.
#[derive(Debug, Args)]
pub struct Tune {
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, Subcommand)]
enum Question {
    Identify(identify::Identify),
    #[cfg(feature = "sim")]
    Excite(excite::Excite),
}

impl Tune {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.question {
            Question::Identify(identify) => identify.run(),
            #[cfg(feature = "sim")]
            Question::Excite(excite) => excite.run(),
        }
    }
}
