//! Judges how a closed loop answered a step of its targets.
//!
//! Terms: a step has *settled* from the first moment after which every magnet stays within [`SETTLED_WITHIN`]
//! of its target to the step's end, and for [`SETTLED_FOR`] at least. The error of a magnet is the angle
//! between its tangent and its target; its signed error is the difference of their angles from global z, as
//! the paper's figures show it. Mean and RMS are taken over [`JUDGED_OVER`] at the step's end; the same *at
//! the end* over that of it which follows the settling, so that a step that ends as soon as it has settled is
//! not judged by its way there.

use std::collections::VecDeque;

use magsteer_hal::MAGNETS_MAX;
use nalgebra::Vector3;
use serde::Serialize;

use super::target::angle_from_z_deg;
use crate::math::angle_between;

/// Greatest error of a settled magnet, rad.
pub const SETTLED_WITHIN: f64 = 1.0_f64.to_radians();
/// Least time to stay settled, s: about a period of the manipulator's first mode, so that swinging through
/// the target does not count.
pub const SETTLED_FOR: f64 = 0.25;
/// Time at the end of a step over which mean and RMS are taken, s.
pub const JUDGED_OVER: f64 = 1.0;

/// One observation of the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Time since the step began, s.
    pub time: f64,
    /// Tangents of the magnets, world.
    pub tangent: [[f64; 3]; MAGNETS_MAX],
    /// Greatest magnitude of a coil current, A.
    pub current: f64,
}

/// How one step went; the keys of `demo --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepResponse {
    /// Angle of each magnet's target from global z.
    pub target_deg: Vec<f64>,
    /// When the step had settled; `None` when it did not.
    pub settled_s: Option<f64>,
    /// Mean of the signed error of each magnet.
    pub error_mean_deg: Vec<f64>,
    /// RMS of the error of each magnet.
    pub error_rms_deg: Vec<f64>,
    /// Mean of the signed error of each magnet at the end: from the settling on, where that is later.
    pub error_end_mean_deg: Vec<f64>,
    /// RMS of the error of each magnet at the end: from the settling on, where that is later.
    pub error_end_rms_deg: Vec<f64>,
    /// Greatest magnitude of a coil current during the step.
    pub current_max_a: f64,
}

/// Judges a step towards `target` (one unit vector a magnet) from its observations in order of time.
#[must_use]
pub fn judge(target: &[[f64; 3]], observations: &[Observation]) -> StepResponse {
    let mut judge = Judge::new(target);
    for observation in observations {
        judge.take(observation);
    }
    judge.verdict()
}

/// Judges a step while it is under way: keeps the observations of the last [`JUDGED_OVER`] alone.
#[derive(Debug, Clone)]
pub struct Judge {
    target: Vec<[f64; 3]>,
    /// From when on every magnet was near its target.
    settled_since: Option<f64>,
    current_max: f64,
    /// Times of the observations kept.
    times: VecDeque<f64>,
    /// Tangents of the observations kept, magnet by magnet.
    tangents: VecDeque<[f64; 3]>,
}

impl Judge {
    /// Nothing observed yet of a step towards `target`, one unit vector a magnet.
    #[must_use]
    pub fn new(target: &[[f64; 3]]) -> Self {
        Self {
            target: target.to_vec(),
            settled_since: None,
            current_max: 0.0,
            times: VecDeque::new(),
            tangents: VecDeque::new(),
        }
    }

    /// Takes one observation, not earlier than the last.
    pub fn take(&mut self, observation: &Observation) {
        let Observation { time, tangent, current } = observation;
        let magnets = self.target.len();
        let is_within =
            self.target.iter().zip(tangent).all(|(target, tangent)| angle(tangent, target) <= SETTLED_WITHIN);
        self.settled_since = if is_within { self.settled_since.or(Some(*time)) } else { None };
        self.current_max = self.current_max.max(*current);
        self.times.push_back(*time);
        self.tangents.extend(&tangent[..magnets]);
        while self.times.front().is_some_and(|oldest| *oldest < time - JUDGED_OVER) {
            self.times.pop_front();
            self.tangents.drain(..magnets);
        }
    }

