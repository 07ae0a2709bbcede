//! The latch of authority and the set point that follows from it.

use std::time::Duration;

use super::envelope::Envelope;
use super::refusal::{Refusal, RefusalCounts};
use crate::description::HardwareDescription;
use crate::limits::{Limits, between, usable_period};
use crate::message::{
    Actuation, COILS_MAX, CoilCommand, CoilFeedback, POSE_PARAMETERS_MAX, SCHEMA, driver_state, order,
};
use crate::receive::FUTURE_TOLERANCE;
use crate::send::count;
use crate::time::Stamp;

/// Longest validity that a command is granted, whatever it asks for: no sender can switch the watchdog off.
pub const VALIDITY_MAX: Duration = Duration::from_secs(1);

/// How far a command's content may run ahead of its publish stamp before it counts as a break of the slew limit:
/// two cycles of a 1 kHz loop. It is granted once, not with every command.
pub const SLEW_JITTER: Duration = Duration::from_millis(2);

/// What the amplifiers and frame motors must do now.
///
/// Currents change from one set point to the next by no more than the slew limit allows, except at [`Setpoint::Disable`];
/// angles by no more than the frames' speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Setpoint {
    /// Nobody commands: zero currents, frames hold.
    Idle(Actuation),
    /// Follow the holder of authority.
    Drive(Actuation),
    /// On the way to zero, by order or because authority was lost; frames hold.
    RampDown(Actuation),
    /// Cut the amplifiers; zero currents, frames hold.
    Disable(Actuation),
}

impl Setpoint {
    /// The currents and angles to follow.
    #[must_use]
    pub const fn actuation(&self) -> &Actuation {
        match self {
            Self::Idle(actuation)
            | Self::Drive(actuation)
            | Self::RampDown(actuation)
            | Self::Disable(actuation) => actuation,
        }
    }
}

/// The holder of authority and what it wants.
#[derive(Debug, Clone, Copy)]
struct Holder {
    identity: Identity,
    deadline: Stamp,
    ramping: bool,
    target: Actuation,
    envelope: Envelope,
}

#[derive(Debug, Clone, Copy)]
struct Identity {
    epoch: u64,
    token: u64,
    sequence: u64,
}

impl Identity {
    const fn sent(&self, command: &CoilCommand) -> bool {
        self.epoch == command.header.epoch && self.token == command.token
    }
}

#[derive(Debug, Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "held once per driver, in place: nothing here allocates")]
enum State {
    Idle,
    Driven(Holder),
    RampingDown,
    Disabled,
}

/// Decides which commands a driver obeys, and what its amplifiers do. See the [module](super).
#[derive(Debug, Clone)]
pub struct CommandGuard {
    limits: Limits,
    fingerprint: u64,
    state: State,
    /// Who holds authority, or held it last.
    last: Option<Identity>,
    accepted: (u64, u64),
    /// Exposure of the newest poses that a command was computed from, and when the first such command came.
    answered: (Stamp, Stamp),
    /// Set point in effect.
    applied: Actuation,
    refusals: RefusalCounts,
    limit_breaks: u64,
}

impl CommandGuard {
    /// A guard for `description` with zero currents and the frames holding at `angle_rad`, their measured angles.
    #[must_use]
    pub fn new(description: &HardwareDescription, angle_rad: &[f64; POSE_PARAMETERS_MAX]) -> Self {
        let limits = Limits::new(description);
        let standing = Actuation { angle_rad: *angle_rad, ..Actuation::default() };
        Self {
            applied: limits.nearest(&standing, &Actuation::default()),
            limits,
            fingerprint: description.fingerprint(),
            state: State::Idle,
            last: None,
            accepted: (0, 0),
            answered: (Stamp::default(), Stamp::default()),
            refusals: RefusalCounts::default(),
            limit_breaks: 0,
        }
    }

    /// Judges a received command, and takes it over when it may be obeyed.
    ///
    /// The holder's own command is judged before the lapse of its former one, so that a driver that was stopped for
    /// a while and finds a valid command on waking goes on; the lapse takes effect in [`CommandGuard::setpoint`].
    ///
    /// # Errors
    /// Why the command is not obeyed; it is counted, and nothing else changes.
    pub fn offer(&mut self, command: &CoilCommand, now: Stamp) -> Result<(), Refusal> {
        let judged = self.check(command, now).and_then(|()| match command.order {
            order::CLAIM => self.claim(command, now),
            order::DRIVE => self.follow(command, now, false),
            order::RAMP_DOWN => self.follow(command, now, true),
            order::RELEASE => self.release(command),
            _ => self.disable(command, now),
        });
        match &judged {
            Ok(()) => {
                self.accepted = (command.header.epoch, command.header.sequence);
                let exposed = command.header.source_stamp();
                // Nothing was exposed after its own answer came, whatever the sender writes.
                if exposed > self.answered.0 && exposed <= now {
                    self.answered = (exposed, now);
                }
            }
            Err(refusal) => self.refusals.add(refusal),
        }
        judged
    }

