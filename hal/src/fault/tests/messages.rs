//! Whole messages: faults from 10 ms on for 20 ms, on streams of one message a millisecond.

use super::bench::{
    EPOCH, all, at, fault, feedback_accepted, feedback_through, injector, ms, poses_accepted, poses_through,
    told,
};
use crate::fault::{EpochChange, FaultTarget, FaultVerb, Garbage, Injector, StreamCounts};
use crate::message::{CoilFeedback, PoseMessage, SCHEMA};

/// Messages with the millisecond at which they went out.
type Timed<M> = Vec<(u64, M)>;

/// What goes out over 50 ms, poses and feedback.
fn through(verb: FaultVerb) -> (Timed<PoseMessage>, Timed<CoilFeedback>) {
    let faulty = |target| injector(fault(target, verb, None), 10, 20);
    let (mut poses, mut feedback) = (faulty(FaultTarget::Poses), faulty(FaultTarget::Feedback));
    (poses_through(&mut poses, 50), feedback_through(&mut feedback, 50))
}

fn times<M>(messages: &[(u64, M)]) -> Vec<u64> {
    messages.iter().map(|(now, _)| *now).collect()
}

/// Sequences in a run of messages.
fn sequences(messages: &[(u64, PoseMessage)]) -> Vec<u64> {
    messages.iter().map(|(_, message)| message.header.sequence).collect()
}

/// Everything but the milliseconds of the fault.
fn outside() -> Vec<u64> {
    [all(1, 9), all(30, 50)].concat()
}

#[test]
fn without_a_fault_messages_pass_as_they_are() {
    let plan = crate::fault::FaultPlan::empty(crate::fault::Reach::Channels);
    let mut sound = Injector::new(&crate::scripted::example_description(), &plan, 1);
    let poses = poses_through(&mut sound, 50);
    assert_eq!(poses_accepted(&poses), all(1, 50));
    assert_eq!(sequences(&poses), all(1, 50));
    for (now, message) in &poses {
        assert_eq!((told(message, 0), told(message, 1)), (*now, *now));
        assert_eq!(message.header.publish_stamp_ns, at(*now).nanoseconds());
    }
    assert_eq!(feedback_accepted(&feedback_through(&mut sound, 50)), all(1, 50));
    assert_eq!(sound.counts(), crate::fault::FaultCounts::default());
}

#[test]
fn off_publishes_nothing_and_counts_what_it_withheld() {
    let (poses, feedback) = through(FaultVerb::Off);
    assert_eq!((times(&poses), times(&feedback)), (outside(), outside()));
    let mut faulty = injector(fault(FaultTarget::Poses, FaultVerb::Off, None), 10, 20);
    poses_through(&mut faulty, 50);
    assert_eq!(faulty.counts().poses, StreamCounts { withheld: 20, altered: 0 });
}

#[test]
fn stuck_freezes_content_under_fresh_headers() {
    let (poses, feedback) = through(FaultVerb::Stuck);
    assert_eq!((poses_accepted(&poses), feedback_accepted(&feedback)), (all(1, 50), all(1, 50)));
    for (now, message) in &poses {
        let expected = if (10..30).contains(now) { 10 } else { *now };
        assert_eq!((told(message, 0), told(message, 1)), (expected, expected), "{now} ms");
        assert_eq!((message.header.sequence, message.header.source_stamp_ns), (*now, at(*now).nanoseconds()));
    }
    for (now, message) in &feedback {
        let expected = if (10..30).contains(now) { 10 } else { *now };
        assert_eq!(message.accepted_sequence, expected, "{now} ms");
        assert_eq!(message.measured.current_a[2], 1e-3 * expected as f64);
    }
}

#[test]
fn garbage_that_cannot_be_true_is_refused_at_receipt() {
    for kind in [Garbage::Nan, Garbage::Huge, Garbage::Quaternion] {
        let mut faulty = injector(fault(FaultTarget::Poses, FaultVerb::Garbage(kind), None), 10, 20);
        let poses = poses_through(&mut faulty, 50);
        assert_eq!((times(&poses), poses_accepted(&poses)), (all(1, 50), outside()), "{kind:?}");
    }
    let mut faulty = injector(fault(FaultTarget::Feedback, FaultVerb::Garbage(Garbage::Nan), None), 10, 20);
    assert_eq!(feedback_accepted(&feedback_through(&mut faulty, 50)), outside());
}

