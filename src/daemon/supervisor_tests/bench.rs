//! A supervisor with an obedient driver, brought into any state.

use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, state};
use magsteer_hal::scripted::example_description;

use crate::control::Verdict;
use crate::daemon::config::{Limits, tests::shipped};
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
}

impl Bench {
    pub(super) fn new() -> Self {
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
            commanded_zero: true,
        };
        Self {
            supervisor: Supervisor::new(limits(), &example_description(), false),
            now,
            seen,
            next_id: 1,
            driver_alive: true,
            echo_alive: true,
            sensor_alive: true,
            driver_obeys: true,
            current: 2.0,
        }
    }

    pub(super) fn driver(&mut self) -> &mut DriverView {
        self.seen.driver.as_mut().expect("the bench always has one")
    }

    pub(super) fn cycle(&mut self, verb: Option<Verb>) -> Decision {
        self.now = self.now.after(PERIOD);
        self.seen.now = self.now;
        if self.sensor_alive {
            self.seen.pose_stamp = Some(self.now);
        }
        if self.driver_alive {
            let (now, echoed) = (self.now, u64::from(self.echo_alive));
            self.driver().stamp = now;
            self.driver().echoed += echoed;
        }
        let id = self.next_id;
        self.next_id += 1;
        let decision = self.supervisor.step(&self.seen, verb.map(|verb| Request { id, verb }));
        self.obey(&decision);
        decision
    }

    pub(super) fn obey(&mut self, decision: &Decision) {
        let steering = matches!(decision.directive, Directive::Begin | Directive::Follow | Directive::Hold);
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
            Directive::Begin | Directive::Follow | Directive::Hold => driver.current_max = current,
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
        let mut bench = Self::new();
        assert_eq!(bench.cycle(None).state, state::IDLE);
        bench
    }

    pub(super) fn armed() -> Self {
        let mut bench = Self::idle();
        assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED));
        bench
    }

    pub(super) fn active() -> Self {
        let mut bench = Self::armed();
        assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
        bench.cycles(5);
        bench
    }

    /// A bench whose supervisor is in the state with this code.
    pub(super) fn in_state(code: u32) -> Self {
        match code {
            state::BOOT => {
                let mut bench = Self::new();
                bench.driver_alive = false;
                bench.now = bench.now.after(ms(1_000));
                bench.cycle(None);
                bench
            }
            state::IDLE => Self::idle(),
            state::ARMED => Self::armed(),
            state::ACTIVE => Self::active(),
            state::HOLDING => {
                let mut bench = Self::active();
                assert_eq!(bench.ask(Verb::Hold), Ok(state::HOLDING));
                bench
            }
            state::SAFE_STOP => {
                let mut bench = Self::active();
                // Currents stay up: the ramp does not end by itself during the test.
                bench.driver_obeys = false;
                assert_eq!(bench.ask(Verb::Stop), Ok(state::SAFE_STOP));
                bench
            }
            _ => {
                let mut bench = Self::active();
                assert_eq!(bench.ask(Verb::EmergencyStop), Ok(state::FAULT));
                bench
            }
        }
    }
}
