//! Every range and every unit of the tables, and what the description says of them.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use super::rotation::shortest_rotation_from_z;
use super::{
    CoilConfig, CoilTypeConfig, FrameConfig, HardwareConfig, MagnetConfig, ManipulatorConfig, MaterialConfig,
    PartConfig, RigConfig, SectionConfig, StiffnessSectionConfig,
};
use crate::description::{PartDescription, Rows3, SectionDescription};

/// Two coils of a published array on one frame, a rod of three sections with two magnets.
fn sound() -> HardwareConfig {
    let coil = |name: &str, azimuth_deg, elevation_deg, distance_mm, frame: Option<&str>| CoilConfig {
        name: name.to_owned(),
        coil_type: "iron".to_owned(),
        azimuth_deg: Some(azimuth_deg),
        elevation_deg: Some(elevation_deg),
        distance_mm: Some(distance_mm),
        position_mm: None,
        axis: None,
        frame: frame.map(str::to_owned),
        gain: None,
    };
    let section = |extensible| {
        PartConfig::Section(SectionConfig {
            material: "rubber".to_owned(),
            length_mm: 25.0,
            diameter_mm: 3.0,
            extensible,
            precurvature_per_m: None,
        })
    };
    let measured = PartConfig::StiffnessSection(StiffnessSectionConfig {
        length_mm: 10.0,
        diameter_mm: 2.0,
        bending_n_m2: 1e-5,
        torsion_n_m2: 2e-5,
        shear_n: Some(3.0),
        axial_n: Some(4.0),
        mass_kg_per_m: 0.005,
        precurvature_per_m: Some([1.0, 2.0, 3.0]),
    });
    let magnet = |name: &str, moment: f64| {
        PartConfig::Magnet(MagnetConfig {
            name: name.to_owned(),
            length_mm: 5.0,
            diameter_mm: 4.0,
            density_kg_per_m3: 7500.0,
            moment_body_a_m2: [0.0, 0.0, moment],
        })
    };
    HardwareConfig {
        rig: RigConfig {
            name: "bench-1".to_owned(),
            workspace_center_mm: [1.0, 2.0, 3.0],
            workspace_diameter_mm: 110.0,
            gravity_m_per_s2: [0.0, 0.0, -9.81],
        },
        frames: vec![FrameConfig {
            name: "bottom".to_owned(),
            axis: [0.0, 0.0, 2.0],
            pivot_mm: [0.0; 3],
            angle_min_deg: -180.0,
            angle_max_deg: 180.0,
            speed_max_deg_per_s: 45.0,
        }],
        coil_types: BTreeMap::from([("iron".to_owned(), iron())]),
        coils: vec![coil("0", 180.0, -34.21, 102.1, Some("bottom")), coil("5", 0.0, 90.0, 85.5, None)],
        manipulator: ManipulatorConfig {
            base_position_mm: [-55.0, 0.0, 0.0],
            base_tangent: [3.0, 0.0, 0.0],
            base_roll_deg: 0.0,
            materials: BTreeMap::from([(
                "rubber".to_owned(),
                MaterialConfig { young_modulus_mpa: 5.5, poisson_ratio: 0.45, density_kg_per_m3: 1040.0 },
            )]),
            parts: vec![section(false), magnet("m1", 0.065), section(true), magnet("m2", -0.065), measured],
        },
    }
}

fn iron() -> CoilTypeConfig {
    CoilTypeConfig {
        coefficients_si: vec![2.844727076399366e-6, 7.487269451547e-8],
        valid_from_x_mm: 43.0,
        current_max_a: 8.0,
        slew_max_a_per_s: 200.0,
        resistance_ohm: 5.0,
        inductance_h: 0.1,
        supply_v: 48.0,
    }
}

fn assert_near(actual: &[f64], expected: &[f64]) {
    assert_eq!(actual.len(), expected.len());
    for (actual, expected) in actual.iter().zip(expected) {
        // A few roundings of trigonometry and products.
        assert!(
            (actual - expected).abs() <= 1e-14 * expected.abs().max(1.0),
            "{actual} instead of {expected}"
        );
    }
}

