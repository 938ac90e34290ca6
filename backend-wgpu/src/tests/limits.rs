//! Ranges, windows, slabs and planes of workgroups, stage by stage against the processor.

use airlight_core::device::{
    Device, DeviceError, DeviceKind, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec, StageTime,
};
use airlight_core::stage::{Reduce, ReduceParams, Stage};
use airlight_cpu::CpuDevice;

use super::{content, device, empty, filled, relative_l2, scalar, small_device};

/// `reduce` of two fields, over some grid that does not divide them.
fn reduce(device: &mut dyn Device) -> Reduce {
    let dims = [11, 7, 13];
    let fields = [1u32, 2].map(|seed| {
        let field = Field { id: ResourceId(seed), spec: scalar(dims) };
        device.create(field.id, &ResourceSpec::Field(field.spec)).unwrap();
        let values: Vec<f32> = (0..11 * 7 * 13).map(|i| ((i * 37 * seed) % 101) as f32 / 101.0).collect();
        // Two writes of whole slices, which fall into different slabs.
        let (first, rest) = values.split_at(11 * 7 * 6);
        device.write(field.id, 0, bytemuck::cast_slice(first)).unwrap();
        device.write(field.id, first.len() as u64 * 4, bytemuck::cast_slice(rest)).unwrap();
        field
    });
    Reduce {
        params: ReduceParams::new([11, 7, 13, 0], [6, 5, 7, 0], [11.0 / 6.0, 1.4, 13.0 / 7.0, 0.5]),
        density: fields[0],
        other: Some(fields[1]),
        out: empty(device, 3, 6 * 5 * 7),
    }
}

#[test]
fn ranges_of_a_stage_add_up_to_the_whole() {
    let mut cpu = CpuDevice::new();
    let stage = reduce(&mut cpu);
    cpu.dispatch(&Stage::Reduce(stage.clone()), 0..210).unwrap();
    let expected = content(&mut cpu, stage.out);
    // A binding of 64 cells, and slabs of 5 slices.
    let Some(mut device) = small_device(512, 11) else { return };
    let stage = reduce(&mut device);
    let ranges = [0..1, 1..65, 65..65, 65..130, 130..210];
    for range in ranges.clone() {
        device.dispatch(&Stage::Reduce(stage.clone()), range).unwrap();
    }
    let got = content(&mut device, stage.out);
    // Means differ in the order of a sum of a dozen terms, maxima not at all.
    for (got, expected) in got.iter().zip(&expected) {
        assert!((got[0] - expected[0]).abs() < 1e-6 && got[1] == expected[1], "{got:?} {expected:?}");
    }
    let times = device.finish().unwrap();
    let told: Vec<_> = times.iter().map(|StageTime { stage, range, .. }| (*stage, range.clone())).collect();
    assert_eq!(told, ranges.map(|range| ("reduce", range)));
    assert!(device.finish().unwrap().is_empty());
}

#[test]
fn more_workgroups_than_fit_a_row_fill_a_plane() {
    let Some(mut device) = device() else { return };
    // Rows of workgroups are this long almost everywhere; a workgroup takes 64 cells.
    let cells = 65_535 * 64 + 1000;
    let records: Vec<f32> = (0..cells).map(|i| (i % 8191) as f32).collect();
    let stage = super::relight(&mut device, &records);
    device.dispatch(&Stage::Relight(stage.clone()), 0..cells).unwrap();
    let got = content(&mut device, stage.out);
    // Powers of two times small whole numbers are exact.
    let wrong = got.iter().zip(&records).position(|(got, r)| *got != [2.0 * r, 4.0 * r, 8.0 * r, 0.0]);
    assert_eq!(wrong, None);
}

