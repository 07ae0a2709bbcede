//! What `magsteer tune identify` found, as JSON and as a table.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use magsteer::control::identification::{
    Estimate, Identified, IdentifyRequest, NoiseLevel, Parameter, Quantity, Rms,
};
use magsteer_hal::config::{HardwareConfig, PartConfig};
use serde::Serialize;

use super::identify::Subject;
use super::verdict::Evidence;

/// Outliers that the table names.
const OUTLIERS_SHOWN: usize = 5;

/// The stable keys are those named in the help.
#[derive(Serialize)]
pub(super) struct Answer {
    converged: bool,
    iterations: usize,
    samples: usize,
    parameters: Vec<ParameterAnswer>,
    /// Of the estimates, in the order of `parameters`.
    correlation: Vec<Vec<f64>>,
    noise: NoiseAnswer,
    rms: RmsAnswer,
    chi_square: f64,
    degrees_of_freedom: f64,
    /// Root of chi-square over the degrees of freedom: 1 when the model explains the data.
    residual_over_noise: f64,
    /// Tangents and positions that were measured.
    readings: usize,
    outliers: Vec<OutlierAnswer>,
    /// Samples for which the model has no stable equilibrium, by file and line.
    lost: Vec<String>,
    undetermined: Vec<UndeterminedAnswer>,
    data: Vec<DataAnswer>,
    files: Vec<PathBuf>,
    /// What it came to, in words, a line each.
    verdict: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(super) struct ParameterAnswer {
    pub name: String,
    pub unit: &'static str,
    pub nominal: f64,
    pub estimate: f64,
    pub standard_deviation: f64,
    /// From how much the samples disagree.
    pub standard_deviation_between_samples: f64,
    /// By how many prior deviations it moved.
    pub moved_prior_sigma: f64,
    /// 1 when the data said nothing.
    pub posterior_over_prior: f64,
}

#[derive(Serialize)]
struct NoiseAnswer {
    orientation_deg: f64,
    orientation_estimated: bool,
    position_mm: f64,
    position_estimated: bool,
}

#[derive(Serialize)]
struct RmsAnswer {
    angle_before_deg: Option<f64>,
    angle_after_deg: Option<f64>,
    distance_before_mm: Option<f64>,
    distance_after_mm: Option<f64>,
}

#[derive(Serialize)]
struct OutlierAnswer {
    place: String,
    magnet: String,
    quantity: &'static str,
    sigma: f64,
}

#[derive(Serialize)]
struct UndeterminedAnswer {
    posterior_over_prior: f64,
    /// Parameters with their shares, in prior deviations.
    parts: Vec<(String, f64)>,
}

#[derive(Serialize)]
struct DataAnswer {
    file: PathBuf,
    sha256: String,
}

impl Answer {
    pub fn new(subject: &Subject, found: &Identified, request: &IdentifyRequest, out: Option<&Path>) -> Self {
        let name = |index: usize| found.estimates[index].name.clone();
        let magnets: Vec<&str> =
            subject.config.description.magnets().map(|magnet| magnet.name.as_str()).collect();
        let outlier = |outlier: &magsteer::control::identification::Outlier| OutlierAnswer {
            place: subject.place(outlier.sample),
            magnet: magnets[outlier.magnet].to_owned(),
            quantity: match outlier.quantity {
                Quantity::Tangent => "tangent",
                Quantity::Position => "position",
            },
            sigma: outlier.sigma,
        };
        let [orientation, position] = found.noise;
        let is_estimated = |level: NoiseLevel| level == NoiseLevel::Estimated;
        let (before, after) = (found.rms_before, found.rms_after);
        let degrees = |rms: Rms| rms.angle.map(f64::to_degrees);
        let millimetres = |rms: Rms| rms.distance.map(|distance| distance * 1e3);
        let mut answer = Self {
            converged: found.converged,
            iterations: found.iterations,
            samples: subject.samples.len(),
            parameters: parameters(subject, found),
            correlation: correlation(found),
            noise: NoiseAnswer {
                orientation_deg: orientation.to_degrees(),
                orientation_estimated: is_estimated(request.noise.orientation),
                position_mm: position * 1e3,
                position_estimated: is_estimated(request.noise.position),
            },
            rms: RmsAnswer {
                angle_before_deg: degrees(before),
                angle_after_deg: degrees(after),
                distance_before_mm: millimetres(before),
                distance_after_mm: millimetres(after),
            },
            chi_square: found.chi_square,
            degrees_of_freedom: found.degrees_of_freedom,
            residual_over_noise: 0.0,
            readings: readings(subject, found),
            outliers: found.outliers.iter().map(outlier).collect(),
            lost: found.lost.iter().map(|sample| subject.place(*sample)).collect(),
            undetermined: found
                .undetermined
                .iter()
                .map(|direction| UndeterminedAnswer {
                    posterior_over_prior: direction.ratio,
                    parts: direction.parts.iter().map(|(index, share)| (name(*index), *share)).collect(),
                })
                .collect(),
            data: subject
                .data
                .iter()
                .map(|(file, sha256)| DataAnswer { file: file.clone(), sha256: sha256.clone() })
                .collect(),
            files: out.map(Path::to_path_buf).into_iter().collect(),
            verdict: Vec::new(),
        };
        let evidence = answer.evidence(found, request);
        (answer.residual_over_noise, answer.verdict) = (evidence.residual_over_noise(), evidence.verdict());
        answer
    }

