//! `[daemon]` of the configuration file: rate, time limits, real-time policy.
//!
//! Every limit is a time, so that a change of the rate changes no limit. How each follows from the
//! physics or from the machine stands at its field.

use std::time::Duration;

use magsteer_hal::invalid::{Checks, Invalid};
use serde::{Deserialize, Serialize};

use super::clock::Pace;
use super::monitors::MonitorsConfig;
use super::recorder::RecorderConfig;

/// What to do where the kernel does not grant real time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RealtimePolicy {
    /// Run with what is granted and report what is missing.
    BestEffort,
    /// Refuse to arm.
    Enforce,
}

/// Whether monitors act.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// They stop the daemon.
    Active,
    /// They judge and tell, for commissioning; what is no monitor's acts all the same.
    Passive,
}

/// What a trip does with the currents. What an operator orders ramps to zero in any case, and a driver that hears
/// nothing valid ramps to zero by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SafeAction {
    /// Ramp to zero within the slew limit: the rod sags to its unloaded shape within some tenths of a second.
    Ramp,
    /// Keep the currents for `safe_hold_ms`, then ramp: the rod stays where it is while someone decides. Only for
    /// causes that leave the currents known and harmless; others ramp at once.
    HoldThenRamp,
    /// Cut the amplifiers: the currents fall as fast as the coils let them, and the rod with them.
    Disable,
}

impl SafeAction {
    /// The code that messages carry: one of [`magsteer_hal::operator::safe_action`].
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::Ramp => magsteer_hal::operator::safe_action::RAMP,
            Self::HoldThenRamp => magsteer_hal::operator::safe_action::HOLD_THEN_RAMP,
            Self::Disable => magsteer_hal::operator::safe_action::DISABLE,
        }
    }
}

