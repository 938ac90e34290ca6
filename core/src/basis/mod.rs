//! Bases of functions on the sphere, direction sets and quadrature.

pub mod quadrature;
