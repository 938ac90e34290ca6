//! What lights a medium: the environment around it, and analytic lights.

mod analytic;
mod environment;

pub use analytic::{Light, LightError};
pub use environment::{Environment, EnvironmentError, Image, clamp_texels};