/// `[daemon]`. Every key is required but `cpu`, `idle_latency_us` and the table `recorder`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DaemonConfig {
    /// Cycles a second, 50 to 10000.
    pub rate_hz: f64,
    /// A command is void this long after it was sent, ms; the driver then ramps to zero alone. 2 periods to 1000.
    /// Longer than the longest pause of the machine, shorter than the rod's drift to harm.
    pub command_validity_ms: f64,
    /// Poses older than this make the loop hold its currents, ms. Depends on the sensor: above its
    /// latency plus two of its periods. A direct tracker (200 Hz, 5 ms) needs 15 and more, a camera
    /// (30 Hz, 60 ms) 130 and more; on top comes the pause of the machine to ride through.
    pub pose_hold_ms: f64,
    /// Poses older than this end in a ramp to zero, ms. Above `pose_hold_ms`: how long the rod may be
    /// held open-loop. 250 for a direct tracker, 500 for a camera.
    pub pose_stop_ms: f64,
    /// Poses in which a magnet points further than this from where the model has it are not believed: they
    /// count as none, as do those of half of `pose_hold_ms` after, deg, 1 to 180 (which believes anything).
    /// Above the model's error and what the rod turns by within the age of the poses.
    pub pose_error_max_deg: f64,
    /// A measured current this far from the commanded one for `following_stop_ms` is a trip, A, > 0. Above
    /// what the amplifiers lag behind a step of the allocation.
    pub following_current_max_a: f64,
    /// The same for a measured frame angle, deg, above 0, to 360. Above lag and backlash of the motors.
    pub following_angle_max_deg: f64,
    /// How much longer currents and angles may stay away from commands than near them, ms, 2 periods to 5000.
    /// Above the time in which the amplifiers make up for the largest step that the slew limit allows.
    pub following_stop_ms: f64,
    /// Feedback older than this, or whose echo of commands stands still for so long, is a trip, ms, 2 periods
    /// to 5000.
    pub feedback_stop_ms: f64,
    /// Without a converged model for this long the loop stops, ms, 1 to 5000.
    pub model_stop_ms: f64,
    /// Margin of stability (1 at rest, 0 at the snap-through) below which the status warns, -10 to 10.
    pub stability_warn: f64,
    /// Below this the daemon goes no further: it keeps currents and frames as they are until another target
    /// is set, -10 to `stability_warn`; -10 never holds. Keeping currents is no motion and keeps the margin,
    /// which steering on might not: even a reference at rest lets currents decay in directions that do not
    /// turn the magnets. Above what the model's errors hide, below what steps of the targets pass through.
    /// From below it a motion may begin that loses no more than half of the margin left.
    pub stability_hold: f64,
    /// Below this for `stability_stop_ms` the daemon ramps to zero, -10 to `stability_hold`; -10 never does.
    /// A ramp is a motion too, of some tens of degrees within a tenth of a second, and from near a
    /// snap-through it may pass through one: above 0 it is therefore worse than keeping the currents. Below 0
    /// no rod stays where the model has it: it has snapped or is about to, and is steered by the Jacobian of
    /// a shape that it does not have. Without currents it has one shape only, so that a ramp ends where it is
    /// known to be.
    pub stability_stop: f64,
    /// How long the margin may stay below `stability_stop`, ms, 1 to 5000. Above what the first mode swings across.
    pub stability_stop_ms: f64,
    /// A ramp to zero that takes longer cuts the amplifiers, ms, 10 to 10000. Above the greatest current
    /// over its slew limit plus five time constants of the coils.
    pub ramp_timeout_ms: f64,
    /// A ramp to zero is over when every measured current is below this, A, > 0. Above the noise of the
    /// current sensors.
    pub ramp_done_a: f64,
    /// A measured current this far beyond its coil's limit cuts the amplifiers, A, > 0. Above
    /// overshoot and noise.
    pub overcurrent_margin_a: f64,
    /// The driver must confirm a claim of authority within this time, ms, 1 to 150: the operator waits 200 ms
    /// for an answer.
    pub arm_timeout_ms: f64,
    /// Missed periods trip the loop when they exceed this share over `overrun_window_ms`, above 0, below 1.
    pub overrun_fraction: f64,
    /// Time over which overruns are judged, ms, 10 periods to 10000. A single stall trips when it lasts this long.
    pub overrun_window_ms: f64,
    /// `"best-effort"` or `"enforce"`.
    pub realtime: RealtimePolicy,
    /// Priority under `SCHED_FIFO`, 1 to 99.
    pub priority: u32,
    /// The loop's CPU; absent to leave it to the scheduler.
    pub cpu: Option<u32>,
    /// True to lock the process's memory.
    pub lock_memory: bool,
    /// Longest time that a CPU may take to wake from idling while the daemon runs, us, 0 to 10000; absent to
    /// leave it to the kernel. 0 keeps every CPU of the machine awake: the least lateness, at full power.
    pub idle_latency_us: Option<u32>,
    /// How long before a deadline the loop's thread wakes to wait for it at the clock, us, 0 (off) to 200 and
    /// half a period. Takes wake-up latency off the lateness for `spin_us` of computing time a cycle.
    pub spin_us: f64,
    /// Status messages a second, 1 to 1000.
    pub status_rate_hz: f64,
    /// `[daemon.recorder]`; absent to record nothing.
    pub recorder: Option<RecorderConfig>,
    /// `"active"` or `"passive"`.
    pub mode: Mode,
    /// `"ramp"`, `"hold-then-ramp"` or `"disable"`.
    pub safe_action: SafeAction,
    /// How long `"hold-then-ramp"` keeps the currents, ms, 0 to 60000: as long as coils and rod bear it, and as someone
    /// takes to decide.
    pub safe_hold_ms: f64,
    /// `[daemon.monitors]`
    pub monitors: MonitorsConfig,
}

/// The limits that the supervisor judges by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Poses older than this: hold.
    pub pose_hold: Duration,
    /// Poses older than this: stop.
    pub pose_stop: Duration,
    /// A magnet further than this from where the model has it, rad: not believed.
    pub pose_error_max: f64,
    /// A current further than this from the commanded, A: astray.
    pub following_current_max: f64,
    /// An angle further than this from the commanded, rad: astray.
    pub following_angle_max: f64,
    /// Astray for longer: stop.
    pub following_stop: Duration,
    /// Feedback older than this: stop.
    pub feedback_stop: Duration,
    /// Model unusable for longer: stop.
    pub model_stop: Duration,
    /// Margin of stability below this: warn.
    pub stability_warn: f64,
    /// Margin below this: hold.
    pub stability_hold: f64,
    /// Margin below this: stop, when it lasts.
    pub stability_stop: f64,
    /// Margin below that for longer: stop.
    pub stability_stop_time: Duration,
    /// Ramp longer than this: disable.
    pub ramp_timeout: Duration,
    /// Currents below this count as zero, A.
    pub ramp_done: f64,
    /// Currents are held for so long before a ramp.
    pub safe_hold: Duration,
    /// Claim unconfirmed for longer: refuse to arm.
    pub arm_timeout: Duration,
    /// Validity of a command; writes failing for longer: stop.
    pub command_validity: Duration,
    /// Share of missed periods at which the overrun bucket fills.
    pub overrun_fraction: f64,
    /// Missed periods that the overrun bucket holds.
    pub overrun_capacity: f64,
}

