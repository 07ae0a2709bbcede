//! How far a campaign is: a bar on a terminal, a line now and then elsewhere.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

use crate::cli::output;

/// How often the bar's clock moves on.
const TICK: Duration = Duration::from_millis(500);
/// How often a line is written where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(30);
/// No colour, so that there is nothing for `NO_COLOR` to take away.
const TEMPLATE: &str = "[{bar:28}] {pos}/{len} runs{msg}";

/// Progress of a campaign on standard error.
pub struct Progress {
    bar: Option<ProgressBar>,
    wanted: u64,
    done: u64,
    settled: u64,
    begin: Instant,
    done_before: u64,
    told: Instant,
}

impl Progress {
    /// Of a campaign of which some runs were done before, with so many of them settled.
    pub fn new(wanted: u64, done: u64, settled: u64) -> Self {
        let bar = stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(wanted).with_position(done);
            // A template that cannot be read would only cost its looks.
            if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.enable_steady_tick(TICK);
            bar
        });
        let now = Instant::now();
        Self { bar, wanted, done, settled, begin: now, done_before: done, told: now }
    }

    /// One more run is done.
    pub fn add(&mut self, settled: bool) {
        self.done += 1;
        self.settled += u64::from(settled);
        let share = 100.0 * self.settled as f64 / self.done as f64;
        let pace = self.begin.elapsed().as_secs_f64() / (self.done - self.done_before) as f64;
        let left = Duration::from_secs_f64(pace * self.wanted.saturating_sub(self.done) as f64);
        let words = format!("{} left, settled {share:.1} %", HumanDuration(left));
        match &self.bar {
            Some(bar) => {
                bar.set_message(format!(", {words}"));
                bar.set_position(self.done);
            }
            None if self.told.elapsed() >= LINE_EVERY && self.done < self.wanted => {
                self.told = Instant::now();
                output::note(format_args!("{} of {} runs, {words}", self.done, self.wanted));
            }
            None => {}
        }
    }

    /// Leaves the terminal to what is said next.
    pub fn end(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}
