//! Which targets are meant: those of a file, or some drawn at random.

use std::path::PathBuf;

use clap::{Args, value_parser};
use magsteer::control::Directions;
use magsteer::control::plan::{draw_targets, parse_targets};

use super::subject::Subject;
use crate::cli::actuation::finite;
use crate::cli::data_file;

/// Targets.
#[derive(Debug, Args)]
pub struct Choice {
    /// Targets (CSV): the unit tangent of each magnet, world, one target a line: m1x,m1y,m1z,m2x,m2y,m2z.
    #[arg(value_name = "TARGETS.csv", required_unless_present = "cone")]
    targets: Option<PathBuf>,
    /// Draw targets at random instead, each magnet's uniformly in a cone of this half-angle about its rest direction, deg.
    #[arg(long, value_name = "DEG", conflicts_with = "targets", value_parser = half_angle)]
    cone: Option<f64>,
    /// How many to draw.
    #[arg(long, value_name = "N", default_value = "100", requires = "cone", value_parser = value_parser!(u32).range(1..=100_000))]
    count: u32,
    /// Seed of the draws.
    #[arg(long, value_name = "SEED", default_value = "1", requires = "cone")]
    seed: u64,
}

impl Choice {
    /// The targets, at least one.
    ///
    /// # Errors
    /// A file that cannot be read, or that is refused.
    pub fn targets(&self, subject: &Subject) -> anyhow::Result<Vec<Directions>> {
        let magnets = subject.magnets();
        if let Some(path) = &self.targets {
            let bytes = data_file::read(path)?;
            let read =
                parse_targets(&bytes, &magnets).map_err(|refusal| data_file::refuse(path, &refusal))?;
            if !read.ends_with_line_end {
                data_file::note_cut(path);
            }
            return Ok(read.targets);
        }
        let rest = &subject.planner.rest().posture.directions;
        let cone = self.cone.unwrap_or_default().to_radians();
        Ok(draw_targets(rest, magnets.len(), cone, self.count as usize, self.seed))
    }
}

/// Half-angle of a cone, deg.
pub fn half_angle(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 && value <= 180.0 { Ok(value) } else { Err("must be above 0 and at most 180".to_owned()) }
}
