//! `classify`: what the values of a grid mean.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Classify, ClassifyParams, ControlRecord, classify_kind};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, lanes, triple};
use crate::simd::Simd;

const PACK: usize = Classify::PACK as usize;

struct Inputs<'a> {
    p: &'a ClassifyParams,
    points: &'a [ControlRecord],
}

/// Sixteen control points.
struct Points<S> {
    density: F<S>,
    first: [F<S>; 3],
    second: [F<S>; 3],
}

pub(crate) fn run(stage: &Classify, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs { p, points: &read.buf(stage.points)?[..p.count as usize] };
    let [x, y, z] = [0, 1, 2].map(|a| p.dims[a] as usize);
    let (slice, channels) = (x * y, p.channels() as usize);
    let packs = slice.div_ceil(PACK);
    let out: &mut [f32] = &mut bytemuck::cast_slice_mut(out.remove(0))[..slice * z * channels];
    let slices = read.field(stage.values)?.par_chunks(slice).zip(out.par_chunks_mut(slice * channels));
    slices.enumerate().for_each(|(z, (values, out))| {
        let first = z * packs;
        let own = (range.start as usize).clamp(first, first + packs) - first
            ..(range.end as usize).clamp(first, first + packs) - first;
        let voxels = own.start * PACK..(own.end * PACK).min(slice);
        if !voxels.is_empty() {
            let (inputs, values) = (&inputs, &values[voxels.clone()]);
            let out = &mut out[voxels.start * channels..voxels.end * channels];
            compiled_for!(isa, classify<S>(inputs: &Inputs<'_>, values: &[f32], out: &mut [f32]));
        }
    });
    Ok(())
}

/// Voxels of a slice, one behind the other.
#[inline(always)]
fn classify<S: Simd>(inputs: &Inputs<'_>, values: &[f32], out: &mut [f32]) {
    let (kind, channels) = (inputs.p.dims[3], inputs.p.channels() as usize);
    for (values, out) in values.chunks(LANES).zip(out.chunks_mut(LANES * channels)) {
        let p = point::<S>(inputs, F::of(lanes!(i => values[i.min(values.len() - 1)])));
        if channels == 1 {
            let reach = p.first[0].max(p.first[1]).max(p.first[2]);
            let found = if kind == classify_kind::REACH { reach } else { p.density };
            out.copy_from_slice(&found.0[..out.len()]);
            continue;
        }
        let found = color(inputs, &p);
        for (i, voxel) in out.chunks_exact_mut(4).enumerate() {
            voxel.copy_from_slice(&[found[0].0[i], found[1].0[i], found[2].0[i], 0.0]);
        }
    }
}

/// What the control points say of values: linear between two, constant beyond the first and the last.
#[inline(always)]
fn point<S: Simd>(inputs: &Inputs<'_>, value: F<S>) -> Points<S> {
    let last = inputs.points.len() - 1;
    let mut below = [0usize; LANES];
    for point in inputs.points {
        for (below, value) in below.iter_mut().zip(&value.0) {
            *below += usize::from(point.place[0] <= *value);
        }
    }
    let a = |i: usize| &inputs.points[below[i].max(1) - 1];
    let b = |i: usize| &inputs.points[below[i].min(last)];
    let width = F::of(lanes!(i => b(i).place[0] - a(i).place[0]));
    // Beyond the ends both are one point, and between them never.
    let f = width.gt(F::ZERO).select((value - F::of(lanes!(i => a(i).place[0]))) / width, F::ZERO);
    let mixed = |a: F<S>, b: F<S>| a + (b - a) * f;
    Points {
        density: mixed(F::of(lanes!(i => a(i).place[1])), F::of(lanes!(i => b(i).place[1]))),
        first: triple!(c => mixed(F::of(lanes!(i => a(i).first[c])), F::of(lanes!(i => b(i).first[c])))),
        second: triple!(c => mixed(F::of(lanes!(i => a(i).second[c])), F::of(lanes!(i => b(i).second[c])))),
    }
}

/// The colours of a kind that has some.
#[inline(always)]
fn color<S: Simd>(inputs: &Inputs<'_>, p: &Points<S>) -> [F<S>; 3] {
    if inputs.p.dims[3] == classify_kind::COLOR {
        return p.first;
    }
    let scatters = triple!(c => p.density * p.first[c]);
    if inputs.p.dims[3] == classify_kind::SCATTERING {
        return scatters;
    }
    triple!(c => scatters[c] * p.second[c])
}
