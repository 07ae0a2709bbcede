//! Lines of the log about the loop, with what a filter of the journal would ask for.
//!
//! Written by the threads beside the loop, of the records that it hands them; never from a control cycle.

use std::fmt::Display;

use magsteer_hal::operator::{Cause, state};

use super::cycle_record::CycleRecord;
use super::journal::{Field, Priority, tell};
use super::state::Transition;
use super::view::TransitionLine;

/// One ordinary line of the log.
pub fn log(line: std::fmt::Arguments<'_>) {
    tell(Priority::Info, &[], line);
}

/// A change of state, with what a filter of the journal would ask for.
pub fn log_transition(rig: &str, record: &CycleRecord) {
    let Some(transition) = record.decision.transition else { return };
    let fields = transition_fields(rig, record, &transition);
    let fields: Vec<Field<'_>> = fields.iter().map(|(key, value)| (*key, value as &dyn Display)).collect();
    tell(priority(transition.to, transition.cause), &fields, format_args!("{}", TransitionLine(record)));
}

fn transition_fields(
    rig: &str,
    record: &CycleRecord,
    transition: &Transition,
) -> Vec<(&'static str, String)> {
    let cause = transition.cause;
    let mut fields = vec![
        ("MAGSTEER_RIG", rig.to_owned()),
        ("MAGSTEER_FROM", state::name(transition.from).to_owned()),
        ("MAGSTEER_STATE", state::name(transition.to).to_owned()),
        ("MAGSTEER_CAUSE", cause.map_or(0, Cause::code).to_string()),
        ("MAGSTEER_CYCLE", record.tick.number.to_string()),
    ];
    fields.extend(cause.map(|cause| ("MAGSTEER_CAUSE_TEXT", cause.text().to_owned())));
    fields
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
    use magsteer_hal::scripted::{EchoHardware, example_description};

    use super::{Cause, Priority, priority, state, transition_fields};
    use crate::control::{CycleInput, CycleOutcome, Step};
    use crate::daemon::config::tests::shipped;
    use crate::daemon::lockstep::Lockstep;
    use crate::daemon::state::Verb;

    /// Asks for nothing new.
    struct Idle;

    impl Step for Idle {
        fn step(&mut self, input: &CycleInput) -> CycleOutcome {
            CycleOutcome::asking_for(input.admitted)
        }
    }

    #[test]
    fn a_transition_carries_the_fields_that_a_filter_of_the_journal_asks_for() {
        let rig = example_description();
        let mut lockstep = Lockstep::new(EchoHardware::new(&rig), Idle, &rig, &shipped());
        for _ in 0..20 {
            lockstep.cycle();
        }
        lockstep.request(Verb::EmergencyStop).expect("one request");
        let record = lockstep.cycle();
        let transition = record.decision.transition.expect("to fault");
        let expected = [
            ("MAGSTEER_RIG", "bench"),
            ("MAGSTEER_FROM", "idle"),
            ("MAGSTEER_STATE", "fault"),
            ("MAGSTEER_CAUSE", "304"),
            ("MAGSTEER_CYCLE", "20"),
            ("MAGSTEER_CAUSE_TEXT", "emergency stop"),
        ];
        let found = transition_fields("bench", &record, &transition);
        assert_eq!(found, expected.map(|(key, value)| (key, value.to_owned())));
    }

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
