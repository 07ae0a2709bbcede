//! Measured currents and angles against their commands, each coil and frame on its own.
//!
//! | symbol | meaning |
//! |---|---|
//! | c, m | commanded and measured current, A |
//! | a, k | `current_error_max_a`, `current_error_share` |
//! | o, s | `open_current_a`, `open_share` |
//!
//! *Not following*: `|m - c| > a + k |c|`. One band from zero to the limit: a current that nobody asked for shows at
//! c = 0, and one that the supply cannot give shows at the limit.
//!
//! *Open*: `|c| >= o` and `m sign(c) < s |c|`. Found at currents far below the band a, where a broken wire would
//! otherwise be steered with for ever. Commands below o say nothing, and take no evidence away either: a current that
//! crosses zero again and again is judged by the rest.

use std::time::Duration;

use magsteer_hal::{Actuation, COILS_MAX, POSE_PARAMETERS_MAX};

use super::config::MonitorLimits;
use super::evidence::Evidence;

/// The evidence of every coil and frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Following {
    off: [Evidence; COILS_MAX],
    open: [Evidence; COILS_MAX],
    turned: [Evidence; POSE_PARAMETERS_MAX],
}

impl Following {
    /// Takes a cycle of `elapsed`. Entries that a rig does not have are zero in both, which is no sign of anything.
    pub(super) fn take(
        &mut self,
        limits: &MonitorLimits,
        measured: &Actuation,
        commanded: &Actuation,
        elapsed: Duration,
    ) {
        let coils = measured.current_a.iter().zip(&commanded.current_a);
        for ((measured, commanded), (off, open)) in coils.zip(self.off.iter_mut().zip(&mut self.open)) {
            let band = limits.current_error + limits.current_error_share * commanded.abs();
            off.take(Some((measured - commanded).abs() > band), elapsed, limits.current_error_stop);
            let tells = commanded.abs() >= limits.open_current;
            let carried = measured * commanded.signum();
            let is_open = carried < limits.open_share * commanded.abs();
            open.take(tells.then_some(is_open), elapsed, limits.open_stop);
        }
        let frames = measured.angle_rad.iter().zip(&commanded.angle_rad).zip(&mut self.turned);
        for ((measured, commanded), turned) in frames {
            let is_off = (measured - commanded).abs() > limits.angle_error;
            turned.take(Some(is_off), elapsed, limits.angle_error_stop);
        }
    }

    /// True when a current or an angle has been off its command for too long.
    pub(super) fn is_off(&self, limits: &MonitorLimits) -> bool {
        self.off.iter().any(|evidence| evidence.exceeds(limits.current_error_stop))
            || self.turned.iter().any(|evidence| evidence.exceeds(limits.angle_error_stop))
    }

    /// True when a coil that was asked for current has carried none for too long.
    pub(super) fn is_open(&self, limits: &MonitorLimits) -> bool {
        self.open.iter().any(|evidence| evidence.exceeds(limits.open_stop))
    }
}
