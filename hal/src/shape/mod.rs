//! The shape of the rod from what sensors see of it, and from the shape the magnets' poses.
//!
//! **Problem.** A stereo camera sees points on the *surface* of the manipulator, a fibre in its core feels
//! curvature; the daemon wants the poses of the magnets. This is block A of Richter, Venkiteswaran and Misra,
//! "Multi-Point Orientation Control of Discretely-Magnetized Continuum Manipulators", IEEE RA-L 6(2), 2021.
//!
//! **Terms.** The *centreline* is `P(s)`, `s` the arc length from the clamp. A *station* is one of the arc
//! lengths at which it is evaluated. A *piece* is a section or a magnet. The *foot* of a point is the place
//! of the centreline nearest to it. A *viewer* is the position of a camera.
//!
//! **What is known beforehand.** The clamp's position and tangent, and each piece's length and radius, from
//! the description. The rod does not stretch. Magnets are rigid.
//!
//! - [`CloudShape`] reconstructs from a point cloud, with outliers and hidden stretches;
//! - [`CurvatureShape`] integrates a curvature sensor's readings;
//! - [`AxisAngle`] is eq. (7): from a tangent to an orientation.
//!
//! All storage is allocated at construction, and nothing here panics on any reading.
//!
//! **What cannot be known.** The surface of a round rod looks the same however it is twisted about its own
//! axis, so a point cloud gives no *torsion*: orientations from it are those of eq. (7), the shortest turn
//! from global z to the tangent.

mod accumulate;
mod arc_model;
mod cloud;
mod curvature;
mod frame;
mod legendre;
mod model;
mod normal;
mod orientation;
mod outcome;
mod outline;
mod polynomial;
mod settings;
mod stations;

pub use cloud::CloudShape;
pub use curvature::{CurvatureError, CurvatureShape};
pub use orientation::AxisAngle;
pub use outcome::{MagnetEstimate, Quality, Reconstruction, Unreconstructed};
pub use settings::{CAPACITY, CentrelineKind, CloudSettings, SettingsError};

#[cfg(test)]
mod tests;
