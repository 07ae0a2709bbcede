//! `magsteer field fit`: coefficients of the coils from measurements of their field.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use magsteer::config::Config;
use magsteer::magnetics::fit::{
    Expectation, FieldFit, FitError, FitRequest, Layout, OrderChoice, Readings, Refusal, check_units, fit,
    parse,
};
use magsteer::magnetics::{CoilArray, CoilPose};
use magsteer_hal::config::ORDER_MAX;
use nalgebra::Vector3;

use super::coil_types::{self, Names};
use super::fit_answer::Answer;
use crate::cli::actuation::{ActuationArgs, finite};
use crate::cli::data_file;
use crate::cli::exit::{Exit, Failure};
use crate::cli::output;
use crate::cli::overlay::{path_from, simulates_itself};

/// A fit that leaves more than this part of the field is no model of it.
const LEFT_MAX: f64 = 0.2;

/// Coefficients of the coils' field from measurements.
///
/// Reads one coil's grid (header x_mm,y_mm,z_mm,current_a,bx_mt,by_mt,bz_mt; the coil's frame: x along its
/// axis, its face at 0) or the calibration of an array (px,py,pz,i0,...,iN,bx,by,bz; m, A, T; world; coils in
/// the order of `--config`). All orders from 1 to 10 are fitted and held against readings that were left out.
/// Ends with 0; 65 when the data are refused, with line, column, value and what would be right.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  magsteer field fit tests/reference/coil_grid.csv\n  \
    magsteer field fit grid.csv --config config/bigmag-planar.toml --coil-type air --out my-rig.toml --picture fit.png\n  \
    magsteer field fit calibration.csv --config config/bigmag-planar.toml --out calibrated.toml --json\n\n\
    JSON: order, coefficients (per ampere, SI), origin_m, rms_norm_mt, orders[].{order, rms_norm_mt, holdout_rms_norm_mt};\n\
    for an array, coefficients and origin_m have one entry a coil. coils[] has each coil by name.")]
pub struct Fit {
    /// Measurements (CSV).
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    /// Rig whose coils were measured. An array's file needs it; for one coil it says what `--out` extends.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Angle of each frame while an array was measured, deg, in the order of the configuration; all zero when
    /// left out.
    #[arg(long, value_name = "DEG,DEG,...", value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    angles_deg: Option<Vec<f64>>,
    /// Number of terms, 1 to 10, or auto: the lowest that foretells left-out readings as well as the best
    /// one, to two standard errors.
    #[arg(long, value_name = "N|auto", default_value = "auto")]
    order: Order,
    /// Also fit where on its axis each expansion point is.
    #[arg(long)]
    fit_origin: bool,
    /// Greatest relative error of the field for which valid_from_x_mm is given, percent.
    #[arg(long, value_name = "PERCENT", default_value = "5", value_parser = percent)]
    valid_within_percent: f64,
    /// Name of the coil type in `--out`, when one coil was measured.
    #[arg(long, value_name = "NAME")]
    coil_type: Option<String>,
    /// Write a TOML file with the coefficients: by itself with `--config`, else to be pasted or extended.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw measurements, dipole and chosen order, and the error of each order (PNG).
    #[cfg(feature = "figures")]
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// `auto` or a number.
#[derive(Debug, Clone, Copy)]
struct Order(OrderChoice);

impl FromStr for Order {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self(OrderChoice::Auto));
        }
        let order = text.parse().ok().filter(|order| (1..=ORDER_MAX).contains(order));
        let order = order.ok_or_else(|| format!("must be auto or a whole number from 1 to {ORDER_MAX}"))?;
        Ok(Self(OrderChoice::Exactly(order)))
    }
}

fn percent(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 && value <= 100.0 { Ok(value) } else { Err("must be above 0 and at most 100".to_owned()) }
}

/// What was measured, and on what.
pub(super) struct Subject {
    /// The file's name, as given.
    pub file: String,
    /// Its SHA-256, lower-case hexadecimal.
    pub sha256: String,
    /// What it holds.
    pub readings: Readings,
    /// The coils at the frame angles of the measurement, or one coil at home.
    pub poses: Vec<CoilPose>,
    /// Names of the coils, for people.
    pub names: Vec<String>,
    /// The rig, when one was named.
    pub config: Option<Config>,
    /// It has a simulated plant, built as it describes.
    pub simulates_itself: bool,
}

