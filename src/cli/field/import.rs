//! `magsteer field import`: coils from the calibration file of another system.

use std::path::{Path, PathBuf};

use clap::Args;
use magsteer::config::{Config, Document};
use magsteer::magnetics::mpem::{Calibration, PlacedCoil, Substitute, placed_coils, read};
use serde::Serialize;

use super::import_text::{self, Origin};
use crate::cli::actuation::finite;
use crate::cli::check::check;
use crate::cli::data_file;
use crate::cli::exit::{Exit, Failure};
use crate::cli::output;
use crate::cli::overlay::path_from;

/// Coils from a calibration of a multipole electromagnet model (MPEM, YAML).
///
/// Reads what the package mpem of Tesla (mag_manip) writes: Coil_List, and for each coil its source with
/// position (m), direction and coefficients (T m^(n+2) / A). A coil must have one source with falling terms
/// (B_Coeff) alone, of order 1 to 10, unless `--one-source-within-percent` takes one in place of others.
/// Such a file says nothing of currents and circuits: they are taken from a coil type of `--config`. Ends
/// with 0; 1 when the file written is no right configuration yet; 65 when the calibration is refused, with
/// line, key, value and what would be right.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  magsteer field import tests/reference/calibration.yaml\n  \
    magsteer field import calibration.yaml --config config/bigmag-planar.toml --coil-type iron --out my-rig.toml\n  \
    magsteer field import octomag.yaml --one-source-within-percent 5 --out coils.toml\n\n\
    JSON: name, coils[].{name, order, coefficients (per ampere, SI), position_m, axis, valid_from_x_mm, field_at_center_t_per_a, left_percent}, files.")]
pub struct Import {
    /// Calibration (YAML).
    #[arg(value_name = "FILE.yaml")]
    file: PathBuf,
    /// Configuration that `--out` extends: manipulator, controller and the rest come from there.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Coil type of `--config` whose circuit and limits every coil gets; needed when there are several.
    #[arg(long, value_name = "NAME", requires = "config")]
    coil_type: Option<String>,
    /// Least distance in front of each source at which its series holds, mm; when left out, as near as the
    /// calibrated workspace comes to it.
    #[arg(long, value_name = "MM", value_parser = positive)]
    valid_from_x_mm: Option<f64>,
    /// Where a coil has several sources, or rising terms, take the one source that comes nearest to their
    /// field in the calibrated box; refuse when it leaves more than this part of it, RMS, percent.
    #[arg(long, value_name = "PERCENT", value_parser = positive)]
    one_source_within_percent: Option<f64>,
    /// Leave out the field without currents, which a coil named Offset stands for.
    #[arg(long)]
    without_background: bool,
    /// Write a TOML file with the coils: by itself with `--config`, else to be extended or pasted.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 { Ok(value) } else { Err("must be above 0".to_owned()) }
}

#[derive(Serialize)]
struct Answer {
    name: String,
    coils: Vec<CoilAnswer>,
    files: Vec<PathBuf>,
}

#[derive(Serialize)]
struct CoilAnswer {
    name: String,
    order: usize,
    /// T m^(k+2) / A, k = 1 first.
    coefficients: Vec<f64>,
    position_m: [f64; 3],
    axis: [f64; 3],
    valid_from_x_mm: f64,
    field_at_center_t_per_a: [f64; 3],
    /// Part of the field of several sources that the one in their place leaves; null where none was needed.
    left_percent: Option<f64>,
}

/// What the one source in place of a coil's several leaves of their field.
fn left(substitutes: &[Substitute], coil: &PlacedCoil) -> Option<f64> {
    substitutes.iter().find(|substitute| substitute.coil == coil.name).map(|substitute| substitute.left)
}