impl DaemonConfig {
    /// Every value that is out of its range or contradicts another, with keys below `daemon`.
    #[must_use]
    pub fn check(&self) -> Vec<Invalid> {
        let mut checks = Checks::new();
        checks.within("daemon.rate_hz", self.rate_hz, 50.0, 10_000.0);
        let period_ms = if self.rate_hz > 0.0 { 1_000.0 / self.rate_hz } else { 1.0 };
        let ranges = [
            ("command_validity_ms", self.command_validity_ms, 2.0 * period_ms, 1_000.0),
            ("pose_hold_ms", self.pose_hold_ms, 1.0, 5_000.0),
            ("pose_stop_ms", self.pose_stop_ms, 1.0, 10_000.0),
            ("pose_error_max_deg", self.pose_error_max_deg, 1.0, 180.0),
            ("following_stop_ms", self.following_stop_ms, 2.0 * period_ms, 5_000.0),
            ("feedback_stop_ms", self.feedback_stop_ms, 2.0 * period_ms, 5_000.0),
            ("model_stop_ms", self.model_stop_ms, 1.0, 5_000.0),
            ("stability_warn", self.stability_warn, -10.0, 10.0),
            ("stability_hold", self.stability_hold, -10.0, self.stability_warn.clamp(-10.0, 10.0)),
            ("stability_stop", self.stability_stop, -10.0, self.stability_hold.clamp(-10.0, 10.0)),
            ("stability_stop_ms", self.stability_stop_ms, 1.0, 5_000.0),
            ("ramp_timeout_ms", self.ramp_timeout_ms, 10.0, 10_000.0),
            ("arm_timeout_ms", self.arm_timeout_ms, 1.0, 150.0),
            ("safe_hold_ms", self.safe_hold_ms, 0.0, 60_000.0),
            ("overrun_window_ms", self.overrun_window_ms, 10.0 * period_ms, 10_000.0),
        ];
        for (key, value, least, most) in ranges {
            checks.within(format!("daemon.{key}"), value, least, most);
        }
        checks.require(
            self.pose_stop_ms > self.pose_hold_ms || self.pose_hold_ms.is_nan(),
            "daemon.pose_stop_ms",
            self.pose_stop_ms,
            format!("above pose_hold_ms = {}", self.pose_hold_ms),
        );
        checks.positive("daemon.following_current_max_a", self.following_current_max_a);
        let angle = self.following_angle_max_deg;
        let holds = angle > 0.0 && angle <= 360.0;
        checks.require(holds, "daemon.following_angle_max_deg", angle, "above 0, at most 360");
        checks.positive("daemon.ramp_done_a", self.ramp_done_a);
        checks.positive("daemon.overcurrent_margin_a", self.overcurrent_margin_a);
        let share = self.overrun_fraction;
        checks.require(share > 0.0 && share < 1.0, "daemon.overrun_fraction", share, "above 0 and below 1");
        checks.require((1..=99).contains(&self.priority), "daemon.priority", self.priority, "from 1 to 99");
        let cpu_fits = self.cpu.is_none_or(|cpu| cpu < 1_024);
        checks.require(cpu_fits, "daemon.cpu", self.cpu.unwrap_or(0), "from 0 to 1023");
        let idle = self.idle_latency_us.unwrap_or(0);
        checks.require(idle <= 10_000, "daemon.idle_latency_us", idle, "from 0 to 10000");
        checks.within("daemon.spin_us", self.spin_us, 0.0, (500.0 * period_ms).clamp(0.0, 200.0));
        checks.within("daemon.status_rate_hz", self.status_rate_hz, 1.0, 1_000.0);
        self.recorder.iter().for_each(|recorder| recorder.check(&mut checks));
        self.monitors.check(&mut checks);
        checks.into_result(()).err().unwrap_or_default()
    }

