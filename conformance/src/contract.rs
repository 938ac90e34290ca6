//! What the [`Device`] trait promises of memory and dispatch.

use airlight::device::{Buf, Device, DeviceError, FieldFormat, FieldSpec, ResourceId, ResourceSpec, Usage};
use airlight::stage::{Reduce, ReduceParams, Stage};
use libtest_mimic::Failed;

use crate::bench::Bench;
use crate::fixtures::noise;
use crate::{Axis, Case, Record, Subject, check};

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new("device::info", "The device tells a name, an id and limits that can be.", info),
        Case::new(
            "device::buffers_are_zero_and_keep_what_is_written",
            "A new buffer holds zeros, and then what is written to it.",
            buffers,
        )
        .permutes(&usages())
        .permutes(&lengths()),
        Case::new("device::parts_of_buffers", "Parts of buffers are written and read alone.", parts),
        Case::new(
            "device::destroyed_resources_are_gone",
            "What is destroyed cannot be read, and its id is free again.",
            destroyed,
        ),
        Case::new(
            "device::unknown_resources_are_errors",
            "Calls that name a resource that does not exist are errors.",
            unknown,
        ),
        Case::new(
            "device::bytes_past_the_end_are_errors",
            "Bytes past a buffer's end, and parts of words, are neither written nor read.",
            past_the_end,
        ),
        Case::new(
            "device::fields_take_whole_slices",
            "Fields are written in whole slices, in any order, and not read back.",
            slices,
        ),
        Case::new(
            "device::published_fields_hold_what_was_written",
            "A published field holds what its buffer held then.",
            published,
        ),
        Case::new(
            "device::stages_see_what_was_written_last",
            "A stage that runs again sees what was written to its field since, by the host and by publication.",
            latest,
        ),
        Case::new(
            "device::publication_checks_sizes",
            "A buffer that is no field's size, and a field to a buffer, are not published.",
            publication,
        ),
        Case::new(
            "device::limits_are_kept",
            "Resources past every limit are refused, and the device is as good as before.",
            limits,
        ),
        Case::new(
            "device::stages_that_do_not_fit_are_errors",
            "Ranges past the axis, outputs too short and resources that are not there are refused.",
            misfits,
        ),
        Case::new("device::finish_forgets", "Without a dispatch there is no time to tell.", finish),
    ]
}

fn usages() -> Axis<Usage> {
    Axis::of("usage", [Usage::Input, Usage::Work, Usage::Output])
}

/// Around a row of a packet and a page.
fn lengths() -> Axis<usize> {
    Axis::of("values", [1, 3, 16, 17, 1023, 4097])
}

const SPEC: FieldSpec = FieldSpec::dense([7, 5, 9], 1, FieldFormat::Scalar);
const VOXELS: usize = 315;

fn buffer(bytes: u64) -> ResourceSpec {
    ResourceSpec::Buffer { bytes, usage: Usage::Work }
}

/// The mean and maximum of every voxel: the field itself, read back through a stage.
fn copy_of(bench: &mut Bench, field: airlight::device::Field) -> Result<Vec<f32>, Failed> {
    let [x, y, z] = field.spec.dims;
    let out: Buf<[f32; 2]> = bench.room((x * y * z) as usize, Usage::Work)?;
    let params = ReduceParams::new([x, y, z, 0], [x, y, z, 0], [1.0, 1.0, 1.0, 0.0]);
    let stage = Stage::Reduce(Reduce { params, density: field, other: None, out });
    bench.device.dispatch(&stage, 0..stage.axis())?;
    Ok(bench.read(out)?.iter().map(|v| v[0]).collect())
}

/// An error of a call that a caller could have known to be wrong.
fn refused<T>(what: &str, result: Result<T, DeviceError>) -> Result<(), Failed> {
    match result {
        Err(DeviceError::Lost(why)) => Err(format!("{what} lost the device: {why}").into()),
        Err(_) => Ok(()),
        Ok(_) => Err(format!("{what} was accepted").into()),
    }
}

fn info(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let device = subject.device()?;
    let info = device.info();
    check!(!info.name.is_empty() && !info.backend.is_empty(), "a device without a name: {info:?}");
    check!(info.id() == format!("{}:{}", info.backend, info.index), "id {}", info.id());
    check!((1..=24).contains(&info.filter_bits), "{} bits of a filter weight", info.filter_bits);
    let limits = info.limits;
    check!(
        limits.binding_bytes <= limits.buffer_bytes && limits.field_side > 0 && limits.binding_bytes > 0,
        "{limits:?}"
    );
    Ok(())
}

