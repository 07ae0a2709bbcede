//! The messages as a page for people, from the sources that define them.
//!
//! Names, offsets and kinds are those of the compiled types ([`layouts`]); what a field means is the documentation that
//! stands before it in the source, read from the text that this program was built from. So the page cannot say
//! something else than the code.

use std::fmt::Write;

use super::layout::{Kind, Layout, layouts, schema_hash, type_names};
use crate::channels::service::{
    COMMAND, FEEDBACK, POSE, RECORD, REQUEST, STATUS, TARGET_SET, TRUTH, TopicSettings,
};
use crate::message::SCHEMA;
use crate::operator::Cause;

/// Where the messages are defined.
const SOURCES: [&str; 4] = [
    include_str!("../message.rs"),
    include_str!("../operator.rs"),
    include_str!("../record.rs"),
    include_str!("../fault/request.rs"),
];
/// Modules of codes, with the source that they stand in.
const CODES: [(&str, usize); 7] = [
    ("order", 0),
    ("driver_state", 0),
    ("verb", 1),
    ("state", 1),
    ("verdict", 1),
    ("safe_action", 1),
    ("recorder", 1),
];

/// The text of the page, in Markdown.
#[must_use]
pub fn reference() -> String {
    let mut text = format!(
        "# Messages\n\n\
         Generated from the sources by `magsteer hal messages`: do not edit.\n\n\
         All numbers are in SI units and radians, little-endian, in the world frame unless a name says otherwise; stamps are\n\
         `CLOCK_MONOTONIC` in nanoseconds. Every service carries the attribute `magsteer-schema` with the hash of all layouts,\n\
         here `{}`, and every message the schema {SCHEMA}.\n\n",
        schema_hash()
    );
    services(&mut text);
    for layout in layouts() {
        message(&mut text, &layout);
    }
    for (module, source) in CODES {
        codes(&mut text, module, SOURCES[source]);
    }
    text += "\n## Causes\n\nWhy a request was refused, or why the daemon stopped. From 100 on the coils ramp to zero, from 200 on a fault is\n\
        latched, from 300 on the amplifiers are cut.\n\n| code | cause |\n|---|---|\n";
    for cause in Cause::ALL {
        line(&mut text, format_args!("| {} | {} |", cause.code(), cause.text()));
    }
    text
}

/// Appends one line; writing into a string cannot fail.
fn line(text: &mut String, line: std::fmt::Arguments<'_>) {
    let _ = writeln!(text, "{line}");
}

fn services(text: &mut String) {
    *text += "## Services\n\nNames are `magsteer/RIG/CHANNEL`. Publish and subscribe, with safe overflow: the newest messages stay.\n\n\
        | channel | message | from, to | history | queue, at most | publishers, subscribers |\n|---|---|---|---|---|---|\n";
    for (settings, message, way) in [
        (POSE, "PoseMessage", "driver to daemon"),
        (FEEDBACK, "CoilFeedback", "driver to daemon"),
        (COMMAND, "CoilCommand", "daemon to driver"),
        (STATUS, "StatusMessage", "daemon to anyone"),
        (RECORD, "RecordBatch", "daemon to recorders"),
        (TRUTH, "PoseMessage", "simulated rig to observers"),
    ] {
        let TopicSettings { channel, history, buffer, publishers, subscribers } = settings;
        line(
            text,
            format_args!(
                "| `{channel}` | {message} | {way} | {history} | {buffer} | {publishers}, {subscribers} |"
            ),
        );
    }
    line(
        text,
        format_args!(
            "\nRequest and response, operators to daemon: `{REQUEST}` and `{TARGET_SET}`, OperatorRequest and OperatorAnswer."
        ),
    );
}

fn message(text: &mut String, layout: &Layout) {
    let Layout { name, size, align, fields } = layout;
    line(text, format_args!("\n## {name}\n"));
    let known = type_names().into_iter().find(|(known, _)| known == name);
    let named = known.map_or_else(String::new, |(_, type_name)| format!(", type name `{type_name}`"));
    let (doc, meanings) = documented(name);
    line(text, format_args!("{doc}\n\n{size} bytes, aligned to {align}{named}.\n"));
    line(text, format_args!("| at | field | kind | meaning |\n|---|---|---|---|"));
    for field in fields {
        let meaning = meanings.iter().find(|(of, _)| of == field.name).map_or("", |(_, meaning)| meaning);
        line(
            text,
            format_args!("| {} | `{}` | {} | {meaning} |", field.offset, field.name, kind(&field.kind)),
        );
    }
}

fn kind(kind: &Kind) -> String {
    match kind {
        Kind::U32 => "u32".to_owned(),
        Kind::U64 => "u64".to_owned(),
        Kind::F64 => "f64".to_owned(),
        Kind::Part(name) => (*name).to_owned(),
        Kind::Array(of, count) => format!("{} x {count}", self::kind(of)),
    }
}

/// The documentation of a type and of its fields, from the source.
fn documented(name: &str) -> (String, Vec<(String, String)>) {
    let head = format!("pub struct {name} {{");
    let Some(source) = SOURCES.iter().find(|source| source.contains(&head)) else {
        return (String::new(), Vec::new());
    };
    let (before, after) = source.split_once(&head).unwrap_or((source, ""));
    let above: Vec<&str> =
        before.lines().rev().take_while(|line| line.starts_with("///") || line.starts_with("#[")).collect();
    let doc: Vec<&str> = above.iter().rev().filter_map(|line| line.strip_prefix("///")).collect();
    let body = after.split("\n}").next().unwrap_or("");
    let field = |line: &str| line.strip_prefix("pub ")?.split_once(':').map(|(name, _)| name.to_owned());
    (prose(&doc), meanings(body, field))
}

/// Documentation with what it stands before, where `named` finds a name on a line.
fn meanings(body: &str, named: impl Fn(&str) -> Option<String>) -> Vec<(String, String)> {
    let (mut found, mut doc) = (Vec::new(), Vec::new());
    for line in body.lines().map(str::trim) {
        if let Some(words) = line.strip_prefix("///") {
            doc.push(words);
        } else if let Some(name) = named(line) {
            found.push((name, prose(&doc)));
            doc.clear();
        }
    }
    found
}

/// Lines of documentation as one paragraph; links become their names.
fn prose(lines: &[&str]) -> String {
    let text = lines.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ");
    text.replace("[`", "`")
        .replace("`]", "`")
        .replace("super::", "")
        .replace("crate::", "")
        .replace('|', "\\|")
}

fn codes(text: &mut String, module: &str, source: &str) {
    let Some((before, after)) = source.split_once(&format!("pub mod {module} {{")) else { return };
    let above: Vec<&str> = before.lines().rev().take_while(|line| line.starts_with("///")).collect();
    let doc: Vec<&str> = above.iter().rev().filter_map(|line| line.strip_prefix("///")).collect();
    line(
        text,
        format_args!("\n## Codes: {module}\n\n{}\n\n| code | name | meaning |\n|---|---|---|", prose(&doc)),
    );
    let body = after.split("\n}").next().unwrap_or("");
    let code = |line: &str| {
        let (name, value) = line.strip_prefix("pub const ")?.split_once(": u32 = ")?;
        Some(format!("{} | `{name}`", value.trim_end_matches(';')))
    };
    for (code, meaning) in meanings(body, code) {
        line(text, format_args!("| {code} | {meaning} |"));
    }
}
