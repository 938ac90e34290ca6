//! `classify`: what the values of a grid mean.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Classify, ClassifyParams, ControlRecord, classify_kind};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, I, LANES, lanes, lerp, together, triple};
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
        let [r, g, b] = color(inputs, &p);
        let found = together([r, g, b, F::ZERO]);
        match <&mut [f32; 4 * LANES]>::try_from(&mut *out) {
            Ok(whole) => *whole = bytemuck::cast(found),
            Err(_) => out.copy_from_slice(&bytemuck::cast_slice(&found)[..out.len()]),
        }
    }
}

/// What the control points say of values: linear between two, constant beyond the first and the last.
#[inline(always)]
fn point<S: Simd>(inputs: &Inputs<'_>, value: F<S>) -> Points<S> {
    let last = F::splat((inputs.points.len() - 1) as f32);
    let mut below = F::ZERO;
    for point in inputs.points {
        below = below + value.ge(F::splat(point.place[0])).select(F::ONE, F::ZERO);
    }
    // A value, a density, a first colour from the fourth float on and a second from the eighth.
    let floats: &[f32] = bytemuck::cast_slice(inputs.points);
    let record = (size_of::<ControlRecord>() / size_of::<f32>()) as i32;
    let a = (below.max(F::ONE) - 1.0).to_int().times(record);
    let b = below.min(last).to_int().times(record);
    let ([start, low], [end, high]) = (pair(floats, a, 0), pair(floats, b, 0));
    let width = end - start;
    // Beyond the ends both are one point, and between them never.
    let f = width.gt(F::ZERO).select((value - start) / width, F::ZERO);
    let colored = inputs.p.dims[3] != classify_kind::DENSITY;
    let seen = inputs.p.dims[3] == classify_kind::SEEN;
    Points {
        density: lerp(low, high, f),
        first: if colored { mixed(floats, [a, b], 4, f) } else { [F::ZERO; 3] },
        second: if seen { mixed(floats, [a, b], 8, f) } else { [F::ZERO; 3] },
    }
}

/// A number of a point, whose first float lies at `at`, and the one behind it.
#[inline(always)]
fn pair<S: Simd>(floats: &[f32], at: I<S>, n: i32) -> [F<S>; 2] {
    // SAFETY: `point` and `mixed` alone call this, for points that there are and numbers of which each of them has four.
    #[allow(unsafe_code)]
    let [a, b] = unsafe { S::two(floats, at.plus(I::splat(n)).0) };
    [F::of(a), F::of(b)]
}

/// Three numbers of a point, between two points.
#[inline(always)]
fn mixed<S: Simd>(floats: &[f32], [a, b]: [I<S>; 2], n: i32, f: F<S>) -> [F<S>; 3] {
    let ([r, g], [s, h]) = (pair(floats, a, n), pair(floats, b, n));
    let ([k, _], [l, _]) = (pair(floats, a, n + 2), pair(floats, b, n + 2));
    [lerp(r, s, f), lerp(g, h, f), lerp(k, l, f)]
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