impl Fit {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let subject = self.subject()?;
        let names = self.out.as_deref().map(|out| self.names(out, &subject)).transpose()?;
        let request = FitRequest {
            order: self.order.0,
            fit_origin: self.fit_origin,
            share: self.valid_within_percent / 100.0,
        };
        let found = fit(&subject.poses, &subject.readings.readings, &request)
            .map_err(|error| self.refuse(explain(&error, &subject)))?;
        self.warn(&subject, &found);
        let mut files = Vec::new();
        if let (Some(out), Some(names)) = (&self.out, &names) {
            let text = coil_types::text(&subject, &found, names, &request)
                .map_err(|words| self.refuse(Refusal { line: subject.readings.header_line, ..words }))?;
            data_file::create(out, text.as_bytes())?;
            files.push(out.clone());
        }
        #[cfg(feature = "figures")]
        if let Some(path) = &self.picture {
            data_file::create(path, &super::picture::draw(&subject, &found)?)?;
            files.push(path.clone());
        }
        self.print(&subject, &found, &request, &files)?;
        Ok(Exit::Success)
    }

    /// Says so when the coils, as placed, do not explain what was measured.
    fn warn(&self, subject: &Subject, found: &FieldFit) {
        let readings = &subject.readings.readings;
        let squares: f64 = readings.iter().map(|reading| reading.field.norm_squared()).sum();
        let left = found.rms_norm / (squares / readings.len() as f64).sqrt();
        if left > LEFT_MAX {
            output::note(format_args!(
                "note: {}: the fit leaves {:.0} % of the measured field: are the coils, their frames' angles, the axes and \
                signs those of the measurement?",
                self.data.display(),
                100.0 * left
            ));
        }
    }

    /// Reads the data and the rig.
    fn subject(&self) -> anyhow::Result<Subject> {
        let file = self.data.display().to_string();
        let bytes = data_file::read(&self.data)?;
        let readings = parse(&bytes).map_err(|refusal| self.refuse(refusal))?;
        if !readings.ends_with_line_end {
            data_file::note_cut(&self.data);
        }
        let loaded = self.config.as_deref().map(Config::load).transpose()?;
        let simulates_itself = loaded.as_ref().is_some_and(|(document, _)| simulates_itself(document));
        let config = loaded.map(|(_, config)| config);
        let (poses, names) = match (readings.layout, &config) {
            (Layout::OneCoil, _) => self.one_coil(&readings)?,
            (Layout::Array, Some(config)) => self.array(&readings, config)?,
            (Layout::Array, None) => {
                let message = format!("{file} is of an array: `--config FILE` must say where its coils are");
                return Err(Failure::usage(message));
            }
        };
        let sha256 = data_file::sha256(&bytes);
        Ok(Subject { file, sha256, readings, poses, names, config, simulates_itself })
    }

    fn one_coil(&self, readings: &Readings) -> anyhow::Result<(Vec<CoilPose>, Vec<String>)> {
        if self.angles_deg.is_some() {
            return Err(Failure::usage(
                "--angles-deg: must be left out: one coil is measured in its own frame",
            ));
        }
        check_units(readings, &Expectation::Dipole).map_err(|refusal| self.refuse(refusal))?;
        let home = CoilPose { origin: Vector3::zeros(), axis: Vector3::x() };
        Ok((vec![home], vec![self.coil_type.clone().unwrap_or_else(|| "coil".to_owned())]))
    }

    fn array(&self, readings: &Readings, config: &Config) -> anyhow::Result<(Vec<CoilPose>, Vec<String>)> {
        if let Some(name) = &self.coil_type {
            let message = format!(
                "--coil-type {name}: must be left out: each coil of an array gets a type by its name"
            );
            return Err(Failure::usage(message));
        }
        let rig = &config.description;
        let names: Vec<String> = rig.coils.iter().map(|coil| coil.name.clone()).collect();
        if readings.coil_count() != names.len() {
            return Err(self.refuse(Refusal {
                line: readings.header_line,
                column: readings.current_column(readings.coil_count() - 1),
                value: format!("the last of {} currents", readings.coil_count()),
                expected: format!(
                    "i{}, one current a coil ({})",
                    names.len().saturating_sub(1),
                    names.join(", ")
                ),
            }));
        }
        let angles =
            ActuationArgs { currents: Some(vec![0.0; names.len()]), angles_deg: self.angles_deg.clone() };
        let array = CoilArray::new(rig).posed(&angles.for_rig(rig)?.angles);
        let expectation = Expectation::Array {
            array: &array,
            center: rig.workspace.center.into(),
            radius: rig.workspace.radius,
        };
        check_units(readings, &expectation).map_err(|refusal| self.refuse(refusal))?;
        Ok(((0..names.len()).map(|coil| array.coil_pose(coil)).collect(), names))
    }

    /// What the coil types in the file to be written are called.
    fn names(&self, out: &Path, subject: &Subject) -> anyhow::Result<Names> {
        let extends = self.config.as_deref().map(|config| path_from(out, config));
        if subject.readings.layout == Layout::Array {
            return Ok(Names { extends, coil_types: subject.names.clone() });
        }
        let Some(config) = &subject.config else {
            let name = self.coil_type.clone().unwrap_or_else(|| "fitted".to_owned());
            return Ok(Names { extends, coil_types: vec![name] });
        };
        let known: Vec<&String> = config.hardware.coil_types.keys().collect();
        let listed = known.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ");
        let name = match (&self.coil_type, known.as_slice()) {
            (Some(name), known) if known.contains(&name) => name.clone(),
            (Some(name), _) => {
                let message =
                    format!("--coil-type {name}: must be a coil type of the configuration ({listed})");
                return Err(Failure::usage(message));
            }
            (None, [only]) => (*only).clone(),
            (None, _) => {
                let message = format!("--coil-type: must say which coil type was measured ({listed})");
                return Err(Failure::usage(message));
            }
        };
        Ok(Names { extends, coil_types: vec![name] })
    }

    fn print(
        &self,
        subject: &Subject,
        found: &FieldFit,
        request: &FitRequest,
        files: &[PathBuf],
    ) -> anyhow::Result<()> {
        let answer = Answer::new(subject, found, files);
        if self.json {
            output::json(&answer)
        } else {
            Ok(output::result(answer.table(subject, found, request))?)
        }
    }

    fn refuse(&self, refusal: Refusal) -> anyhow::Error {
        data_file::refuse(&self.data, &refusal)
    }
}

