//! Faults between the guard and the amplifiers and motors.
//!
//! What goes out is within the rig's limits on current, slew, angle and speed whatever the faults ask for:
//! each step moves from the former output towards what they want by no more than the limits allow. Two set
//! points pass untouched: [`Setpoint::Disable`] at once, and the zero of [`Setpoint::Idle`], when nobody
//! holds authority, within slew. So a fault may keep a holder of authority from stopping the coils, who must
//! then cut; but it never keeps current in the coils of a rig that nobody commands.

use std::f64::consts::TAU;
use std::time::Duration;

use crate::guard::Setpoint;
use crate::limits::{between, usable_period};
use crate::message::{Actuation, COILS_MAX};
use crate::seeded::Seeded;

use super::checked::{Fault, FaultRefusal};
use super::content::Possible;
use super::history::History;
use super::kinds::{FaultTarget, FaultVerb, Part};
use super::plan::Scheduled;
use super::slots::{Events, Memory, Slots, is_off};

/// How long one wrong value stays before the next: long enough that currents get there.
const GARBAGE_STAYS: Duration = Duration::from_millis(50);

#[derive(Debug, Clone, Copy)]
pub(super) struct SetpointMemory {
    began: Duration,
    /// Output at the fault's begin, or what the fault has made of it since.
    held: Option<Actuation>,
    /// When garbage was drawn.
    drawn: Option<Duration>,
}

impl Memory for SetpointMemory {
    fn at_begin(now: Duration) -> Self {
        Self { began: now, held: None, drawn: None }
    }
}

/// Set points on their way to amplifiers and motors.
#[derive(Debug, Clone)]
pub(super) struct Setpoints {
    pub(super) slots: Slots<SetpointMemory>,
    history: History<Actuation>,
    /// What went out last.
    output: Actuation,
    /// True until the output has come back to the guard's after a fault.
    is_astray: bool,
    random: Seeded,
    pub(super) altered: u64,
}

impl Setpoints {
    pub(super) fn new(scheduled: &[Scheduled], random: Seeded) -> Self {
        let belongs = |fault: &Fault| fault.target() == FaultTarget::Actuators && !fault.befalls_commands();
        Self {
            slots: Slots::new(scheduled, belongs),
            history: History::new(),
            output: Actuation::default(),
            is_astray: false,
            random,
            altered: 0,
        }
    }

    pub(super) fn push(&mut self, scheduled: Scheduled) -> Result<(), FaultRefusal> {
        self.slots.push(scheduled)
    }

    /// What the amplifiers and motors are given in place of `setpoint`, `period_s` after the former call.
    pub(super) fn pass(
        &mut self,
        setpoint: &Setpoint,
        possible: &Possible,
        now: Duration,
        period_s: f64,
        events: &mut Events,
    ) -> Setpoint {
        self.slots.update(now, events);
        let acts = self.slots.active_count() > 0;
        if matches!(setpoint, Setpoint::Disable(_)) || !(acts || self.is_astray) {
            self.output = *setpoint.actuation();
            self.is_astray = false;
            self.history.clear();
            return *setpoint;
        }
        let period = usable_period(period_s);
        let mut wanted = *setpoint.actuation();
        if matches!(setpoint, Setpoint::Idle(_)) {
            self.history.clear();
        } else {
            self.history.push(now, wanted);
            self.spoil(&mut wanted, possible, now, period);
        }
        self.approach(&wanted, possible, period);
        self.is_astray = self.output != *setpoint.actuation();
        self.altered += u64::from(self.is_astray);
        match setpoint {
            Setpoint::Drive(_) => Setpoint::Drive(self.output),
            Setpoint::Idle(_) if self.output.current_a == [0.0; COILS_MAX] => Setpoint::Idle(self.output),
            _ => Setpoint::RampDown(self.output),
        }
    }

    fn spoil(&mut self, wanted: &mut Actuation, possible: &Possible, now: Duration, period: f64) {
        let output = self.output;
        for (fault, memory) in self.slots.active() {
            let held = memory.held.get_or_insert(output);
            let off = Actuation { current_a: [0.0; COILS_MAX], angle_rad: output.angle_rad };
            let spoilt = match fault.verb() {
                FaultVerb::Off => off,
                FaultVerb::Stuck => *held,
                FaultVerb::Intermittent { period, off_fraction } => {
                    if !is_off(now.saturating_sub(memory.began), period, off_fraction) {
                        continue;
                    }
                    off
                }
                FaultVerb::Garbage(_) => {
                    if memory.drawn.is_none_or(|drawn| now.saturating_sub(drawn) >= GARBAGE_STAYS) {
                        memory.drawn = Some(now);
                        *held = any_actuation(possible, &mut self.random);
                    }
                    *held
                }
                FaultVerb::Slow { rate_hz } => {
                    lag(held, wanted, -f64::exp_m1(-TAU * rate_hz * period));
                    *held
                }
                FaultVerb::Delayed { by } => {
                    *now.checked_sub(by).and_then(|then| self.history.at(then)).unwrap_or(held)
                }
                _ => continue,
            };
            take(wanted, &spoilt, fault.part());
        }
    }

    /// Moves the output towards `wanted` within every limit of the rig.
    fn approach(&mut self, wanted: &Actuation, possible: &Possible, period: f64) {
        let limits = &possible.limits;
        let wanted = limits.nearest(wanted, &self.output);
        for coil in 0..limits.coil_count {
            let (from, step) = (self.output.current_a[coil], limits.slew_max[coil] * period);
            self.output.current_a[coil] = between(wanted.current_a[coil], from - step, from + step);
        }
        for frame in 0..limits.frame_count {
            let (from, step) = (self.output.angle_rad[frame], limits.speed_max[frame] * period);
            self.output.angle_rad[frame] = between(wanted.angle_rad[frame], from - step, from + step);
        }
    }
}

/// First-order lag: moves `held` towards `wanted` by a share of the way.
fn lag(held: &mut Actuation, wanted: &Actuation, share: f64) {
    let currents = held.current_a.iter_mut().zip(wanted.current_a);
    for (held, wanted) in currents.chain(held.angle_rad.iter_mut().zip(wanted.angle_rad)) {
        *held += (wanted - *held) * share;
    }
}

/// Takes over one part of `from`, or all of it.
fn take(wanted: &mut Actuation, from: &Actuation, part: Option<Part>) {
    match part {
        Some(Part::Coil(coil)) => wanted.current_a[coil] = from.current_a[coil],
        Some(Part::Frame(frame)) => wanted.angle_rad[frame] = from.angle_rad[frame],
        _ => *wanted = *from,
    }
}

fn any_actuation(possible: &Possible, random: &mut Seeded) -> Actuation {
    let mut actuation = Actuation::default();
    for coil in 0..possible.limits.coil_count {
        actuation.current_a[coil] = possible.current(coil, random);
    }
    for frame in 0..possible.limits.frame_count {
        actuation.angle_rad[frame] = possible.angle(frame, random);
    }
    actuation
}
