use super::{HardwareDescription, PartDescription};
use crate::scripted::example_description;

#[test]
fn equal_descriptions_have_equal_fingerprints() {
    assert_eq!(example_description().fingerprint(), example_description().fingerprint());
}

#[test]
fn every_change_of_the_description_changes_its_fingerprint() {
    type Change = fn(&mut HardwareDescription);
    let changes: [Change; 14] = [
        |rig| rig.rig.push('x'),
        |rig| rig.workspace.radius = rig.workspace.radius.next_up(),
        |rig| rig.gravity[2] = -rig.gravity[2],
        |rig| rig.frames[0].pivot[0] = -0.0,
        |rig| rig.frames[1].speed_max *= 2.0,
        |rig| rig.coils[0].coefficients[1] = rig.coils[0].coefficients[1].next_up(),
        |rig| rig.coil_types.push("air".to_owned()),
        |rig| rig.coils[0].coil_type.push('x'),
        |rig| rig.coils[1].frame = None,
        |rig| rig.coils[2].slew_max += 1.0,
        |rig| rig.coils.swap(0, 1),
        |rig| rig.manipulator.base_rotation[0][1] = 1e-300,
        |rig| {
            rig.manipulator.parts.pop();
        },
        |rig| {
            if let PartDescription::Magnet(magnet) = &mut rig.manipulator.parts[1] {
                magnet.moment_body[2] = -magnet.moment_body[2];
            }
        },
    ];
    let mut seen = vec![example_description().fingerprint()];
    for change in changes {
        let mut description = example_description();
        change(&mut description);
        let fingerprint = description.fingerprint();
        assert!(!seen.contains(&fingerprint), "change {} went unnoticed", seen.len());
        seen.push(fingerprint);
    }
}

#[test]
fn magnets_come_base_to_tip_without_the_sections_between() {
    let description = example_description();
    let names: Vec<&str> = description.magnets().map(|magnet| magnet.name.as_str()).collect();
    assert_eq!(names, ["m1", "m2"]);
}
