//! Goal: a control cycle allocates nothing, whatever happens in it; over shared memory exactly once for each message sent, which
//! is the transport's own and a hit of the C library's thread cache.
//!
//! Method: a global allocator counts per thread, and is asked about each cycle. Faults, lost sensing, a model that does not
//! converge, requests that are not finite, stalls, resets and re-arming all happen within the counted cycles.

mod counting_allocator;

use std::time::Duration;

use counting_allocator::allocations_in;
use magsteer::control::{
    ControlConfig, CycleInput, CycleOutcome, FrameUse, MarginGuardConfig, ReferenceTarget, Step,
};
use magsteer::daemon::{
    ControlLoop, CycleRecord, CycleTiming, DaemonConfig, Directive, LoopOptions, MinuteStatistics, Request,
    Statistics, StopWatch, Tick, Verb,
};
use magsteer_hal::channels::{DaemonServices, DriverEnd, PrivateRoot};
use magsteer_hal::operator::state;
use magsteer_hal::scripted::{EchoHardware, example_description};
use magsteer_hal::{
    Actuation, AdmittedCommand, CoilFeedback, CommandGuard, Hardware, MagnetPose, POSE_PARAMETERS_MAX,
    PoseMessage, Sensed, Stamp, WriteError,
};
use rand::{RngExt, SeedableRng};

const CYCLES: u32 = 10_000;
const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Asks for currents that change, and fails as told.
struct Scripted {
    current: f64,
    converged: bool,
    margin: f64,
}

impl Step for Scripted {
    fn step(&mut self, input: &CycleInput) -> CycleOutcome {
        let mut request = input.admitted;
        if input.engaged {
            request.current_a[0] = self.current;
        }
        let mut outcome =
            CycleOutcome { desired: input.target.directions, ..CycleOutcome::asking_for(request) };
        (outcome.model.converged, outcome.model.margin) = (self.converged, self.margin);
        outcome
    }
}

fn daemon_config() -> DaemonConfig {
    let file = include_str!("../config/bigmag-planar.toml");
    let table: toml::Table = file.parse().expect("shipped");
    table["daemon"].clone().try_into().expect("shipped")
}

/// A verb now and then, so that the loop is armed, steered, held, sent back, stopped and reset again and again.
fn some_verb(random: &mut rand_chacha::ChaCha8Rng) -> Option<Verb> {
    let verbs = [
        Verb::Arm,
        Verb::Go,
        Verb::Go,
        Verb::Hold,
        Verb::Retreat,
        Verb::Reset,
        Verb::Stop,
        Verb::SetTarget([UP; 8].into()),
        Verb::EmergencyStop,
    ];
    let last = if random.random_bool(0.1) { verbs.len() } else { verbs.len() - 1 };
    random.random_bool(0.05).then(|| verbs[random.random_range(0..last)])
}

/// Which states a run went through, by code.
#[derive(Debug, Default)]
struct Visited([u32; 7]);

impl Visited {
    fn note(&mut self, record: &CycleRecord) {
        self.0[record.decision.state as usize] += 1;
    }

    fn everywhere(&self) -> bool {
        (state::IDLE..=state::FAULT).all(|code| self.0[code as usize] > 0)
    }
}

/// Proves SR-19.
#[test]
fn cycles_with_faults_and_rearming_allocate_nothing() {
    let description = example_description();
    let config = daemon_config();
    let hardware = EchoHardware::new(&description);
    let controller = Scripted { current: 1.0, converged: true, margin: 1.0 };
    let mut control_loop =
        ControlLoop::new(hardware, controller, &description, &config, LoopOptions::default());
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(11);
    let mut tick = Tick::first(Stamp::from_nanoseconds(1_000_000_000));
    let (mut visited, mut went_back) = (Visited::default(), 0);
    for cycle in 0..CYCLES {
        disturb(&mut random, &mut control_loop);
        if let Some(verb) = some_verb(&mut random) {
            control_loop.request(Request { id: cycle, verb }).expect("one request a cycle");
        }
        let stall = if random.random_bool(0.001) { random.random_range(2..150) } else { 1 };
        tick = Tick { missed: u64::from(stall - 1), ..tick.stepped(config.period() * stall) };
        let (record, allocations) = allocations_in(|| control_loop.cycle(tick));
        assert_eq!(allocations, 0, "cycle {cycle}: {record:?}");
        visited.note(&record);
        went_back += u32::from(record.decision.directive == Directive::Retreat);
    }
    assert!(visited.everywhere(), "the seed must lead through every state: {visited:?}");
    assert!(went_back > 0, "nor may a retreat be missing");
}

