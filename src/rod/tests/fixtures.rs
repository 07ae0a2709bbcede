//! Rods and fields that several tests share.

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{
    ExtensibleStiffness, MagnetDescription, ManipulatorDescription, PartDescription, Rows3,
    SectionDescription, Workspace,
};
use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::magnetics::{
    AffineField, AppliedField, FieldColumn, FieldGradient, FieldSample, FieldSecondGradient,
};
use crate::rod::{Manipulator, Pass, PassMode, RodConfig, TipLoad, Wrenches};

/// Jacobians of rotations and positions too.
pub const POSES: PassMode = PassMode { poses: true, wrenches: Wrenches::Following };
/// Clamp with the tangent along +z.
pub const UPRIGHT: Rows3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Clamp with the tangent along +x.
pub const HORIZONTAL: Rows3 = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];

pub fn description(
    base_rotation: Rows3,
    gravity: [f64; 3],
    parts: Vec<PartDescription>,
) -> HardwareDescription {
    HardwareDescription {
        rig: "test".into(),
        workspace: Workspace { center: [0.0; 3], radius: 1.0 },
        gravity,
        frames: Vec::new(),
        coil_types: Vec::new(),
        coils: Vec::new(),
        manipulator: ManipulatorDescription { base_position: [0.0; 3], base_rotation, parts },
    }
}

/// A weightless, straight Kirchhoff section.
pub fn section(length: f64, bending_stiffness: f64, torsion_stiffness: f64) -> SectionDescription {
    SectionDescription {
        length,
        radius: 1e-3,
        bending_stiffness,
        torsion_stiffness,
        extensible: None,
        mass_per_length: 0.0,
        precurvature: [0.0; 3],
    }
}

pub fn magnet(length: f64, mass: f64, moment_body: [f64; 3]) -> PartDescription {
    PartDescription::Magnet(MagnetDescription { name: "m".into(), length, radius: 1e-3, mass, moment_body })
}

/// Fine options: residuals near rounding, so that differences of solutions are clean.
pub fn options(segment_length_max: f64) -> RodConfig {
    RodConfig {
        segment_length_max_mm: segment_length_max * 1e3,
        residual_tolerance: 1e-12,
        iterations_max: 50,
        rotation_step_max_deg: 20.0,
        passes_max: 20_000,
    }
}

pub fn build(description: &HardwareDescription, segment_length_max: f64) -> Manipulator {
    options(segment_length_max).build(description).expect("the fixture is valid")
}

/// Kirchhoff cantilever of unit length and stiffness along +z.
pub fn unit_cantilever(segments: usize) -> Manipulator {
    let parts = vec![PartDescription::Section(section(1.0, 1.0, 1.0))];
    build(&description(UPRIGHT, [0.0; 3], parts), 1.0 / segments as f64)
}

/// The stiffnesses of a round extensible section.
pub fn round_section(length: f64, radius: f64, young: f64, shear: f64, density: f64) -> SectionDescription {
    let area = std::f64::consts::PI * radius.powi(2);
    let inertia = std::f64::consts::FRAC_PI_4 * radius.powi(4);
    SectionDescription {
        length,
        radius,
        bending_stiffness: young * inertia,
        torsion_stiffness: 2.0 * shear * inertia,
        extensible: Some(ExtensibleStiffness { shear: shear * area, axial: young * area }),
        mass_per_length: density * area,
        precurvature: [0.0; 3],
    }
}

/// The two-magnet cantilever of `tests/reference/README.md`, with these signs of the two moments.
pub fn reference_two_magnets(signs: [f64; 2]) -> HardwareDescription {
    let (radius, magnet_length) = (1e-3, 4e-3);
    let young: f64 = 2.0e6;
    let volume = std::f64::consts::PI * 1e-6 * magnet_length;
    let moment = 1.32 / (4e-7 * std::f64::consts::PI) * volume;
    let part = |length| PartDescription::Section(round_section(length, radius, young, young / 3.0, 1030.0));
    let tip = |sign: f64| magnet(magnet_length, 7500.0 * volume, [0.0, 0.0, sign * moment]);
    let parts = vec![part(25e-3), tip(signs[0]), part(20e-3), tip(signs[1])];
    description(HORIZONTAL, [0.0, 0.0, -9.81], parts)
}

/// The default rig's manipulator: rubber 3 mm thick, antiparallel magnets (`config/bigmag-planar.toml`).
pub fn default_two_magnets() -> HardwareDescription {
    let (radius, young): (f64, f64) = (1.5e-3, 5.5e6);
    let rubber = || {
        let mut rubber = round_section(25e-3, radius, young, young / 2.9, 1040.0);
        rubber.extensible = None;
        PartDescription::Section(rubber)
    };
    let mass = 7500.0 * std::f64::consts::PI * 4e-6 * 5e-3;
    let parts = vec![
        rubber(),
        magnet(5e-3, mass, [0.0, 0.0, 0.065]),
        rubber(),
        magnet(5e-3, mass, [0.0, 0.0, -0.065]),
    ];
    let mut rig = description(HORIZONTAL, [0.0, 0.0, -9.81], parts);
    rig.manipulator.base_position = [-55e-3, 0.0, 0.0];
    rig
}

/// Precurved, extensible and Kirchhoff sections in one chain, and moments off the tangent.
pub fn mixed_chain() -> HardwareDescription {
    let mut rod = reference_two_magnets([1.0, -1.0]);
    let parts = &mut rod.manipulator.parts;
    if let PartDescription::Section(section) = &mut parts[0] {
        section.precurvature = [8.0, -12.0, 15.0];
    }
    if let PartDescription::Magnet(magnet) = &mut parts[1] {
        magnet.moment_body = [0.006, -0.004, 0.01];
    }
    if let PartDescription::Section(section) = &mut parts[2] {
        section.extensible = None;
    }
    let straight = parts[0].clone();
    parts.push(straight);
    if let PartDescription::Section(section) = &mut parts[4] {
        section.extensible = None;
        section.length = 10e-3;
    }
    // A magnet at the clamp, and two in a row.
    let magnet = parts[3].clone();
    parts.insert(0, magnet.clone());
    parts.insert(3, magnet);
    rod
}

