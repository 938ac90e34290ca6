//! `project`: records of directional light at the cells of a coarse grid.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Project, ProjectParams};
use rayon::prelude::*;

use super::field::{Colors, Scalars};
use super::phase::{Phase, phase};
use super::sample::Ray;
use super::segment::segment;
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, dot, lanes, triple};
use crate::simd::{Floats, Simd};

/// Cells that one task takes: enough to fill packets between empty ones.
const CHUNK: usize = 16 * LANES;

struct Inputs<'a> {
    p: &'a ProjectParams,
    density: Scalars<'a>,
    emission: Scalars<'a>,
    emission_color: Option<Colors<'a>>,
    directions: &'a [[f32; 4]],
    weights: &'a [f32],
    emission_weights: &'a [f32],
    phase: Phase<'a>,
}

pub(crate) fn run(stage: &Project, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.records)?;
    if let Some(buf) = stage.emission_records {
        memory.take(buf)?;
    }
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let density = read.scalars(stage.density)?;
    let inputs = Inputs {
        p,
        density,
        emission: match stage.emission {
            Some(field) => read.scalars(field)?,
            None => density,
        },
        emission_color: match stage.emission_color {
            Some(field) => {
                let [x, y, z, _] = p.dims;
                Some(Colors::new(bytemuck::cast_slice(read.field(field)?), [x, y, z, 1]))
            }
            None => None,
        },
        directions: &read.buf(stage.directions)?[..p.direction_end as usize],
        weights: read.buf(stage.weights)?,
        emission_weights: read.opt(stage.emission_weights)?,
        phase: Phase { kind: p.phase_kind, lobes: p.phase, table: read.opt(stage.phase_table)? },
    };
    let occupancy = read.opt(stage.occupancy)?;
    let stride = (p.coefficients * p.record_channels()) as usize;
    let emission_stride = p.emission_coefficients as usize * 3;
    let (start, end) = (range.start as usize, range.end as usize);
    let records: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    let records = &mut records[start * stride..end * stride];
    let mut none = [];
    let emitted: &mut [f32] = match out.pop() {
        Some(bytes) => &mut bytemuck::cast_slice_mut(bytes)[start * emission_stride..end * emission_stride],
        None => &mut none,
    };
    let chunk = |n: usize| (CHUNK * n).max(1);
    // Without emission there is nothing to write, but each task still takes its (empty) part.
    let mut emitted: Vec<&mut [f32]> = emitted.chunks_mut(chunk(emission_stride)).collect();
    emitted.resize_with((end - start).div_ceil(CHUNK), Default::default);
    records.par_chunks_mut(chunk(stride)).zip(emitted).enumerate().for_each(|(n, (records, emitted))| {
        if p.direction_begin == 0 {
            records.fill(0.0);
            emitted.fill(0.0);
        }
        let first = start + n * CHUNK;
        let cells = records.len() / stride;
        let occupied = |i: &usize| occupancy.is_empty() || occupancy[first + i][1] > 0.0;
        let mut places = (0..cells).filter(occupied);
        let mut sums = vec![[0.0; LANES]; stride + emission_stride];
        loop {
            // Lanes past the last cell repeat it and are not stored.
            let mut lane = [usize::MAX; LANES];
            let count = lane.iter_mut().zip(&mut places).map(|(lane, place)| *lane = place).count();
            if count == 0 {
                break;
            }
            let last = lane[count - 1];
            lane[count..].fill(last);
            let cells = lane.map(|i| first + i);
            // The sums of the passes before.
            let (record, glow) = sums.split_at_mut(stride);
            record.iter_mut().enumerate().for_each(|(v, sum)| *sum = lane.map(|i| records[i * stride + v]));
            let place = |i: usize, v: usize| i * emission_stride + v;
            glow.iter_mut().enumerate().for_each(|(v, sum)| *sum = lane.map(|i| emitted[place(i, v)]));
            let (inputs, sums) = (&inputs, &mut sums[..]);
            compiled_for!(isa, project<S>(inputs: &Inputs<'_>, cells: [usize; LANES], sums: &mut [Floats]));
            for (i, &place) in lane[..count].iter().enumerate() {
                let (record, glow) = sums.split_at(stride);
                let to = &mut records[place * stride..][..stride];
                to.iter_mut().zip(record).for_each(|(to, sum)| *to = sum[i]);
                if emission_stride > 0 {
                    let to = &mut emitted[place * emission_stride..][..emission_stride];
                    to.iter_mut().zip(glow).for_each(|(to, sum)| *to = sum[i]);
                }
            }
        }
    });
    Ok(())
}

/// Sixteen cells: adds the directions of this pass to their sums, records first, then the emission's moments.
#[inline(always)]
fn project<S: Simd>(inputs: &Inputs<'_>, cells: [usize; LANES], sums: &mut [Floats]) {
    let p = inputs.p;
    let [nx, ny, _, _] = p.cells.map(|n| n as usize);
    let x = F::of(lanes!(i => (cells[i] % nx) as f32));
    let y = F::of(lanes!(i => (cells[i] / nx % ny) as f32));
    let z = F::of(lanes!(i => (cells[i] / nx / ny) as f32));
    let origin = triple!(a => [x, y, z][a] * p.cell[a] + (0.5 * p.cell[a] - 0.5));
    let view = view_direction(p, origin);
    let (record, emission_record) = sums.split_at_mut((p.coefficients * p.record_channels()) as usize);
    for n in p.direction_begin as usize..p.direction_end as usize {
        let (transmittance, glow) = gather::<S>(inputs, origin, view, inputs.directions[n]);
        sum_record(inputs, record, n, transmittance);
        sum_glow(inputs, emission_record, n, glow);
    }
}

/// Marches along a direction: transmittance, and light that the medium sends.
#[inline(always)]
fn gather<S: Simd>(
    inputs: &Inputs<'_>,
    origin: [F<S>; 3],
    view: [F<S>; 3],
    direction: [f32; 4],
) -> ([F<S>; 3], [F<S>; 3]) {
    let p = inputs.p;
    let rows = [&p.index_x, &p.index_y, &p.index_z];
    let index = triple!(a => {
        F::splat(rows[a][0] * direction[0] + rows[a][1] * direction[1] + rows[a][2] * direction[2])
    });
    let ray = Ray::through(origin, index, inputs.density.size(), F::splat(f32::INFINITY), p.cell[3]);
    let mut glow = [F::ZERO; 3];
    let mut transmittance = if p.emission_coefficients > 0 {
        emission_along::<S>(inputs, &ray, &mut glow)
    } else {
        let (column, sigma) = (ray.column(inputs.density, None, M::ALL), extinction(p));
        let first = (column * -sigma[0]).exp_negative();
        if p.channels == 1 { [first; 3] } else { triple!(c => (column * -sigma[c]).exp_negative()) }
    };
    if p.toward_eye == 1 {
        let world = triple!(a => F::splat(direction[a]));
        let value = phase(&inputs.phase, dot(world, view));
        transmittance = triple!(c => transmittance[c] * value);
        glow = triple!(c => glow[c] * value);
    }
    (transmittance, glow)
}

/// Extinction of the three channels; where one channel serves, the first counts.
#[inline(always)]
fn extinction(p: &ProjectParams) -> [f32; 3] {
    triple!(c => p.extinction[if p.channels == 3 { c } else { 0 }])
}

/// Adds direction `n` to every value of the record.
#[inline(always)]
fn sum_record<S: Simd>(inputs: &Inputs<'_>, record: &mut [Floats], n: usize, transmittance: [F<S>; 3]) {
    let p = inputs.p;
    let (coefficients, weight_channels) = (p.coefficients as usize, p.weight_channels as usize);
    let weights = &inputs.weights[n * coefficients * weight_channels..][..coefficients * weight_channels];
    if p.channels == 1 {
        for (sum, &w) in record.iter_mut().zip(weights) {
            *sum = (F::of(*sum) + transmittance[0] * w).0;
        }
        return;
    }
    for k in 0..coefficients {
        triple!(c => {
            let w = weights[k * weight_channels + if weight_channels == 3 { c } else { 0 }];
            record[k * 3 + c] = (F::of(record[k * 3 + c]) + transmittance[c] * w).0;
        });
    }
}

/// Adds direction `n` to every value of the emission's moments.
#[inline(always)]
fn sum_glow<S: Simd>(inputs: &Inputs<'_>, record: &mut [Floats], n: usize, glow: [F<S>; 3]) {
    let coefficients = inputs.p.emission_coefficients as usize;
    for k in 0..coefficients {
        let w = inputs.emission_weights[n * coefficients + k];
        triple!(c => record[k * 3 + c] = (F::of(record[k * 3 + c]) + glow[c] * w).0);
    }
}

/// Unit direction in the world from the eye to each point of index space.
#[inline(always)]
fn view_direction<S: Simd>(p: &ProjectParams, at: [F<S>; 3]) -> [F<S>; 3] {
    let v = triple!(a => at[a] - p.eye[a]);
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    let w = triple!(a => v[0] * rows[a][0] + v[1] * rows[a][1] + v[2] * rows[a][2]);
    // A cell at the eye has no direction; any will do.
    let length = dot(w, w).sqrt().max(F::splat(f32::MIN_POSITIVE));
    triple!(a => w[a] / length)
}

/// Radiance that the medium sends along the ray to its origin, and the ray's transmittance.
#[inline(always)]
fn emission_along<S: Simd>(inputs: &Inputs<'_>, ray: &Ray<S>, glow: &mut [F<S>; 3]) -> [F<S>; 3] {
    let (p, sigma) = (inputs.p, extinction(inputs.p));
    let mut transmittance = [F::ONE; 3];
    let last = ray.steps.max_lane();
    let mut k = 0.0;
    while k < last {
        let active = F::splat(k).lt(ray.steps);
        let at = ray.along(ray.middle(k));
        let density = active.select(inputs.density.sample::<S>(at), F::ZERO);
        let source = match inputs.emission_color {
            Some(color) => color.packet(at, active),
            None => [active.select(inputs.emission.sample::<S>(at), F::ZERO); 3],
        };
        triple!(c => {
            let (e, mean) = segment(density * ray.step * sigma[c]);
            glow[c] = glow[c] + transmittance[c] * ray.step * mean * (source[c] * p.emission[c]);
            transmittance[c] = transmittance[c] * e;
        });
        k += 1.0;
    }
    transmittance
}
