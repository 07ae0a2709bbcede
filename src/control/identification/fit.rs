//! The search for the most probable parameters.
//!
//! | symbol | meaning |
//! |---|---|
//! | y | parameters over their prior deviations |
//! | r, J | residuals (measured less modelled) over their noise, and the model's derivatives with y, weighted |
//! | k, w | Huber's bound; weight min(1, k/|r|) of a block |
//! | lambda | Marquardt's damping |
//!
//! ```text
//! minimise  sum rho(|r|) + |y|^2       rho(z) = z^2 below k, 2 k z - k^2 beyond              (f1)
//! step      [J; 1; sqrt(lambda) D] dy = [r; -y; 0] in least squares                          (f2)
//! after     C = (J'J + 1)^-1                                                                 (f3)
//! between   S = C (f sum g g' + 1) C,  g = J'r of one of N samples,  f = N/(N - 1) n/(n - p)    (f4)
//! ```
//! (f4) is the covariance of White (Econometrica 48, 1980) with samples as clusters, n equations and p
//! parameters that they determine, and the prior's share beside. The residual of a tangent is the chord
//! from the modelled to the measured one: as long as their angle to first order, with nothing along the
//! tangent itself, so that it counts as the two rows of the tangent plane; and unlike coordinates of that
//! plane smooth all over, so that a tangent the wrong way round is far off and harmless.
//!
//! (f2) is solved by orthogonal factors, never by J'J: what the data leave to the prior would drown there
//! in rounding.

use magsteer_hal::config::HardwareConfig;
use nalgebra::{DMatrix, DVector, Vector3};

use crate::rod::RodConfig;

use super::IdentifyRequest;
use super::equilibria::{Model, Modelled};
use super::error::IdentifyError;
use super::found::Identified;
use super::noise::{Deviations, Left};
use super::parameters::Parameters;
use super::sample::{Quantity, Sample};

/// Most steps of one descent.
const ITERATIONS_MAX: usize = 100;
/// Damping at the start, and where no step lowers the objective any more.
const DAMPING: [f64; 2] = [1e-3, 1e9];
/// Step, in deviations after the data, below which a descent has ended.
const STEP_DONE: f64 = 1e-6;
/// Step that may be left when rounding keeps the objective from falling.
const STEP_ROUNDING: f64 = 1e-2;
/// Rounds of estimating the noise from medians, then from squares.
const ROUNDS: [usize; 2] = [4, 12];
/// Relative change of the noise below which it is settled.
const NOISE_SETTLED: f64 = 1e-2;
/// Times that samples without an equilibrium are tried again with better parameters.
const RETRIES_MAX: usize = 3;
/// How the search is getting on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Steps so far.
    pub number: usize,
    /// Value of (f1).
    pub objective: f64,
}

/// Estimates the free parameters of the rig of `hardware`, modelled on the mesh of `rod`. `progress` hears
/// of every step.
///
/// # Errors
/// Too few samples, nothing to estimate, samples that the model does not bear.
pub fn identify(
    hardware: &HardwareConfig,
    rod: &RodConfig,
    samples: &[Sample],
    request: &IdentifyRequest,
    mut progress: impl FnMut(&Iteration),
) -> Result<Identified, IdentifyError> {
    let parameters = Parameters::new(hardware, &request.priors, request.stiffness);
    check_count(&parameters, samples)?;
    let mut fit = Fit::new(&parameters, rod, samples, request)?;
    let mut converged;
    let mut retries = 0;
    loop {
        converged = fit.settle(&mut progress)?;
        if retries == RETRIES_MAX || !fit.retry()? {
            break;
        }
        retries += 1;
    }
    fit.report(converged)
}

fn check_count(parameters: &Parameters, samples: &[Sample]) -> Result<(), IdentifyError> {
    let count = parameters.free().len();
    if count == 0 {
        return Err(IdentifyError::NothingFree);
    }
    let equations: usize = samples.iter().map(Sample::equations).sum();
    if equations < 2 * count {
        let each = samples.iter().map(Sample::equations).max().unwrap_or(0).max(2);
        return Err(IdentifyError::TooFew {
            samples: samples.len(),
            equations,
            parameters: count,
            least: (2 * count).div_ceil(each),
        });
    }
    Ok(())
}

