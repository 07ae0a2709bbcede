//! Medians of several calls, taken turn by turn, so that their ratios hold while the machine's speed does not.

use std::time::{Duration, Instant};

/// Length of one turn.
const TURN: Duration = Duration::from_micros(300);

/// Runs as many calls as it is told and returns the mean time of one, s.
pub type Timed = Box<dyn FnMut(u32) -> f64>;

/// A call timed in the caller's thread.
pub fn timed(mut call: impl FnMut() + 'static) -> Timed {
    Box::new(move |calls| mean(&mut call, calls))
}

/// Mean time of some calls, s.
pub fn mean(call: &mut dyn FnMut(), calls: u32) -> f64 {
    let start = Instant::now();
    for _ in 0..calls {
        call();
    }
    start.elapsed().as_secs_f64() / f64::from(calls)
}

/// Median time of one call of each, s, over so many turns of all.
pub fn medians(calls: &mut [Timed], turns: usize) -> Vec<f64> {
    let batches: Vec<u32> = calls.iter_mut().map(batch).collect();
    let mut times = vec![Vec::with_capacity(turns); calls.len()];
    for _ in 0..turns {
        for ((call, &batch), times) in calls.iter_mut().zip(&batches).zip(&mut times) {
            times.push(call(batch));
        }
    }
    times.into_iter().map(median).collect()
}

/// Calls that fill a turn.
fn batch(call: &mut Timed) -> u32 {
    call(20);
    ((TURN.as_secs_f64() / call(20)) as u32).max(1)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
