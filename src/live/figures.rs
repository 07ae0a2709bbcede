//! A status as a person reads it, with the names and limits of the rig.

use magsteer_hal::operator::{StatusMessage, cause, recorder, safe_action, state, verdict};
use serde::Serialize;

use super::alert::{self, Alert};
use super::link::Link;
use super::rig::{Rig, millimetres};
use super::rod::RodFigures;
use crate::daemon::TimingSummary;

/// Share of its limit from which a current counts as at it.
const SATURATED: f64 = 0.999;

/// One magnet. Angles as [`super::Angles`] tells them; empty where there is no direction.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MagnetFigures {
    /// As set by the operator.
    pub target_deg: Vec<f64>,
    /// Reference that the loop follows.
    pub desired_deg: Vec<f64>,
    /// As measured.
    pub measured_deg: Vec<f64>,
    /// As the model has it.
    pub predicted_deg: Vec<f64>,
    /// Angle between the measured direction and the target.
    pub error_deg: Option<f64>,
    /// Centre as measured; `None` where it was not seen.
    pub position_mm: Option<[f64; 3]>,
}

/// One coil.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct CoilFigures {
    /// Measured.
    pub measured_a: f64,
    /// Sent last.
    pub commanded_a: f64,
    /// Greatest magnitude.
    pub limit_a: f64,
    /// True when the command is at its limit.
    pub saturated: bool,
}

/// One frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FrameFigures {
    /// Measured.
    pub measured_deg: f64,
    /// Sent last.
    pub commanded_deg: f64,
}

/// Everything of one moment. Before the first status, numbers are zero and `heard` is false.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// How the viewer stands to the daemon.
    pub link: Link,
    /// True once a status was heard.
    pub heard: bool,
    /// Age of the status.
    pub age_s: Option<f64>,
    /// Lives of the daemon after the first that was heard.
    pub restarts: u32,
    /// True when the daemon steers the rig of this viewer's configuration.
    pub same_rig: bool,
    /// As [`state::name`] has it.
    pub state: &'static str,
    /// Its code.
    pub state_code: u32,
    /// Why it stopped last; empty without a cause.
    pub cause: &'static str,
    /// Its code.
    pub cause_code: u32,
    /// Number of the cycle.
    pub cycle: u64,
    /// Configured rate.
    pub rate_hz: f64,
    /// Cycles a second over the last second.
    pub rate_measured_hz: f64,
    /// Periods skipped.
    pub missed: u64,
    /// How late the last cycle began.
    pub lateness_us: f64,
    /// How late the latest cycle since the former status began.
    pub lateness_max_us: f64,
    /// Age of the newest poses; `None` without any.
    pub pose_age_ms: Option<f64>,
    /// Timing since the daemon's start.
    pub timing: TimingSummary,
    /// Timing of the last whole minute; `None` during the first.
    pub last_minute: Option<TimingSummary>,
    /// Margin of stability: 1 at rest, 0 where the rod snaps through.
    pub stability_margin: f64,
    /// True while it is to be warned of.
    pub stability_low: bool,
    /// True when the model's equilibrium was found in the last cycle.
    pub model_converged: bool,
    /// What is known of the way to the target set last.
    pub target_verdict: &'static str,
    /// What a trip does with the currents.
    pub safe_action: &'static str,
    /// True when monitors judge, but do not act.
    pub passive: bool,
    /// Heat of the hottest coil: 1 is the limit.
    pub coil_heat: f64,
    /// "off", "recording" or "failing".
    pub recorder: &'static str,
    /// Flights written since the daemon's start.
    pub flights: u32,
    /// Events and flights that are lost for good.
    pub recorder_lost: u32,
    /// Cycles that the timing does not count.
    pub records_dropped: u64,
    /// Allocations of the loop's thread within its cycles, beyond the transport's.
    pub loop_allocations: u64,
    /// Base to tip.
    pub magnets: Vec<MagnetFigures>,
    /// In the order of the configuration.
    pub coils: Vec<CoilFigures>,
    /// In the order of the configuration.
    pub frames: Vec<FrameFigures>,
    /// The rod.
    pub rod: RodFigures,
    /// What nobody must overlook, the gravest first.
    pub alerts: Vec<Alert>,
}