/// Goal: neither counting nor the turn of a minute nor reading the clock at the end of each phase allocates.
#[test]
fn timing_a_cycle_allocates_nothing_not_even_at_the_turn_of_a_minute() {
    let description = example_description();
    let config = daemon_config();
    let controller = Scripted { current: 1.0, converged: true, margin: 1.0 };
    let hardware = EchoHardware::new(&description);
    let mut control_loop =
        ControlLoop::new(hardware, controller, &description, &config, LoopOptions::default());
    let mut run = Statistics::new(config.rate_hz);
    let mut minutes = MinuteStatistics::new(config.rate_hz);
    let mut tick = Tick::first(Stamp::from_nanoseconds(1_000_000_000));
    for cycle in 0..200 {
        // Ten minutes in all.
        tick = tick.stepped(Duration::from_secs(3));
        let (_, allocations) = allocations_in(|| {
            let mut watch = StopWatch::started(Stamp::now());
            let mut record = control_loop.timed_cycle(tick, &mut watch);
            record.note_times(watch.finish());
            let timing: CycleTiming = record.timing();
            run.record(&timing);
            minutes.record(tick.now, &timing);
        });
        assert_eq!(allocations, 0, "cycle {cycle}");
    }
    assert_eq!(run.summary().cycles, 200);
    assert_eq!(minutes.last().map(|last| last.cycles), Some(20));
}

fn disturb(random: &mut rand_chacha::ChaCha8Rng, control_loop: &mut ControlLoop<EchoHardware, Scripted>) {
    if random.random_bool(0.003) {
        match random.random_range(0..4) {
            0 => control_loop.hardware_mut().set_silent(true),
            1 => control_loop.hardware_mut().set_fault(1),
            2 => control_loop.controller_mut().converged = false,
            _ => control_loop.controller_mut().current = f64::NAN,
        }
    }
    if random.random_bool(0.01) {
        control_loop.controller_mut().margin = 0.05;
    }
    if random.random_bool(0.01) {
        control_loop.hardware_mut().set_silent(false);
        control_loop.hardware_mut().set_fault(0);
        *control_loop.controller_mut() =
            Scripted { current: random.random_range(-8.0..8.0), converged: true, margin: 1.0 };
    }
}

/// An ideal rig whose current sensors say something else when told to.
struct Misreading {
    rig: EchoHardware,
    reported: Option<Actuation>,
}

impl Hardware for Misreading {
    fn read(&mut self, now: Stamp) -> Sensed {
        let mut sensed = self.rig.read(now);
        if let (Some(feedback), Some(reported)) = (&mut sensed.feedback.last, self.reported) {
            feedback.measured = reported;
        }
        sensed
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        self.rig.write(command, now)
    }
}

impl Misreading {
    /// Now and then other currents than there are, all within range, for some cycles; magnets that turn by leaps.
    fn disturb(&mut self, random: &mut rand_chacha::ChaCha8Rng) {
        if random.random_bool(0.02) {
            let mut reported = Actuation::default();
            reported.current_a[..6].fill_with(|| random.random_range(-8.0..8.0));
            reported.angle_rad[..2].fill_with(|| random.random_range(-3.0..3.0));
            self.reported = Some(reported);
        } else if random.random_bool(0.1) {
            self.reported = None;
        }
        if random.random_bool(0.01) {
            let (sine, cosine) = random.random_range(0.0..1.5_f64).sin_cos();
            let pose =
                MagnetPose { orientation_xyzw: [0.0, sine, 0.0, cosine], valid: 1, ..MagnetPose::default() };
            self.rig.set_poses(&[pose; 2]);
        }
    }
}

/// Goal: the same with the real controller, its frames held, and steered with the margin guarded. The rig's magnets do not obey its
/// currents, so that the loop drives them to their limits, and measured currents jump, so that the model does not converge.
///
/// Proves SR-19.
#[test]
fn the_real_controller_allocates_nothing() {
    let guard = MarginGuardConfig { floor: 0.1, rate_per_s: 10.0 };
    for (file, guard, seed) in [("bigmag-planar.toml", None, 12), ("bigmag-3d.toml", Some(guard), 14)] {
        steer_a_misreading_rig(file, guard, seed);
    }
}