    /// True while every magnet is within [`SETTLED_WITHIN`] of its target.
    #[must_use]
    pub fn is_within(&self) -> bool {
        self.settled_since.is_some()
    }

    /// True once every magnet stays at its target for [`SETTLED_FOR`].
    #[must_use]
    pub fn has_settled(&self) -> bool {
        let end = self.times.back().copied().unwrap_or_default();
        self.settled_since.is_some_and(|settled| end - settled >= SETTLED_FOR)
    }

    /// How the step went, were it to end now.
    #[must_use]
    pub fn verdict(&self) -> StepResponse {
        let settled = self.settled_since.filter(|_| self.has_settled());
        let way = settled.map_or(0, |settled| self.times.partition_point(|time| *time < settled));
        let magnets = 0..self.target.len();
        let mean = |magnet, from| self.error_mean_deg(magnet, from);
        let rms = |magnet, from| self.error_rms_deg(magnet, from);
        StepResponse {
            target_deg: self.target.iter().map(degrees_from_z).collect(),
            settled_s: settled,
            error_mean_deg: magnets.clone().map(|magnet| mean(magnet, 0)).collect(),
            error_rms_deg: magnets.clone().map(|magnet| rms(magnet, 0)).collect(),
            error_end_mean_deg: magnets.clone().map(|magnet| mean(magnet, way)).collect(),
            error_end_rms_deg: magnets.map(|magnet| rms(magnet, way)).collect(),
            current_max_a: self.current_max,
        }
    }

    /// Mean of the signed error of a magnet over the observations kept but the first `from`.
    fn error_mean_deg(&self, magnet: usize, from: usize) -> f64 {
        let target = degrees_from_z(&self.target[magnet]);
        let errors = self.kept(magnet).skip(from).map(|tangent| degrees_from_z(tangent) - target);
        errors.sum::<f64>() / (self.times.len() - from) as f64
    }

    /// RMS of the error of a magnet over the observations kept but the first `from`.
    fn error_rms_deg(&self, magnet: usize, from: usize) -> f64 {
        let target = &self.target[magnet];
        let squares = self.kept(magnet).skip(from).map(|tangent| angle(tangent, target).powi(2));
        (squares.sum::<f64>() / (self.times.len() - from) as f64).sqrt().to_degrees()
    }

    /// Farthest that a magnet's tangent was from its last one within the last [`JUDGED_OVER`], rad: what
    /// tells a loop that swings on from one that rests beside its target.
    #[must_use]
    pub fn swing(&self) -> f64 {
        let turned = |magnet: usize| {
            let last = self.kept(magnet).next_back();
            let angles = self.kept(magnet).zip(last.into_iter().cycle());
            angles.fold(0.0_f64, |most, (tangent, last)| most.max(angle(tangent, last)))
        };
        (0..self.target.len()).map(turned).fold(0.0, f64::max)
    }

    /// Tangents of a magnet, the oldest first.
    fn kept(&self, magnet: usize) -> impl DoubleEndedIterator<Item = &[f64; 3]> {
        let magnets = self.target.len();
        (0..self.times.len()).map(move |index| &self.tangents[index * magnets + magnet])
    }
}

fn angle(tangent: &[f64; 3], target: &[f64; 3]) -> f64 {
    angle_between(&Vector3::from(*tangent), &Vector3::from(*target))
}

