//! `[plant.real_time]`.

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use super::plant::whole;

/// `[plant.real_time]`: how the driver process keeps pace with the machine's clock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealTimeConfig {
    /// Period of the process's wake-ups, us, 100 to 20000, not under `step_us`.
    pub wake_us: u64,
    /// Most simulated time caught up in one wake-up, ms, 1 to 1000; what lies further back is
    /// counted and left out.
    pub catch_up_max_ms: u64,
    /// Period of true poses published for observers, ms, 1 to 1000.
    pub truth_period_ms: u64,
    /// Priority under `SCHED_FIFO`, asked for where the process may have it: 1 to 99, below the daemon's; 0 for ordinary
    /// scheduling.
    pub priority: u32,
}

impl RealTimeConfig {
    pub(super) fn check(&self, step_us: u64, checks: &mut Checks) {
        let key = "plant.real_time";
        whole(checks, &format!("{key}.wake_us"), self.wake_us, step_us.max(100), 20_000);
        whole(checks, &format!("{key}.catch_up_max_ms"), self.catch_up_max_ms, 1, 1000);
        whole(checks, &format!("{key}.truth_period_ms"), self.truth_period_ms, 1, 1000);
        whole(checks, &format!("{key}.priority"), u64::from(self.priority), 0, 99);
    }
}
