//! What the runs of a campaign say together.
//!
//! Intervals are 95 % intervals of what the distributions of the configuration would give in infinitely many
//! runs: Wilson's for shares, of order statistics for quantiles. They are given for what runs have one of
//! each. The steps of one run share a plant and so are no independent sample: their quantiles stand without
//! intervals.

use std::time::Duration;

use magsteer::math::statistics::{quantile, quantile_interval, wilson_interval};
use serde::Serialize;

use super::pool::Done;
use super::row::RunRow;

/// The stable keys of `campaign --json`: `runs` to `real_time_factor`; others stand beside them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Runs done.
    pub runs: u64,
    /// Share of runs in which every step settled; `None` without runs.
    pub settled_fraction: Option<f64>,
    /// Its interval.
    pub settled_interval: [f64; 2],
    /// Commands beyond a limit, of all runs.
    pub limit_breaks: u64,
    /// Runs that were unstable.
    pub unstable: u64,
    /// Times that steps took to settle, of those steps of all runs that did.
    pub settle_s: Percentiles,
    /// Time that this session took.
    pub elapsed_s: f64,
    /// Time simulated in this session over the time that it took.
    pub real_time_factor: f64,
    /// The same of one core that it has to itself: over the processor time of the runs.
    pub real_time_factor_per_core: f64,
    /// Cores used.
    pub threads: usize,
    /// Runs done in this session; the others were there before.
    pub runs_in_session: u64,
    /// Runs asked for.
    pub runs_wanted: u64,
    /// Seed of the campaign.
    pub seed: u64,
    /// SHA-256 of the configuration.
    pub config_sha256: String,
    /// Interval of the share of unstable runs.
    pub unstable_interval: [f64; 2],
    /// Steps of all runs.
    pub steps: u64,
    /// Those that settled.
    pub steps_settled: u64,
    /// Longest time that a step of a run took to settle, of the runs that settled.
    pub settle_max_s: Quantiles,
    /// Greatest RMS error of a magnet at the end of a step of a run.
    pub rms_max_deg: Quantiles,
    /// Largest current of any run.
    pub current_max_a: f64,
    /// Greatest angle between model and truth at a step's end.
    pub model_error_max_deg: f64,
    /// Steps of the plants whose equations were not solved.
    pub steps_unsolved: u64,
    /// Steps of the plants outside the field model.
    pub steps_outside_field_model: u64,
    /// How the runs ended that did not steer to the end.
    pub ends: Vec<String>,
}

/// Quantiles of a sample; `None` of nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: Option<f64>,
    /// 95 % lie below.
    pub p95: Option<f64>,
    /// Greatest.
    pub max: Option<f64>,
}

/// Quantiles with their intervals, an end of which is `None` where there are too few runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median, 95 % point and maximum.
    #[serde(flatten)]
    pub percentiles: Percentiles,
    /// Interval of the median.
    pub p50_interval: [Option<f64>; 2],
    /// Interval of the 95 % point.
    pub p95_interval: [Option<f64>; 2],
}

/// How a session went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Session {
    /// Runs done.
    pub runs: u64,
    /// Time simulated, s.
    pub simulated: f64,
    /// Processor time that its runs took.
    pub busy: Duration,
    /// Time from begin to end.
    pub elapsed: Duration,
    /// Threads.
    pub threads: usize,
}

impl Session {
    /// One more run is done.
    pub fn add(&mut self, done: &Done) {
        self.runs += 1;
        self.simulated += done.row.simulated_s;
        self.busy += done.took;
    }
}

impl Percentiles {
    fn of(sorted: &[f64]) -> Self {
        Self { p50: quantile(sorted, 0.5), p95: quantile(sorted, 0.95), max: sorted.last().copied() }
    }
}

impl Quantiles {
    fn of(sorted: &[f64]) -> Self {
        Self {
            percentiles: Percentiles::of(sorted),
            p50_interval: quantile_interval(sorted, 0.5),
            p95_interval: quantile_interval(sorted, 0.95),
        }
    }
}

