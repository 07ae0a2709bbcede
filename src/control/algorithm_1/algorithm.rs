//! The Jacobian gathered problem by problem, over as many cycles and threads as it is given.

use std::sync::Arc;

use magsteer_hal::{HardwareDescription, MAGNETS_MAX};
use nalgebra::Vector3;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use super::config::Algorithm1Config;
use super::problem::{Base, Present, Problem, Rules, moments_body};
use crate::magnetics::CoilArray;
use crate::rod::{HeldOptions, HeldSolution, Manipulator};

/// Tangents of all magnets of one shape.
type Tangents = [Vector3<f64>; MAGNETS_MAX];

/// Present and stepped tangents of a whole Jacobian.
#[derive(Debug)]
struct Turns {
    present: Tangents,
    /// By parameter.
    stepped: Vec<Tangents>,
}

impl Turns {
    fn new(parameters: usize) -> Self {
        let none = [Vector3::zeros(); MAGNETS_MAX];
        Self { present: none, stepped: vec![none; parameters] }
    }
}

/// What one cycle's share of the work came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Progress {
    /// Problems solved, or given up.
    pub problems: u32,
    /// Trial steps of all of them.
    pub iterations: u32,
    /// Integrations from base to tip.
    pub sweeps: u32,
    /// True when one did not converge: its Jacobian is discarded.
    pub failed: bool,
    /// True when a Jacobian was completed.
    pub completed: bool,
}

impl Progress {
    fn add(&mut self, solution: &HeldSolution) {
        self.problems += 1;
        self.iterations += solution.iterations;
        self.sweeps += solution.sweeps;
        self.failed |= !solution.converged();
    }
}

/// Algorithm 1 for one rig.
#[derive(Debug)]
pub struct Algorithm1 {
    rules: Rules,
    base: Base,
    /// As many as a cycle may solve.
    problems: Vec<Problem>,
    per_cycle: usize,
    threads: usize,
    /// Shared by the threads that help; without it the caller solves all problems itself.
    pool: Option<Arc<ThreadPool>>,
    /// Parameter to go on with, and cycles since the Jacobian was begun.
    under_way: Option<(usize, u32)>,
    gathered: Turns,
    complete: Turns,
    age: Option<u32>,
    age_max: u32,
}

impl Algorithm1 {
    /// Algorithm 1 for the rig of `description`, whose statics are those of `manipulator`.
    #[must_use]
    pub fn new(
        config: &Algorithm1Config,
        description: &HardwareDescription,
        manipulator: Manipulator,
    ) -> Self {
        let array = CoilArray::new(description);
        let rules = Rules {
            coils: array.coil_count(),
            frames: array.frame_count(),
            array,
            clamp: description.manipulator.base_position.into(),
            moments_body: moments_body(description),
            manipulator,
            current_step: config.current_step_a,
            angle_step: config.angle_step_deg.to_radians(),
            informed_guess: config.informed_guess,
            held: HeldOptions {
                residual_tolerance: config.residual_tolerance,
                iterations_max: config.iterations_max,
                damping_start: config.damping_start,
                derivative: config.residual_derivative,
            },
        };
        let parameters = rules.parameters();
        let per_cycle = config.problems_per_cycle_max as usize;
        Self {
            base: Base::new(&rules),
            problems: (0..per_cycle.min(parameters)).map(|_| Problem::new(&rules)).collect(),
            per_cycle,
            threads: config.threads as usize,
            pool: None,
            under_way: None,
            gathered: Turns::new(parameters),
            complete: Turns::new(parameters),
            age: None,
            age_max: config.age_max_cycles,
            rules,
        }
    }

