//! Why samples give no parameters.

use thiserror::Error;

/// Samples that cannot be used as asked.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum IdentifyError {
    /// Not enough equations.
    #[error(
        "{samples} samples give {equations} equations for {parameters} parameters: must be at least {least} samples"
    )]
    TooFew {
        /// Samples given.
        samples: usize,
        /// Two a tangent, three a position.
        equations: usize,
        /// Parameters to find.
        parameters: usize,
        /// Samples that would do.
        least: usize,
    },
    /// Every parameter is held.
    #[error("every prior is 0: at least one parameter must be free")]
    NothingFree,
    /// The model of the nominal parameters has no equilibrium for most samples.
    #[error(
        "the model finds no stable equilibrium for {lost} of {samples} samples, first for sample {first}: \
        must be currents and angles that the rod bears without snapping through"
    )]
    NoEquilibrium {
        /// Samples without one.
        lost: usize,
        /// Samples given.
        samples: usize,
        /// Index of the first of them.
        first: usize,
    },
    /// The parameters lead out of what a rig's tables admit.
    #[error("the rig's tables cannot be built: {0}")]
    Tables(String),
}
