//! A manipulator as a chain of rigid links with springs between them: its energy, the energy's gradient in
//! closed form and its Hessian by differences of that. Knows nothing of shooting.
//!
//! The unknowns of a body are the rotation vector `theta` from the body before it, `R = R_before exp(theta)`,
//! and for a link of an extensible section its strain `e`, `p_end = p + h R (e3 + e)`. With F and M the force
//! and moment (about the body's start) of all loads on it and on what lies beyond,
//! ```text
//! U = sum theta.k theta / 2 + h e.K e / 2 - loads,   dU/dtheta = k theta - Jl(theta)^T R_before^T M
//! dU/de = h K e - h R^T F_beyond - (h/2) R^T weight
//! ```
//! with Jl the left Jacobian of the rotation group.

use magsteer::magnetics::{AppliedField, FieldSample};
use magsteer::rod::Station;
use magsteer_hal::HardwareDescription;
use magsteer_hal::description::PartDescription;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};

/// Step of the differences of the gradient, rad or strain: truncation 1e-12, rounding 1e-10 of the stiffness.
const STEP: f64 = 1e-6;
/// Most Newton steps from the continuous rod's shape to the chain's own equilibrium.
const ITERATIONS_MAX: usize = 12;

/// A rigid body of the chain.
struct Body {
    length: f64,
    mass: f64,
    /// Dipole moment in body axes; zero for a link.
    moment: Vector3<f64>,
    /// Of the spring before it, N m/rad in body axes.
    spring: Vector3<f64>,
    /// Shear and axial stiffness, N, of an extensible link.
    extensional: Option<Vector3<f64>>,
}

/// The chain.
pub struct Links {
    bodies: Vec<Body>,
    base_position: Vector3<f64>,
    base_rotation: Matrix3<f64>,
    gravity: Vector3<f64>,
    unknowns: DVector<f64>,
}

/// Eigenvalues of the Hessian relative to the elastic energy's, ascending.
pub struct Spectrum {
    pub eigenvalues: Vec<f64>,
}

/// A body in place.
struct Placed {
    before: Matrix3<f64>,
    rotation: Matrix3<f64>,
    start: Vector3<f64>,
    end: Vector3<f64>,
}

impl Links {
    /// The chain of `rig`, every section cut into so many links.
    pub fn new(rig: &HardwareDescription, cuts: impl Iterator<Item = usize>) -> Self {
        let mut cuts = cuts;
        let mut bodies: Vec<Body> = Vec::new();
        // Compliance between the centre of the last link and the next body, rad/(N m).
        let mut compliance = Vector3::zeros();
        for part in &rig.manipulator.parts {
            match part {
                PartDescription::Section(section) => {
                    let count = cuts.next().expect("a number for every section");
                    let length = section.length / count as f64;
                    let stiffness = [section.bending_stiffness; 2];
                    let stiffness = Vector3::new(stiffness[0], stiffness[1], section.torsion_stiffness);
                    let half = stiffness.map(|stiffness| 0.5 * length / stiffness);
                    assert_eq!(section.precurvature, [0.0; 3]);
                    for _ in 0..count {
                        bodies.push(Body {
                            length,
                            mass: section.mass_per_length * length,
                            moment: Vector3::zeros(),
                            spring: (compliance + half).map(f64::recip),
                            extensional: section.extensible.map(|k| Vector3::new(k.shear, k.shear, k.axial)),
                        });
                        compliance = half;
                    }
                }
                PartDescription::Magnet(magnet) => {
                    bodies.push(Body {
                        length: magnet.length,
                        mass: magnet.mass,
                        moment: magnet.moment_body.into(),
                        spring: compliance.map(f64::recip),
                        extensional: None,
                    });
                    compliance = Vector3::zeros();
                }
            }
        }
        let unknowns = bodies.iter().map(|body| if body.extensional.is_some() { 6 } else { 3 }).sum();
        let rows = &rig.manipulator.base_rotation;
        Self {
            bodies,
            base_position: rig.manipulator.base_position.into(),
            base_rotation: Matrix3::from_fn(|i, j| rows[i][j]),
            gravity: rig.gravity.into(),
            unknowns: DVector::zeros(unknowns),
        }
    }

    /// Lays the chain along a centre line with a station at the start and at the end of every body, without
    /// twist.
    pub fn lay_along(&mut self, shape: &[Station]) {
        assert_eq!(shape.len(), self.bodies.len() + 1);
        let mut frame = Rotation3::from_matrix_unchecked(self.base_rotation);
        let mut first = 0;
        for (body, ends) in self.bodies.iter().zip(shape.windows(2)) {
            let rigid = body.moment != Vector3::zeros();
            let tangent =
                if rigid { ends[1].tangent } else { (ends[0].tangent + ends[1].tangent).normalize() };
            let turn = Rotation3::rotation_between(&(frame * Vector3::z()), &tangent).expect("not reversed");
            let theta = frame.inverse() * turn.scaled_axis();
            self.unknowns.rows_mut(first, 3).copy_from(&theta);
            frame = turn * frame;
            first += 3;
            if body.extensional.is_some() {
                let chord = (ends[1].position - ends[0].position) / body.length;
                self.unknowns.rows_mut(first, 3).copy_from(&(frame.inverse() * chord - Vector3::z()));
                first += 3;
            }
        }
    }

