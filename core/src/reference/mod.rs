//! Truth to hold devices to.

pub mod closed;
