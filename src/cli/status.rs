//! `magsteer status`: what the daemon does.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use magsteer::daemon::target::angle_from_z_deg;
use magsteer::daemon::{StopFlag, TimingSummary};
use magsteer_hal::channels::OperatorClient;
use magsteer_hal::operator::{StatusMessage, cause, recorder, safe_action, state, verdict};
use magsteer_hal::{HardwareDescription, Stamp};
use serde::Serialize;

use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure};
use super::operator::connect;
use super::output;
use super::rig_file::RigArgs;
use super::target::await_status;

/// Between two lines of `--watch`.
const WATCH_PERIOD: Duration = Duration::from_millis(500);
/// A status older than this is no longer the daemon's.
const STATUS_AGE_MAX: Duration = Duration::from_secs(2);
/// Measurements older than this are marked as such: longer than the slowest sensor takes, µs.
const MEASURED_AGE_MAX_US: f64 = 200e3;

/// Show what the daemon of a rig does.
///
/// Ends with 0, with 69 when no daemon publishes its status, with 130 after Ctrl-C.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer status --json")]
pub struct Status {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    rig: RigArgs,
    /// Go on, twice a second, until the daemon ends.
    #[arg(long)]
    watch: bool,
    /// Print one JSON object, or one a line with `--watch`.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `state`, `cause`, `cycle`, `rate_hz`, `targets_deg`, `measured_deg`, `currents_a`, `angles_deg`,
/// `pose_age_us`, `feedback_age_us`, `missed`, `stability_margin`, `target_verdict`, `recorder`, `loop` and `last_minute`. Angles of
/// tangents are those from global z; absent values are null.
#[derive(Serialize)]
struct Answer {
    state: &'static str,
    /// True when the rig is on another machine, watched through a tunnel.
    distant: bool,
    /// Why the daemon stopped last, or why it does not leave boot.
    cause: Option<&'static str>,
    cause_code: u32,
    cycle: u64,
    /// Configured rate.
    rate_hz: f64,
    /// Cycles a second over the last second; 0 during the first.
    rate_measured_hz: f64,
    /// As set by the operator.
    targets_deg: Vec<Option<f64>>,
    /// Reference that the loop follows on its way to the target.
    desired_deg: Vec<Option<f64>>,
    measured_deg: Vec<Option<f64>>,
    predicted_deg: Vec<Option<f64>>,
    /// Measured.
    currents_a: Vec<f64>,
    /// Sent last.
    commanded_currents_a: Vec<f64>,
    /// Measured.
    angles_deg: Vec<f64>,
    pose_age_us: Option<f64>,
    /// Age of the measured currents and angles.
    feedback_age_us: Option<f64>,
    lateness_us: f64,
    /// Since the previous status.
    lateness_max_us: f64,
    missed: u64,
    model_converged: bool,
    /// 1 at rest, 0 where the rod snaps through.
    stability_margin: f64,
    /// True while it is to be warned of.
    stability_low: bool,
    /// Field of each coil that the model believes in, over that of its description; 1 where it is not learnt.
    coil_gains: Vec<f64>,
    /// "unchecked", "checking", "clear", "out-of-reach" or "refused": what is known of the way to the target set last.
    target_verdict: &'static str,
    /// Timing since the start.
    #[serde(rename = "loop")]
    timing: TimingSummary,
    /// Timing of the last whole minute; null during the first.
    last_minute: Option<TimingSummary>,
    /// Cycles that neither of the two counts.
    records_dropped: u64,
    /// Allocations of the loop's thread within its cycles, beyond the transport's.
    alloc_in_cycle: u64,
    /// "off", "recording" or "failing".
    recorder: &'static str,
    /// What keeps the recorder from writing.
    recorder_error: Option<String>,
    /// Written since the daemon's start.
    flights: u32,
    /// Events and flights that are lost for good.
    recorder_lost: u32,
    /// True when monitors judge, but do not act.
    passive: bool,
    /// The worst cause for which a passive daemon would have stopped since it was armed or reset.
    would_trip: Option<&'static str>,
    would_trip_code: u32,
    /// How often one began since its start.
    would_trip_count: u64,
    /// "ramp", "hold-then-ramp" or "disable": what a trip does with the currents.
    safe_action: &'static str,
    /// Heat of the hottest coil by its measured current; 1 is the limit.
    coil_heat: f64,
    /// True while it is to be warned of.
    coil_hot: bool,
}

impl Status {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let mut client = connect(&self.rig, self.file.as_deref())?;
        // A rig that is named needs no configuration; what there is has the names of its parts.
        let rig = self.rig.load(self.file.as_deref()).ok().map(|config| config.description);
        if !self.watch {
            self.show(&mut client, rig.as_ref())?;
            return Ok(Exit::Success);
        }
        let stop = Arc::new(StopFlag::new());
        watching(&stop, false, || (), || self.follow(&mut client, rig.as_ref(), &stop))?
    }

