//! Tests of the layer: reference cases made by independent tools, derivatives against differences of full
//! re-solves, invariants of the mechanics, and the outcomes of solves.

mod constants;
mod fixtures;
mod invariants;
mod jacobian;
mod reference;
mod solving;
mod stability;