    fn evidence(&self, found: &Identified, request: &IdentifyRequest) -> Evidence<'_> {
        let samples: BTreeSet<usize> = found.outliers.iter().map(|outlier| outlier.sample).collect();
        Evidence {
            converged: self.converged,
            parameters: &self.parameters,
            angle_deg: [self.rms.angle_before_deg, self.rms.angle_after_deg],
            chi_square: self.chi_square,
            degrees_of_freedom: self.degrees_of_freedom,
            is_noise_estimated: self.noise.orientation_estimated && self.noise.position_estimated,
            readings: self.readings,
            outliers: self.outliers.len(),
            outlier_samples: samples.len(),
            outlier_sigma: request.outlier_sigma,
            undetermined: self.undetermined.iter().map(|direction| direction.parts.as_slice()).collect(),
        }
    }

    /// The same for people.
    pub fn table(&self) -> String {
        let mut text =
            format!("{} samples, {} steps\n\n{}", self.samples, self.iterations, self.parameter_table());
        text += &format!("\n{}", self.residuals());
        for direction in &self.undetermined {
            let parts: Vec<String> =
                direction.parts.iter().map(|(name, share)| format!("{share:+.2} {name}")).collect();
            text += &format!(
                "not told by the data ({:.0} % of the prior's deviation is left): {}\n",
                100.0 * direction.posterior_over_prior,
                parts.join(", ")
            );
        }
        if !self.outliers.is_empty() {
            text += &format!("{} outliers of {} readings", self.outliers.len(), self.readings);
            for outlier in self.outliers.iter().take(OUTLIERS_SHOWN) {
                text += &format!(
                    "; {}: {} of {} by {:.1} sigma",
                    outlier.place, outlier.quantity, outlier.magnet, outlier.sigma
                );
            }
            text += "\n";
        }
        for file in &self.files {
            text += &format!("written: {}\n", file.display());
        }
        for line in &self.verdict {
            text += &format!("{line}\n");
        }
        text
    }

    fn parameter_table(&self) -> String {
        let width = self.parameters.iter().map(|parameter| parameter.name.len()).max().unwrap_or(0);
        let mut text = format!(
            "{:width$} {:>12} {:>12} {:>12} {:>12}          moved, prior sigma   posterior/prior\n",
            "parameter", "nominal", "estimate", "deviation", "by samples"
        );
        for parameter in &self.parameters {
            text += &format!(
                "{:width$} {:>12.5} {:>12.5} {:>12.5} {:>12.5} {:<9} {:>17.2} {:>17.3}\n",
                parameter.name,
                parameter.nominal,
                parameter.estimate,
                parameter.standard_deviation,
                parameter.standard_deviation_between_samples,
                parameter.unit,
                parameter.moved_prior_sigma,
                parameter.posterior_over_prior
            );
        }
        text
    }

