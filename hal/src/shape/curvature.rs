//! The rod's shape from curvature measured along it, as by Bragg gratings in a fibre at its core.
//!
//! | symbol | meaning |
//! |---|---|
//! | `s_i`, `k_i` | arc length of station `i`; its reading: bending about body x and y, twist, 1/m |
//! | `R(s)`, `p(s)` | frame and centreline, `R' = R k^`, `p' = R e_z` |
//!
//! Each section is cut at its stations. Over a cut the curvature is that at its middle on the straight line
//! between the two stations about it (constant beyond the first and the last of the section), and the frame
//! is carried by the exact exponential. Magnets are rigid: they are straight, whatever stations within them
//! read. Error from the mesh: third order in the distance of stations where curvature is smooth.
//!
//! A reading tells twist only if the sensor does (one that does not reports zero): unlike a point cloud it
//! then sees torsion, and orientations here are those of the frame itself.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::frame::Frame;
use super::outline::{Piece, pieces};
use crate::description::ManipulatorDescription;
use crate::message::{MAGNETS_MAX, MagnetPose, PoseMessage};
use crate::send::count;

/// Why readings give no shape, or stations no sensor.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CurvatureError {
    /// Stations out of order, off the rod or not finite.
    #[error("station {station} at {at} m: must lie from 0 to {length} m and beyond the one before")]
    Station {
        /// Its index.
        station: usize,
        /// Its arc length, m.
        at: f64,
        /// Length of the rod, m.
        length: f64,
    },
    /// A section that nothing measures.
    #[error("part {part} is flexible and has no station")]
    Unmeasured {
        /// Index of the part.
        part: usize,
    },
    /// Not one reading a station.
    #[error("{actual} readings for {expected} stations")]
    Count {
        /// Stations.
        expected: usize,
        /// Readings.
        actual: usize,
    },
    /// A reading that is no number.
    #[error("reading of station {station} is not finite")]
    NotFinite {
        /// Its index.
        station: usize,
    },
}

/// A stretch that is integrated at once.
#[derive(Debug, Clone, Copy)]
struct Cut {
    /// m
    length: f64,
    /// The two stations between which its curvature lies, and the share of the second; `None` for a half
    /// magnet.
    between: Option<(usize, usize, f64)>,
    /// A magnet has its centre at the far end.
    is_centre: bool,
}

/// Integrates the readings of one sensor.
#[derive(Debug, Clone)]
pub struct CurvatureShape {
    base: Frame,
    cuts: Vec<Cut>,
    stations: usize,
    tip: Frame,
}

impl CurvatureShape {
    /// For a sensor with `stations` (arc lengths from the clamp, m, ascending) along a manipulator.
    ///
    /// # Errors
    /// Stations that are out of order or off the rod, and flexible sections without any.
    pub fn new(manipulator: &ManipulatorDescription, stations: &[f64]) -> Result<Self, CurvatureError> {
        let pieces = pieces(manipulator);
        let length = pieces.last().map_or(0.0, Piece::end);
        let mut before = f64::NEG_INFINITY;
        for (station, at) in stations.iter().enumerate() {
            // A clamp or tip that is a rounding off still counts as on the rod.
            let is_on_rod = *at >= 0.0 && *at <= length * (1.0 + 1e-9);
            if !(is_on_rod && *at > before) {
                return Err(CurvatureError::Station { station, at: *at, length });
            }
            before = *at;
        }
        let mut cuts = Vec::new();
        for (part, piece) in pieces.iter().enumerate() {
            if piece.is_flexible {
                cut_section(&mut cuts, piece, stations).ok_or(CurvatureError::Unmeasured { part })?;
            } else {
                let half = Cut { length: piece.length / 2.0, between: None, is_centre: true };
                cuts.extend([half, Cut { is_centre: false, ..half }]);
            }
        }
        let base = Frame::of_base(manipulator);
        Ok(Self { base, cuts, stations: stations.len(), tip: base })
    }

    /// Poses of the magnets, base to tip, from one reading a station: curvature about body x, about body y
    /// and twist, 1/m. The header is empty.
    ///
    /// # Errors
    /// When the readings are not one a station, or one is not finite.
    pub fn reconstruct(&mut self, readings: &[[f64; 3]]) -> Result<PoseMessage, CurvatureError> {
        if readings.len() != self.stations {
            return Err(CurvatureError::Count { expected: self.stations, actual: readings.len() });
        }
        if let Some(station) = readings.iter().position(|reading| !reading.iter().all(|k| k.is_finite())) {
            return Err(CurvatureError::NotFinite { station });
        }
        let mut message = PoseMessage::default();
        let mut frame = self.base;
        let mut found = 0;
        for cut in &self.cuts {
            let curvature = cut.between.map_or(Vector3::zeros(), |(first, second, share)| {
                Vector3::from(readings[first]).lerp(&Vector3::from(readings[second]), share)
            });
            frame = frame.advanced(&curvature, cut.length);
            if cut.is_centre && found < MAGNETS_MAX {
                message.magnets[found] = pose_of(&frame);
                found += 1;
            }
        }
        message.magnet_count = count(found, MAGNETS_MAX);
        self.tip = frame;
        Ok(message)
    }

    /// The free end as found last, m, world.
    #[must_use]
    pub fn tip(&self) -> [f64; 3] {
        self.tip.position.into()
    }
}

/// Cuts a section at its stations; `None` when it has none.
fn cut_section(cuts: &mut Vec<Cut>, piece: &Piece, stations: &[f64]) -> Option<()> {
    let first = stations.iter().position(|at| *at >= piece.start && *at <= piece.end())?;
    let own = stations[first..].iter().take_while(|at| **at <= piece.end()).count();
    let last = first + own - 1;
    let mut cut = |from: f64, to: f64, between| {
        if to > from {
            cuts.push(Cut { length: to - from, between: Some(between), is_centre: false });
        }
    };
    cut(piece.start, stations[first], (first, first, 0.0));
    for station in first..last {
        cut(stations[station], stations[station + 1], (station, station + 1, 0.5));
    }
    cut(stations[last], piece.end(), (last, last, 0.0));
    Some(())
}

fn pose_of(frame: &Frame) -> MagnetPose {
    let rotation = Rotation3::from_matrix_unchecked(orthonormal(&frame.rotation));
    let turn = UnitQuaternion::from_rotation_matrix(&rotation).coords;
    MagnetPose {
        position_m: frame.position.into(),
        orientation_xyzw: [turn.x, turn.y, turn.z, turn.w],
        valid: 1,
        reserved: 0,
    }
}

/// Takes off what a hundred products of rotations have rounded.
fn orthonormal(rotation: &Matrix3<f64>) -> Matrix3<f64> {
    let z = rotation.column(2).normalize();
    let x = (rotation.column(0) - z * z.dot(&rotation.column(0))).normalize();
    Matrix3::from_columns(&[x, z.cross(&x), z])
}
