//! How many commanded currents and frame angles are at a limit of value or rate.
//!
//! Told from the commands alone, cycle by cycle. What may not move is at no limit, wherever it stands: frames that the
//! configuration holds.

use magsteer::config::Config;
use magsteer::control::FrameUse;
use magsteer::recording::Cycle;

/// Share of a limit from which on it counts as reached.
const REACHED: f64 = 1.0 - 1e-6;

/// Limits of one current or angle.
#[derive(Debug, Clone, Copy)]
struct Limit {
    least: f64,
    most: f64,
    /// Greatest change a second.
    rate: f64,
}

/// The limits of a rig, and what was commanded last.
#[derive(Debug)]
pub struct Limits {
    currents: Vec<Limit>,
    /// None of frames that are held.
    angles: Vec<Limit>,
    /// Number of the last cycle, and its commands: currents, then angles.
    last: Option<(u64, Vec<f64>)>,
}

impl Limits {
    /// Of the rig that a configuration describes.
    pub fn of(config: &Config) -> Self {
        let rig = &config.description;
        let currents = rig.coils.iter().map(|coil| Limit {
            least: -coil.current_max,
            most: coil.current_max,
            rate: coil.slew_max,
        });
        let steers_frames =
            config.control.as_ref().is_some_and(|control| control.frame_angles == FrameUse::Steer);
        let frames = rig.frames.iter().filter(|_| steers_frames);
        let angles = frames.map(|frame| Limit {
            least: frame.angle_min,
            most: frame.angle_max,
            rate: frame.speed_max,
        });
        Self { currents: currents.collect(), angles: angles.collect(), last: None }
    }

    /// How many of a cycle's commands are at a limit. A rate is known of a cycle that follows the one before.
    pub fn reached(&mut self, cycle: &Cycle) -> u32 {
        let limits = self.currents.iter().zip(&cycle.commanded_a);
        let limits: Vec<(&Limit, f64)> = limits
            .chain(self.angles.iter().zip(&cycle.commanded_rad))
            .map(|(limit, value)| (limit, *value))
            .collect();
        let follows = |number: u64| number + 1 + cycle.missed == cycle.number;
        let before = self.last.as_ref().filter(|(number, _)| follows(*number)).map(|(_, values)| values);
        let is_reached = |(index, (limit, value)): &(usize, &(&Limit, f64))| {
            let Limit { least, most, rate } = **limit;
            let half = 0.5 * (most - least);
            let at_end = (value - 0.5 * (most + least)).abs() >= REACHED * half;
            let change =
                before.and_then(|before| before.get(*index)).map_or(0.0, |before| (value - before).abs());
            at_end || (change > 0.0 && change >= REACHED * rate * cycle.period_s)
        };
        let reached = limits.iter().enumerate().filter(is_reached).count() as u32;
        let values = limits.iter().map(|(_, value)| *value).collect();
        self.last = Some((cycle.number, values));
        reached
    }
}

#[cfg(test)]
mod tests {
    use magsteer::recording::Cycle;

    use super::{Limit, Limits};

    fn limits(angles: Vec<Limit>) -> Limits {
        let current = Limit { least: -8.0, most: 8.0, rate: 100.0 };
        Limits { currents: vec![current; 2], angles, last: None }
    }

    fn cycle(number: u64, commanded_a: [f64; 2]) -> Cycle {
        Cycle {
            number,
            period_s: 1e-3,
            commanded_a: commanded_a.to_vec(),
            commanded_rad: vec![0.0],
            ..Cycle::default()
        }
    }

    #[test]
    fn values_and_rates_at_a_limit_are_counted() {
        let mut limits = limits(Vec::new());
        let counted = [[0.0, 0.0], [0.1, 0.05], [0.1, -0.05], [0.1, -0.15]].iter().enumerate();
        let counted: Vec<u32> =
            counted.map(|(number, currents)| limits.reached(&cycle(number as u64, *currents))).collect();
        assert_eq!(counted, [0, 1, 1, 1]);
        assert_eq!(limits.reached(&cycle(9, [-8.0, 8.0])), 2, "at the end, whatever was before");
    }

    #[test]
    fn frames_that_are_held_are_at_no_limit() {
        assert_eq!(limits(Vec::new()).reached(&cycle(0, [1.0, 1.0])), 0);
        let at_its_end = Limit { least: -1.0, most: 0.0, rate: 1.0 };
        assert_eq!(limits(vec![at_its_end]).reached(&cycle(0, [1.0, 1.0])), 1, "one that is steered");
    }
}
