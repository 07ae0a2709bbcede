//! `magsteer field export`: the coils as a calibration file of another system.

use std::path::PathBuf;

use clap::Args;
use magsteer::config::Config;
use magsteer::magnetics::CoilArray;
use magsteer::magnetics::mpem::{Calibration, write};
use magsteer_hal::HardwareDescription;

use crate::cli::actuation::{ActuationArgs, finite};
use crate::cli::data_file;
use crate::cli::exit::{Exit, Failure};
use crate::cli::{output, shipped};

/// The coils as a calibration of a multipole electromagnet model (MPEM, YAML).
///
/// Writes what the package mpem of Tesla (mag_manip) reads: coils in the order of their currents, each with
/// one source where it stands at these frame angles. Coefficients hold each coil's gain. The workspace is
/// the cube inside the rig's sphere. Limits, circuits and frames are not in that format.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer field export config/bigmag-planar.toml --out calibration.yaml\n  \
    magsteer field export config/bigmag-planar.toml --angles-deg 30,-45 --out turned.yaml"
)]
pub struct Export {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Angle of each frame, deg, in the order of the configuration; all zero when left out.
    #[arg(long, value_name = "DEG,DEG,...", value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    angles_deg: Option<Vec<f64>>,
    /// Where the calibration goes; printed when left out.
    #[arg(long, value_name = "FILE.yaml")]
    out: Option<PathBuf>,
}

impl Export {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let rig = Config::from_document(&shipped::config(self.config.as_deref())?)?.description;
        let actuation =
            ActuationArgs { currents: Some(vec![0.0; rig.coils.len()]), angles_deg: self.angles_deg.clone() };
        let angles = actuation.for_rig(&rig)?.angles;
        let array = CoilArray::new(&rig).posed(&angles);
        let calibration = Calibration::of_array(&rig, &array);
        let text = write(&calibration, &remarks(&rig, &angles)).map_err(|refusal| {
            let (key, value, expected) = (refusal.column, refusal.value, refusal.expected);
            Failure::with(Exit::Data, anyhow::anyhow!("{key}: {value}: must be {expected}"))
        })?;
        match &self.out {
            Some(out) => data_file::create(out, text.as_bytes())?,
            None => output::result(text)?,
        }
        Ok(Exit::Success)
    }
}

/// What the format has no place for.
fn remarks(rig: &HardwareDescription, angles: &[f64]) -> Vec<String> {
    let mut remarks = vec![format!("Coils of {}, made by `magsteer field export`; m, A, T", rig.rig)];
    if !rig.frames.is_empty() {
        let frames = rig.frames.iter().zip(angles);
        // Rounded, so that no digits of the conversion from degrees and back are written.
        let shown = frames
            .map(|(frame, angle)| format!("{} {} deg", frame.name, (angle.to_degrees() * 1e9).round() / 1e9));
        remarks.push(format!("Frames at: {}", shown.collect::<Vec<_>>().join(", ")));
    }
    for coil in &rig.coils {
        let valid_from_x = coil.valid_from_x * 1e3;
        remarks.push(format!("{}: valid from {valid_from_x:.1} mm in front of its source", coil.name));
    }
    remarks
}
