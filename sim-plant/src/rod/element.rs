//! One elastic element: strains from the poses of its two ends, and the wrenches that its stress makes.
//!
//! | symbol | meaning |
//! |---|---|
//! | `x_i`, `R_i`, `x_j`, `R_j` | ends nearer the clamp and nearer the tip |
//! | `h` | unstretched length, m |
//! | `phi` | `log(R_i^T R_j)`, rotation vector from end to end |
//! | `R_m` | rotation half-way between the ends; vectors below are in its axes |
//! | `rho` | `R_m^T (x_j - x_i)`, the chord |
//! | `c(phi)` | chord over length of an unstretched element bent by `phi`: `e3 + phi x (phi x e3) / 24` |
//! | `gamma` | shear (x, y) and stretch (z): `rho / h - c(phi)` |
//! | `kappa` | bending (x, y) and twist (z) beyond the unloaded shape: `phi / h - kappa_0`, 1/m |
//! | `N`, `M` | internal force `C gamma`, N, and moment `D kappa`, N m |
//! | `a_i`, `a_j` | small rotations of the ends; `b`: small displacement of `x_j - x_i` |
//!
//! The energy is `h/2 (gamma^T C gamma + kappa^T D kappa)`. The chord of an arc is met exactly up to
//! `phi^4 / 1920` (3e-9 for ten degrees an element), so pure bending strains nothing but `kappa`.
//!
//! Small rotations change `phi` by `D(phi) (a_j - a_i)` with `D = (phi^/2) / sinh(phi^/2)`, and `R_m` by
//! `(a_i + a_j)/2 - tanh(phi^/4) (a_j - a_i)/2`; both are even or odd functions of one skew matrix,
//! hence one coefficient each.

use magsteer_hal::description::SectionDescription;
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3};

use super::rotation::{logarithm, matrix, midpoint, skew};

/// Axial stiffness of an inextensible section, in units of `EI / L^2`. A tip force of `10 EI / L^2`,
/// which bends a cantilever by 80 degrees, stretches it by 1e-4 of its length; shear needs no such penalty,
/// since its residual flexibility alone stiffens it.
const INEXTENSIBLE: f64 = 1e5;

/// Stiffness and unloaded shape of one element.
#[derive(Debug, Clone)]
pub struct Element {
    /// `h`.
    pub length: f64,
    /// Diagonal of `C`, N.
    pub force_stiffness: Vector3<f64>,
    /// Diagonal of `D`, N m^2.
    pub moment_stiffness: Vector3<f64>,
    /// `kappa_0`, 1/m.
    pub precurvature: Vector3<f64>,
}

/// The relative pose of an element's ends.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    /// `phi`.
    pub turn: Vector3<f64>,
    /// `R_m`.
    pub frame: Matrix3<f64>,
    /// `rho`.
    pub chord: Vector3<f64>,
}

/// The six strains, or with stresses in their place the six stress resultants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strain {
    /// `gamma`, or `N`.
    pub force_like: Vector3<f64>,
    /// `kappa`, or `M`.
    pub moment_like: Vector3<f64>,
}

/// Derivative of the energy by the ends' poses, in the axes of `R_m`. The force at `x_j` is `force`,
/// that at `x_i` its opposite.
#[derive(Debug, Clone, Copy)]
pub struct EndGradient {
    /// At `x_j`, N.
    pub force: Vector3<f64>,
    /// By `a_i`, N m.
    pub moment_i: Vector3<f64>,
    /// By `a_j`, N m.
    pub moment_j: Vector3<f64>,
}

/// Derivative of [`EndGradient`] by the ends' poses; rows and columns force before moment.
#[derive(Debug, Clone, Copy)]
pub struct EndTangent {
    /// Row and column of end i.
    pub ii: Matrix6<f64>,
    /// Row of end i, column of end j.
    pub ij: Matrix6<f64>,
    /// Row of end j, column of end i.
    pub ji: Matrix6<f64>,
    /// Row and column of end j.
    pub jj: Matrix6<f64>,
}

/// How much of the material and of the geometric stiffness enters a tangent.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    /// Stress following strain.
    pub material: f64,
    /// Stress turning with the element.
    pub geometric: f64,
}

