//! The committed Python module and the reference are what the generators make of the messages.

use magsteer_hal::binding::{LEFT_OUT, layouts, python, reference, schema_hash};

const COMMITTED: &str = include_str!("../python/magsteer/messages.py");
const REFERENCE: &str = include_str!("../docs/messages.md");

#[test]
fn committed_python_messages_equal_the_generated_ones() {
    let generated = python();
    let differs =
        generated.lines().zip(COMMITTED.lines()).find(|(generated, committed)| generated != committed);
    assert!(
        generated == COMMITTED,
        "first difference: {differs:?}; write it anew: magsteer hal bindings > hal/python/magsteer/messages.py"
    );
}

#[test]
fn generated_module_has_every_message_with_size_offsets_and_hash() {
    let text = python();
    assert!(text.contains(&format!("SCHEMA_HASH = \"{}\"", schema_hash())));
    for layout in layouts().iter().filter(|layout| !LEFT_OUT.contains(&layout.name)) {
        assert!(text.contains(&format!("class {}(ctypes.Structure):", layout.name)), "{}", layout.name);
        assert!(text.contains(&format!("\"{}\": ({}, {{", layout.name, layout.size)), "{}", layout.name);
    }
    assert!(text.contains("(\"magnets\", MagnetPose * 8),"), "arrays of parts");
    assert!(text.contains("(\"direction\", (ctypes.c_double * 3) * 8),"), "arrays of arrays");
}

#[test]
fn committed_reference_equals_the_generated_one() {
    let generated = reference();
    let differs =
        generated.lines().zip(REFERENCE.lines()).find(|(generated, committed)| generated != committed);
    assert!(
        generated == REFERENCE,
        "first difference: {differs:?}; write it anew: magsteer hal messages > hal/docs/messages.md"
    );
}

#[test]
fn reference_says_what_every_message_and_every_field_means() {
    let text = reference();
    for layout in layouts() {
        let (_, section) = text.split_once(&format!("\n## {}\n", layout.name)).expect("a section");
        let section = section.split("\n## ").next().expect("its text");
        assert!(section.trim_start().lines().next().is_some_and(|doc| doc.len() > 10), "{}", layout.name);
        for field in &layout.fields {
            let row = format!("| {} | `{}` |", field.offset, field.name);
            let row = section.lines().find(|line| line.starts_with(&row)).expect("a row");
            let meaning = row.trim_end_matches('|').rsplit('|').next().expect("a cell").trim();
            assert!(meaning.len() > 3, "{}: {row}", layout.name);
        }
    }
    for section in
        ["## Codes: order", "## Codes: verb", "| 3 | `RAMP_DOWN` |", "## Causes", "| 200 | no fresh poses |"]
    {
        assert!(text.contains(section), "{section}");
    }
}
