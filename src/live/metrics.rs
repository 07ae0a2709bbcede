//! Figures as OpenMetrics text, for programs that watch many machines.
//!
//! Format: *OpenMetrics 1.0* (<https://github.com/OpenObservability/OpenMetrics>). A family is its metadata
//! (type, unit, help), then its samples; a family with a unit ends in it; counters' samples end in `_total`;
//! the text ends in `# EOF`. Units are the base units that the standard asks for: seconds, amperes, degrees
//! for angles (as everywhere at this project's borders), ratios for shares.

use std::fmt::{self, Display, Write};

use magsteer_hal::operator::state;

use super::figures::Figures;
use super::link::Link;
use super::rig::Rig;
use crate::daemon::LatencySummary;

/// Every state of the daemon.
const STATES: [u32; 7] =
    [state::BOOT, state::IDLE, state::ARMED, state::ACTIVE, state::HOLDING, state::SAFE_STOP, state::FAULT];

/// The text for one scrape, `# EOF` included. Of a daemon that is not heard now it says that alone: old
/// numbers are none.
#[must_use]
pub fn open_metrics(rig: &Rig, figures: &Figures) -> String {
    let mut page = Page { text: String::with_capacity(8 << 10), rig: escaped(&rig.name) };
    let up = figures.link == Link::Attached;
    page.family("magsteer_up", Kind::Gauge, "", "1 while the daemon's status comes, else 0.");
    page.sample("magsteer_up", &[], f64::from(u8::from(up)));
    if up {
        state_of_daemon(&mut page, figures);
        loop_counts(&mut page, figures);
        latencies(&mut page, figures);
        actuation(&mut page, rig, figures);
        orientation(&mut page, rig, figures);
        recording(&mut page, figures);
    }
    page.text.push_str("# EOF\n");
    page.text
}

fn state_of_daemon(page: &mut Page, figures: &Figures) {
    page.family("magsteer_state", Kind::StateSet, "", "State of the daemon.");
    for code in STATES {
        let is_this = f64::from(u8::from(code == figures.state_code));
        page.sample("magsteer_state", &[("magsteer_state", state::name(code))], is_this);
    }
    page.gauge(
        "magsteer_cause_code",
        "",
        "Code of the last stop, fault or refused target; 0 without.",
        figures.cause_code,
    );
    page.gauge(
        "magsteer_stability_margin_ratio",
        "ratio",
        "Margin of stability: 1 at rest, 0 at a snap-through.",
        figures.stability_margin,
    );
    page.gauge(
        "magsteer_coil_heat_ratio",
        "ratio",
        "Heat of the hottest coil; 1 is the limit.",
        figures.coil_heat,
    );
    page.gauge(
        "magsteer_model_converged",
        "",
        "1 when the model's equilibrium was found in the last cycle.",
        u8::from(figures.model_converged),
    );
    page.gauge("magsteer_passive", "", "1 when monitors judge, but do not act.", u8::from(figures.passive));
    if let Some(age) = figures.pose_age_ms {
        page.gauge("magsteer_pose_age_seconds", "seconds", "Age of the newest poses.", age * 1e-3);
    }
}

fn loop_counts(page: &mut Page, figures: &Figures) {
    page.gauge(
        "magsteer_rate_hertz",
        "hertz",
        "Cycles a second over the last second.",
        figures.rate_measured_hz,
    );
    page.gauge("magsteer_rate_configured_hertz", "hertz", "Configured rate.", figures.rate_hz);
    page.counter("magsteer_cycles", "Cycles since the daemon's start.", figures.cycle);
    page.counter("magsteer_missed", "Periods skipped since the daemon's start.", figures.missed);
    page.counter(
        "magsteer_loop_allocations",
        "Allocations within cycles, beyond the transport's.",
        figures.loop_allocations,
    );
}

