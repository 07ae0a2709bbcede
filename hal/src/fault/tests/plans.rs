//! Plans from files: what is refused and under which key.

use crate::fault::{
    Condition, Fault, FaultConfig, FaultPlanConfig, FaultTarget, FaultVerb, Garbage, Part, Reach, VerbName,
};
use crate::scripted::example_description;

use super::bench::ms;

fn immediate(target: FaultTarget, verb: VerbName) -> FaultConfig {
    FaultConfig::immediate(target, verb, Some(1.0))
}

fn refused(config: FaultConfig, reach: Reach) -> Vec<(String, String)> {
    let plan = FaultPlanConfig { description: String::new(), faults: vec![config] };
    let refused = plan.build(&example_description(), reach).err().unwrap_or_default();
    refused
        .into_iter()
        .map(|invalid| (invalid.key, format!("{} | {}", invalid.value, invalid.expected)))
        .collect()
}

/// One refusal, at this key, whose text has these words.
fn assert_refused(config: FaultConfig, key: &str, words: &str) {
    let found = refused(config.clone(), Reach::Plant);
    assert_eq!(found.len(), 1, "{config:?}: {found:?}");
    assert_eq!(found[0].0, format!("faults[0].{key}"), "{found:?}");
    assert!(found[0].1.contains(words), "{words}: {found:?}");
}

#[test]
fn a_plan_reads_into_faults_with_their_times() {
    let mut delayed =
        FaultConfig { at_s: 2.5, ..FaultConfig::immediate(FaultTarget::Poses, VerbName::Delayed, None) };
    (delayed.delay_ms, delayed.magnet) = (Some(80.0), Some("m2".to_owned()));
    let mut shorted = immediate(FaultTarget::Coil, VerbName::Shorted);
    (shorted.turns_fraction, shorted.coil) = (Some(0.25), Some("coil1".to_owned()));
    let config = FaultPlanConfig { description: String::new(), faults: vec![delayed, shorted] };
    let plan = config.build(&example_description(), Reach::Plant).expect("right");
    let [first, second] = plan.scheduled() else { panic!("{plan:?}") };
    assert_eq!((first.from, first.lasts), (ms(2500), None));
    assert_eq!(
        (first.fault.part(), first.fault.verb()),
        (Some(Part::Magnet(1)), FaultVerb::Delayed { by: ms(80) })
    );
    assert_eq!(second.lasts, Some(ms(1000)));
    assert_eq!(second.fault.verb(), FaultVerb::Physical(Condition::Shorted { fraction: 0.25 }));
    assert_eq!(second.fault.to_string(), "coil 1: shorted (0.25 of the turns)");
}

#[test]
fn times_out_of_range_are_refused() {
    let off = || immediate(FaultTarget::Poses, VerbName::Off);
    for at_s in [-1.0, f64::NAN, f64::INFINITY, 1e9] {
        assert_refused(FaultConfig { at_s, ..off() }, "at_s", "a week");
    }
    for for_s in [0.0, -2.0, f64::NAN, 1e9] {
        assert_refused(FaultConfig { for_s: Some(for_s), ..off() }, "for_s", "above 0");
    }
    assert_refused(FaultConfig { for_s: None, ..off() }, "for_s", "lasting = true");
    assert_refused(FaultConfig { lasting: Some(true), ..off() }, "lasting", "left out");
    assert_refused(
        FaultConfig { for_s: None, lasting: Some(false), ..off() },
        "lasting",
        "for_s in its place",
    );
}

#[test]
fn verbs_apply_to_their_targets_alone() {
    let physical = [VerbName::Open, VerbName::StuckAmplifier, VerbName::Stalled];
    for target in [FaultTarget::Poses, FaultTarget::Feedback, FaultTarget::Actuators] {
        for verb in physical {
            assert_refused(immediate(target, verb), "verb", "off, stuck, garbage");
        }
    }
    for verb in
        [VerbName::Off, VerbName::Stuck, VerbName::Repeated, VerbName::WrongVersion, VerbName::Stalled]
    {
        assert_refused(immediate(FaultTarget::Coil, verb), "verb", "open, shorted, stuck-amplifier");
    }
    assert_refused(immediate(FaultTarget::Frame, VerbName::Open), "verb", "stalled");
}

#[test]
fn parameters_stand_where_the_verb_needs_them_and_nowhere_else() {
    let of = |verb| immediate(FaultTarget::Poses, verb);
    assert_refused(of(VerbName::Garbage), "garbage", "needs it");
    assert_refused(of(VerbName::Slow), "rate_hz", "needs it");
    assert_refused(of(VerbName::Delayed), "delay_ms", "needs it");
    assert_refused(of(VerbName::WrongEpoch), "epoch", "needs it");
    let found = refused(of(VerbName::Intermittent), Reach::Channels);
    assert_eq!(found.len(), 2, "{found:?}");
    assert_refused(FaultConfig { rate_hz: Some(5.0), ..of(VerbName::Off) }, "rate_hz", "verb off has none");
    assert_refused(FaultConfig { delay_ms: Some(5.0), ..of(VerbName::Stuck) }, "delay_ms", "left out");
}