    fn follow(
        &self,
        client: &mut OperatorClient,
        rig: Option<&HardwareDescription>,
        stop: &StopFlag,
    ) -> anyhow::Result<Exit> {
        while stop.requested().is_none() {
            self.show(client, rig)?;
            std::thread::sleep(WATCH_PERIOD);
        }
        Ok(exit_of(stop))
    }

    /// Prints the newest status.
    fn show(&self, client: &mut OperatorClient, rig: Option<&HardwareDescription>) -> anyhow::Result<()> {
        let status = await_status(client)?;
        let age = Stamp::now().since(Stamp::from_nanoseconds(status.header.publish_stamp_ns));
        if age > STATUS_AGE_MAX {
            let message = anyhow::anyhow!("the last status is {:.1} s old", age.as_secs_f64());
            return Err(Failure::with(Exit::Unavailable, message));
        }
        let answer = Answer { distant: client.is_distant(), ..Answer::new(&status) };
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(answer.text(&Names::of(rig, &status)))?;
        }
        Ok(())
    }
}

/// Names of a rig's magnets and frames.
#[derive(Debug, Default)]
struct Names {
    magnets: Vec<String>,
    frames: Vec<String>,
}

impl Names {
    /// Those of the rig at hand, if it is the daemon's; none otherwise.
    fn of(rig: Option<&HardwareDescription>, status: &StatusMessage) -> Self {
        let rig = rig.filter(|rig| rig.fingerprint() == status.description_fingerprint);
        rig.map_or_else(Self::default, |rig| Self {
            magnets: rig.magnets().map(|magnet| magnet.name.clone()).collect(),
            frames: rig.frames.iter().map(|frame| frame.name.clone()).collect(),
        })
    }
}

/// Values with two decimals behind their names; without names alone.
fn numbers<'a>(names: &[String], values: impl IntoIterator<Item = &'a Option<f64>>) -> String {
    let shown = values.into_iter().enumerate().map(|(index, value)| {
        let value = value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        names.get(index).map_or(value.clone(), |name| format!("{name} {value}"))
    });
    shown.collect::<Vec<_>>().join("  ")
}

/// How long ago something was measured, where that is worth saying.
fn since(age_us: Option<f64>) -> String {
    match age_us {
        None => "  (never heard)".to_owned(),
        Some(age) if age > MEASURED_AGE_MAX_US => format!("  ({:.1} s ago)", age * 1e-6),
        Some(_) => String::new(),
    }
}

impl Answer {
    fn new(status: &StatusMessage) -> Self {
        // Counts come from another process: they must not reach beyond the arrays.
        let used = |count: u32, capacity: usize| (count as usize).min(capacity);
        let magnets = used(status.magnet_count, status.target_direction.len());
        let coils = used(status.coil_count, status.measured.current_a.len());
        let frames = used(status.pose_parameter_count, status.measured.angle_rad.len());
        let angles = |directions: &[[f64; 3]]| directions[..magnets].iter().map(angle_from_z_deg).collect();
        Self {
            state: state::name(status.state),
            distant: false,
            cause: (status.cause != 0).then(|| cause::text(status.cause)),
            cause_code: status.cause,
            cycle: status.cycle,
            rate_hz: status.rate_hz,
            rate_measured_hz: status.rate_measured_hz,
            targets_deg: angles(&status.target_direction),
            desired_deg: angles(&status.desired_direction),
            measured_deg: angles(&status.measured_direction),
            predicted_deg: angles(&status.predicted_direction),
            currents_a: status.measured.current_a[..coils].to_vec(),
            commanded_currents_a: status.admitted.current_a[..coils].to_vec(),
            angles_deg: status.measured.angle_rad[..frames].iter().map(|it| it.to_degrees()).collect(),
            pose_age_us: (status.pose_age_us >= 0.0).then_some(status.pose_age_us),
            feedback_age_us: (status.feedback_age_us >= 0.0).then_some(status.feedback_age_us),
            lateness_us: status.lateness_us,
            lateness_max_us: status.lateness_max_us,
            missed: status.missed,
            model_converged: status.model_converged == 1,
            stability_margin: status.stability_margin,
            stability_low: status.stability_low == 1,
            coil_gains: status.coil_gain[..coils].to_vec(),
            target_verdict: verdict::name(status.target_verdict),
            timing: TimingSummary::of_status(status),
            last_minute: TimingSummary::of_last_minute(status),
            records_dropped: status.records_dropped,
            alloc_in_cycle: status.loop_allocations,
            recorder: recorder::name(status.recorder),
            recorder_error: (status.recorder_error != 0).then(|| system_error(status.recorder_error)),
            flights: status.flights,
            recorder_lost: status.recorder_lost,
            passive: status.passive == 1,
            would_trip: (status.would_trip != 0).then(|| cause::text(status.would_trip)),
            would_trip_code: status.would_trip,
            would_trip_count: status.would_trip_count,
            safe_action: safe_action::name(status.safe_action),
            coil_heat: status.coil_heat,
            coil_hot: status.coil_hot == 1,
        }
    }