impl Link {
    /// Between an end at `x_i`, `q_i` and one at `x_j`, `q_j`.
    #[inline(always)]
    pub fn between(
        x_i: &Vector3<f64>,
        q_i: &UnitQuaternion<f64>,
        x_j: &Vector3<f64>,
        q_j: &UnitQuaternion<f64>,
    ) -> Self {
        let frame = matrix(&midpoint(q_i, q_j));
        Self { turn: logarithm(&(q_i.inverse() * q_j)), frame, chord: frame.tr_mul(&(x_j - x_i)) }
    }
}

impl Strain {
    /// Nothing strained.
    pub fn zero() -> Self {
        Self { force_like: Vector3::zeros(), moment_like: Vector3::zeros() }
    }

    /// `next - self`
    pub fn difference(&self, next: &Self) -> Self {
        Self {
            force_like: next.force_like - self.force_like,
            moment_like: next.moment_like - self.moment_like,
        }
    }

    /// `self + (next - self) * share`
    pub fn towards(&self, next: &Self, share: f64) -> Self {
        Self {
            force_like: self.force_like + (next.force_like - self.force_like) * share,
            moment_like: self.moment_like + (next.moment_like - self.moment_like) * share,
        }
    }
}

impl Element {
    /// One of `count` equal elements of a section.
    ///
    /// The transverse shear flexibility is `1/GA + h^2 / 12 EI`: the second term is the bending that
    /// one-point strains leave out, so that nodal loads deflect a chain exactly as they do the beam.
    pub fn of_section(section: &SectionDescription, count: usize) -> Self {
        let length = section.length / count as f64;
        let bending = section.bending_stiffness;
        let residual = length.powi(2) / (12.0 * bending);
        let (shear_flexibility, axial) = match section.extensible {
            Some(stiffness) => (1.0 / stiffness.shear, stiffness.axial),
            None => (0.0, INEXTENSIBLE * bending / section.length.powi(2)),
        };
        let shear = 1.0 / (shear_flexibility + residual);
        Self {
            length,
            force_stiffness: Vector3::new(shear, shear, axial),
            moment_stiffness: Vector3::new(bending, bending, section.torsion_stiffness),
            precurvature: Vector3::from(section.precurvature),
        }
    }

    /// Chord of the unloaded element, in the axes half-way along it.
    pub fn unloaded_chord(&self) -> Vector3<f64> {
        arc_chord(&(self.precurvature * self.length)) * self.length
    }

    /// Strains at a relative pose.
    #[inline(always)]
    pub fn strain(&self, link: &Link) -> Strain {
        Strain {
            force_like: link.chord / self.length - arc_chord(&link.turn),
            moment_like: link.turn / self.length - self.precurvature,
        }
    }

    /// Stress resultants of strains.
    #[inline(always)]
    pub fn stress(&self, strain: &Strain) -> Strain {
        Strain {
            force_like: self.force_stiffness.component_mul(&strain.force_like),
            moment_like: self.moment_stiffness.component_mul(&strain.moment_like),
        }
    }

    /// Elastic energy of strains, J.
    pub fn energy(&self, strain: &Strain) -> f64 {
        let stress = self.stress(strain);
        let density = stress.force_like.dot(&strain.force_like) + stress.moment_like.dot(&strain.moment_like);
        0.5 * self.length * density
    }

    /// What a stress asks of the ends.
    #[inline(always)]
    pub fn gradient(&self, link: &Link, stress: &Strain) -> EndGradient {
        let phi = &link.turn;
        let squared = phi.norm_squared();
        let force = stress.force_like;
        // N . dc(phi), symmetric in N and phi.
        let e3 = Vector3::z();
        let from_arc = (phi.cross(&e3).cross(&force) + e3.cross(&force.cross(phi))) / 24.0;
        let moment = stress.moment_like - from_arc * self.length;
        // D(phi) = 1 - (1/24 + 7 phi^2 / 5760) phi^ phi^
        let coefficient = 1.0 / 24.0 + squared * (7.0 / 5760.0);
        let turned = moment - phi.cross(&phi.cross(&moment)) * coefficient;
        // tanh(phi^/4) = (1/4)(1 + phi^2 / 48) phi^
        let lever = force.cross(&link.chord);
        let skewed = lever.cross(phi) * (0.125 * (1.0 + squared / 48.0));
        let inner = turned - skewed;
        EndGradient { force, moment_i: lever * 0.5 - inner, moment_j: lever * 0.5 + inner }
    }

