//! Plans many targets, shared among threads.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use anyhow::Context;
use magsteer::control::Directions;
use magsteer::control::plan::{Plan, Planner, Unreached};
use magsteer_hal::POSE_PARAMETERS_MAX;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use rustix::time::{ClockId, clock_gettime};

use crate::cli::counting::Counting;

/// How a target is come to.
#[derive(Debug, Clone, Copy)]
pub enum Search {
    /// From rest, frames free.
    FromRest,
    /// From rest, frames held at these angles, rad.
    Held([f64; POSE_PARAMETERS_MAX]),
    /// From the target before it, from rest to the first.
    OneAfterAnother,
}

/// What became of each target, in their order, and what it cost.
pub struct Found {
    pub plans: Vec<Result<Plan, Unreached>>,
    /// From begin to end, s.
    pub elapsed: f64,
    /// Processor time of all threads, s.
    pub processor: f64,
}

impl Found {
    /// How many were reached.
    pub fn reached(&self) -> usize {
        self.plans.iter().filter(|plan| plan.is_ok()).count()
    }
}

impl Search {
    /// Plans every target, on the threads of the pool that it is called in, with a bar on a terminal.
    pub fn run(self, planner: &Planner, targets: &[Directions]) -> Found {
        let counting = Mutex::new(Counting::new("targets", targets.len()));
        let told = |plan: Result<Plan, Unreached>| {
            counting.lock().unwrap_or_else(PoisonError::into_inner).add(plan.is_ok());
            plan
        };
        let (begin, processor) = (Instant::now(), processor_time());
        let plans = match self {
            Self::FromRest => targets.par_iter().map(|target| told(planner.from_rest(target))).collect(),
            Self::Held(setting) => {
                targets.par_iter().map(|target| told(planner.from_rest_with(&setting, target))).collect()
            }
            Self::OneAfterAnother => one_after_another(planner, targets, told),
        };
        Found { plans, elapsed: begin.elapsed().as_secs_f64(), processor: processor_time() - processor }
    }
}

/// Each target from where the one before it, or the last that was reached, left the rod.
fn one_after_another(
    planner: &Planner,
    targets: &[Directions],
    told: impl Fn(Result<Plan, Unreached>) -> Result<Plan, Unreached>,
) -> Vec<Result<Plan, Unreached>> {
    let mut standing = None;
    let step = |target| {
        let plan = match &standing {
            None => planner.from_rest(target),
            Some(standing) => planner.plan(standing, target),
        };
        if let Ok(plan) = &plan {
            standing = Some(plan.standing());
        }
        told(plan)
    };
    targets.iter().map(step).collect()
}

/// The setting of the grid, rad, with which most targets are reached, with a bar on a terminal.
pub fn best_fixed(planner: &Planner, targets: &[Directions]) -> [f64; POSE_PARAMETERS_MAX] {
    let counting = Mutex::new(Counting::new("targets", targets.len()));
    planner.best_fixed(targets, |reached| {
        counting.lock().unwrap_or_else(PoisonError::into_inner).add(reached);
    })
}

/// Works on so many threads; on all cores when left out.
///
/// # Errors
/// When the threads cannot be started.
pub fn in_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> anyhow::Result<T> {
    // None of its own accord means as many as there are cores.
    let count = usize::from(threads.unwrap_or(0));
    let pool = ThreadPoolBuilder::new().num_threads(count).build().context("cannot start threads")?;
    Ok(pool.install(work))
}

/// Processor time of this process so far, s.
fn processor_time() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