#[test]
fn huge_feedback_is_finite_and_beyond_every_limit() {
    let mut faulty = injector(fault(FaultTarget::Feedback, FaultVerb::Garbage(Garbage::Huge), None), 10, 20);
    for (now, message) in feedback_through(&mut faulty, 50) {
        let largest = message.measured.current_a[..3].iter().fold(0.0_f64, |most, next| most.max(*next));
        assert!(largest.is_finite());
        assert_eq!(largest > 1e299, (10..30).contains(&now), "{now} ms: {largest}");
    }
}

#[test]
fn random_garbage_could_be_true_and_comes_from_the_seed() {
    let (poses, feedback) = through(FaultVerb::Garbage(Garbage::Random));
    assert_eq!((poses_accepted(&poses), feedback_accepted(&feedback)), (all(1, 50), all(1, 50)));
    for (_, message) in &poses[9..29] {
        let place = message.magnets[1].position_m;
        assert!(place.iter().map(|value| value * value).sum::<f64>().sqrt() <= 0.055, "{place:?}");
        assert!(
            (message.magnets[1].tangent().iter().map(|value| value * value).sum::<f64>() - 1.0).abs() < 1e-9
        );
    }
    for (_, message) in &feedback[9..29] {
        assert!(message.measured.current_a[2].abs() <= 4.0 && message.measured.current_a[0].abs() <= 8.0);
    }
    assert_ne!(poses[10].1.magnets, poses[11].1.magnets, "new with each message");
    assert_eq!((poses, feedback), through(FaultVerb::Garbage(Garbage::Random)));
}

#[test]
fn slow_publishes_at_its_rate() {
    let (poses, feedback) = through(FaultVerb::Slow { rate_hz: 200.0 });
    let expected = [all(1, 10), vec![15, 20, 25], all(30, 50)].concat();
    assert_eq!((times(&poses), times(&feedback)), (expected.clone(), expected));
}

#[test]
fn delayed_publishes_late_with_old_sources_and_fresh_sequences() {
    let (poses, feedback) = through(FaultVerb::Delayed { by: ms(7) });
    let expected = [all(1, 9), all(17, 50)].concat();
    assert_eq!((times(&poses), times(&feedback)), (expected.clone(), expected.clone()));
    assert_eq!(poses_accepted(&poses), expected);
    for (now, message) in &poses {
        let source = if (10..30).contains(now) { now - 7 } else { *now };
        assert_eq!(told(message, 0), source, "{now} ms");
        assert_eq!(message.header.source_stamp_ns, at(source).nanoseconds());
        assert_eq!(message.header.publish_stamp_ns, at(*now).nanoseconds());
    }
    assert_eq!(sequences(&poses), all(1, 43));
}

#[test]
fn delayed_messages_come_out_between_offers_too() {
    let mut faulty = injector(fault(FaultTarget::Poses, FaultVerb::Delayed { by: ms(7) }, None), 0, 100);
    let mut header = crate::send::HeaderWriter::new(EPOCH);
    faulty.offer_pose(super::bench::pose(1), at(1));
    faulty.offer_pose(super::bench::pose(3), at(3));
    let mut out = Vec::new();
    for now in 4..20 {
        while let Some(message) = faulty.take_pose(&mut header, at(now)) {
            out.push((now, told(&message, 0)));
        }
    }
    assert_eq!(out, [(8, 1), (10, 3)]);
}

#[test]
fn intermittent_is_off_in_the_first_part_of_each_period() {
    let (poses, feedback) = through(FaultVerb::Intermittent { period: ms(8), off_fraction: 0.5 });
    let expected = [all(1, 9), all(14, 17), all(22, 25), all(30, 50)].concat();
    assert_eq!((times(&poses), times(&feedback)), (expected.clone(), expected));
}