/// One block: where it stands, its residual and derivatives, unweighted, in SI.
pub(super) struct Block {
    pub sample: usize,
    pub magnet: usize,
    pub quantity: Quantity,
    pub residual: Vector3<f64>,
    pub derivatives: Vec<Vector3<f64>>,
}

/// A least-squares problem (f2), reduced to its triangle.
pub(super) struct Triangle {
    pub factor: DMatrix<f64>,
    right: DVector<f64>,
    /// Norms of the columns.
    scale: DVector<f64>,
}

/// A search under way.
pub(super) struct Fit<'a> {
    pub parameters: &'a Parameters,
    pub rod: &'a RodConfig,
    pub samples: &'a [Sample],
    pub outlier_sigma: f64,
    pub deviations: Deviations,
    pub values: Vec<f64>,
    /// `None` for samples that are not used.
    pub modelled: Vec<Option<Modelled>>,
    pub nominal: Vec<Option<Modelled>>,
    pub iterations: usize,
}

impl<'a> Fit<'a> {
    fn new(
        parameters: &'a Parameters,
        rod: &'a RodConfig,
        samples: &'a [Sample],
        request: &IdentifyRequest,
    ) -> Result<Self, IdentifyError> {
        let values = vec![0.0; parameters.free().len()];
        let mut model = Model::new(parameters, rod, &values)?;
        let modelled: Vec<Option<Modelled>> = samples.iter().map(|sample| model.at(sample, None)).collect();
        let lost = modelled.iter().filter(|modelled| modelled.is_none()).count();
        if 2 * lost > samples.len() {
            let first = modelled.iter().position(Option::is_none).unwrap_or(0);
            return Err(IdentifyError::NoEquilibrium { lost, samples: samples.len(), first });
        }
        let mut fit = Self {
            parameters,
            rod,
            samples,
            outlier_sigma: request.outlier_sigma,
            deviations: Deviations::new(&request.noise),
            values,
            nominal: modelled.clone(),
            modelled,
            iterations: 0,
        };
        fit.deviations = fit.deviations.by_medians(&fit.left(&fit.blocks(&fit.modelled)));
        Ok(fit)
    }

    /// Descends until the noise is settled too. True when the last descent ended in a minimum.
    fn settle(&mut self, progress: &mut impl FnMut(&Iteration)) -> Result<bool, IdentifyError> {
        let [medians, squares] = ROUNDS;
        let mut converged = false;
        for round in 0..medians + squares {
            converged = self.descend(progress)?;
            let left = self.left(&self.blocks(&self.modelled));
            let new = if round < medians {
                self.deviations.by_medians(&left)
            } else {
                self.deviations.by_squares(&left, self.taken())
            };
            let change = new.change(&self.deviations);
            if round >= medians && change < NOISE_SETTLED {
                break;
            }
            self.deviations = new;
        }
        Ok(converged)
    }

