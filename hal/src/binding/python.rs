//! The messages as a Python module of ctypes structures, for PyPI `iceoryx2`.

use std::fmt::Write;

use super::layout::{Kind, Layout, layouts, schema_hash, type_names};
use crate::channels::endpoint::{ROOT_LENGTH_MAX, TRANSPORT_VERSION};
use crate::channels::service::{COMMAND, FEEDBACK, POSE, REQUEST, STATUS, TARGET_SET, TopicSettings};
use crate::guard::{SLEW_JITTER, VALIDITY_MAX};
use crate::message::{COILS_MAX, MAGNETS_MAX, POSE_PARAMETERS_MAX, SCHEMA, driver_state, order};
use crate::operator::{Cause, state, verb};
use crate::receive::FUTURE_TOLERANCE;

/// Messages that the module leaves out: requests about faults and records of cycles are no business of a
/// driver in another language.
pub const LEFT_OUT: [&str; 10] = [
    "FaultRequest",
    "FaultAnswer",
    "TickMessage",
    "AbsenceMessage",
    "TargetMessage",
    "RequestMessage",
    "AnswerMessage",
    "PhasesMessage",
    "CycleMessage",
    "RecordBatch",
];

/// The text of the module.
#[must_use]
pub fn python() -> String {
    let mut text = String::from(
        "\"\"\"Messages, codes and service settings of magsteer.\n\n\
         Generated from the Rust sources by `magsteer hal bindings`: do not edit.\n\"\"\"\n\n\
         import ctypes\n\n",
    );
    constants(&mut text);
    codes(&mut text);
    services(&mut text);
    for layout in layouts().iter().filter(|layout| !LEFT_OUT.contains(&layout.name)) {
        structure(&mut text, layout);
    }
    offsets(&mut text);
    text
}

/// Appends one line; writing into a string cannot fail.
fn line(text: &mut String, line: std::fmt::Arguments<'_>) {
    let _ = writeln!(text, "{line}");
}

fn constants(text: &mut String) {
    line(text, format_args!("SCHEMA = {SCHEMA}"));
    line(text, format_args!("SCHEMA_HASH = \"{}\"", schema_hash()));
    line(text, format_args!("SCHEMA_ATTRIBUTE = \"magsteer-schema\""));
    line(text, format_args!("TRANSPORT_VERSION = \"{TRANSPORT_VERSION}\""));
    line(text, format_args!("ROOT_LENGTH_MAX = {ROOT_LENGTH_MAX}"));
    line(text, format_args!("COILS_MAX = {COILS_MAX}"));
    line(text, format_args!("POSE_PARAMETERS_MAX = {POSE_PARAMETERS_MAX}"));
    line(text, format_args!("MAGNETS_MAX = {MAGNETS_MAX}"));
    line(text, format_args!("# How far a stamp may lie ahead of the receiver's clock."));
    line(text, format_args!("FUTURE_TOLERANCE_NS = {}", FUTURE_TOLERANCE.as_nanos()));
    line(text, format_args!("# Longest validity that a driver grants a command."));
    line(text, format_args!("VALIDITY_MAX_NS = {}", VALIDITY_MAX.as_nanos()));
    line(text, format_args!("# How far a command's content may run ahead of its publish stamp."));
    line(text, format_args!("SLEW_JITTER_S = {}", SLEW_JITTER.as_secs_f64()));
}

fn class(text: &mut String, name: &str, doc: &str, codes: &[(&str, u32)]) {
    line(text, format_args!("\n\nclass {name}:\n    \"\"\"{doc}\"\"\"\n"));
    for (code, value) in codes {
        line(text, format_args!("    {code} = {value}"));
    }
}

