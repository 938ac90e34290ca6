//! What must run on a device. Without one the tests say that they were skipped, or fail where `AIRLIGHT_REQUIRE`
//! names `opencl`.

mod kernels;
mod trouble;

use airlight_core::device::{Buf, Device, DeviceKind, ResourceId, ResourceSpec, Usage};
use airlight_core::stage::{Relight, RelightParams, Stage};

use crate::{OpenclDevice, platform};

/// The first device, opened.
fn device() -> Option<OpenclDevice> {
    match platform::open(0, None) {
        Ok(device) => Some(device),
        Err(reason) => {
            let required = std::env::var("AIRLIGHT_REQUIRE").unwrap_or_default();
            assert!(!required.split(',').any(|id| id.trim() == "opencl"), "opencl is required: {reason}");
            eprintln!("SKIPPED, because opencl has no device: {reason}");
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
    relight_into(device, 0, records)
}

/// The same, in resources from `first` on.
fn relight_into(device: &mut dyn Device, first: u32, records: &[f32]) -> Relight {
    Relight {
        params: RelightParams {
            cells: records.len() as u32,
            coefficients: 1,
            channels: 1,
            layers: 1,
            ..bytemuck::Zeroable::zeroed()
        },
        records: filled(device, first, records),
        emission_records: None,
        light: filled(device, first + 1, &[[2.0f32, 4.0, 8.0, 0.0]]),
        out: empty(device, first + 2, records.len()),
    }
}

#[test]
fn free_memory_is_less_by_what_is_held_and_by_scratch_memory() {
    let Some(mut device) = device() else { return };
    let buffer = empty::<u32>(&mut device, 0, 1000);
    assert_eq!(device.held(), buffer.bytes());
    device.scratch.of(&mut device.cl, 1 << 20).unwrap();
    device.scratch.of(&mut device.cl, 1 << 10).unwrap();
    assert_eq!(device.held(), buffer.bytes() + (1 << 20));
    if let Some(all) = device.info().memory_bytes {
        assert!(device.free_memory().is_some_and(|free| free > 0 && free <= all - device.held()));
    }
    device.destroy(buffer.id);
    assert_eq!(device.held(), 1 << 20);
}

#[test]
fn buffers_are_seen_in_place_between_one_stage_and_the_next() {
    let Some(mut device) = device() else { return };
    if device.info().kind == DeviceKind::DiscreteGpu {
        return;
    }
    let relight = relight(&mut device, &[0.5, 0.25, 3.0]);
    let (records, out) = (relight.records, relight.out);
    let stage = Stage::Relight(relight);
    device.dispatch(&stage, 0..3).unwrap();
    // Work is under way.
    assert!(device.view(out.id).is_none());
    device.finish().unwrap();
    let seen = |device: &OpenclDevice| {
        let values: &[[f32; 4]] = bytemuck::cast_slice(device.view(out.id).unwrap());
        values.iter().map(|value| value[0]).collect::<Vec<_>>()
    };
    for _ in 0..2 {
        assert_eq!(seen(&device), [1.0, 0.5, 6.0]);
    }
    // What is written next is what is seen then, by the host and by stages.
    device.write(records.id, 0, bytemuck::cast_slice(&[1.0f32, 2.0, 4.0])).unwrap();
    device.dispatch(&stage, 0..3).unwrap();
    device.finish().unwrap();
    assert_eq!(seen(&device), [2.0, 4.0, 8.0]);
    assert_eq!(content(&mut device, out)[2], [8.0, 16.0, 32.0, 0.0]);
    device.destroy(out.id);
    assert!(device.view(out.id).is_none());
}

#[test]
fn writes_that_nobody_waits_for_arrive_in_order_however_many_they_are() {
    /// Words of a piece.
    const PIECE: usize = 1 << 17;
    let Some(mut device) = device() else { return };
    let buf = empty::<u32>(&mut device, 0, 48 * PIECE);
    // 24 MiB, more than may be on their way; the second round is written over the first.
    for round in 0..2u32 {
        for piece in 0..48u32 {
            let data = vec![100 * round + piece; PIECE];
            device.write(buf.id, 4 * (piece as usize * PIECE) as u64, bytemuck::cast_slice(&data)).unwrap();
        }
    }
    let found = content(&mut device, buf);
    assert!((100..).zip(found.chunks(PIECE)).all(|(value, piece)| piece.iter().all(|word| *word == value)));
}
