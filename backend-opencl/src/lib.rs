//! The OpenCL device of airlight: every stage in OpenCL C, for PoCL and for vendors' drivers.
//!
//! Buffers and fields are OpenCL buffers; kernels look up and interpolate texels themselves, because images are slow
//! and their filters coarse on many drivers. A field that exceeds what may be allocated at once is cut into slabs of
//! slices, each a buffer.
//!
//! The library OpenCL is found when a device is first asked for (`airlight-opencl-loader`): a program with this crate
//! is built, starts and runs without it. The environment variable `AIRLIGHT_OPENCL_LIBRARY` names another one.

mod cl;
mod clock;
mod device;
mod platform;
mod source;
mod staged;
mod store;

pub use device::OpenclDevice;
pub use source::Lanes;

use airlight_core::device::Provider;

/// The backend, for a runtime to gather.
pub const PROVIDER: Provider = Provider {
    name: "opencl",
    enumerate: platform::enumerate,
    open: |index| platform::open(index, None).map(|device| Box::new(device) as _),
};

#[cfg(test)]
mod tests;
