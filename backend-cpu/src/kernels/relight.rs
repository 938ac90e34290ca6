//! `relight`: in-scattered radiance from records and light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::Relight;
use rayon::prelude::*;

use crate::device::Memory;

/// Cells that one task takes.
const CHUNK: usize = 256;

pub(crate) fn run(stage: &Relight, range: Range<u32>, memory: &mut Memory<'_>) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let (coefficients, channels) = (p.coefficients as usize, p.channels as usize);
    let emission = p.emission_coefficients as usize;
    let light = &read.buf(stage.light)?[..coefficients];
    let records = read.buf(stage.records)?;
    let emitted = read.opt(stage.emission_records)?;
    // A record of one channel serves all three.
    let channel = [0, 1, 2].map(|c| if channels == 3 { c } else { 0 });
    let record = |cell: usize, k: usize, c: usize| records[(cell * coefficients + k) * channels + channel[c]];
    let glow =
        |cell: usize, k: usize, c: usize| if emission > 0 { emitted[(cell * emission + k) * 3 + c] } else { 0.0 };
    let (start, end) = (range.start as usize, range.end as usize);
    let out: &mut [[f32; 4]] = bytemuck::cast_slice_mut(out.remove(0));
    let layers = p.layers as usize;
    out[start * layers..end * layers].par_chunks_mut(CHUNK * layers).enumerate().for_each(|(chunk, out)| {
        for (i, out) in out.chunks_exact_mut(layers).enumerate() {
            let cell = start + chunk * CHUNK + i;
            for (layer, place) in out.iter_mut().enumerate() {
                for c in 0..3 {
                    place[c] = if p.layers == 1 {
                        let mut sum = 0.0;
                        for k in 0..coefficients {
                            sum += light[k][c] * record(cell, k, c);
                        }
                        sum + p.emission_weight * glow(cell, 0, c)
                    } else {
                        light[layer][c] * (record(cell, layer, c) + glow(cell, layer, c))
                    };
                }
            }
        }
    });
    Ok(())
}
