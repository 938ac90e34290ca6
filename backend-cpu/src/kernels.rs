//! The kernels: one file a stage, and the helpers they share. Every backend has files of the same names, which hold
//! functions of the same names in the same order.

pub(crate) mod accumulate;
pub(crate) mod angle;
pub(crate) mod bend;
pub(crate) mod classify;
pub(crate) mod coarsen;
pub(crate) mod face;
pub(crate) mod field;
pub(crate) mod harmonics;
pub(crate) mod illuminate;
pub(crate) mod inject;
pub(crate) mod light;
pub(crate) mod march;
pub(crate) mod maximum;
pub(crate) mod mesh;
pub(crate) mod noise;
pub(crate) mod obstruct;
pub(crate) mod path;
pub(crate) mod phase;
pub(crate) mod phong;
pub(crate) mod project;
pub(crate) mod propagate;
pub(crate) mod random;
pub(crate) mod reduce;
pub(crate) mod relight;
pub(crate) mod sample;
pub(crate) mod segment;
pub(crate) mod shade;
pub(crate) mod shadow;
pub(crate) mod sky;
pub(crate) mod spot;
pub(crate) mod sweep;
pub(crate) mod trace;
pub(crate) mod upsample;
pub(crate) mod view;
pub(crate) mod walk;
