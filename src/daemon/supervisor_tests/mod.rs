//! Tests of the state machine: every (state, event) pair against a table, limits one by one, and
//! random sequences of events against what must never happen.

mod bench;
mod limits;
mod places;
mod random;
mod safe;
mod stability;
mod stream;
mod table;
