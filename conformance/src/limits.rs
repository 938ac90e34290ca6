//! What is larger than a device holds, binds or dispatches in one piece.

use airlight::basis::{SphericalHarmonics, recurrence_table};
use airlight::device::{Buf, DeviceError, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec, Usage};
use airlight::reference::{self, MarchInputs, ReduceInputs};
use airlight::stage::{March, MarchParams, Reduce, ReduceParams, Relight, RelightParams, Stage};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use crate::bench::{Bench, cuts};
use crate::fixtures::noise;
use crate::frames::NARROW;
use crate::{Axis, Case, Record, Subject, check, tolerance};

/// What many devices bind at once at the most, software adapters and WebGPU's defaults among them.
const BINDING: u64 = 128 << 20;

/// Texels of the long side of long fields: past the 2048 that many devices have.
const LONG: u32 = 2100;

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "limits::what_is_past_them_is_refused_with_the_numbers",
            "A resource past a limit of the device is refused with its size and the limit.",
            refusals,
        ),
        Case::new(
            "limits::more_bands_than_kernels_hold",
            "In-scatter of more bands than kernels have room for is refused, and that of the most is rendered.",
            many_bands,
        )
        .within(&tolerance::STAGE),
        Case::new(
            "limits::long_fields",
            "A field longer than 2048 is held whole or refused with its size.",
            long_fields,
        )
        .within(&tolerance::MEAN)
        .permutes(&sides()),
        Case::new(
            "limits::fields_in_slabs",
            "A stage reads the same of fields that are cut into slabs and written in two parts.",
            slabs,
        )
        .within(&tolerance::MEAN)
        .permutes(&sizes())
        .varies(&cuts()),
        Case::new(
            "limits::layers_in_slabs",
            "Layers of a field are the same whether the host writes them or stages do, whole or in slabs.",
            layers,
        )
        .within(&tolerance::STAGE)
        .permutes(&sizes())
        .permutes(&ways()),
        Case::new(
            "limits::long_dispatches",
            "A dispatch of more workgroups than fit one row reaches every unit of its range, and none past it.",
            dispatches,
        ),
        Case::new(
            "limits::long_copies",
            "Buffers past the size of a staging buffer are read from any word on.",
            copies,
        ),
        Case::new("limits::buffers_past_128_mib", "Records of ten bands that take more than 128 MiB are lit.", records),
        Case::new("limits::fields_past_128_mib", "A field of more than 128 MiB is sampled.", field)
            .within(&tolerance::MEAN),
    ]
}

/// Limits to try.
pub(crate) fn sizes() -> Axis<bool> {
    Axis::new("limits", [("own", false), ("narrow", true)])
}

/// A bench on a device of its own limits or of narrow ones.
fn bench(subject: &Subject, narrow: bool) -> Result<Bench, Failed> {
    let mut bench = Bench::new(subject)?;
    if narrow {
        // A few slices of the fields here.
        bench.device.narrow(&airlight::device::Limits { binding_bytes: 5000, field_side: 12, ..NARROW });
    }
    Ok(bench)
}

fn scalars(dims: [u32; 3]) -> FieldSpec {
    FieldSpec::dense(dims, 1, FieldFormat::Scalar)
}

fn refusals(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut device = subject.device()?;
    let limits = record.info().limits;
    let sides = [[limits.field_side.saturating_add(1), 1, 1], [1, limits.field_side.saturating_add(1), 1]];
    let too_large = sides
        .map(|dims| ResourceSpec::Field(scalars(dims)))
        .into_iter()
        .chain([ResourceSpec::Buffer { bytes: limits.buffer_bytes.saturating_add(4) & !3, usage: Usage::Work }]);
    for spec in too_large {
        let error = device.create(ResourceId(0), &spec).err();
        let told = matches!(error, Some(DeviceError::Limit { requested, limit, .. }) if requested > limit);
        check!(told, "{spec:?}, with limits of {limits:?}: {error:?}");
    }
    device.create(ResourceId(0), &ResourceSpec::Buffer { bytes: 64, usage: Usage::Work })?;
    Ok(())
}

/// `reduce` of a field and another one, by its twin.
fn reduced(params: &ReduceParams, field: &[f32], other: &[f32]) -> [Vec<f64>; 2] {
    let both = reference::reduce(params, &ReduceInputs { density: field, other: Some(other) });
    [0, 1].map(|i| both.iter().skip(i).step_by(2).copied().collect())
}

