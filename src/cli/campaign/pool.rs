//! All runs of a campaign over all cores.
//!
//! Runs are begun in their order, one a thread, and share nothing that changes; so neither their number of
//! threads nor their order is seen in a result. Rows come back to one thread, which alone writes.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use anyhow::Context;
use magsteer::daemon::StopFlag;
use rayon::ThreadPoolBuilder;
use rayon::iter::{ParallelBridge, ParallelIterator};
use rustix::time::{ClockId, clock_gettime};

use super::row::RunRow;
use super::runner::Runner;

/// A run that is done, and what it cost.
pub struct Done {
    /// What it came to.
    pub row: RunRow,
    /// Processor time that it took: what other programs took meanwhile is not in it.
    pub took: Duration,
}

/// Plays runs on so many threads and hands each to `take` as it finishes. Ends early when `stop` is set,
/// without the runs under way, and at the first error.
///
/// # Errors
/// The first of: a thread that cannot be started, a run that failed, what `take` returned.
pub fn play_all(
    runner: &Runner<'_>,
    runs: Vec<u64>,
    threads: usize,
    stop: &StopFlag,
    mut take: impl FnMut(Done) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start threads")?;
    // Ends runs under way when one of them, or `take`, has failed.
    let broken = AtomicBool::new(false);
    let is_over = || stop.requested().is_some() || broken.load(Ordering::Relaxed);
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        let is_over = &is_over;
        scope.spawn(move || {
            pool.install(|| {
                runs.into_iter().take_while(|_| !is_over()).par_bridge().for_each_with(
                    sender,
                    |sender, run| {
                        let begin = processor_time();
                        let played = runner.play(run, is_over).transpose();
                        let done = played.map(|row| {
                            row.map(|row| Done { row, took: processor_time().saturating_sub(begin) })
                        });
                        // Nobody listens any more when something has failed.
                        done.into_iter().for_each(|done| drop(sender.send(done)));
                    },
                );
            });
        });
        let result = receiver.iter().try_for_each(|done| take(done?));
        if result.is_err() {
            broken.store(true, Ordering::Relaxed);
        }
        // Senders wait for nobody, and the scope waits for them.
        drop(receiver);
        result
    })
}

/// Processor time that this thread took so far.
fn processor_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ThreadCPUTime)).unwrap_or_default()
}
