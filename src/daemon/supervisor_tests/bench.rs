//! A supervisor with an obedient driver, brought into any state.

use std::time::Duration;

use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, state};
use magsteer_hal::scripted::example_description;
use magsteer_hal::{Actuation, MagnetPose, PoseMessage, Stamp};

use crate::control::Verdict;
use crate::daemon::config::{DaemonConfig, Limits, tests::shipped};
use crate::daemon::monitors::Sample;
use crate::daemon::state::{Directive, Request, Verb};
use crate::daemon::supervisor::{Decision, Supervisor};
use crate::daemon::trust::Astray;
use crate::daemon::watch::{DriverView, Observation};

pub(super) const PERIOD: Duration = Duration::from_millis(1);

pub(super) fn limits() -> Limits {
    shipped().limits()
}

pub(super) fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A supervisor with a driver that does what it is told, one period behind.
pub(super) struct Bench {
    pub(super) supervisor: Supervisor,
    pub(super) now: Stamp,
    pub(super) seen: Observation,
    pub(super) next_id: u32,
    /// False freezes the feedback.
    pub(super) driver_alive: bool,
    /// False freezes the echo of commands alone.
    pub(super) echo_alive: bool,
    /// False freezes the poses.
    pub(super) sensor_alive: bool,
    /// True: the driver obeys claims.
    pub(super) driver_obeys: bool,
    /// Current that commands of steering leave in the coils, A.
    pub(super) current: f64,
    /// Angle by which the magnets are seen to turn to and fro from cycle to cycle, rad; 0 leaves the sample without poses.
    pub(super) shake: f64,
    /// False freezes the controller's view of them.
    pub(super) controller_sees: bool,
    /// What was directed so far, without repetitions.
    pub(super) directives: Vec<Directive>,
    cycle_count: u64,
    healthy: Observation,
}

impl Bench {
    pub(super) fn new() -> Self {
        Self::with(&shipped())
    }

    pub(super) fn with(config: &DaemonConfig) -> Self {
        let now = Stamp::from_nanoseconds(1_000_000_000);
        let driver = DriverView {
            stamp: now,
            state: driver_state::IDLE,
            fault: 0,
            epoch: 0,
            echoed: 0,
            life: 40,
            current_max: 0.0,
            over_current: false,
        };
        let seen = Observation {
            now,
            missed: 0,
            pose_stamp: Some(now),
            pose_life: Some(41),
            pose_error: 0.0,
            driver: Some(driver),
            astray: Astray::default(),
            description_mismatch: false,
            model_converged: true,
            field_valid: true,
            margin: 1.0,
            verdict: Verdict::Unchecked,
            request_finite: true,
            write_failed: false,
            trail_ended: false,
            commanded_zero: true,
            sample: Sample { measured: Some(Actuation::default()), ..Sample::default() },
        };
        Self {
            supervisor: Supervisor::new(config, &example_description(), false),
            now,
            seen,
            next_id: 1,
            driver_alive: true,
            echo_alive: true,
            sensor_alive: true,
            driver_obeys: true,
            current: 2.0,
            shake: 0.0,
            controller_sees: true,
            directives: Vec::new(),
            cycle_count: 0,
            healthy: seen,
        }
    }

    pub(super) fn driver(&mut self) -> &mut DriverView {
        self.seen.driver.as_mut().expect("the bench always has one")
    }

    pub(super) fn measured(&mut self) -> &mut Actuation {
        self.seen.sample.measured.as_mut().expect("the bench always has some")
    }

    pub(super) fn cycle(&mut self, verb: Option<Verb>) -> Decision {
        self.now = self.now.after(PERIOD);
        self.seen.now = self.now;
        if self.sensor_alive {
            self.seen.pose_stamp = Some(self.now);
        }
        self.shake_poses();
        if self.driver_alive {
            let (now, echoed) = (self.now, u64::from(self.echo_alive));
            self.driver().stamp = now;
            self.driver().echoed += echoed;
        }
        let id = self.next_id;
        self.next_id += 1;
        let decision = self.supervisor.step(&self.seen, verb.map(|verb| Request { id, verb }));
        self.obey(&decision);
        if self.directives.last() != Some(&decision.directive) {
            self.directives.push(decision.directive);
        }
        decision
    }

    fn shake_poses(&mut self) {
        self.cycle_count += 1;
        if self.shake == 0.0 {
            return;
        }
        let angle = if self.cycle_count.is_multiple_of(2) { self.shake } else { -self.shake };
        let half = 0.5 * angle;
        let magnet = MagnetPose {
            orientation_xyzw: [0.0, half.sin(), 0.0, half.cos()],
            valid: 1,
            ..MagnetPose::default()
        };
        let mut pose = PoseMessage { magnet_count: 2, magnets: [magnet; 8], ..PoseMessage::default() };
        (pose.header.sequence, pose.header.source_stamp_ns) = (self.cycle_count, self.now.nanoseconds());
        self.seen.sample.pose = Some(pose);
        (self.seen.sample.pose_is_fresh, self.seen.sample.pose_interval) = (true, PERIOD);
        if self.controller_sees {
            self.seen.sample.seen_by_controller = [magnet.tangent(); 8];
        }
    }

