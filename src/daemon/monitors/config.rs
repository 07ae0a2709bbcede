//! `[daemon.monitors]` of the configuration file.

use std::time::Duration;

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

/// `[daemon.monitors]`. Every key is required.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MonitorsConfig {
    /// A measured current may lie this far from its command, A, > 0: offset, noise and induced currents of the sensor,
    /// and the lag of a slow motion.
    pub current_error_max_a: f64,
    /// And by this share of the command more, 0 to 1: gain errors of sensor and amplifier.
    pub current_error_share: f64,
    /// For how much longer it may lie beyond than within, ms, 1 to 10000. Above the time in which the amplifier makes up
    /// for the largest step that the slew limit allows.
    pub current_error_stop_ms: f64,
    /// From which commanded current on a coil must carry some, A, > 0. Above offset and noise of the current sensor.
    pub open_current_a: f64,
    /// A coil that carries less than this share of such a command counts as open, above 0, below 1.
    pub open_share: f64,
    /// For how much longer it may count as open than not, ms, 1 to 10000.
    pub open_stop_ms: f64,
    /// A measured frame angle may lie this far from its command, deg, above 0, to 360. Above backlash, and the lag of
    /// steady motion.
    pub angle_error_max_deg: f64,
    /// For how much longer it may lie beyond than within, ms, 1 to 60000. Above the time in which a motor turns back.
    pub angle_error_stop_ms: f64,
    /// Current that any coil may carry for ever, A, > 0: `sqrt(rise / (resistance hot x thermal resistance))`.
    pub coil_current_continuous_a: f64,
    /// Time constant of a coil's warming, s, 1 to 100000: thermal resistance times heat capacity.
    pub coil_heat_time_constant_s: f64,
    /// Share of the heat at the limit from which the status warns, and below which a reset is allowed, above 0, below 1.
    pub coil_heat_warn: f64,
    /// Magnets may be seen this far outside of the workspace, mm, 0 to 1000: as far as the rod reaches beyond it.
    pub workspace_margin_mm: f64,
    /// Fastest turn of a magnet, deg/s, > 0: above the first mode's `2 pi f` times the widest swing.
    pub pose_rate_max_deg_per_s: f64,
    /// Turn from one message to the next that is no sign of speed, deg, 0 to 180: several times the noise.
    pub pose_jump_max_deg: f64,
    /// Fastest motion of a magnet, mm/s, > 0: that turn at the rod's length.
    pub pose_speed_max_mm_per_s: f64,
    /// Motion from one message to the next that is no sign of speed, mm, >= 0: several times the noise.
    pub pose_jump_max_mm: f64,
    /// Measured and predicted direction of a magnet may differ by this for long, deg, above 0, to 180: above what errors
    /// of the rod's parameters bend it by.
    pub model_error_max_deg: f64,
    /// For how much longer they may differ by more than by less, ms, 1 to 60000: above the time of a step.
    pub model_error_stop_ms: f64,
    /// Distance from a target that is clear, deg, above 0, to 180, from which the loop must come nearer by a tenth
    /// within `progress_stop_ms` while no parameter is at a limit.
    pub progress_error_deg: f64,
    /// See there, ms, 1 to 600000: above the slowest motion that the reference is allowed, frames included.
    pub progress_stop_ms: f64,
    /// How long the controller's view of the magnets may stand still while poses change, ms, 1 to 10000.
    pub controller_frozen_ms: f64,
}

/// The same in the units of the monitors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonitorLimits {
    /// Band of a current, A.
    pub current_error: f64,
    /// Its widening with the command.
    pub current_error_share: f64,
    /// Outside of the band for longer: not following.
    pub current_error_stop: Duration,
    /// Commands from here on show an open coil, A.
    pub open_current: f64,
    /// Share of the command below which a coil counts as open.
    pub open_share: f64,
    /// Open for longer: an open coil.
    pub open_stop: Duration,
    /// Band of an angle, rad.
    pub angle_error: f64,
    /// Outside of the band for longer: not following.
    pub angle_error_stop: Duration,
    /// Current carried for ever, A.
    pub continuous_current: f64,
    /// Time constant of warming, s.
    pub heat_time_constant: f64,
    /// Share of the greatest heat that is warned of.
    pub heat_warn: f64,
    /// Reach beyond the workspace, m.
    pub workspace_margin: f64,
    /// Fastest turn, rad/s.
    pub pose_rate: f64,
    /// Turn that is no sign, rad.
    pub pose_jump: f64,
    /// Fastest motion, m/s.
    pub pose_speed: f64,
    /// Motion that is no sign, m.
    pub pose_shift: f64,
    /// Band of the model's directions, rad.
    pub model_error: f64,
    /// Outside of the band for longer: the model is off.
    pub model_error_stop: Duration,
    /// Distance from the target at which progress is due, rad.
    pub progress_error: f64,
    /// Without progress for longer: not progressing.
    pub progress_stop: Duration,
    /// Frozen for longer: not progressing.
    pub controller_frozen: Duration,
}