    /// What people must not overlook; nothing when there is nothing.
    fn guards(&self) -> String {
        let mut lines = String::new();
        if self.distant {
            lines +=
                "DISTANT  on another machine; what is shown came through a tunnel that carries no commands\n";
        }
        if self.passive {
            let worst = self.would_trip.unwrap_or("nothing");
            let count = self.would_trip_count;
            lines +=
                &format!("PASSIVE  monitors do not act; would have stopped for: {worst} ({count} in all)\n");
        }
        if self.coil_hot {
            lines +=
                &format!("HOT      a coil holds {:.0} % of the heat that it may\n", 100.0 * self.coil_heat);
        }
        lines
    }

    fn text(&self, names: &Names) -> String {
        let cause = self.cause.map_or(String::new(), |cause| format!(" ({cause})"));
        let all = |values: &[f64]| values.iter().copied().map(Some).collect::<Vec<_>>();
        let target = if self.targets_deg.iter().all(Option::is_none) {
            "none was set".to_owned()
        } else {
            format!("{} deg ({})", numbers(&names.magnets, &self.targets_deg), self.target_verdict)
        };
        let age = self.pose_age_us.map_or("none".to_owned(), |age| format!("{:.1} ms old", age * 1e-3));
        format!(
            "{}{cause}, cycle {}, {:.0} of {:.0} Hz, {} missed, late {:.0} us, poses {age}\n\
            target   {target}\nmeasured {} deg{}\ncurrents {} A{}\nframes   {} deg\nmargin   {:.2}{}\n{}{}{}",
            self.state,
            self.cycle,
            self.rate_measured_hz,
            self.rate_hz,
            self.missed,
            self.lateness_us,
            numbers(&names.magnets, &self.measured_deg),
            since(self.pose_age_us),
            numbers(&[], &all(&self.currents_a)),
            since(self.feedback_age_us),
            numbers(&names.frames, &all(&self.angles_deg)),
            self.stability_margin,
            if self.stability_low { ": close to a snap-through" } else { "" },
            self.gains_text(),
            self.guards(),
            self.recorder_text(),
        )
    }

    /// A line where gains are learnt.
    fn gains_text(&self) -> String {
        if self.coil_gains.iter().all(|gain| *gain == 1.0) {
            return String::new();
        }
        let gains = self.coil_gains.iter().copied().map(Some).collect::<Vec<_>>();
        format!("gains    {}\n", numbers(&[], &gains))
    }

    /// A line when there is something to know.
    fn recorder_text(&self) -> String {
        let mut text = String::new();
        if let Some(error) = &self.recorder_error {
            text += &format!("; cannot write: {error}");
        }
        if self.flights > 0 {
            text += &format!("; flights written: {}", self.flights);
        }
        if self.recorder_lost > 0 {
            text += &format!("; events and flights lost: {}", self.recorder_lost);
        }
        if text.is_empty() { text } else { format!("recorder {}{text}\n", self.recorder) }
    }
}

/// What a number of the system's errors means.
fn system_error(code: u32) -> String {
    match i32::try_from(code) {
        Ok(code) => std::io::Error::from_raw_os_error(code).to_string(),
        Err(_) => "the system gives no reason".to_owned(),
    }
}
