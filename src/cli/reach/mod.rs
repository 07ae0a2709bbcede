//! `magsteer reach`: the map of reachable orientations.
//!
//! # Terms
//! - **Ring**: directions between two angles from a magnet's rest direction, 15 deg apart. A target belongs to the outermost ring
//!   of its magnets.
//! - **Share**: of the targets of a ring, or of a cone, were each magnet's direction drawn uniformly by solid angle.
//!
//! # Method
//! Of such draws hardly any lie near rest. So each magnet's ring is drawn first, all with one probability, then the direction within
//! it, uniformly by solid angle; every sample then weighs by how much larger its rings are than their probability, and shares are
//! ratios of sums of weights. Intervals are Wilson's, with Kish's effective number of samples `(sum w)^2 / sum w^2` for that of trials.
//!
//! `sample` draws, `survey` counts, `table` writes the samples down, `picture` draws them.

mod command;
#[cfg(feature = "figures")]
mod picture;
mod sample;
mod survey;
mod table;

pub use command::Reach;