    /// What the amplifiers and motors must do at `now`, `period_s` after the previous call.
    ///
    /// A period that is not finite or negative counts as zero.
    pub fn setpoint(&mut self, now: Stamp, period_s: f64) -> Setpoint {
        self.lapse(now);
        let period = usable_period(period_s);
        match &self.state {
            State::Driven(holder) => {
                let target = holder.target;
                let ramping = holder.ramping;
                self.approach(&target, period);
                if ramping { Setpoint::RampDown(self.applied) } else { Setpoint::Drive(self.applied) }
            }
            State::RampingDown => {
                self.approach(&Actuation { current_a: [0.0; COILS_MAX], ..self.applied }, period);
                if self.is_at_zero() {
                    self.state = State::Idle;
                    Setpoint::Idle(self.applied)
                } else {
                    Setpoint::RampDown(self.applied)
                }
            }
            State::Idle => Setpoint::Idle(self.applied),
            State::Disabled => Setpoint::Disable(self.applied),
        }
    }

    /// Cuts the amplifiers on the driver's own account (over-current, interlock), until the next claim.
    pub fn trip(&mut self) {
        self.applied.current_a = [0.0; COILS_MAX];
        self.state = State::Disabled;
    }

    /// Fills in what feedback says about commands: state, echo, receipt, counts, fingerprint. The header,
    /// `fault` and `measured` are the driver's.
    pub fn report(&self, feedback: &mut CoilFeedback) {
        (feedback.accepted_epoch, feedback.accepted_sequence) = self.accepted;
        feedback.answered_pose_stamp_ns = self.answered.0.nanoseconds();
        feedback.answer_received_stamp_ns = self.answered.1.nanoseconds();
        feedback.description_fingerprint = self.fingerprint;
        feedback.commands_refused = self.refusals.total();
        feedback.limit_breaks = self.limit_breaks;
        feedback.state = self.state();
        feedback.coil_count = count(self.limits.coil_count, COILS_MAX);
        feedback.pose_parameter_count = count(self.limits.frame_count, POSE_PARAMETERS_MAX);
    }

    /// One of [`driver_state`].
    #[must_use]
    pub const fn state(&self) -> u32 {
        match self.state {
            State::Idle => driver_state::IDLE,
            State::Driven(_) => driver_state::DRIVEN,
            State::RampingDown => driver_state::RAMPING_DOWN,
            State::Disabled => driver_state::DISABLED,
        }
    }

    /// Refused commands by reason.
    #[must_use]
    pub const fn refusals(&self) -> &RefusalCounts {
        &self.refusals
    }

    /// Commands obeyed only after a current was held within its magnitude or slew, or an angle within its range.
    #[must_use]
    pub const fn limit_breaks(&self) -> u64 {
        self.limit_breaks
    }

    fn check(&self, command: &CoilCommand, now: Stamp) -> Result<(), Refusal> {
        let header = &command.header;
        if header.schema != SCHEMA {
            return Err(Refusal::Schema { actual: header.schema });
        }
        check_count("coils", self.limits.coil_count, COILS_MAX, command.coil_count)?;
        check_count("frames", self.limits.frame_count, POSE_PARAMETERS_MAX, command.pose_parameter_count)?;
        if command.order > order::DISABLE {
            return Err(Refusal::Order { actual: command.order });
        }
        check_finite("current", &command.actuation.current_a[..self.limits.coil_count])?;
        check_finite("angle", &command.actuation.angle_rad[..self.limits.frame_count])?;
        let ahead = header.publish_stamp_ns.saturating_sub(now.after(FUTURE_TOLERANCE).nanoseconds());
        if ahead > 0 {
            return Err(Refusal::FutureStamp { ahead_ns: header.publish_stamp_ns - now.nanoseconds() });
        }
        // Cutting the amplifiers is never too late.
        if command.order != order::DISABLE && now.nanoseconds() >= header.valid_until_ns {
            return Err(Refusal::Expired { late_ns: now.nanoseconds() - header.valid_until_ns });
        }
        match &self.last {
            Some(last) if last.sent(command) && header.sequence <= last.sequence => {
                Err(Refusal::Sequence { last: last.sequence, actual: header.sequence })
            }
            _ => Ok(()),
        }
    }

    fn claim(&mut self, command: &CoilCommand, now: Stamp) -> Result<(), Refusal> {
        let used = &command.actuation.current_a[..self.limits.coil_count];
        if let Some(coil) = used.iter().position(|current| *current != 0.0) {
            return Err(Refusal::ClaimNotZero { coil: count(coil, COILS_MAX) });
        }
        if self.holder_sent(command) {
            return self.follow(command, now, false);
        }
        self.lapse(now);
        match &self.state {
            State::Driven(holder) => return Err(Refusal::Held { holder: holder.identity.epoch }),
            State::RampingDown => return Err(Refusal::NotAtZero),
            State::Idle | State::Disabled => (),
        }
        let header = &command.header;
        let highest = self.last.map_or(0, |last| last.epoch);
        if header.epoch <= highest {
            return Err(Refusal::Epoch { last: highest, actual: header.epoch });
        }
        let identity = Identity { epoch: header.epoch, token: command.token, sequence: header.sequence };
        self.last = Some(identity);
        self.state = State::Driven(Holder {
            identity,
            deadline: deadline(command, now),
            ramping: false,
            target: self.applied,
            envelope: Envelope::at_zero(Stamp::from_nanoseconds(header.publish_stamp_ns)),
        });
        Ok(())
    }