fn hold_reduced(record: &mut Record, found: &[[f32; 2]], [means, maxima]: &[Vec<f64>; 2]) {
    record.hold("means", found.iter().map(|v| v[0]), means.iter().copied());
    record.within(tolerance::EXACT, |record| {
        record.hold("maxima", found.iter().map(|v| v[1]), maxima.iter().copied());
    });
}

fn slabs(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let dims = [11, 7, 43];
    let n = dims.iter().product::<u32>() as usize;
    let data = [noise(51, n), noise(52, n)];
    let [x, y, z] = dims;
    let params = ReduceParams::new([x, y, z, 0], [6, 5, 7, 0], [11.0 / 6.0, 1.4, 43.0 / 7.0, 0.5]);
    let expected = reduced(&params, &data[0], &data[1]);
    record.each(&sizes(), |record, &narrow| {
        let mut bench = bench(subject, narrow)?;
        let fields = data.iter().map(|values| {
            let field = Field { id: bench.id(), spec: scalars(dims) };
            bench.device.create(field.id, &ResourceSpec::Field(field.spec))?;
            // Two writes of whole slices, which fall into different slabs.
            let (first, rest) = values.split_at(11 * 7 * 6);
            bench.device.write(field.id, 4 * first.len() as u64, bytemuck::cast_slice(rest))?;
            bench.device.write(field.id, 0, bytemuck::cast_slice(first))?;
            Ok(field)
        });
        let fields = fields.collect::<Result<Vec<_>, Failed>>()?;
        let out: Buf<[f32; 2]> = bench.room(6 * 5 * 7, Usage::Work)?;
        let stage = Stage::Reduce(Reduce { params, density: fields[0], other: Some(fields[1]), out });
        record.each(&cuts(), |record, &cut| {
            bench.run(record, &stage, cut)?;
            hold_reduced(record, &bench.read(out)?, &expected);
            Ok(())
        })
    })
}

/// Long sides along each axis.
fn sides() -> Axis<[u32; 3]> {
    Axis::new("long side", [("x", [LONG, 3, 5]), ("y", [3, LONG, 5]), ("z", [3, 5, LONG])])
}

fn long_fields(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let side = record.info().limits.field_side;
    record.each(&sides(), |record, &dims| {
        let data = noise(53, dims.iter().product::<u32>() as usize);
        let coarse = dims.map(|n| if n == LONG { 30 } else { 2 });
        let cell = [0, 1, 2].map(|a| dims[a] as f32 / coarse[a] as f32);
        let [x, y, z] = dims;
        let params =
            ReduceParams::new([x, y, z, 0], [coarse[0], coarse[1], coarse[2], 0], [cell[0], cell[1], cell[2], 0.0]);
        let mut bench = Bench::new(subject)?;
        let density = Field { id: bench.id(), spec: scalars(dims) };
        match bench.device.create(density.id, &ResourceSpec::Field(density.spec)) {
            Err(DeviceError::Limit { requested, limit, .. }) if side < LONG && requested > limit => return Ok(()),
            created => created?,
        }
        bench.device.write(density.id, 0, bytemuck::cast_slice(&data))?;
        let out: Buf<[f32; 2]> = bench.room(coarse.iter().product::<u32>() as usize, Usage::Work)?;
        let stage = Stage::Reduce(Reduce { params, density, other: Some(density), out });
        bench.device.dispatch(&stage, 0..stage.axis())?;
        hold_reduced(record, &bench.read(out)?, &reduced(&params, &data, &data));
        Ok(())
    })
}

/// Ways into a field.
fn ways() -> Axis<bool> {
    Axis::new("layers", [("written", false), ("published", true)])
}

/// A march through a uniform medium that scatters the layers of a field.
struct Layered {
    params: MarchParams,
    spec: FieldSpec,
    density: Vec<f32>,
    values: Vec<[f32; 4]>,
    tables: Vec<f32>,
}

