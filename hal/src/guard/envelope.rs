//! Whether commanded currents, each with its publish stamp, keep a slew limit.
//!
//! | symbol | meaning |
//! |---|---|
//! | c(t) | current of the command published at t, A |
//! | S | slew limit, A/s |
//! | J | jitter allowed between a command's content and its publish stamp, s |
//!
//! Commands keep the limit when `|c(t2) - c(t1)| <= S (t2 - t1 + J)` for *every* pair of them. A check of neighbours
//! alone would grant J anew with every command: at 1 kHz and J = 2 ms, three times the limit for ever. Two numbers
//! a coil suffice for all pairs:
//!
//! `ceiling(t) = min over t1 <= t of c(t1) + S (t - t1)`, and `floor(t) = max over t1 <= t of c(t1) - S (t - t1)`.

use std::time::Duration;

use crate::limits::{Limits, between};
use crate::message::{COILS_MAX, CoilCommand};
use crate::time::Stamp;

/// The range that the next command's currents may lie in.
#[derive(Debug, Clone, Copy)]
pub(super) struct Envelope {
    ceiling: [f64; COILS_MAX],
    floor: [f64; COILS_MAX],
    stamp: Stamp,
}

impl Envelope {
    /// Starts from zero currents published at `stamp`.
    pub(super) const fn at_zero(stamp: Stamp) -> Self {
        Self { ceiling: [0.0; COILS_MAX], floor: [0.0; COILS_MAX], stamp }
    }

    /// Moves on to `command`: returns its currents held within the envelope, and whether they had to be.
    pub(super) fn follow(
        &mut self,
        command: &CoilCommand,
        limits: &Limits,
        jitter: Duration,
    ) -> ([f64; COILS_MAX], bool) {
        // Rounding of the sender's own sums, relative to the greatest current.
        const ROUNDING: f64 = 1e-9;
        let published = Stamp::from_nanoseconds(command.header.publish_stamp_ns);
        let elapsed = published.since(self.stamp).as_secs_f64();
        self.stamp = self.stamp.max(published);
        let mut currents = [0.0; COILS_MAX];
        let mut broken = false;
        for (coil, held_current) in currents.iter_mut().enumerate().take(limits.coil_count) {
            let (slew, limit) = (limits.slew_max[coil], limits.current_max[coil]);
            let tolerance = slew * jitter.as_secs_f64() + limit * ROUNDING;
            let (ceiling, floor) = (self.ceiling[coil] + slew * elapsed, self.floor[coil] - slew * elapsed);
            let commanded = command.actuation.current_a[coil];
            let magnitude = limit * (1.0 + ROUNDING);
            broken |= commanded.abs() > magnitude;
            broken |= commanded > ceiling + tolerance || commanded < floor - tolerance;
            let held = between(between(commanded, -limit, limit), floor - tolerance, ceiling + tolerance);
            self.ceiling[coil] = ceiling.min(held);
            self.floor[coil] = floor.max(held);
            *held_current = held;
        }
        (currents, broken)
    }
}
