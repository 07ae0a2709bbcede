//! The configuration of a rig: every module's section, read and checked together.

use std::path::Path;

use magsteer_hal::HardwareDescription;
use magsteer_hal::config::HardwareConfig;
use magsteer_hal::invalid::Invalid;
use serde::de::DeserializeOwned;

use crate::daemon::DaemonConfig;
use crate::rod::{Manipulator, RodConfig};

use super::document::Document;
use super::placement;
use super::problem::{Problem, Problems};

/// Tables that describe the rig, which both sides of the channels read.
const RIG_TABLES: [&str; 5] = ["rig", "frames", "coil_types", "coils", "manipulator"];

/// Every top-level key of a configuration. `plant` belongs to the simulated plant, which this library does not know.
pub const TABLES: [&str; 9] =
    ["rig", "frames", "coil_types", "coils", "manipulator", "rod", "control", "daemon", "plant"];

/// A configuration whose every value was checked.
#[derive(Debug, Clone)]
pub struct Config {
    /// The rig in the units of the file.
    pub hardware: HardwareConfig,
    /// The rig in SI.
    pub description: HardwareDescription,
    /// `[rod]`; `None` in a file that describes a rig without its model.
    pub rod: Option<RodConfig>,
    /// `[daemon]`; `None` in a file that describes a rig and steers nothing.
    pub daemon: Option<DaemonConfig>,
}

impl Config {
    /// Reads and checks a file and what it extends.
    ///
    /// # Errors
    /// What [`Document::load`] refuses, else every refused value of every section.
    pub fn load(path: &Path) -> Result<(Document, Self), Problems> {
        let document = Document::load(path)?;
        let config = Self::from_document(&document)?;
        Ok((document, config))
    }

    /// Checks every section of a document but `plant`.
    ///
    /// # Errors
    /// Every refused value of every section.
    pub fn from_document(document: &Document) -> Result<Self, Problems> {
        let mut gatherer = Gatherer { document, problems: document.unknown_keys(&TABLES) };
        let hardware = gatherer.keep(document.sections::<HardwareConfig>(&RIG_TABLES));
        let description = hardware.as_ref().and_then(|hardware| gatherer.accept(hardware.build()));
        if let Some(description) = &description {
            gatherer.refuse(placement::check(description));
        }
        // Without a rig there is nothing to mesh; what is wrong with the rig is reported above.
        let rod = gatherer.section::<RodConfig>("rod", |rod| {
            let built = description.as_ref().map(|description| rod.build(description));
            built.and_then(Result::err).unwrap_or_default()
        });
        let daemon = gatherer.section("daemon", DaemonConfig::check);
        let problems = gatherer.problems;
        match (hardware, description) {
            (Some(hardware), Some(description)) => {
                Problems::refuse(problems, Self { hardware, description, rod, daemon })
            }
            _ => Err(Problems::new(problems).expect("what could not be built was refused for a reason")),
        }
    }
}

impl Config {
    /// The model of the manipulator.
    ///
    /// # Errors
    /// `[rod]` is missing.
    pub fn manipulator(&self, document: &Document) -> Result<Manipulator, Problems> {
        let rod = document.require("rod", &self.rod)?;
        let built = rod.build(&self.description);
        built.map_err(|refused| Problems::new(document.refuse(refused)).expect("a refusal has a reason"))
    }
}

/// Collects the problems of every section, so that they are reported together.
struct Gatherer<'d> {
    document: &'d Document,
    problems: Vec<Problem>,
}

impl Gatherer<'_> {
    fn keep<T>(&mut self, read: Result<T, Problems>) -> Option<T> {
        read.map_err(|problems| self.problems.extend(problems.into_vec())).ok()
    }

    fn accept<T>(&mut self, built: Result<T, Vec<Invalid>>) -> Option<T> {
        built.map_err(|refused| self.refuse(refused)).ok()
    }

    fn refuse(&mut self, refused: Vec<Invalid>) {
        self.problems.extend(self.document.refuse(refused));
    }

    /// A section that a file may leave out: a rig can be described without being steered.
    fn section<T: DeserializeOwned>(&mut self, key: &str, check: impl Fn(&T) -> Vec<Invalid>) -> Option<T> {
        if !self.document.has(key) {
            return None;
        }
        let section = self.keep(self.document.section(key))?;
        self.refuse(check(&section));
        Some(section)
    }
}
