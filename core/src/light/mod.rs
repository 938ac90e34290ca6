//! What lights a medium: the environment around it, and analytic lights.

mod analytic;
mod environment;
mod projection;

pub use analytic::{Light, LightError};
pub use environment::{Environment, EnvironmentError, Image, clamp_texels};