impl MonitorsConfig {
    /// Notes every value that is out of its range.
    pub(in crate::daemon) fn check(&self, checks: &mut Checks) {
        let positive = [
            ("current_error_max_a", self.current_error_max_a),
            ("open_current_a", self.open_current_a),
            ("coil_current_continuous_a", self.coil_current_continuous_a),
            ("pose_rate_max_deg_per_s", self.pose_rate_max_deg_per_s),
            ("pose_speed_max_mm_per_s", self.pose_speed_max_mm_per_s),
        ];
        for (key, value) in positive {
            checks.positive(format!("daemon.monitors.{key}"), value);
        }
        let ranges = [
            ("current_error_share", self.current_error_share, 0.0, 1.0),
            ("current_error_stop_ms", self.current_error_stop_ms, 1.0, 10_000.0),
            ("open_stop_ms", self.open_stop_ms, 1.0, 10_000.0),
            ("angle_error_stop_ms", self.angle_error_stop_ms, 1.0, 60_000.0),
            ("coil_heat_time_constant_s", self.coil_heat_time_constant_s, 1.0, 100_000.0),
            ("workspace_margin_mm", self.workspace_margin_mm, 0.0, 1_000.0),
            ("pose_jump_max_deg", self.pose_jump_max_deg, 0.0, 180.0),
            ("pose_jump_max_mm", self.pose_jump_max_mm, 0.0, 1_000.0),
            ("model_error_stop_ms", self.model_error_stop_ms, 1.0, 60_000.0),
            ("progress_stop_ms", self.progress_stop_ms, 1.0, 600_000.0),
            ("controller_frozen_ms", self.controller_frozen_ms, 1.0, 10_000.0),
        ];
        for (key, value, least, most) in ranges {
            checks.within(format!("daemon.monitors.{key}"), value, least, most);
        }
        let angles = [
            ("angle_error_max_deg", self.angle_error_max_deg, 360.0),
            ("model_error_max_deg", self.model_error_max_deg, 180.0),
            ("progress_error_deg", self.progress_error_deg, 180.0),
        ];
        for (key, value, most) in angles {
            let holds = value > 0.0 && value <= most;
            checks.require(
                holds,
                format!("daemon.monitors.{key}"),
                value,
                format!("above 0, at most {most}"),
            );
        }
        for (key, value) in [("open_share", self.open_share), ("coil_heat_warn", self.coil_heat_warn)] {
            let holds = value > 0.0 && value < 1.0;
            checks.require(holds, format!("daemon.monitors.{key}"), value, "above 0 and below 1");
        }
    }

    pub(in crate::daemon) fn limits(&self) -> MonitorLimits {
        let time = |ms: f64| Duration::try_from_secs_f64(ms * 1e-3).unwrap_or(Duration::ZERO);
        MonitorLimits {
            current_error: self.current_error_max_a,
            current_error_share: self.current_error_share,
            current_error_stop: time(self.current_error_stop_ms),
            open_current: self.open_current_a,
            open_share: self.open_share,
            open_stop: time(self.open_stop_ms),
            angle_error: self.angle_error_max_deg.to_radians(),
            angle_error_stop: time(self.angle_error_stop_ms),
            continuous_current: self.coil_current_continuous_a,
            heat_time_constant: self.coil_heat_time_constant_s,
            heat_warn: self.coil_heat_warn,
            workspace_margin: self.workspace_margin_mm * 1e-3,
            pose_rate: self.pose_rate_max_deg_per_s.to_radians(),
            pose_jump: self.pose_jump_max_deg.to_radians(),
            pose_speed: self.pose_speed_max_mm_per_s * 1e-3,
            pose_shift: self.pose_jump_max_mm * 1e-3,
            model_error: self.model_error_max_deg.to_radians(),
            model_error_stop: time(self.model_error_stop_ms),
            progress_error: self.progress_error_deg.to_radians(),
            progress_stop: time(self.progress_stop_ms),
            controller_frozen: time(self.controller_frozen_ms),
        }
    }
}
