//! The rod's centre line at the measured actuation, computed in the viewer's process.
//!
//! **Method.** The configuration's own model is solved at the measured currents and angles, starting from the
//! equilibrium that was drawn before; when that fails, from rest. A model that finds none, or one that points
//! elsewhere than the magnets do, is not drawn: then a curve goes from the clamp through the measured
//! magnets, which are rigid, and between them along cubic Hermite segments
//! ```text
//! c(s) = (2s^3 - 3s^2 + 1) p0 + (s^3 - 2s^2 + s) l t0 + (3s^2 - 2s^3) p1 + (s^3 - s^2) l t1          (h1)
//! ```
//! with ends p0 and p1, tangents t0 and t1, and l the section's length.

use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use magsteer_hal::operator::StatusMessage;
use nalgebra::{Vector3, Vector6};
use serde::Serialize;

use super::history::rounded;
use super::rig::millimetres;
use crate::config::Config;
use crate::magnetics::{CoilArray, PosedArray};
use crate::rod::{Manipulator, Pass, PassMode, TipLoad};

/// Angle between a magnet's tangent in the model and as measured beyond which the model is on another branch,
/// deg.
const BRANCH_ANGLE_DEG: f64 = 30.0;
/// Pictures for which a model that failed from rest is left alone: starting from rest takes milliseconds.
const RESPITE: u32 = 20;
/// Points of one Hermite segment.
const SEGMENT_POINTS: u32 = 12;

/// What the centre line comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RodSource {
    /// The model's equilibrium at the measured actuation.
    Model,
    /// A curve through the measured magnets.
    Measured,
    /// Nothing is known.
    #[default]
    None,
}

impl RodSource {
    /// The words a person reads.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model => "model at the measured currents",
            Self::Measured => "curve through the measured magnets",
            Self::None => "not known",
        }
    }
}

/// The rod as it is drawn, mm, world.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct RodFigures {
    /// What the line comes from.
    pub source: RodSource,
    /// Points of the centre line from clamp to tip; empty when nothing is known.
    pub line_mm: Vec<[f64; 3]>,
    /// Both ends of each magnet on that line.
    pub magnets_mm: Vec<[[f64; 3]; 2]>,
    /// Both ends of each magnet as measured; `None` where it was not seen.
    pub measured_mm: Vec<Option<[[f64; 3]; 2]>>,
}

/// Draws the rod of one rig.
#[derive(Debug, Clone)]
pub struct RodModel {
    description: ManipulatorDescription,
    array: CoilArray,
    posed: PosedArray,
    model: Option<(Manipulator, Pass)>,
    guess: Option<Vector6<f64>>,
    respite: u32,
}

/// A magnet as it was measured.
#[derive(Debug, Clone, Copy)]
struct Seen {
    position: Vector3<f64>,
    tangent: Vector3<f64>,
}

