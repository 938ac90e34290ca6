//! What lights a medium: the environment around it, and analytic lights.

mod analytic;
mod beams;
mod black_body;
mod cells;
mod environment;
mod prefilter;
mod projection;
mod sun;

pub use analytic::{Light, LightError};
pub use beams::Beams;
pub use black_body::BlackBody;
pub use environment::{Environment, EnvironmentError, Image, clamp_texels};
pub use prefilter::Prefilter;
pub use sun::{Cost, Split, Sun, half_space};
