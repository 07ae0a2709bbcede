//! One shooting pass: statics, Newton step and Jacobian. `cargo bench --bench rod`.
//!
//! The field is affine and costs next to nothing, so the numbers are the rod's own.

use divan::Bencher;
use magsteer::magnetics::{AffineField, AppliedField, FieldColumn, FieldGradient, FieldSample};
use magsteer::rod::{Manipulator, Pass, PassMode, RodConfig, TipLoad, Wrenches};
use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{
    MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription, Workspace,
};
use nalgebra::Vector3;

fn main() {
    divan::main();
}

/// The default rig's manipulator, with as many pairs of section and magnet.
fn description(magnets: usize) -> HardwareDescription {
    let inertia = std::f64::consts::FRAC_PI_4 * 1.5e-3_f64.powi(4);
    let section = SectionDescription {
        length: 25e-3,
        radius: 1.5e-3,
        bending_stiffness: 5.5e6 * inertia,
        torsion_stiffness: 5.5e6 / 1.45 * inertia,
        extensible: None,
        mass_per_length: 1040.0 * std::f64::consts::PI * 2.25e-6,
        precurvature: [0.0; 3],
    };
    let magnet = |index: usize| MagnetDescription {
        name: format!("m{index}"),
        length: 5e-3,
        radius: 2e-3,
        mass: 0.47e-3,
        moment_body: [0.0, 0.0, if index.is_multiple_of(2) { 0.065 } else { -0.065 }],
    };
    let parts = (0..magnets)
        .flat_map(|index| [PartDescription::Section(section.clone()), PartDescription::Magnet(magnet(index))])
        .collect();
    HardwareDescription {
        rig: "bench".into(),
        workspace: Workspace { center: [0.0; 3], radius: 0.055 },
        gravity: [0.0, 0.0, -9.81],
        frames: Vec::new(),
        coils: Vec::new(),
        manipulator: ManipulatorDescription {
            base_position: [-0.055, 0.0, 0.0],
            base_rotation: [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
            parts,
        },
    }
}

/// The affine field's eight parameters, repeated up to any number of them.
struct Wide {
    affine: AffineField,
    parameters: usize,
}

impl AppliedField for Wide {
    fn parameter_count(&self) -> usize {
        self.parameters
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        self.affine.evaluate(point, sample);
        for index in 8..self.parameters {
            let FieldColumn { field, gradient } = sample.columns[index % 8];
            sample.columns[index] = FieldColumn { field, gradient };
        }
    }
}

fn pass(bencher: Bencher, magnets: usize, parameters: usize, step_mm: f64, mode: PassMode) {
    let config = RodConfig {
        segment_length_max_mm: step_mm,
        residual_tolerance: 1e-9,
        iterations_max: 50,
        rotation_step_max_deg: 20.0,
        passes_max: 10_000,
    };
    let manipulator: Manipulator = config.build(&description(magnets)).expect("a valid rod");
    let affine = AffineField {
        field: Vector3::new(1e-3, 1e-3, 2e-3),
        gradient: FieldGradient { xx: 0.05, xy: 0.02, xz: -0.03, yy: 0.02, yz: 0.01 },
    };
    let field = Wide { affine, parameters };
    let mut pass = Pass::new(&manipulator);
    let load = TipLoad::NONE;
    let solution = manipulator.solve_from_rest(&field, &load, PassMode::default(), &mut pass);
    assert!(solution.converged(), "{solution:?}");
    let unknowns = pass.unknowns();
    bencher.bench_local(|| {
        manipulator.pass(&field, divan::black_box(&load), divan::black_box(&unknowns), mode, &mut pass);
        divan::black_box(&pass);
    });
}

const FROZEN: PassMode = PassMode { poses: false, wrenches: Wrenches::Frozen };
const POSES: PassMode = PassMode { poses: true, wrenches: Wrenches::Following };

#[divan::bench]
fn two_magnets_8_parameters_8_and_8_segments(bencher: Bencher) {
    pass(bencher, 2, 8, 3.125, PassMode::default());
}

#[divan::bench]
fn two_magnets_8_parameters_6_and_6_segments(bencher: Bencher) {
    pass(bencher, 2, 8, 25.0 / 6.0, PassMode::default());
}

#[divan::bench]
fn two_magnets_8_parameters_8_and_8_segments_frozen(bencher: Bencher) {
    pass(bencher, 2, 8, 3.125, FROZEN);
}

#[divan::bench]
fn two_magnets_8_parameters_8_and_8_segments_poses(bencher: Bencher) {
    pass(bencher, 2, 8, 3.125, POSES);
}

#[divan::bench]
fn four_magnets_16_parameters_8_segments_each(bencher: Bencher) {
    pass(bencher, 4, 16, 3.125, PassMode::default());
}

#[divan::bench]
fn eight_magnets_40_parameters_8_segments_each(bencher: Bencher) {
    pass(bencher, 8, 40, 3.125, PassMode::default());
}
