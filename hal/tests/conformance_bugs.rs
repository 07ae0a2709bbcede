//! The conformance suite names what is wrong: a small driver behind real channels, with one bug at a time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use magsteer_hal::channels::{DriverEnd, Endpoint, PrivateRoot};
use magsteer_hal::conformance::{
    Clause, Ending, Finding, Garbage, Level, RunningRig, StatedRates, Tolerances, Verdict, examine,
};
use magsteer_hal::message::{driver_state, order};
use magsteer_hal::scripted::example_description;
use magsteer_hal::{
    Actuation, CoilCommand, CoilFeedback, CommandGuard, HardwareDescription, MagnetPose, POSE_PARAMETERS_MAX,
    PoseMessage, Setpoint, Stamp,
};

const PERIOD: Duration = Duration::from_millis(1);
/// Of the amplifiers.
const TIME_CONSTANT_S: f64 = 0.002;
/// Rigs that two cores can run beside each other.
const AT_ONCE: usize = 7;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Bug {
    None,
    WrongSign,
    SwappedChannels,
    MilliamperesForAmperes,
    CrossTalk,
    NoWatchdog,
    CutsInsteadOfRamp,
    RampsTooSlowly,
    NoSlewLimit,
    NoLimits,
    ObeysWithoutClaim,
    AcceptsRival,
    AcceptsExpired,
    AcceptsFormerSequence,
    AcceptsAnyToken,
    EchoesNothing,
    ForgetsDisable,
    StaleStamps,
    WallClock,
    SequenceRepeats,
    WrongFingerprint,
    FormerLayout,
    TooSlow,
    CurrentLeaks,
    DegreesForRadians,
    SwappedFrames,
    FrameTurnsBack,
    PositionsInMillimetres,
    PosesTooOld,
}

/// Each bug and the check that names it.
const CASES: [(Bug, Clause); 28] = [
    (Bug::WrongSign, Clause::CurrentSign),
    (Bug::SwappedChannels, Clause::CurrentOrder),
    (Bug::MilliamperesForAmperes, Clause::CurrentScale),
    (Bug::CrossTalk, Clause::CurrentCrosstalk),
    (Bug::NoWatchdog, Clause::LapseEndsAuthority),
    (Bug::CutsInsteadOfRamp, Clause::LapseRampKeepsSlew),
    (Bug::RampsTooSlowly, Clause::LapseRampsDown),
    (Bug::NoSlewLimit, Clause::JumpIsSlewed),
    (Bug::NoLimits, Clause::OverLimitIsHeld),
    (Bug::ObeysWithoutClaim, Clause::NoDriveWithoutClaim),
    (Bug::AcceptsRival, Clause::RivalIsRefused),
    (Bug::AcceptsExpired, Clause::Garbage(Garbage::Expired)),
    (Bug::AcceptsFormerSequence, Clause::Garbage(Garbage::Sequence)),
    (Bug::AcceptsAnyToken, Clause::Garbage(Garbage::Token)),
    (Bug::EchoesNothing, Clause::ClaimIsEchoed),
    (Bug::ForgetsDisable, Clause::DisableIsKept),
    (Bug::StaleStamps, Clause::FeedbackStamps),
    (Bug::WallClock, Clause::FeedbackStamps),
    (Bug::SequenceRepeats, Clause::FeedbackSequence),
    (Bug::WrongFingerprint, Clause::Fingerprint),
    (Bug::FormerLayout, Clause::LayoutVersion),
    (Bug::TooSlow, Clause::FeedbackRate),
    (Bug::CurrentLeaks, Clause::CurrentAtRest),
    (Bug::DegreesForRadians, Clause::AngleScale),
    (Bug::SwappedFrames, Clause::AngleOrder),
    (Bug::FrameTurnsBack, Clause::AngleSign),
    (Bug::PositionsInMillimetres, Clause::PoseContents),
    (Bug::PosesTooOld, Clause::PoseStamps),
];

