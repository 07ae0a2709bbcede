//! Stability

mod chain;
mod lowest;
mod measure;
mod rigid;
mod samples;
mod span;
mod stiffness;

pub(super) use chain::Chain;
pub use measure::Stability;
