//! Where bytes from outside come in: one function each, which must not panic, whatever the bytes are.
//!
//! Each also asserts what is promised of what it lets through. Used by the fuzz targets beside it and by
//! `tests/fuzz_corpus.rs`.

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use magsteer::config::{Config, Document, Experiment, Problems, TargetLines, experiment_of_csv};
use magsteer::control::plan::parse_targets;
use magsteer::control::{Cycle, Directions, identification};
use magsteer::daemon::recorder::{Crc32, Ending, Flight, FlightLabel, JOURNAL, read_journal};
use magsteer::daemon::{ControlLoop, DaemonConfig, LoopOptions, Request, RigCounts, Tick, verb_of};
use magsteer::magnetics::{fit, mpem};
use magsteer::recording::{Recording, recover};
use magsteer_hal::binding::RigSheet;
use magsteer_hal::fault::{FaultAnswer, FaultPlan, FaultPlanConfig, FaultRequest, Injector, Reach};
use magsteer_hal::message::SCHEMA;
use magsteer_hal::operator::{OperatorRequest, verb};
use magsteer_hal::scripted::EchoHardware;
use magsteer_hal::shape::{CentrelineKind, CloudSettings, CloudShape};
use magsteer_hal::udp;
use magsteer_hal::{
    Actuation, COILS_MAX, CoilCommand, CoilFeedback, CommandGuard, FeedbackReceiver, HardwareDescription,
    Header, HeaderWriter, MAGNETS_MAX, MagnetPose, POSE_PARAMETERS_MAX, PoseMessage, PoseReceiver, Stamp,
};
use magsteer_sim_plant::PlantConfig;

/// The shipped planar rig.
static SHIPPED: LazyLock<Config> = LazyLock::new(|| {
    let document =
        Document::from_text("shipped", include_str!("../../config/bigmag-planar.toml")).expect("TOML");
    Config::from_document(&document).expect("shipped")
});
static RIG: LazyLock<HardwareDescription> = LazyLock::new(|| SHIPPED.description.clone());

fn text(bytes: &[u8]) -> Option<Document> {
    let document = Document::from_text("fuzzed.toml", std::str::from_utf8(bytes).ok()?);
    document.map_err(|problems| words(&problems)).ok()
}

/// Problems are made to be read: writing them must not fail either.
fn words(problems: &Problems) {
    assert!(!problems.to_string().is_empty());
}

/// A rig's configuration, with the simulated plant's section.
pub fn config(bytes: &[u8]) {
    let Some(document) = text(bytes) else { return };
    let resolved = document.resolved();
    let again = Document::from_text("resolved", resolved.text.clone()).expect("what was resolved is TOML");
    assert_eq!(again.resolved(), resolved, "resolving changes nothing twice");
    match Config::from_document(&document) {
        Err(problems) => words(&problems),
        Ok(config) => {
            Config::from_document(&again).expect("the resolved text means the same");
            if let Ok(plant) = document.section::<PlantConfig>("plant") {
                let _ = plant.build(&config.description);
            }
        }
    }
}

/// An experiment.
pub fn experiment(bytes: &[u8]) {
    let Some(document) = text(bytes) else { return };
    match Experiment::from_document(&document, &RIG) {
        Err(problems) => words(&problems),
        Ok(experiment) => {
            look_at_targets(&experiment);
        }
    }
}

fn look_at_targets(experiment: &Experiment) {
    for step in &experiment.steps {
        assert!(step.duration_s > 0.0 && step.duration_s.is_finite());
        let target = experiment.target(step, &RIG);
        assert!(target.directions.iter().flatten().all(|component| component.is_finite()));
    }
}

/// An experiment as a table.
pub fn experiment_csv(bytes: &[u8]) {
    match experiment_of_csv(bytes, &RIG) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(experiment) => look_at_targets(&experiment),
    }
}

