//! Faults with their times.

use std::time::Duration;

use super::checked::Fault;
use super::kinds::Reach;

/// A fault and when it acts, counted from the driver's start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scheduled {
    /// What goes wrong.
    pub fault: Fault,
    /// When it begins.
    pub from: Duration,
    /// How long it lasts; `None` for ever, or until it is cleared.
    pub lasts: Option<Duration>,
}

/// A script of faults. Read from a file by [`FaultPlanConfig`](super::FaultPlanConfig).
#[derive(Debug, Clone, PartialEq)]
pub struct FaultPlan {
    reach: Reach,
    scheduled: Vec<Scheduled>,
}

impl FaultPlan {
    /// No faults by themselves; on request as deep as `reach`.
    #[must_use]
    pub const fn empty(reach: Reach) -> Self {
        Self { reach, scheduled: Vec::new() }
    }

    /// The given faults, which were made for a driver of this `reach`.
    #[must_use]
    pub const fn new(reach: Reach, scheduled: Vec<Scheduled>) -> Self {
        Self { reach, scheduled }
    }

    /// How deep its faults, and those on request, may go.
    #[must_use]
    pub const fn reach(&self) -> Reach {
        self.reach
    }

    /// The faults, in the order of the file.
    #[must_use]
    pub fn scheduled(&self) -> &[Scheduled] {
        &self.scheduled
    }
}
