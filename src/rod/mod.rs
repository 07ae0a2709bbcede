//! Layer rod.
