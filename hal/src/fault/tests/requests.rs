//! Faults on request, as they cross shared memory.

use super::bench::{at, fault, injector, ms};
use crate::fault::{
    Condition, EpochChange, Fault, FaultAnswer, FaultPlan, FaultRefusal, FaultRequest, FaultTarget,
    FaultVerb, Garbage, Injector, Part, Reach, action, refusal_text,
};
use crate::scripted::example_description;
use crate::seeded::Seeded;

fn every_fault() -> Vec<Fault> {
    let mut faults = Vec::new();
    let verbs = [
        FaultVerb::Off,
        FaultVerb::Stuck,
        FaultVerb::Garbage(Garbage::Nan),
        FaultVerb::Garbage(Garbage::Huge),
        FaultVerb::Garbage(Garbage::Quaternion),
        FaultVerb::Garbage(Garbage::Random),
        FaultVerb::Slow { rate_hz: 12.5 },
        FaultVerb::Delayed { by: ms(80) },
        FaultVerb::Intermittent { period: ms(200), off_fraction: 0.25 },
        FaultVerb::Repeated,
        FaultVerb::Backward,
        FaultVerb::WrongEpoch(EpochChange::Other),
        FaultVerb::WrongEpoch(EpochChange::EveryMessage),
        FaultVerb::WrongVersion,
        FaultVerb::Physical(Condition::Open),
        FaultVerb::Physical(Condition::Shorted { fraction: 0.5 }),
        FaultVerb::Physical(Condition::StuckAmplifier),
        FaultVerb::Physical(Condition::Stalled),
    ];
    let parts = [None, Some(Part::Magnet(1)), Some(Part::Coil(2)), Some(Part::Frame(0))];
    for target in FaultTarget::ALL {
        for verb in verbs {
            for part in parts {
                faults.extend(Fault::new(target, part, verb, &example_description(), Reach::Plant));
            }
        }
    }
    faults
}

#[test]
fn every_fault_survives_the_way_through_a_request() {
    let faults = every_fault();
    assert!(faults.len() > 60, "{}", faults.len());
    for fault in faults {
        for lasts in [None, Some(ms(1500))] {
            let request = FaultRequest::begin(&fault, lasts);
            assert_eq!(request.fault(&example_description(), Reach::Plant), Ok((fault, lasts)), "{fault}");
        }
    }
}

#[test]
fn any_bits_are_refused_or_make_a_fault_that_makes_sense() {
    let mut random = Seeded::new(3);
    let (mut made, mut refused) = (0, 0);
    let description = example_description();
    let plan = FaultPlan::empty(Reach::Channels);
    let mut injector = Injector::new(&description, &plan, 1);
    for _ in 0..100_000 {
        let mut small = |most: u64| {
            let wild = random.below(20) == 0;
            if wild { random.bits() as u32 } else { random.below(most) as u32 }
        };
        let request = FaultRequest {
            action: small(4),
            target: small(7),
            part: small(5),
            index: small(4),
            verb: small(16),
            kind: small(6),
            lasts_ns: random.bits() >> random.below(64),
            time_ns: random.bits() >> random.below(64),
            value: f64::from_bits(random.bits()),
        };
        let answer = FaultAnswer::to(&request, &mut injector, at(random.below(1000)));
        if answer.accepted == 1 {
            made += 1;
            assert_eq!((answer.reason, refusal_text(answer.reason)), (0, ""));
        } else {
            refused += 1;
            assert!(!refusal_text(answer.reason).is_empty());
        }
        if let Ok((fault, _)) = request.fault(&description, Reach::Channels) {
            assert_eq!(
                Fault::new(fault.target(), fault.part(), fault.verb(), &description, Reach::Channels),
                Ok(fault)
            );
        }
    }
    assert!(made > 1000 && refused > 1000, "{made} made, {refused} refused");
}

#[test]
fn requests_begin_and_clear_faults_and_answers_count_them() {
    let mut injector = injector(fault(FaultTarget::Poses, FaultVerb::Off, None), 5_000, 10);
    let stuck = FaultRequest::begin(&fault(FaultTarget::Feedback, FaultVerb::Stuck, None), Some(ms(100)));
    let answer = FaultAnswer::to(&stuck, &mut injector, at(10));
    assert_eq!((answer.accepted, answer.reason, answer.cleared), (1, 0, 0));
    injector.offer_feedback(super::bench::feedback(11), at(11));
    let answer = FaultAnswer::to(&FaultRequest::clear(), &mut injector, at(12));
    assert_eq!((answer.accepted, answer.active, answer.cleared), (1, 0, 2), "that of the plan, too");
    let nonsense = FaultRequest { action: 9, ..stuck };
    assert_eq!(FaultAnswer::to(&nonsense, &mut injector, at(13)).accepted, 0);
    assert_eq!(action::BEGIN, 1);
}

#[test]
fn requests_beyond_reach_or_room_are_refused_in_words() {
    let plan = FaultPlan::empty(Reach::Channels);
    let mut injector = Injector::new(&example_description(), &plan, 1);
    let open = fault(FaultTarget::Coil, FaultVerb::Physical(Condition::Open), Some(Part::Coil(0)));
    let answer = FaultAnswer::to(&FaultRequest::begin(&open, None), &mut injector, at(1));
    assert_eq!(answer.accepted, 0);
    assert!(refusal_text(answer.reason).contains("simulated plant"), "{answer:?}");
    let verb = FaultVerb::Physical(Condition::Open);
    assert_eq!(injector.begin(open, None, at(1)), Err(FaultRefusal::PlantOnly { verb: verb.name() }));
    let off = FaultRequest::begin(&fault(FaultTarget::Poses, FaultVerb::Off, None), None);
    for _ in 0..32 {
        assert_eq!(FaultAnswer::to(&off, &mut injector, at(2)).accepted, 1);
    }
    let answer = FaultAnswer::to(&off, &mut injector, at(2));
    assert!(answer.accepted == 0 && refusal_text(answer.reason).contains("too many"));
}