/// Guard, amplifiers of first order, a sensor that sees a rod at rest; and the bug.
struct Driver {
    bug: Bug,
    description: HardwareDescription,
    guard: CommandGuard,
    end: DriverEnd,
    start: Stamp,
    measured: Actuation,
    /// Set point that the amplifiers follow.
    applied: Actuation,
    commanded: Option<CoilCommand>,
    sequence: u64,
    cycle: u64,
}

impl Driver {
    fn new(bug: Bug, endpoint: &Endpoint) -> Self {
        let description = example_description();
        let guard = CommandGuard::new(&description, &[0.0; POSE_PARAMETERS_MAX]);
        Self {
            bug,
            guard,
            end: DriverEnd::create(endpoint).expect("a driver"),
            description,
            start: Stamp::now(),
            measured: Actuation::default(),
            applied: Actuation::default(),
            commanded: None,
            sequence: 0,
            cycle: 0,
        }
    }

    fn run(mut self, stop: &AtomicBool) {
        let mut before = Stamp::now();
        while !stop.load(Ordering::Relaxed) {
            thread::sleep(PERIOD);
            let now = Stamp::now();
            self.step(now, now.since(before).as_secs_f64());
            before = now;
        }
    }

    fn step(&mut self, now: Stamp, period: f64) {
        if let Some(command) = self.end.take_command(now) {
            self.offer(command, now);
        }
        let setpoint = self.guard.setpoint(now, period);
        self.applied = self.spoilt(&setpoint, period);
        self.follow(period);
        self.cycle += 1;
        if self.bug != Bug::TooSlow || self.cycle.is_multiple_of(100) {
            self.publish(now);
        }
    }

    fn offer(&mut self, mut command: CoilCommand, now: Stamp) {
        let accepted = |bug| self.bug == bug;
        if accepted(Bug::AcceptsExpired) {
            command.header.valid_until_ns = now.after(Duration::from_millis(200)).nanoseconds();
        }
        if accepted(Bug::AcceptsAnyToken) {
            command.token = 1;
        }
        if accepted(Bug::AcceptsFormerSequence) {
            self.sequence += 1;
            command.header.sequence = self.sequence;
        }
        if accepted(Bug::AcceptsRival) && command.order == order::CLAIM {
            self.guard = CommandGuard::new(&self.description, &self.measured.angle_rad);
        }
        let judged = self.guard.offer(&command, now);
        let obeys = judged.is_ok() || accepted(Bug::ObeysWithoutClaim);
        if obeys {
            self.commanded = Some(command);
        }
    }

    /// What the amplifiers follow in place of the guard's set point.
    fn spoilt(&self, setpoint: &Setpoint, period: f64) -> Actuation {
        let mut wanted = *setpoint.actuation();
        let commanded = self.commanded.filter(|command| command.order == order::DRIVE);
        let asked = commanded.map_or([0.0; 32], |command| command.actuation.current_a);
        let is_driven = matches!(setpoint, Setpoint::Drive(_));
        let is_held = self.is_held();
        match (self.bug, setpoint) {
            (Bug::WrongSign, _) => wanted.current_a[1] *= -1.0,
            (Bug::SwappedChannels, _) => wanted.current_a.swap(0, 1),
            (Bug::MilliamperesForAmperes, _) => wanted.current_a = wanted.current_a.map(|value| value / 1e3),
            (Bug::CrossTalk, _) => wanted.current_a[2] += 0.2 * wanted.current_a[0],
            (Bug::NoWatchdog, Setpoint::RampDown(_) | Setpoint::Idle(_)) if is_held => wanted = self.applied,
            (Bug::CutsInsteadOfRamp, Setpoint::RampDown(_)) => wanted.current_a = [0.0; 32],
            (Bug::RampsTooSlowly, Setpoint::RampDown(_) | Setpoint::Idle(_)) => {
                wanted.current_a = self.applied.current_a.map(|value| value * (1.0 - period / 0.2).max(0.0));
            }
            (Bug::NoSlewLimit, _) if is_driven => wanted.current_a = asked,
            (Bug::NoLimits, _) if is_driven && asked[0].abs() > 8.0 => wanted.current_a = asked,
            (Bug::ObeysWithoutClaim, Setpoint::Idle(_)) => wanted.current_a = asked,
            (Bug::CurrentLeaks, _) => wanted.current_a[2] += 0.5,
            (Bug::DegreesForRadians, _) => wanted.angle_rad = wanted.angle_rad.map(f64::to_radians),
            (Bug::SwappedFrames, _) => wanted.angle_rad.swap(0, 1),
            (Bug::FrameTurnsBack, _) => wanted.angle_rad[1] *= -1.0,
            _ => (),
        }
        wanted
    }

