//! What lights a medium: the environment around it, and analytic lights.

mod analytic;
mod black_body;
mod environment;
mod projection;
mod sun;

pub use analytic::{Light, LightError};
pub use black_body::BlackBody;
pub use environment::{Environment, EnvironmentError, Image, clamp_texels};
pub use sun::{Cost, Split, Sun, half_space};
