//! `magsteer tune identify`: modulus, moments, gains and clamp from measured equilibria.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use magsteer::config::{Config, Document};
use magsteer::control::identification::{
    Identified, IdentifyError, IdentifyRequest, Iteration, Noise, NoiseLevel, Priors, Sample, Stiffness,
    check_units, identify, may_be_radians, parse,
};
use magsteer::math::csv::Refusal;
use magsteer::rod::RodConfig;

use super::identify_answer::Answer;
use super::overlay;
use crate::cli::actuation::finite;
use crate::cli::exit::{Exit, Failure};
use crate::cli::overlay::simulates_itself;
use crate::cli::play::LiveLine;
use crate::cli::{data_file, output};

/// RMS angle of the nominal model beyond which directions, not parameters, are wrong.
const ANGLE_FAR: f64 = 45.0_f64.to_radians();
/// Chi-square per degree of freedom beyond which stated noise does not explain what is left.
const CHI_SQUARE_FAR: f64 = 2.0;
/// How often the progress line is drawn.
const DRAW_EVERY: Duration = Duration::from_millis(100);

/// Modulus, moments, coil gains and clamp from measured equilibria.
///
/// Each line of DATA is the rig at rest: i0_a, i1_a, ... (measured currents, A, in the order of FILE),
/// theta_NAME_deg for every frame, and for every magnet its tangent towards the tip NAME_tx, NAME_ty,
/// NAME_tz (unit, world) or its orientation NAME_qx to NAME_qw (body z is the tangent), and where measured
/// its centre NAME_x_m, NAME_y_m, NAME_z_m. Empty cells mean that a magnet was not seen.
///
/// Every parameter has a prior: how far the value in FILE is trusted. The estimate weighs it against the
/// data; what the data do not tell stays where it was and is named. Noise that is not stated is estimated
/// from what the fit leaves. "deviation" is the standard deviation for noise that is independent and alike
/// everywhere; "by samples" is that from how much the samples disagree, and greater where the model misses
/// something. An outlier is a reading (tangent or position of a magnet in a sample) that lies beyond
/// --outlier-sigma deviations of the noise; it still pulls, with no more than so many. Chi-square is the sum of
/// squares of what is left, in deviations: about the degrees of freedom when the model explains the data, and
/// the root of their ratio is how many times the noise is left. Outliers and a ratio above 1 mean that the model
/// misses something, not that the search failed: the verdict says which. Ends with 0; 1 when the search did not end; 65 when the data are refused, with line, column,
/// value and what would be right.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    magsteer tune excite config/bigmag-planar.toml --out data.csv\n  \
    magsteer tune identify config/bigmag-planar.toml data.csv --out tuned.toml\n  \
    magsteer check tuned.toml\n  \
    magsteer tune identify rig.toml a.csv b.csv --prior-base-mm 1 --prior-base-deg 1 --noise-orientation-deg 0.2 --json\n\n\
    --out writes a file that extends FILE, states where its numbers come from and can stand in its place. A prior of 0\n\
    holds its parameters. JSON: parameters[].{name, unit, nominal, estimate, standard_deviation,\n\
    standard_deviation_between_samples, moved_prior_sigma, posterior_over_prior}, noise, rms, chi_square, degrees_of_freedom, residual_over_noise,\n\
    readings, outliers, undetermined, correlation, verdict.")]