impl Figures {
    /// A status of `age_s` as a person reads it; `link`, `restarts`: of the lifeline.
    #[must_use]
    pub fn new(
        rig: &Rig,
        status: Option<&StatusMessage>,
        (link, age_s, restarts): (Link, Option<f64>, u32),
        rod: RodFigures,
    ) -> Self {
        let same_rig = status.is_none_or(|status| is_of(status, rig));
        let mut alerts: Vec<Alert> = alert::of_link(link, age_s).into_iter().collect();
        alerts.extend(status.iter().flat_map(|status| alert::of_status(status, same_rig)));
        let heard = status.is_some();
        let nothing = StatusMessage::default();
        let status = status.unwrap_or(&nothing);
        Self {
            link,
            heard,
            age_s,
            restarts,
            same_rig,
            state: if heard { state::name(status.state) } else { "unknown" },
            state_code: status.state,
            cause: cause::text(status.cause),
            cause_code: status.cause,
            cycle: status.cycle,
            rate_hz: status.rate_hz,
            rate_measured_hz: status.rate_measured_hz,
            missed: status.missed,
            lateness_us: status.lateness_us,
            lateness_max_us: status.lateness_max_us,
            pose_age_ms: (heard && status.pose_age_us >= 0.0).then_some(status.pose_age_us * 1e-3),
            timing: TimingSummary::of_status(status),
            last_minute: TimingSummary::of_last_minute(status),
            stability_margin: status.stability_margin,
            stability_low: status.stability_low == 1,
            model_converged: status.model_converged == 1,
            target_verdict: verdict::name(status.target_verdict),
            safe_action: safe_action::name(status.safe_action),
            passive: status.passive == 1,
            coil_heat: status.coil_heat,
            recorder: recorder::name(status.recorder),
            flights: status.flights,
            recorder_lost: status.recorder_lost,
            records_dropped: status.records_dropped,
            loop_allocations: status.loop_allocations,
            magnets: (0..rig.magnets.len()).map(|magnet| magnet_figures(rig, status, magnet)).collect(),
            coils: (0..rig.coils.len()).map(|coil| coil_figures(rig, status, coil)).collect(),
            frames: (0..rig.frames.len()).map(|frame| frame_figures(status, frame)).collect(),
            rod,
            alerts,
        }
    }

    /// True when the daemon steers.
    #[must_use]
    pub fn steers(&self) -> bool {
        matches!(self.state_code, state::ACTIVE | state::HOLDING)
    }
}

/// True when a status tells of this rig.
pub(super) fn is_of(status: &StatusMessage, rig: &Rig) -> bool {
    status.description_fingerprint == rig.fingerprint
}

fn magnet_figures(rig: &Rig, status: &StatusMessage, magnet: usize) -> MagnetFigures {
    let angles = |directions: &[[f64; 3]]| {
        directions.get(magnet).map_or_else(Vec::new, |it| rig.angles_deg(it).as_slice().to_vec())
    };
    let position = status.measured_position_m.get(magnet).filter(|position| **position != [0.0; 3]);
    let pair = status.target_direction.get(magnet).zip(status.measured_direction.get(magnet));
    MagnetFigures {
        target_deg: angles(&status.target_direction),
        desired_deg: angles(&status.desired_direction),
        measured_deg: angles(&status.measured_direction),
        predicted_deg: angles(&status.predicted_direction),
        error_deg: pair.and_then(|(target, measured)| angle_between_deg(target, measured)),
        position_mm: position.map(|position| position.map(millimetres)),
    }
}

fn coil_figures(rig: &Rig, status: &StatusMessage, coil: usize) -> CoilFigures {
    let of = |currents: &[f64]| currents.get(coil).copied().unwrap_or_default();
    let (commanded_a, limit_a) = (of(&status.admitted.current_a), rig.current_max_a[coil]);
    CoilFigures {
        measured_a: of(&status.measured.current_a),
        commanded_a,
        limit_a,
        saturated: commanded_a.abs() >= SATURATED * limit_a,
    }
}

fn frame_figures(status: &StatusMessage, frame: usize) -> FrameFigures {
    let of = |angles: &[f64]| angles.get(frame).copied().unwrap_or_default().to_degrees();
    FrameFigures {
        measured_deg: of(&status.measured.angle_rad),
        commanded_deg: of(&status.admitted.angle_rad),
    }
}

/// `None` when one of the two is no direction.
fn angle_between_deg(one: &[f64; 3], other: &[f64; 3]) -> Option<f64> {
    let [one, other] = [one, other].map(|it| nalgebra::Vector3::from(*it));
    let told = one.norm() > 0.5 && other.norm() > 0.5;
    // Precise near 0 and 180 deg too, unlike the arc cosine.
    told.then(|| one.cross(&other).norm().atan2(one.dot(&other)).to_degrees())
}