    /// True until the holder of authority gives it up.
    fn is_held(&self) -> bool {
        self.commanded.is_some_and(|command| matches!(command.order, order::CLAIM | order::DRIVE))
    }

    fn follow(&mut self, period: f64) {
        // A driver that cuts has amplifiers that discharge their coils at once, and one without limits those
        // that can.
        let is_quick = matches!(self.bug, Bug::CutsInsteadOfRamp | Bug::NoSlewLimit | Bug::NoLimits);
        let share = if is_quick { 1.0 } else { 1.0 - (-period / TIME_CONSTANT_S).exp() };
        for (measured, wanted) in self.measured.current_a.iter_mut().zip(self.applied.current_a) {
            *measured += share * (wanted - *measured);
        }
        self.measured.angle_rad = self.applied.angle_rad;
    }

    fn publish(&mut self, now: Stamp) {
        let mut feedback = CoilFeedback { measured: self.measured, ..CoilFeedback::default() };
        self.guard.report(&mut feedback);
        let header = &mut feedback.header;
        header.sequence = self.cycle + 1;
        header.epoch = self.start.nanoseconds();
        header.schema = magsteer_hal::message::SCHEMA;
        header.source_stamp_ns = now.nanoseconds();
        header.publish_stamp_ns = now.nanoseconds();
        match self.bug {
            Bug::StaleStamps => header.source_stamp_ns = self.start.nanoseconds(),
            Bug::WallClock => {
                header.source_stamp_ns += 1_700_000_000_000_000_000;
                header.publish_stamp_ns += 1_700_000_000_000_000_000;
            }
            Bug::SequenceRepeats => header.sequence = 1 + self.cycle / 2,
            Bug::WrongFingerprint => feedback.description_fingerprint ^= 1,
            Bug::FormerLayout => header.schema -= 1,
            Bug::EchoesNothing => feedback.accepted_sequence = 0,
            Bug::ForgetsDisable if feedback.state == driver_state::DISABLED => {
                feedback.state = driver_state::IDLE;
            }
            Bug::NoWatchdog if self.is_held() => feedback.state = driver_state::DRIVEN,
            _ => (),
        }
        self.end.publish_raw_feedback(feedback, now).expect("published");
        let unit = if self.bug == Bug::PositionsInMillimetres { 1e3 } else { 1.0 };
        let seen = MagnetPose {
            position_m: [0.02 * unit, 0.0, 0.0],
            orientation_xyzw: [0.0, 0.0, 0.0, 1.0],
            valid: 1,
            ..MagnetPose::default()
        };
        let mut pose = PoseMessage { magnet_count: 2, ..PoseMessage::default() };
        pose.magnets[..2].fill(seen);
        let age =
            if self.bug == Bug::PosesTooOld { Duration::from_secs(2) } else { Duration::from_millis(3) };
        pose.header.source_stamp_ns = now.before(age).nanoseconds();
        self.end.publish_pose(pose, now).expect("published");
    }
}