#[test]
fn units_of_people_become_si_and_radians() {
    let built = sound().build().expect("sound");
    assert_eq!(built.rig, "bench-1");
    assert_near(&built.workspace.center, &[1e-3, 2e-3, 3e-3]);
    assert_near(&[built.workspace.radius], &[0.055]);
    let frame = &built.frames[0];
    assert_near(&[frame.angle_min, frame.angle_max, frame.speed_max], &[-PI, PI, PI / 4.0]);
    assert_near(&frame.axis, &[0.0, 0.0, 1.0]);
    let coil = &built.coils[0];
    assert_near(&[coil.valid_from_x, coil.current_max, coil.slew_max], &[0.043, 8.0, 200.0]);
    assert_near(&[coil.resistance, coil.inductance, coil.supply_voltage], &[5.0, 0.1, 48.0]);
    assert_eq!((coil.frame, built.coils[1].frame), (Some(0), None));
    assert_near(&built.manipulator.base_position, &[-0.055, 0.0, 0.0]);
}

#[test]
fn coil_axis_points_from_its_face_to_the_workspace_centre() {
    let built = sound().build().expect("sound");
    for (coil, distance) in built.coils.iter().zip([0.1021, 0.0855]) {
        let axis = coil.rotation.map(|row| row[0]);
        let met = [0, 1, 2].map(|k| coil.position[k] + distance * axis[k]);
        assert_near(&met, &built.workspace.center);
    }
    // rotz(180) roty(-34.21) takes x to (-cos, 0, sin) of 34.21 degrees; roty(90) takes it to -z.
    let (sine, cosine) = 34.21_f64.to_radians().sin_cos();
    assert_near(&built.coils[0].rotation.map(|row| row[0]), &[-cosine, 0.0, sine]);
    assert_near(&built.coils[1].rotation.map(|row| row[0]), &[0.0, 0.0, -1.0]);
}

#[test]
fn sections_get_the_stiffness_and_mass_of_a_round_bar() {
    let built = sound().build().expect("sound");
    let sections: Vec<&SectionDescription> = built
        .manipulator
        .parts
        .iter()
        .filter_map(|part| match part {
            PartDescription::Section(section) => Some(section),
            PartDescription::Magnet(_) => None,
        })
        .collect();
    let radius = 1.5e-3_f64;
    let (young, shear) = (5.5e6, 5.5e6 / 2.9);
    let area = PI * radius * radius;
    let second_moment = PI * radius.powi(4) / 4.0;
    assert_near(&[sections[0].length, sections[0].radius], &[0.025, radius]);
    assert_near(&[sections[0].bending_stiffness / (young * second_moment)], &[1.0]);
    assert_near(&[sections[0].torsion_stiffness / (shear * 2.0 * second_moment)], &[1.0]);
    assert_near(&[sections[0].mass_per_length / (1040.0 * area)], &[1.0]);
    assert_eq!(sections[0].extensible, None);
    let stiffness = sections[1].extensible.expect("extensible");
    assert_near(&[stiffness.shear / (shear * area), stiffness.axial / (young * area)], &[1.0, 1.0]);
    let given = sections[2].extensible.expect("given");
    assert_near(&[given.shear, given.axial, sections[2].mass_per_length], &[3.0, 4.0, 0.005]);
    assert_eq!(sections[2].precurvature, [1.0, 2.0, 3.0]);
}

#[test]
fn magnets_get_the_mass_of_a_cylinder_and_keep_their_order() {
    let built = sound().build().expect("sound");
    let magnets: Vec<_> = built.magnets().collect();
    assert_eq!([magnets[0].name.as_str(), magnets[1].name.as_str()], ["m1", "m2"]);
    assert_near(&[magnets[0].mass], &[7500.0 * PI * 2e-3_f64.powi(2) * 5e-3]);
    assert_eq!(magnets[1].moment_body, [0.0, 0.0, -0.065]);
}

fn assert_rotation(rotation: &Rows3) {
    for (first, left) in rotation.iter().enumerate() {
        for (second, right) in rotation.iter().enumerate() {
            let product: f64 = left.iter().zip(right).map(|(a, b)| a * b).sum();
            let expected = if first == second { 1.0 } else { 0.0 };
            assert!((product - expected).abs() < 1e-12, "{rotation:?}");
        }
    }
    let [x, y, z] = rotation;
    let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    assert!(cross.iter().zip(z).all(|(a, b)| (a - b).abs() < 1e-12), "left-handed: {rotation:?}");
}

