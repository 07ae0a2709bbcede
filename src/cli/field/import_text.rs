//! Imported coils as a TOML file that a configuration can use.
//!
//! Each coil gets a type of its own and stands where the calibration has it. Tables merge key by key and
//! arrays replace as a whole, so that the file may extend a configuration, be extended by one, or be pasted
//! into one.

use magsteer::magnetics::mpem::{Calibration, PlacedCoil, Substitute};
use magsteer_hal::config::{CoilConfig, CoilTypeConfig};

use crate::cli::overlay::{circuit, coil_entry, key, quoted};

/// Where the numbers come from.
pub(super) struct Origin<'a> {
    /// The calibration file, as given.
    pub file: String,
    /// Its SHA-256, lower-case hexadecimal.
    pub sha256: String,
    /// What the file extends.
    pub extends: Option<String>,
    /// The circuit of every coil.
    pub circuit: Option<Circuit<'a>>,
    /// Whether what it extends has a simulated plant.
    pub has_plant: bool,
}

/// A coil type that others take after.
pub(super) struct Circuit<'a> {
    pub name: &'a str,
    pub coil_type: &'a CoilTypeConfig,
}

/// The whole file.
pub(super) fn text(
    calibration: &Calibration,
    coils: &[PlacedCoil],
    substitutes: &[Substitute],
    origin: &Origin<'_>,
    valid_from_x_mm: impl Fn(&PlacedCoil) -> f64,
) -> String {
    let mut text = format!(
        "# Coils of {}, made by `magsteer field import` from {}\n# SHA-256 of the calibration: {}\n",
        one_line(&calibration.name),
        one_line(&origin.file),
        origin.sha256
    );
    for (axis, [least, greatest]) in ["x", "y", "z"].iter().zip(calibration.workspace) {
        text += &format!("# calibrated from {axis} = {:.1} to {:.1} mm\n", least * 1e3, greatest * 1e3);
    }
    for Substitute { coil, source_count, left } in substitutes {
        text += &format!(
            "# {}: one source in place of {source_count} leaves {:.2} % of the calibrated field (RMS)\n",
            one_line(coil),
            100.0 * left
        );
    }
    match &origin.circuit {
        Some(circuit) => {
            text += &format!("# Circuits and limits as of coil type {}\n", one_line(circuit.name))
        }
        None => {
            text += "# A coil type also has current_max_a, slew_max_a_per_s, resistance_ohm, inductance_h and supply_v.\n";
        }
    }
    if let Some(extends) = &origin.extends {
        text += &format!("\nextends = {}\n", quoted(extends));
    }
    for coil in coils {
        let series: Vec<String> = coil.coefficients.iter().map(|value| format!("{value:e}")).collect();
        text += &format!(
            "\n[coil_types.{}]\ncoefficients_si = [{}] # T m^(k+2) / A\nvalid_from_x_mm = {:?}\n",
            key(&coil.name),
            series.join(", "),
            valid_from_x_mm(coil)
        );
        text += &origin.circuit.as_ref().map_or_else(String::new, |taken| circuit(taken.coil_type));
    }
    if origin.has_plant {
        text += "\n[plant]\ncoupling = [] # none is known between these coils\n";
        text += "\n[plant.field] # simulated coils are exactly these series\n";
        text +=
            &coils.iter().map(|coil| format!("{} = \"multipole\"\n", key(&coil.name))).collect::<String>();
    }
    for coil in coils {
        text += &coil_entry(&CoilConfig {
            name: coil.name.clone(),
            coil_type: coil.name.clone(),
            azimuth_deg: None,
            elevation_deg: None,
            distance_mm: None,
            position_mm: Some((coil.pose.origin * 1e3).into()),
            // The sum turns a negative zero into zero.
            axis: Some(coil.pose.axis.add_scalar(0.0).into()),
            frame: None,
            gain: None,
        });
    }
    text
}

fn one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}