#[test]
fn what_is_written_is_read_back_from_any_word_on() {
    let Some(mut device) = device() else { return };
    // Past the size of a staging buffer.
    let values: Vec<u32> = (0..9_000_001).collect();
    let buf = filled(&mut device, 0, &values);
    device.write(buf.id, 4 * 5, bytemuck::cast_slice(&[7u32, 8])).unwrap();
    let mut out = [0u32; 4];
    device.read(buf.id, 4 * 4, bytemuck::cast_slice_mut(&mut out)).unwrap();
    assert_eq!(out, [4, 7, 8, 7]);
    let all = content(&mut device, buf);
    assert_eq!(all[9_000_000], 9_000_000);
    let made: Vec<u32> = {
        let zeros = empty(&mut device, 1, 33);
        content(&mut device, zeros)
    };
    assert!(made.iter().all(|&v| v == 0));
}

#[test]
fn what_exceeds_a_limit_is_refused_with_the_numbers() {
    let Some(mut device) = device() else { return };
    let limits = device.info().limits;
    let field = |dims, layers| ResourceSpec::Field(FieldSpec { dims, layers, format: FieldFormat::Scalar });
    for spec in [
        field([limits.field_side + 1, 1, 1], 1),
        field([1, limits.field_side + 1, 1], 1),
        field([1, 1, limits.field_side], 17),
        ResourceSpec::Buffer { bytes: limits.buffer_bytes + 4, usage: airlight_core::device::Usage::Work },
    ] {
        let error = device.create(ResourceId(0), &spec).unwrap_err();
        assert!(matches!(error, DeviceError::Limit { requested, limit, .. } if requested > limit), "{error}");
    }
    // A row of layers longer than a texture's side is held in slabs.
    device.create(ResourceId(0), &field([1, 1, limits.field_side / 2 + 1], 4)).unwrap();
}

#[test]
fn layers_written_by_the_host_and_published_are_the_same() {
    // Both ways into a field of three layers in several slabs, seen through the same march.
    let spec = FieldSpec { dims: [4, 3, 7], layers: 4, format: FieldFormat::Rgba };
    let values: Vec<f32> = (0..spec.texels() * 4).map(|i| ((i * 29) % 53) as f32).collect();
    let film = |device: &mut dyn Device, published: bool| {
        let field = Field { id: ResourceId(0), spec };
        device.create(field.id, &ResourceSpec::Field(spec)).unwrap();
        if published {
            let buf = filled(device, 1, &values);
            device.publish(buf.id, field.id).unwrap();
        } else {
            device.write(field.id, 0, bytemuck::cast_slice(&values)).unwrap();
        }
        let march = super::scenes::layered_march(device, field);
        let out = march.film;
        let stage = Stage::March(march);
        device.dispatch(&stage, 0..stage.axis()).unwrap();
        let vectors: Vec<[f32; 4]> = content(device, out);
        vectors.iter().step_by(2).flatten().copied().collect::<Vec<f32>>()
    };
    let expected = film(&mut CpuDevice::new(), true);
    assert_eq!(film(&mut CpuDevice::new(), false), expected);
    for published in [true, false] {
        let Some(mut device) = small_device(5000, 10) else { return };
        let error = relative_l2(&film(&mut device, published), &expected);
        // A few units in the last place a step, over ten steps.
        assert!(error < 1e-6, "published {published}: {error:e}");
    }
}

#[test]
fn memory_is_told_where_the_driver_tells_it() {
    let Some(device) = device() else { return };
    let stated = crate::vulkan::of_device(&device.gpu.device);
    let software = device.info().kind == DeviceKind::SoftwareGpu;
    assert_eq!(device.info().memory_bytes, if software { airlight_core::host::memory() } else { stated.memory });
    if device.info().features.iter().any(|feature| feature == "vulkan") {
        // Vulkan has every device state both.
        assert!(stated.memory.is_some_and(|bytes| bytes > 1 << 28), "{stated:?}");
        assert!(stated.weight_bits.is_some_and(|bits| (4..=24).contains(&bits)), "{stated:?}");
    }
    if let (Some(free), Some(all)) = (device.free_memory(), device.info().memory_bytes) {
        assert!(free > 0 && free <= all, "{free} of {all}");
    }
}
