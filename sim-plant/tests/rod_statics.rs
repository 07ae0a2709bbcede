//! The rod at rest under forces, against closed forms and independent solutions.
//!
//! Dead loads at the tip are the weight of a magnet of negligible length.

#[path = "../src/fixture.rs"]
mod fixture;
#[path = "rod_oracles/unit_rod.rs"]
mod unit_rod;
mod validation;

use magsteer_hal::description::{
    ExtensibleStiffness, MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription,
};
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::{Meshing, Rod};
use nalgebra::{Matrix3, Vector3};
use unit_rod::{STEPPING, UPRIGHT, number, point, reference, rows, unit_section, unloaded, vector};
use validation::Row;

fn settled(parts: Vec<PartDescription>, rotation: [[f64; 3]; 3], gravity: [f64; 3], elements: usize) -> Rod {
    let mut rod = unloaded(parts, rotation, gravity, elements);
    assert!(rod.settle(|_| Field::zero()), "did not come to rest");
    rod
}

/// Greatest deviation of the tip's position over the length, and of its angle, rad.
#[derive(Default)]
struct Worst {
    position: f64,
    angle: f64,
}

impl Worst {
    fn take(&mut self, position: f64, angle: f64) {
        self.position = self.position.max(position);
        self.angle = self.angle.max(angle.abs());
    }
}

/// A tip force on 40 elements. The axial penalty stretches by `alpha` 1e-5.
fn elastica() -> Worst {
    let mut worst = Worst::default();
    for row in rows(&reference(), "elastica_tip_force") {
        let alpha = number(&row["alpha"]);
        let parts = vec![PartDescription::Section(unit_section()), point([0.0; 3])];
        let tip = settled(parts, UPRIGHT, [alpha, 0.0, 0.0], 40).tip_pose();
        let tangent = tip.rotation * Vector3::z();
        let expected = Vector3::new(number(&row["transverse"]), 0.0, number(&row["axial"]));
        let angle = tangent.x.atan2(tangent.z) - number(&row["tip_angle_rad"]);
        let error = (tip.position - expected).norm();
        assert!(error < 1e-5 * alpha + 2e-5, "alpha {alpha}: off by {error} L");
        worst.take(error, angle);
    }
    worst
}

/// Own weight on 40 elements.
fn heavy_elastica() -> Worst {
    let along_x = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    let mut worst = Worst::default();
    for row in rows(&reference(), "heavy_elastica") {
        let section = SectionDescription { mass_per_length: 1.0, ..unit_section() };
        let gravity = [0.0, 0.0, -number(&row["gamma"])];
        let tip = settled(vec![PartDescription::Section(section)], along_x, gravity, 40).tip_pose();
        let tangent = tip.rotation * Vector3::z();
        let expected = Vector3::new(number(&row["axial"]), 0.0, -number(&row["droop"]));
        let angle = (-tangent.z).atan2(tangent.x) - number(&row["tip_angle"]);
        worst.take((tip.position - expected).norm(), angle);
    }
    worst
}

/// Bathe and Bolourchi's 45-degree bend, radius 100, along +y curving to +x, tip force along +z; both torsion stiffnesses.
fn bend() -> f64 {
    let mut worst: f64 = 0.0;
    for row in rows(&reference(), "bend45") {
        let polar = if row["torsion"].as_str().is_some_and(|text| text.contains("polar")) {
            1.0 / 6.0
        } else {
            0.140_577
        };
        let section = SectionDescription {
            length: 100.0 * std::f64::consts::FRAC_PI_4,
            radius: 0.5,
            bending_stiffness: 1e7 / 12.0,
            torsion_stiffness: 0.5e7 * polar,
            extensible: Some(ExtensibleStiffness { shear: 0.5e7, axial: 1e7 }),
            mass_per_length: 0.0,
            // Third body axis along +y and first along +x: turning towards +x is positive about the second.
            precurvature: [0.0, 0.01, 0.0],
        };
        let length = section.length;
        let rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
        let parts = vec![PartDescription::Section(section), point([0.0; 3])];
        let tip = settled(parts, rotation, [0.0, 0.0, number(&row["P"])], 40).tip_pose();
        worst = worst.max((tip.position - vector(&row["tip"])).norm() / length);
    }
    worst
}

/// The shipped mesh's elements; positions over the length.
fn two_magnets_in_an_affine_field() -> Worst {
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
    let mut worst = Worst::default();
    let expected = &reference()["two_magnets_affine"]["magnets"];
    for index in 0..2 {
        let pose = rod.magnet_pose(index);
        let turned = (pose.rotation * Vector3::z()).angle(&vector(&expected[index]["tangent"]));
        worst.take((pose.position - vector(&expected[index]["p"])).norm() / 53e-3, turned);
    }
    worst
}

#[test]
fn rod_under_forces_rests_where_the_references_say() {
    let (elastica, heavy, affine) = (elastica(), heavy_elastica(), two_magnets_in_an_affine_field());
    // 40 elements: the mesh's own error; positions of the elastica up to 1e-5 alpha from stretching.
    let table = [
        Row::new("elastica, tip force to 15 EI/L², place over L", elastica.position, 1.7e-4, ""),
        Row::new("elastica, tip angle", elastica.angle.to_degrees(), 0.003, "deg"),
        Row::new("heavy elastica, to w L³ = 10 EI, place over L", heavy.position, 5e-5, ""),
        Row::new("heavy elastica, tip angle", heavy.angle.to_degrees(), 0.003, "deg"),
        Row::new("45-degree bend in space, place over L", bend(), 1.2e-5, ""),
        Row::new("two magnets, gravity, affine field, shipped mesh, place over L", affine.position, 4e-5, ""),
        Row::new("two magnets, tangents", affine.angle.to_degrees(), 0.005, "deg"),
    ];
    validation::hold("rod.md", "statics", &table);
}
