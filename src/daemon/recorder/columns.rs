//! What a record holds: one table that names, explains and writes every value.
//!
//! A record is a row of 8-byte little-endian values, either a count (`u64`) or a number (`f64`): as many as
//! the rig has coils, frames and magnets, nothing for entries that it does not use. What the controller was
//! given and what it decided stand in it bit for bit, so that a cycle can be done again. [`NONE`] and "not a
//! number" stand for what is not there.

use std::time::Duration;

use magsteer_hal::operator::Cause;
use magsteer_hal::{CoilFeedback, HardwareDescription, PoseMessage};

use super::header::Column;
use super::refusal::absence;
use crate::control::Verdict;
use crate::control::plan::Obstacle;
use crate::daemon::cycle_record::CycleRecord;

/// A count that is not there.
pub const NONE: u64 = u64::MAX;

/// How a value comes out of a cycle; entries of coils, frames and magnets by their index.
#[derive(Clone, Copy)]
enum Of {
    Count(fn(&CycleRecord) -> u64),
    Number(fn(&CycleRecord) -> f64),
    Entry(fn(&CycleRecord, usize) -> f64),
    EntryCount(fn(&CycleRecord, usize) -> u64),
    /// Three columns that end in x, y and z.
    Vector(fn(&CycleRecord, usize) -> [f64; 3]),
    /// Four columns that end in x, y, z and w.
    Quaternion(fn(&CycleRecord, usize) -> [f64; 4]),
}

/// One row of the table: name, its unit last; meaning; where it is found.
type Row = (&'static str, &'static str, Of);

