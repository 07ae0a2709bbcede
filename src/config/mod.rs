//! Layer config.
