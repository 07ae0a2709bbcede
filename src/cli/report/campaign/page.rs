//! The page of a campaign, with every figure in it.

use std::path::{Path, PathBuf};

use magsteer::math::statistics::{quantile, wilson_interval};

use super::figures::{sheets, shown, sorted};
use super::runs::{CampaignRuns, RunOutcome};
use crate::cli::campaign::RunRow;
use crate::cli::exit::cannot_create;
use crate::cli::report::page::{Figure, document, escaped, row, side_by_side};

/// Makes every figure of a campaign and the page with all of them in a folder; returns their paths, the page's first.
///
/// # Errors
/// When a figure cannot be drawn, or a file cannot be written.
pub fn write(campaign: &CampaignRuns, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).map_err(|error| cannot_create(folder, &error))?;
    let file = folder.join("report.html");
    let (mut figures, mut files) = (String::new(), vec![file.clone()]);
    for sheet in sheets(campaign) {
        let (svg, written) = sheet.write(folder)?;
        files.extend(written);
        figures += &Figure { name: sheet.name, caption: sheet.caption, svg }.html();
    }
    let body = [summary(campaign), side_by_side(&figures), common(campaign), failures(campaign)].concat();
    let title = format!("Campaign with {}", campaign.rig);
    std::fs::write(&file, document(&title, &body)).map_err(|error| cannot_create(&file, &error))?;
    Ok(files)
}

fn summary(campaign: &CampaignRuns) -> String {
    let CampaignRuns { manifest, rows, .. } = campaign;
    let runs = rows.len() as u64;
    let share = |outcome: RunOutcome| {
        let part = campaign.with(outcome).count() as u64;
        let [low, high] = wilson_interval(part, runs).map(|share| 100.0 * share);
        let percent = 100.0 * part as f64 / runs as f64;
        row(outcome.name(), &format!("{part} ({percent:.1} %, 95 % interval {low:.1} to {high:.1} %)"))
    };
    let quantiles = |measure: fn(&RunRow) -> Option<f64>, unit: &str| {
        let values = sorted(rows.iter().filter_map(measure));
        let number =
            |share: f64| quantile(&values, share).map_or("-".to_owned(), |value| format!("{value:.2}"));
        format!("median {}, 95 % {}, greatest {} {unit}", number(0.5), number(0.95), number(1.0))
    };
    let current = rows.iter().map(|row| row.current_max_a).fold(0.0, f64::max);
    let margin = rows.iter().filter_map(|row| row.margin_min).reduce(f64::min);
    let breaks: u64 = rows.iter().map(|row| row.limit_breaks).sum();
    let table = [
        row("runs", &format!("{runs} of {}, seed {}", manifest.runs, manifest.seed)),
        RunOutcome::ALL.map(share).concat(),
        row("slowest step of a run that settled", &quantiles(|row| row.settle_max_s, "s")),
        row(
            "greatest RMS error of a run that settled",
            &quantiles(|row| row.rms_max_deg.filter(|_| row.settled), "deg"),
        ),
        row("largest current", &format!("{current:.2} A of {:.2} A", campaign.current_limit)),
        row("smallest margin of stability", &margin.map_or("-".to_owned(), |margin| format!("{margin:.3}"))),
        row("commands beyond a limit", &breaks.to_string()),
        row("configuration", &format!("SHA-256 {}", escaped(&manifest.config_sha256))),
        row("program", &format!("magsteer {}", escaped(&manifest.version))),
    ];
    format!("<div class=\"wide\"><table>\n{}</table></div>\n", table.concat())
}

/// Where failed runs lie among all, draw by draw.
fn common(campaign: &CampaignRuns) -> String {
    let failed = |row: &RunRow| RunOutcome::of(row) != RunOutcome::Settled;
    if !campaign.rows.iter().any(failed) || campaign.columns.drawn.is_empty() {
        return String::new();
    }
    let line = |(index, key): (usize, &String)| {
        let (label, factor) = shown(key);
        let values = |wanted: bool| {
            let rows = campaign.rows.iter().filter(move |row| failed(row) == wanted);
            sorted(rows.filter_map(move |row| Some(factor * row.drawn.get(index)?)))
        };
        let cells: String = [values(false), values(true)]
            .iter()
            .flat_map(|values| [0.0, 0.5, 1.0].map(|share| quantile(values, share)))
            .map(|value| {
                format!(
                    "<td class=\"n\">{}</td>",
                    value.map_or("-".to_owned(), |value| format!("{value:.3}"))
                )
            })
            .collect();
        format!("<tr><td title=\"{}\">{}</td>{cells}</tr>\n", escaped(key), escaped(&label))
    };
    let lines: String = campaign.columns.drawn.iter().enumerate().map(line).collect();
    format!(
        "<h2>What failed runs have in common</h2>\n<div class=\"wide\"><table><tr><th rowspan=\"2\">drawn</th><th colspan=\"3\">runs that settled</th>\
         <th colspan=\"3\">runs that failed</th></tr><tr><th>least</th><th>median</th><th>greatest</th><th>least</th><th>median</th><th>greatest</th></tr>\n\
         {lines}</table></div>\n"
    )
}

/// Every run that failed, and how it is played again.
fn failures(campaign: &CampaignRuns) -> String {
    let failed = campaign.failed();
    if failed.is_empty() {
        return "<h2>Failed runs</h2>\n<p>None: every step of every run settled.</p>\n".to_owned();
    }
    let rows = campaign.rows.iter().filter(|row| RunOutcome::of(row) != RunOutcome::Settled);
    let lines: String = failed
        .iter()
        .zip(rows)
        .map(|(failed, row)| {
            let error = row.rms_max_deg.map_or("-".to_owned(), |error| format!("{error:.2}"));
            format!(
                "<tr><td class=\"n\">{}</td><td><span class=\"bad\">{}</span></td><td class=\"n\">{} of {}</td><td class=\"n\">{error}</td>\
                 <td class=\"n\">{:.1}</td><td class=\"n\">{:.2}</td><td>{}</td></tr>\n<tr><td colspan=\"7\"><code>{}</code></td></tr>\n",
                failed.run,
                failed.outcome.name(),
                row.steps_settled,
                campaign.columns.steps,
                row.swing_deg,
                row.current_max_a,
                escaped(&row.end),
                escaped(&failed.replay),
            )
        })
        .collect();
    format!(
        "<h2>Failed runs</h2>\n<p>Below each, the command that plays it again and compares it bit for bit.</p>\n<div class=\"wide\"><table><tr><th>run</th>\
         <th>outcome</th><th>steps settled</th><th>error RMS (deg)</th><th>swing (deg)</th><th>largest current (A)</th><th>ended</th></tr>\n{lines}</table></div>\n"
    )
}
