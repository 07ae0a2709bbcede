//! What nobody must overlook.

use magsteer_hal::operator::{StatusMessage, cause, recorder, state, verdict};
use serde::Serialize;

use super::link::Link;

/// How much it matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// To be known.
    Note,
    /// Not as it should be.
    Warning,
    /// Somebody must act.
    Grave,
}

/// One line.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Alert {
    /// How much it matters.
    pub level: Level,
    /// What there is to know.
    pub text: String,
}

impl Alert {
    fn new(level: Level, text: impl Into<String>) -> Self {
        Self { level, text: text.into() }
    }
}

/// What a viewer says of its link.
pub(super) fn of_link(link: Link, age_s: Option<f64>) -> Option<Alert> {
    match (link, age_s) {
        (Link::Attached, _) => None,
        (Link::Absent, _) => Some(Alert::new(Level::Warning, "no daemon serves this rig: waiting for one")),
        (Link::Waiting, _) => {
            Some(Alert::new(Level::Warning, "the daemon's channels are there, its status is not"))
        }
        (Link::Stale, age) => {
            let age = age.map_or(String::new(), |age| format!(" for {age:.0} s"));
            Some(Alert::new(Level::Grave, format!("no word from the daemon{age}: what is shown is old")))
        }
    }
}

/// What a viewer says of a rig on another machine.
pub(super) fn of_distance() -> Alert {
    let text = "watched from another machine: ages count from the shortest way here; no commands pass";
    Alert::new(Level::Note, text)
}

/// What a status says, the gravest first.
pub(super) fn of_status(status: &StatusMessage, same_rig: bool) -> Vec<Alert> {
    let mut alerts = Vec::new();
    let mut tell = |holds: bool, level: Level, text: &dyn Fn() -> String| {
        if holds {
            alerts.push(Alert::new(level, text()));
        }
    };
    let steers = matches!(status.state, state::ACTIVE | state::HOLDING);
    let because = cause::text(status.cause);
    tell(!same_rig, Level::Grave, &|| {
        "the daemon runs another configuration than this viewer: give the same file to both".to_owned()
    });
    tell(status.state == state::FAULT, Level::Grave, &|| {
        format!("fault: {because}; reset when it is mended")
    });
    tell(status.state == state::SAFE_STOP, Level::Warning, &|| format!("stopping: {because}"));
    tell(status.coil_hot == 1, Level::Warning, &|| {
        format!("a coil holds {:.0} % of the heat that it may", 100.0 * status.coil_heat)
    });
    tell(status.stability_low == 1, Level::Warning, &|| "close to a snap-through".to_owned());
    tell(steers && status.model_converged != 1, Level::Warning, &|| {
        "the model found no equilibrium".to_owned()
    });
    tell(status.target_verdict == verdict::REFUSED, Level::Warning, &|| format!("target refused: {because}"));
    tell(status.target_verdict == verdict::OUT_OF_REACH, Level::Note, &|| {
        "the target is beyond the currents: the loop goes as far as they lead".to_owned()
    });
    tell(status.recorder == recorder::FAILING, Level::Warning, &|| "the recorder cannot write".to_owned());
    tell(status.recorder_lost > 0, Level::Warning, &|| {
        format!("{} events and flights are lost", status.recorder_lost)
    });
    tell(status.records_dropped > 0, Level::Note, &|| {
        format!("{} cycle records were dropped", status.records_dropped)
    });
    tell(status.passive == 1, Level::Warning, &|| match status.would_trip {
        0 => "passive: monitors do not act".to_owned(),
        code => format!("passive: monitors do not act; would have stopped for: {}", cause::text(code)),
    });
    alerts.sort_by_key(|alert| std::cmp::Reverse(alert.level));
    alerts
}