/// One Newton step more than the tolerance asks for: to the floor of rounding.
pub fn polish(manipulator: &Manipulator, field: &impl AppliedField, load: &TipLoad, pass: &mut Pass) {
    let corrected = pass.unknowns() + pass.newton_step().expect("regular");
    manipulator.pass(field, load, &corrected, POSES, pass);
}

pub fn uniform(field: Vector3<f64>) -> AffineField {
    AffineField { field, gradient: FieldGradient::default() }
}

pub fn tip_load(force: [f64; 3], moment: [f64; 3]) -> TipLoad {
    TipLoad { force: force.into(), moment: moment.into() }
}

/// The Jacobian of a magnet's tangent as rows of numbers.
pub fn tangent_rows(pass: &Pass, magnet: usize) -> Vec<Vec<f64>> {
    pass.tangent_jacobian(magnet).iter().map(|row| row.to_vec()).collect()
}

/// Field of point dipoles with given strengths as parameters: strongly non-uniform, its derivatives in closed form.
/// `B_j = q_j grad (a_j . d / |d|^3) (-1)`, with `d` from the dipole.
#[derive(Debug, Clone)]
pub struct Dipoles {
    pub strengths: Vec<f64>,
    pub positions: Vec<Vector3<f64>>,
    pub axes: Vec<Vector3<f64>>,
}

impl Dipoles {
    /// Dipoles around the rod, some 60 to 90 mm away, up to about 5 mT and 0.2 T/m each.
    pub fn random(count: usize, random: &mut ChaCha8Rng) -> Self {
        let mut unit = |_| {
            let v = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0f64));
            v / v.norm().max(0.1)
        };
        let axes: Vec<Vector3<f64>> = (0..count).map(&mut unit).collect();
        let ways: Vec<Vector3<f64>> = (0..count).map(&mut unit).collect();
        let positions = ways
            .iter()
            .map(|way| Vector3::new(0.02, 0.0, 0.0) + way.normalize() * random.random_range(0.06..0.09))
            .collect();
        let strengths = (0..count).map(|_| random.random_range(-5e-7..5e-7)).collect();
        Self { strengths, positions, axes }
    }

    /// Field and its first two gradients of one dipole of unit strength, by tensors.
    fn unit(&self, index: usize, point: &Vector3<f64>) -> FieldTensors {
        let (a, d) = (self.axes[index], point - self.positions[index]);
        let r = d.norm();
        let (r5, r7, r9) = (r.powi(-5), r.powi(-7), r.powi(-9));
        let ad = a.dot(&d);
        let delta = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let field = d * (3.0 * ad * r5) - a * r.powi(-3);
        let gradient = Matrix3::from_fn(|i, j| {
            3.0 * r5 * (a[i] * d[j] + a[j] * d[i] + ad * delta(i, j)) - 15.0 * r7 * ad * d[i] * d[j]
        });
        let second = |i: usize, j: usize, k: usize| {
            let flat = a[i] * delta(j, k) + a[j] * delta(i, k) + a[k] * delta(i, j);
            let mixed = a[i] * d[j] * d[k] + a[j] * d[i] * d[k] + a[k] * d[i] * d[j];
            let traces = d[i] * delta(j, k) + d[j] * delta(i, k) + d[k] * delta(i, j);
            3.0 * r5 * flat - 15.0 * r7 * (mixed + ad * traces) + 105.0 * r9 * ad * d[i] * d[j] * d[k]
        };
        let second = [
            second(0, 0, 0),
            second(0, 0, 1),
            second(0, 0, 2),
            second(0, 1, 1),
            second(0, 1, 2),
            second(1, 1, 1),
            second(1, 1, 2),
        ];
        (field, gradient, second)
    }
}

type FieldTensors = (Vector3<f64>, Matrix3<f64>, [f64; 7]);

impl AppliedField for Dipoles {
    fn parameter_count(&self) -> usize {
        self.strengths.len()
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        let mut field = Vector3::zeros();
        let mut gradient = Matrix3::zeros();
        let mut second = [0.0; 7];
        for (index, strength) in self.strengths.iter().enumerate() {
            let (b, g, h) = self.unit(index, point);
            sample.columns[index] = FieldColumn { field: b, gradient: independent(&g) };
            field += b * *strength;
            gradient += g * *strength;
            for (sum, part) in second.iter_mut().zip(h) {
                *sum += part * strength;
            }
        }
        let [xxx, xxy, xxz, xyy, xyz, yyy, yyz] = second;
        sample.field = field;
        sample.gradient = independent(&gradient);
        sample.second_gradient = FieldSecondGradient { xxx, xxy, xxz, xyy, xyz, yyy, yyz };
        sample.valid = true;
    }
}

fn independent(g: &Matrix3<f64>) -> FieldGradient {
    FieldGradient { xx: g[(0, 0)], xy: g[(0, 1)], xz: g[(0, 2)], yy: g[(1, 1)], yz: g[(1, 2)] }
}

/// Rotation vector that takes `from` to `to`, world, by the skew part: exact to rounding for small angles,
/// where the trace is not.
pub fn rotation_between(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Vector3<f64> {
    let r = to * from.transpose();
    let sine = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) * 0.5;
    let length = sine.norm();
    if length > 0.0 { sine * (length.asin() / length) } else { sine }
}
