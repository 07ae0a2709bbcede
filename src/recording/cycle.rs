//! What is recorded of a cycle: one table from which the struct, its ROS message, its encoding and the
//! columns of an export follow.
//!
//! Units stand last in a name; times are `CLOCK_MONOTONIC`, directions unit vectors in the world frame,
//! quaternions x, y, z, w. All numbers are those of the loop, bit for bit.

use super::cdr::{CdrError, Decoder, Encoder};
use super::value::{List, Number, Per, Value};

/// A field of [`Cycle`], described.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type in ROS.
    pub ros: &'static str,
    /// Of what it has entries.
    pub per: Per,
    /// Endings of the names of what an entry is made of.
    pub parts: &'static [&'static str],
    /// True for counts, codes and times.
    pub is_count: bool,
    /// What it is.
    pub meaning: &'static str,
}

macro_rules! cycle {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty = $per:ident,)+) => {
        /// One cycle of the daemon's loop, as it was recorded.
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct Cycle {
            $($(#[doc = $doc])+ pub $name: $type,)+
        }

        impl Cycle {
            /// Every field, in the order of the message.
            pub const FIELDS: &'static [Field] = &[$(Field {
                name: stringify!($name),
                ros: <$type as Value>::ROS,
                per: Per::$per,
                parts: <$type as Value>::PARTS,
                is_count: <$type as Value>::IS_COUNT,
                meaning: concat!($($doc),+),
            },)+];

            /// Writes the message.
            pub fn encode(&self, encoder: &mut Encoder) {
                $(self.$name.put(encoder);)+
            }

            /// Reads the message.
            ///
            /// # Errors
            /// When it ends early or is none.
            pub fn decode(bytes: &[u8]) -> Result<Self, CdrError> {
                let mut decoder = Decoder::new(bytes)?;
                Ok(Self { $($name: Value::take(&mut decoder)?,)+ })
            }

            /// The numbers of each field, in the order of [`Self::FIELDS`].
            pub fn numbers(&self) -> Vec<Vec<Number>> {
                let fields: &[&dyn List] = &[$(&self.$name,)+];
                let list = |field: &&dyn List| {
                    let mut numbers = Vec::new();
                    field.list(&mut numbers);
                    numbers
                };
                fields.iter().map(list).collect()
            }
        }
    };
}

