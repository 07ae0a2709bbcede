//! One page with everything: figures drawn in it, nothing loaded from elsewhere.

use std::fmt::Write;

use magsteer::daemon::{LatencySummary, latency_summary};

use super::run::Run;
use crate::cli::output::fixed;

const STYLE: &str = "\
body{font:16px/1.45 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#1a1a1a;background:#fff}\
h1{font-size:1.6rem;margin-bottom:.2rem}h2{font-size:1.15rem;margin-top:2.2rem}\
table{border-collapse:collapse;margin:.8rem 0}th,td{padding:.25rem .8rem .25rem 0;text-align:left;border-bottom:1px solid #ddd}\
td{overflow-wrap:anywhere}.wide{overflow-x:auto}td.n{white-space:nowrap;text-align:right;font-variant-numeric:tabular-nums}\
.figures{columns:27rem 2;column-gap:2rem;margin:1.5rem 0}\
figure{margin:0 0 1.5rem;break-inside:avoid}figure svg{width:100%;height:auto;display:block}figcaption{color:#444;font-size:.92rem}\
th.n{text-align:right}@media(max-width:40rem){th,td{padding-right:.35rem;font-size:.72rem}td.n{white-space:normal}}\
pre{background:#f5f5f5;padding:.8rem;overflow-x:auto;font-size:.85rem}details{margin:.6rem 0}.bad{color:#b00020;font-weight:600}";

/// A figure on the page.
pub struct Figure {
    pub name: &'static str,
    pub caption: String,
    pub svg: String,
}

impl Figure {
    /// As a part of a page.
    pub fn html(&self) -> String {
        let (name, caption) = (self.name, escaped(&self.caption));
        format!("<figure id=\"{name}\">{}<figcaption>{caption}</figcaption></figure>\n", drawing(self))
    }
}

/// Figures side by side where there is room.
pub fn side_by_side(figures: &str) -> String {
    format!("<div class=\"figures\">\n{figures}</div>\n")
}

/// A page of its own.
pub fn document(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{title}</title><style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n{body}</body></html>\n",
        title = escaped(title),
    )
}

/// The page of a run.
pub fn page(run: &Run, figures: &[Figure]) -> String {
    let mut text = format!("<p>{}</p>\n", escaped(&run.description));
    text += &summary(run);
    text += &steps(run);
    text += &side_by_side(&figures.iter().map(Figure::html).collect::<String>());
    text += &timing(run);
    let events = run.events.iter().map(|event| format!("{:>10.3} s  {}\n", event.time, escaped(&event.text)));
    let events: String = events.collect();
    // Writing to a string does not fail.
    let _ = writeln!(text, "<h2>Events</h2>\n<pre>{events}</pre>");
    document(&run.info.rig, &text)
}

/// A row of a table of facts; the value is HTML.
pub fn row(name: &str, value: &str) -> String {
    format!("<tr><th>{}</th><td>{}</td></tr>\n", escaped(name), value)
}

fn summary(run: &Run) -> String {
    let (info, counts) = (&run.info, &run.counts);
    let whole = if counts.holes == 0 {
        "none".to_owned()
    } else {
        format!("<span class=\"bad\">{} in {} holes</span>", counts.lost(), counts.holes)
    };
    let missed = 100.0 * counts.missed as f64 / counts.periods().max(1) as f64;
    let settled = run.steps.iter().filter(|step| step.response.settled_s.is_some()).count();
    let all = if settled == run.steps.len() { "" } else { " class=\"bad\"" };
    let duration = run.samples.last().map_or(0.0, |sample| sample.time);
    let rows = [
        row("begun", &began(&info.started)),
        row("steps", &format!("<span{all}>{settled} of {} settled</span>", run.steps.len())),
        row("duration", &format!("{duration:.1} s, {} cycles at {} Hz", counts.cycles, info.rate_hz)),
        row(
            "periods missed by the loop",
            &format!("{} of {} ({missed:.2} %)", counts.missed, counts.periods()),
        ),
        row("cycles lost in the recording", &whole),
        row("magnets", &escaped(&info.magnets.join(", "))),
        row("coils", &escaped(&info.coils.join(", "))),
        row("frames", &escaped(&info.frames.join(", "))),
        row("configuration", &format!("SHA-256 {}", escaped(&info.config_sha256))),
        row("program", &escaped(&info.program)),
    ];
    format!("<div class=\"wide\"><table>\n{}</table></div>\n", rows.concat())
}

