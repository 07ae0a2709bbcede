//! Fitted coefficients as a TOML file that a configuration can use.
//!
//! For one coil: `[coil_types.NAME]` with the two keys that a fit knows. Tables merge key by key, so that the
//! file may extend a configuration that has the type, be extended by one, or be pasted into one. For an
//! array: each coil gets a type of its own, with the circuit of the type it had. Expansion points that moved
//! change `distance_mm` or `position_mm`; arrays replace as a whole, so that all coils are written.

use magsteer::magnetics::fit::{CoilFit, FieldFit, FitRequest, Layout, OrderChoice, Refusal};
use magsteer_hal::config::{CoilConfig, HardwareConfig};

use super::fit::Subject;
use crate::cli::overlay::{self, coil_entry, key, nominal_entry, quoted};

/// How the file fits together with others.
pub(super) struct Names {
    /// What it extends.
    pub extends: Option<String>,
    /// Type of each coil fitted.
    pub coil_types: Vec<String>,
}

/// The whole file.
///
/// # Errors
/// A coil whose expansion point moved through the workspace's centre.
pub(super) fn text(
    subject: &Subject,
    found: &FieldFit,
    names: &Names,
    request: &FitRequest,
) -> Result<String, Refusal> {
    let mut text = head(subject, found, request);
    if let Some(extends) = &names.extends {
        text += &format!("\nextends = {}\n", quoted(extends));
    }
    let hardware = subject.config.as_ref().map(|config| &config.hardware);
    for (index, (coil, name)) in found.coils.iter().zip(&names.coil_types).enumerate() {
        text += &format!("\n[coil_types.{}]\n{}", key(name), series(coil));
        match (subject.readings.layout, hardware) {
            (Layout::Array, Some(hardware)) => text += &circuit(hardware, index),
            (Layout::OneCoil, None) => {
                text += "# A coil type also has current_max_a, slew_max_a_per_s, resistance_ohm, inductance_h and supply_v.\n";
                if coil.origin != 0.0 {
                    text += &format!(
                        "# The expansion point moved: add {:.3} to distance_mm of each such coil.\n",
                        -coil.origin * 1e3
                    );
                }
            }
            _ => {}
        }
    }
    if let Some(hardware) = hardware {
        text += &coils(hardware, subject, found, names)?;
    }
    if let Some(extends) = names.extends.as_ref().filter(|_| subject.simulates_itself) {
        text += &nominal_entry(extends);
    }
    Ok(text)
}

/// Where the numbers come from, as comments.
fn head(subject: &Subject, found: &FieldFit, request: &FitRequest) -> String {
    let choice = match request.order {
        OrderChoice::Auto => "chosen by readings left out",
        OrderChoice::Exactly(_) => "as asked for",
    };
    let holdout = found
        .orders
        .iter()
        .find(|report| report.order == found.order)
        .and_then(|report| report.holdout_rms_norm);
    let holdout =
        holdout.map_or_else(String::new, |norm| format!(", {:.4} mT of readings left out", norm * 1e3));
    let origin = if request.fit_origin { "fitted along the axes" } else { "as given" };
    format!(
        "# Field coefficients, made by `magsteer field fit` from {}\n\
         # SHA-256 of the data: {}\n\
         # {} readings, order {} ({choice}), origins {origin}\n\
         # RMS norm {:.4} mT{holdout}; noise of one component {:.4} mT\n",
        subject.file.replace(['\n', '\r'], " "),
        subject.sha256,
        subject.readings.readings.len(),
        found.order,
        found.rms_norm * 1e3,
        found.noise * 1e3,
    )
}

/// The keys that a fit knows.
fn series(coil: &CoilFit) -> String {
    let list = |values: &[f64], digits: Option<usize>| {
        let show =
            |value: &f64| digits.map_or_else(|| format!("{value:e}"), |digits| format!("{value:.digits$e}"));
        values.iter().map(show).collect::<Vec<_>>().join(", ")
    };
    format!(
        "coefficients_si = [{}] # T m^(k+2) / A\n# their standard deviations: {}\nvalid_from_x_mm = {:.1}\n",
        list(&coil.coefficients, None),
        list(&coil.deviations, Some(1)),
        coil.range.from_x * 1e3
    )
}

/// The circuit of the type that a coil had.
fn circuit(hardware: &HardwareConfig, coil: usize) -> String {
    let coil_type = hardware.coils.get(coil).and_then(|coil| hardware.coil_types.get(&coil.coil_type));
    coil_type.map_or_else(String::new, overlay::circuit)
}

/// Every coil, where a type or a distance changed.
fn coils(
    hardware: &HardwareConfig,
    subject: &Subject,
    found: &FieldFit,
    names: &Names,
) -> Result<String, Refusal> {
    let is_array = subject.readings.layout == Layout::Array;
    if !is_array && found.coils.iter().all(|coil| coil.origin == 0.0) {
        return Ok(String::new());
    }
    let mut text = String::new();
    for (index, coil) in hardware.coils.iter().enumerate() {
        let mut coil = coil.clone();
        let fitted = if is_array {
            // The fitted coefficients are of this coil alone and hold its gain.
            coil.gain = None;
            coil.coil_type.clone_from(&names.coil_types[index]);
            Some(&found.coils[index])
        } else {
            found.coils.first().filter(|_| names.coil_types.contains(&coil.coil_type))
        };
        if let Some(fitted) = fitted {
            move_expansion_point(&mut coil, fitted.origin)?;
        }
        text += &coil_entry(&coil);
    }
    Ok(text)
}

/// Moves a coil's expansion point by `origin`, m, along its axis.
fn move_expansion_point(coil: &mut CoilConfig, origin: f64) -> Result<(), Refusal> {
    // Rounded to a nanometre, so that no digits of rounding are written.
    let rounded = |value_mm: f64| (value_mm * 1e6).round() / 1e6;
    if let (Some(position_mm), Some(axis)) = (&mut coil.position_mm, coil.axis) {
        let norm = axis.iter().map(|component| component * component).sum::<f64>().sqrt();
        for (position_mm, component) in position_mm.iter_mut().zip(axis) {
            *position_mm = rounded(*position_mm + origin * 1e3 * component / norm);
        }
    }
    let Some(distance_mm) = &mut coil.distance_mm else { return Ok(()) };
    *distance_mm = rounded(*distance_mm - origin * 1e3);
    if *distance_mm > 0.0 {
        return Ok(());
    }
    Err(Refusal {
        line: 1,
        column: "rows".to_owned(),
        value: format!("put the expansion point of coil {} at {distance_mm} mm from the centre", coil.name),
        expected: "in front of the coil: check the positions, or leave out --fit-origin".to_owned(),
    })
}