cycle! {
    /// Number of the period on the daemon's grid; missed ones are skipped.
    number: u64 = Cycle,
    /// Begin of this period.
    deadline_ns: u64 = Cycle,
    /// When the cycle began.
    now_ns: u64 = Cycle,
    /// From the deadline that was waited for to the cycle's begin.
    lateness_ns: u64 = Cycle,
    /// Periods skipped before it.
    missed: u64 = Cycle,
    /// From its begin to its end.
    execution_ns: u64 = Cycle,
    /// Of that: until requests and messages were taken.
    read_ns: u64 = Cycle,
    /// Of that: the controller's step.
    control_ns: u64 = Cycle,
    /// Of that: supervisor and gate.
    decide_ns: u64 = Cycle,
    /// Of that: handing the command to the transport.
    write_ns: u64 = Cycle,
    /// Of that: putting the record together.
    record_ns: u64 = Cycle,
    /// Allocations of the loop's thread in the cycles before, beyond the transport's.
    allocations: u64 = Cycle,
    /// State code after the cycle: 0 boot, 1 idle, 2 armed, 3 active, 4 holding, 5 safe-stop, 6 fault.
    state: u32 = Cycle,
    /// Cause code in force, 0 without one.
    cause: u32 = Cycle,
    /// State code before a change, 4294967295 without one.
    transition_from: u32 = Cycle,
    /// State code after a change, 4294967295 without one.
    transition_to: u32 = Cycle,
    /// Cause code of the change, 0 without one.
    transition_cause: u32 = Cycle,
    /// Cause code of a target given up, 0 without one.
    given_up: u32 = Cycle,
    /// What might be sent: 0 nothing, 1 claim, 2 rest, 3 begin, 4 follow, 5 hold, 6 ramp down, 7 release, 8
    /// disable.
    directive: u32 = Cycle,
    /// Order sent: 0 release, 1 claim, 2 drive, 3 ramp down, 4 disable; 4294967295 when nothing was.
    order: u32 = Cycle,
    /// Epoch of authority held, 0 without.
    epoch: u64 = Cycle,
    /// Exposure of the poses that the command was computed from, 0 for one that needs none.
    command_pose_stamp_ns: u64 = Cycle,
    /// 1 while the controller closes the loop.
    engaged: u32 = Cycle,
    /// Time that the controller stepped by.
    period_s: f64 = Cycle,
    /// Verb of the request taken: 0 none, 1 arm, 2 go, 3 hold, 4 stop, 5 reset, 6 estop, 7 target, 1000
    /// terminate.
    request_verb: u32 = Cycle,
    /// Number under which it is answered.
    request_id: u32 = Cycle,
    /// Its target directions; empty without one.
    request_target: Vec<[f64; 3]> = Magnet,
    /// Its frame angles; empty when it names none.
    request_target_rad: Vec<f64> = Frame,
    /// For one of a stream of targets, how long it is valid without a newer one, ms; 0 for a target that stays.
    request_valid_ms: u32 = Cycle,
    /// Numbers of the requests answered.
    answer_id: Vec<u32> = Answer,
    /// Cause codes of their refusal, 0 when done.
    answer_cause: Vec<u32> = Answer,
    /// 1 when a target was accepted.
    target_accepted: u32 = Cycle,
    /// 1 when the reference was frozen.
    froze: u32 = Cycle,
    /// 1 when there are poses.
    pose_received: u32 = Cycle,
    /// 1 when they came in this cycle.
    pose_fresh: u32 = Cycle,
    /// Exposure of the newest valid poses.
    pose_stamp_ns: u64 = Cycle,
    /// When they were sent.
    pose_published_ns: u64 = Cycle,
    /// Their sequence.
    pose_sequence: u64 = Cycle,
    /// Life of their sender.
    pose_epoch: u64 = Cycle,
    /// Until when they may be acted upon, 0 without a limit.
    pose_valid_until_ns: u64 = Cycle,
    /// Why the newest poses were refused, 0 when not.
    pose_refused: u32 = Cycle,
    /// What was expected of them.
    pose_refused_expected: u64 = Cycle,
    /// What was found.
    pose_refused_actual: u64 = Cycle,
    /// Centre of each magnet.
    position_m: Vec<[f64; 3]> = Magnet,
    /// Orientation of each magnet; body z is its tangent.
    orientation: Vec<[f64; 4]> = Magnet,
    /// 1 when the sensor saw it.
    seen: Vec<u32> = Magnet,
    /// 1 when there is feedback.
    feedback_received: u32 = Cycle,
    /// 1 when it came in this cycle.
    feedback_fresh: u32 = Cycle,
    /// When the newest valid feedback was true.
    feedback_stamp_ns: u64 = Cycle,
    /// When it was sent.
    feedback_published_ns: u64 = Cycle,
    /// Its sequence.
    feedback_sequence: u64 = Cycle,
    /// The driver's life.
    feedback_epoch: u64 = Cycle,
    /// Until when it may be acted upon, 0 without a limit.
    feedback_valid_until_ns: u64 = Cycle,
    /// Why the newest feedback was refused, 0 when not.
    feedback_refused: u32 = Cycle,
    /// What was expected of it.
    feedback_refused_expected: u64 = Cycle,
    /// What was found.
    feedback_refused_actual: u64 = Cycle,
    /// Sequence of the last command that the driver accepted.
    accepted_sequence: u64 = Cycle,
    /// Its epoch.
    accepted_epoch: u64 = Cycle,
    /// Fingerprint of the driver's description.
    description_fingerprint: u64 = Cycle,
    /// Commands that the driver refused since its start.
    commands_refused: u64 = Cycle,
    /// Commands that broke a limit, as the driver counts them.
    limit_breaks: u64 = Cycle,
    /// Exposure of the newest poses that a command answered, as the driver tells.
    answered_pose_stamp_ns: u64 = Cycle,
    /// When the driver received the first such command.
    answer_received_stamp_ns: u64 = Cycle,
    /// State code of the driver.
    driver_state: u32 = Cycle,
    /// Fault code of the driver, 0 without.
    driver_fault: u32 = Cycle,
    /// From the exposure of poses to the driver's receipt of their command; all bits set when none was told.
    pose_to_driver_ns: u64 = Cycle,
    /// From the publication of those poses to the same receipt; all bits set when none was told.
    round_trip_ns: u64 = Cycle,
    /// Measured current of each coil.
    measured_a: Vec<f64> = Coil,
    /// Current asked of the gate.
    requested_a: Vec<f64> = Coil,
    /// Current admitted last, this cycle's included.
    commanded_a: Vec<f64> = Coil,
    /// Measured angle of each frame.
    measured_rad: Vec<f64> = Frame,
    /// Angle asked of the gate.
    requested_rad: Vec<f64> = Frame,
    /// Angle admitted last, this cycle's included.
    commanded_rad: Vec<f64> = Frame,
    /// Target direction set by the operator.
    target: Vec<[f64; 3]> = Magnet,
    /// Its frame angles; empty when it names none.
    target_rad: Vec<f64> = Frame,
    /// Target given to the controller.
    steered_to: Vec<[f64; 3]> = Magnet,
    /// Its frame angles; empty when it names none.
    steered_to_rad: Vec<f64> = Frame,
    /// Target once its way was looked at.
    in_force: Vec<[f64; 3]> = Magnet,
    /// Its frame angles; empty when it names none.
    in_force_rad: Vec<f64> = Frame,
    /// Reference of the cycle.
    desired: Vec<[f64; 3]> = Magnet,
    /// Tangent seen last.
    measured: Vec<[f64; 3]> = Magnet,
    /// Tangent that the model predicts.
    predicted: Vec<[f64; 3]> = Magnet,
    /// Bias of the model, a rotation vector.
    bias_rad: Vec<[f64; 3]> = Magnet,
    /// Field of each coil that the model believes in, over that of its description.
    coil_gain: Vec<f64> = Coil,
    /// 1 when the equilibrium was found.
    model_converged: u32 = Cycle,
    /// Scaled residual of the statics.
    residual: f64 = Cycle,
    /// Shooting passes spent.
    model_passes: u32 = Cycle,
    /// Cycles since the Jacobian in use.
    jacobian_age: u32 = Cycle,
    /// 1 at rest, 0 where the rod snaps through.
    stability_margin: f64 = Cycle,
    /// Ways in which the rod would leave its shape.
    unstable_modes: u32 = Cycle,
    /// 0 when a magnet lies outside the field model.
    field_valid: u32 = Cycle,
    /// Condition of the scaled Jacobian.
    condition: f64 = Cycle,
    /// Actuation parameters at a limit.
    saturated: u32 = Cycle,
    /// Currents that the gate cut to their limit.
    limited_magnitude: u32 = Cycle,
    /// Currents that it held back.
    limited_slew: u32 = Cycle,
    /// Angles that it cut to their range.
    limited_range: u32 = Cycle,
    /// Angles that it held back.
    limited_speed: u32 = Cycle,
    /// What is known of the way to the target: 0 unchecked, 1 checking, 2 clear, 3 out of reach, 4 refused.
    verdict: u32 = Cycle,
    /// What stands in the way: 1 limits, 2 near a snap, 3 a snap, 4 the field's range; 0 nothing.
    verdict_obstacle: u32 = Cycle,
    /// Share of the way that was looked at, or the least margin on a clear one.
    verdict_progress: f64 = Cycle,
    /// Largest current on a clear way.
    verdict_current_a: f64 = Cycle,
    /// 1 while the margin of stability is warned of.
    stability_low: u32 = Cycle,
    /// Heat of the hottest coil: 0 when cold, 1 at the limit.
    coil_heat: f64 = Cycle,
    /// 1 in passive mode.
    passive: u32 = Cycle,
    /// Code of the worst cause for which a passive daemon would have tripped, 0 without one.
    would_trip: u32 = Cycle,
    /// How often one began.
    would_trip_count: u64 = Cycle,
}
