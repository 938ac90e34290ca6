//! The kernels: one file a stage, and the helpers they share. Every backend has files of the same names.

pub(crate) mod harmonics;
pub(crate) mod inject;
pub(crate) mod march;
pub(crate) mod noise;
pub(crate) mod phase;
pub(crate) mod project;
pub(crate) mod reduce;
pub(crate) mod relight;
pub(crate) mod sample;
pub(crate) mod segment;
