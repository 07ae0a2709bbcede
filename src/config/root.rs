//! The configuration of a rig: every module's section, read and checked together.

use std::path::Path;

use magsteer_hal::HardwareDescription;
use magsteer_hal::config::HardwareConfig;
use magsteer_hal::invalid::Invalid;
use serde::de::DeserializeOwned;

use crate::control::ControlConfig;
use crate::daemon::DaemonConfig;
use crate::rod::{Manipulator, RodConfig};

use super::campaign::CampaignConfig;
use super::document::Document;
use super::placement;
use super::problem::{Problem, Problems};

/// Tables that describe the rig, which both sides of the channels read.
const RIG_TABLES: [&str; 5] = ["rig", "frames", "coil_types", "coils", "manipulator"];

/// Every top-level key of a configuration. `plant` belongs to the simulated plant, which this library does not know.
pub const TABLES: [&str; 10] =
    ["rig", "frames", "coil_types", "coils", "manipulator", "rod", "control", "daemon", "plant", "campaign"];

/// A configuration whose every value was checked.
#[derive(Debug, Clone)]
pub struct Config {
    /// The rig in the units of the file.
    pub hardware: HardwareConfig,
    /// The rig in SI.
    pub description: HardwareDescription,
    /// The manipulator on the mesh of `[rod]`; `None` in a file that describes a rig without a model of it.
    pub manipulator: Option<Manipulator>,
    /// `[control]`; `None` in a file that describes a rig and steers nothing.
    pub control: Option<ControlConfig>,
    /// `[daemon]`; `None` in a file that describes a rig and steers nothing.
    pub daemon: Option<DaemonConfig>,
    /// `[campaign]`; `None` in a file that no campaign is meant for.
    pub campaign: Option<CampaignConfig>,
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

    /// The rig that a simulated plant is built as: that of the file which `plant.nominal` of the document names, this one
    /// where it names none.
    ///
    /// # Errors
    /// When that file cannot be read, and what [`Self::load`] refuses of it.
    pub fn nominal(&self, document: &Document) -> Result<HardwareDescription, Problems> {
        const KEY: &str = "plant.nominal";
        let Some(path) = document.path_at(KEY) else { return Ok(self.description.clone()) };
        Self::load(&path).map(|(_, config)| config.description).map_err(|problems| {
            if !problems.unreadable() {
                return problems;
            }
            let value = format!("{} ({})", path.display(), problems.as_slice()[0].value);
            let expected = "a configuration that can be read, relative to this file".to_owned();
            let refused = document.refuse(vec![Invalid { key: KEY.to_owned(), value, expected }]);
            Problems::new(refused).unwrap_or(problems)
        })
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
        let rod: Option<RodConfig> = gatherer.section("rod", |_| Vec::new());
        let manipulator = rod
            .zip(description.as_ref())
            .and_then(|(rod, description)| gatherer.accept(rod.build(description)));
        let control: Option<ControlConfig> = gatherer.section("control", ControlConfig::check);
        if let (Some(control), Some(description)) = (&control, &description) {
            gatherer.refuse(control.check_rig(description));
        }
        let daemon = gatherer.section("daemon", DaemonConfig::check);
        let campaign: Option<CampaignConfig> = gatherer.section("campaign", |_| Vec::new());
        if let Some(campaign) = &campaign {
            gatherer.refuse(campaign.check(document));
        }
        let problems = gatherer.problems;
        match (hardware, description) {
            (Some(hardware), Some(description)) => Problems::refuse(
                problems,
                Self { hardware, description, manipulator, control, daemon, campaign },
            ),
            _ => Err(Problems::new(problems).expect("what could not be built was refused for a reason")),
        }
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
    fn section<T: DeserializeOwned>(&mut self, key: &str, check: fn(&T) -> Vec<Invalid>) -> Option<T> {
        if !self.document.has(key) {
            return None;
        }
        let section = self.keep(self.document.section(key))?;
        self.refuse(check(&section));
        Some(section)
    }
}
