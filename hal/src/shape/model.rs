//! The centreline as a function of parameters, whichever kind it is.

use super::arc_model::ArcModel;
use super::frame::Frame;
use super::normal::NormalEquations;
use super::polynomial::PolynomialModel;
use super::settings::{CentrelineKind, CloudSettings};
use super::stations::{Centreline, Layout};

/// A parametrised centreline.
#[derive(Debug, Clone)]
pub(super) enum Model {
    Arcs(ArcModel),
    Polynomial(PolynomialModel),
}

impl Model {
    pub fn new(base: Frame, layout: &Layout, settings: &CloudSettings) -> Self {
        match settings.kind {
            CentrelineKind::Curvature { degree } => {
                Self::Arcs(ArcModel::new(base, layout, degree, settings.curvature, settings.force))
            }
            CentrelineKind::Polynomial { degree } => {
                Self::Polynomial(PolynomialModel::new(base, layout, degree, settings.curvature))
            }
        }
    }

    /// All parameters zero is the straight rod.
    pub fn parameter_count(&self) -> usize {
        match self {
            Self::Arcs(model) => model.parameter_count(),
            Self::Polynomial(model) => model.parameter_count(),
        }
    }

    /// Evaluates the centreline and its derivatives at every station.
    pub fn place(&mut self, parameters: &[f64], layout: &Layout, centreline: &mut Centreline) {
        match self {
            Self::Arcs(model) => model.place(parameters, layout, centreline),
            Self::Polynomial(model) => model.place(parameters, layout, centreline),
        }
    }

    /// Adds what is expected of the parameters beforehand.
    pub fn add_expectation(
        &self,
        parameters: &[f64],
        centreline: &Centreline,
        equations: &mut NormalEquations,
    ) {
        match self {
            Self::Arcs(model) => model.add_expectation(parameters, equations),
            Self::Polynomial(model) => model.add_expectation(parameters, centreline, equations),
        }
    }
}