impl Import {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let bytes = data_file::read_as(&self.file, "a YAML file")?;
        let mut calibration = read(&bytes).map_err(|refusal| data_file::refuse(&self.file, &refusal))?;
        if !calibration.ends_with_line_end {
            data_file::note_cut(&self.file);
        }
        if let Some(background) = calibration.background.take_if(|_| self.without_background) {
            let strength = background.field(&calibration.center()).norm() * 1e3;
            output::note(format_args!(
                "note: the field without currents, {}, is left out: {strength:.3} mT at the centre",
                background.name
            ));
        }
        let mut substitutes = Vec::new();
        if let Some(percent) = self.one_source_within_percent {
            (calibration, substitutes) = calibration
                .with_one_source_each(percent / 100.0)
                .map_err(|refusal| data_file::refuse(&self.file, &refusal))?;
        }
        for Substitute { coil, source_count, left } in &substitutes {
            output::note(format_args!(
                "note: coil {coil}: one source in place of {source_count} leaves {:.2} % of the calibrated field",
                100.0 * left
            ));
        }
        let coils = placed_coils(&calibration).map_err(|refusal| {
            if calibration.coils.iter().any(|coil| coil.sources.len() > 1) {
                output::note(
                    "note: --one-source-within-percent PERCENT takes the nearest one source in place of several",
                );
            }
            data_file::refuse(&self.file, &refusal)
        })?;
        let (document, config) = self.config.as_deref().map(Config::load).transpose()?.unzip();
        let circuit = config.as_ref().map(|config| self.circuit(config)).transpose()?;
        if let Some(config) = &config {
            note_surroundings(config, &calibration);
        }
        let mut files = Vec::new();
        let mut is_right = true;
        if let Some(out) = &self.out {
            let origin = Origin {
                file: self.file.display().to_string(),
                sha256: data_file::sha256(&bytes),
                extends: self.config.as_deref().map(|config| path_from(out, config)),
                circuit,
                has_plant: document.is_some_and(|document| document.has("plant")),
            };
            let text = import_text::text(&calibration, &coils, &substitutes, &origin, |coil| {
                self.valid_from_x_mm(coil)
            });
            data_file::create(out, text.as_bytes())?;
            files.push(out.clone());
            is_right = config.is_none() || loads(out);
        }
        self.print(calibration, &coils, &substitutes, files)?;
        Ok(if is_right { Exit::Success } else { Exit::No })
    }

    /// Rounded down to a micrometre, so that no digits of rounding are written.
    fn valid_from_x_mm(&self, coil: &PlacedCoil) -> f64 {
        self.valid_from_x_mm.unwrap_or_else(|| ((coil.box_from_x * 1e6 + 1e-3).floor() / 1e3).max(1e-3))
    }

    /// Name and circuit of the coil type that every coil takes after.
    fn circuit<'a>(&self, config: &'a Config) -> anyhow::Result<import_text::Circuit<'a>> {
        let known = &config.hardware.coil_types;
        let listed = known.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
        let named = match &self.coil_type {
            Some(name) => known.get_key_value(name).ok_or_else(|| {
                Failure::usage(format!(
                    "--coil-type {name}: must be a coil type of the configuration ({listed})"
                ))
            })?,
            None => known.iter().next().filter(|_| known.len() == 1).ok_or_else(|| {
                Failure::usage(format!("--coil-type: must say whose circuit the coils have ({listed})"))
            })?,
        };
        Ok(import_text::Circuit { name: named.0, coil_type: named.1 })
    }

    fn print(
        &self,
        calibration: Calibration,
        coils: &[PlacedCoil],
        substitutes: &[Substitute],
        files: Vec<PathBuf>,
    ) -> anyhow::Result<()> {
        let coil = |coil: &PlacedCoil| CoilAnswer {
            name: coil.name.clone(),
            order: coil.coefficients.len(),
            coefficients: coil.coefficients.clone(),
            position_m: coil.pose.origin.into(),
            axis: coil.pose.axis.into(),
            valid_from_x_mm: self.valid_from_x_mm(coil),
            field_at_center_t_per_a: coil.field_at_center.into(),
            left_percent: left(substitutes, coil).map(|left| 100.0 * left),
        };
        let answer = Answer { name: calibration.name, coils: coils.iter().map(coil).collect(), files };
        if self.json { output::json(&answer) } else { Ok(output::result(answer.table())?) }
    }
}

impl Answer {
    fn table(&self) -> String {
        let mut text = format!(
            "{}: {} coils\n{:<24} {:>5} {:>31} {:>27} {:>11} {:>13}\n",
            self.name,
            self.coils.len(),
            "coil",
            "order",
            "position (mm)",
            "axis",
            "from x (mm)",
            "centre (mT/A)"
        );
        for coil in &self.coils {
            let row = |values: &[f64; 3], scale: f64, digits: usize| {
                // What rounds to nothing must not show a sign.
                let unsigned = |text: String| match text.strip_prefix('-') {
                    Some(digits) if digits.chars().all(|digit| "0.".contains(digit)) => digits.to_owned(),
                    _ => text,
                };
                let shown = values.map(|value| unsigned(format!("{:.digits$}", value * scale)));
                format!("({})", shown.join(", "))
            };
            let strength = coil.field_at_center_t_per_a.iter().map(|field| field * field).sum::<f64>().sqrt();
            text += &format!(
                "{:<24} {:>5} {:>31} {:>27} {:>11.1} {:>13.4}\n",
                coil.name,
                coil.order,
                row(&coil.position_m, 1e3, 2),
                row(&coil.axis, 1.0, 4),
                coil.valid_from_x_mm,
                strength * 1e3
            );
        }
        for file in &self.files {
            text += &format!("written: {}\n", file.display());
        }
        text
    }
}

/// Says what of the configuration does not go with the calibration.
fn note_surroundings(config: &Config, calibration: &Calibration) {
    let workspace = &config.description.workspace;
    let reaches_out = (0..3).any(|axis| {
        let [least, greatest] = calibration.workspace[axis];
        let center = workspace.center[axis];
        center - workspace.radius < least - 1e-9 || center + workspace.radius > greatest + 1e-9
    });
    if reaches_out {
        let edges = calibration
            .workspace
            .map(|[least, greatest]| format!("{:.1} to {:.1}", least * 1e3, greatest * 1e3));
        output::note(format_args!(
            "note: the configuration's workspace reaches out of the box that was calibrated (x {}, y {}, z {} mm)",
            edges[0], edges[1], edges[2]
        ));
    }
    let frames: Vec<&str> = config.description.frames.iter().map(|frame| frame.name.as_str()).collect();
    if !frames.is_empty() {
        output::note(format_args!(
            "note: no coil of the calibration stands on a frame: {} of the configuration turn nothing",
            frames.join(", ")
        ));
    }
}

/// Whether the file written is a right configuration; tells what is wrong with it.
fn loads(out: &Path) -> bool {
    let Err(problems) = Document::load(out).and_then(|document| check(&document)) else { return true };
    output::note(format_args!("note: {} is no right configuration yet:\n{problems}", out.display()));
    false
}