fn buffers(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    record.each(&usages(), |record, &usage| {
        record.each(&lengths(), |record, &len| {
            let buf = bench.room::<f32>(len, usage)?;
            record.same("new", &bench.read(buf)?, &vec![0.0; len]);
            let data = noise(len as u64, len);
            bench.device.write(buf.id, 0, bytemuck::cast_slice(&data))?;
            record.same("written and read", &bench.read(buf)?, &data);
            Ok(())
        })
    })
}

fn parts(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let buf = bench.room::<f32>(100, Usage::Work)?;
    let mut expected = vec![0.0f32; 100];
    for (start, len) in [(10usize, 20usize), (0, 4), (96, 4), (25, 10)] {
        let data = noise(start as u64, len);
        bench.device.write(buf.id, 4 * start as u64, bytemuck::cast_slice(&data))?;
        expected[start..start + len].copy_from_slice(&data);
    }
    record.same("after four writes", &bench.read(buf)?, &expected);
    let mut part = vec![0.0f32; 7];
    bench.device.read(buf.id, 4 * 23, bytemuck::cast_slice_mut(&mut part))?;
    record.same("a part", &part, &expected[23..30]);
    Ok(())
}

fn destroyed(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut device = subject.device()?;
    let id = ResourceId(3);
    device.create(id, &buffer(64))?;
    refused("an id that exists", device.create(id, &buffer(64)))?;
    device.write(id, 0, &[255; 64])?;
    device.destroy(id);
    refused("reading what was destroyed", device.read(id, 0, &mut [0; 64]))?;
    device.destroy(id);
    device.create(id, &buffer(128))?;
    let mut out = [1u8; 128];
    device.read(id, 0, &mut out)?;
    check!(out == [0; 128], "a resource made anew is not zero");
    Ok(())
}

fn unknown(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut device = subject.device()?;
    let id = ResourceId(99);
    refused("writing", device.write(id, 0, &[0; 4]))?;
    refused("reading", device.read(id, 0, &mut [0; 4]))?;
    device.create(ResourceId(1), &buffer(1260))?;
    device.create(ResourceId(2), &ResourceSpec::Field(SPEC))?;
    refused("publishing from nothing", device.publish(id, ResourceId(2)))?;
    refused("publishing to nothing", device.publish(ResourceId(1), id))?;
    device.publish(ResourceId(1), ResourceId(2))?;
    Ok(())
}

fn past_the_end(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut device = subject.device()?;
    let id = ResourceId(1);
    device.create(id, &buffer(64))?;
    for (offset, len) in [(0u64, 68usize), (64, 4), (60, 8), (u64::MAX - 3, 4)] {
        refused(&format!("writing {len} bytes at {offset}"), device.write(id, offset, &vec![0; len]))?;
        refused(&format!("reading {len} bytes at {offset}"), device.read(id, offset, &mut vec![0; len]))?;
    }
    for (offset, len) in [(0u64, 3usize), (2, 4), (1, 1)] {
        refused(&format!("writing parts of words, {len} bytes at {offset}"), device.write(id, offset, &vec![0; len]))?;
        refused(
            &format!("reading parts of words, {len} bytes at {offset}"),
            device.read(id, offset, &mut vec![0; len]),
        )?;
    }
    device.write(id, 60, &[0; 4])?;
    Ok(())
}

fn slices(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let data = noise(1, VOXELS);
    let field = bench.scalars(SPEC.dims, &vec![0.0; VOXELS])?;
    let slice = SPEC.slice_bytes();
    // Slices in disorder.
    for k in [4usize, 8, 0, 2, 1, 3, 7, 6, 5] {
        bench.device.write(field.id, k as u64 * slice, bytemuck::cast_slice(&data[k * 35..(k + 1) * 35]))?;
    }
    record.same("slices", &copy_of(&mut bench, field)?, &data);
    refused("half a slice", bench.device.write(field.id, 0, &vec![0; slice as usize / 2]))?;
    refused("a slice off its place", bench.device.write(field.id, 4, &vec![0; slice as usize]))?;
    refused("a slice too many", bench.device.write(field.id, 9 * slice, &vec![0; slice as usize]))?;
    refused("reading a field", bench.device.read(field.id, 0, &mut vec![0; slice as usize]))?;
    record.same("after refusals", &copy_of(&mut bench, field)?, &data);
    Ok(())
}