/// Lines of another program that streams targets.
pub fn target_lines(bytes: &[u8]) {
    let mut present = Directions::default();
    present[..2].copy_from_slice(&[[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    let mut lines = TargetLines::new(&RIG, [0.0, 1.0, 0.0], present);
    for line in String::from_utf8_lossy(bytes).lines() {
        match lines.target(line) {
            Err(refused) => assert!(!refused.is_empty()),
            Ok(target) => {
                for direction in &target.directions[..RIG.magnets().count()] {
                    let norm = direction.iter().map(|component| component * component).sum::<f64>().sqrt();
                    assert!((norm - 1.0).abs() < 1e-12, "{line}: {direction:?}");
                }
                for (angle, frame) in target.frame_angles.iter().flatten().zip(&RIG.frames) {
                    let slack = 1e-9 * (frame.angle_max - frame.angle_min);
                    assert!((frame.angle_min - slack..=frame.angle_max + slack).contains(angle), "{line}");
                }
            }
        }
    }
}

/// A script of faults.
pub fn fault_plan(bytes: &[u8]) {
    let Some(document) = text(bytes) else { return };
    match document.read::<FaultPlanConfig>() {
        Err(problems) => words(&problems),
        Ok(config) => {
            if let Ok(plan) = config.build(&RIG, Reach::Plant) {
                let mut injector = Injector::new(&RIG, &plan, 1);
                injector.start(Stamp::from_nanoseconds(1));
                run(&mut injector);
            }
        }
    }
}

/// Takes an injector through two seconds.
fn run(injector: &mut Injector) {
    let mut header = HeaderWriter::new(1);
    for step in 1..20_u32 {
        let now = Stamp::from_nanoseconds(1).after(step * Duration::from_millis(100));
        injector.offer_pose(PoseMessage::default(), now);
        injector.offer_feedback(CoilFeedback::default(), now);
        let _ = injector.take_pose(&mut header, now);
        let _ = injector.take_feedback(&mut header, now);
        let _ = injector.command(&CoilCommand::default(), now);
        while injector.next_condition(now).is_some() {}
        while injector.take_event().is_some() {}
    }
}

/// Targets of a plan.
pub fn targets_csv(bytes: &[u8]) {
    match parse_targets(bytes, &["m1", "m2"]) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(found) => {
            for direction in found.targets.iter().flat_map(|target| &target[..2]) {
                let norm = direction.iter().map(|component| component * component).sum::<f64>().sqrt();
                assert!((norm - 1.0).abs() < 1e-12, "{direction:?}");
            }
        }
    }
}

/// Calibration of one coil or of an array.
pub fn calibration_csv(bytes: &[u8]) {
    match fit::parse(bytes) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(found) => {
            assert!(!found.readings.is_empty());
            for reading in &found.readings {
                let vectors = reading.position.iter().chain(&reading.field);
                assert!(vectors.chain(&reading.currents).all(|value| value.is_finite()));
                assert_eq!(reading.currents.len(), found.coil_count());
            }
        }
    }
}

/// Equilibria for the identification.
pub fn identify_csv(bytes: &[u8]) {
    match identification::parse(bytes, &RIG) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(found) => assert!(!found.samples.is_empty()),
    }
}

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

/// A file of these bytes in a folder of its own, which is removed afterwards.
fn with_file(name: &str, bytes: &[u8], read: impl FnOnce(PathBuf)) {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("magsteer-fuzz-{}-{number}", std::process::id()));
    fs::create_dir_all(&folder).expect("a directory for temporary files");
    fs::write(folder.join(name), bytes).expect("room for a small file");
    read(folder.join(name));
    let _ = fs::remove_dir_all(&folder);
}

/// A flight as it stands; and, so that what a checksum keeps out is looked at too, with the bytes up to their
/// first zero as its header, the next one as the number of records in its one block, and the rest as these.
pub fn flight(bytes: &[u8]) {
    with_file("a.flight", bytes, |path| look_at_flight(&path));
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let mut file = b"MSFLIGHT\x01\0\0\0".to_vec();
    file.extend(u32::try_from(end).unwrap_or(u32::MAX).to_le_bytes());
    file.extend(&bytes[..end]);
    file.extend(Crc32::new().with(&file).value().to_le_bytes());
    let at = file.len();
    let records = bytes.get(end + 2..).unwrap_or_default();
    file.extend(b"BLCK\0\0\0\0");
    file.extend([bytes.get(end + 1).copied().unwrap_or(1), 0, 0, 0]);
    file.extend(records);
    let checksum = Crc32::new().with(&file[at..]).value();
    file.extend(checksum.to_le_bytes());
    with_file("a.flight", &file, |path| look_at_flight(&path));
}

