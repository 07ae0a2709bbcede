//! The clauses about channels: one coil after the other carries current, one frame after the other turns,
//! and what all of them measure meanwhile tells sign, order, scale and cross talk apart.
//!
//! All this sees is what the driver measures: a sensor wired to a wrong coil together with its amplifier
//! cannot be told from a right one.

use std::time::Duration;

use super::clause::Clause;
use super::finding::{Outcome, found, not_tried};
use super::harness::Rig;
use super::trial::{Trial, cycles, require, require_state};
use crate::message::{Actuation, CoilFeedback, driver_state};

/// How far a frame is turned, unless its range is too small.
const TURN_DEG: f64 = 5.0;
/// Part of a frame's range that it is turned at most.
const TURN_SHARE: f64 = 0.25;
/// Part of the set point by which the measured value may be off, beside the sensor's tolerance.
const SCALE_TOLERANCE: f64 = 0.1;
/// Part of the set point that other channels may show.
const CROSSTALK: f64 = 0.05;
/// Messages of a steady state whose mean is taken.
const MEAN_OF: usize = 10;

/// What all channels measured while one was commanded.
struct Response {
    channel: usize,
    commanded: f64,
    measured: Vec<f64>,
    tolerance: f64,
}

impl Response {
    /// What was sent, and what answered.
    fn told(&self, answering: usize, value: f64, Words { channel, unit, .. }: &Words) -> String {
        format!(
            "{channel} {} was sent {:.4} {unit}, {channel} {answering} measures {value:.4} {unit}",
            self.channel, self.commanded
        )
    }

    /// The channel that answers most, and by how much; `None` when none does.
    fn answering(&self) -> Option<(usize, f64)> {
        let greatest =
            self.measured.iter().copied().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        (greatest.1.abs() > self.tolerance).then_some(greatest)
    }
}

/// Words for what is swept.
struct Words {
    channel: &'static str,
    unit: &'static str,
    /// A factor that is a known mistake, and its name.
    mistake: (f64, &'static str),
}

const CURRENT: Words =
    Words { channel: "coil", unit: "A", mistake: (1000.0, "milliamperes taken for amperes") };
const ANGLE: Words =
    Words { channel: "frame", unit: "rad", mistake: (57.295_779_5, "degrees taken for radians") };

pub(super) fn currents<R: Rig>(rig: &mut R) -> Vec<(Clause, Outcome)> {
    let sweep = sweep_currents(rig);
    vec![
        (Clause::CurrentOrder, judged(&sweep, |sweep| order(sweep, &CURRENT))),
        (Clause::CurrentSign, judged(&sweep, |sweep| sign(sweep, &CURRENT))),
        (Clause::CurrentScale, judged(&sweep, |sweep| scale(sweep, &CURRENT))),
        (Clause::CurrentCrosstalk, judged(&sweep, |sweep| crosstalk(sweep, &CURRENT))),
    ]
}

pub(super) fn angles<R: Rig>(rig: &mut R) -> Vec<(Clause, Outcome)> {
    let sweep = sweep_angles(rig);
    vec![
        (Clause::AngleOrder, judged(&sweep, |sweep| order(sweep, &ANGLE))),
        (Clause::AngleSign, judged(&sweep, |sweep| sign(sweep, &ANGLE))),
        (Clause::AngleScale, judged(&sweep, |sweep| scale(sweep, &ANGLE))),
    ]
}

fn judged(sweep: &Result<Vec<Response>, String>, judge: impl FnOnce(&[Response]) -> Outcome) -> Outcome {
    match sweep {
        Err(broken) => Err(broken.clone()),
        Ok(responses) if responses.is_empty() => not_tried("the rig has none"),
        Ok(responses) => judge(responses),
    }
}

fn sweep_currents<R: Rig>(rig: &mut R) -> Result<Vec<Response>, String> {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    let zero = *trial.gate.previous();
    let effort = trial.effort();
    let mut responses = Vec::new();
    let coils = trial.rig.description().coils.len();
    for coil in 0..coils {
        let mut wanted = zero;
        wanted.current_a[coil] = effort.current_a[coil];
        trial.drive_to(&wanted)?;
        let mean = trial.mean(&wanted, |feedback| feedback.measured.current_a[..coils].to_vec())?;
        responses.push(Response {
            channel: coil,
            commanded: wanted.current_a[coil],
            measured: mean,
            tolerance: trial.rig.current_tolerance(coil),
        });
        trial.drive_to(&zero)?;
    }
    Ok(responses)
}

fn sweep_angles<R: Rig>(rig: &mut R) -> Result<Vec<Response>, String> {
    let mut trial = Trial::new(rig);
    trial.rest()?;
    trial.claim()?;
    let home = *trial.gate.previous();
    let frames = trial.rig.description().frames.clone();
    let mut responses = Vec::new();
    for (index, frame) in frames.iter().enumerate() {
        let turn = TURN_DEG.to_radians().min((frame.angle_max - frame.angle_min) * TURN_SHARE);
        let middle = f64::midpoint(frame.angle_min, frame.angle_max);
        // Towards the middle of its range; upwards from there.
        let turn = if home.angle_rad[index] > middle + turn { -turn } else { turn };
        let mut wanted = home;
        wanted.angle_rad[index] += turn;
        let time = Duration::from_secs_f64(turn.abs() / frame.speed_max) + trial.rig.angle_settling();
        let angles = |feedback: &CoilFeedback| feedback.measured.angle_rad[..frames.len()].to_vec();
        trial.turn_to(&home, index, time)?;
        let before = trial.mean(&home, angles)?;
        trial.turn_to(&wanted, index, time)?;
        let after = trial.mean(&wanted, angles)?;
        let measured = after.iter().zip(&before).map(|(after, before)| after - before).collect();
        let tolerance = trial.rig.angle_tolerance();
        responses.push(Response { channel: index, commanded: turn, measured, tolerance });
        trial.turn_to(&home, index, time)?;
    }
    Ok(responses)
}

impl<R: Rig> Trial<'_, R> {
    /// Drives to `wanted` until its frame is there, or had `time` to be.
    fn turn_to(&mut self, wanted: &Actuation, frame: usize, time: Duration) -> Result<(), String> {
        let mut settled = 0;
        for _ in 0..cycles(time) + MEAN_OF as u128 {
            let feedback = self.drive_on(wanted)?;
            let off = (feedback.measured.angle_rad[frame] - wanted.angle_rad[frame]).abs();
            settled = if off <= self.rig.angle_tolerance() { settled + 1 } else { 0 };
            if settled > MEAN_OF {
                break;
            }
        }
        Ok(())
    }