/// Examines the driver with `bug` up to `level`; what was found, and how the rig was left.
fn examined(
    bug: Bug,
    level: Level,
    interrupted: &Arc<AtomicBool>,
    told: impl FnMut(&Finding),
) -> (Vec<Finding>, Ending, [f64; 32]) {
    let root = PrivateRoot::create("mscon").expect("a root");
    let endpoint = root.endpoint("example").expect("an endpoint");
    let stop = AtomicBool::new(false);
    let description = example_description();
    thread::scope(|scope| {
        let driver_at = endpoint.clone();
        let stop = &stop;
        scope.spawn(move || Driver::new(bug, &driver_at).run(stop));
        let tolerances = Tolerances {
            settling: Duration::from_millis(40),
            angle_settling: Duration::from_millis(100),
            ..Tolerances::of(&description)
        };
        let wait = Duration::from_secs(20);
        let opened = RunningRig::open(
            &endpoint,
            description,
            tolerances,
            StatedRates::default(),
            wait,
            Arc::clone(interrupted),
        );
        let mut rig = opened.expect("a driver");
        let findings = examine(&mut rig, level, told);
        let ending = rig.end();
        let left = magsteer_hal::conformance::Rig::heard(&mut rig)
            .and_then(|heard| heard.feedback.last().map(|(feedback, _)| feedback.measured.current_a))
            .unwrap_or([0.0; 32]);
        drop(rig);
        stop.store(true, Ordering::Relaxed);
        (findings, ending, left)
    })
}

/// Examines up to the first broken check and those of the same measurement: the author stops reading there.
fn until_broken(bug: Bug, level: Level) -> Vec<Finding> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    let stop = move |finding: &Finding| {
        if finding.verdict == Verdict::Broken {
            flag.store(true, Ordering::Relaxed);
        }
    };
    examined(bug, level, &interrupted, stop).0
}

fn broken(findings: &[Finding]) -> Vec<String> {
    let broken = findings.iter().filter(|finding| finding.verdict == Verdict::Broken);
    broken.map(|finding| format!("{}: {}", finding.clause.id(), finding.measured)).collect()
}

#[test]
fn right_driver_passes_every_check_and_is_left_without_current() {
    let (findings, ending, left) = examined(Bug::None, Level::DummyLoad, &Arc::default(), |_| ());
    assert_eq!(broken(&findings), Vec::<String>::new());
    let skipped = findings.iter().filter(|finding| finding.verdict == Verdict::NotTried);
    assert_eq!(skipped.count(), 0, "{findings:?}");
    assert_eq!(ending, Ending::AtZero);
    assert!(left.iter().all(|current| current.abs() < 0.16), "{left:?}");
}

/// Goal: the check that is meant for a bug is the first to break, so that its text is what the author reads
/// first.
#[test]
fn every_seeded_bug_is_caught_and_named_by_its_check() {
    let mut missed = Vec::new();
    for group in CASES.chunks(AT_ONCE) {
        thread::scope(|scope| {
            let running: Vec<_> = group
                .iter()
                .map(|(bug, clause)| (bug, clause, scope.spawn(|| until_broken(*bug, clause.level()))))
                .collect();
            for (bug, clause, run) in running {
                let findings = run.join().expect("no panic");
                let broken = broken(&findings);
                println!("{bug:?}: {}", broken.first().map_or("nothing", String::as_str));
                let is_named =
                    broken.first().is_some_and(|first| first.starts_with(&format!("{}:", clause.id())));
                if !is_named {
                    missed.push(format!("{bug:?} is to break {}: {broken:#?}", clause.id()));
                }
            }
        });
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Goal: whoever interrupts the suite while current flows finds the coils without.
#[test]
fn interrupted_suite_leaves_the_coils_without_current() {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    let timer = thread::spawn(move || {
        // Listening and the dry checks take some seconds; currents flow after them. Whenever it comes, the
        // end is the same.
        thread::sleep(Duration::from_millis(3_700));
        flag.store(true, Ordering::Relaxed);
    });
    let (findings, ending, left) = examined(Bug::None, Level::DummyLoad, &interrupted, |_| ());
    timer.join().expect("no panic");
    assert_eq!(ending, Ending::AtZero);
    assert!(left.iter().all(|current| current.abs() < 0.16), "{left:?}");
    assert_eq!(broken(&findings), Vec::<String>::new(), "an interruption is no finding");
}