#[test]
fn clamp_is_a_rotation_that_takes_z_to_the_tangent_without_roll() {
    let directions = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.6, 0.0, -0.8],
        [0.0, 0.0, -1.0],
        [0.48, 0.64, 0.6],
    ];
    for tangent in directions {
        let rotation = shortest_rotation_from_z(tangent);
        assert_rotation(&rotation);
        assert_near(&rotation.map(|row| row[2]), &tangent);
        // The axis of the shortest rotation lies in the xy plane: R is symmetric there.
        assert!((rotation[0][1] - rotation[1][0]).abs() < 1e-12, "{tangent:?}: rolled");
    }
    let mut rolled = sound();
    rolled.manipulator.base_roll_deg = 90.0;
    let rotation = rolled.build().expect("sound").manipulator.base_rotation;
    assert_rotation(&rotation);
    // z to x, then a quarter turn about it: body x goes to world y.
    assert_near(&rotation.map(|row| row[0]), &[0.0, 1.0, 0.0]);
    assert_near(&rotation.map(|row| row[2]), &[1.0, 0.0, 0.0]);
}

#[test]
fn a_clamp_that_is_turned_is_built_as_it_was_turned() {
    for (tangent, roll) in [([0.6, 0.0, -0.8], 0.0), ([0.48, 0.64, 0.6], 75.0), ([-0.1, 0.2, -0.9], -160.0)] {
        let mut config = sound();
        config.manipulator.base_tangent = tangent;
        config.manipulator.base_roll_deg = roll;
        let rotation = config.build().expect("sound").manipulator.base_rotation;
        let mut other = sound();
        other.manipulator.set_base_rotation(&rotation);
        let built = other.build().expect("sound").manipulator.base_rotation;
        for (built, expected) in built.iter().zip(&rotation) {
            assert_near(built, expected);
        }
    }
}

#[test]
fn a_gain_scales_the_field_of_its_coil_alone() {
    let mut config = sound();
    config.coils[1].gain = Some(1.03);
    let (built, plain) = (config.build().expect("sound"), sound().build().expect("sound"));
    assert_eq!(built.coils[0], plain.coils[0]);
    for (gained, plain) in built.coils[1].coefficients.iter().zip(&plain.coils[1].coefficients) {
        assert_near(&[gained / plain], &[1.03]);
    }
}

type Spoil = fn(&mut HardwareConfig);

fn coil_type(config: &mut HardwareConfig) -> &mut CoilTypeConfig {
    config.coil_types.get_mut("iron").expect("there")
}

fn material(config: &mut HardwareConfig) -> &mut MaterialConfig {
    config.manipulator.materials.get_mut("rubber").expect("there")
}

fn section(config: &mut HardwareConfig) -> &mut SectionConfig {
    let PartConfig::Section(section) = &mut config.manipulator.parts[0] else { panic!("a section") };
    section
}

fn magnet(config: &mut HardwareConfig) -> &mut MagnetConfig {
    let PartConfig::Magnet(magnet) = &mut config.manipulator.parts[1] else { panic!("a magnet") };
    magnet
}

fn stiffness(config: &mut HardwareConfig) -> &mut StiffnessSectionConfig {
    let PartConfig::StiffnessSection(section) = &mut config.manipulator.parts[4] else { panic!("a section") };
    section
}