/// Values of the whole cycle.
const CYCLE: &[Row] = &[
    ("cycle", "number of the cycle", Of::Count(|it| it.tick.number)),
    ("tick_ns", "when it began, CLOCK_MONOTONIC", Of::Count(|it| it.tick.now.nanoseconds())),
    ("deadline_ns", "deadline of its period", Of::Count(|it| it.tick.deadline.nanoseconds())),
    ("lateness_ns", "from the awaited deadline to its begin", Of::Count(|it| nanoseconds(it.tick.lateness))),
    ("execution_ns", "from its begin to its end", Of::Count(|it| nanoseconds(it.execution))),
    ("missed", "periods skipped before it", Of::Count(|it| it.tick.missed)),
    ("state", "state code after it", Of::Count(|it| it.decision.state.into())),
    ("cause", "cause code in force, 0 without one", Of::Count(|it| code(it.decision.cause))),
    ("transition_from", "state code before a change", Of::Count(|it| transition(it).0)),
    ("transition_to", "state code after a change", Of::Count(|it| transition(it).1)),
    ("transition_cause", "cause code of the change, 0 without one", Of::Count(|it| transition(it).2)),
    (
        "given_up",
        "cause code of a target given up, 0 without one",
        Of::Count(|it| code(it.decision.given_up)),
    ),
    ("request_refused", "cause code of a request refused, 0 without one", Of::Count(refused)),
    (
        "directive",
        "what might be sent, in the order of `Directive`",
        Of::Count(|it| it.decision.directive as u64),
    ),
    ("order", "order sent", Of::Count(|it| it.order.map_or(NONE, u64::from))),
    ("epoch", "epoch of authority held, 0 without", Of::Count(|it| it.decision.epoch)),
    ("engaged", "1 while the controller closes the loop", Of::Count(|it| it.input.engaged.into())),
    ("target_accepted", "1 when a target was accepted", Of::Count(|it| it.decision.target.is_some().into())),
    ("froze", "1 when the reference was frozen", Of::Count(|it| it.decision.froze.into())),
    ("verdict", "what is known of the way to the target", Of::Count(|it| verdict(it).0)),
    ("verdict_obstacle", "1 limits, 2 near a snap, 3 a snap, 4 field", Of::Count(|it| verdict(it).1)),
    (
        "verdict_progress",
        "share of the way, or the least margin on a clear one",
        Of::Number(|it| verdict(it).2),
    ),
    ("verdict_current_max_a", "largest current on a clear way", Of::Number(|it| verdict(it).3)),
    ("stability_low", "1 while the margin is warned of", Of::Count(|it| it.decision.stability_low.into())),
    ("period_s", "time that the controller steps by", Of::Number(|it| it.input.period)),
    ("pose_fresh", "1 when poses came in this cycle", Of::Count(|it| it.input.pose_is_fresh.into())),
    ("pose_age_s", "time since the exposure, 0 without poses", Of::Number(|it| it.input.pose_age)),
    (
        "pose_stamp_ns",
        "exposure of the newest valid poses",
        Of::Count(|it| pose(it, |it| it.header.source_stamp_ns)),
    ),
    ("pose_published_ns", "when they were sent", Of::Count(|it| pose(it, |it| it.header.publish_stamp_ns))),
    ("pose_sequence", "their sequence", Of::Count(|it| pose(it, |it| it.header.sequence))),
    ("pose_epoch", "their sender's life", Of::Count(|it| pose(it, |it| it.header.epoch))),
    (
        "pose_refused",
        "why the newest poses were refused, 0 when not",
        Of::Count(|it| absence(it.pose_refused).0),
    ),
    ("pose_refused_expected", "first detail of that", Of::Count(|it| absence(it.pose_refused).1)),
    ("pose_refused_actual", "second detail of that", Of::Count(|it| absence(it.pose_refused).2)),
    (
        "feedback_stamp_ns",
        "newest valid feedback, true at",
        Of::Count(|it| back(it, |it| it.header.source_stamp_ns)),
    ),
    ("feedback_published_ns", "when it was sent", Of::Count(|it| back(it, |it| it.header.publish_stamp_ns))),
    ("feedback_sequence", "its sequence", Of::Count(|it| back(it, |it| it.header.sequence))),
    ("feedback_epoch", "the driver's life", Of::Count(|it| back(it, |it| it.header.epoch))),
    (
        "accepted_sequence",
        "last command that the driver accepted",
        Of::Count(|it| back(it, |it| it.accepted_sequence)),
    ),
    ("accepted_epoch", "its epoch", Of::Count(|it| back(it, |it| it.accepted_epoch))),
    ("commands_refused", "by the driver since its start", Of::Count(|it| back(it, |it| it.commands_refused))),
    ("limit_breaks", "seen by the driver since its start", Of::Count(|it| back(it, |it| it.limit_breaks))),
    ("driver_state", "state code of the driver", Of::Count(|it| back(it, |it| it.state.into()))),
    ("driver_fault", "fault code of the driver, 0 without", Of::Count(|it| back(it, |it| it.fault.into()))),
    (
        "feedback_refused",
        "why the newest feedback was refused, 0 when not",
        Of::Count(|it| absence(it.feedback_refused).0),
    ),
    ("feedback_refused_expected", "first detail of that", Of::Count(|it| absence(it.feedback_refused).1)),
    ("feedback_refused_actual", "second detail of that", Of::Count(|it| absence(it.feedback_refused).2)),
    (
        "limited_magnitude",
        "currents that the gate cut to their limit",
        Of::Count(|it| it.limited.magnitude.into()),
    ),
    ("limited_slew", "currents that it held back", Of::Count(|it| it.limited.slew.into())),
    ("limited_range", "angles that it cut to their range", Of::Count(|it| it.limited.range.into())),
    ("limited_speed", "angles that it held back", Of::Count(|it| it.limited.speed.into())),
    (
        "model_converged",
        "1 when the equilibrium was found",
        Of::Count(|it| it.outcome.model.converged.into()),
    ),
    ("model_residual", "scaled residual of the statics", Of::Number(|it| it.outcome.model.residual)),
    ("model_passes", "shooting passes spent", Of::Count(|it| it.outcome.model.passes.into())),
    (
        "jacobian_age",
        "cycles since the Jacobian in use",
        Of::Count(|it| it.outcome.model.jacobian_age.into()),
    ),
    (
        "stability_margin",
        "1 at rest, 0 where the rod snaps through",
        Of::Number(|it| it.outcome.model.margin),
    ),
    (
        "unstable_modes",
        "ways in which the rod leaves its shape",
        Of::Count(|it| it.outcome.model.unstable_modes.into()),
    ),
    (
        "field_valid",
        "0 when a magnet lies outside the field model",
        Of::Count(|it| it.outcome.model.field_valid.into()),
    ),
    ("condition", "of the scaled Jacobian", Of::Number(|it| it.outcome.condition)),
    ("saturated", "parameters at a limit", Of::Count(|it| it.outcome.saturated.into())),
    (
        "frames_targeted",
        "1 when the target names frame angles",
        Of::Count(|it| it.target.frame_angles.is_some().into()),
    ),
    (
        "frames_steered",
        "1 when that given to the controller does",
        Of::Count(|it| it.input.target.frame_angles.is_some().into()),
    ),
];