impl RodModel {
    /// The rod of a configuration, by its model where it has one.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let array = CoilArray::new(&config.description);
        let model = config.manipulator.clone().map(|manipulator| {
            let pass = Pass::new(&manipulator);
            (manipulator, pass)
        });
        Self {
            description: config.description.manipulator.clone(),
            posed: array.posed(&vec![0.0; array.frame_count()]),
            array,
            model,
            guess: None,
            respite: 0,
        }
    }

    /// The rod at a status; by its measurements alone when the daemon's rig is not this one.
    pub fn draw(&mut self, status: &StatusMessage, same_rig: bool) -> RodFigures {
        let seen = self.seen(status);
        let measured_mm: Vec<_> = seen.iter().zip(self.magnet_lengths()).map(magnet_ends).collect();
        let (source, line, magnets_mm) = if same_rig && self.solve(status, &seen) {
            let (line, magnets) = self.drawn_model();
            (RodSource::Model, line, magnets)
        } else if let Some(line) = self.curve(&seen).filter(|_| same_rig) {
            (RodSource::Measured, line, measured_mm.iter().copied().flatten().collect())
        } else {
            (RodSource::None, Vec::new(), Vec::new())
        };
        RodFigures { source, line_mm: line, magnets_mm, measured_mm }
    }

    fn magnet_lengths(&self) -> impl Iterator<Item = f64> {
        self.description.parts.iter().filter_map(|part| match part {
            PartDescription::Magnet(magnet) => Some(magnet.length),
            PartDescription::Section(_) => None,
        })
    }

    fn seen(&self, status: &StatusMessage) -> Vec<Option<Seen>> {
        let poses = status.measured_position_m.iter().zip(&status.measured_direction);
        let seen = |(position, tangent): (&[f64; 3], &[f64; 3])| {
            let is_told = *position != [0.0; 3] && position.iter().all(|it| it.is_finite());
            let tangent = Vector3::from(*tangent).try_normalize(0.5);
            tangent.filter(|_| is_told).map(|tangent| Seen { position: Vector3::from(*position), tangent })
        };
        poses.map(seen).take(self.magnet_lengths().count()).collect()
    }

    /// Finds the equilibrium; false when there is none, or none that points where the magnets do.
    fn solve(&mut self, status: &StatusMessage, seen: &[Option<Seen>]) -> bool {
        let Some((manipulator, pass)) = &mut self.model else { return false };
        self.array.pose_into(&status.measured.angle_rad[..self.array.frame_count()], &mut self.posed);
        let field = self.posed.actuated(&status.measured.current_a[..self.array.coil_count()]);
        let mode = PassMode::default();
        let near =
            self.guess.take().map(|guess| manipulator.solve(&field, &TipLoad::NONE, &guess, mode, pass));
        let mut found = near.is_some_and(|solution| solution.converged()) && points_as(pass, seen);
        if !found && self.respite > 0 {
            self.respite -= 1;
        } else if !found {
            let solution = manipulator.solve_from_rest(&field, &TipLoad::NONE, mode, pass);
            found = solution.converged() && points_as(pass, seen);
            self.respite = if found { 0 } else { RESPITE };
        }
        self.guess = found.then(|| pass.unknowns());
        found
    }

    /// Centre line and ends of the magnets, of the last pass.
    fn drawn_model(&self) -> (Vec<[f64; 3]>, Vec<[[f64; 3]; 2]>) {
        let Some((manipulator, pass)) = &self.model else { return Default::default() };
        let stations = manipulator.shape(pass);
        let line: Vec<[f64; 3]> = stations.iter().map(|station| shown(&station.position)).collect();
        let ends = (1..stations.len()).filter(|&at| stations[at].magnet.is_some());
        let magnets = ends.map(|at| [line[at - 1], line[at]]).collect();
        (line, magnets)
    }

    /// The curve through the measured magnets; `None` when one was not seen.
    fn curve(&self, seen: &[Option<Seen>]) -> Option<Vec<[f64; 3]>> {
        let mut magnets = seen.iter();
        let rows = &self.description.base_rotation;
        let mut end = Vector3::from(self.description.base_position);
        let mut tangent = Vector3::from_fn(|row, _| rows[row][2]);
        let mut line = vec![shown(&end)];
        let mut flexible = 0.0;
        for part in &self.description.parts {
            match part {
                PartDescription::Section(section) => flexible += section.length,
                PartDescription::Magnet(magnet) => {
                    let seen = (*magnets.next()?)?;
                    let start = seen.position - 0.5 * magnet.length * seen.tangent;
                    hermite([end, start], [tangent * flexible, seen.tangent * flexible], &mut line);
                    end = seen.position + 0.5 * magnet.length * seen.tangent;
                    line.push(shown(&end));
                    (tangent, flexible) = (seen.tangent, 0.0);
                }
            }
        }
        if flexible > 0.0 {
            line.push(shown(&(end + flexible * tangent)));
        }
        Some(line)
    }
}

/// Appends the points of (h1) after its begin.
fn hermite([from, to]: [Vector3<f64>; 2], [leaving, arriving]: [Vector3<f64>; 2], line: &mut Vec<[f64; 3]>) {
    for point in 1..=SEGMENT_POINTS {
        let s = f64::from(point) / f64::from(SEGMENT_POINTS);
        let (s2, s3) = (s * s, s * s * s);
        // (h1)
        let place = (2.0 * s3 - 3.0 * s2 + 1.0) * from
            + (s3 - 2.0 * s2 + s) * leaving
            + (3.0 * s2 - 2.0 * s3) * to
            + (s3 - s2) * arriving;
        line.push(shown(&place));
    }
}

/// True when every magnet that was seen points about as the model has it.
fn points_as(pass: &Pass, seen: &[Option<Seen>]) -> bool {
    let close = BRANCH_ANGLE_DEG.to_radians().cos();
    let mut pairs = pass.magnets().iter().zip(seen);
    pairs.all(|(magnet, seen)| seen.is_none_or(|seen| magnet.tangent().dot(&seen.tangent) >= close))
}

fn magnet_ends((seen, length): (&Option<Seen>, f64)) -> Option<[[f64; 3]; 2]> {
    let Seen { position, tangent } = (*seen)?;
    let half = 0.5 * length * tangent;
    Some([shown(&(position - half)), shown(&(position + half))])
}

/// mm, to a micrometre.
fn shown(position: &Vector3<f64>) -> [f64; 3] {
    [position.x, position.y, position.z].map(|it| rounded(millimetres(it), 1e3))
}