/// A wrong value each, and how its refusal begins.
fn mistakes() -> Vec<(Spoil, &'static str)> {
    vec![
        (|config| config.rig.name = "Big Mag".to_owned(), "rig.name = \"Big Mag\": must be 1 to 40"),
        (|config| config.rig.name.clear(), "rig.name = \"\": must be 1 to 40"),
        (
            |config| config.rig.workspace_diameter_mm = 0.0,
            "rig.workspace_diameter_mm = 0: must be from 1 to 10000",
        ),
        (|config| config.rig.workspace_center_mm[1] = f64::NAN, "rig.workspace_center_mm = [1.0, NaN, 3.0]"),
        (|config| config.rig.gravity_m_per_s2[0] = f64::INFINITY, "rig.gravity_m_per_s2 = [inf, 0.0, -9.81]"),
        (
            |config| config.frames[0].angle_min_deg = -400.0,
            "frames[0].angle_min_deg = -400: must be from -360",
        ),
        (
            |config| config.frames[0].angle_max_deg = -190.0,
            "frames[0].angle_max_deg = -190: must be from -180",
        ),
        (|config| config.frames[0].speed_max_deg_per_s = -1.0, "frames[0].speed_max_deg_per_s = -1: must be"),
        (
            |config| config.frames[0].axis = [0.0; 3],
            "frames[0].axis = [0.0, 0.0, 0.0]: must be a finite vector",
        ),
        (|config| config.frames[0].pivot_mm[2] = f64::NAN, "frames[0].pivot_mm = [0.0, 0.0, NaN]"),
        (
            |config| config.frames = vec![config.frames[0].clone(); 9],
            "frames = 9 entries: must be at most 8 entries",
        ),
        (
            |config| config.frames.push(config.frames[0].clone()),
            "frames = name \"bottom\" twice: must be given unique names",
        ),
        (
            |config| coil_type(config).coefficients_si.clear(),
            "coil_types.iron.coefficients_si = 0 coefficients",
        ),
        (
            |config| coil_type(config).coefficients_si = vec![1e-6; 11],
            "coil_types.iron.coefficients_si = 11 coefficients: must be 1 to 10",
        ),
        (
            |config| coil_type(config).coefficients_si[1] = f64::NAN,
            "coil_types.iron.coefficients_si = [2.844727076399366e-6, NaN]",
        ),
        (|config| coil_type(config).valid_from_x_mm = 0.0, "coil_types.iron.valid_from_x_mm = 0: must be"),
        (
            |config| coil_type(config).current_max_a = -4.0,
            "coil_types.iron.current_max_a = -4: must be from 0.001 to 1000",
        ),
        (
            |config| coil_type(config).slew_max_a_per_s = f64::NAN,
            "coil_types.iron.slew_max_a_per_s = NaN: must be",
        ),
        (|config| coil_type(config).resistance_ohm = 0.0, "coil_types.iron.resistance_ohm = 0: must be"),
        (|config| coil_type(config).inductance_h = 0.0, "coil_types.iron.inductance_h = 0: must be"),
        (|config| coil_type(config).supply_v = -48.0, "coil_types.iron.supply_v = -48: must be"),
        (
            |config| config.coils[1].distance_mm = Some(0.0),
            "coils[1].distance_mm = 0: must be from 1 to 10000",
        ),
        (
            |config| config.coils[1].distance_mm = None,
            "coils[1] = placed by azimuth_deg, elevation_deg: must be placed by azimuth_deg, elevation_deg and \
             distance_mm, or by position_mm and axis",
        ),
        (
            |config| config.coils[1].axis = Some([1.0, 0.0, 0.0]),
            "coils[1] = placed by azimuth_deg, elevation_deg, distance_mm, axis: must be placed by",
        ),
        (
            |config| freely(config, [1.0, 2.0, 3.0], [0.0; 3]),
            "coils[1].axis = [0.0, 0.0, 0.0]: must be a finite vector other than zero",
        ),
        (
            |config| freely(config, [1.0, 2.0, 3.0], [f64::NAN, 0.0, 1.0]),
            "coils[1].axis = [NaN, 0.0, 1.0]: must be a finite vector other than zero",
        ),
        (
            |config| freely(config, [f64::INFINITY, 2.0, 3.0], [0.0, 0.0, 1.0]),
            "coils[1].position_mm = [inf, 2.0, 3.0]",
        ),
        (|config| config.coils[1].gain = Some(-1.0), "coils[1].gain = -1: must be from 0.01 to 100"),
        (
            |config| config.coils[0].azimuth_deg = Some(361.0),
            "coils[0].azimuth_deg = 361: must be from -360 to 360",
        ),
        (
            |config| config.coils[0].elevation_deg = Some(91.0),
            "coils[0].elevation_deg = 91: must be from -90 to 90",
        ),
        (
            |config| config.coils[0].frame = Some("top".to_owned()),
            "coils[0].frame = top: must be the name of a frame (bottom)",
        ),
        (
            |config| config.coils[0].coil_type = "air".to_owned(),
            "coils[0].type = air: must be the name of a coil type (iron)",
        ),
        (|config| config.coils[1].name = "0".to_owned(), "coils = name \"0\" twice"),
        (
            |config| config.coils = vec![config.coils[0].clone(); 33],
            "coils = 33 entries: must be at most 32 entries",
        ),
        (|config| config.manipulator.base_tangent = [0.0; 3], "manipulator.base_tangent = [0.0, 0.0, 0.0]"),
        (|config| config.manipulator.base_roll_deg = f64::NAN, "manipulator.base_roll_deg = NaN"),
        (|config| config.manipulator.base_position_mm[0] = f64::NAN, "manipulator.base_position_mm = [NaN"),
        (
            |config| material(config).young_modulus_mpa = 0.0,
            "manipulator.materials.rubber.young_modulus_mpa = 0",
        ),
        (
            |config| material(config).poisson_ratio = 0.6,
            "manipulator.materials.rubber.poisson_ratio = 0.6: must be",
        ),
        (
            |config| material(config).density_kg_per_m3 = -1.0,
            "manipulator.materials.rubber.density_kg_per_m3 = -1",
        ),
        (
            |config| section(config).material = "steel".to_owned(),
            "manipulator.parts[0].section.material = steel: must be the name of a material (rubber)",
        ),
        (|config| section(config).length_mm = -25.0, "manipulator.parts[0].section.length_mm = -25: must be"),
        (|config| section(config).diameter_mm = 0.0, "manipulator.parts[0].section.diameter_mm = 0: must be"),
        (
            |config| section(config).precurvature_per_m = Some([f64::NAN; 3]),
            "manipulator.parts[0].section.precurvature_per_m = [NaN, NaN, NaN]",
        ),
        (|config| magnet(config).length_mm = 0.0, "manipulator.parts[1].magnet.length_mm = 0: must be"),
        (
            |config| magnet(config).density_kg_per_m3 = f64::NAN,
            "manipulator.parts[1].magnet.density_kg_per_m3 = NaN",
        ),
        (
            |config| magnet(config).moment_body_a_m2[0] = f64::INFINITY,
            "manipulator.parts[1].magnet.moment_body_a_m2 = [inf, 0.0, 0.065]",
        ),
        (|config| magnet(config).name = "m2".to_owned(), "manipulator.parts = name \"m2\" twice"),
        (
            |config| stiffness(config).bending_n_m2 = 0.0,
            "manipulator.parts[4].stiffness_section.bending_n_m2 = 0: must be from 0.00000000000001 to 100",
        ),
        (
            |config| stiffness(config).axial_n = None,
            "manipulator.parts[4].stiffness_section = one of shear_n and axial_n: must be given both",
        ),
        (
            |config| stiffness(config).shear_n = Some(-1.0),
            "manipulator.parts[4].stiffness_section.shear_n = -1: must be from 0.000001 to 1000000000",
        ),
        (
            |config| config.manipulator.parts.retain(|part| matches!(part, PartConfig::Magnet(_))),
            "manipulator.parts = no section: must be at least one flexible section",
        ),
        (
            |config| {
                let magnets = (0..9).map(|index| {
                    let mut part = config.manipulator.parts[1].clone();
                    if let PartConfig::Magnet(magnet) = &mut part {
                        magnet.name = format!("n{index}");
                    }
                    part
                });
                let magnets: Vec<PartConfig> = magnets.collect();
                config.manipulator.parts.splice(1..4, magnets);
            },
            "manipulator.parts = 9 magnets: must be at most 8 magnets",
        ),
    ]
}