impl Layered {
    fn new(dims: [u32; 3], bands: u32) -> Self {
        let spec = FieldSpec::dense(dims, bands * bands, FieldFormat::Rgba);
        let mut params = MarchParams::zeroed();
        params.dims = [8, 6, 10, 0];
        (params.index_x, params.index_y) = ([8.0, 0.0, 0.0, 0.0], [0.0, 6.0, 0.0, 0.0]);
        params.index_z = [0.0, 0.0, 10.0, 0.0];
        params.eye = [-4.0, 2.5, 14.0, 0.0];
        params.forward = [0.7, 0.1, -0.7, 0.0];
        (params.right, params.up) = ([0.4, 0.0, 0.4, 0.0], [0.0, 0.5, 0.0, 0.0]);
        (params.extinction, params.albedo) = ([3.0; 4], [1.0, 0.9, 0.8, 0.0]);
        params.cells = [dims[0], dims[1], dims[2], spec.layers];
        params.cells_per_voxel = [dims[0] as f32 / 8.0, dims[1] as f32 / 6.0, dims[2] as f32 / 10.0, 0.0];
        (params.width, params.height, params.samples) = (19, 11, 1);
        (params.scale, params.full_width, params.full_height) = (1, 19, 11);
        (params.sample_end, params.step_end, params.surface_samples) = (1, March::ALL_STEPS, 1);
        (params.step, params.cut) = (0.1, March::CUT);
        (params.bands, params.trilinear, params.harmonics_at) = (bands, 1, 2);
        let tables = [0.5, 0.5].into_iter().chain(recurrence_table(bands)).collect();
        let values = noise(54, 3 * spec.texels() as usize);
        let values = values.chunks_exact(3).map(|v| [v[0], v[1] - 0.3, v[2], 0.0]).collect();
        Self { params, spec, density: vec![0.3; 8 * 6 * 10], values, tables }
    }

    /// The first four values of each pixel, by the twin.
    fn expected(&self) -> Vec<f64> {
        let inputs = MarchInputs {
            density: &self.density,
            scattering: None,
            emission: None,
            emission_color: None,
            in_scatter: Some(&self.values),
            scattered: None,
            light_depth: None,
            lights: &[],
            tables: &self.tables,
            environment: None,
            surface: None,
            mesh: &[],
            shadow_map: &[],
        };
        let film = reference::march(&self.params, &inputs);
        film.chunks_exact(8).flat_map(|pixel| pixel[..4].to_vec()).collect()
    }

    /// The stage, over a field that is written by the host or published.
    fn stage(&self, bench: &mut Bench, published: bool) -> Result<Stage, Failed> {
        let field = if published {
            let buf = bench.buf(&self.values)?;
            let field = Field { id: bench.id(), spec: self.spec };
            bench.device.create(field.id, &ResourceSpec::Field(field.spec))?;
            bench.device.publish(buf.id, field.id)?;
            field
        } else {
            bench.colors(self.spec.dims, self.spec.layers, &self.values)?
        };
        Ok(Stage::March(March {
            params: self.params,
            density: bench.scalars([8, 6, 10], &self.density)?,
            scattering: None,
            emission: None,
            emission_color: None,
            in_scatter: Some(field),
            scattered: None,
            light_depth: None,
            occupancy: None,
            lights: None,
            tables: bench.buf(&self.tables)?,
            environment: None,
            surface: None,
            mesh: None,
            shadow_map: None,
            paths: None,
            film: bench.room(2 * 19 * 11, Usage::Output)?,
        }))
    }

    /// The same as the twin's, by a device.
    fn found(&self, bench: &mut Bench, published: bool) -> Result<Vec<f32>, Failed> {
        let stage = self.stage(bench, published)?;
        bench.device.dispatch(&stage, 0..stage.axis())?;
        let Stage::March(March { film, .. }) = stage else { unreachable!("a march is planned above") };
        Ok(bench.read(film)?.iter().step_by(2).flatten().copied().collect())
    }
}

fn layers(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let layered = Layered::new([4, 3, 7], 2);
    let expected = layered.expected();
    record.within(record.tolerance().filtered(record.info()), |record| {
        record.each(&sizes(), |record, &narrow| {
            record.each(&ways(), |record, &published| {
                let found = layered.found(&mut bench(subject, narrow)?, published)?;
                record.hold("radiance and alpha", found, expected.iter().copied());
                Ok(())
            })
        })
    })
}

fn many_bands(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let refused = Layered::new([2, 1, 1], SphericalHarmonics::DEVICE_BANDS + 1).stage(&mut bench, false)?;
    let result = bench.device.dispatch(&refused, 0..1);
    check!(matches!(result, Err(DeviceError::Invalid(_) | DeviceError::Limit { .. })), "{result:?}");
    // The device is as good as before.
    let layered = Layered::new([2, 1, 1], SphericalHarmonics::DEVICE_BANDS);
    record.within(record.tolerance().filtered(record.info()), |record| {
        record.hold("ten bands", layered.found(&mut bench, false)?, layered.expected());
        Ok(())
    })
}

/// `relight` of records of so many coefficients of one channel, under light of (2, 4, 8) in each.
fn relight(bench: &mut Bench, records: &[f32], coefficients: u32) -> Result<Relight, Failed> {
    let cells = records.len() / coefficients as usize;
    let params = RelightParams { cells: cells as u32, coefficients, channels: 1, layers: 1, ..RelightParams::zeroed() };
    Ok(Relight {
        params,
        records: bench.buf(records)?,
        emission_records: None,
        light: bench.buf(&vec![[2.0f32, 4.0, 8.0, 0.0]; coefficients as usize])?,
        out: bench.room(cells, Usage::Work)?,
    })
}

