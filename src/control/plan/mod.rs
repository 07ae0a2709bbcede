//! Planning of frame angles: how the frames shall stand so that the currents reach a target within their limits, and on which way.
//!
//! # Problem
//! Currents answer at once, frames turn slowly, and which directions the currents can turn the magnets in depends on the frames. With
//! BigMag's six coils in one plane nothing steers out of it; with the frames apart two magnets are steered in 3-D. Which setting
//! suits depends on the target: none suits all, and on the way to most of them the rod is lost with most settings.
//!
//! # Terms
//! - **Posture**: an equilibrium of the model under an actuation.
//! - **Waypoint**: where the magnets shall point and how the frames shall stand. Between two waypoints the magnets turn along
//!   great circles and the frames evenly with them, so that a way is the same for whoever follows it slowly.
//! - **Walk**: the quasi-static motion from a posture to a waypoint ([`Walker`]).
//! - **Expected power**: what comparing postures goes by ([`ExpectedPower`], (p1)).
//!
//! # Method
//! A grid of frame settings; every setting is tried by continuation of equilibria along several routes from the present posture and
//! from rest, where currents are zero and frames turn freely; of those that arrive, the one whose worst posture on the way is best is
//! taken ([`Planner`]). Global in the frames, and every way it returns was walked: nothing is inferred between.
//!
//! Of those, ways that the loop's scout would let pass come first. A plan begins where the model is; a loop's currents go their own way in
//! the null space, so whoever leads a loop plans each way from where it stands ([`Guide`]).
//!
//! What is absent: time. A plan holds for motion slow against the rod's first mode; the loop's reference sees to that.

mod config;
mod expected_power;
mod guide;
mod planner;
mod rehearsal;
mod route;
mod search;
mod targets;
mod walk;
mod walker;

pub use config::PlanConfig;
pub use expected_power::ExpectedPower;
pub use guide::{GivenUp, Guide, Leg, Order, Stance, Told};
pub use planner::{Plan, Planner, Standing, Unreached};
pub use rehearsal::{Rehearsal, Rehearsed};
pub use targets::{Targets, draw_direction, draw_targets, parse_targets, target_columns};
pub use walk::{Advance, Bounds, Obstacle, Posture, Walk, Walked, Waypoint};
pub use walker::Walker;
