//! The committed Python module is what the generator makes of the messages.

use magsteer_hal::binding::{LEFT_OUT, layouts, python, schema_hash};

const COMMITTED: &str = include_str!("../python/magsteer/messages.py");

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
