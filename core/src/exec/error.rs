//! What can go wrong between a scene and its film.

use crate::device::{Bytes, DeviceError};
use crate::scene::SceneError;
use crate::transfer::TransferError;

/// Why a plan did not run to its end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExecError {
    /// A device call failed.
    #[error("{device}: {stage}: {error}")]
    Device {
        /// Name of the device.
        device: String,
        /// Stage, or what else was being done.
        stage: String,
        /// The fault.
        error: DeviceError,
    },
    /// A stage that does not fit its resources: a bug in an estimator.
    #[error("{device}: {stage}: {what}")]
    Invalid {
        /// Name of the device.
        device: String,
        /// Name of the stage.
        stage: String,
        /// What does not fit.
        what: String,
    },
    /// The plan needs more memory than there is; nothing was allocated.
    #[error(
        "{device}: this needs {} of memory and {} may be used (largest: {largest}); densities of 16 \
         bits (`quality.density`), a medium of fewer voxels (`medium.coarse`), a smaller picture or fewer cells and bands need less",
        Bytes(*needed),
        Bytes(*budget)
    )]
    Memory {
        /// Name of the device.
        device: String,
        /// Bytes of all resources, of what the device takes to run stages, and of what the host needs where both share their memory.
        needed: u64,
        /// Bytes that may be used.
        budget: u64,
        /// The largest resources with their sizes.
        largest: String,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Why a scene was not rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The scene itself.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its transfer.
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// Running it.
    #[error(transparent)]
    Exec(#[from] ExecError),
}