pub struct Identify {
    /// Configuration of the rig (TOML), with its nominal parameters.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Measured equilibria (CSV), one file or more.
    #[arg(value_name = "DATA.csv", required = true)]
    data: Vec<PathBuf>,
    #[command(flatten)]
    priors: PriorArgs,
    /// A factor on the modulus for each material, in place of one for all sections.
    #[arg(long)]
    per_material: bool,
    /// Standard deviation of each of the two tilts of a measured tangent, deg; estimated when left out.
    #[arg(long, value_name = "DEG", value_parser = positive)]
    noise_orientation_deg: Option<f64>,
    /// Standard deviation of each measured coordinate, mm; estimated when left out.
    #[arg(long, value_name = "MM", value_parser = positive)]
    noise_position_mm: Option<f64>,
    /// Noise deviations beyond which a measurement is an outlier; it pulls with no more than so many.
    #[arg(long, value_name = "N", default_value = "4", value_parser = positive)]
    outlier_sigma: f64,
    /// Write a configuration that extends FILE with the estimates.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// How far nominal values are trusted: standard deviations, 0 to hold the value.
#[derive(Debug, Args)]
struct PriorArgs {
    /// Of the elastic modulus, percent; 0 holds it, as with every prior.
    #[arg(long, value_name = "PERCENT", default_value = "20", value_parser = not_negative)]
    prior_modulus_percent: f64,
    /// Of each magnet's moment, percent.
    #[arg(long, value_name = "PERCENT", default_value = "10", value_parser = not_negative)]
    prior_moment_percent: f64,
    /// Of each coil's field per ampere, percent.
    #[arg(long, value_name = "PERCENT", default_value = "3", value_parser = not_negative)]
    prior_gain_percent: f64,
    /// Of each coordinate of the clamp, mm. Held unless given: a clamp beside the plane in which the coils
    /// lie makes the model see directions out of the plane that the coils hardly move.
    #[arg(long, value_name = "MM", default_value = "0", value_parser = not_negative)]
    prior_base_mm: f64,
    /// Of the clamp's turn about each world axis, deg. Held unless given.
    #[arg(long, value_name = "DEG", default_value = "0", value_parser = not_negative)]
    prior_base_deg: f64,
}

fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 { Ok(value) } else { Err("must be above 0".to_owned()) }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value >= 0.0 { Ok(value) } else { Err("must be at least 0".to_owned()) }
}

/// What was measured, and on what.
pub(super) struct Subject {
    /// The configuration's name, as given.
    pub config_file: PathBuf,
    /// The rig with its nominal parameters.
    pub config: Config,
    /// It has a simulated plant, built as it describes.
    pub simulates_itself: bool,
    /// Files, as given, with their SHA-256.
    pub data: Vec<(PathBuf, String)>,
    /// All samples, file by file.
    pub samples: Vec<Sample>,
    /// Index of the file of each sample.
    pub file_of: Vec<usize>,
    /// Lines of the headers of the files.
    header_lines: Vec<usize>,
}

impl Subject {
    /// File and line of a sample.
    pub fn place(&self, sample: usize) -> String {
        format!("{}:{}", self.data[self.file_of[sample]].0.display(), self.samples[sample].line)
    }
}

