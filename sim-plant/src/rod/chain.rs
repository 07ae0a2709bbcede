//! The chain: from a manipulator's description to rigid bodies and the elements between them.
//!
//! A body collects what is rigidly joined: magnets, and half an element of rubber at each end where
//! a section is glued on. A half element counts as a mass one sixth of an element inwards from its
//! end: under a uniform acceleration that gives the end moment `w h^2 / 12` of the continuous beam,
//! which plain lumping loses.

use magsteer_hal::description::{
    MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription,
};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3, Vector6};

use super::element::Element;
use super::rotation::exponential;

/// How finely sections are cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meshing {
    /// Greatest length of an element, m.
    pub element_length_max: f64,
}

impl Meshing {
    /// Elements of a whole manipulator.
    #[must_use]
    pub fn element_count(&self, description: &ManipulatorDescription) -> usize {
        let count = |part: &PartDescription| match part {
            PartDescription::Section(section) => self.elements(section),
            PartDescription::Magnet(_) => 0,
        };
        description.parts.iter().map(count).fold(0, usize::saturating_add)
    }

    fn elements(&self, section: &SectionDescription) -> usize {
        // Ten elements of 2.5 mm must not become eleven by rounding.
        let count = (section.length / self.element_length_max - 1e-9).ceil();
        (count as usize).max(1)
    }
}

/// Position (m, world) and rotation from body to world axes; body z is the tangent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position, m, world.
    pub position: Vector3<f64>,
    /// Rotation from body to world.
    pub rotation: UnitQuaternion<f64>,
}

impl Pose {
    /// The point at `offset` along the tangent.
    pub fn along(&self, offset: f64) -> Vector3<f64> {
        self.position + self.rotation * Vector3::new(0.0, 0.0, offset)
    }
}

/// A rigid body of revolution about its tangent. Offsets are along the tangent from the centre of mass, m.
#[derive(Debug, Clone)]
pub struct Body {
    /// kg
    pub mass: f64,
    /// About a transverse axis through the centre of mass, kg m^2.
    pub inertia_transverse: f64,
    /// About the tangent, kg m^2.
    pub inertia_axial: f64,
    /// Where the element from the clamp's side ends.
    pub proximal: f64,
    /// Where the element towards the tip begins.
    pub distal: f64,
}

impl Body {
    /// `J W` for a spin in body axes.
    pub fn angular_momentum(&self, spin: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.inertia_transverse * spin.x,
            self.inertia_transverse * spin.y,
            self.inertia_axial * spin.z,
        )
    }

    /// Mass three times, then the three inertias.
    pub fn mass_diagonal(&self) -> Vector6<f64> {
        let (mass, across, along) = (self.mass, self.inertia_transverse, self.inertia_axial);
        Vector6::new(mass, mass, mass, across, across, along)
    }
}

/// A magnet and where it sits.
#[derive(Debug, Clone)]
pub struct Magnet {
    /// Index of its body; `None` when it is joined to the clamp.
    pub body: Option<usize>,
    /// From the body's centre of mass, or from the clamp, along the tangent, m.
    pub offset: f64,
    /// A m^2, body axes.
    pub moment_body: Vector3<f64>,
}

/// A point on a moving body's axis that can touch a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPoint {
    /// Index of its body.
    pub body: usize,
    /// From the body's centre of mass along the tangent, m.
    pub offset: f64,
    /// From the axis to the rod's surface, m.
    pub radius: f64,
    /// Length of rod that it stands for, m.
    pub length: f64,
}

/// Constants of a rod. Element `k` joins body `k - 1` (the clamp for `k = 0`) to body `k`.
#[derive(Debug, Clone)]
pub struct Chain {
    /// Where the first element begins.
    pub clamp: Pose,
    /// The base as described, before any magnet that is joined to it.
    pub base: Pose,
    /// From clamp to tip.
    pub bodies: Vec<Body>,
    /// From clamp to tip.
    pub elements: Vec<Element>,
    /// In the order of the description.
    pub magnets: Vec<Magnet>,
    /// From clamp to tip.
    pub contact_points: Vec<ContactPoint>,
    /// Poses of the bodies' centres of mass when nothing loads the rod.
    pub unloaded: Vec<Pose>,
}

/// One rigid thing in a body under construction, on the body's own axis.
#[derive(Debug, Clone, Copy)]
struct Piece {
    mass: f64,
    at: f64,
    inertia_transverse: f64,
    inertia_axial: f64,
}

/// A body under construction; its axis starts where the element from the clamp's side ends.
#[derive(Debug, Clone, Default)]
struct Assembly {
    pieces: Vec<Piece>,
    length: f64,
    magnets: Vec<(f64, Vector3<f64>)>,
    /// Place, radius and length.
    surfaces: Vec<[f64; 3]>,
}