fn latencies(page: &mut Page, figures: &Figures) {
    let timing = &figures.timing;
    let families: [(&str, &str, &LatencySummary); 6] = [
        ("magsteer_lateness_seconds", "From the awaited deadline to the cycle's begin.", &timing.lateness_us),
        ("magsteer_execution_seconds", "From a cycle's begin to its end.", &timing.execution_us),
        (
            "magsteer_pose_age_used_seconds",
            "From exposure to the cycle that uses the poses.",
            &timing.pose_age_us,
        ),
        (
            "magsteer_pose_to_command_seconds",
            "From exposure of fresh poses to their command.",
            &timing.pose_to_command_us,
        ),
        (
            "magsteer_pose_to_driver_seconds",
            "From exposure to the driver's receipt of the command.",
            &timing.pose_to_driver_us,
        ),
        (
            "magsteer_round_trip_seconds",
            "From publication of poses to the driver's receipt.",
            &timing.round_trip_us,
        ),
    ];
    for (family, help, latency) in families {
        page.family(family, Kind::Summary, "seconds", &format!("{help} Since the daemon's start."));
        let quantiles = [
            ("0.5", latency.p50),
            ("0.99", latency.p99),
            ("0.999", latency.p999),
            ("0.9999", latency.p9999),
            ("1", latency.max),
        ];
        for (quantile, value_us) in quantiles {
            page.sample(family, &[("quantile", quantile)], value_us / 1e6);
        }
    }
    let phases = &timing.phases_us;
    page.family("magsteer_phase_seconds", Kind::Summary, "seconds", "Execution time of a cycle's phases.");
    for (phase, latency) in [
        ("read", &phases.read),
        ("control", &phases.control),
        ("decide", &phases.decide),
        ("write", &phases.write),
        ("record", &phases.record),
    ] {
        for (quantile, value_us) in [("0.5", latency.p50), ("0.999", latency.p999), ("1", latency.max)] {
            page.sample(
                "magsteer_phase_seconds",
                &[("phase", phase), ("quantile", quantile)],
                value_us / 1e6,
            );
        }
    }
}

fn actuation(page: &mut Page, rig: &Rig, figures: &Figures) {
    let coils = || rig.coils.iter().zip(&figures.coils);
    page.family("magsteer_current_amperes", Kind::Gauge, "amperes", "Measured current of a coil.");
    coils()
        .for_each(|(name, coil)| page.sample("magsteer_current_amperes", &[("coil", name)], coil.measured_a));
    page.family("magsteer_current_commanded_amperes", Kind::Gauge, "amperes", "Current sent last.");
    coils().for_each(|(name, coil)| {
        page.sample("magsteer_current_commanded_amperes", &[("coil", name)], coil.commanded_a)
    });
    page.family(
        "magsteer_current_limit_amperes",
        Kind::Gauge,
        "amperes",
        "Greatest magnitude of a coil's current.",
    );
    coils().for_each(|(name, coil)| {
        page.sample("magsteer_current_limit_amperes", &[("coil", name)], coil.limit_a)
    });
    let frames = || rig.frames.iter().zip(&figures.frames);
    if frames().len() > 0 {
        page.family("magsteer_frame_degrees", Kind::Gauge, "degrees", "Measured angle of a frame.");
        frames().for_each(|(name, frame)| {
            page.sample("magsteer_frame_degrees", &[("frame", name)], frame.measured_deg)
        });
    }
}

fn orientation(page: &mut Page, rig: &Rig, figures: &Figures) {
    let errors =
        rig.magnets.iter().zip(&figures.magnets).filter_map(|(name, magnet)| Some((name, magnet.error_deg?)));
    let errors: Vec<_> = errors.collect();
    if !errors.is_empty() {
        page.family(
            "magsteer_orientation_error_degrees",
            Kind::Gauge,
            "degrees",
            "Angle between a magnet and its target.",
        );
        errors.iter().for_each(|(name, error)| {
            page.sample("magsteer_orientation_error_degrees", &[("magnet", name)], *error)
        });
    }
}