/// Where in the file a fit that failed should be mended.
fn explain(error: &FitError, subject: &Subject) -> Refusal {
    let name = |coil: usize| match subject.readings.layout {
        Layout::OneCoil => "the coil".to_owned(),
        Layout::Array => format!("coil {}", subject.names[coil]),
    };
    let spread =
        "spread over more places (in an array, with currents that change one by one), or the order lower";
    let rows = || "rows".to_owned();
    let (column, value, expected) = match error {
        FitError::TooFew { order, readings, equations, unknowns, least } => (
            rows(),
            format!(
                "{readings}, which give {equations} equations for the {unknowns} unknowns of order {order}"
            ),
            format!("at least {least}"),
        ),
        FitError::Undriven { coil } => (
            subject.readings.current_column(*coil),
            "0 in every row".to_owned(),
            format!("other than 0 in some rows: without current {} cannot be fitted", name(*coil)),
        ),
        FitError::Undetermined { order, coil, term } => (
            rows(),
            format!("do not determine a{term} of {} at order {order}", name(*coil)),
            spread.to_owned(),
        ),
        FitError::OriginUndetermined { order, coil, reason } => (
            rows(),
            format!("do not determine the origin of {} at order {order} ({reason})", name(*coil)),
            spread.to_owned(),
        ),
    };
    Refusal { line: subject.readings.header_line, column, value, expected }
}
