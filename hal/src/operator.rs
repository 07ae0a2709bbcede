//! What an operator and the daemon say to each other: requests, answers and the status view.
//!
//! Nothing here reaches a driver; the daemon alone commands coils.

pub mod cause;

use iceoryx2::prelude::ZeroCopySend;

pub use cause::Cause;

use crate::message::{Actuation, COILS_MAX, Header, MAGNETS_MAX, POSE_PARAMETERS_MAX};

/// What an operator asks for; the codes of [`OperatorRequest::verb`].
pub mod verb {
    /// Take authority over the driver at zero current.
    pub const ARM: u32 = 1;
    /// Start steering towards the targets.
    pub const GO: u32 = 2;
    /// Hold the present targets.
    pub const HOLD: u32 = 3;
    /// Ramp to zero and return to idle.
    pub const STOP: u32 = 4;
    /// Clear a latched fault whose cause is gone.
    pub const RESET: u32 = 5;
    /// Cut the amplifiers.
    pub const ESTOP: u32 = 6;
    /// Steer towards [`super::OperatorRequest::direction`].
    pub const SET_TARGET: u32 = 7;
    /// Write the last seconds of every cycle to a file.
    pub const SAVE: u32 = 8;
    /// From a hold close to a snap-through go back along the way that led there, until it is far enough.
    pub const RETREAT: u32 = 9;

    /// The word a person reads for a verb.
    #[must_use]
    pub const fn name(verb: u32) -> &'static str {
        match verb {
            ARM => "arm",
            GO => "go",
            HOLD => "hold",
            STOP => "stop",
            RESET => "reset",
            ESTOP => "estop",
            SET_TARGET => "set-target",
            SAVE => "save",
            RETREAT => "retreat",
            _ => "unknown",
        }
    }
}

/// How the flight recorder fares; the codes of [`StatusMessage::recorder`].
pub mod recorder {
    /// There is none.
    pub const OFF: u32 = 0;
    /// It records, and can write.
    pub const RECORDING: u32 = 1;
    /// It records, and cannot write: a warning, the loop goes on.
    pub const FAILING: u32 = 2;

    /// The word a person reads.
    #[must_use]
    pub const fn name(recorder: u32) -> &'static str {
        match recorder {
            OFF => "off",
            RECORDING => "recording",
            FAILING => "failing",
            _ => "unknown",
        }
    }
}

/// States of the daemon; the codes of [`StatusMessage::state`].
pub mod state {
    /// Checks before the loop runs.
    pub const BOOT: u32 = 0;
    /// Outputs zero, no authority.
    pub const IDLE: u32 = 1;
    /// Authority held, zero current.
    pub const ARMED: u32 = 2;
    /// Steering.
    pub const ACTIVE: u32 = 3;
    /// Target held: by the operator's wish, while sensing is lost briefly, or close to a snap-through.
    pub const HOLDING: u32 = 4;
    /// Ramping to zero.
    pub const SAFE_STOP: u32 = 5;
    /// Latched until reset.
    pub const FAULT: u32 = 6;

    /// The word a person reads for a state.
    #[must_use]
    pub const fn name(state: u32) -> &'static str {
        match state {
            BOOT => "boot",
            IDLE => "idle",
            ARMED => "armed",
            ACTIVE => "active",
            HOLDING => "holding",
            SAFE_STOP => "safe-stop",
            FAULT => "fault",
            _ => "unknown",
        }
    }
}

/// What a trip does with the currents; the codes of [`StatusMessage::safe_action`].
pub mod safe_action {
    /// Ramp to zero.
    pub const RAMP: u32 = 0;
    /// Keep them for a while, then ramp to zero.
    pub const HOLD_THEN_RAMP: u32 = 1;
    /// Cut the amplifiers.
    pub const DISABLE: u32 = 2;

    /// The word a person reads for an action, as configurations have it.
    #[must_use]
    pub const fn name(action: u32) -> &'static str {
        match action {
            RAMP => "ramp",
            HOLD_THEN_RAMP => "hold-then-ramp",
            DISABLE => "disable",
            _ => "unknown",
        }
    }
}

