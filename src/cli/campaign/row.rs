//! What one run came to, and how a table of them is written and read back.
//!
//! Numbers are written with as many digits as reading them back bit for bit takes; what there is none of is
//! left empty.

use std::collections::BTreeMap;

use anyhow::{Context, anyhow, bail};
use magsteer::config::Number;
use serde::Serialize;

/// What one run came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunRow {
    /// Number of the run, 0 first.
    pub run: u64,
    /// Its seed.
    pub seed: u64,
    /// Drawn values, in the order of the configuration.
    #[serde(skip)]
    pub drawn: Vec<f64>,
    /// True when every step settled.
    pub settled: bool,
    /// Steps that settled.
    pub steps_settled: u64,
    /// Longest time that a step took to settle; `None` unless all did.
    pub settle_max_s: Option<f64>,
    /// When each step had settled.
    pub settle_s: Vec<Option<f64>>,
    /// Greatest RMS error of a magnet in the last second of a step; `None` when no step was played.
    pub rms_max_deg: Option<f64>,
    /// RMS error of each magnet over the last seconds of all steps played.
    pub rms_deg: Vec<Option<f64>>,
    /// Greatest RMS error of a magnet in the last second of each step.
    pub rms_step_deg: Vec<Option<f64>>,
    /// Greatest angle between the model's tangent and the true one at the end of a step.
    pub model_error_deg: f64,
    /// Farthest that a magnet turned in the last second of a step that did not settle; 0 when all did.
    pub swing_deg: f64,
    /// Largest current that a coil carried.
    pub current_max_a: f64,
    /// Smallest margin of stability of the model while steering; `None` when it never found an equilibrium.
    pub margin_min: Option<f64>,
    /// Commands beyond a limit, as the plant counts them.
    pub limit_breaks: u64,
    /// Time in which sensing was lost and the last currents were held.
    pub holding_s: f64,
    /// True when the loop was unstable, as the command's help defines it.
    pub unstable: bool,
    /// How it ended: `steering`, or the state and the cause.
    pub end: String,
    /// Steps of the plant whose equations were not solved.
    pub steps_unsolved: u64,
    /// Steps of the plant in which a magnet was nearer to a driven coil than its series holds.
    pub steps_outside_field_model: u64,
    /// Time simulated.
    pub simulated_s: f64,
    /// [`magsteer::daemon::RunDigest`] of it.
    pub digest: String,
}

/// Columns that vary with the campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// Keys drawn.
    pub drawn: Vec<String>,
    /// Steps of the experiment.
    pub steps: usize,
    /// Names of the magnets.
    pub magnets: Vec<String>,
}

impl Columns {
    /// Names of all columns.
    fn names(&self) -> Vec<String> {
        let mut names = vec!["run".to_owned(), "seed".to_owned()];
        names.extend(self.drawn.iter().cloned());
        names.extend(["settled", "steps_settled", "settle_max_s"].map(str::to_owned));
        names.extend((1..=self.steps).map(|step| format!("settle_{step}_s")));
        names.push("rms_max_deg".to_owned());
        names.extend(self.magnets.iter().map(|magnet| format!("rms_{magnet}_deg")));
        names.extend((1..=self.steps).map(|step| format!("rms_step_{step}_deg")));
        let rest = [
            "model_error_deg",
            "swing_deg",
            "current_max_a",
            "margin_min",
            "limit_breaks",
            "holding_s",
            "unstable",
            "end",
            "steps_unsolved",
            "steps_outside_field_model",
            "simulated_s",
            "digest",
        ];
        names.extend(rest.map(str::to_owned));
        names
    }

