//! How an experiment went, in words: the loop's timing and a table of the steps.

use magsteer::daemon::{LatencySummary, TimingSummary};

use super::session::Played;

/// A line on the loop's timing.
pub fn timing_line(timing: &TimingSummary) -> String {
    let row = |latency: &LatencySummary| {
        format!("p50 {:.0} us, p99 {:.0} us, max {:.0} us", latency.p50, latency.p99, latency.max)
    };
    format!(
        "loop at {:.0} Hz: {} cycles, {} missed; lateness {}; execution {}; pose to command {}, to driver {}\n",
        timing.rate_hz,
        timing.cycles,
        timing.missed,
        row(&timing.lateness_us),
        row(&timing.execution_us),
        row(&timing.pose_to_command_us),
        row(&timing.pose_to_driver_us),
    )
}

/// The table of an experiment's steps.
pub fn table(played: &Played) -> String {
    let mut text = String::from(
        "target (deg)        settled after  error mean (deg)    error RMS (deg)     largest current\n",
    );
    for response in &played.steps {
        let list = |values: &[f64], digits: usize| {
            let parts: Vec<String> = values.iter().map(|value| format!("{value:.digits$}")).collect();
            parts.join("  ")
        };
        let settled = response.settled_s.map_or("not settled".to_owned(), |time| format!("{time:.2} s"));
        text += &format!(
            "{:<18}  {:<13}  {:<18}  {:<18}  {:.2} A\n",
            list(&response.target_deg, 0),
            settled,
            list(&response.error_mean_deg, 2),
            list(&response.error_rms_deg, 2),
            response.current_max_a,
        );
    }
    text
}
