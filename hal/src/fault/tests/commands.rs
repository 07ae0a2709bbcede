//! Commands on their way to the guard.

use std::time::Duration;

use super::bench::{at, fault, injector, ms};
use crate::fault::{EpochChange, FaultTarget, FaultVerb, Injector};
use crate::gate::{Authority, Gate};
use crate::guard::{CommandGuard, Refusal};
use crate::message::{Actuation, POSE_PARAMETERS_MAX, driver_state};
use crate::scripted::example_description;
use crate::send::CommandWriter;
use crate::time::Stamp;

const AUTHORITY: Authority = Authority { epoch: 50, token: 3, validity: Duration::from_millis(40) };

/// Claims, then drives coil 0 for `milliseconds`; the refusals and the guard at the end.
fn driven(injector: &mut Injector, milliseconds: u64) -> (Vec<(u64, Refusal)>, CommandGuard) {
    let description = example_description();
    let (mut gate, mut writer) = (Gate::new(&description), CommandWriter::new(&description));
    let mut guard = CommandGuard::new(&description, &[0.0; POSE_PARAMETERS_MAX]);
    let mut refusals = Vec::new();
    let mut request = Actuation::default();
    request.current_a[0] = 1.0;
    for now in 1..=milliseconds {
        let command = if now == 1 {
            gate.claim(AUTHORITY)
        } else {
            gate.drive(&request, 1e-3, AUTHORITY, Stamp::default()).expect("finite").command
        };
        let message = injector.command(&writer.message(&command, at(now)), at(now));
        refusals.extend(guard.offer(&message, at(now)).err().map(|refusal| (now, refusal)));
        guard.setpoint(at(now), 1e-3);
    }
    (refusals, guard)
}

#[test]
fn each_verb_of_commands_is_refused_by_the_guard_for_its_own_reason() {
    let cases = [
        (FaultVerb::Repeated, Refusal::Sequence { last: 9, actual: 9 }),
        (FaultVerb::Backward, Refusal::Sequence { last: 9, actual: 8 }),
        (FaultVerb::WrongEpoch(EpochChange::Other), Refusal::Held { holder: 50 }),
        (FaultVerb::WrongEpoch(EpochChange::EveryMessage), Refusal::Held { holder: 50 }),
        (FaultVerb::WrongVersion, Refusal::Schema { actual: 2 }),
    ];
    for (verb, expected) in cases {
        let mut faulty = injector(fault(FaultTarget::Actuators, verb, None), 10, 20);
        let (refusals, guard) = driven(&mut faulty, 60);
        assert_eq!(refusals[0], (10, expected), "{verb}");
        assert_eq!(refusals.len(), 20, "{verb}: {refusals:?}");
        assert_eq!(guard.state(), driver_state::DRIVEN, "{verb}: over before the validity ran out");
        assert_eq!(faulty.counts().commands_altered, 20);
    }
}

#[test]
fn commands_that_go_wrong_for_longer_than_their_validity_end_authority() {
    for verb in [FaultVerb::Repeated, FaultVerb::Backward, FaultVerb::WrongVersion] {
        let mut faulty = injector(fault(FaultTarget::Actuators, verb, None), 10, 60);
        let (refusals, guard) = driven(&mut faulty, 100);
        assert_eq!(guard.state(), driver_state::IDLE, "{verb}");
        assert!(refusals.iter().any(|(now, refusal)| *now > 75 && *refusal == Refusal::NoAuthority));
    }
}

#[test]
fn orders_to_cut_pass_whatever_acts() {
    for verb in [
        FaultVerb::Repeated,
        FaultVerb::Backward,
        FaultVerb::WrongEpoch(EpochChange::EveryMessage),
        FaultVerb::WrongVersion,
    ] {
        let mut faulty = injector(fault(FaultTarget::Actuators, verb, None), 10, 1000);
        let (_, mut guard) = driven(&mut faulty, 30);
        let description = example_description();
        let mut writer = CommandWriter::new(&description);
        let mut cut = writer.message(&Gate::new(&description).disable(AUTHORITY), at(31));
        cut.header.sequence = 1_000;
        let passed = faulty.command(&cut, at(31));
        assert_eq!(passed, cut);
        guard.offer(&passed, at(31)).expect("obeyed");
        assert_eq!(guard.state(), driver_state::DISABLED);
    }
    assert_eq!(ms(40), AUTHORITY.validity);
}
