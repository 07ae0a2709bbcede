//! The heat in each coil, from its measured current: what fuses and motor guards do, in one line.
//!
//! | symbol | meaning |
//! |---|---|
//! | q | heat of a coil as a share of what it may hold: 1 at the limit, 0 at the temperature of the room |
//! | I | measured current, A |
//! | I_c | current that it carries for ever, A |
//! | tau | time constant of warming, s |
//!
//! One heat capacity behind one thermal resistance gives `dq/dt = ((I / I_c)^2 - q) / tau`, solved exactly over a
//! cycle with I constant. The limit's resistance is taken for the whole way up, which overrates a cold coil.
//!
//! A daemon that starts knows nothing of the heat of former runs; it begins at zero, and a coil that is still hot is
//! the driver's own thermometer to watch.

use magsteer_hal::COILS_MAX;

use super::config::MonitorLimits;

/// Heat of every coil.
#[derive(Debug, Clone, Default)]
pub(super) struct Heat {
    share: [f64; COILS_MAX],
}

impl Heat {
    /// Takes currents in A that flowed for `elapsed` s. One that is not finite is no current: what follows from it is
    /// not this monitor's business.
    pub(super) fn take(&mut self, limits: &MonitorLimits, current: &[f64; COILS_MAX], elapsed: f64) {
        let approach = -(-elapsed / limits.heat_time_constant).exp_m1();
        for (share, current) in self.share.iter_mut().zip(current).filter(|(_, current)| current.is_finite())
        {
            let end = (current / limits.continuous_current).powi(2);
            *share += (end - *share) * approach;
        }
    }

    /// Heat of the hottest coil; 1 is the limit.
    pub(super) fn greatest(&self) -> f64 {
        self.share.iter().copied().fold(0.0, f64::max)
    }
}