impl Identify {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let (document, config) = Config::load(&self.file)?;
        document.require("rod", &config.manipulator)?;
        let rod: RodConfig = document.section("rod")?;
        self.check_out(&document)?;
        let subject = self.subject(config, simulates_itself(&document))?;
        let request = self.request();
        let found = self.search(&subject, &rod, &request)?;
        self.warn(&subject, &found);
        if let Some(out) = &self.out {
            data_file::create(out, overlay::text(&subject, &found, &request, out).as_bytes())?;
            // What cannot be used must not lie about as if it could.
            Config::load(out)?;
        }
        let answer = Answer::new(&subject, &found, &request, self.out.as_deref());
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(answer.table())?;
        }
        Ok(if found.converged { Exit::Success } else { Exit::No })
    }

    fn request(&self) -> IdentifyRequest {
        let level = |stated: Option<f64>| stated.map_or(NoiseLevel::Estimated, NoiseLevel::Stated);
        IdentifyRequest {
            priors: Priors {
                modulus: self.priors.prior_modulus_percent * 1e-2,
                moment: self.priors.prior_moment_percent * 1e-2,
                gain: self.priors.prior_gain_percent * 1e-2,
                base_position: self.priors.prior_base_mm * 1e-3,
                base_rotation: self.priors.prior_base_deg.to_radians(),
            },
            stiffness: if self.per_material { Stiffness::PerMaterial } else { Stiffness::Common },
            noise: Noise {
                orientation: level(self.noise_orientation_deg.map(f64::to_radians)),
                position: level(self.noise_position_mm.map(|millimetres| millimetres * 1e-3)),
            },
            outlier_sigma: self.outlier_sigma,
        }
    }

    /// An overlay must not take the place of a file that it extends.
    fn check_out(&self, document: &Document) -> anyhow::Result<()> {
        let Some(out) = &self.out else { return Ok(()) };
        let real = |path: &Path| path.canonicalize().ok();
        let taken =
            document.files().find(|file| real(Path::new(file)).is_some_and(|file| real(out) == Some(file)));
        taken.map_or(Ok(()), |file| {
            Err(Failure::usage(format_args!(
                "--out {}: must be another file than {file}, which it extends",
                out.display()
            )))
        })
    }

    /// Reads and checks the data.
    fn subject(&self, config: Config, simulates_itself: bool) -> anyhow::Result<Subject> {
        let rig = config.description.clone();
        let mut subject = Subject {
            config_file: self.file.clone(),
            config,
            simulates_itself,
            data: Vec::new(),
            samples: Vec::new(),
            file_of: Vec::new(),
            header_lines: Vec::new(),
        };
        for (index, path) in self.data.iter().enumerate() {
            let bytes = data_file::read(path)?;
            let refuse = |refusal: Refusal| data_file::refuse(path, &refusal);
            let read = parse(&bytes, &rig).map_err(refuse)?;
            if !read.ends_with_line_end {
                data_file::note_cut(path);
            }
            check_units(&read, &rig).map_err(refuse)?;
            if may_be_radians(&read, &rig) {
                output::note(format_args!(
                    "note: {}: every angle lies within 3.2: must be in degrees, as the header says: radians?",
                    path.display()
                ));
            }
            subject.data.push((path.clone(), data_file::sha256(&bytes)));
            subject.file_of.extend(std::iter::repeat_n(index, read.samples.len()));
            subject.header_lines.push(read.header_line);
            subject.samples.extend(read.samples);
        }
        Ok(subject)
    }

    fn search(
        &self,
        subject: &Subject,
        rod: &RodConfig,
        request: &IdentifyRequest,
    ) -> anyhow::Result<Identified> {
        let mut line = std::io::stderr().is_terminal().then(LiveLine::new);
        let tell = |iteration: &Iteration| {
            let Some(line) = &mut line else { return };
            let text = || format!("step {}, objective {:.1}", iteration.number, iteration.objective);
            line.draw(text, DRAW_EVERY);
        };
        let found = identify(&subject.config.hardware, rod, &subject.samples, request, tell);
        if let Some(line) = &mut line {
            line.end();
        }
        found.map_err(|error| self.explain(&error, subject))
    }

    /// Where the data should be mended when they give no parameters.
    fn explain(&self, error: &IdentifyError, subject: &Subject) -> anyhow::Error {
        let refuse = |path: &Path, line: usize, value: String, expected: String| {
            data_file::refuse(path, &Refusal::new(line, "rows", value, expected))
        };
        let last = subject.data.len() - 1;
        match error {
            IdentifyError::TooFew { samples, equations, parameters, least } => refuse(
                &subject.data[last].0,
                subject.header_lines[last],
                format!("{samples}, which give {equations} equations for {parameters} parameters"),
                format!("at least {least}, two equations for every parameter"),
            ),
            IdentifyError::NoEquilibrium { lost, samples, first } => refuse(
                &subject.data[subject.file_of[*first]].0,
                subject.samples[*first].line,
                format!("the model finds no stable equilibrium for this and {} more of {samples}", lost - 1),
                "currents and angles that the rod bears: are their signs and units those of the configuration?"
                    .to_owned(),
            ),
            IdentifyError::NothingFree => Failure::usage("every --prior is 0: at least one must be above"),
            IdentifyError::Tables(_) => Failure::with(Exit::Software, anyhow!("{error}")),
        }
    }

    fn warn(&self, subject: &Subject, found: &Identified) {
        if found.rms_before.angle.is_some_and(|angle| angle > ANGLE_FAR) {
            output::note(
                "note: measured tangents point far from where the nominal model has them: are they towards the tip, in \
                the world's axes, and the signs of currents and moments those of the configuration?",
            );
        }
        let ratio = found.chi_square / found.degrees_of_freedom.max(1.0);
        let is_stated = self.noise_orientation_deg.is_some() || self.noise_position_mm.is_some();
        if is_stated && ratio > CHI_SQUARE_FAR {
            output::note(format_args!(
                "note: what is left is {:.1} times the stated noise: the noise is greater, or the model misses \
                something; the deviations below are too small by as much",
                ratio.sqrt()
            ));
        }
        for sample in &found.lost {
            output::note(format_args!(
                "note: {}: the model finds no stable equilibrium: not used",
                subject.place(*sample)
            ));
        }
        if !found.converged {
            output::note("note: the search did not end in a minimum: do not trust the estimates");
        }
    }
}