    fn residuals(&self) -> String {
        let shown = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        let how = |is_estimated| if is_estimated { "estimated" } else { "stated" };
        let NoiseAnswer { orientation_deg, orientation_estimated, position_mm, position_estimated } =
            self.noise;
        format!(
            "RMS of tangents {} -> {} deg, of positions {} -> {} mm\n\
             noise of a tilt {orientation_deg:.3} deg ({}), of a coordinate {position_mm:.3} mm ({})\n\
             chi-square {:.1} at {:.1} degrees of freedom\n",
            shown(self.rms.angle_before_deg),
            shown(self.rms.angle_after_deg),
            shown(self.rms.distance_before_mm),
            shown(self.rms.distance_after_mm),
            how(orientation_estimated),
            how(position_estimated),
            self.chi_square,
            self.degrees_of_freedom
        )
    }
}

/// Tangents and positions of magnets that were seen, in the samples that were used.
fn readings(subject: &Subject, found: &Identified) -> usize {
    let used = subject.samples.iter().enumerate().filter(|(index, _)| !found.lost.contains(index));
    let magnets = used.flat_map(|(_, sample)| sample.magnets.iter().flatten());
    magnets.map(|reading| 1 + usize::from(reading.position.is_some())).sum()
}

/// Every parameter in the units that people write.
pub(super) fn parameters(subject: &Subject, found: &Identified) -> Vec<ParameterAnswer> {
    let nominal = &subject.config.hardware;
    found.estimates.iter().map(|estimate| parameter(nominal, estimate)).collect()
}

fn parameter(nominal: &HardwareConfig, estimate: &Estimate) -> ParameterAnswer {
    // Deviations in the units of `scale`.
    let answer = |unit, nominal: f64, value: f64, scale: f64| ParameterAnswer {
        name: estimate.name.clone(),
        unit,
        nominal,
        estimate: value,
        standard_deviation: estimate.deviation * scale,
        standard_deviation_between_samples: estimate.deviation_between_samples * scale,
        moved_prior_sigma: estimate.moved(),
        posterior_over_prior: estimate.ratio(),
    };
    let scaled = |unit, nominal: f64| {
        let value = nominal * estimate.value.exp();
        answer(unit, nominal, value, value)
    };
    let shifted =
        |unit, nominal: f64, scale: f64| answer(unit, nominal, nominal + estimate.value * scale, scale);
    let manipulator = &nominal.manipulator;
    match estimate.parameter {
        Parameter::Modulus { .. } => match only_modulus(nominal, &estimate.name) {
            Some(modulus) => scaled("MPa", modulus),
            None => scaled("(factor)", 1.0),
        },
        Parameter::Moment { magnet } => {
            let magnets = manipulator.parts.iter().filter_map(|part| match part {
                PartConfig::Magnet(magnet) => Some(magnet.moment_body_a_m2),
                PartConfig::Section(_) | PartConfig::StiffnessSection(_) => None,
            });
            let moment = magnets.into_iter().nth(magnet).unwrap_or_default();
            scaled("A m^2", moment.iter().map(|component| component * component).sum::<f64>().sqrt())
        }
        Parameter::Gain { coil } => {
            scaled("(factor)", nominal.coils.get(coil).and_then(|coil| coil.gain).unwrap_or(1.0))
        }
        Parameter::BasePosition { axis } => shifted("mm", manipulator.base_position_mm[axis], 1e3),
        Parameter::BaseRotation { .. } => shifted("deg", 0.0, 1.0_f64.to_degrees()),
    }
}

/// The modulus that a factor acts on, where it acts on a single one.
fn only_modulus(hardware: &HardwareConfig, name: &str) -> Option<f64> {
    let materials = &hardware.manipulator.materials;
    let mut used: Vec<&str> = Vec::new();
    for part in &hardware.manipulator.parts {
        match part {
            PartConfig::Section(section) => used.push(&section.material),
            PartConfig::StiffnessSection(_) => used.push(""),
            PartConfig::Magnet(_) => {}
        }
    }
    used.sort_unstable();
    used.dedup();
    let named = used.iter().find(|material| name == format!("modulus {material}")).copied();
    let only = match used.as_slice() {
        [only] => Some(*only),
        _ => None,
    };
    materials.get(named.or(only)?).map(|material| material.young_modulus_mpa)
}

fn correlation(found: &Identified) -> Vec<Vec<f64>> {
    let covariance = &found.covariance;
    let count = covariance.nrows();
    let of = |row: usize, column: usize| {
        covariance[(row, column)] / (covariance[(row, row)] * covariance[(column, column)]).sqrt()
    };
    (0..count).map(|row| (0..count).map(|column| of(row, column)).collect()).collect()
}
