//! `relight`: in-scattered radiance from records and light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Relight, RelightParams};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, lanes, triple};
use crate::simd::Simd;

/// Cells that one task takes.
const CHUNK: usize = 256;

#[derive(Clone, Copy)]
struct Inputs<'a> {
    p: &'a RelightParams,
    records: &'a [f32],
    emission_records: &'a [f32],
    light: &'a [[f32; 4]],
}

pub(crate) fn run(stage: &Relight, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        records: read.buf(stage.records)?,
        emission_records: read.opt(stage.emission_records)?,
        light: &read.buf(stage.light)?[..p.coefficients as usize],
    };
    let (start, end) = (range.start as usize, range.end as usize);
    let out: &mut [[f32; 4]] = bytemuck::cast_slice_mut(out.remove(0));
    let layers = p.layers as usize;
    out[start * layers..end * layers].par_chunks_mut(CHUNK * layers).enumerate().for_each(|(chunk, out)| {
        let first = start + chunk * CHUNK;
        compiled_for!(isa, relight<S>(inputs: Inputs<'_>, first: usize, out: &mut [[f32; 4]]));
    });
    Ok(())
}

/// The layers of the cells from `first` on.
#[inline(always)]
fn relight<S: Simd>(inputs: Inputs<'_>, first: usize, out: &mut [[f32; 4]]) {
    let p = inputs.p;
    let layers = p.layers as usize;
    for (n, out) in out.chunks_mut(LANES * layers).enumerate() {
        let cells = first + n * LANES..first + n * LANES + out.len() / layers;
        if layers == 1 {
            let mut sum = [F::<S>::ZERO; 3];
            for (k, light) in inputs.light.iter().enumerate() {
                let record = record(inputs, &cells, k);
                sum = triple!(c => sum[c] + record[c] * light[c]);
            }
            let glow = glow(inputs, &cells, 0);
            sum = triple!(c => sum[c] + glow[c] * p.emission_weight);
            lay(&sum, out, 0, 1);
        } else {
            for (layer, light) in inputs.light.iter().enumerate().take(layers) {
                let (record, glow) = (record::<S>(inputs, &cells, layer), glow::<S>(inputs, &cells, layer));
                lay(&triple!(c => (record[c] + glow[c]) * light[c]), out, layer, layers);
            }
        }
    }
}

/// A layer of so many into the cells of a packet.
#[inline(always)]
fn lay<S: Simd>(values: &[F<S>; 3], out: &mut [[f32; 4]], layer: usize, layers: usize) {
    for (i, cell) in out.chunks_exact_mut(layers).enumerate().take(LANES) {
        cell[layer] = [values[0].0[i], values[1].0[i], values[2].0[i], 0.0];
    }
}

/// Coefficient `k` of the records of up to sixteen cells; a record of one channel serves all three.
#[inline(always)]
fn record<S: Simd>(inputs: Inputs<'_>, cells: &Range<usize>, k: usize) -> [F<S>; 3] {
    let p = inputs.p;
    let (channels, all) = (p.channels as usize, p.cells as usize);
    let pitch = if p.planar == 1 { 1 } else { p.coefficients as usize * channels };
    let of = |c: usize| {
        let from = if p.planar == 1 { (k * channels + c) * all } else { k * channels + c };
        strided(&inputs.records[from + cells.start * pitch..], pitch, cells.len())
    };
    let first = of(0);
    if channels == 1 { [first; 3] } else { [first, of(1), of(2)] }
}

/// Coefficient `k` of the moments of the cells' emission.
#[inline(always)]
fn glow<S: Simd>(inputs: Inputs<'_>, cells: &Range<usize>, k: usize) -> [F<S>; 3] {
    let pitch = 3 * inputs.p.emission_coefficients as usize;
    if pitch == 0 {
        return [F::ZERO; 3];
    }
    triple!(c => strided(&inputs.emission_records[3 * k + c + cells.start * pitch..], pitch, cells.len()))
}

/// The first value and each so many behind the one before, `count` of them; in lanes behind those the last one.
#[inline(always)]
fn strided<S: Simd>(values: &[f32], pitch: usize, count: usize) -> F<S> {
    let last = (count - 1) * pitch;
    assert!(last < values.len() && LANES * pitch <= i32::MAX as usize);
    let at = lanes!(i => (i * pitch).min(last) as i32);
    // SAFETY: no offset is larger than the last, which was just checked.
    #[allow(unsafe_code)]
    F::of(unsafe { S::one(values, at) })
}