/// Values of each coil.
const COIL: &[Row] = &[
    ("measured_a", "measured", Of::Entry(|it, coil| it.input.measured.current_a[coil])),
    ("requested_a", "asked of the gate", Of::Entry(|it, coil| it.outcome.request.current_a[coil])),
    (
        "commanded_a",
        "admitted last, this cycle's included",
        Of::Entry(|it, coil| it.admitted.current_a[coil]),
    ),
    (
        "commanded_before_a",
        "admitted before this cycle",
        Of::Entry(|it, coil| it.input.admitted.current_a[coil]),
    ),
    ("gain", "field by the model over that of the description", Of::Entry(|it, coil| it.outcome.gains[coil])),
];

/// Values of each frame.
const FRAME: &[Row] = &[
    ("measured_rad", "measured", Of::Entry(|it, frame| it.input.measured.angle_rad[frame])),
    ("requested_rad", "asked of the gate", Of::Entry(|it, frame| it.outcome.request.angle_rad[frame])),
    (
        "commanded_rad",
        "admitted last, this cycle's included",
        Of::Entry(|it, frame| it.admitted.angle_rad[frame]),
    ),
    (
        "commanded_before_rad",
        "admitted before this cycle",
        Of::Entry(|it, frame| it.input.admitted.angle_rad[frame]),
    ),
    (
        "target_rad",
        "target, if it names one",
        Of::Entry(|it, frame| goal(it.target.frame_angles.as_ref(), frame)),
    ),
    (
        "steered_to_rad",
        "target given to the controller, if it names one",
        Of::Entry(|it, frame| goal(it.input.target.frame_angles.as_ref(), frame)),
    ),
];

/// Values of each magnet; directions are unit tangents, world.
const MAGNET: &[Row] = &[
    ("target", "set by the operator", Of::Vector(|it, magnet| it.target.directions[magnet])),
    ("steered_to", "given to the controller", Of::Vector(|it, magnet| it.input.target.directions[magnet])),
    (
        "in_force",
        "once its way was looked at",
        Of::Vector(|it, magnet| it.outcome.in_force.directions[magnet]),
    ),
    ("desired", "reference of the cycle", Of::Vector(|it, magnet| it.outcome.desired[magnet])),
    ("measured", "seen last", Of::Vector(|it, magnet| it.outcome.measured[magnet])),
    ("predicted", "by the model", Of::Vector(|it, magnet| it.outcome.predicted[magnet])),
    ("bias_rad", "of the model, a rotation vector", Of::Vector(|it, magnet| it.outcome.bias[magnet])),
    ("position_m", "centre, in the newest valid poses", Of::Vector(position)),
    ("orientation", "in the newest valid poses", Of::Quaternion(orientation)),
    ("seen", "1 when the sensor saw it", Of::EntryCount(seen)),
];

/// The columns of one rig.
#[derive(Debug)]
pub struct Columns {
    coils: usize,
    frames: usize,
    magnets: usize,
    described: Vec<Column>,
}

impl Columns {
    /// Those of the rig of `description`.
    pub fn new(description: &HardwareDescription) -> Self {
        let coils: Vec<&str> = description.coils.iter().map(|coil| coil.name.as_str()).collect();
        let frames: Vec<&str> = description.frames.iter().map(|frame| frame.name.as_str()).collect();
        let magnets: Vec<&str> = description.magnets().map(|magnet| magnet.name.as_str()).collect();
        let mut described = Vec::new();
        describe(CYCLE, "", &mut described);
        for (group, kind, names) in
            [(COIL, "coil", &coils), (FRAME, "frame", &frames), (MAGNET, "magnet", &magnets)]
        {
            names.iter().for_each(|name| describe(group, &format!("{kind}.{name}."), &mut described));
        }
        Self { coils: coils.len(), frames: frames.len(), magnets: magnets.len(), described }
    }

    /// Names, types and meanings, in the order of a record.
    pub fn described(&self) -> &[Column] {
        &self.described
    }

    /// Size of a record.
    pub fn record_bytes(&self) -> usize {
        8 * self.described.len()
    }

    /// Writes `record` into `bytes`, [`Self::record_bytes`] of them.
    pub fn encode(&self, record: &CycleRecord, bytes: &mut [u8]) {
        let mut places = bytes.chunks_exact_mut(8);
        let mut put = |bits: u64| {
            if let Some(place) = places.next() {
                place.copy_from_slice(&bits.to_le_bytes());
            }
        };
        CYCLE.iter().for_each(|row| row.2.put(record, 0, &mut put));
        for (group, count) in [(COIL, self.coils), (FRAME, self.frames), (MAGNET, self.magnets)] {
            for index in 0..count {
                group.iter().for_each(|row| row.2.put(record, index, &mut put));
            }
        }
    }
}

