//! What an identification came to, for people: what was found, how well it fits, what the data left open, and what they
//! say that the model does not.

use super::identify_answer::ParameterAnswer;

/// Deviation after the data over that before, below which a parameter is worth naming as found.
const RATIO_FOUND: f64 = 0.3;
/// Deviations of chi-square itself beyond which what is left is not noise.
const CHI_SQUARE_SIGMA: f64 = 4.0;
/// Least share of the gains' largest one in a direction that is common to all of them.
const SHARE_COMMON: f64 = 0.7;
/// With which name a gain begins.
const GAIN: &str = "gain ";

/// What a verdict rests on.
#[derive(Debug)]
pub(super) struct Evidence<'a> {
    pub converged: bool,
    pub parameters: &'a [ParameterAnswer],
    /// RMS angle of tangents, deg, without outliers: with the nominal parameters, and with the estimates.
    pub angle_deg: [Option<f64>; 2],
    pub chi_square: f64,
    pub degrees_of_freedom: f64,
    /// The noise was not stated but taken from what the fit leaves.
    pub is_noise_estimated: bool,
    /// Readings, tangents and positions, of magnets that were seen.
    pub readings: usize,
    /// Readings beyond the limit, and the samples that they are of.
    pub outliers: usize,
    pub outlier_samples: usize,
    pub outlier_sigma: f64,
    /// Directions that the data leave to the prior: parameters with their shares.
    pub undetermined: Vec<&'a [(String, f64)]>,
}

impl Evidence<'_> {
    /// What is left of the readings, in deviations of the noise: 1 when the model explains the data.
    pub fn residual_over_noise(&self) -> f64 {
        (self.chi_square / self.degrees_of_freedom.max(1.0)).sqrt()
    }

    /// The verdict, a line each.
    pub fn verdict(&self) -> Vec<String> {
        if !self.converged {
            return vec!["verdict: NOT identified: the search did not end in a minimum".to_owned()];
        }
        let mut lines = vec![format!("verdict: {}{}", self.found(), self.fit())];
        lines.extend(
            self.undetermined.iter().map(|parts| format!("  not told by the data: {}", self.open(parts))),
        );
        lines.push(format!("  {}", self.noise()));
        lines
    }

    fn found(&self) -> String {
        let (found, rest): (Vec<_>, Vec<_>) =
            self.parameters.iter().partition(|parameter| parameter.posterior_over_prior < RATIO_FOUND);
        let named = |parameter: &&ParameterAnswer| {
            let deviation = parameter.standard_deviation.max(parameter.standard_deviation_between_samples);
            let unit = if parameter.unit == "(factor)" { "" } else { parameter.unit };
            let moved = change(parameter).map_or(String::new(), |percent| format!(" ({percent:+.1} %)"));
            let text = format!("{} {:.4} +- {deviation:.4} {unit}", parameter.name, parameter.estimate);
            text.trim_end().to_owned() + &moved
        };
        let mut text = found.iter().map(named).collect::<Vec<_>>().join(", ");
        if found.is_empty() {
            text += "no parameter is told well";
        }
        let moved = rest.iter().filter_map(|parameter| change(parameter)).map(f64::abs);
        if let Some(most) = moved.reduce(f64::max) {
            text += &format!("; {} more moved by {most:.1} % at most", rest.len());
        }
        text
    }

    fn fit(&self) -> String {
        match self.angle_deg {
            [Some(before), Some(after)] => {
                format!(
                    "; the model's tangents now lie {after:.2} deg (RMS) from the measured ones, {before:.2} before"
                )
            }
            _ => String::new(),
        }
    }

    /// A direction that is left open, and what would tell it.
    fn open(&self, parts: &[(String, f64)]) -> String {
        let gains = self.parameters.iter().filter(|parameter| parameter.name.starts_with(GAIN)).count();
        let shares: Vec<f64> =
            parts.iter().filter(|(name, _)| name.starts_with(GAIN)).map(|(_, share)| *share).collect();
        let most = shares.iter().fold(0.0_f64, |most, share| most.max(share.abs()));
        let first = shares.first().copied().unwrap_or_default();
        let is_common = gains > 1
            && shares.len() == gains
            && shares.iter().all(|share| share * first > 0.0 && share.abs() > SHARE_COMMON * most);
        if is_common {
            return "a common factor of all gains, which the moments undo: no equilibrium shows it, and steering does not \
                    need it. A field probe tells it (`magsteer field fit`), then --prior-gain-percent 0 holds the gains"
                .to_owned();
        }
        let parts: Vec<String> = parts.iter().map(|(name, share)| format!("{share:+.2} {name}")).collect();
        format!(
            "{}: kept as in FILE. More equilibria with other currents and frame angles may tell, or a measurement of its own, \
             then --prior-... 0 holds it",
            parts.join(", ")
        )
    }

    fn noise(&self) -> String {
        let ratio = self.residual_over_noise();
        let freedom = self.degrees_of_freedom.max(1.0);
        let is_explained =
            self.chi_square <= freedom + CHI_SQUARE_SIGMA * (2.0 * freedom).sqrt() && self.outliers == 0;
        if is_explained {
            let of = if self.is_noise_estimated {
                "; that noise was taken from the fit itself: compare it with your sensor's"
            } else {
                ""
            };
            return format!("the model explains the data: what is left is {ratio:.2} times the noise{of}");
        }
        let noise = if self.is_noise_estimated {
            "the noise, taken from the better readings"
        } else {
            "the stated noise"
        };
        format!(
            "the model does not explain the data to their noise: {ratio:.2} times {noise}; {} of {} readings, in {} samples, lie \
             beyond {} deviations. It leaves something out (forces between magnets, saturation, coils out of place, friction): \
             trust \"by samples\", not \"deviation\"",
            self.outliers, self.readings, self.outlier_samples, self.outlier_sigma
        )
    }
}

