//! The rod against a plane and in a tube.

#[path = "../src/fixture.rs"]
mod fixture;
mod validation;

use magsteer_hal::description::SectionDescription;
use magsteer_sim_plant::PlantConfig;
use magsteer_sim_plant::field::{CoilArray, Field};
use magsteer_sim_plant::rod::{Contact, Meshing, Rod, Stepping, Surface, Wall};
use nalgebra::Vector3;
use serde_json::{Value, json};
use validation::Row;

const STEP: f64 = 5e-4;
const MESHING: Meshing = Meshing { element_length_max: 2.5e-3 };

/// Soft tissue: 100 kPa, setting in over 0.05 mm.
const SURFACE: Surface =
    Surface { stiffness: 1e5, rounding: 5e-5, damping: 0.0, friction: 0.0, creep_speed: 1e-3 };

fn no_field(_: &Vector3<f64>) -> Field {
    Field::zero()
}

/// The shipped rod with the shipped damping, at rest about a wall.
fn shipped(contact: Contact, damping_ratio: f64) -> Rod {
    let description = fixture::bigmag();
    let undamped = Stepping { step: STEP, retardation: 0.0 };
    let mut rod = Rod::new(&description.manipulator, description.gravity, MESHING, undamped);
    rod.set_magnet_interaction(true);
    assert!(rod.settle(no_field));
    let mode = rod.first_mode().expect("has mass");
    rod.set_stepping(Stepping { step: STEP, retardation: mode.retardation(damping_ratio) });
    rod.set_contact(Some(contact));
    assert!(rod.settle(no_field));
    rod
}

/// A floor 10 mm below the clamp, above where the rod's tip hangs without it.
fn floor(surface: Surface) -> Contact {
    Contact { wall: Wall::Plane { point: Vector3::z() * -10e-3, normal: Vector3::z() }, surface }
}

/// A tube of 4 mm radius that bends down from the clamp as the rod does, and then to the side.
fn vessel(surface: Surface) -> Contact {
    let points = [[-55.0, 0.0, 0.0], [-35.0, 0.0, -2.0], [-15.0, 4.0, -7.0], [5.0, 12.0, -14.0]];
    let points = points.map(|point| Vector3::from(point) * 1e-3).to_vec();
    Contact { wall: Wall::Tube { points, radius: 4e-3 }, surface }
}

/// Drives the rod by all coils for some seconds; returns the greatest depth, m, and the greatest force of the
/// wall, N.
fn drive(rod: &mut Rod, amplitude: f64, seconds: f64) -> (f64, f64) {
    let mut array = CoilArray::as_described(&fixture::bigmag());
    let (mut deepest, mut strongest): (f64, f64) = (0.0, 0.0);
    for index in 0..(seconds / STEP) as u32 {
        let time = f64::from(index) * STEP;
        let currents: Vec<f64> =
            (0..6).map(|coil| amplitude * (time * (3.0 + f64::from(coil))).sin()).collect();
        array.actuate(&currents, &[0.8, -0.8]);
        assert!(rod.step(|point| array.at(point)).converged, "at {time} s");
        let touch = rod.touch().expect("has a wall");
        deepest = deepest.max(touch.depth_max);
        strongest = strongest.max(touch.force.norm());
    }
    (deepest, strongest)
}

#[test]
fn rod_lying_on_a_floor_is_borne_by_its_weight() {
    // So high that the floor bears it straight, at the depth where (vii) gives its weight.
    let section = SectionDescription { bending_stiffness: 2e-7, ..fixture::rubber() };
    let weight = section.mass_per_length * 9.81;
    let depth = (2.0 * SURFACE.rounding * weight / SURFACE.stiffness).sqrt();
    let mut description = fixture::cantilever(section.clone()).manipulator;
    description.base_rotation = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    let undamped = Stepping { step: STEP, retardation: 0.0 };
    let mut rod = Rod::new(&description, [0.0, 0.0, -9.81], MESHING, undamped);
    let point = Vector3::z() * -(section.radius - depth);
    rod.set_contact(Some(Contact { wall: Wall::Plane { point, normal: Vector3::z() }, surface: SURFACE }));
    assert!(rod.settle(no_field));
    let touch = rod.touch().expect("has a wall");
    let borne = rod.moving_mass() * 9.81;
    let rows = [
        Row::new(
            "force of a floor over the weight lying on it, beyond 1",
            touch.force.z / borne - 1.0,
            1e-4,
            "",
        ),
        // The last half element's mass counts a sixth of an element further in than the floor's force on the
        // tip.
        Row::new("greatest depth over that of the law, beyond 1", touch.depth_max / depth - 1.0, 0.02, ""),
    ];
    assert!(touch.force.xy().norm() < 1e-12 * borne);
    validation::hold("rod.md", "contact at rest", &rows);
}