/// What is known of the way to the target; the codes of [`StatusMessage::target_verdict`].
pub mod verdict {
    /// Nobody looks: the daemon does not steer, or has no scout.
    pub const UNCHECKED: u32 = 0;
    /// The way is being looked at; the target before is in force.
    pub const CHECKING: u32 = 1;
    /// The way is clear.
    pub const CLEAR: u32 = 2;
    /// The way is safe as far as currents lead, which is not to the target.
    pub const OUT_OF_REACH: u32 = 3;
    /// The target was refused, and the one before stays in force; [`super::StatusMessage::cause`] tells why.
    pub const REFUSED: u32 = 4;

    /// The word a person reads for a verdict.
    #[must_use]
    pub const fn name(verdict: u32) -> &'static str {
        match verdict {
            UNCHECKED => "unchecked",
            CHECKING => "checking",
            CLEAR => "clear",
            OUT_OF_REACH => "out-of-reach",
            REFUSED => "refused",
            _ => "unknown",
        }
    }
}

/// One request of an operator.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("magsteer_operator_request_v3")]
pub struct OperatorRequest {
    /// One of [`verb`].
    pub verb: u32,
    /// Entries of `direction` in use, for [`verb::SET_TARGET`].
    pub magnet_count: u32,
    /// Desired unit tangent of each magnet, world.
    pub direction: [[f64; 3]; MAGNETS_MAX],
    /// Entries of `angle_rad` in use: as many as the rig has frames, or none to leave the frames to the daemon.
    pub pose_parameter_count: u32,
    /// For [`verb::SET_TARGET`], how long the target may be steered to without a newer one: the daemon holds when the time is
    /// over. 0 for a target that stays until the next one.
    pub valid_ms: u32,
    /// Where each frame shall stand when the magnets have arrived.
    pub angle_rad: [f64; POSE_PARAMETERS_MAX],
}

/// The daemon's answer: done, or why not.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("magsteer_operator_answer_v1")]
pub struct OperatorAnswer {
    /// 1 when the request was carried out, 0 when refused.
    pub accepted: u32,
    /// Why it was refused: one of the daemon's cause codes, 0 when accepted.
    pub cause: u32,
    /// State after the request.
    pub state: u32,
    /// Reserved, zero.
    pub reserved: u32,
    /// Epoch that the daemon holds, 0 without authority.
    pub epoch: u64,
}

/// Quantiles of a time over the cycles counted.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
pub struct Quantiles {
    /// Half of all values lie below.
    pub p50_us: f64,
    /// 99 of 100 values lie below.
    pub p99_us: f64,
    /// 999 of 1000 values lie below.
    pub p999_us: f64,
    /// 9999 of 10000 values lie below.
    pub p9999_us: f64,
    /// The greatest value.
    pub max_us: f64,
}

/// Execution time of each phase of a cycle; together they are the execution.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
pub struct PhaseQuantiles {
    /// From the cycle's begin until messages and requests are taken.
    pub read: Quantiles,
    /// The controller's step: model, error, allocation.
    pub control: Quantiles,
    /// Supervisor and gate.
    pub decide: Quantiles,
    /// Handing the command to the transport.
    pub write: Quantiles,
    /// Putting the cycle's record together.
    pub record: Quantiles,
}

/// Timing of the loop over all its cycles, or over those of a minute.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
pub struct LoopTiming {
    /// Cycles counted; 0 when there is nothing to tell yet.
    pub cycles: u64,
    /// Periods skipped.
    pub missed: u64,
    /// From the awaited deadline to the cycle's begin.
    pub lateness: Quantiles,
    /// From the cycle's begin to its end.
    pub execution: Quantiles,
    /// Execution by phase.
    pub phases: PhaseQuantiles,
    /// From exposure to the cycle that uses the poses.
    pub pose_age: Quantiles,
    /// From the exposure of fresh poses to the command computed from them.
    pub pose_to_command: Quantiles,
    /// From the exposure of fresh poses to the driver's receipt of the command computed from them, as the
    /// driver stamped it.
    pub pose_to_driver: Quantiles,
    /// From the publication of those poses to the same receipt: without the sensor's own latency.
    pub round_trip: Quantiles,
}