impl Chain {
    /// Cuts the sections into elements and joins the rest.
    pub fn new(description: &ManipulatorDescription, meshing: Meshing) -> Self {
        let rotation = Matrix3::from_row_iterator(description.base_rotation.into_iter().flatten());
        let base = Pose {
            position: Vector3::from(description.base_position),
            rotation: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
        };
        let mut chain = Self {
            clamp: base,
            base,
            bodies: Vec::new(),
            elements: Vec::new(),
            magnets: Vec::new(),
            contact_points: Vec::new(),
            unloaded: Vec::new(),
        };
        let mut assembly = Assembly::default();
        for part in &description.parts {
            match part {
                PartDescription::Magnet(magnet) => assembly.join(magnet),
                PartDescription::Section(section) => {
                    let count = meshing.elements(section);
                    let element = Element::of_section(section, count);
                    for _ in 0..count {
                        let end = assembly.length;
                        assembly.glue(section, end, element.length / 6.0, element.length);
                        chain.finish(std::mem::take(&mut assembly));
                        chain.elements.push(element.clone());
                        assembly.glue(section, 0.0, -element.length / 6.0, element.length);
                    }
                }
            }
        }
        chain.finish(assembly);
        chain.unloaded = chain.unloaded_poses();
        chain
    }

    /// kg, of all that can move.
    pub fn moving_mass(&self) -> f64 {
        self.bodies.iter().map(|body| body.mass).sum()
    }

    /// The pose from which offsets of magnets joined to the clamp count.
    pub fn clamp_of_magnets(&self) -> Pose {
        self.base
    }

    /// Takes over a finished body; the first is the clamp.
    fn finish(&mut self, assembly: Assembly) {
        let clamped = self.elements.is_empty();
        let centre = if clamped { 0.0 } else { assembly.centre() };
        let body = (!clamped).then_some(self.bodies.len());
        let magnets = assembly.magnets.iter();
        self.magnets.extend(magnets.map(|(at, moment)| Magnet {
            body,
            offset: at - centre,
            moment_body: *moment,
        }));
        if let Some(body) = body {
            let point = |[at, radius, length]: &[f64; 3]| ContactPoint {
                body,
                offset: at - centre,
                radius: *radius,
                length: *length,
            };
            self.contact_points.extend(assembly.surfaces.iter().map(point));
        }
        if clamped {
            self.clamp = Pose { position: self.base.along(assembly.length), ..self.base };
        } else {
            self.bodies.push(assembly.body(centre));
        }
    }

    fn unloaded_poses(&self) -> Vec<Pose> {
        let mut end = self.clamp;
        let place = |(body, element): (&Body, &Element)| {
            let half = exponential(&(element.precurvature * (element.length / 2.0)));
            let middle = end.rotation * half;
            let start = end.position + middle * element.unloaded_chord();
            let rotation = middle * half;
            let pose = Pose { position: start - rotation * Vector3::new(0.0, 0.0, body.proximal), rotation };
            end = Pose { position: pose.along(body.distal), rotation };
            pose
        };
        self.bodies.iter().zip(&self.elements).map(place).collect()
    }
}

impl Assembly {
    fn join(&mut self, magnet: &MagnetDescription) {
        let at = self.length + magnet.length / 2.0;
        self.length += magnet.length;
        self.pieces.push(Piece {
            mass: magnet.mass,
            at,
            inertia_transverse: magnet.mass * (3.0 * magnet.radius.powi(2) + magnet.length.powi(2)) / 12.0,
            inertia_axial: magnet.mass * magnet.radius.powi(2) / 2.0,
        });
        self.magnets.push((at, Vector3::from(magnet.moment_body)));
        for end in [at - magnet.length / 2.0, at + magnet.length / 2.0] {
            self.touch(end, magnet.radius, magnet.length / 2.0);
        }
    }

    /// A point of contact, joined with one of the same radius at the same place.
    fn touch(&mut self, at: f64, radius: f64, length: f64) {
        match self.surfaces.iter_mut().find(|surface| surface[0] == at && surface[1] == radius) {
            Some(surface) => surface[2] += length,
            None => self.surfaces.push([at, radius, length]),
        }
    }

    /// Half an element of a section, whose node is at the body's end and whose mass `inwards` from it. Its own rotary
    /// inertia is that of the cross-section.
    fn glue(&mut self, section: &SectionDescription, node: f64, inwards: f64, element_length: f64) {
        let at = node + inwards;
        self.touch(node, section.radius, element_length / 2.0);
        let mass = section.mass_per_length * element_length / 2.0;
        let inertia_transverse = mass * section.radius.powi(2) / 4.0;
        self.pieces.push(Piece { mass, at, inertia_transverse, inertia_axial: 2.0 * inertia_transverse });
    }

