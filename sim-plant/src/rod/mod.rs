//! A dynamic Cosserat rod: rigid bodies linked by elastic elements, implicit in time.
//!
//! **Problem.** A clamped, free-ended manipulator of flexible sections and rigid magnets moves under
//! gravity, inertia, damping and magnetic wrenches. The plant needs its motion at a fixed step of
//! about half a millisecond, stable whatever the stiffness, at a cost linear in its length.
//!
//! **Terms.** A *body* is rigid: a magnet with the ends of the sections glued to it, or a slice of a
//! section lumped at a node. An *element* is the elastic stretch between two bodies; it carries the
//! six *strains* of a Cosserat rod (shear, stretch, bending, twist), constant along it. The *clamp* is
//! the fixed pose at which the first element begins.
//!
//! **Method.**
//! - space (`element`, `chain`): strains from the relative pose of the two ends, exact for an arc of
//!   constant curvature; residual bending flexibility (MacNeal, "A simple quadrilateral shell element",
//!   Computers & Structures 8, 1978) so that a coarse mesh neither locks nor softens; masses lumped
//!   one sixth of an element inwards from the ends of a section, which reproduces its consistent
//!   end moments;
//! - time (`dynamics`, `motion`, `balance`): the midpoint rule on rotations with stresses averaged over the
//!   step (Simo, Tarnow and Doblaré, "Non-linear dynamics of three-dimensional rods: exact energy and momentum
//!   conserving algorithms", IJNME 38, 1995) plus a first-order dissipation in strain and velocity, so
//!   that energy decays at every frequency (Armero and Romero, CMAME 190, 2001);
//! - solution (`block_tridiagonal`): a Newton iteration whose factorised tangent is kept over many steps
//!   and renewed when convergence slows;
//! - magnets (`magnets`): the coils' field, sampled once a step, and the dipole fields of each other;
//! - walls (`wall`, `contact`): a plane or a tube that the rod touches, by a smooth penalty;
//! - accounts (`energy`): what is stored, what the field has done, and where it went;
//! - damping (`modes`): Kelvin-Voigt, its time constant found from the first mode about rest.
//!
//! Nothing here knows a coil: magnets are told the field in which they are.

mod balance;
mod block_tridiagonal;
mod centreline;
mod chain;
mod contact;
mod dynamics;
mod element;
mod energy;
mod magnets;
mod modes;
mod motion;
mod rotation;
mod wall;

pub use chain::{Meshing, Pose};
pub use contact::{Contact, Surface, Touch};
pub use dynamics::{Rod, RodSettings, Solve, Stepping};
pub use energy::{Energy, EnergyLedger};
pub use modes::FirstMode;
pub use wall::{Clearance, Wall};
