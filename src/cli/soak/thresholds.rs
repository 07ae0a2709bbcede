//! Thresholds as `--fail-on` has them: `missed>0,lateness_p9999_us>200`.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use serde::Serialize;

use super::measures::{COUNTS, Measures};

/// Why a list of thresholds is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ThresholdError {
    /// Nothing between two commas, before the first, or after the last.
    #[error("an empty threshold; expected METRIC COMPARISON NUMBER between commas, as missed>0")]
    Empty,
    /// None of the comparisons.
    #[error("`{0}`: expected one of > >= < <= after the metric, as missed>0")]
    Comparison(String),
    /// No metric has this name.
    #[error("`{name}` is no metric; known are {}", known.join(", "))]
    Metric { name: String, known: Vec<String> },
    /// What stands after the comparison.
    #[error("`{0}`: expected a finite number after the comparison")]
    Number(String),
}

/// How a metric is compared; a metric for which it is true breaks the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Comparison {
    Above,
    AtLeast,
    Below,
    AtMost,
}

/// The longer ones first: they begin like the others.
const COMPARISONS: [(&str, Comparison); 4] = [
    (">=", Comparison::AtLeast),
    ("<=", Comparison::AtMost),
    (">", Comparison::Above),
    ("<", Comparison::Below),
];

/// One threshold.
#[derive(Debug, Clone, PartialEq)]
pub struct Threshold {
    metric: String,
    comparison: Comparison,
    limit: f64,
}

/// Thresholds, in the order in which they were named.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Thresholds(Vec<Threshold>);

/// How a threshold fared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    pub threshold: String,
    /// Null where the metric is not known, which breaks the threshold too.
    pub value: Option<f64>,
    pub held: bool,
}

impl Thresholds {
    /// Each of them against `measures`.
    pub fn judge(&self, measures: &Measures) -> Vec<Judged> {
        let values = measures.values();
        let judge = |threshold: &Threshold| {
            let found = values.iter().find(|(name, _)| *name == threshold.metric);
            let value = found.and_then(|(_, value)| *value);
            // What cannot be judged has not been shown to hold.
            let held = value.is_some_and(|value| !threshold.is_broken_by(value));
            Judged { threshold: threshold.to_string(), value, held }
        };
        self.0.iter().map(judge).collect()
    }
}

impl Thresholds {
    /// Whether a count is beyond its limit. Counts only rise: unlike times and shares, which are of a minute or of the
    /// whole, they are not to be waited for.
    pub fn is_exceeded_by_counts(&self, measures: &Measures) -> bool {
        let values = measures.values();
        let count = |name: &str| {
            let found = values.iter().find(|(known, _)| known == name && COUNTS.contains(&name));
            found.and_then(|(_, value)| *value)
        };
        self.0.iter().any(|threshold| {
            let rises_into_it = matches!(threshold.comparison, Comparison::Above | Comparison::AtLeast);
            rises_into_it && count(&threshold.metric).is_some_and(|value| threshold.is_broken_by(value))
        })
    }
}

impl Display for Thresholds {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        for (index, threshold) in self.0.iter().enumerate() {
            write!(formatter, "{}{threshold}", if index > 0 { ", " } else { "" })?;
        }
        Ok(())
    }
}

impl FromStr for Thresholds {
    type Err = ThresholdError;

    fn from_str(text: &str) -> Result<Self, ThresholdError> {
        text.split(',').map(str::parse).collect::<Result<_, _>>().map(Self)
    }
}

impl Threshold {
    fn is_broken_by(&self, value: f64) -> bool {
        match self.comparison {
            Comparison::Above => value > self.limit,
            Comparison::AtLeast => value >= self.limit,
            Comparison::Below => value < self.limit,
            Comparison::AtMost => value <= self.limit,
        }
    }
}

impl FromStr for Threshold {
    type Err = ThresholdError;

