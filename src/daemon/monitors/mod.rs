//! Monitors: slow or narrow judgements behind the quick and wide ones of [`watch`](super::watch) and
//! [`trust`](super::trust).
//!
//! Terms: *evidence* is time in which a sign was seen, less time in which its opposite was; what says neither
//! counts for neither. A monitor has an opinion when its evidence exceeds its limit.
//!
//! | file | judges | cause |
//! |---|---|---|
//! | `following` | each current and angle against its command, within a band near zero and near the limit alike; open coils at small currents | `NotFollowing`, `CoilOpen` |
//! | `heat` | the energy that each coil has taken up and not yet given off | `CoilOverheated` |
//! | `poses` | poses outside of the workspace, or faster than a rod moves | `PoseOutsideWorkspace`, `PoseTooFast` |
//! | `progress` | a controller that froze or comes no nearer, a model that stays off | `NotProgressing`, `ModelOff` |
//! | `sequence` | counts messages lost, repeated, backward; what they hide is judged by age | |
//!
//! What is absent: a clock, an allocation, and any decision about what to send.

mod bank;
mod config;
mod evidence;
mod following;
mod heat;
mod poses;
mod progress;
mod sequence;
#[cfg(test)]
mod tests;

pub use bank::{MonitorReport, Monitors, Sample};
pub use config::{MonitorLimits, MonitorsConfig};
pub use sequence::SequenceCounts;
