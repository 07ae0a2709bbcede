//! Lines of the log about the loop, with what a filter of the journal would ask for.
//!
//! Written by the threads beside the loop, of the records that it hands them; never from a control cycle.

use magsteer_hal::operator::{Cause, state};

use super::cycle_record::CycleRecord;
use super::journal::{Field, Priority, tell};
use super::view::TransitionLine;

/// One ordinary line of the log.
pub fn log(line: std::fmt::Arguments<'_>) {
    tell(Priority::Info, &[], line);
}

/// A change of state, with what a filter of the journal would ask for.
pub fn log_transition(rig: &str, record: &CycleRecord) {
    let Some(transition) = record.decision.transition else { return };
    let (from, to) = (state::name(transition.from), state::name(transition.to));
    let code = transition.cause.map_or(0, Cause::code);
    let mut fields: Vec<Field<'_>> = vec![
        ("MAGSTEER_RIG", &rig),
        ("MAGSTEER_FROM", &from),
        ("MAGSTEER_STATE", &to),
        ("MAGSTEER_CAUSE", &code),
        ("MAGSTEER_CYCLE", &record.tick.number),
    ];
    let text = transition.cause.map(Cause::text);
    if let Some(text) = &text {
        fields.push(("MAGSTEER_CAUSE_TEXT", text));
    }
    tell(priority(transition.to, transition.cause), &fields, format_args!("{}", TransitionLine(record)));
}

/// What happened for `cause` without a change of state, with the fields that one has.
pub fn log_cause(rig: &str, record: &CycleRecord, what: &str, cause: Cause) {
    let (state, code, text) = (state::name(record.decision.state), cause.code(), cause.text());
    let fields: [Field<'_>; 5] = [
        ("MAGSTEER_RIG", &rig),
        ("MAGSTEER_STATE", &state),
        ("MAGSTEER_CAUSE", &code),
        ("MAGSTEER_CAUSE_TEXT", &text),
        ("MAGSTEER_CYCLE", &record.tick.number),
    ];
    tell(Priority::Warning, &fields, format_args!("{what}: {text} (cause {code})"));
}

/// A fault is an error; a stop that nobody asked for, and sensing that was lost, are warnings.
fn priority(to: u32, cause: Option<Cause>) -> Priority {
    let was_asked_for = matches!(cause, None | Some(Cause::OperatorStop | Cause::Terminated));
    match to {
        state::FAULT => Priority::Error,
        _ if !was_asked_for => Priority::Warning,
        state::SAFE_STOP => Priority::Notice,
        _ => Priority::Info,
    }
}

#[cfg(test)]
mod tests {
    use super::{Cause, Priority, priority, state};

    #[test]
    fn faults_are_errors_and_stops_that_nobody_asked_for_are_warnings() {
        for (to, cause, expected) in [
            (state::FAULT, Some(Cause::EmergencyStop), Priority::Error),
            (state::SAFE_STOP, Some(Cause::PoseStale), Priority::Warning),
            (state::HOLDING, Some(Cause::PoseStale), Priority::Warning),
            (state::SAFE_STOP, Some(Cause::OperatorStop), Priority::Notice),
            (state::SAFE_STOP, Some(Cause::Terminated), Priority::Notice),
            (state::ACTIVE, None, Priority::Info),
            (state::IDLE, None, Priority::Info),
        ] {
            assert_eq!(priority(to, cause), expected, "{to} {cause:?}");
        }
    }
}
