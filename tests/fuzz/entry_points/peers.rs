//! Messages of hostile processes and devices, one after the other.

use std::time::Duration;

use magsteer::control::Cycle;
use magsteer::daemon::{ControlLoop, DaemonConfig, LoopOptions, Request, RigCounts, Tick, verb_of};
use magsteer_hal::binding::RigSheet;
use magsteer_hal::fault::{FaultAnswer, FaultPlan, FaultRequest, Injector, Reach};
use magsteer_hal::message::SCHEMA;
use magsteer_hal::operator::{OperatorRequest, verb};
use magsteer_hal::scripted::EchoHardware;
use magsteer_hal::shape::{CentrelineKind, CloudSettings, CloudShape};
use magsteer_hal::udp;
use magsteer_hal::{
    Actuation, COILS_MAX, CoilCommand, CoilFeedback, CommandGuard, FeedbackReceiver, Header, MAGNETS_MAX,
    MagnetPose, POSE_PARAMETERS_MAX, PoseMessage, PoseReceiver, Stamp,
};

use super::rig::{RIG, SHIPPED, run};

/// Takes values out of bytes; zeros beyond their end.
struct Cursor<'a>(&'a [u8]);

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut value = [0; N];
        let length = N.min(self.0.len());
        let (head, rest) = self.0.split_at(length);
        value[..length].copy_from_slice(head);
        self.0 = rest;
        value
    }

    fn byte(&mut self) -> u8 {
        self.take::<1>()[0]
    }

    /// True for one byte of four.
    fn seldom(&mut self) -> bool {
        self.byte().is_multiple_of(4)
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }

    fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    fn array<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.f64())
    }

    /// A header as it stands, or one that passes, so that what comes behind it is looked at too.
    fn header(&mut self, now: Stamp) -> Header {
        if self.seldom() {
            return Header {
                sequence: self.u64(),
                source_stamp_ns: self.u64(),
                publish_stamp_ns: self.u64(),
                epoch: self.u64(),
                schema: self.u32(),
                flags: self.u32(),
                valid_until_ns: self.u64(),
            };
        }
        Header {
            sequence: now.nanoseconds() / 1_000_000,
            source_stamp_ns: now.nanoseconds(),
            publish_stamp_ns: now.nanoseconds(),
            epoch: 7 + u64::from(self.byte().is_multiple_of(8)),
            schema: SCHEMA,
            flags: 0,
            valid_until_ns: now.after(Duration::from_millis(100)).nanoseconds(),
        }
    }

    /// A count that fits, or any.
    fn count(&mut self, fitting: usize) -> u32 {
        if self.seldom() { self.u32() } else { u32::try_from(fitting).unwrap_or(u32::MAX) }
    }

    /// A request as an operator's program may send it: its verb mostly one that there is, directions anything.
    fn request(&mut self) -> OperatorRequest {
        let mut request = OperatorRequest {
            verb: if self.seldom() { self.u32() } else { u32::from(self.byte() % 9) },
            magnet_count: self.count(RIG.magnets().count()),
            pose_parameter_count: u32::from(self.byte() % 4),
            valid_ms: if self.seldom() { self.u32() } else { 0 },
            ..OperatorRequest::default()
        };
        if request.verb == verb::SET_TARGET {
            let used = RIG.magnets().count() + 1;
            for direction in request.direction.iter_mut().take(used) {
                *direction = match self.byte() % 4 {
                    0 => self.array(),
                    1 => [0.0, 0.0, 1.0],
                    _ => {
                        let turn = f64::from(self.byte()) / 32.0;
                        [turn.sin(), 0.0, turn.cos()]
                    }
                };
            }
            request.angle_rad = self.array();
        }
        request
    }

    fn actuation(&mut self) -> Actuation {
        Actuation { current_a: self.array::<COILS_MAX>(), angle_rad: self.array::<POSE_PARAMETERS_MAX>() }
    }
}

/// A series of messages from a hostile peer: poses, feedback, commands, requests for faults.
pub fn messages(bytes: &[u8]) {
    let rig = &*RIG;
    let mut cursor = Cursor(bytes);
    let (mut poses, mut feedback) = (PoseReceiver::new(rig), FeedbackReceiver::new(rig));
    let mut guard = CommandGuard::new(rig, &[0.0; POSE_PARAMETERS_MAX]);
    let mut injector = Injector::new(rig, &FaultPlan::empty(Reach::Plant), 1);
    let mut now = Stamp::from_nanoseconds(1_000_000_000);
    injector.start(now);
    for _ in 0..64 {
        if cursor.0.is_empty() {
            break;
        }
        now = now.after(Duration::from_millis(1 + u64::from(cursor.byte())));
        match cursor.byte() % 4 {
            0 => take_poses(&mut cursor, &mut poses, now),
            1 => take_feedback(&mut cursor, &mut feedback, now),
            2 => take_command(&mut cursor, &mut guard, now),
            _ => take_fault(&mut cursor, &mut injector, now),
        }
    }
    run(&mut injector);
}