fn published(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let data = noise(2, VOXELS);
    let buf = bench.buf(&data)?;
    let field = bench.scalars(SPEC.dims, &vec![9.0; VOXELS])?;
    bench.device.publish(buf.id, field.id)?;
    // Where the host sees a buffer in place, it sees what it reads; a field it does not see.
    let seen = bench.device.view(buf.id).map(|bytes| bytes.to_vec());
    if let Some(seen) = seen {
        record.same("seen in place", bytemuck::cast_slice(&seen), &data);
    }
    check!(bench.device.view(field.id).is_none(), "a field is seen as a buffer");
    record.same("published", &copy_of(&mut bench, field)?, &data);
    // What is written to the buffer afterwards does not reach the field.
    bench.device.write(buf.id, 0, bytemuck::cast_slice(&vec![1.0f32; VOXELS]))?;
    record.same("after a later write", &copy_of(&mut bench, field)?, &data);
    Ok(())
}

fn latest(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let data = [3, 4, 5].map(|seed| noise(seed, VOXELS));
    let field = bench.scalars(SPEC.dims, &data[0])?;
    let [x, y, z] = SPEC.dims;
    let out: Buf<[f32; 2]> = bench.room(VOXELS, Usage::Work)?;
    let params = ReduceParams::new([x, y, z, 0], [x, y, z, 0], [1.0, 1.0, 1.0, 0.0]);
    // The same stage, to the last bit.
    let stage = Stage::Reduce(Reduce { params, density: field, other: None, out });
    for (n, values) in data.iter().enumerate() {
        match n {
            0 => {}
            1 => bench.device.write(field.id, 0, bytemuck::cast_slice(values))?,
            _ => {
                let buf = bench.buf(values)?;
                bench.device.publish(buf.id, field.id)?;
            }
        }
        bench.device.dispatch(&stage, 0..stage.axis())?;
        let means: Vec<f32> = bench.read(out)?.iter().map(|v| v[0]).collect();
        record.same(["at first", "written anew", "published anew"][n], &means, values);
    }
    Ok(())
}

fn publication(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let field = bench.scalars(SPEC.dims, &vec![0.0; VOXELS])?;
    let short = bench.room::<f32>(VOXELS - 1, Usage::Work)?;
    refused("publishing too little", bench.device.publish(short.id, field.id))?;
    let whole = bench.room::<f32>(VOXELS, Usage::Work)?;
    refused("publishing to a buffer", bench.device.publish(whole.id, short.id))?;
    refused("publishing from a field", bench.device.publish(field.id, field.id))
}

fn limits(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut device = subject.device()?;
    let beyond = device.info().limits.buffer_bytes.saturating_mul(4).saturating_add(64) & !15;
    refused("a buffer past every limit", device.create(ResourceId(1), &buffer(beyond.max(1 << 60))))?;
    let spec = FieldSpec::dense([u32::MAX, u32::MAX, u32::MAX], 1, FieldFormat::Rgba);
    refused("a field past every limit", device.create(ResourceId(2), &ResourceSpec::Field(spec)))?;
    // The device is as good as before.
    device.create(ResourceId(1), &buffer(64))?;
    device.create(ResourceId(2), &ResourceSpec::Field(SPEC))?;
    Ok(())
}

fn misfits(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let field = bench.scalars(SPEC.dims, &vec![0.0; VOXELS])?;
    let out: Buf<[f32; 2]> = bench.room(VOXELS, Usage::Work)?;
    let params = ReduceParams::new([7, 5, 9, 0], [7, 5, 9, 0], [1.0, 1.0, 1.0, 0.0]);
    let reduce = Reduce { params, density: field, other: None, out };
    let run = |bench: &mut Bench, reduce: Reduce, to: u32| bench.device.dispatch(&Stage::Reduce(reduce), 0..to);
    refused("a range past the axis", run(&mut bench, reduce.clone(), 316))?;
    let short = Reduce { out: Buf::new(out.id, 314), ..reduce.clone() };
    refused("an output too short", run(&mut bench, short, 315))?;
    let missing = Reduce { out: Buf::new(ResourceId(99), 315), ..reduce.clone() };
    // A device that works late may say so late.
    let late = run(&mut bench, missing, 315).and_then(|()| bench.device.finish().map(|_| ()));
    refused("an output that does not exist", late)?;
    run(&mut bench, reduce, 315)?;
    Ok(())
}

fn finish(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut device: Box<dyn Device> = subject.device()?;
    check!(device.finish()?.is_empty(), "times of dispatches that never were");
    device.create(ResourceId(1), &buffer(64))?;
    check!(device.finish()?.is_empty(), "a time of something that was no dispatch");
    Ok(())
}