/// Angle from global z; NaN for no direction.
fn degrees_from_z(direction: &[f64; 3]) -> f64 {
    angle_from_z_deg(direction).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn tangent_at(degrees: f64) -> [f64; 3] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        [sine, 0.0, cosine]
    }

    /// A magnet whose angle is `angle_deg(t)` for four seconds.
    fn observe(angle_deg: impl Fn(f64) -> f64) -> Vec<Observation> {
        (0..400)
            .map(|index| {
                let time = f64::from(index) * 0.01;
                let mut tangent = [[0.0; 3]; MAGNETS_MAX];
                tangent[0] = tangent_at(angle_deg(time));
                Observation { time, tangent, current: time }
            })
            .collect()
    }

    /// Goal: an exponential approach of 20 degrees settles when it is within one degree, and not before.
    #[test]
    fn settles_when_it_stays_within_a_degree() {
        let response = judge(&[tangent_at(90.0)], &observe(|time| 90.0 - 20.0 * (-5.0 * time).exp()));
        let expected = 20f64.ln() / 5.0;
        let settled = response.settled_s.expect("settles");
        assert!((settled - expected).abs() <= 0.01);
        assert!((response.current_max_a - 3.99).abs() < 1e-12);
    }

    /// Goal: an excursion near the end of the step undoes the settling, however long it was within before.
    #[test]
    fn late_excursion_is_not_settled() {
        let response = judge(&[tangent_at(90.0)], &observe(|time| if time > 3.98 { 92.0 } else { 90.0 }));
        assert_eq!(response.settled_s, None);
    }

    /// Goal: a magnet that is only just passing its target when the step ends has not settled.
    #[test]
    fn passing_through_at_the_end_is_not_settled() {
        let response = judge(&[tangent_at(90.0)], &observe(|time| 90.0 + 10.0 * (3.95 - time)));
        assert_eq!(response.settled_s, None);
    }

    /// Goal: a steady error of half a degree is the mean and the RMS.
    #[test]
    fn steady_error_is_mean_and_rms() {
        let response = judge(&[tangent_at(90.0)], &observe(|_| 90.5));
        assert!((response.error_mean_deg[0] - 0.5).abs() < 1e-9);
        assert!((response.error_rms_deg[0] - 0.5).abs() < 1e-9);
        assert_eq!(response.settled_s, Some(0.0));
    }

    /// Goal: a step that ends soon after it settled is judged at its end by what followed, not by its way.
    #[test]
    fn errors_at_the_end_leave_out_the_way_there() {
        let mut judge = Judge::new(&[tangent_at(70.0)]);
        for observation in observe(|time| if time < 0.5 { 30.0 } else { 70.3 }) {
            if judge.has_settled() {
                break;
            }
            judge.take(&observation);
        }
        let response = judge.verdict();
        assert!(response.settled_s.is_some_and(|settled| (settled - 0.5).abs() < 0.011));
        assert!(
            response.error_rms_deg[0] > 20.0 && response.error_mean_deg[0] < -20.0,
            "over the last second"
        );
        assert!((response.error_end_rms_deg[0] - 0.3).abs() < 1e-9, "{:?}", response.error_end_rms_deg);
        assert!((response.error_end_mean_deg[0] - 0.3).abs() < 1e-9, "{:?}", response.error_end_mean_deg);
    }

    /// Goal: where the last second follows the settling, or nothing settled, both errors are the same.
    #[test]
    fn errors_at_the_end_are_those_of_the_last_second_of_a_long_step() {
        for way in
            [|time: f64| 90.0 - 20.0 * (-5.0 * time).exp(), |time: f64| 90.0 + 3.0 * (9.0 * time).sin()]
        {
            let response = judge(&[tangent_at(90.0)], &observe(way));
            assert_eq!(response.error_end_mean_deg, response.error_mean_deg);
            assert_eq!(response.error_end_rms_deg, response.error_rms_deg);
        }
    }

    /// Goal: a magnet that swings about its target by half a degree at the end has a swing of one, whatever
    /// it did before.
    #[test]
    fn swing_is_that_of_the_last_second() {
        let mut judge = Judge::new(&[tangent_at(90.0)]);
        let angle =
            |time: f64| if time < 2.5 { 60.0 } else { 90.0 + 0.5 * (TAU * 2.0 * (time - 3.99)).cos() };
        for observation in observe(angle) {
            judge.take(&observation);
        }
        assert!((judge.swing().to_degrees() - 1.0).abs() < 0.01, "{}", judge.swing().to_degrees());
    }

    /// Goal: nothing observed is nothing settled.
    #[test]
    fn nothing_observed_is_not_settled() {
        assert_eq!(judge(&[tangent_at(90.0)], &[]).settled_s, None);
    }
}
