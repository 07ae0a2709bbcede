//! What the second variation says of an equilibrium.

use crate::rod::manipulator::Manipulator;
use crate::rod::pass::Pass;

/// Stability of an equilibrium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stability {
    /// Number of independent ways in which the manipulator would leave the equilibrium by itself; 0 when it
    /// is stable.
    pub unstable_modes: u32,
    /// Share of the strain energy of the weakest deformation that loads leave: 1 without loads, 0 where
    /// stability is lost, negative beyond; never above 1. Not a number for a pass that is not finite.
    pub margin: f64,
}

impl Manipulator {
    /// The stability of the equilibrium in `pass`, whatever its mode. The weakest mode is kept in `pass` and
    /// shortens the next search for it; that moves the margin by less than 1e-6, or by up to 0.002 where two
    /// modes change places. Never allocates or panics.
    pub fn stability(&self, pass: &mut Pass) -> Stability {
        pass.chain.update(self, pass.gravity, &pass.states, &pass.magnets);
        pass.chain.measure()
    }

    /// The number of unstable modes alone, at half the cost.
    pub(in crate::rod) fn unstable_modes(&self, pass: &mut Pass) -> u32 {
        pass.chain.update(self, pass.gravity, &pass.states, &pass.magnets);
        pass.chain.factor(0.0)
    }
}