    /// Derivative of [`Self::gradient`], with `stress` following the strains by `share.material`.
    ///
    /// Terms of relative size `phi^2 / 12` and `force h / 12` are left out: the tangent steers an iteration whose residual
    /// is complete.
    pub fn tangent(&self, link: &Link, stress: &Strain, share: Share) -> EndTangent {
        let stretch = Matrix3::from_diagonal(&(self.force_stiffness * (share.material / self.length)));
        let bend = Matrix3::from_diagonal(&(self.moment_stiffness * (share.material / self.length)));
        let chord = skew(&link.chord);
        let force = skew(&(stress.force_like * share.geometric));
        // How the chord's strain follows a_j - a_i: the turn of R_m, and the arc's own chord.
        let arc = (skew(&link.turn.cross(&Vector3::z())) + skew(&link.turn) * skew(&Vector3::z())) / 24.0;
        let skewed = arc * self.length - chord * skew(&link.turn) / 8.0;
        let inner_by_shift = skewed.tr_mul(&stretch);
        // Columns: both ends turning alike, then a_j turning more than a_i.
        let force_alike = (stretch * chord - force) * 0.5;
        let force_apart = stretch * skewed;
        let lever_by_shift = (force - chord * stretch) * 0.5;
        let lever_alike = (chord * force - chord * stretch * chord) * 0.25;
        let lever_apart = chord * force_apart * -0.5;
        let inner_alike = (inner_by_shift * chord - skew(&(stress.moment_like * share.geometric))) * 0.5;
        let inner_apart = bend + inner_by_shift * skewed;
        // Moments: half the lever's share plus (j) or minus (i) the inner one.
        let (shift_j, shift_i) = (lever_by_shift + inner_by_shift, lever_by_shift - inner_by_shift);
        let (alike_j, alike_i) = (lever_alike + inner_alike, lever_alike - inner_alike);
        let (apart_j, apart_i) = (lever_apart + inner_apart, lever_apart - inner_apart);
        EndTangent {
            ii: blocks(&stretch, &(force_apart - force_alike), &-shift_i, &(alike_i - apart_i)),
            ij: blocks(&-stretch, &(-force_apart - force_alike), &shift_i, &(alike_i + apart_i)),
            ji: blocks(&-stretch, &(force_alike - force_apart), &-shift_j, &(alike_j - apart_j)),
            jj: blocks(&stretch, &(force_alike + force_apart), &shift_j, &(alike_j + apart_j)),
        }
    }
}

/// `c(phi)`
fn arc_chord(phi: &Vector3<f64>) -> Vector3<f64> {
    let e3 = Vector3::z();
    e3 + phi.cross(&phi.cross(&e3)) / 24.0
}

