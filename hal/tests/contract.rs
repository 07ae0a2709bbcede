//! The contract of `Hardware`, held against every implementation of this crate.

use std::time::Duration;

use magsteer_hal::channels::{DaemonEnd, DaemonServices, DriverEnd, Endpoint, PrivateRoot};
use magsteer_hal::conformance::{Clause, Rig, Stepped, SteppedRig, Violation, run};
use magsteer_hal::scripted::{EchoHardware, example_description};
use magsteer_hal::{
    AdmittedCommand, CoilFeedback, CommandGuard, Hardware, HardwareDescription, MagnetPose,
    POSE_PARAMETERS_MAX, PoseMessage, Sensed, Setpoint, Stamp, WriteError,
};

const START: Stamp = Stamp::from_nanoseconds(1_000_000_000);
const CYCLE: Duration = Duration::from_millis(1);

fn assert_kept(found: &[Violation]) {
    let lines: Vec<String> = found.iter().map(ToString::to_string).collect();
    assert!(found.is_empty(), "{}", lines.join("\n"));
}

/// The ideal rig under stepped time.
fn echo_rig() -> SteppedRig<EchoHardware> {
    let description = example_description();
    let hardware = EchoHardware::new(&description);
    SteppedRig::new(description, hardware, Duration::ZERO)
}

/// A driver of a few lines on the far side of the channels: guard, ideal amplifiers, a sensor that sees a rod at rest.
struct Driver {
    end: DriverEnd,
    guard: CommandGuard,
}

impl Driver {
    fn step(&mut self, now: Stamp, duration: Duration) -> Setpoint {
        if let Some(command) = self.end.take_command(now) {
            // Refusals are told by feedback.
            let _ = self.guard.offer(&command, now);
        }
        let setpoint = self.guard.setpoint(now, duration.as_secs_f64());
        let mut feedback = CoilFeedback { measured: *setpoint.actuation(), ..CoilFeedback::default() };
        feedback.header.source_stamp_ns = now.nanoseconds();
        self.guard.report(&mut feedback);
        self.end.publish_feedback(feedback, now).expect("published");
        let seen = MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
        let mut pose = PoseMessage { magnet_count: 2, ..PoseMessage::default() };
        pose.magnets[..2].fill(seen);
        pose.header.source_stamp_ns = now.nanoseconds();
        self.end.publish_pose(pose, now).expect("published");
        setpoint
    }
}

/// Both ends over shared memory, in one thread under stepped time.
struct ChannelRig {
    description: HardwareDescription,
    daemon: DaemonEnd,
    driver: Driver,
    now: Stamp,
    _root: PrivateRoot,
}

impl ChannelRig {
    fn new() -> Self {
        let description = example_description();
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let endpoint = Endpoint::new(&description.rig, Some(root.path())).expect("an endpoint");
        let end = DriverEnd::create(&endpoint).expect("a driver");
        let guard = CommandGuard::new(&description, &[0.0; POSE_PARAMETERS_MAX]);
        let services = DaemonServices::open(&endpoint, Duration::from_secs(5)).expect("a driver");
        let daemon = services.into_ports(&description).expect("ports");
        Self { description, daemon, driver: Driver { end, guard }, now: START, _root: root }
    }
}

impl Rig for ChannelRig {
    type H = DaemonEnd;

    fn hardware(&mut self) -> &mut DaemonEnd {
        &mut self.daemon
    }

    fn description(&self) -> &HardwareDescription {
        &self.description
    }

    fn now(&self) -> Stamp {
        self.now
    }

    fn advance(&mut self, duration: Duration) {
        let mut left = duration;
        while !left.is_zero() {
            let step = left.min(CYCLE);
            self.now = self.now.after(step);
            self.driver.step(self.now, step);
            left -= step;
        }
    }

    fn inject_pose(&mut self, message: PoseMessage) -> bool {
        self.driver.end.publish_raw_pose(message, self.now).is_ok()
    }

    fn inject_feedback(&mut self, message: CoilFeedback) -> bool {
        self.driver.end.publish_raw_feedback(message, self.now).is_ok()
    }
}

#[test]
fn echo_hardware_keeps_the_contract() {
    assert_kept(&run(echo_rig));
}

#[test]
fn channels_keep_the_contract() {
    assert_kept(&run(ChannelRig::new));
}

/// A way to break the contract, to show that the suite would notice.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Flaw {
    ForgetsToEcho,
    FollowsAtOnce,
    NeverRampsDown,
    DropsCommands,
    TakesGarbage,
    SendsOldFeedback,
    ReleasesNever,
}

/// The ideal rig behind a flaw.
struct Flawed {
    inner: EchoHardware,
    flaw: Flaw,
    first: Option<CoilFeedback>,
    garbage: Option<PoseMessage>,
    commanded: [f64; 32],
}

impl Hardware for Flawed {
    fn read(&mut self, now: Stamp) -> Sensed {
        let mut sensed = self.inner.read(now);
        let Some(feedback) = &mut sensed.feedback.last else { return sensed };
        match self.flaw {
            Flaw::ForgetsToEcho => feedback.accepted_sequence = 1,
            Flaw::FollowsAtOnce if feedback.state == 1 => {
                feedback.measured.current_a = self.commanded.map(|current| current * 40.0);
            }
            Flaw::NeverRampsDown if feedback.state != 1 => feedback.measured.current_a = self.commanded,
            Flaw::SendsOldFeedback => *feedback = *self.first.get_or_insert(*feedback),
            Flaw::TakesGarbage => sensed.pose.last = self.garbage.take().or(sensed.pose.last),
            _ => (),
        }
        sensed
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        let order = command.order();
        let drop = match self.flaw {
            Flaw::DropsCommands => order == 1,
            Flaw::ReleasesNever => order == 0 || order == 4,
            _ => false,
        };
        if order == 2 {
            self.commanded = command.actuation().current_a;
        }
        if drop { Ok(()) } else { self.inner.write(command, now) }
    }
}

impl Stepped for Flawed {
    fn inject_pose(&mut self, message: PoseMessage) {
        self.garbage = Some(message);
        self.inner.inject_pose(message);
    }

    fn inject_feedback(&mut self, message: CoilFeedback) {
        self.inner.inject_feedback(message);
    }
}

#[test]
fn suite_notices_every_flaw_by_the_clause_it_breaks() {
    let cases = [
        (Flaw::ForgetsToEcho, Clause::ClaimIsEchoed),
        (Flaw::FollowsAtOnce, Clause::CurrentsFollowWithinSlew),
        (Flaw::NeverRampsDown, Clause::LapseRampsDown),
        (Flaw::DropsCommands, Clause::ClaimIsEchoed),
        (Flaw::TakesGarbage, Clause::GarbageIsRefused),
        (Flaw::SendsOldFeedback, Clause::FeedbackArrives),
        (Flaw::ReleasesNever, Clause::DisableLatches),
    ];
    for (flaw, clause) in cases {
        let found = run(|| {
            let description = example_description();
            let inner = EchoHardware::new(&description);
            let hardware = Flawed { inner, flaw, first: None, garbage: None, commanded: [0.0; 32] };
            SteppedRig::new(description, hardware, Duration::ZERO)
        });
        assert!(found.iter().any(|violation| violation.clause == clause), "{flaw:?}: found {found:?}");
    }
}