fn dispatches(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    // Rows of workgroups are 65,535 long almost everywhere, and a workgroup often takes 64 cells.
    let cells = 65_535 * 64 + 1000;
    let records: Vec<f32> = (0..cells).map(|i| (i % 8191) as f32).collect();
    let mut bench = Bench::new(subject)?;
    let stage = relight(&mut bench, &records, 1)?;
    let out = stage.out;
    bench.device.dispatch(&Stage::Relight(stage), 0..cells - 1)?;
    // Powers of two times small whole numbers are exact; what is past the range stays zero.
    let last = cells as usize - 1;
    let expected = |(i, r): (usize, &f32)| if i < last { [2.0 * r, 4.0 * r, 8.0 * r, 0.0] } else { [0.0; 4] };
    let expected: Vec<[f32; 4]> = records.iter().enumerate().map(expected).collect();
    record.same("every cell", bench.read(out)?.as_flattened(), expected.as_flattened());
    Ok(())
}

fn copies(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let mut values: Vec<f32> = (0..9_000_001).map(|i| (i % 65_521) as f32).collect();
    let buf = bench.buf(&values)?;
    values[5..7].copy_from_slice(&[-1.0, -2.0]);
    bench.device.write(buf.id, 4 * 5, bytemuck::cast_slice(&values[5..7]))?;
    record.same("all", &bench.read(buf)?, &values);
    let mut part = vec![0.0f32; 8_500_000];
    bench.device.read(buf.id, 4 * 4, bytemuck::cast_slice_mut(&mut part))?;
    record.same("from the fifth word on", &part, &values[4..8_500_004]);
    Ok(())
}

fn records(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let coefficients = SphericalHarmonics::DEVICE_BANDS * SphericalHarmonics::DEVICE_BANDS;
    let cells = BINDING as u32 / 4 / coefficients + 1000;
    let records: Vec<f32> = (0..cells * coefficients).map(|i| (i % 127) as f32).collect();
    let mut bench = Bench::new(subject)?;
    let stage = relight(&mut bench, &records, coefficients)?;
    check!(stage.records.bytes() > BINDING, "{} bytes try nothing", stage.records.bytes());
    let out = stage.out;
    bench.device.dispatch(&Stage::Relight(stage), 0..cells)?;
    // Sums of small whole numbers are exact in any order.
    let expected = records.chunks_exact(coefficients as usize).flat_map(|record| {
        let sum: f32 = record.iter().sum();
        [2.0 * sum, 4.0 * sum, 8.0 * sum, 0.0]
    });
    record.same("every cell", bench.read(out)?.as_flattened(), &expected.collect::<Vec<_>>());
    Ok(())
}

fn field(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let dims = [640u32, 480, 116];
    let slice = (dims[0] * dims[1]) as usize;
    let value = |i: usize, k: u32| ((7 * i + 29 * k as usize) % 101) as f32 / 101.0;
    let mut bench = Bench::new(subject)?;
    let density = Field { id: bench.id(), spec: scalars(dims) };
    check!(density.spec.bytes() > BINDING, "{} bytes try nothing", density.spec.bytes());
    bench.device.create(density.id, &ResourceSpec::Field(density.spec))?;
    let mut sums = vec![0.0f64; 80 * 60 * 29];
    for k in 0..dims[2] {
        let values: Vec<f32> = (0..slice).map(|i| value(i, k)).collect();
        bench.device.write(density.id, u64::from(k) * density.spec.slice_bytes(), bytemuck::cast_slice(&values))?;
        for (i, v) in values.iter().enumerate() {
            let (x, y) = (i % 640 / 8, i / 640 / 8);
            sums[(k as usize / 4 * 60 + y) * 80 + x] += f64::from(*v);
        }
    }
    let params = ReduceParams::new([640, 480, 116, 0], [80, 60, 29, 0], [8.0, 8.0, 4.0, 0.0]);
    let out: Buf<[f32; 2]> = bench.room(sums.len(), Usage::Work)?;
    let stage = Stage::Reduce(Reduce { params, density, other: None, out });
    bench.device.dispatch(&stage, 0..stage.axis())?;
    let found = bench.read(out)?;
    record.hold("means", found.iter().map(|v| v[0]), sums.iter().map(|sum| sum / 256.0));
    Ok(())
}
