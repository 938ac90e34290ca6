//! `relight`: in-scattered radiance from records and light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Relight, RelightParams};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, I, LANES, lanes, together, triple};
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
    let record_pitch = if p.planar == 1 { 1 } else { (p.coefficients * p.channels) as usize };
    for (n, out) in out.chunks_mut(LANES * layers).enumerate() {
        let (first, count) = (first + n * LANES, out.len() / layers);
        let cells = Cells::<S>::new(first, count, record_pitch);
        let glowing = Cells::<S>::new(first, count, 3 * p.emission_coefficients as usize);
        if layers == 1 {
            let mut sum = [F::ZERO; 3];
            // Two loops: where what was loaded once and what was loaded for each channel meet, compilers keep lanes, not registers.
            if p.channels == 1 {
                for (k, light) in inputs.light.iter().enumerate() {
                    let record = record(inputs, &cells, k, 0);
                    sum = triple!(c => sum[c] + record * light[c]);
                }
            } else {
                for (k, light) in inputs.light.iter().enumerate() {
                    sum = triple!(c => sum[c] + record(inputs, &cells, k, c) * light[c]);
                }
            }
            let glow = glow(inputs, &glowing, 0);
            sum = triple!(c => sum[c] + glow[c] * p.emission_weight);
            let vectors = together([sum[0], sum[1], sum[2], F::ZERO]);
            match out.as_mut_array::<LANES>() {
                Some(out) => *out = vectors,
                None => out.copy_from_slice(&vectors[..count]),
            }
        } else {
            for (layer, light) in inputs.light.iter().enumerate().take(layers) {
                let glow = glow(inputs, &glowing, layer);
                let values = triple!(c => (record(inputs, &cells, layer, c) + glow[c]) * light[c]);
                lay(&values, out, layer, layers);
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

/// Coefficient `k` of the records of up to sixteen cells, of a channel; a record of one channel serves all three.
#[inline(always)]
fn record<S: Simd>(inputs: Inputs<'_>, cells: &Cells<S>, k: usize, channel: usize) -> F<S> {
    let p = inputs.p;
    let (channels, plane) = (p.channels as usize, if p.planar == 1 { p.cells as usize } else { 1 });
    cells.values(inputs.records, (k * channels + channel.min(channels - 1)) * plane)
}

/// Coefficient `k` of the moments of the cells' emission.
#[inline(always)]
fn glow<S: Simd>(inputs: Inputs<'_>, cells: &Cells<S>, k: usize) -> [F<S>; 3] {
    if inputs.p.emission_coefficients == 0 {
        return [F::ZERO; 3];
    }
    triple!(c => cells.values(inputs.emission_records, 3 * k + c))
}

/// Where up to sixteen cells have what lies so many floats behind that of the cell before.
struct Cells<S> {
    first: usize,
    /// From the first cell to each; in lanes behind the last cell that one.
    at: I<S>,
    /// From the first cell to the last.
    last: usize,
    /// Whether cells lie one behind the other.
    run: bool,
}

impl<S: Simd> Cells<S> {
    #[inline(always)]
    fn new(first: usize, count: usize, pitch: usize) -> Self {
        let last = (count - 1) * pitch;
        assert!(LANES * pitch <= i32::MAX as usize);
        Self { first: first * pitch, at: I::of(lanes!(i => (i * pitch).min(last) as i32)), last, run: pitch == 1 }
    }

    /// The values of the cells, of which that of cell 0 lies at `from`.
    #[inline(always)]
    fn values(&self, values: &[f32], from: usize) -> F<S> {
        let values = &values[from + self.first..];
        if self.run
            && let Some(run) = values.first_chunk::<LANES>()
        {
            return F::of(*run);
        }
        assert!(self.last < values.len());
        // SAFETY: no offset is larger than the last, which was just checked.
        #[allow(unsafe_code)]
        F::of(unsafe { S::one(values, self.at.0) })
    }
}