/// Change of a parameter that is no shift, percent.
fn change(parameter: &ParameterAnswer) -> Option<f64> {
    let is_factor = parameter.nominal != 0.0 && !matches!(parameter.unit, "mm" | "deg");
    is_factor.then(|| 100.0 * (parameter.estimate / parameter.nominal - 1.0))
}

#[cfg(test)]
mod tests {
    use super::{Evidence, ParameterAnswer};

    fn parameter(name: &str, unit: &'static str, nominal: f64, estimate: f64, ratio: f64) -> ParameterAnswer {
        ParameterAnswer {
            name: name.to_owned(),
            unit,
            nominal,
            estimate,
            standard_deviation: 0.002,
            standard_deviation_between_samples: 0.007,
            moved_prior_sigma: 0.5,
            posterior_over_prior: ratio,
        }
    }

    fn parameters() -> Vec<ParameterAnswer> {
        vec![
            parameter("modulus of all sections", "MPa", 5.5, 6.05, 0.002),
            parameter("gain left", "(factor)", 1.0, 0.97, 0.4),
            parameter("gain right", "(factor)", 1.0, 1.02, 0.4),
        ]
    }

    fn evidence<'a>(parameters: &'a [ParameterAnswer], open: &'a [(String, f64)]) -> Evidence<'a> {
        Evidence {
            converged: true,
            parameters,
            angle_deg: [Some(2.127), Some(0.206)],
            chi_square: 1086.4,
            degrees_of_freedom: 592.0,
            is_noise_estimated: true,
            readings: 240,
            outliers: 16,
            outlier_samples: 11,
            outlier_sigma: 4.0,
            undetermined: vec![open],
        }
    }

    fn open(shares: [f64; 2]) -> Vec<(String, f64)> {
        vec![("gain left".to_owned(), shares[0]), ("gain right".to_owned(), shares[1])]
    }

    #[test]
    fn a_verdict_says_what_was_found_how_well_and_what_the_model_leaves_out() {
        let (parameters, open) = (parameters(), open([0.7, 0.7]));
        let text = evidence(&parameters, &open).verdict().join("\n");
        for told in [
            "verdict: modulus of all sections 6.0500 +- 0.0070 MPa (+10.0 %); 2 more moved by 3.0 % at most",
            "now lie 0.21 deg (RMS) from the measured ones, 2.13 before",
            "not told by the data: a common factor of all gains",
            "does not explain the data to their noise: 1.35 times",
            "16 of 240 readings, in 11 samples, lie beyond 4 deviations",
        ] {
            assert!(text.contains(told), "{told}\n{text}");
        }
    }

    #[test]
    fn gains_against_each_other_are_no_common_factor() {
        let (parameters, open) = (parameters(), open([0.7, -0.7]));
        let text = evidence(&parameters, &open).verdict().join("\n");
        assert!(text.contains("+0.70 gain left, -0.70 gain right") && !text.contains("common"), "{text}");
    }

    #[test]
    fn data_within_their_noise_are_explained_and_a_broken_search_is_no_result() {
        let (parameters, open) = (parameters(), open([0.7, 0.7]));
        let explained = Evidence { chi_square: 600.0, outliers: 0, ..evidence(&parameters, &open) };
        assert!(explained.verdict().join("\n").contains("explains the data: what is left is 1.01 times"));
        let broken = Evidence { converged: false, ..evidence(&parameters, &open) };
        assert!(broken.verdict()[0].contains("NOT identified"));
    }
}
