//! What the second variation says of an equilibrium.

use crate::rod::manipulator::Manipulator;
use crate::rod::pass::Pass;

/// Stability of an equilibrium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stability {
    /// Number of independent ways in which the manipulator would leave the equilibrium by itself; 0 when it is stable.
    pub unstable_modes: u32,
    /// Share of the strain energy of the weakest deformation that loads leave: 1 without loads, 0 where stability is lost, negative
    /// beyond; never above 1. Not a number for a pass that is not finite.
    pub margin: f64,
}

impl Manipulator {
    /// The stability of the equilibrium in `pass`.
    pub fn stability(&self, pass: &mut Pass) -> Stability {
        pass.chain.update(self, pass.gravity, &pass.states, &pass.magnets);
        pass.chain.measure()
    }

    /// The margin of the equilibrium in `pass` against the weakest mode of the one in `of`, whose stability was measured: to first
    /// order in the difference of the two equilibria it is the margin itself. Much cheaper.
    pub fn margin_beside(&self, of: &Pass, pass: &mut Pass) -> f64 {
        pass.chain.take_mode(&of.chain);
        pass.chain.update(self, pass.gravity, &pass.states, &pass.magnets);
        pass.chain.rayleigh().min(1.0)
    }
}