#[test]
fn repeated_messages_are_the_last_one_bit_for_bit() {
    let (poses, feedback) = through(FaultVerb::Repeated);
    assert_eq!((times(&poses), times(&feedback)), (all(1, 50), all(1, 50)));
    assert_eq!((poses_accepted(&poses), feedback_accepted(&feedback)), (outside(), outside()));
    for index in 9..29 {
        assert_eq!((poses[index].1, feedback[index].1), (poses[8].1, feedback[8].1));
    }
}

#[test]
fn backward_sequences_fall_from_the_last_one() {
    let (poses, feedback) = through(FaultVerb::Backward);
    let expected = [all(1, 9), all(1, 8).into_iter().rev().collect(), vec![1; 12], all(30, 50)].concat();
    assert_eq!(sequences(&poses), expected);
    assert_eq!((poses_accepted(&poses), feedback_accepted(&feedback)), (outside(), outside()));
}

#[test]
fn wrong_epoch_looks_like_a_restart_once_or_with_every_message() {
    for (change, expected) in
        [(EpochChange::Other, vec![EPOCH + 1; 20]), (EpochChange::EveryMessage, all(101, 120))]
    {
        let (poses, feedback) = through(FaultVerb::WrongEpoch(change));
        let epochs: Vec<u64> = poses[9..29].iter().map(|(_, message)| message.header.epoch).collect();
        assert_eq!(epochs, expected);
        let epochs: Vec<u64> = feedback[9..29].iter().map(|(_, message)| message.header.epoch).collect();
        assert_eq!(epochs, expected);
        assert_eq!((poses[8].1.header.epoch, poses[29].1.header.epoch), (EPOCH, EPOCH));
    }
}

#[test]
fn wrong_version_is_refused_at_receipt() {
    let (poses, feedback) = through(FaultVerb::WrongVersion);
    assert!(poses[9..29].iter().all(|(_, message)| message.header.schema == SCHEMA + 1));
    assert_eq!((times(&poses), times(&feedback)), (all(1, 50), all(1, 50)));
    assert_eq!((poses_accepted(&poses), feedback_accepted(&feedback)), (outside(), outside()));
}

#[test]
fn several_faults_act_together() {
    let mut faulty = injector(fault(FaultTarget::Poses, FaultVerb::Stuck, None), 10, 20);
    let delayed = fault(FaultTarget::Poses, FaultVerb::Delayed { by: ms(5) }, None);
    faulty.begin(delayed, Some(ms(1000)), at(0)).expect("room");
    let poses = poses_through(&mut faulty, 25);
    // What is published at 10 ms is of 5 ms; there it stays, under the stamps of what is published after.
    assert_eq!(times(&poses), all(6, 25));
    for (now, message) in &poses {
        assert_eq!(told(message, 0), (now - 5).min(5), "{now} ms");
        assert_eq!(message.header.source_stamp_ns, at(now - 5).nanoseconds());
    }
}

#[test]
fn begins_and_ends_are_told_and_clearing_forgets_what_waits() {
    let mut faulty = injector(fault(FaultTarget::Poses, FaultVerb::Off, None), 10, 20);
    poses_through(&mut faulty, 50);
    let events: Vec<_> = std::iter::from_fn(|| faulty.take_event()).collect();
    assert_eq!(
        events.iter().map(|event| (event.began, event.at)).collect::<Vec<_>>(),
        [(true, ms(10)), (false, ms(30))]
    );
    assert_eq!((faulty.counts().begun, faulty.counts().ended, faulty.counts().active), (1, 1, 0));
    let mut faulty = injector(fault(FaultTarget::Poses, FaultVerb::Off, None), 10, 20);
    faulty.begin(fault(FaultTarget::Poses, FaultVerb::Stuck, None), None, at(1)).expect("room");
    poses_through(&mut faulty, 5);
    assert_eq!(faulty.counts().active, 1);
    assert_eq!(faulty.clear(at(5)), 2);
    assert_eq!(faulty.counts().active, 0);
    assert_eq!(times(&poses_through(&mut faulty, 50)), all(1, 50));
}