    /// One driven cycle; without authority what is measured says nothing.
    fn drive_on(&mut self, wanted: &Actuation) -> Result<CoilFeedback, String> {
        let feedback = self.drive(wanted)?;
        require_state(&feedback, driver_state::DRIVEN)?;
        Ok(feedback)
    }

    /// Mean of some messages while `wanted` is commanded.
    fn mean(
        &mut self,
        wanted: &Actuation,
        values: impl Fn(&CoilFeedback) -> Vec<f64>,
    ) -> Result<Vec<f64>, String> {
        let mut sums: Vec<f64> = Vec::new();
        for _ in 0..MEAN_OF {
            let values = values(&self.drive_on(wanted)?);
            sums.resize(values.len(), 0.0);
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += value;
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "a small constant")]
        let count = MEAN_OF as f64;
        Ok(sums.into_iter().map(|sum| sum / count).collect())
    }
}

fn order(sweep: &[Response], words: &Words) -> Outcome {
    let mut told = 0;
    for response in sweep {
        let Some((answering, value)) = response.answering() else { continue };
        told += 1;
        require(answering == response.channel, || response.told(answering, value, words))?;
    }
    if told == 0 {
        return not_tried("nothing answers: see the scale");
    }
    found(format!("{told} of {} {}s answer, each its own command", sweep.len(), words.channel))
}

fn sign(sweep: &[Response], words: &Words) -> Outcome {
    let mut told = 0;
    for response in sweep {
        let Some((answering, value)) = response.answering() else { continue };
        told += 1;
        require(value * response.commanded > 0.0, || response.told(answering, value, words))?;
    }
    if told == 0 {
        return not_tried("nothing answers: see the scale");
    }
    found(format!("as commanded in {told} of {}", sweep.len()))
}

fn scale(sweep: &[Response], words: &Words) -> Outcome {
    let mut worst = 1.0_f64;
    for response in sweep {
        let greatest = response.measured.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let value = greatest.unwrap_or(0.0).abs();
        let commanded = response.commanded.abs();
        let ratio = value / commanded;
        let allowed = response.tolerance + SCALE_TOLERANCE * commanded;
        require((value - commanded).abs() <= allowed, || {
            let (factor, name) = words.mistake;
            let is_near = |wanted: f64| ratio > wanted / 1.5 && ratio < wanted * 1.5;
            let hint =
                if is_near(factor) || is_near(1.0 / factor) { format!(": {name}?") } else { String::new() };
            let Words { channel, unit, .. } = words;
            format!(
                "{channel} {} was sent {commanded:.4} {unit}, {value:.5} {unit} are measured, {ratio:.4} times as \
                 much{hint}",
                response.channel
            )
        })?;
        if (ratio - 1.0).abs() > (worst - 1.0).abs() {
            worst = ratio;
        }
    }
    found(format!("{worst:.4} times the set point at worst"))
}

fn crosstalk(sweep: &[Response], words: &Words) -> Outcome {
    let mut greatest = 0.0_f64;
    for response in sweep {
        let answering = response.answering().map_or(response.channel, |(answering, _)| answering);
        for (other, value) in response.measured.iter().enumerate().filter(|(other, _)| *other != answering) {
            let allowed = response.tolerance.max(CROSSTALK * response.commanded.abs());
            require(value.abs() <= allowed, || {
                let Words { channel, unit, .. } = words;
                format!(
                    "{channel} {} was sent {:.3} {unit}, {channel} {other} measures {value:.4} {unit} too",
                    response.channel, response.commanded
                )
            })?;
            greatest = greatest.max(value.abs() / response.commanded.abs());
        }
    }
    found(format!("{:.2} % of the set point in any other", greatest * 100.0))
}
