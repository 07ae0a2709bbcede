//! Layer daemon.
