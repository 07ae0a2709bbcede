//! What the samples say together. The keys of [`Survey`] are what `magsteer reach --json` prints.

use std::collections::BTreeMap;
use std::path::PathBuf;

use magsteer::control::plan::{Obstacle, Plan, Unreached};
use magsteer::math::statistics::{quantile, wilson_interval};
use serde::Serialize;

use super::sample::Sample;

/// The map in numbers.
#[derive(Debug, Serialize)]
pub struct Survey {
    pub samples: usize,
    /// Of the whole cone.
    pub reached_fraction: f64,
    pub reached_interval: [f64; 2],
    /// From the innermost.
    pub rings: Vec<Share>,
    /// From the narrowest; the last is the whole.
    pub cones: Vec<Share>,
    /// What ended the walk that came closest, of the targets not reached; the most frequent first.
    pub obstacles: Vec<ObstacleCount>,
    /// Of the targets reached: greatest current on the way.
    pub path_current_max_a: Spread,
    /// Least margin of stability on the way.
    pub path_margin_min: Spread,
    /// Of the orientation Jacobian in the currents, at the target.
    pub condition: Spread,
    pub elapsed_s: f64,
    /// Processor time of all threads.
    pub processor_s: f64,
    pub files: Vec<PathBuf>,
}

/// A part of the samples, and how much of what it stands for is reached.
#[derive(Debug, Serialize)]
pub struct Share {
    pub from_deg: f64,
    pub to_deg: f64,
    pub samples: usize,
    pub reached: usize,
    /// By solid angle; `null` without samples.
    pub reached_fraction: Option<f64>,
    /// 95 %.
    pub reached_interval: [f64; 2],
}

#[derive(Debug, Serialize)]
pub struct ObstacleCount {
    pub obstacle: Obstacle,
    pub count: usize,
}

/// Quantiles of the samples, unweighted; `null` of nothing.
#[derive(Debug, Serialize)]
pub struct Spread {
    pub min: Option<f64>,
    pub p50: Option<f64>,
    pub p95: Option<f64>,
    pub max: Option<f64>,
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let at = |level| quantile(&sorted, level);
        Self { min: at(0.0), p50: at(0.5), p95: at(0.95), max: at(1.0) }
    }
}

impl Share {
    fn of<'s>([from, to]: [f64; 2], samples: impl Iterator<Item = (&'s Sample, bool)>) -> Self {
        let (mut count, mut reached) = (0, 0);
        let (mut weight, mut squares, mut weight_reached) = (0.0, 0.0, 0.0);
        for (sample, is_reached) in samples {
            count += 1;
            weight += sample.weight;
            squares += sample.weight * sample.weight;
            if is_reached {
                reached += 1;
                weight_reached += sample.weight;
            }
        }
        let share = (count > 0).then(|| weight_reached / weight);
        // Kish's effective number of samples.
        let trials = if count > 0 { (weight * weight / squares).round() } else { 0.0 };
        let successes = (share.unwrap_or(0.0) * trials).round();
        Self {
            from_deg: from.to_degrees(),
            to_deg: to.to_degrees(),
            samples: count,
            reached,
            reached_fraction: share,
            reached_interval: wilson_interval(successes as u64, trials as u64),
        }
    }

    fn line(&self) -> String {
        let [low, high] = self.reached_interval.map(|share| 100.0 * share);
        let share = self.reached_fraction.map_or("   ?".to_owned(), |share| format!("{:5.1}", 100.0 * share));
        format!(
            "{:>4.0} to {:<4.0} deg{:>6} of {:<6}{share} %   ({low:.1} to {high:.1} %)\n",
            self.from_deg, self.to_deg, self.reached, self.samples
        )
    }
}

impl Survey {
    /// Of samples in rings with these edges, rad, and their plans.
    pub fn of(edges: &[f64], samples: &[Sample], plans: &[Result<Plan, Unreached>]) -> Self {
        let each = || samples.iter().zip(plans).map(|(sample, plan)| (sample, plan.is_ok()));
        let ring = |ring: usize| {
            Share::of([edges[ring], edges[ring + 1]], each().filter(move |(sample, _)| sample.ring == ring))
        };
        let cone =
            |to: usize| Share::of([0.0, edges[to + 1]], each().filter(move |(sample, _)| sample.ring <= to));
        let rings = edges.len() - 1;
        let whole = cone(rings - 1);
        let mut counts = BTreeMap::new();
        for unreached in plans.iter().filter_map(|plan| plan.as_ref().err()) {
            *counts.entry(unreached.closest).or_insert(0_usize) += 1;
        }
        let mut obstacles: Vec<ObstacleCount> =
            counts.into_iter().map(|(obstacle, count)| ObstacleCount { obstacle, count }).collect();
        obstacles.sort_by_key(|counted| std::cmp::Reverse(counted.count));
        let spread =
            |of: fn(&Plan) -> f64| Spread::of(plans.iter().filter_map(|plan| plan.as_ref().ok()).map(of));
        Self {
            samples: samples.len(),
            reached_fraction: whole.reached_fraction.unwrap_or(0.0),
            reached_interval: whole.reached_interval,
            rings: (0..rings).map(ring).collect(),
            cones: (0..rings).map(cone).collect(),
            obstacles,
            path_current_max_a: spread(|plan| plan.walked.current_max),
            path_margin_min: spread(|plan| plan.walked.margin_min),
            condition: spread(|plan| plan.posture.condition),
            elapsed_s: 0.0,
            processor_s: 0.0,
            files: Vec::new(),
        }
    }

    /// For people.
    pub fn text(&self) -> String {
        let mut text =
            "farthest magnet from rest: samples reached, share by solid angle (95 % interval)\n".to_owned();
        text.extend(self.rings.iter().map(Share::line));
        text += "cones\n";
        text.extend(self.cones.iter().map(Share::line));
        for ObstacleCount { obstacle, count } in &self.obstacles {
            text += &format!("not reached, closest walk ended {count} times: {}\n", obstacle.text());
        }
        let number = |value: Option<f64>| value.map_or("?".to_owned(), |value| format!("{value:.2}"));
        let mut row = |name: &str, spread: &Spread, unit: &str| {
            let Spread { min, p50, p95, max } = spread;
            let [min, p50, p95, max] = [min, p50, p95, max].map(|value| number(*value));
            text += &format!("{name:<24}min {min}, p50 {p50}, p95 {p95}, max {max}{unit}\n");
        };
        row("current on the way", &self.path_current_max_a, " A");
        row("margin on the way", &self.path_margin_min, "");
        row("condition", &self.condition, "");
        let each = self.processor_s / self.samples.max(1) as f64;
        text += &format!("{:.1} s, processor time {each:.2} s a target\n", self.elapsed_s);
        text.extend(self.files.iter().map(|file| format!("{}\n", file.display())));
        text
    }
}