    /// Levenberg and Marquardt at the present noise. True when it ended in a minimum.
    fn descend(&mut self, progress: &mut impl FnMut(&Iteration)) -> Result<bool, IdentifyError> {
        let mut damping = DAMPING[0];
        let mut blocks = self.blocks(&self.modelled);
        for _ in 0..ITERATIONS_MAX {
            let triangle = self.triangle(&blocks, true);
            let full = triangle.step(0.0);
            let left = (&triangle.factor * full).norm();
            if left < STEP_DONE {
                return Ok(true);
            }
            let accepted = loop {
                if damping > DAMPING[1] {
                    break None;
                }
                let step = triangle.step(damping);
                let values: Vec<f64> = (self.values.iter().zip(step.iter()))
                    .zip(self.parameters.deviations())
                    .map(|((value, step), deviation)| value + step * deviation)
                    .collect();
                let modelled = self.model_all(&values)?;
                if self.are_enough(&modelled) {
                    let new = self.blocks(&modelled);
                    let lower = self.objective(&new, &values);
                    // Only what both have is compared: to lose a sample is no gain.
                    blocks.retain(|block| modelled[block.sample].is_some());
                    if lower < self.objective(&blocks, &self.values) {
                        break Some((values, modelled, new, lower));
                    }
                }
                damping = (damping * 8.0).max(1e-6);
            };
            let Some((values, modelled, new, objective)) = accepted else {
                return Ok(left < STEP_ROUNDING);
            };
            (self.values, self.modelled, blocks) = (values, modelled, new);
            damping = if damping < 1e-9 { 0.0 } else { damping / 8.0 };
            self.iterations += 1;
            progress(&Iteration { number: self.iterations, objective });
        }
        let triangle = self.triangle(&blocks, true);
        Ok((&triangle.factor * triangle.step(0.0)).norm() < STEP_ROUNDING)
    }

    /// Equilibria of all samples in use; `None` for one that has none with these values.
    fn model_all(&self, values: &[f64]) -> Result<Vec<Option<Modelled>>, IdentifyError> {
        let mut model = Model::new(self.parameters, self.rod, values)?;
        let all = self.samples.iter().zip(&self.modelled);
        Ok(all.map(|(sample, known)| model.at(sample, Some(known.as_ref()?))).collect())
    }

    /// True unless so many samples have no equilibrium that the model cannot be right.
    fn are_enough(&self, modelled: &[Option<Modelled>]) -> bool {
        2 * modelled.iter().flatten().count() >= self.samples.len()
    }

    /// Tries samples that had no equilibrium with the present values; true when one has one now.
    fn retry(&mut self) -> Result<bool, IdentifyError> {
        if self.modelled.iter().all(Option::is_some) {
            return Ok(false);
        }
        let mut model = Model::new(self.parameters, self.rod, &self.values)?;
        let mut any = false;
        for (sample, modelled) in self.samples.iter().zip(&mut self.modelled) {
            if modelled.is_none() {
                *modelled = model.at(sample, None);
                any |= modelled.is_some();
            }
        }
        Ok(any)
    }

    pub(super) fn blocks(&self, modelled: &[Option<Modelled>]) -> Vec<Block> {
        let mut blocks = Vec::new();
        for (index, (sample, modelled)) in self.samples.iter().zip(modelled).enumerate() {
            let Some(modelled) = modelled else { continue };
            for (magnet, (reading, model)) in sample.magnets.iter().zip(&modelled.magnets).enumerate() {
                let Some(reading) = reading else { continue };
                let mut push = |quantity, residual: Vector3<f64>, by: &[Vector3<f64>]| {
                    blocks.push(Block {
                        sample: index,
                        magnet,
                        quantity,
                        residual,
                        derivatives: by.to_vec(),
                    });
                };
                push(Quantity::Tangent, reading.tangent - model.tangent, &model.tangent_by);
                if let Some(position) = reading.position {
                    push(Quantity::Position, position - model.position, &model.position_by);
                }
            }
        }
        blocks
    }

    /// Norm of a block in noise deviations.
    pub(super) fn sigma(&self, block: &Block) -> f64 {
        block.residual.norm() / self.deviations.values[block.quantity.index()]
    }

    fn left(&self, blocks: &[Block]) -> Vec<Left> {
        let of = |block: &Block| Left {
            quantity: block.quantity,
            norm: block.residual.norm(),
            is_outlier: self.sigma(block) > self.outlier_sigma,
        };
        blocks.iter().map(of).collect()
    }

    /// (f1)
    fn objective(&self, blocks: &[Block], values: &[f64]) -> f64 {
        let k = self.outlier_sigma;
        let huber = |z: f64| if z <= k { z * z } else { 2.0 * k * z - k * k };
        let data: f64 = blocks.iter().map(|block| huber(self.sigma(block))).sum();
        let prior = values.iter().zip(self.parameters.deviations()).map(|(value, s)| (value / s).powi(2));
        data + prior.sum::<f64>()
    }

