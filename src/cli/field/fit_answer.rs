//! What `magsteer field fit` found, as JSON and as tables.

use std::fmt::Write;
use std::path::PathBuf;

use magsteer::magnetics::fit::{CoilFit, FieldFit, FitRequest, Layout, OrderChoice, OrderReport};
use serde::Serialize;

use super::fit::Subject;

/// The stable keys are `order`, `coefficients`, `origin_m`, `rms_norm_mt` and `orders` with `order`,
/// `rms_norm_mt` and `holdout_rms_norm_mt`.
#[derive(Serialize)]
pub(super) struct Answer {
    order: usize,
    /// Per ampere, T m^(k+2) / A, k = 1 first; for an array one list a coil.
    coefficients: PerCoil<Vec<f64>>,
    /// Local x of the expansion point from where the pose has it.
    origin_m: PerCoil<f64>,
    rms_norm_mt: f64,
    orders: Vec<OrderAnswer>,
    noise_mt: f64,
    covariance_condition: f64,
    coils: Vec<CoilAnswer>,
    regions: Vec<RegionAnswer>,
    undetermined: Vec<UndeterminedAnswer>,
    data: DataAnswer,
    files: Vec<PathBuf>,
}

/// One value for one coil, a list for an array.
#[derive(Serialize)]
#[serde(untagged)]
enum PerCoil<T> {
    One(T),
    Each(Vec<T>),
}

#[derive(Serialize)]
struct OrderAnswer {
    order: usize,
    rms_norm_mt: f64,
    /// Of readings left out in ten folds; null where that leaves too few.
    holdout_rms_norm_mt: Option<f64>,
    /// Of each of `regions`, left out as a whole.
    region_rms_norms_mt: Vec<Option<f64>>,
    rms_mt: [f64; 3],
    largest_mt: f64,
    origins_m: Vec<f64>,
    condition: f64,
}

#[derive(Serialize)]
struct CoilAnswer {
    name: String,
    coefficients: Vec<f64>,
    standard_deviations: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    origin_m: f64,
    origin_standard_deviation_m: Option<f64>,
    /// From the expansion point along the axis.
    valid_from_x_mm: f64,
    turns_over_x_mm: Option<f64>,
    orders_differ_x_mm: Option<f64>,
    misfit_x_mm: Option<f64>,
    nearest_reading_x_mm: f64,
}

#[derive(Serialize)]
struct RegionAnswer {
    name: &'static str,
    readings: usize,
}

#[derive(Serialize)]
struct UndeterminedAnswer {
    order: usize,
    reason: String,
}

#[derive(Serialize)]
struct DataAnswer {
    file: String,
    sha256: String,
    readings: usize,
    layout: &'static str,
}

impl Answer {
    pub fn new(subject: &Subject, found: &FieldFit, files: &[PathBuf]) -> Self {
        let layout = subject.readings.layout;
        Self {
            order: found.order,
            coefficients: per_coil(layout, found, |coil| coil.coefficients.clone()),
            origin_m: per_coil(layout, found, |coil| coil.origin),
            rms_norm_mt: found.rms_norm * 1e3,
            orders: found.orders.iter().map(OrderAnswer::new).collect(),
            noise_mt: found.noise * 1e3,
            covariance_condition: found.covariance_condition,
            coils: subject
                .names
                .iter()
                .zip(&found.coils)
                .map(|(name, coil)| CoilAnswer::new(name, coil))
                .collect(),
            regions: found
                .regions
                .iter()
                .map(|region| RegionAnswer { name: region.name, readings: region.readings })
                .collect(),
            undetermined: found
                .undetermined
                .iter()
                .map(|(order, reason)| UndeterminedAnswer { order: *order, reason: reason.to_string() })
                .collect(),
            data: DataAnswer {
                file: subject.file.clone(),
                sha256: subject.sha256.clone(),
                readings: subject.readings.readings.len(),
                layout: match layout {
                    Layout::OneCoil => "one-coil",
                    Layout::Array => "array",
                },
            },
            files: files.to_vec(),
        }
    }

    /// The same for people.
    pub fn table(&self, subject: &Subject, found: &FieldFit, request: &FitRequest) -> String {
        let mut text = format!("{}: {} readings\n\n", self.data.file, self.data.readings);
        text += &self.scan();
        text += &match request.order {
            OrderChoice::Auto => format!(
                "\norder {}: the lowest that foretells left-out readings as well as the best, to two standard errors\n",
                found.order
            ),
            OrderChoice::Exactly(order) => format!("\norder {order}, as asked for\n"),
        };
        let left_out: Vec<String> = self.undetermined.iter().map(|answer| answer.order.to_string()).collect();
        if !left_out.is_empty() {
            text +=
                &format!("the readings do not determine order {} (--json says why)\n", left_out.join(", "));
        }
        text += &format!(
            "noise of one component {:.4} mT; condition of the scaled covariance {:.1e}\n",
            self.noise_mt, self.covariance_condition
        );
        for (coil, answer) in found.coils.iter().zip(&self.coils) {
            text += &coil_table(subject.readings.layout, coil, answer, request);
        }
        for file in &self.files {
            // Writing to a text cannot fail.
            let _ = writeln!(text, "\nwritten: {}", file.display());
        }
        text
    }

