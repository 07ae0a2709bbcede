//! Tests of the identification against the controller's own model: derivatives, recovery, honest
//! uncertainties, outliers, and what the data cannot tell.

mod derivatives;
mod fixtures;
mod recovery;
mod uncertainty;
