//! The GPU device of airlight: every stage in WGSL, on wgpu. Of its interfaces Vulkan was tried; Metal and DX12 are
//! switched on where they are at home, and were not.
//!
//! Engines lend a device of their own and keep the picture on it: see [`engine`].
//!
//! Buffers are storage buffers; fields are 3-D textures of 32-bit floats that kernels load and interpolate themselves,
//! unless texture units are exact enough or asked for ([`Filter`]). What exceeds the adapter's limits is cut: fields into slabs of
//! slices, each a texture, and dispatches into pieces whose part of every buffer fits a binding.
//!
//! Mesa's software driver gathers from storage textures alone, runs both sides of every condition, and is handed kernels that suit
//! it: see decisions 0260 and 0261.

mod adapter;
mod atlas;
mod batch;
mod clock;
mod cut;
mod device;
pub mod engine;
mod filter;
mod gpu;
mod groups;
mod launch;
mod loader;
mod memory;
mod part;
mod pipeline;
mod project;
mod propagate;
mod source;
mod staging;
mod store;
mod sweep;
mod texels;
mod vulkan;

pub use device::WgpuDevice;
pub use filter::Filter;
pub use wgpu;

use airlight_core::device::Provider;

/// The backend, for a runtime to gather.
pub const PROVIDER: Provider = Provider {
    name: "wgpu",
    enumerate: adapter::enumerate,
    open: |index| adapter::open(index).map(|device| Box::new(device) as _),
};

#[cfg(test)]
mod tests;
