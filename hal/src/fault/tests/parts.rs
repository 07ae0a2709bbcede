//! One magnet, coil or frame of a message, the rest sound.

use super::bench::{all, fault, feedback_through, injector, ms, poses_accepted, poses_through, told};
use crate::fault::{FaultTarget, FaultVerb, Garbage, Part};
use crate::hardware::Absent;
use crate::receive::PoseReceiver;
use crate::scripted::example_description;

/// What the second magnet tells in each millisecond, with the first one sound: `None` where it is not seen.
fn second_magnet(verb: FaultVerb) -> Vec<Option<u64>> {
    let mut faulty = injector(fault(FaultTarget::Poses, verb, Some(Part::Magnet(1))), 10, 10);
    let poses = poses_through(&mut faulty, 25);
    assert_eq!(poses.len(), 25);
    for (now, message) in &poses {
        assert_eq!((told(message, 0), message.magnets[0].valid), (*now, 1));
        assert_eq!(message.header.sequence, *now);
    }
    poses.iter().map(|(_, message)| (message.magnets[1].valid == 1).then(|| told(message, 1))).collect()
}

/// What one coil and one frame read, in thousandths, with the others sound.
fn second_coil_and_frame(verb: FaultVerb) -> (Vec<u64>, Vec<u64>) {
    let run = |part| {
        let mut faulty = injector(fault(FaultTarget::Feedback, verb, Some(part)), 10, 10);
        feedback_through(&mut faulty, 25)
    };
    let thousandths = |value: f64| (value * 1e3).round() as u64;
    let (coil, frame) = (run(Part::Coil(1)), run(Part::Frame(1)));
    for (now, message) in coil.iter().chain(&frame) {
        assert_eq!(thousandths(message.measured.current_a[0]), *now);
        assert_eq!(thousandths(message.measured.angle_rad[0]), *now);
        assert_eq!(message.accepted_sequence, *now);
    }
    (
        coil.iter().map(|(_, message)| thousandths(message.measured.current_a[1])).collect(),
        frame.iter().map(|(_, message)| thousandths(message.measured.angle_rad[1])).collect(),
    )
}

fn expected(during: impl Fn(u64) -> u64) -> Vec<u64> {
    (1..=25).map(|now| if (10..20).contains(&now) { during(now) } else { now }).collect()
}

#[test]
fn off_hides_one_magnet_and_zeroes_one_reading() {
    let seen = second_magnet(FaultVerb::Off);
    assert!((1..=25).all(|now| seen[now - 1].is_none() == (10..20).contains(&now)), "{seen:?}");
    let zero = expected(|_| 0);
    assert_eq!(second_coil_and_frame(FaultVerb::Off), (zero.clone(), zero));
}

#[test]
fn magnet_that_is_not_seen_is_named_at_receipt() {
    let mut faulty = injector(fault(FaultTarget::Poses, FaultVerb::Off, Some(Part::Magnet(1))), 1, 10);
    let mut receiver = PoseReceiver::new(&example_description());
    let (now, message) = poses_through(&mut faulty, 1)[0];
    let reading = receiver.receive(Some(&message), super::bench::at(now));
    assert_eq!(reading.refused, Some(Absent::NotSeen { magnet: 1 }));
}

#[test]
fn stuck_slow_and_delayed_hold_one_entry_back() {
    let cases = [
        (FaultVerb::Stuck, expected(|_| 10)),
        (FaultVerb::Slow { rate_hz: 250.0 }, expected(|now| 10 + (now - 10) / 4 * 4)),
        (FaultVerb::Delayed { by: ms(4) }, expected(|now| (now - 4).max(10))),
    ];
    for (verb, wanted) in cases {
        let seen: Vec<u64> = second_magnet(verb).into_iter().map(|told| told.expect("seen")).collect();
        assert_eq!(seen, wanted, "{verb}");
        assert_eq!(second_coil_and_frame(verb), (wanted.clone(), wanted), "{verb}");
    }
}

#[test]
fn intermittent_hides_one_magnet_in_the_first_part_of_each_period() {
    let verb = FaultVerb::Intermittent { period: ms(5), off_fraction: 0.4 };
    let seen = second_magnet(verb);
    let hidden: Vec<usize> = (1..=25).filter(|now| seen[now - 1].is_none()).collect();
    assert_eq!(hidden, [10, 11, 15, 16]);
    let wanted = expected(|now| if [10, 11, 15, 16].contains(&now) { 0 } else { now });
    assert_eq!(second_coil_and_frame(verb), (wanted.clone(), wanted));
}

#[test]
fn garbage_of_one_magnet_condemns_the_message_or_misleads() {
    for kind in [Garbage::Nan, Garbage::Huge, Garbage::Quaternion] {
        let mut faulty =
            injector(fault(FaultTarget::Poses, FaultVerb::Garbage(kind), Some(Part::Magnet(1))), 10, 10);
        let poses = poses_through(&mut faulty, 25);
        assert_eq!(poses_accepted(&poses), [all(1, 9), all(20, 25)].concat(), "{kind:?}");
        assert!(poses.iter().all(|(now, message)| told(message, 0) == *now));
    }
    let misled = second_magnet(FaultVerb::Garbage(Garbage::Random));
    assert!((10..20).filter(|now| misled[now - 1] == Some(*now as u64)).count() < 3, "{misled:?}");
}
