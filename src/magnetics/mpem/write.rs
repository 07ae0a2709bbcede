//! A calibration as the text of a file.
//!
//! Numbers have a point and a signed exponent of two digits or more: YAML 1.1 readers take `1e-6` for a text.
//! They are as long as it takes to read back the same number.

use std::fmt::Write;

use super::calibration::{Calibration, CoilSources};
use super::read::{
    A_COEFF, B_COEFF, COIL_LIST, DIRECTION, OFFSET, POSITION, SOURCE_LIST, SYSTEM_NAME, WORKSPACE,
};
use crate::math::csv::Refusal;

/// The text of a calibration; `remarks` are put in front as comments.
///
/// # Errors
/// A coil whose name the format takes for something else.
pub fn write(calibration: &Calibration, remarks: &[String]) -> Result<String, Refusal> {
    let reserved = [SYSTEM_NAME, COIL_LIST, WORKSPACE];
    let taken = |coil: &&CoilSources| coil.name.contains(OFFSET) || reserved.contains(&coil.name.as_str());
    if let Some(coil) = calibration.coils.iter().find(taken) {
        let expected = format!("another name: readers take {} for something else", coil.name);
        return Err(Refusal::new(1, format!("coil {}", coil.name), "a word of the format", expected));
    }
    let mut text = String::new();
    // Writing to a text cannot fail.
    let _ = compose(calibration, remarks, &mut text);
    Ok(text)
}

fn compose(calibration: &Calibration, remarks: &[String], text: &mut String) -> std::fmt::Result {
    for remark in remarks {
        writeln!(text, "# {}", remark.replace(char::is_control, " "))?;
    }
    writeln!(text, "{SYSTEM_NAME}: {}", quoted(&calibration.name))?;
    writeln!(text, "{WORKSPACE}:")?;
    for [least, greatest] in calibration.workspace {
        writeln!(text, "  - [{}, {}]", number(least), number(greatest))?;
    }
    let coils = || calibration.coils.iter().chain(&calibration.background);
    writeln!(text, "{COIL_LIST}:")?;
    for coil in coils() {
        writeln!(text, "  - {}", quoted(&coil.name))?;
    }
    for coil in coils() {
        writeln!(text, "{}:\n  {SOURCE_LIST}:", quoted(&coil.name))?;
        for source in &coil.sources {
            writeln!(text, "    - {}", quoted(&source.name))?;
        }
        for source in &coil.sources {
            writeln!(text, "  {}:", quoted(&source.name))?;
            sequence(text, A_COEFF, &source.rising)?;
            sequence(text, B_COEFF, &source.falling)?;
            sequence(text, DIRECTION, source.direction.as_slice())?;
            sequence(text, POSITION, source.position.as_slice())?;
        }
    }
    Ok(())
}

fn sequence(text: &mut String, key: &str, values: &[f64]) -> std::fmt::Result {
    if values.is_empty() {
        return writeln!(text, "    {key}: ~");
    }
    writeln!(text, "    {key}:")?;
    values.iter().try_for_each(|value| writeln!(text, "      - {}", number(*value)))
}

fn number(value: f64) -> String {
    let text = format!("{value:e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let point = if mantissa.contains('.') { "" } else { ".0" };
    let (sign, digits) = match exponent.strip_prefix('-') {
        Some(digits) => ('-', digits),
        None => ('+', exponent),
    };
    format!("{mantissa}{point}e{sign}{digits:0>2}")
}

/// A name; in quotes unless every reader takes it for a text as it is.
fn quoted(name: &str) -> String {
    let is_plain = name.chars().next().is_some_and(|first| first.is_ascii_alphabetic())
        && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_' || letter == '-')
        && !["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"]
            .contains(&name.to_ascii_lowercase().as_str());
    if is_plain {
        return name.to_owned();
    }
    let mut text = String::from("\"");
    for letter in name.chars() {
        match letter {
            '"' | '\\' => text.extend(['\\', letter]),
            _ if letter.is_control() => text += &format!("\\U{:08x}", u32::from(letter)),
            _ => text.push(letter),
        }
    }
    text + "\""
}
