//! What a search ended with, put together: estimates with their deviations, outliers, what the data left
//! open.
//!
//! Symbols and (f1) to (f4) are those of `fit`.

use nalgebra::{DMatrix, DVector};

use crate::math::angle_between;

use super::equilibria::Modelled;
use super::error::IdentifyError;
use super::fit::{Block, Fit};
use super::found::{Estimate, Identified, Outlier, Rms, Undetermined};
use super::sample::Quantity;

/// Deviation after the data over that before, above which a direction is left to the prior.
const RATIO_UNDETERMINED: f64 = 0.5;
/// Least share of a parameter in a direction that is worth naming.
const SHARE_NAMED: f64 = 0.2;

impl Fit<'_> {
    /// Everything that was found.
    pub(super) fn report(&self, converged: bool) -> Result<Identified, IdentifyError> {
        let blocks = self.blocks(&self.modelled);
        let scaled = self.covariance(&blocks);
        let deviations = self.parameters.deviations();
        let between = self.covariance_between_samples(&blocks, &scaled);
        let estimates = (0..self.values.len()).map(|index| Estimate {
            parameter: self.parameters.free()[index],
            name: self.parameters.names()[index].clone(),
            value: self.values[index],
            deviation: scaled[(index, index)].sqrt() * deviations[index],
            deviation_between_samples: between[(index, index)].sqrt() * deviations[index],
            prior_deviation: deviations[index],
        });
        let covariance = DMatrix::from_fn(scaled.nrows(), scaled.ncols(), |row, column| {
            scaled[(row, column)] * deviations[row] * deviations[column]
        });
        let believed: Vec<&Block> =
            blocks.iter().filter(|block| self.sigma(block) <= self.outlier_sigma).collect();
        let weighted = |block: &Block| {
            let z = self.sigma(block);
            z * z * (self.outlier_sigma / z).min(1.0)
        };
        let lost = self.modelled.iter().enumerate().filter(|(_, modelled)| modelled.is_none());
        Ok(Identified {
            estimates: estimates.collect(),
            covariance,
            hardware: self.parameters.applied(&self.values),
            converged,
            iterations: self.iterations,
            noise: self.deviations.values,
            chi_square: blocks.iter().map(weighted).sum(),
            degrees_of_freedom: equations(&blocks) - self.taken().iter().sum::<f64>(),
            rms_before: self.rms(&believed, &self.nominal),
            rms_after: self.rms(&believed, &self.modelled),
            outliers: self.outliers(&blocks),
            lost: lost.map(|(sample, _)| sample).collect(),
            undetermined: self.undetermined(&blocks),
        })
    }

    fn outliers(&self, blocks: &[Block]) -> Vec<Outlier> {
        let of = |block: &Block| Outlier {
            sample: block.sample,
            magnet: block.magnet,
            quantity: block.quantity,
            sigma: self.sigma(block),
        };
        let mut outliers: Vec<Outlier> =
            blocks.iter().map(of).filter(|outlier| outlier.sigma > self.outlier_sigma).collect();
        outliers.sort_by(|one, other| other.sigma.total_cmp(&one.sigma));
        outliers
    }

    /// Distances of model and measurement where both are known.
    fn rms(&self, blocks: &[&Block], modelled: &[Option<Modelled>]) -> Rms {
        let of = |quantity: Quantity| {
            let chosen = blocks.iter().filter(|block| block.quantity == quantity);
            let squares: Vec<f64> = chosen
                .filter_map(|block| {
                    let model = &modelled[block.sample].as_ref()?.magnets[block.magnet];
                    let reading = self.samples[block.sample].magnets[block.magnet]?;
                    let distance = match quantity {
                        Quantity::Tangent => angle_between(&reading.tangent, &model.tangent),
                        Quantity::Position => (reading.position? - model.position).norm(),
                    };
                    Some(distance * distance)
                })
                .collect();
            (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
        };
        Rms { angle: of(Quantity::Tangent), distance: of(Quantity::Position) }
    }

    /// Directions in which the data say little: the right singular vectors of J with small singular values
    /// s, along which (f3) leaves `1 / sqrt(1 + s^2)` of the prior's deviation.
    fn undetermined(&self, blocks: &[Block]) -> Vec<Undetermined> {
        let svd = self.triangle(blocks, false).factor.svd(false, true);
        let Some(right) = svd.v_t else { return Vec::new() };
        let mut found: Vec<Undetermined> = svd
            .singular_values
            .iter()
            .enumerate()
            .map(|(index, value)| (index, 1.0 / (1.0 + value * value).sqrt()))
            .filter(|(_, ratio)| *ratio > RATIO_UNDETERMINED)
            .map(|(index, ratio)| {
                let row = right.row(index);
                let largest = row[row.transpose().iamax()];
                let share = |(parameter, share): (usize, &f64)| (parameter, share * largest.signum());
                let mut parts: Vec<(usize, f64)> = row.iter().enumerate().map(share).collect();
                parts.retain(|(_, share)| share.abs() >= SHARE_NAMED);
                parts.sort_by(|one, other| other.1.abs().total_cmp(&one.1.abs()));
                Undetermined { ratio, parts }
            })
            .collect();
        found.sort_by(|one, other| other.ratio.total_cmp(&one.ratio));
        found
    }

    /// (f4), in prior deviations; `covariance` is (f3).
    fn covariance_between_samples(&self, blocks: &[Block], covariance: &DMatrix<f64>) -> DMatrix<f64> {
        let count = self.values.len();
        let rows = self.rows(blocks, None);
        let mut pulls = vec![DVector::zeros(count); self.samples.len()];
        for (index, block) in blocks.iter().enumerate() {
            let rows = rows.rows(3 * index, 3);
            pulls[block.sample] += rows.columns(0, count).transpose() * rows.column(count);
        }
        let samples = self.modelled.iter().flatten().count() as f64;
        let equations = equations(blocks);
        let taken: f64 = self.taken().iter().sum();
        let factor = samples / (samples - 1.0).max(1.0) * equations / (equations - taken).max(1.0);
        let spread =
            pulls.iter().fold(DMatrix::zeros(count, count), |sum, pull| sum + pull * pull.transpose());
        covariance * (spread * factor + DMatrix::identity(count, count)) * covariance
    }
}

/// Two a tangent, three a position.
fn equations(blocks: &[Block]) -> f64 {
    blocks.iter().map(|block| block.quantity.rows()).sum::<usize>() as f64
}