fn take_poses(cursor: &mut Cursor<'_>, receiver: &mut PoseReceiver, now: Stamp) {
    let used = RIG.magnets().count();
    let mut message = PoseMessage {
        header: cursor.header(now),
        magnet_count: cursor.count(used),
        ..PoseMessage::default()
    };
    for magnet in message.magnets.iter_mut().take(used) {
        magnet.valid = cursor.count(1);
        // Values of a rod here, with one of them anything.
        magnet.orientation_xyzw = [0.0, 0.0, 0.0, 1.0];
        let place = usize::from(cursor.byte() % 9);
        match place {
            0..3 => magnet.position_m[place] = cursor.f64(),
            3..7 => magnet.orientation_xyzw[place - 3] = cursor.f64(),
            _ => (),
        }
    }
    let reading = receiver.receive(Some(&message), now);
    assert_eq!(reading.fresh, reading.refused.is_none());
    let Some(last) = reading.last else { return };
    assert_eq!(last.magnet_count as usize, used);
    for magnet in &last.magnets[..used] {
        assert!(magnet.position_m.iter().all(|value| value.abs() < 1e3), "{magnet:?}");
        let norm = magnet.tangent().iter().map(|value| value * value).sum::<f64>().sqrt();
        assert!((norm - 1.0).abs() < 1e-12, "{magnet:?}");
    }
    assert!(last.magnets[used..MAGNETS_MAX].iter().all(|magnet| magnet.position_m == [0.0; 3]));
}

fn take_feedback(cursor: &mut Cursor<'_>, receiver: &mut FeedbackReceiver, now: Stamp) {
    let message = CoilFeedback {
        header: cursor.header(now),
        description_fingerprint: if cursor.seldom() { cursor.u64() } else { RIG.fingerprint() },
        state: cursor.u32() % 6,
        fault: cursor.u32(),
        coil_count: cursor.count(RIG.coils.len()),
        pose_parameter_count: cursor.count(RIG.frames.len()),
        measured: cursor.actuation(),
        ..CoilFeedback::default()
    };
    let reading = receiver.receive(Some(&message), now);
    assert_eq!(reading.fresh, reading.refused.is_none());
    let Some(last) = reading.last else { return };
    let values = last.measured.current_a.iter().chain(&last.measured.angle_rad);
    assert!(values.into_iter().all(|value| value.is_finite()));
}

fn take_command(cursor: &mut Cursor<'_>, guard: &mut CommandGuard, now: Stamp) {
    let command = CoilCommand {
        header: cursor.header(now),
        token: u64::from(cursor.byte() % 4),
        order: u32::from(cursor.byte() % 6),
        coil_count: cursor.count(RIG.coils.len()),
        pose_parameter_count: cursor.count(RIG.frames.len()),
        actuation: if cursor.seldom() { Actuation::default() } else { cursor.actuation() },
        ..CoilCommand::default()
    };
    let _ = guard.offer(&command, now);
    let period_s = if cursor.seldom() { cursor.f64() } else { 1e-3 };
    let setpoint = guard.setpoint(now, period_s);
    for (current, coil) in setpoint.actuation().current_a.iter().zip(&RIG.coils) {
        assert!(current.abs() <= coil.current_max, "{current}");
    }
    for (angle, frame) in setpoint.actuation().angle_rad.iter().zip(&RIG.frames) {
        assert!((frame.angle_min..=frame.angle_max).contains(angle), "{angle}");
    }
}

fn take_fault(cursor: &mut Cursor<'_>, injector: &mut Injector, now: Stamp) {
    let request = FaultRequest {
        action: cursor.u32() % 4,
        target: cursor.u32() % 7,
        part: cursor.u32() % 5,
        index: cursor.count(1),
        verb: cursor.u32() % 16,
        kind: cursor.u32() % 6,
        lasts_ns: cursor.u64(),
        time_ns: cursor.u64(),
        value: cursor.f64(),
    };
    let answer = FaultAnswer::to(&request, injector, now);
    assert!(answer.accepted <= 1);
}