/// Date and time for people, of a time as RFC 3339 has it.
fn began(started: &str) -> String {
    let readable = started.split_once('T').and_then(|(date, time)| {
        let clock = time.strip_suffix('Z')?.split('.').next()?;
        Some(format!("{date} {clock} UTC"))
    });
    escaped(readable.as_deref().unwrap_or(started))
}

fn steps(run: &Run) -> String {
    if run.steps.is_empty() {
        return "<p>No target was steered to.</p>\n".to_owned();
    }
    let list = |values: &[f64], digits: usize| {
        values.iter().map(|value| fixed(*value, digits)).collect::<Vec<_>>().join(", ")
    };
    let rows: String = run
        .steps
        .iter()
        .enumerate()
        .map(|(index, step)| {
            let response = &step.response;
            let settled =
                response.settled_s.map_or("<span class=\"bad\">no</span>".to_owned(), |time| format!("{time:.2} s"));
            format!(
                "<tr><td class=\"n\">{}</td><td class=\"n\">{:.1}</td><td>{}</td><td class=\"n\">{settled}</td><td class=\"n\">{}</td>\
                 <td class=\"n\">{}</td><td class=\"n\">{:.2}</td></tr>\n",
                index + 1,
                step.begin,
                list(&response.target_deg, 1),
                list(&response.error_end_mean_deg, 2),
                list(&response.error_end_rms_deg, 2),
                response.current_max_a,
            )
        })
        .collect();
    let of = escaped(&run.magnets().join(", "));
    format!(
        "<h2>Steps</h2>\n<div class=\"wide\"><table><tr><th class=\"n\">step</th><th class=\"n\">begin (s)</th><th>target {of}, from z (deg)</th><th class=\"n\">settled after</th>\
         <th class=\"n\">error mean {of} (deg)</th><th class=\"n\">error RMS {of} (deg)</th><th class=\"n\">largest current (A)</th></tr>\n{rows}</table></div>\n\
         <p>Judged by measured tangents, the sensor's noise included (<code>demo</code> and <code>target</code> judge a simulated rig by the \
         plant's truth: their errors are smaller). Settled: within 1 degree from then on, for 0.25 s at least. Errors over the last second, from the \
         settling on at the earliest.</p>\n"
    )
}

fn timing(run: &Run) -> String {
    let times = &run.times;
    let rows: String =
        [("lateness", &times.lateness), ("execution", &times.execution), ("pose age", &times.pose_age)]
            .iter()
            .map(|(name, times)| {
                let LatencySummary { p50, p99, p999, p9999, max } = latency_summary(times);
                let cells: String = [p50, p99, p999, p9999, max]
                    .iter()
                    .map(|value| format!("<td class=\"n\">{value:.1}</td>"))
                    .collect();
                format!("<tr><th>{name}</th>{cells}</tr>\n")
            })
            .collect();
    format!(
        "<h2>Timing</h2>\n<div class=\"wide\"><table><tr><th>us</th><th class=\"n\">p50</th><th class=\"n\">p99</th><th class=\"n\">p99.9</th><th class=\"n\">p99.99</th><th class=\"n\">max</th></tr>\n{rows}</table></div>\n\
         <p>Pose age: time since the exposure of the newest poses, in every cycle that had any.</p>\n"
    )
}

/// The drawing alone, without what makes it a file of its own, with the box that lets the page scale it, and with names that no
/// other drawing on the page has.
fn drawing(figure: &Figure) -> String {
    let svg = figure.svg.replace("kuva-clip-", &format!("{}-clip-", figure.name));
    let svg = svg.find("<svg").map_or(&*svg, |begin| &svg[begin..]);
    let head = svg.split_once('>').map_or(svg, |(head, _)| head);
    let length = |name: &str| -> Option<f64> {
        let (_, rest) = head.split_once(&format!(" {name}=\""))?;
        rest.split_once('"')?.0.trim_end_matches("px").parse().ok()
    };
    match (length("width"), length("height")) {
        (Some(width), Some(height)) if !head.contains("viewBox") => {
            svg.replacen("<svg", &format!("<svg viewBox=\"0 0 {width} {height}\""), 1)
        }
        _ => svg.to_owned(),
    }
}

/// Text as HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
