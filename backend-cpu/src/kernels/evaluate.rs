//! `evaluate`: what clusters of transfer matrices make of light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Evaluate, EvaluateParams};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, triple};
use crate::simd::Simd;

const _: () = assert!((EvaluateParams::PACK as usize).is_multiple_of(LANES), "rows are whole packets");

/// Rows of matrices that one task takes.
const CHUNK: usize = 64;

struct Inputs<'a> {
    p: &'a EvaluateParams,
    matrices: &'a [f32],
    /// Red, green and blue of all functions.
    light: [&'a [f32]; 3],
    views: &'a [f32],
}

pub(crate) fn run(stage: &Evaluate, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let (planes, functions) = (read.buf(stage.light)?, p.functions as usize);
    let light = [0, 1, 2].map(|c| &planes[c * functions..][..functions]);
    let (matrices, views) = (read.buf(stage.matrices)?, read.opt(stage.views)?);
    let inputs = &Inputs { p, matrices, light, views };
    let (start, end) = (range.start as usize, range.end as usize);
    let out: &mut [[f32; 4]] = bytemuck::cast_slice_mut(out.remove(0));
    let rows = if p.folded == 1 { p.coefficients as usize } else { 1 };
    let chunk = (CHUNK / rows).max(1);
    // Rayon by itself makes a few large tasks, for the last of which a thread would wait.
    out[start..end].par_chunks_mut(chunk).enumerate().with_max_len(1).for_each(|(n, out)| {
        let first = start + n * chunk;
        compiled_for!(isa, evaluate<S>(inputs: &Inputs<'_>, first: usize, out: &mut [[f32; 4]]));
    });
    Ok(())
}

/// Moments from `first` on, or units where folded.
#[inline(always)]
fn evaluate<S: Simd>(inputs: &Inputs<'_>, first: usize, out: &mut [[f32; 4]]) {
    let p = inputs.p;
    for (i, place) in out.iter_mut().enumerate() {
        let index = first + i;
        let mut sum = [0.0; 3];
        if p.folded == 0 {
            sum = moment::<S>(inputs, index);
        } else {
            if p.coefficient_begin > 0 {
                // What the passes before left.
                sum = triple!(c => place[c]);
            }
            let (moments, cluster) = (p.coefficients as usize, index / p.per_cluster as usize);
            for j in p.coefficient_begin as usize..p.coefficient_end as usize {
                let (view, moment) = (inputs.views[cluster * moments + j], moment::<S>(inputs, index * moments + j));
                sum = triple!(c => sum[c] + view * moment[c]);
            }
        }
        *place = [sum[0], sum[1], sum[2], 0.0];
    }
}

/// What a row of the matrices makes of light, sixteen functions at a time.
#[inline(always)]
fn moment<'a, S: Simd>(inputs: &Inputs<'a>, row: usize) -> [f32; 3] {
    let functions = inputs.p.functions as usize;
    let packets = |values: &'a [f32]| values.as_chunks::<LANES>().0;
    let row = packets(&inputs.matrices[row * functions..][..functions]);
    let [red, green, blue] = inputs.light.map(|plane| &packets(plane)[..row.len()]);
    let (mut r, mut g, mut b) = (F::<S>::ZERO, F::<S>::ZERO, F::<S>::ZERO);
    for (n, m) in row.iter().enumerate() {
        let m = F::of(*m);
        r = r + m * F::of(red[n]);
        g = g + m * F::of(green[n]);
        b = b + m * F::of(blue[n]);
    }
    [total(r), total(g), total(b)]
}

/// The sum of the lanes.
#[inline(always)]
fn total<S: Simd>(packet: F<S>) -> f32 {
    let mut sum = 0.0;
    for v in packet.0 {
        sum += v;
    }
    sum
}