    /// Everything outside of the supervisor is well again; what the driver does stays.
    pub(super) fn heal(&mut self) {
        let life = self.driver().life;
        let (state, epoch, echoed) = (self.driver().state, self.driver().epoch, self.driver().echoed);
        let current_max = self.driver().current_max;
        self.seen = Observation { commanded_zero: self.seen.commanded_zero, ..self.healthy };
        (self.seen.now, self.seen.pose_stamp) = (self.now, Some(self.now));
        let driver = DriverView { state, epoch, echoed, life, current_max, ..*self.driver() };
        *self.driver() = driver;
        (self.driver_alive, self.echo_alive, self.sensor_alive, self.driver_obeys) = (true, true, true, true);
        self.shake = 0.0;
    }

    pub(super) fn obey(&mut self, decision: &Decision) {
        let steering = matches!(
            decision.directive,
            Directive::Begin | Directive::Follow | Directive::Hold | Directive::Retreat
        );
        self.seen.commanded_zero = !steering;
        if !(self.driver_alive && self.driver_obeys) {
            return;
        }
        let current = self.current;
        let driver = self.driver();
        match decision.directive {
            Directive::Silent => {}
            Directive::Claim => (driver.epoch, driver.state) = (decision.epoch, driver_state::DRIVEN),
            Directive::Release => (driver.state, driver.current_max) = (driver_state::IDLE, 0.0),
            Directive::Disable => (driver.state, driver.current_max) = (driver_state::DISABLED, 0.0),
            Directive::Begin | Directive::Follow | Directive::Hold | Directive::Retreat => {
                driver.current_max = current;
            }
            Directive::Rest | Directive::RampDown => driver.current_max = 0.0,
        }
    }

    pub(super) fn cycles(&mut self, count: u64) -> Decision {
        for _ in 1..count {
            self.cycle(None);
        }
        self.cycle(None)
    }

    /// Cycles until `code` is reached, at most for `patience`.
    pub(super) fn until(&mut self, code: u32, patience: Duration) -> Option<Duration> {
        let begin = self.now;
        while self.now.since(begin) <= patience {
            if self.cycle(None).state == code {
                return Some(self.now.since(begin));
            }
        }
        None
    }

    pub(super) fn ask(&mut self, verb: Verb) -> Result<u32, Cause> {
        let id = self.next_id;
        let mut decision = self.cycle(Some(verb));
        for _ in 0..200 {
            if let Some(answer) = decision.answers.into_iter().flatten().find(|answer| answer.id == id) {
                return answer.refused.map_or(Ok(decision.state), Err);
            }
            decision = self.cycle(None);
        }
        panic!("{verb:?} was never answered");
    }

    pub(super) fn idle() -> Self {
        Self::idle_of(&shipped())
    }

    fn idle_of(config: &DaemonConfig) -> Self {
        let mut bench = Self::with(config);
        assert_eq!(bench.cycle(None).state, state::IDLE);
        bench
    }

    pub(super) fn armed() -> Self {
        Self::armed_of(&shipped())
    }

    fn armed_of(config: &DaemonConfig) -> Self {
        let mut bench = Self::idle_of(config);
        assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED));
        bench
    }

    pub(super) fn active() -> Self {
        Self::active_of(&shipped())
    }

    pub(super) fn active_of(config: &DaemonConfig) -> Self {
        let mut bench = Self::armed_of(config);
        assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
        bench.cycles(5);
        bench
    }

    /// A bench whose supervisor is in the state with this code.
    pub(super) fn in_state(code: u32) -> Self {
        Self::in_state_of(&shipped(), code)
    }

    pub(super) fn in_state_of(config: &DaemonConfig, code: u32) -> Self {
        match code {
            state::BOOT => {
                let mut bench = Self::with(config);
                bench.driver_alive = false;
                bench.now = bench.now.after(ms(1_000));
                bench.cycle(None);
                bench
            }
            state::IDLE => Self::idle_of(config),
            state::ARMED => Self::armed_of(config),
            state::ACTIVE => Self::active_of(config),
            state::HOLDING => {
                let mut bench = Self::active_of(config);
                assert_eq!(bench.ask(Verb::Hold), Ok(state::HOLDING));
                bench
            }
            state::SAFE_STOP => {
                let mut bench = Self::active_of(config);
                // Currents stay up: the ramp does not end by itself during the test.
                bench.driver_obeys = false;
                assert_eq!(bench.ask(Verb::Stop), Ok(state::SAFE_STOP));
                bench
            }
            _ => {
                let mut bench = Self::active_of(config);
                assert_eq!(bench.ask(Verb::EmergencyStop), Ok(state::FAULT));
                bench
            }
        }
    }
}