#[test]
fn every_mistake_is_refused_by_key_value_and_what_would_be_right() {
    for (spoil, expected) in mistakes() {
        let mut config = sound();
        spoil(&mut config);
        let found = config.build().expect_err(expected);
        let texts: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert!(texts.iter().any(|text| text.starts_with(expected)), "{texts:?}: expected {expected}");
    }
}

#[test]
fn values_in_another_unit_are_refused_with_the_number_that_was_meant() {
    let slips: [(Spoil, &str); 9] = [
        (
            |config| config.rig.workspace_diameter_mm = 0.11,
            "0.11: must be from 1 to 10000, in mm: 0.11 m would be 110",
        ),
        (
            |config| config.rig.gravity_m_per_s2 = [0.0, 0.0, -9810.0],
            "at most 100 in length, in m/s^2: 9810 mm/s^2 would be 9.81",
        ),
        (|config| coil_type(config).current_max_a = 8000.0, "from 0.001 to 1000, in A: 8000 mA would be 8"),
        (|config| coil_type(config).slew_max_a_per_s = 0.3, "1000000, in A/s: 0.3 A/ms would be 300"),
        (|config| coil_type(config).coefficients_si[0] *= 1e3, "at most 0.0003 T m^3/A in front"),
        (|config| coil_type(config).inductance_h = 100.0, "in H: 100 mH would be 0.1"),
        (|config| material(config).young_modulus_mpa = 4.8e6, "in MPa: 4800000 Pa would be 4.8"),
        (
            |config| magnet(config).density_kg_per_m3 = 7.5,
            "0, or from 10 to 30000, in kg/m^3: 7.5 g/cm^3 would be 7500",
        ),
        (|config| magnet(config).length_mm = 0.005, "in mm: 0.005 m would be 5"),
    ];
    for (slip, expected) in slips {
        let mut config = sound();
        slip(&mut config);
        let found = config.build().expect_err(expected);
        let texts: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert!(matches!(&texts[..], [text] if text.contains(expected)), "{texts:?}: {expected}");
    }
}