    /// The rows [J r], weighted; those of one sort, or of both.
    pub(super) fn rows(&self, blocks: &[Block], only: Option<Quantity>) -> DMatrix<f64> {
        let chosen = || blocks.iter().filter(|block| only.is_none_or(|only| only == block.quantity));
        let count = self.values.len();
        let mut matrix = DMatrix::zeros(3 * chosen().count(), count + 1);
        for (index, block) in chosen().enumerate() {
            let weight = (self.outlier_sigma / self.sigma(block)).min(1.0).sqrt();
            let scale = weight / self.deviations.values[block.quantity.index()];
            let columns = block.derivatives.iter().zip(self.parameters.deviations());
            for (column, (by, deviation)) in columns.enumerate() {
                matrix.fixed_view_mut::<3, 1>(3 * index, column).copy_from(&(by * *deviation * scale));
            }
            matrix.fixed_view_mut::<3, 1>(3 * index, count).copy_from(&(block.residual * scale));
        }
        matrix
    }

    /// [J; 1] and [r; -y] as a triangle; without the prior's rows when not asked for.
    pub(super) fn triangle(&self, blocks: &[Block], with_prior: bool) -> Triangle {
        let count = self.values.len();
        let data = self.rows(blocks, None);
        let first = data.nrows();
        let mut stacked = data.resize_vertically(first + count, 0.0);
        if with_prior {
            for (index, (value, deviation)) in
                self.values.iter().zip(self.parameters.deviations()).enumerate()
            {
                stacked[(first + index, index)] = 1.0;
                stacked[(first + index, count)] = -value / deviation;
            }
        }
        let scale = DVector::from_fn(count, |column, _| stacked.column(column).norm());
        // Factoring the right side along with the matrix leaves Q'[r; -y] in the last column.
        let upper = stacked.qr().r();
        Triangle {
            factor: upper.view((0, 0), (count, count)).into_owned(),
            right: upper.view((0, count), (count, 1)).column(0).into_owned(),
            scale,
        }
    }

    /// (f3), in prior deviations.
    pub(super) fn covariance(&self, blocks: &[Block]) -> DMatrix<f64> {
        let count = self.values.len();
        let factor = self.triangle(blocks, true).factor;
        // The prior's rows keep every diagonal entry from vanishing.
        let inverse = factor
            .solve_upper_triangular(&DMatrix::identity(count, count))
            .unwrap_or_else(|| DMatrix::identity(count, count));
        &inverse * inverse.transpose()
    }

    /// Degrees of freedom that the parameters took of tangents and positions: the trace of J C J'.
    pub(super) fn taken(&self) -> [f64; 2] {
        let blocks = self.blocks(&self.modelled);
        let covariance = self.covariance(&blocks);
        [Quantity::Tangent, Quantity::Position].map(|quantity| {
            let rows = self.rows(&blocks, Some(quantity));
            let jacobian = rows.columns(0, self.values.len());
            (jacobian * &covariance).component_mul(&jacobian).sum()
        })
    }
}

impl Triangle {
    /// The step of (f2).
    fn step(&self, damping: f64) -> DVector<f64> {
        let count = self.right.len();
        let mut stacked = DMatrix::zeros(2 * count, count + 1);
        stacked.view_mut((0, 0), (count, count)).copy_from(&self.factor);
        stacked.view_mut((0, count), (count, 1)).copy_from(&self.right);
        for index in 0..count {
            stacked[(count + index, index)] = damping.sqrt() * self.scale[index];
        }
        let upper = stacked.qr().r();
        let factor = upper.view((0, 0), (count, count)).into_owned();
        let right = upper.view((0, count), (count, 1)).column(0).into_owned();
        factor.solve_upper_triangular(&right).unwrap_or_else(|| DVector::zeros(count))
    }
}