    /// Time from one deadline to the next, whole nanoseconds.
    #[must_use]
    pub fn period(&self) -> Duration {
        Duration::from_nanos((1e9 / self.rate_hz).round() as u64)
    }

    /// How the loop's thread waits for its deadlines.
    #[must_use]
    pub fn pace(&self) -> Pace {
        let spin = Duration::try_from_secs_f64(self.spin_us * 1e-6).unwrap_or(Duration::ZERO);
        Pace { period: self.period(), spin }
    }

    /// Time between two status messages.
    #[must_use]
    pub fn status_period(&self) -> Duration {
        Duration::from_nanos((1e9 / self.status_rate_hz).round() as u64)
    }

    /// The limits in the supervisor's units.
    #[must_use]
    pub fn limits(&self) -> Limits {
        let window_periods = self.overrun_window_ms * 1e-3 * self.rate_hz;
        Limits {
            pose_hold: milliseconds(self.pose_hold_ms),
            pose_stop: milliseconds(self.pose_stop_ms),
            pose_error_max: self.pose_error_max_deg.to_radians(),
            following_current_max: self.following_current_max_a,
            following_angle_max: self.following_angle_max_deg.to_radians(),
            following_stop: milliseconds(self.following_stop_ms),
            feedback_stop: milliseconds(self.feedback_stop_ms),
            model_stop: milliseconds(self.model_stop_ms),
            stability_warn: self.stability_warn,
            stability_hold: self.stability_hold,
            stability_stop: self.stability_stop,
            stability_stop_time: milliseconds(self.stability_stop_ms),
            ramp_timeout: milliseconds(self.ramp_timeout_ms),
            ramp_done: self.ramp_done_a,
            safe_hold: milliseconds(self.safe_hold_ms),
            arm_timeout: milliseconds(self.arm_timeout_ms),
            command_validity: milliseconds(self.command_validity_ms),
            overrun_fraction: self.overrun_fraction,
            // A loop that misses every period gains 1 - fraction a period: full after one window.
            overrun_capacity: (1.0 - self.overrun_fraction) * window_periods,
        }
    }
}

fn milliseconds(value: f64) -> Duration {
    Duration::try_from_secs_f64(value * 1e-3).unwrap_or(Duration::ZERO)
}

#[cfg(test)]
pub(super) mod tests {
    use super::{DaemonConfig, RealtimePolicy};

    fn shipped_table() -> toml::Table {
        let file: toml::Table = include_str!("../../config/bigmag-planar.toml").parse().expect("shipped");
        file["daemon"].as_table().expect("a table").clone()
    }

    /// The values of the shipped file.
    pub fn shipped() -> DaemonConfig {
        shipped_table().try_into().expect("shipped")
    }

    #[test]
    fn shipped_values_are_accepted() {
        assert_eq!(shipped().check(), vec![]);
        assert_eq!(shipped().realtime, RealtimePolicy::BestEffort);
        assert_eq!(shipped().period(), std::time::Duration::from_millis(1));
    }

    #[test]
    fn every_key_but_cpu_idle_latency_and_recorder_is_required_and_unknown_keys_are_refused() {
        let read = |table: toml::Table| table.try_into::<DaemonConfig>();
        for key in shipped_table().keys().filter(|key| *key != "recorder") {
            let mut without = shipped_table();
            without.remove(key);
            assert!(read(without).is_err(), "accepted without {key}");
        }
        let with = |key: &str| {
            let mut table = shipped_table();
            table.insert(key.to_owned(), 1.into());
            read(table)
        };
        assert!(with("rate").is_err());
        assert!(with("cpu").is_ok());
        assert!(with("idle_latency_us").is_ok());
    }

