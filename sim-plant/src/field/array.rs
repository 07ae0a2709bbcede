//! Field of the coil array and its wrench on the magnets.
//!
//! Each coil is the same all round its axis, so that it is known by where it stands, where it points and what
//! it carries. Gain, tilt and offset of a coil are those that the plant has and the description does not:
//!
//! `position = p_0 + R_0 o`, `axis = R_0 exp(tilt) e_x`, `field = gain f(i) field_1`             (F15)
//!
//! with `p_0`, `R_0` from the description, turned with the frame, and the field of one ampere of its
//! [`Source`].
//!
//! The description's series holds only outside of its source: each coil has a least local x. A sample taken
//! nearer says so, and is that of the nearest point at the least x: wrenches stay bounded where the series
//! would turn over and grow without limit. The same boundary holds for windings, so that truth and series are
//! bounded alike.

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{CoilDescription, FrameDescription};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::axial::Superposition;
use super::multipole::Multipole;
use super::sample::Field;
use super::saturation::Saturation;
use super::source::{CoilTruth, Source};
use super::table::Domain;
use crate::errors::CoilError;

/// How far beyond the workspace tables reach, over its radius: a free tip may leave it a little.
const REACH: f64 = 1.2;

/// One coil: its constants, and where it stands and what it carries now.
#[derive(Debug, Clone)]
struct Coil {
    source: Source,
    saturation: Saturation,
    gain: f64,
    valid_from_x: f64,
    frame: Option<usize>,
    axis_at_zero: Vector3<f64>,
    position_at_zero: Vector3<f64>,
    axis: Vector3<f64>,
    position: Vector3<f64>,
    /// Gain times effective current, A.
    drive: f64,
}

/// All coils at their present currents and frame angles.
#[derive(Debug, Clone)]
pub struct CoilArray {
    frames: Vec<FrameDescription>,
    coils: Vec<Coil>,
}

impl CoilArray {
    /// All coils of the description at zero current and zero angle. `truths` and `errors` have an entry for
    /// each coil, in order.
    ///
    /// # Panics
    /// When they have not: a coil without a truth would silently make no field.
    #[must_use]
    pub fn new(description: &HardwareDescription, truths: &[CoilTruth], errors: &[CoilError]) -> Self {
        let count = description.coils.len();
        assert_eq!((truths.len(), errors.len()), (count, count), "an entry for each coil");
        let coils = description.coils.iter().zip(truths).zip(errors);
        let coils = coils.map(|((coil, truth), error)| Coil::new(description, coil, *truth, error)).collect();
        Self { frames: description.frames.clone(), coils }
    }

    /// The same where every coil has exactly the series and the place of the description.
    #[must_use]
    pub fn as_described(description: &HardwareDescription) -> Self {
        let count = description.coils.len();
        let series = CoilTruth::Multipole(Saturation::None);
        Self::new(description, &vec![series; count], &vec![CoilError::NONE; count])
    }

    /// Sets currents, A, and frame angles, rad, in the order of the description.
    pub fn actuate(&mut self, currents: &[f64], angles: &[f64]) {
        for (coil, current) in self.coils.iter_mut().zip(currents) {
            coil.drive = coil.gain * coil.saturation.effective_current(*current); // (F15)
        }
        for (index, (frame, angle)) in self.frames.iter().zip(angles).enumerate() {
            let axis = Unit::new_unchecked(Vector3::from(frame.axis));
            let turn = *Rotation3::from_axis_angle(&axis, *angle).matrix();
            let pivot = Vector3::from(frame.pivot);
            for coil in self.coils.iter_mut().filter(|coil| coil.frame == Some(index)) {
                coil.axis = turn * coil.axis_at_zero;
                coil.position = pivot + turn * (coil.position_at_zero - pivot);
            }
        }
    }

    /// Field at `point` (m, world).
    #[must_use]
    pub fn at(&self, point: &Vector3<f64>) -> Field {
        let mut total = Superposition::zero();
        let mut valid = true;
        for coil in self.coils.iter().filter(|coil| coil.drive != 0.0) {
            let from_face = point - coil.position;
            let x = coil.axis.dot(&from_face);
            let offset = from_face - coil.axis * x;
            valid &= x >= coil.valid_from_x;
            let field = coil.source.at(x.max(coil.valid_from_x), offset.norm_squared());
            total.add(&field, coil.drive, &coil.axis, &offset);
        }
        Field { flux: total.flux(), gradient: total.gradient(), valid }
    }
}

