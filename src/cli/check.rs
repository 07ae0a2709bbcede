//! `magsteer check`: is a configuration right?

use std::path::PathBuf;

use clap::Args;
use magsteer::config::{Config, Document, Problem, Problems, TABLES};
use serde::Serialize;

use super::exit::Exit;
use super::output;

/// Check a configuration and all that it extends.
///
/// Reports every refused value with its file, line, column and what would be right.
/// Ends with 0, with 78 when a value is refused, or with 66 when a file cannot be read.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  magsteer check config/bigmag-planar.toml\n  \
    magsteer check config/bigmag-14.toml --print-resolved > resolved.toml")]
pub struct Check {
    /// Configuration file (TOML).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Print the file merged with all that it extends, and its SHA-256.
    #[arg(long)]
    print_resolved: bool,
}

/// The stable keys are `ok` and `errors`.
#[derive(Serialize)]
struct Answer<'a> {
    ok: bool,
    errors: &'a [Problem],
    files: Vec<&'a str>,
    sha256: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    resolved: Option<&'a str>,
}

impl Check {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let document = match Document::load(&self.file) {
            Ok(document) => document,
            Err(problems) => return self.refuse(&problems),
        };
        let checked = check(&document);
        let problems = checked.as_ref().err();
        let resolved = document.resolved();
        if self.json {
            output::told(output::json(&Answer {
                ok: problems.is_none(),
                errors: problems.map_or(&[], Problems::as_slice),
                files: document.files().collect(),
                sha256: Some(&resolved.sha256),
                resolved: self.print_resolved.then_some(&resolved.text),
            }))?;
        } else if self.print_resolved {
            let files: Vec<&str> = document.files().collect();
            let head = format!("# {}\n# SHA-256 of the text below: ", files.join(", extending "));
            let text = format_args!("{head}{}\n\n{}", resolved.sha256, resolved.text);
            output::told(output::result(text).map_err(Into::into))?;
        }
        match checked {
            Err(problems) => {
                self.report(&problems);
                Ok(Exit::of_problems(&problems))
            }
            Ok(config) => {
                if !self.json && !self.print_resolved {
                    output::result(self.summary(&document, &config, &resolved.sha256))?;
                }
                Ok(Exit::Success)
            }
        }
    }

    /// The files could not be read or parsed: there is no document to speak of.
    fn refuse(&self, problems: &Problems) -> anyhow::Result<Exit> {
        if self.json {
            let errors = problems.as_slice();
            let answer = Answer { ok: false, errors, files: vec![], sha256: None, resolved: None };
            output::told(output::json(&answer))?;
        }
        self.report(problems);
        Ok(Exit::of_problems(problems))
    }

    /// JSON carries the problems already.
    fn report(&self, problems: &Problems) {
        if !self.json {
            output::problems(problems);
        }
    }

    fn summary(&self, document: &Document, config: &Config, sha256: &str) -> String {
        let rig = &config.description;
        let absent: Vec<&str> =
            TABLES.into_iter().filter(|table| *table != "frames" && !document.has(table)).collect();
        let absent = if absent.is_empty() {
            String::new()
        } else {
            format!("without {}: commands that need them will refuse this file\n", absent.join(", "))
        };
        format!(
            "{}: ok: rig {}, {} coils, {} frames, {} magnets\n{absent}sha256 {sha256}\n",
            self.file.display(),
            rig.rig,
            rig.coils.len(),
            rig.frames.len(),
            rig.magnets().count(),
        )
    }
}

/// Every section, the simulated plant's among them where this build has it.
///
/// # Errors
/// All that is wrong with any of them.
pub fn check(document: &Document) -> Result<Config, Problems> {
    let checked = Config::from_document(document);
    let plant = check_plant(document, checked.as_ref().ok());
    match checked {
        Ok(config) => Problems::refuse(plant, config),
        Err(problems) => {
            let all = problems.into_vec().into_iter().chain(plant).collect();
            Err(Problems::new(all).expect("there was one"))
        }
    }
}

/// What is wrong with `[plant]`, and with what a campaign draws for it. Ranges are checked once the rig that
/// it simulates is right.
#[cfg(feature = "sim")]
fn check_plant(document: &Document, config: Option<&Config>) -> Vec<Problem> {
    if !document.has("plant") {
        return Vec::new();
    }
    match document.section::<magsteer_sim_plant::PlantConfig>("plant") {
        Ok(plant) => {
            let Some(config) = config else { return Vec::new() };
            let nominal = match config.nominal(document) {
                Ok(nominal) => nominal,
                Err(problems) => return problems.into_vec(),
            };
            let description = &config.description;
            let refused = plant.build_as(description, &nominal).err().unwrap_or_default();
            let mut problems = document.refuse(refused);
            if let Some(campaign) = &config.campaign {
                let plants = super::campaign::Plants { document, description, nominal, campaign };
                problems.extend(plants.refused_extremes());
            }
            problems
        }
        Err(problems) => problems.into_vec(),
    }
}

/// This build has no plant that could say what is wrong.
#[cfg(not(feature = "sim"))]
fn check_plant(_: &Document, _: Option<&Config>) -> Vec<Problem> {
    Vec::new()
}
