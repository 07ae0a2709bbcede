//! A small made-up rig.

use crate::description::{
    CoilDescription, FrameDescription, HardwareDescription, MagnetDescription, ManipulatorDescription,
    PartDescription, Rows3, SectionDescription, Workspace,
};

const IDENTITY: Rows3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Three coils (8 A, 200 A/s; the third 4 A, 100 A/s) on two frames (-180 to 180 degrees, 45 degrees/s), two magnets.
/// Its numbers describe no real device.
#[must_use]
pub fn example_description() -> HardwareDescription {
    let coil = |index: usize, current_max: f64, slew_max: f64| CoilDescription {
        name: format!("coil{index}"),
        coil_type: "iron".to_owned(),
        coefficients: vec![2.8e-6, 7.5e-8],
        valid_from_x: 0.043,
        rotation: IDENTITY,
        position: [-0.1, 0.0, 0.0],
        frame: (index < 2).then_some(index),
        current_max,
        slew_max,
        resistance: 5.0,
        inductance: 0.1,
        supply_voltage: 48.0,
    };
    let frame = |name: &str| FrameDescription {
        name: name.to_owned(),
        axis: [0.0, 0.0, 1.0],
        pivot: [0.0; 3],
        angle_min: (-180.0_f64).to_radians(),
        angle_max: 180.0_f64.to_radians(),
        speed_max: 45.0_f64.to_radians(),
    };
    let section = || {
        PartDescription::Section(SectionDescription {
            length: 0.025,
            radius: 0.0015,
            bending_stiffness: 2e-5,
            torsion_stiffness: 1.5e-5,
            extensible: None,
            mass_per_length: 0.0074,
            precurvature: [0.0; 3],
        })
    };
    let magnet = |name: &str, moment: f64| {
        PartDescription::Magnet(MagnetDescription {
            name: name.to_owned(),
            length: 0.005,
            radius: 0.002,
            mass: 4.7e-4,
            moment_body: [0.0, 0.0, moment],
        })
    };
    HardwareDescription {
        rig: "example".to_owned(),
        workspace: Workspace { center: [0.0; 3], radius: 0.055 },
        gravity: [0.0, 0.0, -9.81],
        frames: vec![frame("bottom"), frame("top")],
        coil_types: vec!["iron".to_owned()],
        coils: vec![coil(0, 8.0, 200.0), coil(1, 8.0, 200.0), coil(2, 4.0, 100.0)],
        manipulator: ManipulatorDescription {
            base_position: [-0.055, 0.0, 0.0],
            base_rotation: [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
            parts: vec![section(), magnet("m1", 0.065), section(), magnet("m2", -0.065)],
        },
    }
}
