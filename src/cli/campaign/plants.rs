//! Plants of a campaign: the configured one with drawn values in the place of its own.
//!
//! A value is put into the merged TOML before the plant's table is read, so that any number of it can be
//! drawn and every check of its own applies.

use magsteer::config::{CampaignConfig, Document, Number, Problem, Problems, run_seed};
use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Invalid;
use magsteer_sim_plant::{Plant, PlantConfig};

/// Where a run's seed goes.
const SEED_KEY: &str = "plant.seed";

/// What differs from run to run.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// The run's seed, which everything else follows from.
    pub seed: u64,
    /// One value a draw of the configuration, in its order.
    pub values: Vec<Number>,
}

/// Draws and builds plants.
#[derive(Debug, Clone)]
pub struct Plants<'a> {
    /// The configuration.
    pub document: &'a Document,
    /// The rig that it describes.
    pub description: &'a HardwareDescription,
    /// The rig that its plants are built as.
    pub nominal: HardwareDescription,
    /// Its `[campaign]` table.
    pub campaign: &'a CampaignConfig,
}

impl Plants<'_> {
    /// What a run draws; runs count from 0.
    pub fn draw(&self, campaign_seed: u64, run: u64) -> Drawn {
        let seed = run_seed(campaign_seed, run);
        Drawn { seed, values: self.campaign.values(self.document, seed) }
    }

    /// The plant with drawn values.
    ///
    /// # Errors
    /// Every value that the plant refuses.
    pub fn build(&self, drawn: &Drawn) -> Result<Plant, Vec<Problem>> {
        let mut document = self.document.clone();
        document.set_number(SEED_KEY, Number::Whole(i64::try_from(drawn.seed).unwrap_or(i64::MAX)));
        let keys = self.campaign.draw.iter().map(|draw| draw.key.as_str());
        for (key, value) in keys.clone().zip(&drawn.values) {
            document.set_number(key, *value);
        }
        let drawn_at = |key: &str| {
            keys.clone().zip(&drawn.values).find(|(drawn, _)| *drawn == key).map(|(_, value)| value)
        };
        let settings = document.section::<PlantConfig>("plant").map_err(|problems| {
            let mut problems = problems.into_vec();
            // The document still knows the text of the file alone.
            for problem in &mut problems {
                if let Some(value) = drawn_at(&problem.key) {
                    problem.value = value.to_string();
                }
            }
            problems
        })?;
        settings.build_as(self.description, &self.nominal).map_err(|refused| document.refuse(refused))
    }

    /// What the plant refuses of the ends of the distributions: of each by itself, and of all the least and
    /// all the greatest values at once. Empty as well when it refuses the configured values already: then the
    /// draws are not to blame.
    pub fn refused_extremes(&self) -> Vec<Problem> {
        let configured = |index: usize| self.document.number(&self.campaign.draw[index].key);
        let count = self.campaign.draw.len();
        let Some(values) = (0..count).map(configured).collect::<Option<Vec<Number>>>() else {
            return Vec::new();
        };
        let as_configured = Drawn { seed: 1, values };
        if self.build(&as_configured).is_err() {
            return Vec::new();
        }
        let mut refused = Vec::new();
        for (index, draw) in self.campaign.draw.iter().enumerate() {
            for (path, value) in draw.extremes() {
                let mut drawn = as_configured.clone();
                drawn.values[index] = drawn.values[index].with_value(value);
                let path = format!("campaign.draw[{index}].{path}");
                refused.extend(self.refusals(&drawn, &path, &value.to_string()));
            }
        }
        if refused.is_empty() && count > 1 {
            for (which, name) in [(f64::min as fn(f64, f64) -> f64, "least"), (f64::max, "greatest")] {
                let mut drawn = as_configured.clone();
                for (value, draw) in drawn.values.iter_mut().zip(&self.campaign.draw) {
                    let ends = draw.extremes().into_iter().map(|(_, end)| end);
                    *value = value.with_value(ends.reduce(which).unwrap_or(value.value()));
                }
                let words = format!("every {name} value at once");
                refused.extend(self.refusals(&drawn, "campaign.draw", &words));
            }
        }
        self.document.refuse(refused)
    }

    /// What the plant refuses of drawn values, laid at the door of a key of `[campaign]`.
    fn refusals(&self, drawn: &Drawn, key: &str, value: &str) -> Vec<Invalid> {
        let problems = self.build(drawn).err().unwrap_or_default();
        let blame = |problem: Problem| Invalid {
            key: key.to_owned(),
            value: value.to_owned(),
            expected: format!("such that {} is {}", problem.key, problem.expected),
        };
        problems.into_iter().map(blame).collect()
    }

    /// Refuses a campaign whose distributions reach beyond what the plant accepts.
    ///
    /// # Errors
    /// What [`Self::refused_extremes`] finds.
    pub fn check(&self) -> Result<(), Problems> {
        Problems::refuse(self.refused_extremes(), ())
    }
}
