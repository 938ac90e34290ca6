//! Running what must be computed on a device, and nothing else.
//!
//! A [`Plan`] is made anew for each frame: uploads, stages and publications over named resources, each with a key
//! made of its parameters and of what it reads. The [`Executor`] keeps the resources between frames and runs only
//! the nodes whose key changed. A moving light over a still medium, a moving medium under a still sky and a moving
//! eye over both need no flags: each redoes what depends on it.

mod anderson;
mod apart;
mod classify;
mod density;
mod error;
mod executor;
mod key;
mod paths;
mod photons;
mod plan;
mod precompute;
mod renderer;
mod solve;
mod surfaces;
mod vectors;

pub use error::{ExecError, RenderError};
pub use executor::{Executor, Hooks, Progress, Report, StageRun};
pub use key::Key;
pub use paths::PathsRun;
pub use photons::Flown;
pub use plan::{Plan, State};
pub use precompute::{Precomputed, Survey};
pub use renderer::{OnDevice, Rendered, Renderer, Surface};
pub use solve::{Part, Solve, Solved};
