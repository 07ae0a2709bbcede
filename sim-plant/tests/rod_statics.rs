//! The rod at rest against closed forms and independent solutions.
//!
//! Numbers are copied from `rod_cases.json` of the project's reference data (scipy and mpmath, two
//! methods each). Dead loads at the tip are the weight of a magnet of negligible length.

#[path = "../src/fixture.rs"]
mod fixture;

use magsteer_hal::description::{
    ExtensibleStiffness, MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription,
};
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use nalgebra::{Matrix3, Vector3};

const STEPPING: Stepping = Stepping { step: 5e-4, retardation: 0.0 };
const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A point of 1 kg, but for a rotary inertia that keeps it from spinning freely.
fn weight() -> PartDescription {
    PartDescription::Magnet(MagnetDescription {
        name: "weight".to_owned(),
        length: 1e-9,
        radius: 1e-3,
        mass: 1.0,
        moment_body: [0.0; 3],
    })
}

fn unit_section() -> SectionDescription {
    SectionDescription {
        length: 1.0,
        radius: 0.01,
        bending_stiffness: 1.0,
        torsion_stiffness: 1.0,
        extensible: None,
        mass_per_length: 0.0,
        precurvature: [0.0; 3],
    }
}

fn settled(parts: Vec<PartDescription>, rotation: [[f64; 3]; 3], gravity: [f64; 3], elements: usize) -> Rod {
    let length = match &parts[0] {
        PartDescription::Section(section) => section.length,
        PartDescription::Magnet(magnet) => magnet.length,
    };
    let description = ManipulatorDescription { base_position: [0.0; 3], base_rotation: rotation, parts };
    let meshing = Meshing { element_length_max: length / elements as f64 };
    let mut rod = Rod::new(&description, gravity, meshing, STEPPING);
    assert!(rod.settle(|_| Field::zero()), "did not come to rest");
    rod
}

#[test]
fn tip_force_bends_the_rod_into_the_elastica() {
    // alpha = P L^2 / EI, transverse and axial tip position over L, tip angle.
    let rows = [
        (0.5, 0.162_143_575_658, 0.984_081_037_529, 0.244_533_647_133),
        (2.0, 0.493_457_480_397, 0.839_358_279_175, 0.781_749_831_557),
        (5.0, 0.713_791_523_612, 0.612_371_639_276, 1.215_368_117_612),
        (10.0, 0.810_609_024_880, 0.445_004_402_246, 1.430_285_538_804),
    ];
    for (alpha, transverse, axial, angle) in rows {
        let parts = vec![PartDescription::Section(unit_section()), weight()];
        let tip = settled(parts, UPRIGHT, [alpha, 0.0, 0.0], 40).tip_pose();
        let tangent = tip.rotation * Vector3::z();
        let error = Vector3::new(tip.position.x - transverse, 0.0, tip.position.z - axial).norm();
        let angle_error = tangent.x.atan2(tangent.z) - angle;
        // The axial penalty stretches by alpha 1e-5; the mesh of 40 adds about 2e-5.
        assert!(error < 1e-5 * alpha + 2e-5, "alpha {alpha}: off by {error} L");
        assert!(angle_error.abs() < 5e-5, "alpha {alpha}: off by {angle_error} rad");
    }
}

#[test]
fn own_weight_bends_the_rod_into_the_heavy_elastica() {
    // gamma = w L^3 / EI, droop and axial tip position over L, tip angle.
    let rows = [
        (1.0, 0.123_471_401_983, 0.991_246_395_347, 0.165_115_560_502),
        (10.0, 0.700_199_715_514, 0.656_353_761_239, 1.052_643_117_197),
    ];
    let along_x = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    for (gamma, droop, axial, angle) in rows {
        let section = SectionDescription { mass_per_length: 1.0, ..unit_section() };
        let tip =
            settled(vec![PartDescription::Section(section)], along_x, [0.0, 0.0, -gamma], 40).tip_pose();
        let tangent = tip.rotation * Vector3::z();
        let error = Vector3::new(tip.position.x - axial, 0.0, tip.position.z + droop).norm();
        let angle_error = (-tangent.z).atan2(tangent.x) - angle;
        assert!(error < 5e-5, "gamma {gamma}: off by {error} L");
        assert!(angle_error.abs() < 5e-5, "gamma {gamma}: off by {angle_error} rad");
    }
}