    #[test]
    fn each_bad_value_is_named_by_its_key() {
        type Edit = fn(&mut DaemonConfig);
        let cases: [(&str, Edit); 51] = [
            ("rate_hz", |config| config.rate_hz = 49.0),
            ("rate_hz", |config| config.rate_hz = 10_001.0),
            ("rate_hz", |config| config.rate_hz = f64::NAN),
            ("command_validity_ms", |config| config.command_validity_ms = 1.0),
            ("pose_hold_ms", |config| config.pose_hold_ms = -1.0),
            ("pose_stop_ms", |config| config.pose_stop_ms = 50.0),
            ("pose_stop_ms", |config| config.pose_stop_ms = f64::INFINITY),
            ("pose_error_max_deg", |config| config.pose_error_max_deg = 0.0),
            ("pose_error_max_deg", |config| config.pose_error_max_deg = 200.0),
            ("following_current_max_a", |config| config.following_current_max_a = 0.0),
            ("following_angle_max_deg", |config| config.following_angle_max_deg = f64::NAN),
            ("following_stop_ms", |config| config.following_stop_ms = 1.0),
            ("feedback_stop_ms", |config| config.feedback_stop_ms = 0.0),
            ("model_stop_ms", |config| config.model_stop_ms = 0.0),
            ("stability_warn", |config| config.stability_warn = f64::NAN),
            ("stability_hold", |config| config.stability_hold = config.stability_warn + 0.1),
            ("stability_hold", |config| config.stability_hold = -11.0),
            ("stability_stop", |config| config.stability_stop = config.stability_hold + 0.1),
            ("stability_stop_ms", |config| config.stability_stop_ms = 0.0),
            ("ramp_timeout_ms", |config| config.ramp_timeout_ms = 1.0),
            ("ramp_done_a", |config| config.ramp_done_a = 0.0),
            ("overcurrent_margin_a", |config| config.overcurrent_margin_a = -0.5),
            ("arm_timeout_ms", |config| config.arm_timeout_ms = 200.0),
            ("overrun_fraction", |config| config.overrun_fraction = 1.0),
            ("overrun_fraction", |config| config.overrun_fraction = f64::NAN),
            ("overrun_window_ms", |config| config.overrun_window_ms = 5.0),
            ("priority", |config| config.priority = 0),
            ("priority", |config| config.priority = 100),
            ("cpu", |config| config.cpu = Some(4_096)),
            ("idle_latency_us", |config| config.idle_latency_us = Some(10_001)),
            ("spin_us", |config| config.spin_us = -1.0),
            ("spin_us", |config| config.spin_us = 201.0),
            ("spin_us", |config| config.spin_us = f64::NAN),
            ("spin_us", |config| (config.spin_us, config.rate_hz) = (51.0, 10_000.0)),
            ("status_rate_hz", |config| config.status_rate_hz = 0.0),
            ("safe_hold_ms", |config| config.safe_hold_ms = -1.0),
            ("monitors.current_error_max_a", |config| config.monitors.current_error_max_a = 0.0),
            ("monitors.current_error_share", |config| config.monitors.current_error_share = 1.5),
            ("monitors.open_current_a", |config| config.monitors.open_current_a = f64::NAN),
            ("monitors.open_share", |config| config.monitors.open_share = 1.0),
            ("monitors.open_stop_ms", |config| config.monitors.open_stop_ms = 0.0),
            ("monitors.angle_error_max_deg", |config| config.monitors.angle_error_max_deg = 0.0),
            ("monitors.coil_current_continuous_a", |config| config.monitors.coil_current_continuous_a = 0.0),
            ("monitors.coil_heat_time_constant_s", |config| config.monitors.coil_heat_time_constant_s = 0.0),
            ("monitors.coil_heat_warn", |config| config.monitors.coil_heat_warn = 1.0),
            ("monitors.workspace_margin_mm", |config| config.monitors.workspace_margin_mm = -1.0),
            ("monitors.pose_rate_max_deg_per_s", |config| {
                config.monitors.pose_rate_max_deg_per_s = f64::INFINITY
            }),
            ("monitors.pose_jump_max_mm", |config| config.monitors.pose_jump_max_mm = -0.1),
            ("monitors.model_error_max_deg", |config| config.monitors.model_error_max_deg = 181.0),
            ("monitors.progress_stop_ms", |config| config.monitors.progress_stop_ms = 0.0),
            ("monitors.controller_frozen_ms", |config| config.monitors.controller_frozen_ms = 0.0),
        ];
        for (key, edit) in cases {
            let mut config = shipped();
            edit(&mut config);
            let found = config.check();
            let keys: Vec<&str> = found.iter().map(|invalid| invalid.key.as_str()).collect();
            assert!(keys.contains(&format!("daemon.{key}").as_str()), "{key}: {found:?}");
        }
    }
}