impl Of {
    fn put(self, record: &CycleRecord, index: usize, put: &mut impl FnMut(u64)) {
        match self {
            Self::Count(of) => put(of(record)),
            Self::Number(of) => put(of(record).to_bits()),
            Self::Entry(of) => put(of(record, index).to_bits()),
            Self::EntryCount(of) => put(of(record, index)),
            Self::Vector(of) => of(record, index).into_iter().for_each(|value| put(value.to_bits())),
            Self::Quaternion(of) => of(record, index).into_iter().for_each(|value| put(value.to_bits())),
        }
    }

    /// Endings of the names of its columns, and their type.
    const fn parts(self) -> (&'static [&'static str], &'static str) {
        match self {
            Self::Count(_) | Self::EntryCount(_) => (&[""], Column::COUNT),
            Self::Number(_) | Self::Entry(_) => (&[""], Column::NUMBER),
            Self::Vector(_) => (&["_x", "_y", "_z"], Column::NUMBER),
            Self::Quaternion(_) => (&["_x", "_y", "_z", "_w"], Column::NUMBER),
        }
    }
}

fn describe(rows: &[Row], prefix: &str, described: &mut Vec<Column>) {
    for (name, meaning, of) in rows {
        let (endings, kind) = of.parts();
        // The unit stays last: bias_x_rad.
        let (stem, unit) = split_unit(name, endings.len() > 1);
        described.extend(endings.iter().map(|ending| Column {
            name: format!("{prefix}{stem}{ending}{unit}"),
            kind: kind.to_owned(),
            meaning: (*meaning).to_owned(),
        }));
    }
}

fn split_unit(name: &str, is_vector: bool) -> (&str, &str) {
    let unit = ["_rad", "_m"].into_iter().find(|unit| is_vector && name.ends_with(unit)).unwrap_or("");
    name.split_at(name.len() - unit.len())
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn code(cause: Option<Cause>) -> u64 {
    cause.map_or(0, |cause| cause.code().into())
}

fn transition(record: &CycleRecord) -> (u64, u64, u64) {
    let transition = record.decision.transition;
    transition.map_or((NONE, NONE, 0), |it| (it.from.into(), it.to.into(), code(it.cause)))
}

fn refused(record: &CycleRecord) -> u64 {
    code(record.decision.answers.iter().flatten().find_map(|answer| answer.refused))
}

/// Code, obstacle, progress or margin, current.
fn verdict(record: &CycleRecord) -> (u64, u64, f64, f64) {
    const NAN: f64 = f64::NAN;
    match record.decision.verdict {
        Verdict::Unchecked => (0, 0, NAN, NAN),
        Verdict::Checking => (1, 0, NAN, NAN),
        Verdict::Clear { margin_min, current_max } => (2, 0, margin_min, current_max),
        Verdict::OutOfReach { progress } => (3, 0, progress, NAN),
        Verdict::Refused { obstacle, progress } => {
            let obstacle = match obstacle {
                Obstacle::OutOfReach => 1,
                Obstacle::NearSnapThrough => 2,
                Obstacle::BranchEnds => 3,
                Obstacle::OutsideField => 4,
            };
            (4, obstacle, progress, NAN)
        }
    }
}

fn pose(record: &CycleRecord, of: fn(&PoseMessage) -> u64) -> u64 {
    record.input.pose.as_ref().map_or(NONE, of)
}

fn back(record: &CycleRecord, of: fn(&CoilFeedback) -> u64) -> u64 {
    record.feedback.as_ref().map_or(NONE, of)
}

fn goal(angles: Option<&[f64; magsteer_hal::POSE_PARAMETERS_MAX]>, frame: usize) -> f64 {
    angles.map_or(f64::NAN, |angles| angles[frame])
}

fn position(record: &CycleRecord, magnet: usize) -> [f64; 3] {
    record.input.pose.as_ref().map_or([f64::NAN; 3], |pose| pose.magnets[magnet].position_m)
}

fn orientation(record: &CycleRecord, magnet: usize) -> [f64; 4] {
    record.input.pose.as_ref().map_or([f64::NAN; 4], |pose| pose.magnets[magnet].orientation_xyzw)
}

fn seen(record: &CycleRecord, magnet: usize) -> u64 {
    record.input.pose.as_ref().map_or(0, |pose| pose.magnets[magnet].valid.into())
}