    /// One line an order.
    fn scan(&self) -> String {
        let mut text = String::from("order        RMS, mT                            left out, mT\n");
        let mut heads = String::from("       Bx       By       Bz       norm     largest  folds");
        for region in &self.regions {
            heads += &format!("    {}", region.name);
        }
        text += &heads;
        text += "\n";
        for report in &self.orders {
            let mark = if report.order == self.order { '*' } else { ' ' };
            let [x, y, z] = report.rms_mt;
            text += &format!(
                "{:>3} {mark}  {x:<8.4} {y:<8.4} {z:<8.4} {:<8.4} {:<8.4} {:<8}",
                report.order,
                report.rms_norm_mt,
                report.largest_mt,
                shown(report.holdout_rms_norm_mt)
            );
            for (region, norm) in self.regions.iter().zip(&report.region_rms_norms_mt) {
                text += &format!(" {:<width$}", shown(*norm), width = region.name.len() + 3);
            }
            text = text.trim_end().to_owned() + "\n";
        }
        text
    }
}

fn shown(norm: Option<f64>) -> String {
    norm.map_or_else(|| "-".to_owned(), |norm| format!("{norm:.4}"))
}

fn coil_table(layout: Layout, coil: &CoilFit, answer: &CoilAnswer, request: &FitRequest) -> String {
    let mut text = match layout {
        Layout::OneCoil => "\n".to_owned(),
        Layout::Array => format!("\ncoil {}\n", answer.name),
    };
    for (index, (value, deviation)) in coil.coefficients.iter().zip(&coil.deviations).enumerate() {
        let k = index + 1;
        let percent = 100.0 * deviation / value.abs();
        text +=
            &format!("a{k:<3} {value:>14.6e} T m^{:<2} / A   +- {deviation:.1e} ({percent:.2} %)\n", k + 2);
    }
    if let Some(deviation) = coil.origin_deviation {
        let (origin, deviation) = (coil.origin * 1e3, deviation * 1e3);
        text += &format!("origin at x = {origin:.2} +- {deviation:.2} mm\n");
    }
    let range = &coil.range;
    let reasons: Vec<String> = [
        (range.turns_over_x, "the series turns over at"),
        (range.orders_differ_x, "the next orders differ by more below"),
        (range.misfit_x, "the readings are missed by more below"),
    ]
    .into_iter()
    .filter_map(|(x, words)| x.map(|x| format!("{words} {:.1} mm", x * 1e3)))
    .collect();
    text += &format!(
        "valid from x = {:.1} mm, to {} % ({}; nearest reading at {:.1} mm)\n",
        range.from_x * 1e3,
        request.share * 100.0,
        if reasons.is_empty() { "nothing speaks against it".to_owned() } else { reasons.join(", ") },
        range.nearest_reading_x * 1e3
    );
    text
}

fn per_coil<T>(layout: Layout, found: &FieldFit, of: impl Fn(&CoilFit) -> T) -> PerCoil<T> {
    match (layout, found.coils.as_slice()) {
        (Layout::OneCoil, [coil]) => PerCoil::One(of(coil)),
        (_, coils) => PerCoil::Each(coils.iter().map(of).collect()),
    }
}

impl OrderAnswer {
    fn new(report: &OrderReport) -> Self {
        Self {
            order: report.order,
            rms_norm_mt: report.rms_norm * 1e3,
            holdout_rms_norm_mt: report.holdout_rms_norm.map(|norm| norm * 1e3),
            region_rms_norms_mt: report
                .region_rms_norms
                .iter()
                .map(|norm| norm.map(|norm| norm * 1e3))
                .collect(),
            rms_mt: report.rms.map(|rms| rms * 1e3),
            largest_mt: report.largest * 1e3,
            origins_m: report.origins.clone(),
            condition: report.condition,
        }
    }
}

impl CoilAnswer {
    fn new(name: &str, coil: &CoilFit) -> Self {
        // A tenth of a millimetre is what the range is known to.
        let millimetres = |x: f64| (x * 1e4).round() / 10.0;
        let range = &coil.range;
        Self {
            name: name.to_owned(),
            coefficients: coil.coefficients.clone(),
            standard_deviations: coil.deviations.clone(),
            covariance: coil.covariance.clone(),
            origin_m: coil.origin,
            origin_standard_deviation_m: coil.origin_deviation,
            valid_from_x_mm: millimetres(range.from_x),
            turns_over_x_mm: range.turns_over_x.map(millimetres),
            orders_differ_x_mm: range.orders_differ_x.map(millimetres),
            misfit_x_mm: range.misfit_x.map(millimetres),
            nearest_reading_x_mm: millimetres(range.nearest_reading_x),
        }
    }
}