    fn mass(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.mass).sum()
    }

    /// Centre of mass; the middle of a body without mass.
    fn centre(&self) -> f64 {
        let mass = self.mass();
        if mass > 0.0 {
            self.pieces.iter().map(|piece| piece.mass * piece.at).sum::<f64>() / mass
        } else {
            self.length / 2.0
        }
    }

    fn body(&self, centre: f64) -> Body {
        // Between two elements of one section the halves' offsets are a device for the ends of the
        // section and cancel; as rotary inertia they would slow the higher modes.
        let is_node = self.magnets.is_empty() && self.pieces.len() == 2;
        let offset = |piece: &Piece| if is_node { 0.0 } else { piece.at - centre };
        Body {
            mass: self.mass(),
            inertia_transverse: self
                .pieces
                .iter()
                .map(|piece| piece.inertia_transverse + piece.mass * offset(piece).powi(2))
                .sum(),
            inertia_axial: self.pieces.iter().map(|piece| piece.inertia_axial).sum(),
            proximal: -centre,
            distal: self.length - centre,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn bigmag_cuts_into_bodies_of_the_right_mass_and_place() {
        let description = fixture::bigmag();
        let chain = Chain::new(&description.manipulator, Meshing { element_length_max: 2.5e-3 });
        assert_eq!((chain.bodies.len(), chain.elements.len(), chain.magnets.len()), (20, 20, 2));
        let magnet = 7500.0 * std::f64::consts::PI * 4e-6 * 5e-3;
        let rubber = fixture::rubber().mass_per_length * 0.05;
        // Half an element stays at the clamp.
        let clamped = fixture::rubber().mass_per_length * 1.25e-3;
        assert!((chain.moving_mass() - (2.0 * magnet + rubber - clamped)).abs() < 1e-15);
        for (magnet, expected) in chain.magnets.iter().zip([-0.0275, 0.0025]) {
            let body = magnet.body.expect("both magnets move");
            let centre = chain.unloaded[body].along(magnet.offset);
            assert!((centre - Vector3::new(expected, 0.0, 0.0)).norm() < 1e-15);
        }
    }

    #[test]
    fn neighbouring_magnets_are_one_body_and_a_leading_one_joins_the_clamp() {
        let mut description = fixture::bigmag().manipulator;
        let magnet = description.parts[1].clone();
        description.parts.insert(0, magnet.clone());
        description.parts.insert(2, magnet);
        let chain = Chain::new(&description, Meshing { element_length_max: 25e-3 });
        assert_eq!(chain.bodies.len(), 2);
        let bodies: Vec<_> = chain.magnets.iter().map(|magnet| magnet.body).collect();
        assert_eq!(bodies, [None, Some(0), Some(0), Some(1)]);
        assert!((chain.clamp.position - Vector3::new(-0.05, 0.0, 0.0)).norm() < 1e-15);
        assert!((chain.bodies[0].distal - chain.bodies[0].proximal - 0.01).abs() < 1e-15);
    }

    #[test]
    fn points_of_contact_stand_for_the_whole_length() {
        let description = fixture::bigmag();
        let chain = Chain::new(&description.manipulator, Meshing { element_length_max: 2.5e-3 });
        // Nine nodes and an end in each section, and both ends of each magnet; the rubber's end at a magnet is a point of its own.
        assert_eq!(chain.contact_points.len(), 2 * (9 + 1 + 2) + 1);
        let length: f64 = chain.contact_points.iter().map(|point| point.length).sum();
        // Half an element stays at the clamp.
        assert!((length - (0.06 - 1.25e-3)).abs() < 1e-15);
        let last = chain.contact_points.last().expect("has points");
        let tip = chain.unloaded[last.body].along(last.offset);
        assert!((tip - Vector3::new(0.005, 0.0, 0.0)).norm() < 1e-15 && last.radius == 2e-3);
    }

    #[test]
    fn unloaded_precurved_section_lies_on_its_arc() {
        let mut section = fixture::rubber();
        section.precurvature = [0.0, 10.0, 0.0];
        let description = fixture::cantilever(section);
        let chain = Chain::new(&description.manipulator, Meshing { element_length_max: 3e-3 });
        let tip = chain.unloaded[19].along(chain.bodies[19].distal);
        let expected = Vector3::new(0.1 * (1.0 - 0.6_f64.cos()), 0.0, 0.1 * 0.6_f64.sin());
        // phi = 0.03 an element: 0.03^4 / 1920 of 60 mm.
        assert!((tip - expected).norm() < 1e-10, "{tip}");
    }
}
