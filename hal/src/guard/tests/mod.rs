//! The guard in every state against every kind of command, and what its set points do.

mod limits;
mod setpoints;
mod table;

use std::time::Duration;

use super::CommandGuard;
use crate::message::{Actuation, CoilCommand, Header, POSE_PARAMETERS_MAX, SCHEMA, driver_state, order};
use crate::scripted::example_description;
use crate::time::Stamp;

const MILLISECOND: Duration = Duration::from_millis(1);
const VALIDITY: Duration = Duration::from_millis(100);
const PERIOD: f64 = 1e-3;

/// Somebody who sends commands.
#[derive(Debug, Clone, Copy)]
struct Sender {
    epoch: u64,
    token: u64,
}

const HOLDER: Sender = Sender { epoch: 5, token: 7 };

/// A guard with its clock and the sequence of its commands.
struct Bench {
    guard: CommandGuard,
    now: Stamp,
    sequence: u64,
}

impl Bench {
    fn new() -> Self {
        let guard = CommandGuard::new(&example_description(), &[0.0; POSE_PARAMETERS_MAX]);
        Self { guard, now: Stamp::from_nanoseconds(1_000_000_000), sequence: 0 }
    }

    /// A sound command of `sender`, sent now, of the next sequence.
    fn command(&mut self, sender: Sender, order: u32, currents: [f64; 3]) -> CoilCommand {
        self.sequence += 1;
        let now = self.now.nanoseconds();
        let mut command = CoilCommand {
            header: Header {
                sequence: self.sequence,
                source_stamp_ns: now,
                publish_stamp_ns: now,
                epoch: sender.epoch,
                schema: SCHEMA,
                flags: 0,
                valid_until_ns: self.now.after(VALIDITY).nanoseconds(),
            },
            token: sender.token,
            order,
            coil_count: 3,
            pose_parameter_count: 2,
            ..CoilCommand::default()
        };
        command.actuation.current_a[..3].copy_from_slice(&currents);
        command
    }

    fn send(&mut self, sender: Sender, order: u32, currents: [f64; 3]) -> Result<(), super::Refusal> {
        let command = self.command(sender, order, currents);
        self.guard.offer(&command, self.now)
    }

    /// One millisecond of the driver without a command.
    fn step(&mut self) -> super::Setpoint {
        self.now = self.now.after(MILLISECOND);
        self.guard.setpoint(self.now, PERIOD)
    }

    fn step_for(&mut self, milliseconds: u32) -> super::Setpoint {
        (0..milliseconds).map(|_| self.step()).last().expect("at least one step")
    }

    /// Claims, and drives the first coil to `current` within its slew.
    fn drive_to(&mut self, current: f64) {
        self.send(HOLDER, order::CLAIM, [0.0; 3]).expect("free");
        let mut reached = 0.0_f64;
        while reached != current {
            self.step();
            reached += (current - reached).clamp(-0.2, 0.2);
            self.send(HOLDER, order::DRIVE, [reached, 0.0, 0.0]).expect("within limits");
        }
        assert_eq!(self.step().actuation().current_a[0], current);
        assert_eq!(self.guard.state(), driver_state::DRIVEN);
        assert_eq!(self.guard.limit_breaks(), 0);
    }
}

fn currents(values: [f64; 3]) -> Actuation {
    let mut actuation = Actuation::default();
    actuation.current_a[..3].copy_from_slice(&values);
    actuation
}