    /// The columns of a table with this first line; `None` when it is none of a campaign.
    #[cfg(all(feature = "figures", feature = "record"))]
    pub fn of_header(header: &str) -> Option<Self> {
        let names: Vec<&str> = header.split(',').collect();
        let place = |wanted: &str| names.iter().position(|name| *name == wanted);
        let (settled, longest, rms, rest) =
            (place("settled")?, place("settle_max_s")?, place("rms_max_deg")?, place("model_error_deg")?);
        let steps = rms.checked_sub(longest + 1)?;
        let magnets = names.get(rms + 1..rest.checked_sub(steps)?)?;
        let magnets = magnets.iter().map(|name| name.strip_prefix("rms_")?.strip_suffix("_deg"));
        let columns = Self {
            drawn: names.get(2..settled)?.iter().map(|name| (*name).to_owned()).collect(),
            steps,
            magnets: magnets.map(|name| name.map(str::to_owned)).collect::<Option<_>>()?,
        };
        (columns.names() == names).then_some(columns)
    }

    /// The table's first line, with its end.
    pub fn header(&self) -> String {
        self.names().join(",") + "\n"
    }

    /// A row as a line, with its end.
    pub fn line(&self, row: &RunRow) -> String {
        let optional = |value: &Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let mut fields = vec![row.run.to_string(), row.seed.to_string()];
        fields.extend(row.drawn.iter().map(f64::to_string));
        fields.extend([u8::from(row.settled).to_string(), row.steps_settled.to_string()]);
        fields.push(optional(&row.settle_max_s));
        fields.extend(row.settle_s.iter().map(optional));
        fields.push(optional(&row.rms_max_deg));
        fields.extend(row.rms_deg.iter().map(optional));
        fields.extend(row.rms_step_deg.iter().map(optional));
        fields.extend([row.model_error_deg, row.swing_deg, row.current_max_a].map(|value| value.to_string()));
        fields.push(optional(&row.margin_min));
        fields.extend([row.limit_breaks.to_string(), row.holding_s.to_string()]);
        fields.push(u8::from(row.unstable).to_string());
        // The table knows no quotes.
        fields.push(row.end.replace(',', ";"));
        fields.extend([row.steps_unsolved, row.steps_outside_field_model].map(|count| count.to_string()));
        fields.extend([row.simulated_s.to_string(), row.digest.clone()]);
        fields.join(",") + "\n"
    }

    /// Reads a line without its end.
    ///
    /// # Errors
    /// When it is not a row of this table.
    pub fn parse(&self, line: &str) -> anyhow::Result<RunRow> {
        let names = self.names();
        let fields: Vec<&str> = line.split(',').collect();
        if fields.len() != names.len() {
            bail!("{} fields instead of {}", fields.len(), names.len());
        }
        let mut fields = Fields { names: names.iter().zip(fields) };
        Ok(RunRow {
            run: fields.read()?,
            seed: fields.read()?,
            drawn: fields.several(self.drawn.len())?,
            settled: fields.flag()?,
            steps_settled: fields.read()?,
            settle_max_s: fields.optional()?,
            settle_s: fields.several_optional(self.steps)?,
            rms_max_deg: fields.optional()?,
            rms_deg: fields.several_optional(self.magnets.len())?,
            rms_step_deg: fields.several_optional(self.steps)?,
            model_error_deg: fields.read()?,
            swing_deg: fields.read()?,
            current_max_a: fields.read()?,
            margin_min: fields.optional()?,
            limit_breaks: fields.read()?,
            holding_s: fields.read()?,
            unstable: fields.flag()?,
            end: fields.read()?,
            steps_unsolved: fields.read()?,
            steps_outside_field_model: fields.read()?,
            simulated_s: fields.read()?,
            digest: fields.read()?,
        })
    }

    /// Drawn values by key.
    pub fn drawn_by_key(&self, row: &RunRow) -> BTreeMap<String, f64> {
        self.drawn.iter().cloned().zip(row.drawn.iter().copied()).collect()
    }
}

/// Values of drawn numbers.
pub fn values(drawn: &[Number]) -> Vec<f64> {
    drawn.iter().map(|number| number.value()).collect()
}

/// Fields of a line with the names of their columns.
struct Fields<I> {
    names: I,
}