fn recording(page: &mut Page, figures: &Figures) {
    page.family("magsteer_recorder", Kind::StateSet, "", "Flight recorder of the daemon.");
    for name in ["off", "recording", "failing"] {
        let is_this = f64::from(u8::from(name == figures.recorder));
        page.sample("magsteer_recorder", &[("magsteer_recorder", name)], is_this);
    }
    page.counter("magsteer_flights", "Flights written since the daemon's start.", figures.flights);
    page.counter(
        "magsteer_recorder_lost",
        "Events and flights that are lost for good.",
        figures.recorder_lost,
    );
    page.counter(
        "magsteer_records_dropped",
        "Cycle records lost on the way to the publisher.",
        figures.records_dropped,
    );
}

/// What a family is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Gauge,
    Counter,
    Summary,
    StateSet,
}

impl Display for Kind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Gauge => "gauge",
            Self::Counter => "counter",
            Self::Summary => "summary",
            Self::StateSet => "stateset",
        })
    }
}

/// The text as far as it is written; writing to memory does not fail.
struct Page {
    text: String,
    /// Value of the label that every sample carries.
    rig: String,
}

impl Page {
    fn family(&mut self, name: &str, kind: Kind, unit: &str, help: &str) {
        let _ = writeln!(self.text, "# TYPE {name} {kind}");
        if !unit.is_empty() {
            let _ = writeln!(self.text, "# UNIT {name} {unit}");
        }
        let _ = writeln!(self.text, "# HELP {name} {help}");
    }

    fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: f64) {
        let _ = write!(self.text, "{name}{{rig=\"{}\"", self.rig);
        for (label, value) in labels {
            let _ = write!(self.text, ",{label}=\"{}\"", escaped(value));
        }
        let _ = writeln!(self.text, "}} {}", number(value));
    }

    fn gauge(&mut self, name: &str, unit: &str, help: &str, value: impl Into<f64>) {
        self.family(name, Kind::Gauge, unit, help);
        self.sample(name, &[], value.into());
    }

    fn counter(&mut self, name: &str, help: &str, value: impl Display) {
        self.family(name, Kind::Counter, "", help);
        let _ = writeln!(self.text, "{name}_total{{rig=\"{}\"}} {value}", self.rig);
    }
}

/// A number as the format spells it.
fn number(value: f64) -> String {
    if value.is_nan() {
        "NaN".to_owned()
    } else if value.is_infinite() {
        if value > 0.0 { "+Inf" } else { "-Inf" }.to_owned()
    } else {
        format!("{value}")
    }
}

/// The value of a label.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

#[cfg(test)]
mod tests {
    use std::collections::{HashMap, HashSet};

    use magsteer_hal::operator::{Quantiles, StatusMessage, state};

    use super::super::{Figures, Link, Rig, RodFigures};
    use super::{escaped, number, open_metrics};
    use crate::config::{Config, Document};

    /// What the standard demands of a text, as far as it can be told from the text alone.
    fn refusal(text: &str) -> Option<String> {
        let Some(body) = text.strip_suffix("# EOF\n") else { return Some("no end".to_owned()) };
        let (mut families, mut samples) = (HashMap::new(), HashSet::new());
        let mut present = String::new();
        for line in body.split_terminator('\n') {
            if let Some(metadata) = line.strip_prefix("# ") {
                let [word, name, value] = metadata.splitn(3, ' ').collect::<Vec<_>>()[..] else {
                    return Some(format!("metadata: {line}"));
                };
                if word == "TYPE" && families.insert(name.to_owned(), value.to_owned()).is_some() {
                    return Some(format!("twice: {line}"));
                }
                if word == "UNIT" && !name.ends_with(&format!("_{value}")) {
                    return Some(format!("unit: {line}"));
                }
                if word != "TYPE" && name != present {
                    return Some(format!("apart: {line}"));
                }
                name.clone_into(&mut present);
                continue;
            }
            let (series, value) = line.rsplit_once(' ')?;
            let (name, labels) = series.strip_suffix('}')?.split_once('{')?;
            let kind = families.get(&present).map_or("", String::as_str);
            let expected = if kind == "counter" { format!("{present}_total") } else { present.clone() };
            let is_set = kind == "stateset";
            if name != expected
                || (is_set && !(labels.contains(&format!("{name}=\"")) && "01".contains(value)))
            {
                return Some(format!("sample of {kind} {present}: {line}"));
            }
            if value.parse::<f64>().is_err() || !samples.insert(series.to_owned()) {
                return Some(format!("value, or twice: {line}"));
            }
        }
        None
    }