    /// Starts the threads that share the problems, each with a stack of `stack_bytes`; none when the configuration asks for one thread.
    ///
    /// Enter the pool once, around the loop (`ThreadPool::install`): the loop then runs in one of its threads, and a cycle
    /// hands problems to the others without allocating. Outside of it a cycle would be handed over whole, at a cost.
    ///
    /// # Errors
    /// When the system refuses a thread.
    pub fn start_workers(
        &mut self,
        stack_bytes: usize,
    ) -> Result<Option<Arc<ThreadPool>>, ThreadPoolBuildError> {
        if self.threads > 1 && self.pool.is_none() {
            let builder = ThreadPoolBuilder::new().num_threads(self.threads).stack_size(stack_bytes);
            let named = builder.thread_name(|index| format!("magsteer-jac-{index}"));
            self.pool = Some(Arc::new(named.build()?));
        }
        Ok(self.pool.clone())
    }

    /// One cycle's share of the work. A new Jacobian is begun at `present`, when there is one and none is under way.
    pub fn advance(&mut self, present: Option<&Present>) -> Progress {
        let mut progress = Progress::default();
        self.age = self.age.map(|age| age.saturating_add(1));
        let (next, age) = match (self.under_way, present) {
            (Some((next, age)), _) => (next, age.saturating_add(1)),
            (None, Some(present)) => {
                progress.add(&self.base.freeze(&self.rules, present));
                self.gathered.present = self.base.shape.tangents;
                (0, 0)
            }
            (None, None) => return progress,
        };
        let parameters = self.rules.parameters();
        let left = self.per_cycle - progress.problems as usize;
        let end = if progress.failed { next } else { parameters.min(next + left) };
        self.solve(next, end, &mut progress);
        self.under_way = (!progress.failed && end < parameters).then_some((end, age));
        progress.completed = !progress.failed && end == parameters;
        if progress.completed {
            std::mem::swap(&mut self.gathered, &mut self.complete);
            self.age = Some(age);
        }
        progress
    }

    /// Solves the problems of parameters `first` to `end`.
    fn solve(&mut self, first: usize, end: usize, progress: &mut Progress) {
        let problems = &mut self.problems[..end - first];
        for (problem, parameter) in problems.iter_mut().zip(first..end) {
            problem.parameter = parameter;
            problem.solution = None;
        }
        let (rules, base) = (&self.rules, &self.base);
        match &self.pool {
            Some(pool) if problems.len() > 1 => pool.install(|| solve_together(problems, rules, base)),
            _ => problems.iter_mut().for_each(|problem| problem.solve(rules, base)),
        }
        for problem in problems {
            if let Some(solution) = &problem.solution {
                progress.add(solution);
            }
            self.gathered.stepped[problem.parameter] = problem.shape.tangents;
        }
    }

    /// Cycles since the shape to which the Jacobian in use belongs; `None` before the first.
    #[must_use]
    pub fn age(&self) -> Option<u32> {
        self.age
    }

    /// True while there is a Jacobian no older than allowed.
    #[must_use]
    pub fn is_fresh(&self) -> bool {
        self.age.is_some_and(|age| age <= self.age_max)
    }

    /// Number of actuation parameters.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.rules.parameters()
    }

    /// Step of a parameter, A or rad.
    #[must_use]
    pub fn step(&self, parameter: usize) -> f64 {
        self.rules.step(parameter)
    }

    /// Tangent of a magnet in the shape to which the Jacobian belongs, unit, world.
    #[must_use]
    pub fn tangent(&self, magnet: usize) -> Vector3<f64> {
        self.complete.present[magnet]
    }

    /// Tangent of a magnet with a parameter stepped, unit, world.
    #[must_use]
    pub fn stepped_tangent(&self, magnet: usize, parameter: usize) -> Vector3<f64> {
        self.complete.stepped[parameter][magnet]
    }
}

/// Halves the problems between this thread and whoever is free.
fn solve_together(problems: &mut [Problem], rules: &Rules, base: &Base) {
    match problems {
        [] => (),
        [problem] => problem.solve(rules, base),
        several => {
            let (left, right) = several.split_at_mut(several.len() / 2);
            rayon::join(|| solve_together(left, rules, base), || solve_together(right, rules, base));
        }
    }
}