fn look_at_flight(path: &std::path::Path) {
    match FlightLabel::read(path) {
        Err(error) => assert!(!error.to_string().is_empty()),
        Ok(label) => assert!(!label.header.words().is_empty()),
    }
    let Ok(flight) = Flight::read(path) else { return };
    assert_eq!(flight.ending == Ending::Complete, flight.ending.words().is_none());
    for record in 0..flight.records().min(64) {
        assert_eq!(flight.record(record).len(), flight.header.columns.len());
        for column in &flight.header.columns {
            let _ = (flight.count(record, &column.name), flight.number(record, &column.name));
        }
    }
}

/// A recording as it stands, and what recovery makes of it: that is whole, and holds as many messages.
pub fn recording(bytes: &[u8]) {
    with_file("recording.mcap", bytes, |path| {
        look_at_recording(&path);
        let mended = path.with_file_name("mended.mcap");
        match recover(&path, &mended) {
            Err(error) => assert!(!error.to_string().is_empty()),
            Ok(recovered) => {
                assert!(recovered.bytes_read + recovered.bytes_lost <= bytes.len() as u64);
                let again = recover(&mended, &path.with_file_name("again.mcap")).expect("its own");
                assert!(again.was_whole);
                assert_eq!((again.messages, again.damaged), (recovered.messages, 0));
            }
        }
    });
}

fn look_at_recording(path: &std::path::Path) {
    let recording = match Recording::open(path) {
        Ok(recording) => recording,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let cycles = recording.cycles().expect("it was opened before");
    let whole = cycles.take_while(Result::is_ok).count() as u64;
    if let Ok(counts) = recording.counts() {
        assert_eq!(counts.cycles, whole);
        assert!(counts.cycles <= counts.messages);
    }
    let _ = (recording.events(), recording.metadata());
}

/// A calibration of a multipole electromagnet model: what is let through is written and read back the same.
pub fn calibration_yaml(bytes: &[u8]) {
    let calibration = match mpem::read(bytes) {
        Ok(calibration) => calibration,
        Err(refusal) => {
            assert!(!refusal.to_string().is_empty());
            return;
        }
    };
    match mpem::placed_coils(&calibration) {
        Err(refusal) => assert!(!refusal.to_string().is_empty()),
        Ok(coils) => {
            for coil in &coils {
                assert!(coil.coefficients.iter().all(|coefficient| coefficient.is_finite()), "{coil:?}");
                assert!(coil.field_at_center.iter().all(|component| component.is_finite()), "{coil:?}");
            }
        }
    }
    let written = mpem::write(&calibration, &[]).expect("the names were read from a file");
    let again = mpem::read(written.as_bytes()).expect("its own");
    let sources = |calibration: &mpem::Calibration| {
        calibration.coils.iter().flat_map(|coil| coil.sources.clone()).collect::<Vec<_>>()
    };
    let (before, after) = (sources(&calibration), sources(&again));
    assert_eq!(before.len(), after.len());
    for (before, after) in before.iter().zip(&after) {
        assert_eq!((&before.rising, &before.falling), (&after.rising, &after.falling));
        assert_eq!(before.position, after.position);
        // Made a unit vector once more, which rounds.
        assert!((before.direction - after.direction).norm() < 1e-15, "{before:?}");
    }
}

/// A journal of events.
pub fn journal(bytes: &[u8]) {
    with_file(JOURNAL, bytes, |path| {
        let folder = path.parent().expect("in a folder");
        let page = read_journal(folder).expect("it can be read");
        assert!(page.entries.iter().all(|entry| !entry.event.is_empty()));
        assert!(page.entries.len() as u64 + page.damaged <= bytes.len() as u64 + 1);
    });
}
