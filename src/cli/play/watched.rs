//! What is seen of a step while it is played.

use magsteer::control::Directions;
use magsteer::daemon::step_response::{Judge, Observation};
use magsteer_hal::Stamp;
use magsteer_hal::message::PoseMessage;
use magsteer_hal::operator::StatusMessage;

/// What was seen of one step.
pub(super) struct Watched {
    begin: Stamp,
    pub(super) newest: Option<StatusMessage>,
    current: f64,
    pub(super) lateness_max_us: f64,
    pub(super) judge: Judge,
}

impl Watched {
    /// A step towards `target` that begins now.
    pub(super) fn new(begin: Stamp, target: &[[f64; 3]]) -> Self {
        Self { begin, newest: None, current: 0.0, lateness_max_us: 0.0, judge: Judge::new(target) }
    }

    pub(super) fn begin(&self) -> Stamp {
        self.begin
    }

    pub(super) fn take(&mut self, status: &StatusMessage, by_truth: bool) {
        let stamp = status.header.source_stamp();
        // A status of the step before may still have been under way.
        if stamp < self.begin {
            return;
        }
        self.current = status.measured.current_a.iter().fold(0.0, |most, current| most.max(current.abs()));
        self.lateness_max_us = self.lateness_max_us.max(status.lateness_max_us);
        self.newest = Some(*status);
        if !by_truth {
            self.observe(stamp, status.measured_direction);
        }
    }

    pub(super) fn take_truth(&mut self, pose: &PoseMessage) {
        let stamp = pose.header.source_stamp();
        if stamp >= self.begin {
            self.observe(stamp, pose.magnets.map(|magnet| magnet.tangent()));
        }
    }

    fn observe(&mut self, stamp: Stamp, tangent: Directions) {
        let time = stamp.since(self.begin).as_secs_f64();
        self.judge.take(&Observation { time, tangent, current: self.current });
    }
}