#[test]
fn precurved_bend_moves_in_space_as_the_reference_does() {
    // Bathe and Bolourchi's 45-degree bend, radius 100, along +y curving to +x, tip force along +z.
    let bend = SectionDescription {
        length: 100.0 * std::f64::consts::FRAC_PI_4,
        radius: 0.5,
        bending_stiffness: 1e7 / 12.0,
        torsion_stiffness: 0.5e7 / 6.0,
        extensible: Some(ExtensibleStiffness { shear: 0.5e7, axial: 1e7 }),
        mass_per_length: 0.0,
        // Third body axis along +y and first along +x: turning towards +x is positive about the second.
        precurvature: [0.0, 0.01, 0.0],
    };
    let rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    let rows = [
        (300.0, [22.244_780_945, 58.779_122_490, 40.191_891_672]),
        (600.0, [15.684_800_534, 47.150_438_574, 53.474_858_792]),
    ];
    for (force, expected) in rows {
        let parts = vec![PartDescription::Section(bend.clone()), weight()];
        let tip = settled(parts, rotation, [0.0, 0.0, force], 40).tip_pose();
        let error = (tip.position - Vector3::from(expected)).norm();
        assert!(error < 1e-3, "P {force}: off by {error} of 78.5");
    }
}

#[test]
fn two_magnets_in_an_affine_field_rest_where_the_reference_says() {
    let (young, radius): (f64, f64) = (2.0e6, 1e-3);
    let area = std::f64::consts::PI * radius.powi(2);
    let second_moment = area * radius.powi(2) / 4.0;
    let section = |length| {
        PartDescription::Section(SectionDescription {
            length,
            radius,
            bending_stiffness: young * second_moment,
            torsion_stiffness: young / 3.0 * 2.0 * second_moment,
            extensible: Some(ExtensibleStiffness { shear: young / 3.0 * area, axial: young * area }),
            mass_per_length: 1030.0 * area,
            precurvature: [0.0; 3],
        })
    };
    let volume = area * 4e-3;
    let magnet = || {
        PartDescription::Magnet(MagnetDescription {
            name: "m".to_owned(),
            length: 4e-3,
            radius,
            mass: 7500.0 * volume,
            moment_body: [0.0, 0.0, 1.32 * volume / (4e-7 * std::f64::consts::PI)],
        })
    };
    let description = ManipulatorDescription {
        base_position: [0.0; 3],
        base_rotation: [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
        parts: vec![section(25e-3), magnet(), section(20e-3), magnet()],
    };
    let gradient = Matrix3::new(0.05, 0.1, -0.15, 0.1, 0.02, 0.08, -0.15, 0.08, -0.07);
    let field = |point: &Vector3<f64>| Field {
        flux: Vector3::new(0.002, -0.003, 0.006) + gradient * point,
        gradient,
        valid: true,
    };
    let mut rod = Rod::new(&description, [0.0, 0.0, -9.81], Meshing { element_length_max: 2.5e-3 }, STEPPING);
    assert!(rod.settle(field));
    let expected = [
        (
            [0.025_269_565_075, 0.003_193_565_886, -0.008_435_945_599],
            [0.933_255_200_228, 0.138_046_621_539, -0.331_629_102_356],
        ),
        (
            [0.047_631_372_129, 0.007_042_021_651, -0.016_216_763_007],
            [0.956_551_612_174, 0.158_108_607_433, -0.244_970_776_833],
        ),
    ];
    for (index, (position, tangent)) in expected.into_iter().enumerate() {
        let pose = rod.magnet_pose(index);
        let off = (pose.position - Vector3::from(position)).norm();
        let turned = (pose.rotation * Vector3::z()).angle(&Vector3::from(tangent)).to_degrees();
        assert!(off < 2e-6, "magnet {index} off by {off} m");
        assert!(turned < 0.005, "magnet {index} off by {turned} deg");
    }
}