impl Summary {
    /// What `rows` say together.
    pub fn of<'r>(
        rows: impl Iterator<Item = &'r RunRow> + Clone,
        session: &Session,
        seed: u64,
        runs_wanted: u64,
        config_sha256: &str,
    ) -> Self {
        let count = |holds: fn(&RunRow) -> bool| rows.clone().filter(|row| holds(row)).count() as u64;
        let sum = |of: fn(&RunRow) -> u64| rows.clone().map(of).sum::<u64>();
        let most = |of: fn(&RunRow) -> f64| rows.clone().map(of).fold(0.0, f64::max);
        let (runs, settled, unstable) =
            (count(|_| true), count(|row| row.settled), count(|row| row.unstable));
        let mut ends: Vec<String> =
            rows.clone().filter(|row| row.end != "steering").map(|row| row.end.clone()).collect();
        ends.sort_unstable();
        ends.dedup();
        let seconds = |duration: Duration| duration.as_secs_f64().max(1e-9);
        Self {
            runs,
            settled_fraction: (runs > 0).then(|| settled as f64 / runs as f64),
            settled_interval: wilson_interval(settled, runs),
            limit_breaks: sum(|row| row.limit_breaks),
            unstable,
            settle_s: Percentiles::of(&sorted(rows.clone().flat_map(|row| row.settle_s.iter().flatten()))),
            elapsed_s: session.elapsed.as_secs_f64(),
            real_time_factor: session.simulated / seconds(session.elapsed),
            real_time_factor_per_core: session.simulated / seconds(session.busy),
            threads: session.threads,
            runs_in_session: session.runs,
            runs_wanted,
            seed,
            config_sha256: config_sha256.to_owned(),
            unstable_interval: wilson_interval(unstable, runs),
            steps: sum(|row| row.settle_s.len() as u64),
            steps_settled: sum(|row| row.steps_settled),
            settle_max_s: Quantiles::of(&sorted(rows.clone().filter_map(|row| row.settle_max_s.as_ref()))),
            rms_max_deg: Quantiles::of(&sorted(rows.clone().filter_map(|row| row.rms_max_deg.as_ref()))),
            current_max_a: most(|row| row.current_max_a),
            model_error_max_deg: most(|row| row.model_error_deg),
            steps_unsolved: sum(|row| row.steps_unsolved),
            steps_outside_field_model: sum(|row| row.steps_outside_field_model),
            ends,
        }
    }

    /// True when there is nothing to be ashamed of: runs, no broken limit, no unstable run. That a run did
    /// not settle is a result, not a failure.
    pub fn is_sound(&self) -> bool {
        self.runs > 0 && self.limit_breaks == 0 && self.unstable == 0
    }

    /// For people.
    pub fn text(&self) -> String {
        let percent = |share: f64| 100.0 * share;
        let share = |name: &str, part: u64, interval: &[f64; 2]| {
            let fraction = percent(part as f64 / self.runs.max(1) as f64);
            let [low, high] = interval.map(percent);
            format!("{name:<22}{part} of {} ({fraction:.1} %, interval {low:.1} to {high:.1} %)\n", self.runs)
        };
        let settled = (self.settled_fraction.unwrap_or(0.0) * self.runs as f64).round() as u64;
        let number = |value: Option<f64>| value.map_or("?".to_owned(), |value| format!("{value:.2}"));
        let row = |name: &str, unit: &str, percentiles: &Percentiles, intervals: Option<&Quantiles>| {
            let interval = |ends: fn(&Quantiles) -> [Option<f64>; 2]| {
                intervals.map_or(String::new(), |quantiles| {
                    let [low, high] = ends(quantiles).map(number);
                    format!(" ({low} to {high})")
                })
            };
            format!(
                "{name:<22}p50 {}{} {unit}, p95 {}{} {unit}, max {} {unit}\n",
                number(percentiles.p50),
                interval(|quantiles| quantiles.p50_interval),
                number(percentiles.p95),
                interval(|quantiles| quantiles.p95_interval),
                number(percentiles.max),
            )
        };
        let mut text = share("every step settled", settled, &self.settled_interval);
        text += &share("unstable", self.unstable, &self.unstable_interval);
        text += &row("step settled after", "s", &self.settle_s, None);
        text += &row("slowest step of a run", "s", &self.settle_max_s.percentiles, Some(&self.settle_max_s));
        text += &row("largest RMS of a run", "deg", &self.rms_max_deg.percentiles, Some(&self.rms_max_deg));
        text += &format!(
            "{:<22}{} commands beyond a limit, largest current {:.2} A, model off by at most {:.1} deg, {} plant steps unsolved, {} outside the field model\n",
            "plants",
            self.limit_breaks,
            self.current_max_a,
            self.model_error_max_deg,
            self.steps_unsolved,
            self.steps_outside_field_model,
        );
        for end in &self.ends {
            text += &format!("{:<22}{end}\n", "a run ended");
        }
        if self.runs_in_session > 0 {
            text += &format!(
                "{:<22}{} runs in {:.1} s on {} threads: {:.1} times real time, {:.1} times by the processor time of one core\n",
                "speed",
                self.runs_in_session,
                self.elapsed_s,
                self.threads,
                self.real_time_factor,
                self.real_time_factor_per_core,
            );
        }
        text
    }
}

fn sorted<'v>(values: impl Iterator<Item = &'v f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.copied().collect();
    values.sort_by(f64::total_cmp);
    values
}
