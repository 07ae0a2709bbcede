//! Layer math.
