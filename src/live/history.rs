//! Samples of the last minute, for plots against time.

use std::collections::VecDeque;
use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::operator::StatusMessage;
use serde::Serialize;

use super::rig::Rig;

/// Between two samples: eyes see no more, and a minute stays small.
const PERIOD: Duration = Duration::from_millis(50);
/// How far plots reach back.
const REACH: Duration = Duration::from_secs(60);
/// Samples kept.
const CAPACITY: usize = (REACH.as_millis() / PERIOD.as_millis()) as usize;

/// One angle of one magnet, deg; `None` where there is no direction.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct AngleSample {
    /// As the operator set it.
    pub target: Option<f64>,
    /// Reference that the loop follows.
    pub desired: Option<f64>,
    /// As measured.
    pub measured: Option<f64>,
    /// As the model has it.
    pub predicted: Option<f64>,
}

/// What is plotted of one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sample {
    /// `CLOCK_MONOTONIC` of the cycle, s.
    pub time_s: f64,
    /// One of [`magsteer_hal::operator::state`].
    pub state: u32,
    /// [`super::Angles::count`] entries a magnet, base to tip.
    pub angles_deg: Vec<AngleSample>,
    /// Measured current of each coil.
    pub currents_a: Vec<f64>,
    /// Measured angle of each frame.
    pub frames_deg: Vec<f64>,
    /// Margin of stability.
    pub margin: f64,
    /// How late the latest cycle since the former sample began.
    pub lateness_max_us: f64,
}

/// The last samples, the oldest first.
#[derive(Debug, Clone, Default)]
pub struct History {
    samples: VecDeque<Sample>,
    next: Stamp,
    lateness_max_us: f64,
    taken: u64,
}

impl History {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        Self { samples: VecDeque::with_capacity(CAPACITY), ..Self::default() }
    }

    /// Takes over a status; most make no sample of their own, but none of their lateness is lost.
    pub fn take(&mut self, rig: &Rig, status: &StatusMessage) {
        self.lateness_max_us = self.lateness_max_us.max(status.lateness_max_us);
        let now = status.header.source_stamp();
        if now < self.next {
            return;
        }
        // From the present on: a gap is not made up for.
        self.next = now.after(PERIOD);
        if self.samples.len() == CAPACITY {
            self.samples.pop_front();
        }
        self.samples.push_back(sample(rig, status, std::mem::take(&mut self.lateness_max_us)));
        self.taken += 1;
    }

    /// The samples, the oldest first.
    pub fn samples(&self) -> impl DoubleEndedIterator<Item = &Sample> + ExactSizeIterator {
        self.samples.iter()
    }

    /// Samples taken since the begin, those that made room included.
    #[must_use]
    pub const fn taken(&self) -> u64 {
        self.taken
    }

    /// The samples that came after the first `taken`, as far as they are still there.
    pub fn since(&self, taken: u64) -> impl Iterator<Item = &Sample> {
        let new = usize::try_from(self.taken.saturating_sub(taken)).unwrap_or(usize::MAX);
        self.samples.iter().skip(self.samples.len().saturating_sub(new))
    }
}

fn sample(rig: &Rig, status: &StatusMessage, lateness_max_us: f64) -> Sample {
    let mut angles_deg = Vec::with_capacity(rig.magnets.len() * rig.angles.count());
    for magnet in 0..rig.magnets.len() {
        let of = |directions: &[[f64; 3]]| directions.get(magnet).map(|direction| rig.angles_deg(direction));
        let [target, desired, measured, predicted] = [
            of(&status.target_direction),
            of(&status.desired_direction),
            of(&status.measured_direction),
            of(&status.predicted_direction),
        ];
        for index in 0..rig.angles.count() {
            let of = |angles: &Option<super::rig::AnglesDeg>| {
                angles
                    .and_then(|angles| angles.as_slice().get(index).copied())
                    .map(|angle| rounded(angle, 1e3))
            };
            angles_deg.push(AngleSample {
                target: of(&target),
                desired: of(&desired),
                measured: of(&measured),
                predicted: of(&predicted),
            });
        }
    }
    let currents = status.measured.current_a.iter().take(rig.coils.len());
    let frames = status.measured.angle_rad.iter().take(rig.frames.len());
    Sample {
        time_s: rounded(status.header.source_stamp_ns as f64 * 1e-9, 1e4),
        state: status.state,
        angles_deg,
        currents_a: currents.map(|current| rounded(*current, 1e4)).collect(),
        frames_deg: frames.map(|angle| rounded(angle.to_degrees(), 1e3)).collect(),
        margin: rounded(status.stability_margin, 1e4),
        lateness_max_us: rounded(lateness_max_us, 10.0),
    }
}

/// Digits that nobody sees make messages long.
pub(super) fn rounded(value: f64, per_unit: f64) -> f64 {
    (value * per_unit).round() / per_unit
}