    /// Moves to the chain's own equilibrium and returns the spectrum there; `None` when there is none close
    /// by.
    pub fn spectrum(&mut self, field: &impl AppliedField) -> Option<Spectrum> {
        let start = self.unknowns.clone();
        let mut sample = FieldSample::default();
        for _ in 0..ITERATIONS_MAX {
            let gradient = self.gradient(field, &mut sample);
            let hessian = self.hessian(field, &mut sample);
            let step = hessian.clone().lu().solve(&gradient)?;
            if step.amax() < 1e-9 {
                let scale = self.elastic().map(|stiffness| stiffness.sqrt().recip());
                let relative = DMatrix::from_fn(step.len(), step.len(), |i, j| {
                    0.5 * (hessian[(i, j)] + hessian[(j, i)]) * scale[i] * scale[j]
                });
                let mut eigenvalues = relative.symmetric_eigenvalues().as_slice().to_vec();
                eigenvalues.sort_by(f64::total_cmp);
                return Some(Spectrum { eigenvalues });
            }
            self.unknowns -= step;
            if (&self.unknowns - &start).amax() > 0.1 {
                return None;
            }
        }
        None
    }

    /// Diagonal of the elastic energy's Hessian.
    fn elastic(&self) -> DVector<f64> {
        let entries = self.bodies.iter().flat_map(|body| {
            let strain = body.extensional.map(|stiffness| stiffness * body.length);
            body.spring
                .iter()
                .copied()
                .chain(strain.into_iter().flat_map(|k| [k.x, k.y, k.z]))
                .collect::<Vec<_>>()
        });
        DVector::from_iterator(self.unknowns.len(), entries)
    }

    fn hessian(&mut self, field: &impl AppliedField, sample: &mut FieldSample) -> DMatrix<f64> {
        let size = self.unknowns.len();
        let mut hessian = DMatrix::zeros(size, size);
        for column in 0..size {
            let here = self.unknowns[column];
            self.unknowns[column] = here + STEP;
            let ahead = self.gradient(field, sample);
            self.unknowns[column] = here - STEP;
            let behind = self.gradient(field, sample);
            self.unknowns[column] = here;
            hessian.set_column(column, &((ahead - behind) / (2.0 * STEP)));
        }
        hessian
    }

    fn placed(&self) -> Vec<Placed> {
        let (mut rotation, mut start) = (self.base_rotation, self.base_position);
        let mut first = 0;
        let place = |body: &Body| {
            let before = rotation;
            rotation = before * Rotation3::from_scaled_axis(self.vector(first)).matrix();
            first += 3;
            let mut along = Vector3::z();
            if body.extensional.is_some() {
                along += self.vector(first);
                first += 3;
            }
            let end = start + rotation * along * body.length;
            let placed = Placed { before, rotation, start, end };
            start = end;
            placed
        };
        self.bodies.iter().map(place).collect()
    }

    fn vector(&self, first: usize) -> Vector3<f64> {
        self.unknowns.fixed_rows::<3>(first).into()
    }

    fn gradient(&self, field: &impl AppliedField, sample: &mut FieldSample) -> DVector<f64> {
        let mut gradient = DVector::zeros(self.unknowns.len());
        // Force of all loads beyond a body and their moment about its end.
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        let mut first = self.unknowns.len();
        for (body, at) in self.bodies.iter().zip(self.placed()).rev() {
            let center = 0.5 * (at.start + at.end);
            let weight = self.gravity * body.mass;
            if let Some(stiffness) = body.extensional {
                first -= 3;
                let strain = self.vector(first).component_mul(&stiffness);
                let pulled = at.rotation.transpose() * (force + 0.5 * weight);
                gradient.rows_mut(first, 3).copy_from(&((strain - pulled) * body.length));
            }
            moment += (at.end - at.start).cross(&force);
            let mut own = weight;
            if body.moment != Vector3::zeros() {
                field.evaluate(&center, sample);
                let dipole = at.rotation * body.moment;
                own += sample.gradient.matrix() * dipole;
                moment += dipole.cross(&sample.field);
            }
            moment += (center - at.start).cross(&own);
            force += own;
            first -= 3;
            let theta = self.vector(first);
            let turning = left_jacobian(&theta).transpose() * (at.before.transpose() * moment);
            gradient.rows_mut(first, 3).copy_from(&(theta.component_mul(&body.spring) - turning));
        }
        gradient
    }
}

/// `exp(theta + d) = exp(Jl d) exp(theta)` to first order.
fn left_jacobian(theta: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (theta.norm(), theta.cross_matrix());
    // Series below 1e-3 rad: truncation under 1e-14.
    let (first, second) = if angle < 1e-3 {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3))
    };
    Matrix3::identity() + cross * first + cross * cross * second
}