impl<'n, 'f, I: Iterator<Item = (&'n String, &'f str)>> Fields<I> {
    fn next(&mut self) -> anyhow::Result<(&'n String, &'f str)> {
        self.names.next().context("too few fields")
    }

    fn read<T: std::str::FromStr>(&mut self) -> anyhow::Result<T> {
        let (name, text) = self.next()?;
        text.parse().map_err(|_| anyhow!("{name} = {text}: cannot be read"))
    }

    fn optional(&mut self) -> anyhow::Result<Option<f64>> {
        let (name, text) = self.next()?;
        if text.is_empty() {
            return Ok(None);
        }
        text.parse().map(Some).map_err(|_| anyhow!("{name} = {text}: must be a number or empty"))
    }

    fn flag(&mut self) -> anyhow::Result<bool> {
        let (name, text) = self.next()?;
        match text {
            "0" => Ok(false),
            "1" => Ok(true),
            _ => bail!("{name} = {text}: must be 0 or 1"),
        }
    }

    fn several(&mut self, count: usize) -> anyhow::Result<Vec<f64>> {
        (0..count).map(|_| self.read()).collect()
    }

    fn several_optional(&mut self, count: usize) -> anyhow::Result<Vec<Option<f64>>> {
        (0..count).map(|_| self.optional()).collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn columns() -> Columns {
        Columns {
            drawn: vec!["plant.errors.modulus_relative".to_owned()],
            steps: 2,
            magnets: vec!["m1".to_owned(), "m2".to_owned()],
        }
    }

    pub fn row(run: u64) -> RunRow {
        RunRow {
            run,
            seed: 0x7fff_ffff_ffff_ffff,
            drawn: vec![0.1 + 0.2],
            settled: false,
            steps_settled: 1,
            settle_max_s: None,
            settle_s: vec![Some(1.0 / 3.0), None],
            rms_max_deg: Some(0.1),
            rms_deg: vec![Some(1e-300), Some(0.2)],
            rms_step_deg: vec![Some(0.2), None],
            model_error_deg: 7.25,
            swing_deg: 0.0,
            current_max_a: 2.5,
            margin_min: Some(0.4),
            limit_breaks: 0,
            holding_s: 0.0,
            unstable: true,
            end: "fault: no fresh poses".to_owned(),
            steps_unsolved: 3,
            steps_outside_field_model: 0,
            simulated_s: 33.1,
            digest: "0123456789abcdef".to_owned(),
        }
    }

    #[test]
    fn a_row_reads_back_bit_for_bit() {
        let (columns, row) = (columns(), row(7));
        let line = columns.line(&row);
        assert_eq!(columns.parse(line.trim_end()).expect("its own line"), row);
        assert_eq!(line.matches(',').count(), columns.header().matches(',').count());
    }

    #[cfg(all(feature = "figures", feature = "record"))]
    #[test]
    fn columns_are_known_by_their_first_line() {
        let columns = columns();
        assert_eq!(Columns::of_header(columns.header().trim_end()), Some(columns.clone()));
        for other in ["", "run,seed", "settled,settle_max_s,rms_max_deg,model_error_deg"] {
            assert_eq!(Columns::of_header(other), None, "{other}");
        }
        let without = columns.header().replace("margin_min,", "");
        assert_eq!(Columns::of_header(without.trim_end()), None);
    }

    #[test]
    fn a_comma_in_the_end_does_not_shift_the_columns() {
        let (columns, row) = (columns(), RunRow { end: "fault: a, b".to_owned(), ..row(7) });
        assert_eq!(columns.parse(columns.line(&row).trim_end()).expect("its own line").end, "fault: a; b");
    }

    #[test]
    fn a_line_that_is_cut_or_wrong_is_refused() {
        let (columns, row) = (columns(), row(7));
        let line = columns.line(&row);
        for cut in [1, 20, line.len() - 30] {
            assert!(columns.parse(&line[..cut]).is_err(), "{}", &line[..cut]);
        }
        assert!(columns.parse(&line.trim_end().replace(",1,fault", ",yes,fault")).is_err());
    }
}
