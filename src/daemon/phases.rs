//! Where in a cycle its time goes.
//!
//! Terms: a *phase* is a stretch of the cycle between two of its steps; together they are the cycle's
//! execution, from its tick until its record is put together, without gap or overlap. Not in it, since the
//! record that carries these times is what is handled: counting them in the histograms, watching for a ramp,
//! and copying the record and the answers into their rings. A cycle that is late for that shows as the next
//! one's lateness. Method: the cycle says when a phase ends, and whoever runs it brings the clock: a
//! [`StopWatch`] in real time, [`Untimed`] under stepped time. So the cycle itself reads no clock. A reading
//! takes some 25 ns.

use std::time::Duration;

use magsteer_hal::Stamp;

/// A part of the cycle whose end the cycle announces; what follows the last of them is the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// From the tick until requests and messages are taken.
    Read,
    /// The controller's step: model, error, allocation.
    Control,
    /// Supervisor and gate.
    Decide,
    /// Handing the command to the transport.
    Write,
}

/// How long each phase took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PhaseTimes {
    /// See [`Phase::Read`].
    pub read: Duration,
    /// See [`Phase::Control`].
    pub control: Duration,
    /// See [`Phase::Decide`].
    pub decide: Duration,
    /// See [`Phase::Write`].
    pub write: Duration,
    /// From the end of the write until the cycle's record is put together; handing it on is in no phase.
    pub record: Duration,
}

impl PhaseTimes {
    /// From the tick to the end of the write: the moment at which the command is sent.
    #[must_use]
    pub fn until_sent(&self) -> Duration {
        self.read + self.control + self.decide + self.write
    }

    /// The cycle's execution time, without the record's handing on.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.until_sent() + self.record
    }
}

/// Told by a cycle when its phases end.
pub trait PhaseWatch {
    /// `phase` ended now, and the next one began.
    fn ended(&mut self, phase: Phase);
}

/// For stepped time, in which a cycle takes none.
#[derive(Debug, Clone, Copy, Default)]
pub struct Untimed;

impl PhaseWatch for Untimed {
    fn ended(&mut self, _: Phase) {}
}

/// Reads the machine's clock at the end of each phase.
#[derive(Debug)]
pub struct StopWatch {
    last: Stamp,
    times: PhaseTimes,
}

impl StopWatch {
    /// A watch for the cycle that began at `tick_now`.
    #[must_use]
    pub fn started(tick_now: Stamp) -> Self {
        Self { last: tick_now, times: PhaseTimes::default() }
    }

    /// The times of the cycle, which ends now.
    #[must_use]
    pub fn finish(mut self) -> PhaseTimes {
        self.times.record = self.lap(Stamp::now());
        self.times
    }

    fn end_at(&mut self, phase: Phase, now: Stamp) {
        let lap = self.lap(now);
        match phase {
            Phase::Read => self.times.read += lap,
            Phase::Control => self.times.control += lap,
            Phase::Decide => self.times.decide += lap,
            Phase::Write => self.times.write += lap,
        }
    }

    fn lap(&mut self, now: Stamp) -> Duration {
        let lap = now.since(self.last);
        self.last = now;
        lap
    }
}

impl PhaseWatch for StopWatch {
    fn ended(&mut self, phase: Phase) {
        self.end_at(phase, Stamp::now());
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use magsteer_hal::Stamp;

    use super::{Phase, PhaseTimes, PhaseWatch, StopWatch};

    const PHASES: [Phase; 4] = [Phase::Read, Phase::Control, Phase::Decide, Phase::Write];

    #[test]
    fn each_phase_is_the_time_since_the_one_before() {
        let at = Stamp::from_nanoseconds;
        let mut watch = StopWatch::started(at(1_000));
        for (phase, end) in PHASES.into_iter().zip([1_010, 1_210, 1_213, 1_250]) {
            watch.end_at(phase, at(end));
        }
        let expected = [10, 200, 3, 37].map(Duration::from_nanos);
        let PhaseTimes { read, control, decide, write, record } = watch.times;
        assert_eq!([read, control, decide, write], expected);
        assert_eq!(record, Duration::ZERO);
        assert_eq!(watch.times.until_sent(), Duration::from_nanos(250));
    }

    /// Goal: nothing of a cycle is lost between phases, and nothing counted twice.
    #[test]
    fn phases_add_up_to_the_time_that_passed() {
        let begin = Stamp::now();
        let mut watch = StopWatch::started(begin);
        for phase in PHASES {
            std::hint::black_box((0..10_000_u64).fold(0, |sum, term| sum ^ std::hint::black_box(term)));
            watch.ended(phase);
        }
        let written = watch.last;
        let before = Stamp::now();
        let times = watch.finish();
        let after = Stamp::now();
        assert_eq!(
            times.until_sent(),
            written.since(begin),
            "to the nanosecond: no clock is read in between"
        );
        assert!(times.total() >= before.since(begin) && times.total() <= after.since(begin));
    }
}
