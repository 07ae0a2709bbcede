//! What coils are in truth, as the configuration says it: refusals, and that the plant obeys.

#[path = "../src/fixture.rs"]
mod fixture;

use magsteer_hal::Actuation;
use magsteer_hal::invalid::Invalid;
use magsteer_sim_plant::{Plant, PlantConfig};
use nalgebra::Vector3;
use serde_json::{Value, json};

/// The fixture's tables with another `[plant.field]`.
fn config(field: Value) -> PlantConfig {
    let mut tables = fixture::plant_tables();
    tables["field"] = field;
    serde_json::from_value(tables).expect("a configuration")
}

fn winding(key: &str, value: Value) -> Value {
    let mut winding = fixture::plant_tables()["field"]["air"]["winding"].clone();
    winding[key] = value;
    json!({"winding": winding})
}

/// The description's series, exactly.
const SERIES: &str = "multipole";

fn refused(field: Value) -> Vec<Invalid> {
    config(field).build(&fixture::bigmag()).err().unwrap_or_default()
}

#[test]
fn a_coil_without_a_truth_and_a_truth_without_a_type_are_refused_by_name() {
    let missing = refused(json!({"iron": SERIES}));
    assert_eq!(missing.len(), 1);
    assert_eq!(missing[0].key, "plant.field.air");
    assert!(missing[0].expected.contains("`core` and `winding`"), "{}", missing[0]);
    let unknown = refused(json!({"air": SERIES, "iron": SERIES, "irno": SERIES}));
    assert_eq!(unknown.len(), 1);
    assert_eq!(unknown[0].key, "plant.field.irno");
    assert!(unknown[0].expected.contains("air, iron"), "{}", unknown[0]);
}

#[test]
fn a_type_without_coils_may_have_a_truth_or_none() {
    let mut description = fixture::bigmag();
    description.coils.truncate(4);
    for field in [json!({"air": SERIES, "iron": SERIES}), json!({"iron": SERIES})] {
        assert!(config(field).build(&description).is_ok());
    }
}

#[test]
fn values_out_of_range_are_refused_at_their_keys() {
    for (key, value) in [
        ("inner_radius_mm", json!(0.0)),
        ("outer_radius_mm", json!(45.0)),
        ("length_mm", json!(-1.0)),
        ("turns", json!(0.0)),
    ] {
        let keys: Vec<String> = refused(json!({"air": winding(key, value), "iron": SERIES}))
            .into_iter()
            .map(|invalid| invalid.key)
            .collect();
        assert_eq!(keys, [format!("plant.field.air.winding.{key}")]);
    }
    let knee = json!({"core": {"saturation_knee_a": 0.0}});
    let keys = refused(json!({"air": SERIES, "iron": knee}));
    assert_eq!(keys[0].key, "plant.field.iron.core.saturation_knee_a");
}

#[test]
fn nothing_is_filled_in() {
    for field in [
        json!({"air": {}}),
        json!({"air": {"core": {}}}),
        json!({"air": {"winding": {"turns": 100.0}}}),
        json!({"air": winding("wire_mm", json!(1.0))}),
        json!({"air": "winding"}),
        json!({"air": {"series": {}}}),
    ] {
        let mut tables = fixture::plant_tables();
        tables["field"] = field.clone();
        assert!(serde_json::from_value::<PlantConfig>(tables).is_err(), "{field}");
    }
}

/// Where the tip rests with currents in one iron coil and one air coil.
fn tip(field: Value) -> Vector3<f64> {
    let mut plant: Plant = config(field).build(&fixture::bigmag()).expect("valid");
    let mut actuation = Actuation::default();
    (actuation.current_a[0], actuation.current_a[4]) = (1.0, -2.0);
    for share in [0.25, 0.5, 0.75, 1.0] {
        let mut part = actuation;
        part.current_a.iter_mut().for_each(|current| *current *= share);
        assert!(plant.settle_at(&part));
    }
    plant.tip().position
}

#[test]
fn the_plant_moves_otherwise_with_another_truth() {
    let knee = |knee: f64| json!({"core": {"saturation_knee_a": knee}});
    let series = tip(json!({"air": SERIES, "iron": SERIES}));
    let far_knee = tip(json!({"air": SERIES, "iron": knee(1e4)}));
    let saturated = tip(json!({"air": SERIES, "iron": knee(1.0)}));
    let wound = tip(json!({"air": winding("turns", json!(642.0)), "iron": SERIES}));
    let doubled = tip(json!({"air": winding("turns", json!(1284.0)), "iron": SERIES}));
    let moved = |other: Vector3<f64>| (other - series).norm() * 1e3;
    // mm. The winding is the series' own within two per cent; twice its turns are not.
    assert!(moved(far_knee) < 1e-6, "{}", moved(far_knee));
    assert!(moved(saturated) > 0.1, "{}", moved(saturated));
    assert!((1e-4..0.2).contains(&moved(wound)), "{}", moved(wound));
    assert!(moved(doubled) > 5.0 * moved(wound), "{}", moved(doubled));
}
