//! How far a count is, on one line of a terminal.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use super::play::LiveLine;

/// How often the line is drawn.
const DRAW_EVERY: Duration = Duration::from_millis(200);
/// Characters of the bar.
const WIDTH: usize = 28;

/// A bar on standard error; nothing where that is no terminal.
pub struct Counting {
    line: Option<LiveLine>,
    what: &'static str,
    whole: usize,
    done: usize,
    good: usize,
    begin: Instant,
}

impl Counting {
    /// Of so many of what is named, none done yet.
    pub fn new(what: &'static str, whole: usize) -> Self {
        let line = stderr().is_terminal().then(LiveLine::new);
        Self { line, what, whole, done: 0, good: 0, begin: Instant::now() }
    }

    /// One more is done, and reached or not.
    pub fn add(&mut self, reached: bool) {
        self.done += 1;
        self.good += usize::from(reached);
        let (what, whole, done, good, begin) = (self.what, self.whole, self.done, self.good, self.begin);
        let text = || {
            let filled = (WIDTH * done / whole.max(1)).min(WIDTH);
            let (bar, gap) = ("=".repeat(filled), " ".repeat(WIDTH - filled));
            let left = begin.elapsed().as_secs_f64() / done as f64 * whole.saturating_sub(done) as f64;
            let share = 100.0 * good as f64 / done as f64;
            format!("[{bar}{gap}] {done}/{whole} {what}, {left:.0} s left, reached {share:.1} %")
        };
        if let Some(line) = &mut self.line {
            line.draw(text, DRAW_EVERY);
        }
    }
}

impl Drop for Counting {
    fn drop(&mut self) {
        if let Some(line) = &mut self.line {
            line.end();
        }
    }
}