/// A view of the daemon for anyone who looks; never a command.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("magsteer_status_v7")]
pub struct StatusMessage {
    /// Common header; `source_stamp_ns` is the cycle's tick.
    pub header: Header,
    /// One of [`state`].
    pub state: u32,
    /// Cause code of the last stop, fault or refused target, 0 without one.
    pub cause: u32,
    /// Number of the cycle.
    pub cycle: u64,
    /// Ticks that the loop skipped because it was late.
    pub missed: u64,
    /// Configured rate of the loop.
    pub rate_hz: f64,
    /// Cycles a second, measured over the last second.
    pub rate_measured_hz: f64,
    /// How late the last cycle began.
    pub lateness_us: f64,
    /// How late the latest cycle since the previous status began.
    pub lateness_max_us: f64,
    /// Age of the newest poses; negative when there are none.
    pub pose_age_us: f64,
    /// Age of the newest feedback, whose currents and angles are the measured ones here; negative when there is none.
    pub feedback_age_us: f64,
    /// Timing since the start, renewed once a second.
    pub timing: LoopTiming,
    /// Timing of the last whole minute; no cycles during the first.
    pub last_minute: LoopTiming,
    /// Cycles that neither of the two counts because their records were lost on the way to the publisher.
    pub records_dropped: u64,
    /// Allocations of the loop's thread within its cycles, beyond the transport's one a message sent; counted
    /// from the second message on, since the first one forms the connection.
    pub loop_allocations: u64,
    /// Margin of stability of the model's equilibrium: 1 at rest, 0 where the rod snaps through.
    pub stability_margin: f64,
    /// Entries of the direction arrays in use.
    pub magnet_count: u32,
    /// Entries of the current arrays in use.
    pub coil_count: u32,
    /// Entries of the angle arrays in use.
    pub pose_parameter_count: u32,
    /// 1 when the model's equilibrium was found in the last cycle.
    pub model_converged: u32,
    /// One of [`verdict`], of the target set last.
    pub target_verdict: u32,
    /// 1 while the margin of stability is below the daemon's limit of warning.
    pub stability_low: u32,
    /// One of [`recorder`].
    pub recorder: u32,
    /// Number of the system's error that keeps the recorder from writing, 0 without one.
    pub recorder_error: u32,
    /// Flights written since the daemon's start.
    pub flights: u32,
    /// Events and flights that are lost for good.
    pub recorder_lost: u32,
    /// 1 in passive mode: monitors judge, but do not act.
    pub passive: u32,
    /// Code of the worst cause for which a passive daemon would have tripped since it was armed or reset, 0 without one.
    pub would_trip: u32,
    /// How often one began since its start.
    pub would_trip_count: u64,
    /// One of [`safe_action`].
    pub safe_action: u32,
    /// 1 while the heat of a coil is to be warned of.
    pub coil_hot: u32,
    /// Heat of the hottest coil, by its measured current: 0 when cold, 1 at the limit.
    pub coil_heat: f64,
    /// Target tangents as set by the operator, world.
    pub target_direction: [[f64; 3]; MAGNETS_MAX],
    /// Reference that the loop follows this cycle, world.
    pub desired_direction: [[f64; 3]; MAGNETS_MAX],
    /// Tangents measured last, world.
    pub measured_direction: [[f64; 3]; MAGNETS_MAX],
    /// Tangents that the model predicts for the present actuation, world.
    pub predicted_direction: [[f64; 3]; MAGNETS_MAX],
    /// Field of every coil that the model believes in, over that of its description: learnt where the daemon learns it, else 1.
    pub coil_gain: [f64; COILS_MAX],
    /// Currents and angles of the model's equilibrium: those measured, smoothed where the daemon smooths them.
    pub modelled: Actuation,
    /// Force that the manipulator transmits at its clamp in that equilibrium, world.
    pub base_force_n: [f64; 3],
    /// Moment that it transmits there, world.
    pub base_moment_n_m: [f64; 3],
    /// Centres of the magnets measured last, world; zero where a magnet was not seen.
    pub measured_position_m: [[f64; 3]; MAGNETS_MAX],
    /// [`crate::HardwareDescription::fingerprint`] of the rig as the daemon knows it, so that a viewer can tell whether it
    /// draws the same rig.
    pub description_fingerprint: u64,
    /// Measured currents and angles.
    pub measured: Actuation,
    /// Currents and angles sent last.
    pub admitted: Actuation,
}
