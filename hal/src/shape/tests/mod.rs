//! Reconstruction against rods whose shape is known otherwise: analytic curves, and fine integration by
//! another rule.

mod cloud;
mod curvature;
mod orientation;
mod rods;
mod spoiled;
