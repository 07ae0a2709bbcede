//! Descriptions that tests share: BigMag with its manipulator, and plain cantilevers.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]

use magsteer_hal::config::HardwareConfig;
use magsteer_hal::description::{
    ExtensibleStiffness, HardwareDescription, ManipulatorDescription, PartDescription, SectionDescription,
    Workspace,
};
use serde_json::{Value, json};

/// BigMag with its six coils and two antiparallel magnets, as `config/bigmag-planar.toml` has it.
pub fn bigmag_config() -> HardwareConfig {
    let coil_type = |coefficients: [f64; 4]| {
        json!({
            "coefficients_si": coefficients, "valid_from_x_mm": 43.0, "current_max_a": 8.0,
            "slew_max_a_per_s": 300.0, "resistance_ohm": 5.0, "inductance_h": 0.1, "supply_v": 48.0
        })
    };
    let coil = |name: &str, kind: &str, azimuth: f64, elevation: f64, distance: f64, frame: &str| {
        json!({
            "name": name, "type": kind, "azimuth_deg": azimuth, "elevation_deg": elevation,
            "distance_mm": distance, "frame": frame
        })
    };
    let frame = |name: &str| {
        json!({
            "name": name, "axis": [0.0, 0.0, 1.0], "pivot_mm": [0.0, 0.0, 0.0],
            "angle_min_deg": -180.0, "angle_max_deg": 180.0, "speed_max_deg_per_s": 45.0
        })
    };
    let section = json!({"section": {
        "material": "pmc770", "length_mm": 25.0, "diameter_mm": 3.0, "extensible": false,
        "precurvature_per_m": null
    }});
    let magnet = |name: &str, moment: f64| {
        json!({"magnet": {
            "name": name, "length_mm": 5.0, "diameter_mm": 4.0, "density_kg_per_m3": 7500.0,
            "moment_body_a_m2": [0.0, 0.0, moment]
        }})
    };
    let value: Value = json!({
        "rig": {
            "name": "bigmag-test", "workspace_center_mm": [0.0, 0.0, 0.0],
            "workspace_diameter_mm": 110.0, "gravity_m_per_s2": [0.0, 0.0, -9.81]
        },
        "frames": [frame("bottom"), frame("top")],
        "coil_types": {
            "air": coil_type([6.422646756191375e-7, 1.870831551827e-8, 1.746090239903e-10, 5.183775351973e-13]),
            "iron": coil_type([2.844727076399366e-6, 7.487269451547e-8, 7.366089357684e-10, 2.443226526864e-12])
        },
        "coils": [
            coil("iron-bottom-right", "iron", 180.0, -34.21, 102.1, "bottom"),
            coil("iron-bottom-left", "iron", 0.0, -33.22, 103.3, "bottom"),
            coil("iron-top-right", "iron", 180.0, 33.0, 101.0, "top"),
            coil("iron-top-left", "iron", 0.0, 33.14, 103.0, "top"),
            coil("air-bottom", "air", 0.0, -90.0, 85.5, "bottom"),
            coil("air-top", "air", 0.0, 90.0, 85.5, "top")
        ],
        "manipulator": {
            "base_position_mm": [-55.0, 0.0, 0.0], "base_tangent": [1.0, 0.0, 0.0], "base_roll_deg": 0.0,
            "materials": {"pmc770": {
                "young_modulus_mpa": 5.5, "poisson_ratio": 0.45, "density_kg_per_m3": 1040.0
            }},
            "parts": [section, magnet("m1", 0.065), section, magnet("m2", -0.065)]
        }
    });
    serde_json::from_value(value).expect("the fixture is a hardware configuration")
}

