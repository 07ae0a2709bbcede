//! Two pictures of a soak: how late and how long its cycles were, and timing and memory against time.

use std::path::{Path, PathBuf};

use magsteer::daemon::{Bin, RunReport, TimingHistograms};

use super::measures::Measures;
use crate::cli::figures::{Curve, CycleBin, MinutePanel, Stroke, cycle_histograms, minutes as draw_minutes};

/// Draws what there is to draw, and returns the pictures' names.
///
/// # Errors
/// When a picture cannot be drawn or written.
pub fn draw(folder: &Path, minutes: &[Measures], daemon: Option<&RunReport>) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    if let Some(histograms) = daemon.map(|daemon| &daemon.histograms) {
        let path = folder.join("histograms.png");
        let of = |bins: &[Bin]| bins.iter().map(drawn).collect();
        let histograms =
            [("lateness", of(&histograms.lateness_us)), ("execution", of(&histograms.execution_us))];
        cycle_histograms(&path, &histograms)?;
        files.push(path);
    }
    // One point makes no curve.
    if minutes.len() > 1 {
        let path = folder.join("minutes.png");
        draw_minutes(&path, &panels(minutes))?;
        files.push(path);
    }
    Ok(files)
}

fn drawn(bin: &Bin) -> CycleBin {
    let width = (1.0 / TimingHistograms::PER_OCTAVE).exp2();
    CycleBin { from_us: bin.up_to_us / width, to_us: bin.up_to_us, cycles: bin.cycles as f64 }
}

fn panels(minutes: &[Measures]) -> Vec<MinutePanel> {
    let curve = |name: &str, color: usize, value: fn(&Measures) -> Option<f64>| Curve {
        name: name.to_owned(),
        stroke: Stroke::Color(color),
        points: minutes.iter().filter_map(|it| Some((it.elapsed_s / 60.0, value(it)?))).collect(),
    };
    let lateness = vec![
        curve("p50", 0, |it| Some(it.lateness_us.p50.max(0.1))),
        curve("p99", 1, |it| Some(it.lateness_us.p99.max(0.1))),
        curve("p99.9", 2, |it| Some(it.lateness_us.p999.max(0.1))),
        curve("max", 3, |it| Some(it.lateness_us.max.max(0.1))),
    ];
    let mut panels =
        vec![MinutePanel { label: "lateness (us)".to_owned(), logarithmic: true, curves: lateness }];
    let memory = curve("daemon", 0, |it| it.rss_mb);
    if !memory.points.is_empty() {
        panels.push(MinutePanel {
            label: "memory (MB)".to_owned(),
            logarithmic: false,
            curves: vec![memory],
        });
    }
    panels
}
