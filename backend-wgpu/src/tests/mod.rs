//! What must run on a device. Without an adapter the tests say that they were skipped, or fail where `AIRLIGHT_REQUIRE`
//! names `wgpu`.

mod engine;
mod filter;
mod project;
mod propagate;
mod publish;
mod staging;
mod steady;
mod sweep;
mod trouble;
mod units;

use airlight_core::device::{Buf, Device, ResourceId, ResourceSpec, Usage};
use airlight_core::stage::{Relight, RelightParams};

use crate::{WgpuDevice, adapter};

/// The first adapter, opened.
fn device() -> Option<WgpuDevice> {
    match adapter::open(0) {
        Ok(device) => Some(device),
        Err(reason) => {
            let required = std::env::var("AIRLIGHT_REQUIRE").unwrap_or_default();
            assert!(!required.split(',').any(|id| id.trim() == "wgpu"), "wgpu is required: {reason}");
            eprintln!("SKIPPED, because wgpu has no device: {reason}");
            None
        }
    }
}

/// A buffer of `values`.
fn filled<T: bytemuck::Pod>(device: &mut dyn Device, id: u32, values: &[T]) -> Buf<T> {
    let buf = empty(device, id, values.len());
    device.write(buf.id, 0, bytemuck::cast_slice(values)).unwrap();
    buf
}

/// A buffer of zeros.
fn empty<T: bytemuck::Pod>(device: &mut dyn Device, id: u32, len: usize) -> Buf<T> {
    let buf = Buf::new(ResourceId(id), len as u64);
    let spec = ResourceSpec::Buffer { bytes: size_of::<T>() as u64 * len as u64, usage: Usage::Work };
    device.create(buf.id, &spec).unwrap();
    buf
}

/// What a buffer holds.
fn content<T: bytemuck::Pod>(device: &mut dyn Device, buf: Buf<T>) -> Vec<T> {
    let mut out = vec![T::zeroed(); buf.len as usize];
    device.read(buf.id, 0, bytemuck::cast_slice_mut(&mut out)).unwrap();
    out
}

/// `relight` of records of one value each, under light of (2, 4, 8).
fn relight(device: &mut dyn Device, records: &[f32]) -> Relight {
    Relight {
        params: RelightParams {
            cells: records.len() as u32,
            coefficients: 1,
            channels: 1,
            layers: 1,
            ..bytemuck::Zeroable::zeroed()
        },
        records: filled(device, 0, records),
        emission_records: None,
        light: filled(device, 1, &[[2.0f32, 4.0, 8.0, 0.0]]),
        out: empty(device, 2, records.len()),
    }
}