fn codes(text: &mut String) {
    class(
        text,
        "Order",
        "What a CoilCommand asks of the driver.",
        &[
            ("RELEASE", order::RELEASE),
            ("CLAIM", order::CLAIM),
            ("DRIVE", order::DRIVE),
            ("RAMP_DOWN", order::RAMP_DOWN),
            ("DISABLE", order::DISABLE),
        ],
    );
    class(
        text,
        "DriverState",
        "State of a driver, in CoilFeedback.",
        &[
            ("IDLE", driver_state::IDLE),
            ("DRIVEN", driver_state::DRIVEN),
            ("RAMPING_DOWN", driver_state::RAMPING_DOWN),
            ("DISABLED", driver_state::DISABLED),
        ],
    );
    class(
        text,
        "Verb",
        "What an operator asks for.",
        &[
            ("ARM", verb::ARM),
            ("GO", verb::GO),
            ("HOLD", verb::HOLD),
            ("STOP", verb::STOP),
            ("RESET", verb::RESET),
            ("ESTOP", verb::ESTOP),
            ("SET_TARGET", verb::SET_TARGET),
            ("SAVE", verb::SAVE),
            ("RETREAT", verb::RETREAT),
        ],
    );
    line(text, format_args!("\n\n# Words for StatusMessage.state, by code."));
    let names: Vec<String> =
        (state::BOOT..=state::FAULT).map(|code| format!("\"{}\"", state::name(code))).collect();
    line(text, format_args!("STATE_NAMES = [{}]", names.join(", ")));
    line(text, format_args!("\n# Words for the causes of refusals and stops, by code."));
    line(text, format_args!("CAUSES = {{"));
    for cause in Cause::ALL {
        line(text, format_args!("    {}: \"{}\",", *cause as u32, cause.text()));
    }
    line(text, format_args!("}}"));
}

fn services(text: &mut String) {
    line(text, format_args!("\n# Publish-subscribe services: what each is opened with."));
    line(text, format_args!("SERVICES = {{"));
    for settings in [POSE, FEEDBACK, COMMAND, STATUS] {
        let TopicSettings { channel, history, buffer, publishers, subscribers } = settings;
        line(
            text,
            format_args!(
                "    \"{channel}\": {{\"history\": {history}, \"buffer\": {buffer}, \"publishers\": {publishers}, \
                 \"subscribers\": {subscribers}, \"nodes\": {}}},",
                settings.nodes()
            ),
        );
    }
    line(text, format_args!("}}"));
    line(text, format_args!("REQUEST = \"{REQUEST}\""));
    line(text, format_args!("TARGET_SET = \"{TARGET_SET}\""));
}

fn ctype(kind: &Kind) -> String {
    match kind {
        Kind::U32 => "ctypes.c_uint32".to_owned(),
        Kind::U64 => "ctypes.c_uint64".to_owned(),
        Kind::F64 => "ctypes.c_double".to_owned(),
        Kind::Part(name) => (*name).to_owned(),
        Kind::Array(of, count) => match **of {
            Kind::Array(..) => format!("({}) * {count}", ctype(of)),
            _ => format!("{} * {count}", ctype(of)),
        },
    }
}

fn structure(text: &mut String, layout: &Layout) {
    line(text, format_args!("\n\nclass {}(ctypes.Structure):", layout.name));
    line(text, format_args!("    _fields_ = ["));
    for field in &layout.fields {
        line(text, format_args!("        (\"{}\", {}),", field.name, ctype(&field.kind)));
    }
    line(text, format_args!("    ]"));
    if let Some((_, name)) = type_names().into_iter().find(|(message, _)| *message == layout.name) {
        line(
            text,
            format_args!("\n    @staticmethod\n    def type_name() -> str:\n        return \"{name}\""),
        );
    }
}

/// What the Rust compiler made of each message, for a test in Python.
fn offsets(text: &mut String) {
    line(text, format_args!("\n\n# Size of each structure and offset of each field as Rust has them."));
    line(text, format_args!("LAYOUTS = {{"));
    for layout in layouts().iter().filter(|layout| !LEFT_OUT.contains(&layout.name)) {
        line(text, format_args!("    \"{}\": ({}, {{", layout.name, layout.size));
        for field in &layout.fields {
            line(text, format_args!("        \"{}\": {},", field.name, field.offset));
        }
        line(text, format_args!("    }}),"));
    }
    line(text, format_args!("}}"));
}