/// A 6 x 6 matrix from its four blocks.
pub fn blocks(
    force_by_shift: &Matrix3<f64>,
    force_by_turn: &Matrix3<f64>,
    moment_by_shift: &Matrix3<f64>,
    moment_by_turn: &Matrix3<f64>,
) -> Matrix6<f64> {
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(force_by_shift);
    whole.fixed_view_mut::<3, 3>(0, 3).copy_from(force_by_turn);
    whole.fixed_view_mut::<3, 3>(3, 0).copy_from(moment_by_shift);
    whole.fixed_view_mut::<3, 3>(3, 3).copy_from(moment_by_turn);
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use crate::rod::rotation::exponential;

    type End = (Vector3<f64>, UnitQuaternion<f64>);

    fn element() -> Element {
        let mut section = fixture::rubber();
        section.extensible = Some(fixture::rubber_stretch());
        section.precurvature = [3.0, -2.0, 1.0];
        Element::of_section(&section, 10)
    }

    /// Two ends, strained in every way, turned away from the world's axes.
    fn ends(element: &Element) -> (End, End) {
        let q_i = exponential(&Vector3::new(0.7, -0.4, 1.1));
        let q_j = q_i * exponential(&Vector3::new(0.12, -0.08, 0.05));
        let chord = Vector3::new(2e-5, -1e-5, 1.001 * element.length);
        let x_i = Vector3::new(0.01, 0.02, -0.03);
        ((x_i, q_i), (x_i + midpoint(&q_i, &q_j) * chord, q_j))
    }

    fn energy(element: &Element, i: &End, j: &End) -> f64 {
        element.energy(&element.strain(&Link::between(&i.0, &i.1, &j.0, &j.1)))
    }

    /// An end moved by a displacement and a small rotation given in the axes `frame`.
    fn moved(end: &End, frame: &Matrix3<f64>, direction: usize, step: f64) -> End {
        let axis = frame.column(direction % 3) * step;
        if direction < 3 { (end.0 + axis, end.1) } else { (end.0, exponential(&axis) * end.1) }
    }

    #[test]
    fn gradient_is_the_derivative_of_the_energy() {
        let element = element();
        let (i, j) = ends(&element);
        let link = Link::between(&i.0, &i.1, &j.0, &j.1);
        let gradient = element.gradient(&link, &element.stress(&element.strain(&link)));
        let scale = [gradient.force.norm(), gradient.moment_j.norm()];
        let step = 1e-6;
        for direction in 0..6 {
            let slope_i = (energy(&element, &moved(&i, &link.frame, direction, step), &j)
                - energy(&element, &moved(&i, &link.frame, direction, -step), &j))
                / (2.0 * step);
            let slope_j = (energy(&element, &i, &moved(&j, &link.frame, direction, step))
                - energy(&element, &i, &moved(&j, &link.frame, direction, -step)))
                / (2.0 * step);
            let axis = direction % 3;
            let (found_i, found_j) = if direction < 3 {
                (-gradient.force[axis], gradient.force[axis])
            } else {
                (gradient.moment_i[axis], gradient.moment_j[axis])
            };
            // The series of D and tanh stop at phi^4 / 2000, about 1e-7 here.
            let tolerance = 1e-6 * scale[direction / 3];
            assert!((slope_i - found_i).abs() < tolerance, "end i, {direction}: {slope_i} {found_i}");
            assert!((slope_j - found_j).abs() < tolerance, "end j, {direction}: {slope_j} {found_j}");
        }
    }

    #[test]
    fn tangent_is_near_the_derivative_of_the_gradient() {
        let element = element();
        let (i, j) = ends(&element);
        let link = Link::between(&i.0, &i.1, &j.0, &j.1);
        let stress = element.stress(&element.strain(&link));
        let tangent = element.tangent(&link, &stress, Share { material: 1.0, geometric: 1.0 });
        // Gradient in fixed axes, those of the unmoved element.
        let gradient = |i: &End, j: &End| {
            let moved = Link::between(&i.0, &i.1, &j.0, &j.1);
            let gradient = element.gradient(&moved, &element.stress(&element.strain(&moved)));
            let turn = link.frame.transpose() * moved.frame;
            [turn * gradient.force, turn * gradient.moment_i, turn * gradient.moment_j]
        };
        let step = 1e-6;
        for direction in 0..6 {
            let up = gradient(&i, &moved(&j, &link.frame, direction, step));
            let down = gradient(&i, &moved(&j, &link.frame, direction, -step));
            let rows = [&tangent.jj, &tangent.ij, &tangent.jj];
            for (quantity, offset) in [(0, 0), (1, 3), (2, 3)] {
                let slope = (up[quantity] - down[quantity]) / (2.0 * step);
                let found = rows[quantity].fixed_view::<3, 1>(offset, direction);
                let scale = rows[quantity].fixed_view::<3, 3>(offset, direction / 3 * 3).amax();
                // Left out: phi^2 / 12, and the arc share of the geometric part, one per cent here.
                assert!((slope - found).amax() < 0.02 * scale, "{quantity} by {direction}: {slope} {found}");
            }
        }
    }

    #[test]
    fn pure_bending_into_an_arc_strains_nothing_else() {
        let element = Element::of_section(&fixture::rubber(), 10);
        let angle = 0.15;
        let radius = element.length / angle;
        let q = exponential(&Vector3::new(0.0, angle, 0.0));
        let tip = Vector3::new(radius * (1.0 - angle.cos()), 0.0, radius * angle.sin());
        let link = Link::between(&Vector3::zeros(), &UnitQuaternion::identity(), &tip, &q);
        let strain = element.strain(&link);
        // 0.15^4 / 1920 = 2.6e-7.
        assert!(strain.force_like.norm() < 3e-7, "{}", strain.force_like);
        assert!((strain.moment_like - Vector3::new(0.0, 1.0 / radius, 0.0)).norm() < 1e-11);
    }
}
