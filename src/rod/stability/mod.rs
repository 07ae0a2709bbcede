//! Is an equilibrium stable, and by how much? The second variation of the manipulator's potential energy.
//!
//! # Terms
//! - **Second variation** `A`: the energy, elastic and of all loads, to second order in a deformation at
//!   fixed loads. An equilibrium is stable when `A` is positive for every deformation; the number of its
//!   negative directions counts the **unstable modes**. Loads are conservative: weight, dead forces, magnets
//!   `-mu.B` in a field without curl. A dead moment at the tip has no energy; it counts as its work along
//!   `exp(eps phi)`, which has no second order.
//! - **Strain energy** `E`: the elastic part of it, positive. Without loads `A = E`.
//! - **Margin**: the lowest eigenvalue `lambda` of `A x = lambda E x`, at most 1.
//! - **Span**: a piece of a section, of at most 16 steps of the mesh. Its unknowns are strains at four Gauss
//!   points.
//!
//! # Equations
//! A deformation turns every frame by `exp(eps phi)`, phi in world axes, and strains the centre line by `eps
//! w` (an extensible section):
//! ```text
//! kappa = phi',   dp' = phi x v + w,   phi = dp = 0 at the clamp   (z1)
//! E = int kappa.K kappa + w.C w ds,   K = EI 1 + (GJ - EI) t t^T,   C = GA 1 + (EA - GA) t t^T   (z2)
//! A = E + int |phi|^2 n.v - (n.phi)(v.phi) - m.(phi x kappa) - 2 n.(phi x w) ds + sum over magnets   (z3)
//! magnet: -dc.H dc - 2 (phi x mu).G dc - (phi.mu)(phi.B) + |phi|^2 mu.B
//!         + |phi|^2 t.N - (N.phi)(t.phi),   dc = dp + (l/2) phi x t,   N = (l/2)(n + n+)   (z4)
//! lambda = min A/E   (z5)
//! ```
//! (z3): body curvature varies by `R^T (kappa - phi x kappa / 2)`, and the loads beyond a cross-section, n in
//! sum, do the work of the centre line's second order, `phi x (phi x v) + 2 phi x w`. Symbols are those of
//! `section` and `magnet`.
//!
//! # Method
//! (z1) is discretised by Gauss's collocation method with four points a span, (z3) by its quadrature: of
//! eighth order in the span's length. From the tip to the clamp each span's strains are eliminated in favour
//! of its start's six displacements, which leaves the stiffness of all that lies beyond. The pivots that are
//! not positive are as many as unstable modes (Sylvester's law of inertia; Haynsworth, *Linear Algebra Appl.*
//! 1, 1968): the count of conjugate points along the rod, clamped where the elimination stands and free
//! beyond. The same elimination of `A - sigma E` counts eigenvalues below `sigma`; inverse iteration with it
//! finds the lowest (`lowest`). Cost: linear in the number of spans. Pivots are not exchanged: a count is
//! wrong when one is zero to rounding, that is when the rod from some cut between two spans on, clamped
//! there, is itself at its limit to fourteen digits.
//!
//! What a span cannot represent is missed: modes that wiggle within it. A span held at both ends has none
//! unstable while
//! ```text
//! |n| h^2 / EI + (|m| h / 2 EI)^2 < pi^2   (z6)   Greenhill
//! ```
//! and the weakest mode under that load is represented to about 1e-5. The shipped manipulator
//! may transmit 0.3 N by that.
//!
//! # Why this measure
//! - The determinant of shooting ([`super::Pass::determinant`]) is the product of all eigenvalues (Forman,
//!   *Invent. Math.* 88, 1987). It keeps its sign where a rod that is symmetric about two planes loses two
//!   modes at once, says nothing of an equilibrium of which the way from rest is not known, and grows without
//!   bound with modes that loads stiffen. It remains a measure of stiffness as a whole.
//! - The lowest stiffness seen at the tip, or the smallest pivot, has poles where a mode leaves the tip at
//!   rest.
//! - (z5) has no unit and does not depend on frames or coordinates. Under loads in proportion it is `1 - load
//!   / critical load` as long as the shape does not change: linear through zero, whatever the multiplicity.
//!   `1 - lambda` is the share of the weakest deformation's strain energy that the loads pay. At a fold
//!   (snap-through) it vanishes as the root of the distance. Where two modes change places it has a kink.
//!
//! # Sources
//! Conjugate points of rods: R. S. Manning, K. A. Rogers, J. H. Maddocks, *Isoperimetric conjugate points
//! with application to the stability of DNA minicircles*, Proc. R. Soc. A 454, 1998. For robots: T. Bretl, Z.
//! McCarthy, *Quasi-static manipulation of a Kirchhoff elastic rod based on a geometric analysis of
//! equilibrium configurations*, Int. J. Robot. Res. 33, 2014; J. Till, D. C. Rucker, *Elastic stability of
//! Cosserat rods and parallel continuum robots*, IEEE T-RO 33, 2017, whose test by discretised second
//! variation this one resembles. They integrate Jacobi's equations from the clamp's end; here the magnets'
//! own stiffness (z4) joins in and the whole is eliminated in blocks.

mod chain;
mod lowest;
mod measure;
mod rigid;
mod samples;
mod span;
mod stiffness;

pub(super) use chain::Chain;
pub use measure::Stability;