fn steer_a_misreading_rig(file: &str, guard: Option<MarginGuardConfig>, seed: u64) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(file);
    let (_, config) = magsteer::config::Config::load(&path).expect("shipped");
    let rig = &config.description;
    let (control, daemon) = (config.control.clone(), config.daemon.as_ref().expect("shipped"));
    let control = ControlConfig { margin_guard: guard, ..control.expect("shipped") };
    let manipulator = config.manipulator.clone().expect("shipped");
    let controller = magsteer::control::Cycle::new(&control, rig, manipulator);
    let hardware = Misreading { rig: EchoHardware::new(rig), reported: None };
    let mut control_loop = ControlLoop::new(hardware, controller, rig, daemon, LoopOptions::default());
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut tick = Tick::first(Stamp::from_nanoseconds(1_000_000_000));
    let (mut visited, mut unconverged, mut scouting) = (Visited::default(), 0, 0);
    for cycle in 0..CYCLES {
        control_loop.hardware_mut().disturb(&mut random);
        let verb = if random.random_bool(0.004) {
            let angle: f64 = random.random_range(-3.0..3.0);
            let directions = [[angle.sin(), 0.0, angle.cos()]; 8];
            // Where frames steer, the way of a target that names their angles is looked at.
            let steered = config.control.as_ref().is_some_and(|it| it.frame_angles == FrameUse::Steer);
            Some(Verb::SetTarget(ReferenceTarget { directions, frame_angles: steered.then_some([0.3; 8]) }))
        } else {
            // A stop now and then, but long stretches of steering.
            some_verb(&mut random).filter(|verb| *verb != Verb::Stop || random.random_bool(0.2))
        };
        if let Some(verb) = verb {
            control_loop.request(Request { id: cycle, verb }).expect("one request a cycle");
        }
        let stall = if random.random_bool(0.001) { random.random_range(2..150) } else { 1 };
        tick = Tick { missed: u64::from(stall - 1), ..tick.stepped(daemon.period() * stall) };
        let (record, allocations) = allocations_in(|| control_loop.cycle(tick));
        assert_eq!(allocations, 0, "cycle {cycle}: {record:?}");
        visited.note(&record);
        unconverged += u32::from(!record.outcome.model.converged);
        scouting += u32::from(record.outcome.verdict == magsteer::control::Verdict::Checking);
    }
    println!("{unconverged} cycles without convergence; {visited:?}");
    assert!(visited.everywhere(), "the seed must lead through every state: {visited:?}");
    assert!(unconverged > 500, "the seed must lead the model astray: {unconverged}");
    assert!(scouting > 100, "the seed must send the scout ahead: {scouting}");
}

/// A driver that is stepped by this thread between two cycles.
struct Driver {
    end: DriverEnd,
    guard: CommandGuard,
}

impl Driver {
    fn step(&mut self, now: Stamp) {
        if let Some(command) = self.end.take_command(now) {
            // Refusals are counted by the guard.
            let _ = self.guard.offer(&command, now);
        }
        let setpoint = self.guard.setpoint(now, 1e-3);
        let upright =
            MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
        let mut pose = PoseMessage { magnet_count: 2, magnets: [upright; 8], ..PoseMessage::default() };
        pose.header.source_stamp_ns = now.nanoseconds();
        self.end.publish_pose(pose, now).expect("the transport works");
        let mut feedback = CoilFeedback { measured: *setpoint.actuation(), ..CoilFeedback::default() };
        feedback.header.source_stamp_ns = now.nanoseconds();
        self.guard.report(&mut feedback);
        self.end.publish_feedback(feedback, now).expect("the transport works");
    }
}

/// Proves SR-19.
#[test]
fn over_shared_memory_a_cycle_allocates_once_for_a_message_sent() {
    let root = PrivateRoot::create("ms").expect("shared memory is there");
    let endpoint = root.endpoint("example").expect("short and own");
    let description = example_description();
    let guard = CommandGuard::new(&description, &[0.0; POSE_PARAMETERS_MAX]);
    let mut driver = Driver { end: DriverEnd::create(&endpoint).expect("own root"), guard };
    let services = DaemonServices::open(&endpoint, Duration::from_secs(20)).expect("the driver is there");
    let hardware = services.into_ports(&description).expect("the transport works");
    // Times of this test are the machine's, since the transport stamps with them: wide limits.
    let mut config = daemon_config();
    (config.command_validity_ms, config.pose_hold_ms, config.pose_stop_ms) = (1e3, 3e3, 6e3);
    (config.feedback_stop_ms, config.overrun_window_ms) = (5e3, 1e4);
    let controller = Scripted { current: 1.0, converged: true, margin: 1.0 };
    let mut control_loop =
        ControlLoop::new(hardware, controller, &description, &config, LoopOptions::default());
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(13);
    let mut tick = Tick::first(Stamp::now());
    let (mut sent, mut allocated) = (0, 0);
    for cycle in 0..CYCLES {
        driver.step(Stamp::now());
        let verb = match cycle {
            5 => Some(Verb::Arm),
            // The first message of all forms the connection.
            0..30 => None,
            30 => Some(Verb::Go),
            _ => some_verb(&mut random),
        };
        if let Some(verb) = verb {
            control_loop.request(Request { id: cycle, verb }).expect("one request a cycle");
        }
        tick = Tick { number: tick.number + 1, ..Tick::first(Stamp::now()) };
        let (record, allocations) = allocations_in(|| control_loop.cycle(tick));
        if cycle > 20 {
            let messages = u64::from(record.order.is_some());
            assert_eq!(allocations, messages, "cycle {cycle}: {record:?}");
            (sent, allocated) = (sent + messages, allocated + allocations);
        }
    }
    assert_eq!(sent, allocated);
    assert!(sent > 1_000, "the seed must steer for long enough: {sent}");
}

/// Goal: the counter itself sees an allocation, and only where it is asked to.
#[test]
fn the_counter_counts() {
    let (kept, counted) = allocations_in(|| vec![1_u8; 100]);
    assert_eq!(counted, 1);
    let (_, counted) = allocations_in(|| ());
    assert_eq!((counted, kept.len()), (0, 100));
    assert_eq!(Actuation::default().current_a[0], 0.0);
}