    fn planar() -> Rig {
        let text = include_str!("../../config/bigmag-planar.toml");
        let document = Document::from_text("planar", text).expect("shipped");
        Rig::new(&Config::from_document(&document).expect("shipped"))
    }

    fn page(link: Link) -> String {
        let rig = planar();
        let mut status = StatusMessage { state: state::ACTIVE, missed: 3, ..StatusMessage::default() };
        status.timing.lateness =
            Quantiles { p50_us: 4.0, p99_us: 9.0, p999_us: 50.0, p9999_us: 90.0, max_us: 120.0 };
        status.measured.current_a[4] = -1.25;
        let figures = Figures::new(&rig, Some(&status), (link, Some(0.0), 0), RodFigures::default());
        open_metrics(&rig, &figures)
    }

    #[test]
    fn text_keeps_the_standard_and_the_check_finds_planted_faults() {
        let text = page(Link::Attached);
        assert_eq!(refusal(&text), None, "{text}");
        for (from, to) in [
            ("# EOF\n", ""),
            ("magsteer_missed_total{", "magsteer_missed{"),
            ("# UNIT magsteer_lateness_seconds seconds", "# UNIT magsteer_lateness_seconds us"),
            (
                "magsteer_state{rig=\"bigmag-planar\",magsteer_state=\"active\"} 1",
                "magsteer_state{rig=\"x\",magsteer_state=\"active\"} 2",
            ),
            ("# TYPE magsteer_cycles counter", "# TYPE magsteer_missed counter"),
            ("# TYPE magsteer_rate_hertz gauge\n", ""),
        ] {
            assert!(text.contains(from), "{from}");
            assert!(refusal(&text.replacen(from, to, 1)).is_some(), "{from} -> {to}");
        }
    }

    #[test]
    fn figures_stand_in_base_units_with_the_names_of_the_rig() {
        let text = page(Link::Attached);
        for line in [
            "magsteer_up{rig=\"bigmag-planar\"} 1",
            "magsteer_state{rig=\"bigmag-planar\",magsteer_state=\"active\"} 1",
            "magsteer_state{rig=\"bigmag-planar\",magsteer_state=\"fault\"} 0",
            "magsteer_missed_total{rig=\"bigmag-planar\"} 3",
            "magsteer_lateness_seconds{rig=\"bigmag-planar\",quantile=\"0.999\"} 0.00005",
            "magsteer_current_amperes{rig=\"bigmag-planar\",coil=\"air-bottom\"} -1.25",
            "magsteer_current_limit_amperes{rig=\"bigmag-planar\",coil=\"air-bottom\"} 8",
        ] {
            assert!(text.contains(&format!("\n{line}\n")), "{line}\n{text}");
        }
    }

    #[test]
    fn of_a_daemon_that_is_not_heard_nothing_but_that_is_told() {
        let text = page(Link::Stale);
        assert_eq!(refusal(&text), None);
        assert!(text.contains("magsteer_up{rig=\"bigmag-planar\"} 0\n"));
        assert_eq!(text.lines().filter(|line| !line.starts_with('#')).count(), 1);
    }

    #[test]
    fn labels_and_numbers_are_spelt_as_the_standard_wants() {
        assert_eq!(escaped("a\"b\\c\nd"), "a\\\"b\\\\c\\nd");
        assert_eq!(
            [number(f64::NAN), number(f64::INFINITY), number(-f64::INFINITY), number(1e-7)],
            ["NaN", "+Inf", "-Inf", "0.0000001"]
        );
    }
}
