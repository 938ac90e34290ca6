//! `relight`: in-scattered radiance from records and light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Relight, RelightParams};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::triple;

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
        compiled_for!(isa, relight(inputs: Inputs<'_>, first: usize, out: &mut [[f32; 4]]));
    });
    Ok(())
}

/// The layers of the cells from `first` on.
#[inline(always)]
fn relight(inputs: Inputs<'_>, first: usize, out: &mut [[f32; 4]]) {
    let p = inputs.p;
    for (i, place) in out.iter_mut().enumerate() {
        let (cell, layer) = (first + i / p.layers as usize, i % p.layers as usize);
        let mut sum = [0.0; 3];
        if p.layers == 1 {
            for (k, light) in inputs.light.iter().enumerate() {
                let record = record(inputs, cell, k);
                sum = triple!(c => sum[c] + light[c] * record[c]);
            }
            let glow = glow(inputs, cell, 0);
            sum = triple!(c => sum[c] + p.emission_weight * glow[c]);
        } else {
            let (record, glow) = (record(inputs, cell, layer), glow(inputs, cell, layer));
            sum = triple!(c => inputs.light[layer][c] * (record[c] + glow[c]));
        }
        *place = [sum[0], sum[1], sum[2], 0.0];
    }
}

/// Coefficient `k` of a cell's record; a record of one channel serves all three.
#[inline(always)]
fn record(inputs: Inputs<'_>, cell: usize, k: usize) -> [f32; 3] {
    let channels = inputs.p.channels as usize;
    let (first, pitch) = if inputs.p.planar == 1 {
        let cells = inputs.p.cells as usize;
        (k * channels * cells + cell, cells)
    } else {
        ((cell * inputs.p.coefficients as usize + k) * channels, 1)
    };
    triple!(c => inputs.records[first + c.min(channels - 1) * pitch])
}

/// Coefficient `k` of the emission's moments.
#[inline(always)]
fn glow(inputs: Inputs<'_>, cell: usize, k: usize) -> [f32; 3] {
    if inputs.p.emission_coefficients == 0 {
        return [0.0; 3];
    }
    let at = cell * inputs.p.emission_coefficients as usize + k;
    triple!(c => inputs.emission_records[3 * at + c])
}