    fn from_str(text: &str) -> Result<Self, ThresholdError> {
        let text = text.trim();
        if text.is_empty() {
            return Err(ThresholdError::Empty);
        }
        let split = COMPARISONS.iter().find_map(|(sign, comparison)| {
            let (metric, limit) = text.split_once(sign)?;
            Some((metric.trim().to_owned(), *comparison, limit.trim()))
        });
        let Some((metric, comparison, limit)) = split else {
            return Err(ThresholdError::Comparison(text.to_owned()));
        };
        let known: Vec<String> = Measures::default().values().into_iter().map(|(name, _)| name).collect();
        if !known.contains(&metric) {
            return Err(ThresholdError::Metric { name: metric, known });
        }
        match limit.parse::<f64>() {
            Ok(limit) if limit.is_finite() => Ok(Self { metric, comparison, limit }),
            _ => Err(ThresholdError::Number(text.to_owned())),
        }
    }
}

impl Display for Threshold {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let sign = COMPARISONS.iter().find(|(_, comparison)| *comparison == self.comparison);
        write!(formatter, "{}{}{}", self.metric, sign.map_or("", |(sign, _)| sign), self.limit)
    }
}

impl Display for Judged {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self.value {
            Some(value) => write!(formatter, "{}: {value}", self.threshold),
            None => write!(formatter, "{}: not known here", self.threshold),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Measures, ThresholdError, Thresholds};

    #[test]
    fn thresholds_are_read_as_they_are_written_with_blanks_or_without() {
        for (text, shown) in [
            ("missed>0", "missed>0"),
            (" lateness_p9999_us >= 200.5 ", "lateness_p9999_us>=200.5"),
            ("cycles<1e3", "cycles<1000"),
            ("rss_growth_mb<=-5", "rss_growth_mb<=-5"),
            ("pose_to_driver_p50_us>7000", "pose_to_driver_p50_us>7000"),
        ] {
            let Thresholds(read) = text.parse().expect("valid");
            assert_eq!(read.len(), 1);
            assert_eq!(read[0].to_string(), shown);
        }
        let all = "missed>0,lateness_p9999_us>200,rss_growth_mb>5,alloc_in_cycle>0,trips>0,unsettled>0";
        assert_eq!(all.parse::<Thresholds>().expect("those of the documentation").0.len(), 6);
    }

    #[test]
    fn what_is_no_threshold_is_refused_for_its_own_reason() {
        let refused = |text: &str| text.parse::<Thresholds>().expect_err(text);
        for text in ["", " ", "missed>0,", ",missed>0", "missed>0,,trips>0"] {
            assert_eq!(refused(text), ThresholdError::Empty, "{text}");
        }
        for text in ["missed", "missed=0", "missed 0"] {
            assert_eq!(refused(text), ThresholdError::Comparison(text.to_owned()));
        }
        for text in
            ["missed>", "missed>x", "missed>nan", "missed>inf", "missed>>0", "missed>0>1", "missed>0 1"]
        {
            assert_eq!(refused(text), ThresholdError::Number(text.to_owned()));
        }
        for name in ["mised", "", "lateness_us", "lateness_p98_us"] {
            let told = refused(&format!("{name}>0")).to_string();
            assert!(told.starts_with(&format!("`{name}` is no metric")), "{told}");
            assert!(told.contains("missed") && told.contains("lateness_p9999_us"), "{told}");
        }
    }

    #[test]
    fn a_threshold_is_broken_by_values_beyond_it_and_by_a_metric_that_is_not_known() {
        let measures = Measures { missed: 3, rss_growth_mb: None, ..Measures::default() };
        for (text, held) in [
            ("missed>2", false),
            ("missed>3", true),
            ("missed>=3", false),
            ("missed>=4", true),
            ("missed<3", true),
            ("missed<4", false),
            ("missed<=3", false),
            ("missed<=2", true),
            ("rss_growth_mb>5", false),
        ] {
            let judged = text.parse::<Thresholds>().expect("valid").judge(&measures);
            assert_eq!(judged[0].held, held, "{text}");
        }
        let judged = "rss_growth_mb>5,missed>2".parse::<Thresholds>().expect("valid").judge(&measures);
        assert_eq!(judged[0].to_string(), "rss_growth_mb>5: not known here");
        assert_eq!(judged[1].to_string(), "missed>2: 3");
    }
}