impl Coil {
    fn new(
        description: &HardwareDescription,
        coil: &CoilDescription,
        truth: CoilTruth,
        error: &CoilError,
    ) -> Self {
        let rotation = Matrix3::from_row_iterator(coil.rotation.into_iter().flatten());
        let position = Vector3::from(coil.position) + rotation * error.offset; // (F15)
        let axis = rotation * (Rotation3::new(error.tilt) * Vector3::x()); // (F15)
        let (source, saturation) = match truth {
            CoilTruth::Winding(winding) => {
                (Source::winding(winding, domain(description, coil)), Saturation::None)
            }
            CoilTruth::Multipole(saturation) => {
                (Source::Multipole(Multipole::new(&coil.coefficients)), saturation)
            }
        };
        Self {
            source,
            saturation,
            gain: error.gain,
            valid_from_x: coil.valid_from_x,
            frame: coil.frame,
            axis_at_zero: axis,
            position_at_zero: position,
            axis,
            position,
            drive: 0.0,
        }
    }
}

/// Where in a coil's half plane the workspace lies, as described and at frame angle zero: errors do not
/// change it, so that coils built alike and placed alike share their table.
fn domain(description: &HardwareDescription, coil: &CoilDescription) -> Domain {
    let center = Vector3::from(description.workspace.center) - Vector3::from(coil.position);
    let axis = Vector3::from(coil.rotation.map(|row| row[0]));
    let (x, reach) = (axis.dot(&center), REACH * description.workspace.radius);
    // Rounded up to a millimetre: coils that differ by rounding, or by less, share it as well.
    let rounded = |length: f64| (length * 1e3).ceil() * 1e-3;
    let aside = (center - axis * x).norm();
    Domain { x_min: coil.valid_from_x, x_max: rounded(x + reach), r_max: rounded(aside + reach) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::winding::Winding;
    use crate::fixture;

    fn vector(x: f64, y: f64, z: f64) -> Vector3<f64> {
        Vector3::new(x, y, z)
    }

    /// The series alone, as the controller knows it.
    const SERIES: [CoilTruth; 6] = [CoilTruth::Multipole(Saturation::None); 6];
    const AS_DESCRIBED: [CoilError; 6] = [CoilError::NONE; 6];

    /// The field of coil `index` at 1 A at a point of the coil's own frame, by an array of which it is the
    /// only coil.
    fn in_own_frame(index: usize, point: Vector3<f64>) -> Field {
        let mut description = fixture::bigmag();
        let mut coil = description.coils.swap_remove(index);
        coil.rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        coil.position = [0.0; 3];
        coil.frame = None;
        description.coils = vec![coil];
        let mut array = CoilArray::as_described(&description);
        array.actuate(&[1.0], &[]);
        array.at(&point)
    }

    #[test]
    fn one_coil_in_its_own_frame_agrees_with_the_reference_vectors() {
        let air = in_own_frame(4, vector(0.08, 0.02, -0.013));
        assert!((air.flux - vector(7.3184e-4, 1.7779e-4, -1.1557e-4)).norm() < 2e-8);
        let expected = Matrix3::new(
            -0.016425, -0.005208, 0.003386, -0.005208, 0.007938, 0.000619, 0.003386, 0.000619, 0.008487,
        );
        assert!((air.gradient - expected).amax() < 1e-6);
        let iron = in_own_frame(0, vector(0.05, 0.0, 0.0));
        assert!((iron.flux - vector(1.144_543e-2, 0.0, 0.0)).norm() < 1e-8);
        let expected = Matrix3::from_diagonal(&vector(-0.386_194, 0.193_097, 0.193_097));
        assert!((iron.gradient - expected).amax() < 1e-6);
    }

    /// Field of each coil of BigMag at 1 A, mT.
    fn columns(point: Vector3<f64>, bottom_deg: f64, top_deg: f64) -> Vec<Vector3<f64>> {
        let mut array = CoilArray::as_described(&fixture::bigmag());
        (0..6)
            .map(|coil| {
                let mut currents = [0.0; 6];
                currents[coil] = 1.0;
                array.actuate(&currents, &[bottom_deg.to_radians(), top_deg.to_radians()]);
                array.at(&point).flux * 1e3
            })
            .collect()
    }

    #[test]
    fn every_coil_of_the_array_agrees_with_the_reference_table() {
        let x = [-2.105_592, 2.072_903, -2.189_702, 2.088_892, 0.0, 0.0];
        let z = [1.431_496, 1.357_503, -1.422_009, -1.363_811, 0.712_599, -0.712_599];
        for (coil, field) in columns(Vector3::zeros(), 0.0, 0.0).into_iter().enumerate() {
            assert!((field - vector(x[coil], 0.0, z[coil])).amax() < 2e-6, "coil {coil}: {field}");
        }
        let x = [-3.568_104, 1.547_67, -0.765_141, 1.220_814, 0.239_142, 0.101_491];
        let y = [-2.172_848, 0.863_916, 1.523_86, -0.689_881, 0.119_571, 0.050_745];
        let z = [2.852_145, 0.593_322, -1.546_604, -1.065_856, 0.924_062, -0.478_856];
        for (coil, field) in columns(vector(0.02, 0.01, -0.015), 30.0, -45.0).into_iter().enumerate() {
            assert!((field - vector(x[coil], y[coil], z[coil])).amax() < 2e-6, "coil {coil}: {field}");
        }
    }

    #[test]
    fn gradient_is_the_derivative_of_the_field_up_to_order_ten() {
        let mut description = fixture::bigmag();
        for coil in &mut description.coils {
            coil.coefficients = (0..10).map(|k| 1e-6 * 0.02_f64.powi(k) / f64::from(k + 1)).collect();
        }
        let mut array = CoilArray::as_described(&description);
        array.actuate(&[1.0, -2.0, 3.0, 0.5, -4.0, 2.5], &[0.3, -0.8]);
        let point = vector(0.012, -0.007, 0.015);
        let gradient = array.at(&point).gradient;
        let scale = gradient.amax();
        assert!(gradient.trace().abs() < 1e-12 * scale);
        assert!((gradient - gradient.transpose()).amax() < 1e-12 * scale);
        // Central differences at 1e-5 m: truncation near (1e-5 / 0.08)^2 of the value.
        let step = 1e-5;
        for axis in 0..3 {
            let offset = Vector3::ith(axis, step);
            let difference =
                (array.at(&(point + offset)).flux - array.at(&(point - offset)).flux) / (2.0 * step);
            assert!((difference - gradient.column(axis)).amax() < 1e-6 * scale);
        }
    }

    #[test]
    fn force_and_torque_are_derivatives_of_the_dipole_energy() {
        let mut array = CoilArray::as_described(&fixture::bigmag());
        array.actuate(&[3.0, -2.0, 1.0, 4.0, -5.0, 2.0], &[0.2, -0.4]);
        let (point, moment) = (vector(0.01, 0.004, -0.006), vector(0.02, -0.05, 0.03));
        let wrench = array.at(&point).wrench(&moment);
        let energy = |point: Vector3<f64>, moment: Vector3<f64>| -moment.dot(&array.at(&point).flux);
        let step = 1e-5;
        for axis in 0..3 {
            let offset = Vector3::ith(axis, step);
            let force = -(energy(point + offset, moment) - energy(point - offset, moment)) / (2.0 * step);
            assert!((force - wrench.force[axis]).abs() < 1e-6 * wrench.force.norm());
            let turn = |sign: f64| Rotation3::new(offset * sign) * moment;
            let torque = -(energy(point, turn(1.0)) - energy(point, turn(-1.0))) / (2.0 * step);
            assert!((torque - wrench.torque[axis]).abs() < 1e-6 * wrench.torque.norm());
        }
    }

    #[test]
    fn a_point_inside_a_coil_is_reported() {
        let mut array = CoilArray::as_described(&fixture::bigmag());
        array.actuate(&[0.0, 0.0, 0.0, 0.0, 1.0, 0.0], &[0.0, 0.0]);
        assert!(array.at(&Vector3::zeros()).valid);
        assert!(!array.at(&vector(0.0, 0.0, -0.05)).valid);
    }

    #[test]
    fn a_coil_gain_scales_the_field_of_that_coil_alone() {
        let description = fixture::bigmag();
        let mut errors = AS_DESCRIBED;
        errors[0].gain = 1.02;
        let mut exact = CoilArray::as_described(&description);
        let mut off = CoilArray::new(&description, &SERIES, &errors);
        exact.actuate(&[1.0], &[]);
        off.actuate(&[1.0], &[]);
        let point = vector(0.01, 0.0, 0.0);
        assert!((off.at(&point).flux - exact.at(&point).flux * 1.02).norm() < 1e-15);
        exact.actuate(&[0.0, 1.0], &[]);
        off.actuate(&[0.0, 1.0], &[]);
        assert_eq!(off.at(&point), exact.at(&point));
    }

    /// Goal: a coil shifted and tilted in its own frame makes the field that the same coil makes when it is
    /// described there.
    #[test]
    fn a_tilted_and_shifted_coil_is_the_coil_described_at_that_place() {
        let mut description = fixture::bigmag();
        let error = CoilError {
            tilt: vector(0.0, 0.02, -0.03),
            offset: vector(1e-3, -2e-3, 5e-4),
            ..CoilError::NONE
        };
        let mut off = CoilArray::new(&description, &SERIES, &[error; 6]);
        for coil in &mut description.coils {
            let rotation = Matrix3::from_row_iterator(coil.rotation.into_iter().flatten());
            coil.position = (Vector3::from(coil.position) + rotation * error.offset).into();
            let tilted = rotation * Rotation3::new(error.tilt).matrix();
            coil.rotation = tilted.transpose().into();
        }
        let mut described = CoilArray::as_described(&description);
        let (currents, angles) = ([1.0, -2.0, 3.0, 0.5, -4.0, 2.5], [0.4, -0.7]);
        off.actuate(&currents, &angles);
        described.actuate(&currents, &angles);
        let point = vector(0.01, -0.02, 0.015);
        let (found, expected) = (off.at(&point), described.at(&point));
        assert!((found.flux - expected.flux).norm() < 1e-14 * expected.flux.norm());
        assert!((found.gradient - expected.gradient).norm() < 1e-13 * expected.gradient.norm());
    }

    /// Goal: truth by type: air cores are windings and add up with cores that lose 4 % at 8 A.
    #[test]
    fn windings_and_saturated_cores_make_the_shipped_array() {
        let description = fixture::bigmag();
        let winding = Winding { inner_radius: 0.045, outer_radius: 0.063, length: 0.043, turns: 642.0 };
        let mut truths = [CoilTruth::Multipole(Saturation::Knee(12.5)); 6];
        truths[4..].fill(CoilTruth::Winding(winding));
        let mut truth = CoilArray::new(&description, &truths, &AS_DESCRIBED);
        let mut model = CoilArray::as_described(&description);
        let center = Vector3::zeros();
        truth.actuate(&[8.0], &[]);
        model.actuate(&[8.0], &[]);
        let ratio = truth.at(&center).flux.norm() / model.at(&center).flux.norm();
        assert!((ratio - Saturation::Knee(12.5).effective_current(8.0) / 8.0).abs() < 1e-14);
        let air_alone = [0.0, 0.0, 0.0, 0.0, 8.0, 0.0];
        truth.actuate(&air_alone, &[]);
        model.actuate(&air_alone, &[]);
        let (found, expected) = (truth.at(&center), model.at(&center));
        // Coil 4 stands below and points up; the winding was chosen after its series.
        assert!((found.flux.z / (8.0 * winding.at(0.0855, 0.0).along) - 1.0).abs() < 1e-6);
        assert!((found.flux - expected.flux).norm() < 0.01 * expected.flux.norm());
        assert_ne!(found.flux, expected.flux);
        // Nearer than the series holds, the winding is asked at the boundary too, and says so.
        let (inside, boundary) = (vector(0.0, 0.0, -0.08), vector(0.0, 0.0, -0.0855 + 0.043));
        let (inside, boundary) = (truth.at(&inside), truth.at(&boundary));
        assert!(!inside.valid && (inside.flux - boundary.flux).norm() < 1e-12 * boundary.flux.norm());
    }
}
