//! Passive mode: what monitors would have done.
//!
//! For commissioning, when limits are yet to be found: every monitor judges as ever, and its judgement is told and
//! counted, but the outputs go on. What is no monitor's ([`is_monitor`](super::causes::is_monitor)) acts as ever, and
//! arming and going ask for exactly what they ask for in active mode.

use magsteer_hal::operator::Cause;

/// What the monitors of a passive daemon came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Judgements {
    /// What they would trip for now.
    pub present: Option<Cause>,
    /// The same where it began in this cycle.
    pub begun: Option<Cause>,
    /// The worst since arming or reset.
    pub worst: Option<Cause>,
    /// How often one began since the daemon's start.
    pub count: u64,
}

impl Judgements {
    /// Takes what the monitors judge in this cycle.
    pub(super) fn take(&mut self, judged: Option<Cause>) {
        self.begun = judged.filter(|_| judged != self.present);
        self.present = judged;
        self.worst = self.worst.max(judged);
        self.count += u64::from(self.begun.is_some());
    }

    /// A new episode begins.
    pub(super) fn forget(&mut self) {
        self.worst = None;
    }
}