#[test]
fn driven_rod_sinks_no_deeper_than_stated_and_every_step_is_solved() {
    let mut rows = Vec::new();
    for (what, contact) in [("floor", floor(SURFACE)), ("tube", vessel(SURFACE))] {
        for (friction, damping) in [(0.0, 0.0), (0.3, 20.0)] {
            let mut contact = contact.clone();
            contact.surface.friction = friction;
            contact.surface.damping = damping;
            let mut rod = shipped(contact, 0.2);
            let start = rod.energy().total();
            let (deepest, strongest) = drive(&mut rod, 1.5, 4.0);
            // Were all the force on one end of a rubber section, which stands for half an element.
            let bound = strongest / (SURFACE.stiffness * 1.25e-3) + SURFACE.rounding / 2.0;
            assert!(deepest < bound, "{deepest} m under {strongest} N");
            let ledger = rod.ledger();
            let missing = (ledger.coils - ledger.lost() - (rod.energy().total() - start)) / ledger.coils;
            let name = format!("{what}, friction {friction}, damping {damping} s/m");
            println!("{name}: {ledger:?}");
            println!("{strongest} N");
            rows.push(Row::new(format!("{name}: depth"), deepest * 1e3, 0.5, "mm"));
            rows.push(Row::new(format!("{name}: energy missing"), 100.0 * missing, 0.1, "%"));
            assert!((ledger.friction > 0.0) == (friction > 0.0) && (ledger.contact > 0.0) == (damping > 0.0));
        }
    }
    validation::hold("rod.md", "contact", &rows);
}

#[test]
fn energy_never_grows_against_a_wall() {
    for (friction, damping) in [(0.0, 0.0), (0.3, 0.0), (0.3, 20.0)] {
        for contact in [floor(SURFACE), vessel(SURFACE)] {
            let mut contact = contact;
            contact.surface.friction = friction;
            contact.surface.damping = damping;
            let mut rod = shipped(contact, 0.02);
            let rest = rod.energy().total();
            rod.strike(Vector3::new(0.0, 0.2, 0.4));
            let swing = rod.energy().total() - rest;
            let mut last = rod.energy().total();
            let mut touched = 0;
            for _ in 0..2000 {
                assert!(rod.step(no_field).converged);
                let now = rod.energy().total();
                // The solver leaves corrections under 1e-11 m out.
                assert!(now - last < 1e-8 * swing, "{friction}, {damping}: grew by {}", (now - last) / swing);
                last = now;
                touched += u32::from(rod.touch().is_some_and(|touch| touch.depth_max > 0.0));
            }
            assert!(touched > 100, "the rod must touch: {touched}");
        }
    }
}

#[test]
fn friction_is_coulombs_while_the_rod_slides() {
    let surface = Surface { friction: 0.3, ..SURFACE };
    let mut rod = shipped(floor(surface), 0.2);
    rod.strike(Vector3::new(0.0, 0.1, 0.0));
    for _ in 0..20 {
        assert!(rod.step(no_field).converged);
        let force = rod.touch().expect("has a wall").force;
        let share = force.xy().norm() / force.z;
        assert!(share <= 0.3 + 1e-12, "{share}");
        assert!(share > 0.29 && force.y < 0.0, "it slides with 0.1 m/s: {force}");
    }
}

/// Keys that a build of the fixture with a wall refuses.
fn refused(contact: Value) -> Vec<String> {
    let mut tables = fixture::plant_tables();
    tables["rod"]["contact"] = contact;
    let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
    match config.build(&fixture::bigmag()) {
        Ok(_) => Vec::new(),
        Err(invalid) => invalid.into_iter().map(|invalid| invalid.key).collect(),
    }
}

fn surface() -> Value {
    json!({
        "stiffness_kpa": 100.0, "rounding_mm": 0.05, "damping_s_per_m": 0.0,
        "friction_coefficient": 0.2, "creep_speed_mm_per_s": 1.0
    })
}

#[test]
fn walls_out_of_range_are_refused_by_their_keys() {
    let plane = |point: [f64; 3], normal: [f64; 3]| json!({"plane": {"point_mm": point, "normal": normal, "surface": surface()}});
    let tube = |points: Value, radius: f64| json!({"tube": {"points_mm": points, "radius_mm": radius, "surface": surface()}});
    assert!(refused(json!("none")).is_empty());
    assert!(refused(plane([0.0, 0.0, -10.0], [0.0, 0.0, 2.0])).is_empty());
    assert!(refused(tube(json!([[-55.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), 5.0)).is_empty());
    assert_eq!(refused(plane([0.0, 0.0, -10.0], [0.0; 3])), ["plant.rod.contact.plane.normal"]);
    assert_eq!(refused(plane([0.0, 0.0, 10.0], [0.0, 0.0, 1.0])), ["plant.rod.contact.plane"]);
    assert_eq!(refused(tube(json!([[0.0, 0.0, 0.0]]), 5.0)), ["plant.rod.contact.tube.points_mm"]);
    let twice = json!([[-55.0, 0.0, 0.0], [-55.0, 0.0, 0.0]]);
    assert_eq!(refused(tube(twice, 5.0)), ["plant.rod.contact.tube.points_mm[1]"]);
    let far = json!([[-55.0, 9.0, 0.0], [5.0, 9.0, 0.0]]);
    assert_eq!(refused(tube(far, 5.0)), ["plant.rod.contact.tube"]);
    for (key, value) in [
        ("stiffness_kpa", 0.0),
        ("rounding_mm", 0.0),
        ("damping_s_per_m", -1.0),
        ("friction_coefficient", -0.1),
        ("creep_speed_mm_per_s", 0.0),
    ] {
        let mut contact = plane([0.0, 0.0, -10.0], [0.0, 0.0, 1.0]);
        contact["plane"]["surface"][key] = json!(value);
        assert_eq!(refused(contact), [format!("plant.rod.contact.plane.surface.{key}")]);
    }
}
