//! Layer live: what a viewer shows of a rig that a daemon steers. `top`, `web` and bridges draw; here is what
//! they draw.
//!
//! **Problem.** Several viewers come and go while a loop steers. Each wants the same: targets and angles
//! against time, the rod, currents with their limits, timing, margin, events; and each must survive a daemon
//! that is not there yet, ends, or is started again.
//!
//! **Terms.** A *status* is what the daemon publishes of itself; *figures* are a status as a person reads it,
//! with the names and limits of the rig's configuration; a *sample* is what is plotted against time; the
//! *link* is how the viewer stands to the daemon.
//!
//! **Method.** A [`Viewer`] attaches to the status channel and the journal, and to nothing else. The rod's
//! shape is computed here, in the viewer's process, by the model of the configuration at the measured
//! currents and angles.
//!
//! What is absent: a way by which a viewer could hold up the loop. It takes messages that the daemon's
//! telemetry thread publishes to whoever listens, and its requests go the way of every operator's.
//!
//! | file | does |
//! |---|---|
//! | `rig` | names, limits, angles and views of the rig |
//! | `link` | how the viewer stands to the daemon, judged by the stamps of what came |
//! | `history` | samples of the last minute |
//! | `rod` | the rod's centre line |
//! | `figures` | a status as a person reads it |
//! | `alert` | what nobody must overlook |
//! | `events` | the journal as lines |
//! | `viewer` | all of it together; start reading here |
//! | `metrics` | figures as OpenMetrics text |

mod alert;
mod events;
mod figures;
mod history;
mod link;
mod metrics;
mod rig;
mod rod;
#[cfg(test)]
mod tests;
mod viewer;

pub use alert::{Alert, Level};
pub use events::{EventFeed, EventLine, words};
pub use figures::{CoilFigures, Figures, FrameFigures, MagnetFigures};
pub use history::{AngleSample, History, Sample};
pub use link::{Lifeline, Link};
pub use metrics::open_metrics;
pub use rig::{Angles, Rig, View};
pub use rod::{RodFigures, RodModel, RodSource};
pub use viewer::{Unsent, Viewer};