/// The `[plant]` tables with which the shipped rigs run, without parameter errors: coils share no flux and keep
/// their resistance, currents and angles are measured as they are, and gears have no play.
pub fn plant_tables() -> Value {
    json!({
        "seed": 1, "step_us": 500, "sensor": "tracker",
        "rod": {
            "element_length_max_mm": 2.5, "first_mode_damping_ratio": 0.2, "magnet_interaction": true,
            "contact": "none"
        },
        "amplifier": {
            "bandwidth_hz": 200.0, "current_gain_relative": 0.0, "current_offset_a": 0.0,
            "current_noise_a": 0.0, "current_step_a": 0.0
        },
        "winding": {
            "ambient_celsius": 20.0, "reference_celsius": 20.0, "resistance_coefficient_per_k": 0.0,
            "thermal_resistance_k_per_w": 0.5, "heat_capacity_j_per_k": 800.0
        },
        "coupling": [],
        "motor": {"acceleration_max_deg_per_s2": 200.0, "backlash_deg": 0.0, "encoder_step_deg": 0.0},
        "driver": {
            "follow_error_max_a": 1.0, "idle_current_max_a": 0.1, "follow_error_time_ms": 100.0,
            "frame_error_max_deg": 20.0, "frame_error_time_ms": 500.0,
            "temperature_max_celsius": 110.0, "temperature_release_celsius": 90.0
        },
        "field": {
            "air": {"winding": {
                "inner_radius_mm": 45.0, "outer_radius_mm": 63.0, "length_mm": 43.0, "turns": 642.0
            }},
            "iron": {"core": {"saturation_knee_a": 12.5}}
        },
        "errors": {
            "modulus_relative": 0.0, "moment_relative": 0.0, "coil_gain_relative": 0.0,
            "coil_axis_deg": 0.0, "coil_position_mm": 0.0
        },
        "sensors": {
            "tracker": {"poses": {
                "rate_hz": 200.0, "latency_ms": 5.0, "orientation_noise_deg": 0.2,
                "position_noise_mm": 0.1, "dropout_probability": 0.0
            }},
            "camera": {"point_cloud": {
                "rate_hz": 30.0, "latency_ms": 60.0, "dropout_probability": 0.0,
                "viewers_mm": [[-50.0, -300.0, 100.0], [50.0, -300.0, 100.0]], "points": 2000,
                "noise_across_mm": 0.3, "noise_depth_mm": 0.3,
                "outlier_share": 0.1, "outlier_margin_mm": 10.0,
                "occlusion": {"random": {"share": 0.2}}, "centreline": {"curvature": {"degree": 2}},
                "tangent_deviation_max_deg": 1.25
            }},
            "fibre": {"curvature": {
                "rate_hz": 1000.0, "latency_ms": 2.0, "dropout_probability": 0.0, "stations": 100,
                "noise_per_m": 0.5, "offset_per_m": 0.3, "measures_twist": true
            }}
        },
        "real_time": {"wake_us": 1000, "catch_up_max_ms": 50, "truth_period_ms": 5, "priority": 0}
    })
}

/// [`bigmag_config`], built.
pub fn bigmag() -> HardwareDescription {
    bigmag_config().build().expect("the fixture is valid")
}

/// A plain cantilever along +z from the origin, without coils, magnets or gravity.
pub fn cantilever(section: SectionDescription) -> HardwareDescription {
    HardwareDescription {
        rig: "cantilever".to_owned(),
        workspace: Workspace { center: [0.0; 3], radius: 10.0 },
        gravity: [0.0; 3],
        frames: Vec::new(),
        coil_types: vec!["air".to_owned(), "iron".to_owned()],
        coils: Vec::new(),
        manipulator: ManipulatorDescription {
            base_position: [0.0; 3],
            base_rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            parts: vec![PartDescription::Section(section)],
        },
    }
}

/// A round rubber section, 60 mm long and 3 mm thick, inextensible.
pub fn rubber() -> SectionDescription {
    let (radius, young, poisson, density): (f64, f64, f64, f64) = (1.5e-3, 5.5e6, 0.45, 1040.0);
    let area = std::f64::consts::PI * radius.powi(2);
    let second_moment = area * radius.powi(2) / 4.0;
    SectionDescription {
        length: 0.06,
        radius,
        bending_stiffness: young * second_moment,
        torsion_stiffness: young / (1.0 + poisson) * second_moment,
        extensible: None,
        mass_per_length: density * area,
        precurvature: [0.0; 3],
    }
}

/// Axial and shear stiffness of [`rubber`].
pub fn rubber_stretch() -> ExtensibleStiffness {
    let area = std::f64::consts::PI * 1.5e-3_f64.powi(2);
    ExtensibleStiffness { shear: 5.5e6 / 2.9 * area, axial: 5.5e6 * area }
}
