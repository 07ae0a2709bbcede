//! How an experiment went, in words: the loop's timing and a table of the steps.

use magsteer::daemon::{LatencySummary, TimingSummary};

use super::session::Played;
use crate::cli::output::fixed;

/// Least width of an angle's column, and what stands between groups of them.
const WIDTH: usize = 6;
const GAP: &str = "   ";

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

/// The table of an experiment's steps, a column for each magnet by its name, and what its errors are.
pub fn table(played: &Played) -> String {
    let widths: Vec<usize> = played.magnets.iter().map(|name| name.chars().count().max(WIDTH)).collect();
    // As wide as its heading at least.
    let group = |heading: &str, cells: Vec<String>| {
        let cells: Vec<String> =
            cells.iter().zip(&widths).map(|(cell, width)| format!("{cell:>width$}")).collect();
        format!("{:<1$}{GAP}", cells.join(" "), heading.len())
    };
    let headings = ["target (deg)", "error mean (deg)", "error RMS (deg)"];
    let names = |heading: &str| group(heading, played.magnets.clone());
    let wide = |heading: &str| format!("{heading:<0$}", names(heading).len());
    let [target, mean, rms] = headings;
    let mut text = format!("{}settled after   {}{}largest\n", wide(target), wide(mean), wide(rms));
    text += &format!("{}{:16}{}{}current\n", names(target), "", names(mean), names(rms));
    for response in &played.steps {
        let list = |heading: &str, values: &[f64], digits: usize| {
            group(heading, values.iter().map(|value| fixed(*value, digits)).collect())
        };
        let settled = response.settled_s.map_or("not settled".to_owned(), |time| format!("{time:.2} s"));
        text += &format!(
            "{}{settled:<16}{}{}{:.2} A\n",
            list(target, &response.target_deg, 0),
            list(mean, &response.error_end_mean_deg, 2),
            list(rms, &response.error_end_rms_deg, 2),
            response.current_max_a,
        );
    }
    text + judged(played.judged_by_truth)
}

/// What errors are, and of what.
fn judged(by_truth: bool) -> &'static str {
    if by_truth {
        "Errors at the end: over the last second, from the settling on at the earliest. Judged by the plant's truth, \
         free of the sensor's noise; a report judges by measured tangents, noise included.\n"
    } else {
        "Errors at the end: over the last second, from the settling on at the earliest. Judged by measured tangents, \
         the sensor's noise included.\n"
    }
}

#[cfg(test)]
mod tests {
    use magsteer::daemon::step_response::StepResponse;

    use super::{Played, table};

    fn played(magnets: &[&str], judged_by_truth: bool) -> Played {
        let of = |value: f64| vec![value; magnets.len()];
        let step = StepResponse {
            target_deg: of(70.0),
            settled_s: Some(0.5),
            error_mean_deg: of(-14.5),
            error_rms_deg: of(21.5),
            error_end_mean_deg: of(-0.25),
            error_end_rms_deg: of(0.31),
            current_max_a: 3.5,
        };
        let magnets = magnets.iter().map(|name| (*name).to_owned()).collect();
        Played { magnets, steps: vec![step], judged_by_truth, timing: None }
    }

    /// Goal: people are told the error that is left, below the magnet's name, and not the way there.
    #[test]
    fn errors_are_those_at_the_end_below_the_name_of_their_magnet() {
        for magnets in [&["m1", "m2"][..], &["m1"], &["proximal", "middle", "tip"]] {
            let text = table(&played(magnets, true));
            let lines: Vec<&str> = text.lines().collect();
            for name in magnets {
                assert_eq!(lines[1].split_whitespace().filter(|word| word == name).count(), 3, "{text}");
            }
            let ends = |line: &str, of: &str| -> Vec<usize> {
                line.match_indices(of).map(|(at, found)| at + found.len()).collect()
            };
            let name = magnets[magnets.len() - 1];
            let below: Vec<usize> =
                ["70", "-0.25", "0.31"].iter().filter_map(|it| ends(lines[2], it).pop()).collect();
            assert_eq!(ends(lines[1], name), below, "{text}");
            assert!(!text.contains("14.5") && !text.contains("21.5"), "{text}");
        }
    }

    #[test]
    fn the_table_says_what_judged_the_steps() {
        assert!(table(&played(&["m1"], true)).contains("by the plant's truth"));
        assert!(!table(&played(&["m1"], false)).contains("truth"));
    }
}
