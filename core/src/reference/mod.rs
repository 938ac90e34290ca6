//! Truth to hold devices to: closed forms, a slow f64 twin of each stage, and brute force over whole scenes.
//!
//! The twins say what a stage computes in the plainest way: no packets, no skipping, no shared intermediate results,
//! and no arithmetic of the kernels. They take the stage's parameters with what its bindings hold, and give what the
//! stage writes in the same layout. They index without checks: what they are given must satisfy the stage's
//! [`validate`](crate::stage::Kernel::validate).

mod accumulate;
pub mod brute;
mod classify;
pub mod closed;
mod coarsen;
mod evaluate;
mod facets;
mod flight;
mod illuminate;
mod inject;
mod lookup;
mod march;
mod mesh;
mod obstruct;
mod path;
mod phong;
mod photons;
mod project;
mod propagate;
mod reconstruct;
mod reduce;
mod relight;
mod shade;
mod shadow;
mod sky;
mod sweep;
mod trace;
mod upsample;

pub use accumulate::{AccumulateInputs, accumulate};
pub use brute::{BruteForce, BruteSettings};
pub use classify::{ClassifyInputs, classify};
pub use coarsen::{CoarsenInputs, coarsen};
pub use evaluate::{EvaluateInputs, evaluate};
pub use illuminate::{IlluminateInputs, illuminate};
pub use inject::{InjectInputs, inject};
pub use march::{MarchInputs, march, near_rim};
pub use obstruct::obstruct;
pub use path::{PathInputs, path};
pub use photons::{PhotonInputs, photons};
pub use project::{ProjectInputs, project};
pub use propagate::{PropagateInputs, propagate};
pub use reconstruct::{ReconstructInputs, reconstruct};
pub use reduce::{ReduceInputs, reduce};
pub use relight::{RelightInputs, relight};
pub use shade::{ShadeInputs, shade};
pub use shadow::{ShadowInputs, shadow};
pub use sweep::{SweepInputs, sweep};
pub use trace::{TraceInputs, trace};
pub use upsample::{UpsampleInputs, upsample};
