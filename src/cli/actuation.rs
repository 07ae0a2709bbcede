//! Currents, angles and vectors as arguments.

use std::str::FromStr;

use clap::Args;
use magsteer_hal::HardwareDescription;

use super::exit::Failure;
use super::output;

/// What the coils and frames are set to.
#[derive(Debug, Args)]
pub struct ActuationArgs {
    /// Current of each coil, A, in the order of the configuration.
    #[arg(long, value_name = "A,A,...", value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    pub currents: Option<Vec<f64>>,
    /// Angle of each frame, deg, in the order of the configuration; all zero when left out.
    #[arg(long, value_name = "DEG,DEG,...", value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    pub angles_deg: Option<Vec<f64>>,
}

/// Currents in A and angles in rad, one for each coil and frame of a rig.
#[derive(Debug)]
pub struct ArrayActuation {
    pub currents: Vec<f64>,
    pub angles: Vec<f64>,
}

impl ActuationArgs {
    /// The currents and angles for a rig. What exceeds the rig's limits is noted, not refused: a model can be asked anything.
    ///
    /// # Errors
    /// Usage: not as many as the rig has coils or frames.
    pub fn for_rig(&self, rig: &HardwareDescription) -> anyhow::Result<ArrayActuation> {
        let coils = rig.coils.iter().map(|coil| coil.name.as_str());
        let frames = rig.frames.iter().map(|frame| frame.name.as_str());
        let currents = self.currents.clone().unwrap_or_default();
        expect_count("--currents", "coils", &currents, &coils.collect::<Vec<_>>())?;
        let angles_deg = self.angles_deg.clone().unwrap_or_else(|| vec![0.0; rig.frames.len()]);
        expect_count("--angles-deg", "frames", &angles_deg, &frames.collect::<Vec<_>>())?;
        for (coil, current) in rig.coils.iter().zip(&currents) {
            if current.abs() > coil.current_max {
                let limit = coil.current_max;
                output::note(format_args!(
                    "note: {current} A is beyond the limit of coil {}, {limit} A",
                    coil.name
                ));
            }
        }
        for (frame, angle_deg) in rig.frames.iter().zip(&angles_deg) {
            let (least, most) = (frame.angle_min.to_degrees(), frame.angle_max.to_degrees());
            // A limit converted to radians and back may have moved in its last digit.
            if *angle_deg < least - 1e-9 || *angle_deg > most + 1e-9 {
                let range = format_args!("{least} to {most} deg");
                output::note(format_args!(
                    "note: {angle_deg} deg is outside the range of frame {}, {range}",
                    frame.name
                ));
            }
        }
        Ok(ArrayActuation { currents, angles: angles_deg.iter().map(|angle| angle.to_radians()).collect() })
    }
}

fn expect_count(argument: &str, what: &str, values: &[f64], names: &[&str]) -> anyhow::Result<()> {
    if values.len() == names.len() {
        return Ok(());
    }
    let (found, count, names) = (values.len(), names.len(), names.join(", "));
    Err(Failure::usage(format_args!(
        "{argument}: {found} values: must be {count}, one for each of the {what} ({names})"
    )))
}

/// `N` finite numbers between commas.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let values: Vec<f64> = text.split(',').map(finite).collect::<Result<_, _>>()?;
        let count = values.len();
        values.try_into().map(Self).map_err(|_| format!("{count} numbers: must be {N}, between commas"))
    }
}

/// A number that is neither infinite nor "not a number".
pub fn finite(text: &str) -> Result<f64, String> {
    let value: f64 = text.trim().parse().map_err(|_| format!("{text:?}: must be a number"))?;
    if value.is_finite() { Ok(value) } else { Err(format!("{text:?}: must be finite")) }
}
