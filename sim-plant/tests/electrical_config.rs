//! The `[plant]` tables of coils, amplifiers, motors and the driver: what is refused, by which key.

#[path = "../src/fixture.rs"]
mod fixture;

use magsteer_sim_plant::PlantConfig;
use serde_json::{Value, json};

/// Keys refused after setting one value of a table of the fixture.
fn refused(pointer: &str, value: Value) -> Vec<(String, String)> {
    let mut tables = fixture::plant_tables();
    let (table, key) = pointer.rsplit_once('/').expect("a table and a key");
    tables.pointer_mut(table).expect("a table of the fixture")[key] = value;
    let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
    match config.build(&fixture::bigmag()) {
        Ok(_) => Vec::new(),
        Err(refused) => refused.into_iter().map(|invalid| (invalid.key, invalid.expected)).collect(),
    }
}

#[test]
fn values_out_of_range_are_refused_by_their_keys() {
    let cases = [
        ("/amplifier/bandwidth_hz", json!(-1.0)),
        ("/amplifier/current_gain_relative", json!(0.2)),
        ("/amplifier/current_offset_a", json!(-0.01)),
        ("/amplifier/current_noise_a", json!(2.0)),
        ("/amplifier/current_step_a", json!(-0.001)),
        ("/winding/ambient_celsius", json!(70.0)),
        ("/winding/reference_celsius", json!(-10.0)),
        ("/winding/resistance_coefficient_per_k", json!(0.02)),
        ("/winding/thermal_resistance_k_per_w", json!(0.0)),
        ("/winding/heat_capacity_j_per_k", json!(0.0)),
        ("/motor/acceleration_max_deg_per_s2", json!(0.0)),
        ("/motor/backlash_deg", json!(-0.1)),
        ("/motor/encoder_step_deg", json!(11.0)),
        ("/motor/start_deg", json!({ "bottom": 181.0 })),
        ("/motor/start_deg", json!({ "middle": 10.0 })),
        // A ramp at 300 A/s lags by 0.39 A at 200 Hz and 500 us.
        ("/driver/follow_error_max_a", json!(0.38)),
        ("/driver/idle_current_max_a", json!(0.0)),
        ("/driver/follow_error_time_ms", json!(0.5)),
        // 45 deg/s turned back at 200 deg/s^2 lag by 15.2 deg.
        ("/driver/frame_error_max_deg", json!(15.0)),
        ("/driver/frame_error_time_ms", json!(20_000.0)),
        ("/driver/temperature_max_celsius", json!(89.0)),
        ("/driver/temperature_release_celsius", json!(19.0)),
    ];
    for (pointer, value) in cases {
        let expected = format!("plant{}", pointer.replace('/', "."));
        let keys = refused(pointer, value.clone());
        // The entry of a table of names is named as well.
        assert!(
            keys.iter().any(|(key, _)| key.starts_with(&expected)),
            "{pointer} = {value}: refused {keys:?}"
        );
    }
    for (pointer, value) in [
        ("/driver/follow_error_max_a", json!(0.4)),
        ("/driver/frame_error_max_deg", json!(15.3)),
        ("/amplifier/current_noise_a", json!(0.01)),
    ] {
        assert_eq!(refused(pointer, value), []);
    }
    // Five deviations of the noise come near what counts as a current that nobody asked for.
    assert_eq!(refused("/amplifier/current_noise_a", json!(0.03))[0].0, "plant.driver.idle_current_max_a");
}

#[test]
fn couplings_that_make_no_sense_or_are_too_strong_are_refused_by_their_pair() {
    let pair =
        |one: &str, other: &str, coefficient: f64| json!({"coils": [one, other], "coefficient": coefficient});
    let weak = pair("air-bottom", "air-top", -0.1);
    assert_eq!(refused("/coupling", json!([weak])), []);
    let cases = [
        (
            json!([weak, pair("air-bottom", "nowhere", 0.1)]),
            "plant.coupling[1].coils",
            "names of two different coils",
        ),
        (json!([pair("air-top", "air-top", 0.1)]), "plant.coupling[0].coils", "names of two different coils"),
        (
            json!([weak, pair("air-top", "air-bottom", 0.1)]),
            "plant.coupling[1].coils",
            "no other entry names",
        ),
        (json!([pair("air-top", "air-bottom", 1.5)]), "plant.coupling[0].coefficient", "from -1 to 1"),
        (
            json!([weak, pair("air-top", "iron-top-left", 0.3)]),
            "plant.coupling[1].coefficient",
            "air-top and iron-top-left",
        ),
    ];
    for (pairs, key, expected) in cases {
        let found = refused("/coupling", pairs.clone());
        assert!(found.len() == 1 && found[0].0 == key && found[0].1.contains(expected), "{pairs}: {found:?}");
    }
}

#[test]
fn every_key_must_be_given() {
    for (table, key) in [
        ("/amplifier", "current_noise_a"),
        ("/winding", "heat_capacity_j_per_k"),
        ("/motor", "backlash_deg"),
        ("/driver", "idle_current_max_a"),
        ("", "coupling"),
    ] {
        let mut tables = fixture::plant_tables();
        let found =
            tables.pointer_mut(table).and_then(Value::as_object_mut).and_then(|table| table.remove(key));
        assert!(found.is_some());
        assert!(serde_json::from_value::<PlantConfig>(tables).is_err(), "{table}/{key}");
    }
}