#[test]
fn parameters_out_of_range_are_refused() {
    let of = |verb| immediate(FaultTarget::Feedback, verb);
    for rate_hz in [0.0, -1.0, f64::NAN, 2000.0] {
        assert_refused(
            FaultConfig { rate_hz: Some(rate_hz), ..of(VerbName::Slow) },
            "rate_hz",
            "from 0.1 to 1000",
        );
    }
    for delay_ms in [0.0, 1001.0] {
        assert_refused(
            FaultConfig { delay_ms: Some(delay_ms), ..of(VerbName::Delayed) },
            "delay_ms",
            "from 1 to 1000",
        );
    }
    for delay_ms in [-1.0, f64::NAN, f64::INFINITY] {
        assert_refused(
            FaultConfig { delay_ms: Some(delay_ms), ..of(VerbName::Delayed) },
            "delay_ms",
            "finite",
        );
    }
    let intermittent = |period_ms, off_fraction| FaultConfig {
        period_ms: Some(period_ms),
        off_fraction: Some(off_fraction),
        ..of(VerbName::Intermittent)
    };
    assert_refused(intermittent(1.0, 0.5), "period_ms", "from 2 to 60000");
    for off_fraction in [0.0, 1.0, -0.5, f64::NAN] {
        assert_refused(intermittent(100.0, off_fraction), "off_fraction", "above 0 and below 1");
    }
}

#[test]
fn garbage_fits_its_target() {
    let of = |target, kind| FaultConfig { garbage: Some(kind), ..immediate(target, VerbName::Garbage) };
    for kind in [Garbage::Nan, Garbage::Huge, Garbage::Quaternion] {
        assert_refused(of(FaultTarget::Actuators, kind), "garbage", "`random` garbage alone");
    }
    assert_refused(of(FaultTarget::Feedback, Garbage::Quaternion), "garbage", "no quaternions");
    assert!(refused(of(FaultTarget::Actuators, Garbage::Random), Reach::Channels).is_empty());
}

#[test]
fn parts_are_named_and_fit_target_and_verb() {
    let named = |name: &str| Some(name.to_owned());
    let poses = || immediate(FaultTarget::Poses, VerbName::Stuck);
    assert_refused(FaultConfig { magnet: named("m3"), ..poses() }, "magnet", "m1, m2");
    assert_refused(
        FaultConfig { coil: named("coil0"), ..poses() },
        "coil",
        "cannot be limited to a single coil",
    );
    let feedback = || immediate(FaultTarget::Feedback, VerbName::Stuck);
    assert_refused(FaultConfig { magnet: named("m1"), ..feedback() }, "magnet", "left out");
    assert_refused(
        FaultConfig { coil: named("coil0"), frame: named("top"), ..feedback() },
        "frame",
        "one part alone",
    );
    let whole = FaultConfig { coil: named("coil0"), ..immediate(FaultTarget::Feedback, VerbName::Backward) };
    assert_refused(whole, "coil", "left out");
    assert_refused(immediate(FaultTarget::Coil, VerbName::Open), "coil", "must say which");
    assert_refused(immediate(FaultTarget::Frame, VerbName::Stalled), "frame", "must say which");
}

#[test]
fn conditions_of_the_plant_are_refused_where_there_is_none() {
    let open = FaultConfig { coil: Some("coil0".to_owned()), ..immediate(FaultTarget::Coil, VerbName::Open) };
    assert!(refused(open.clone(), Reach::Plant).is_empty());
    let found = refused(open, Reach::Channels);
    assert_eq!(found[0].0, "faults[0].verb");
    assert!(found[0].1.contains("only a simulated plant"), "{found:?}");
}

#[test]
fn more_faults_than_there_is_room_for_are_refused() {
    let faults = vec![immediate(FaultTarget::Poses, VerbName::Off); 33];
    let plan = FaultPlanConfig { description: String::new(), faults };
    let refused = plan.build(&example_description(), Reach::Channels).expect_err("too many");
    assert_eq!((refused.len(), refused[0].key.as_str()), (1, "faults"));
    let empty = FaultPlanConfig { description: String::new(), faults: Vec::new() };
    assert!(empty.build(&example_description(), Reach::Channels).is_err());
}

#[test]
fn conditions_of_the_plant_come_and_go_with_their_faults() {
    let open = |part| {
        let verb = FaultVerb::Physical(Condition::Open);
        Fault::new(FaultTarget::Coil, Some(part), verb, &example_description(), Reach::Plant).expect("right")
    };
    let mut faulty = super::bench::injector(open(Part::Coil(2)), 10, 20);
    let stalled = super::bench::fault(
        FaultTarget::Frame,
        FaultVerb::Physical(Condition::Stalled),
        Some(Part::Frame(1)),
    );
    faulty.begin(stalled, Some(ms(25)), super::bench::at(5)).expect("room");
    let mut changes = Vec::new();
    for now in 0..50 {
        while let Some(change) = faulty.next_condition(super::bench::at(now)) {
            changes.push((now, change.part, change.condition));
        }
    }
    assert_eq!(
        changes,
        [
            (5, Part::Frame(1), Some(Condition::Stalled)),
            (10, Part::Coil(2), Some(Condition::Open)),
            (30, Part::Coil(2), None),
            (30, Part::Frame(1), None)
        ]
    );
    faulty.begin(open(Part::Coil(0)), None, super::bench::at(60)).expect("room");
    assert!(faulty.next_condition(super::bench::at(60)).is_some());
    assert_eq!(faulty.clear(super::bench::at(61)), 1);
    let change = faulty.next_condition(super::bench::at(61)).expect("sound again");
    assert_eq!((change.part, change.condition), (Part::Coil(0), None));
}