/// Requests of a hostile operator, through the shipped controller and the daemon's loop, to an ideal driver: none
/// sends a coil or a frame beyond its limits.
pub fn operator_requests(bytes: &[u8]) {
    let rig = &*RIG;
    let missing = "shipped with all tables";
    let control = SHIPPED.control.as_ref().expect(missing);
    let daemon: &DaemonConfig = SHIPPED.daemon.as_ref().expect(missing);
    let controller = Cycle::new(control, rig, SHIPPED.manipulator.clone().expect(missing));
    let mut hardware = EchoHardware::new(rig);
    let straight: Vec<MagnetPose> = RigSheet::of(rig)
        .magnets
        .iter()
        .map(|magnet| MagnetPose {
            position_m: magnet.position_m,
            orientation_xyzw: magnet.orientation_xyzw,
            valid: 1,
            ..MagnetPose::default()
        })
        .collect();
    hardware.set_poses(&straight);
    let mut control_loop = ControlLoop::new(hardware, controller, rig, daemon, LoopOptions::default());
    let mut tick = Tick::first(Stamp::from_nanoseconds(1_000_000_000));
    let mut cursor = Cursor(bytes);
    for id in 0..32 {
        if cursor.0.is_empty() {
            break;
        }
        if let Ok(verb) = verb_of(&cursor.request(), RigCounts::of(rig)) {
            control_loop.request(Request { id, verb }).expect("the one before was taken by a cycle");
        }
        for _ in 0..=cursor.byte() % 32 {
            let record = control_loop.cycle(tick);
            tick = tick.stepped(daemon.period());
            for (current, coil) in record.admitted.current_a.iter().zip(&rig.coils) {
                assert!(current.abs() <= coil.current_max, "{current}");
            }
            for (angle, frame) in record.admitted.angle_rad.iter().zip(&rig.frames) {
                assert!((frame.angle_min..=frame.angle_max).contains(angle), "{angle}");
            }
        }
    }
    let guard = control_loop.hardware().guard();
    assert_eq!(guard.limit_breaks(), 0);
}

/// Clouds of points, one after the other: any numbers, or near the rod.
pub fn cloud(bytes: &[u8]) {
    let viewers = [[-0.05, -0.3, 0.1], [0.05, -0.3, 0.1]];
    let (&[kind, ..], Some(rest)) = (bytes, bytes.get(1..)) else { return };
    let centreline = match kind % 2 {
        0 => CentrelineKind::Curvature { degree: 2 },
        _ => CentrelineKind::Polynomial { degree: 6 },
    };
    let manipulator = &RIG.manipulator;
    let mut settings = CloudSettings::new(centreline, manipulator, 0.3e-3, &viewers);
    // A few hundred points: an iteration costs what they cost, and mistakes do not wait for more.
    settings.capacity = 256;
    let mut shape = CloudShape::new(manipulator, settings).expect("of a shipped rig");
    for bytes in rest.chunks(4_096) {
        let points: Vec<[f64; 3]> = if kind % 4 < 2 {
            let coordinate = |bytes: &[u8]| f64::from(i16::from_le_bytes([bytes[0], bytes[1]])) * 3e-6;
            bytes.chunks_exact(6).map(|bytes| [0, 2, 4].map(|at| coordinate(&bytes[at..]))).collect()
        } else {
            let coordinate =
                |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
            bytes.chunks_exact(12).map(|bytes| [0, 4, 8].map(|at| coordinate(&bytes[at..]))).collect()
        };
        let Ok(found) = shape.reconstruct(&points) else { continue };
        for magnet in found.magnets().iter().filter(|magnet| magnet.pose.valid == 1) {
            assert!(magnet.pose.position_m.iter().all(|value| value.is_finite()), "{magnet:?}");
            let norm = magnet.pose.orientation_xyzw.iter().map(|value| value * value).sum::<f64>();
            assert!((norm - 1.0).abs() < 1e-9, "{magnet:?}");
        }
    }
}

/// Datagrams between a driver and its device, each taken for all of the three kinds: none, or one that is
/// written as it was read.
pub fn datagrams(bytes: &[u8]) {
    let (coils, frames, magnets) = (RIG.coils.len(), RIG.frames.len(), RIG.magnets().count());
    if let Ok(request) = udp::Request::decode(bytes, coils, frames) {
        let written = request.encode(coils, frames);
        let again = udp::Request::decode(&written, coils, frames).expect("its own");
        assert_eq!(again.encode(coils, frames), written);
    }
    if let Ok(answer) = udp::Answer::decode(bytes, coils, frames) {
        let written = answer.encode(coils, frames);
        let again = udp::Answer::decode(&written, coils, frames).expect("its own");
        assert_eq!(again.encode(coils, frames), written);
    }
    if let Ok(poses) = udp::Poses::decode(bytes, magnets) {
        assert_eq!(poses.magnet_count as usize, magnets);
        let written = poses.encode();
        let again = udp::Poses::decode(&written, magnets).expect("its own");
        assert_eq!(again.encode(), written);
    }
}
