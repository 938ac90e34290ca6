//! The CPU device: every stage of airlight on the processor's cores, with rayon across them and packets of sixteen
//! lanes within.
//!
//! Kernels are written once over plain arrays of sixteen and compiled for each instruction set ([`Isa`]); the best
//! that the machine has is chosen when the device is opened. Nothing is contracted or reordered between them, so all
//! give the same bits.

mod bare;
mod columns;
mod device;
mod film;
mod held;
mod inputs;
mod isa;
mod kernels;
mod packet;
mod paths;
mod simd;
mod tiles;

pub use bare::{BareRay, bare_lookups};
pub use device::CpuDevice;
pub use isa::Isa;

use airlight_core::device::{Device, Provider};

/// The backend, for a runtime to gather.
pub const PROVIDER: Provider = Provider {
    name: "cpu",
    enumerate: || Ok(vec![CpuDevice::new().info().clone()]),
    open: |index| {
        if index == 0 {
            Ok(Box::new(CpuDevice::new()))
        } else {
            Err(airlight_core::device::Unavailable(format!("there is no cpu:{index}; the only one is cpu:0")))
        }
    },
};