#[test]
fn all_mistakes_are_reported_at_once() {
    let mut config = sound();
    config.rig.workspace_diameter_mm = -1.0;
    config.coils[0].distance_mm = Some(0.0);
    section(&mut config).length_mm = 0.0;
    let keys: Vec<String> =
        config.build().expect_err("three").into_iter().map(|invalid| invalid.key).collect();
    assert_eq!(
        keys,
        ["rig.workspace_diameter_mm", "coils[0].distance_mm", "manipulator.parts[0].section.length_mm"]
    );
}

/// Places the second coil by its position and axis.
fn freely(config: &mut HardwareConfig, position_mm: [f64; 3], axis: [f64; 3]) {
    let coil = &mut config.coils[1];
    (coil.azimuth_deg, coil.elevation_deg, coil.distance_mm) = (None, None, None);
    (coil.position_mm, coil.axis) = (Some(position_mm), Some(axis));
}

/// Goal: a coil aimed at the centre and one placed where it is and along its axis are the same coil, rotation
/// about the axis too, since errors of the plant's coils are given in their own axes.
#[test]
fn both_ways_to_place_a_coil_give_the_same_coil() {
    for (azimuth_deg, elevation_deg) in
        [(0.0, 0.0), (180.0, -34.21), (-75.0, 33.0), (0.0, 90.0), (0.0, -90.0), (300.0, 89.0)]
    {
        let mut config = sound();
        config.coils[1].azimuth_deg = Some(azimuth_deg);
        config.coils[1].elevation_deg = Some(elevation_deg);
        let aimed = config.build().expect("sound").coils.remove(1);
        let axis = aimed.rotation.map(|row| 2.5 * row[0]);
        freely(&mut config, aimed.position.map(|value| value * 1e3), axis);
        let free = config.build().expect("sound").coils.remove(1);
        for row in 0..3 {
            assert!((free.position[row] - aimed.position[row]).abs() < 1e-15, "{free:?}");
            for column in 0..3 {
                // A cosine of 90 degrees is 6e-17, which turns the azimuth of a vertical axis by nothing here.
                let difference = free.rotation[row][column] - aimed.rotation[row][column];
                assert!(difference.abs() < 1e-15, "{azimuth_deg}, {elevation_deg}: {free:?}");
            }
        }
        assert_eq!(free.frame, aimed.frame);
    }
}

#[test]
fn rig_without_coils_frames_or_magnets_is_sound() {
    let mut config = sound();
    config.frames.clear();
    config.coils.clear();
    config.coil_types.clear();
    config.manipulator.parts.truncate(1);
    let built = config.build().expect("a rod alone");
    assert_eq!(built.magnets().count(), 0);
}