    /// The holder's next set point; `ramping` when it orders zero.
    fn follow(&mut self, command: &CoilCommand, now: Stamp, ramping: bool) -> Result<(), Refusal> {
        if !self.holder_sent(command) {
            self.lapse(now);
        }
        let held_angles = self.applied.angle_rad;
        let State::Driven(holder) = &mut self.state else {
            return Err(Refusal::NoAuthority);
        };
        if !holder.identity.sent(command) {
            return Err(Refusal::Held { holder: holder.identity.epoch });
        }
        holder.identity.sequence = command.header.sequence;
        self.last = Some(holder.identity);
        holder.deadline = deadline(command, now);
        holder.ramping = ramping;
        let (currents, mut broken) = holder.envelope.follow(command, &self.limits, SLEW_JITTER);
        let wanted = Actuation { current_a: currents, angle_rad: command.actuation.angle_rad };
        holder.target = self.limits.nearest(&wanted, &wanted);
        let frames = ..self.limits.frame_count;
        broken |= holder.target.angle_rad[frames] != command.actuation.angle_rad[frames];
        if ramping {
            // Where to is fixed by the order itself; its content cannot break a limit.
            holder.target = Actuation { current_a: [0.0; COILS_MAX], angle_rad: held_angles };
        } else if command.order == order::CLAIM {
            holder.target.angle_rad = held_angles;
        }
        self.limit_breaks += u64::from(broken && !ramping);
        Ok(())
    }

    fn release(&mut self, command: &CoilCommand) -> Result<(), Refusal> {
        match &self.state {
            State::Driven(holder) if !holder.identity.sent(command) => {
                Err(Refusal::Held { holder: holder.identity.epoch })
            }
            State::Driven(_) => {
                self.remember(command);
                self.leave();
                Ok(())
            }
            // Repeated by its last holder: it has what it asks for.
            _ if self.last.is_some_and(|last| last.sent(command)) => {
                self.remember(command);
                Ok(())
            }
            _ => Err(Refusal::NoAuthority),
        }
    }

    /// Cuts at once. Obeyed from the holder; while nobody holds authority also from its last holder and from any
    /// later epoch, since it can only take current away.
    fn disable(&mut self, command: &CoilCommand, now: Stamp) -> Result<(), Refusal> {
        if !self.holder_sent(command) {
            self.lapse(now);
            if let State::Driven(holder) = &self.state {
                return Err(Refusal::Held { holder: holder.identity.epoch });
            }
        }
        match &self.last {
            Some(last) if last.sent(command) => self.remember(command),
            Some(last) if command.header.epoch <= last.epoch => {
                return Err(Refusal::Epoch { last: last.epoch, actual: command.header.epoch });
            }
            _ => (),
        }
        self.trip();
        Ok(())
    }

    fn holder_sent(&self, command: &CoilCommand) -> bool {
        matches!(&self.state, State::Driven(holder) if holder.identity.sent(command))
    }

    const fn remember(&mut self, command: &CoilCommand) {
        if let Some(last) = &mut self.last {
            last.sequence = command.header.sequence;
        }
    }

    /// Takes authority from a holder whose validity ran out.
    fn lapse(&mut self, now: Stamp) {
        if matches!(&self.state, State::Driven(holder) if now >= holder.deadline) {
            self.leave();
        }
    }

    fn leave(&mut self) {
        self.state = if self.is_at_zero() { State::Idle } else { State::RampingDown };
    }

    fn is_at_zero(&self) -> bool {
        self.applied.current_a.iter().all(|current| *current == 0.0)
    }

    /// Moves the set point in effect towards `target` within slew and speed.
    fn approach(&mut self, target: &Actuation, period: f64) {
        for coil in 0..self.limits.coil_count {
            let (from, step) = (self.applied.current_a[coil], self.limits.slew_max[coil] * period);
            self.applied.current_a[coil] = between(target.current_a[coil], from - step, from + step);
        }
        for frame in 0..self.limits.frame_count {
            let (from, step) = (self.applied.angle_rad[frame], self.limits.speed_max[frame] * period);
            self.applied.angle_rad[frame] = between(target.angle_rad[frame], from - step, from + step);
        }
    }
}

fn deadline(command: &CoilCommand, now: Stamp) -> Stamp {
    Stamp::from_nanoseconds(command.header.valid_until_ns).min(now.after(VALIDITY_MAX))
}

fn check_count(what: &'static str, used: usize, capacity: usize, actual: u32) -> Result<(), Refusal> {
    let expected = count(used, capacity);
    if actual == expected { Ok(()) } else { Err(Refusal::Count { what, expected, actual }) }
}

fn check_finite(what: &'static str, values: &[f64]) -> Result<(), Refusal> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(Refusal::NotFinite { what, index: count(index, COILS_MAX) }),
        None => Ok(()),
    }
}
