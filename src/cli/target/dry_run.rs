//! What the model says of targets before anything moves.

use magsteer::config::{Config, Document};
use magsteer::control::ReferenceTarget;
use magsteer::control::plan::{Obstacle, Rehearsal, Rehearsed};
use magsteer::daemon::target::angle_from_z_deg;
use magsteer::daemon::view;
use magsteer_hal::operator::StatusMessage;
use serde::Serialize;

use crate::cli::exit::{Exit, Failure};
use crate::cli::output;

/// Where a dry run begins.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// At rest, without currents.
    Rest,
    /// Where the rig of a daemon is.
    Present(&'a StatusMessage),
}

impl<'a> Start<'a> {
    /// Where the daemon is that told its status, else at rest.
    pub fn of(status: Option<&'a StatusMessage>) -> Self {
        status.map_or(Self::Rest, Self::Present)
    }
}

/// A walk through targets, as far as it leads.
pub struct DryRun {
    rehearsal: Rehearsal,
    magnets: usize,
    answer: Answer,
    /// A step after which nothing can be said of the next.
    ended: bool,
}

/// The keys are stable.
#[derive(Debug, Serialize)]
struct Answer {
    /// True when every target is reached within the limits on a stable way.
    ok: bool,
    /// `rest` or `present`.
    begins_at: &'static str,
    steps: Vec<StepAnswer>,
}

#[derive(Debug, Serialize)]
struct StepAnswer {
    /// Angle of each magnet's target from z.
    target_deg: Vec<Option<f64>>,
    /// `reached`, what stops it, or `not-looked-at` behind a step that stops it for good.
    verdict: &'static str,
    /// False where the loop turns the frames as it likes, which this walk does not.
    binding: bool,
    /// Share of the way that was walked.
    share: Option<f64>,
    /// Greatest of the magnets, at the end.
    error_deg: Option<f64>,
    /// On the way.
    current_max_a: Option<f64>,
    /// Least on the way: 1 at rest, 0 at a snap-through.
    stability_margin: Option<f64>,
    /// At the end: ratio of the singular values of the orientation Jacobian in the currents.
    condition: Option<f64>,
}

impl DryRun {
    /// Stands where `start` says.
    ///
    /// # Errors
    /// A configuration without `[rod]`, `[control]` or `[control.scout]`; a beginning to which the model does not come.
    pub fn new(document: &Document, config: &Config, start: Start<'_>) -> anyhow::Result<Self> {
        let manipulator = document.require("rod", &config.manipulator)?.clone();
        let control = document.require("control", &config.control)?;
        let scout = document.require("control.scout", &control.scout)?;
        let rig = &config.description;
        let mut rehearsal = Rehearsal::new(scout, control, rig, manipulator);
        let mut begins_at = "rest";
        if let Start::Present(status) = start {
            begins_at = "present";
            rehearsal.set_gains(&status.coil_gain);
            rehearsal.begin_at(&view::equilibrium(status)).map_err(|obstacle| {
                let message = format!("the model does not come to where the rig is: {}", obstacle.text());
                Failure::with(Exit::No, anyhow::anyhow!(message))
            })?;
        }
        let answer = Answer { ok: true, begins_at, steps: Vec::new() };
        Ok(Self { rehearsal, magnets: rig.magnets().count(), answer, ended: false })
    }

    /// Walks to the next target.
    pub fn step(&mut self, target: &ReferenceTarget) {
        let target_deg = target.directions[..self.magnets].iter().map(angle_from_z_deg).collect();
        let binding = self.rehearsal.binds(target);
        let rehearsed = (!self.ended).then(|| self.rehearsal.step(target));
        let obstacle = rehearsed.and_then(|rehearsed| rehearsed.obstacle);
        // Where currents end the loop stays and goes on from there; past a snap-through nothing is known.
        self.ended |= obstacle.is_some_and(|(obstacle, _)| obstacle != Obstacle::OutOfReach);
        self.answer.ok &= rehearsed.is_some() && (obstacle.is_none() || !binding);
        self.answer.steps.push(StepAnswer::new(target_deg, binding, rehearsed.as_ref()));
    }

    /// True when every target is reached within the limits on a stable way.
    pub fn is_clear(&self) -> bool {
        self.answer.ok
    }

    /// Prints what was found; its exit code.
    pub fn tell(&self, json: bool) -> anyhow::Result<Exit> {
        if json {
            output::json(&self.answer)?;
        } else {
            output::result(self.table())?;
        }
        Ok(if self.is_clear() { Exit::Success } else { Exit::No })
    }

    /// The steps for people.
    pub fn table(&self) -> String {
        let mut text = format!(
            "in the model, from {}:\n{:<6}{:<18}{:<28}{:>10}{:>10}{:>10}\n{:<6}{:<18}{:<28}{:>10}{:>10}{:>10}\n",
            if self.answer.begins_at == "rest" { "rest" } else { "where the rig is" },
            "step",
            "target",
            "",
            "error",
            "current",
            "margin",
            "",
            "deg from z",
            "",
            "deg",
            "A",
            "least",
        );
        for (index, step) in self.answer.steps.iter().enumerate() {
            text += &step.line(index);
        }
        if self.answer.steps.iter().any(|step| !step.binding) {
            text += "frames without goals were held here; the loop turns them as its secondary tasks like\n";
        }
        text
    }
}

impl StepAnswer {
    fn new(target_deg: Vec<Option<f64>>, binding: bool, rehearsed: Option<&Rehearsed>) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        let verdict = match rehearsed.map(|rehearsed| rehearsed.obstacle) {
            None => "not-looked-at",
            Some(None) => "reached",
            Some(Some((obstacle, _))) => obstacle.name(),
        };
        Self {
            target_deg,
            verdict,
            binding,
            share: rehearsed.map(|rehearsed| rehearsed.obstacle.map_or(1.0, |(_, share)| share)),
            error_deg: rehearsed.map(|rehearsed| rehearsed.error.to_degrees()),
            current_max_a: rehearsed.map(|rehearsed| rehearsed.current_max),
            stability_margin: rehearsed.and_then(|rehearsed| finite(rehearsed.margin_min)),
            condition: rehearsed.and_then(|rehearsed| finite(rehearsed.posture.condition)),
        }
    }

    fn line(&self, index: usize) -> String {
        let angles =
            self.target_deg.iter().map(|angle| angle.map_or("-".to_owned(), |it| format!("{it:.1}")));
        let number =
            |value: Option<f64>| value.map_or_else(|| format!("{:>10}", "-"), |it| format!("{it:>10.2}"));
        let verdict = match (self.verdict, self.share) {
            ("reached" | "not-looked-at", _) | (_, None) => self.verdict.to_owned(),
            (verdict, Some(share)) => format!("{verdict} after {:.0} %", 100.0 * share),
        };
        format!(
            "{:<6}{:<18}{verdict:<28}{}{}{}\n",
            index + 1,
            angles.collect::<Vec<_>>().join("  "),
            number(self.error_deg),
            number(self.current_max_a),
            number(self.stability_margin),
        )
    }
}
