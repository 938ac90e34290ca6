//! `coarsen`: what a medium does to light, as means over the cells of a coarse grid.

use std::ops::Range;

use airlight_core::device::{DeviceError, Field};
use airlight_core::stage::{Coarsen, CoarsenParams};
use rayon::prelude::*;

use super::field::Scalars;
use super::reduce::{row_parts, share};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::F;
use crate::simd::Simd;

/// Cells that one task takes at the least.
const TASK: usize = 16;

const PLANES: usize = Coarsen::PLANES as usize;

struct Inputs<'a> {
    p: &'a CoarsenParams,
    density: Scalars<'a>,
    scattering: &'a [[f32; 4]],
    emission: Option<Scalars<'a>>,
    emission_color: &'a [[f32; 4]],
}

pub(crate) fn run(stage: &Coarsen, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let colors = |field: Option<Field>| -> Result<&[[f32; 4]], DeviceError> {
        Ok(field.map(|field| read.field(field)).transpose()?.map_or(&[], bytemuck::cast_slice))
    };
    let inputs = Inputs {
        p,
        density: read.scalars(stage.density)?,
        scattering: colors(stage.scattering)?,
        emission: match stage.emission {
            Some(field) => Some(read.scalars(field)?),
            None => None,
        },
        emission_color: colors(stage.emission_color)?,
    };
    let begin = range.start as usize;
    let mean = |index: u32| {
        let (inputs, mut means) = (&inputs, [0.0; PLANES]);
        let out = &mut means;
        compiled_for!(isa, coarsen<S>(inputs: &Inputs<'_>, index: u32, out: &mut [f32; PLANES]));
        means
    };
    let means: Vec<[f32; PLANES]> = range.into_par_iter().with_min_len(TASK).map(mean).collect();
    let out: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    let cells = stage.params.cells[..3].iter().product::<u32>() as usize;
    for (plane, out) in out.chunks_exact_mut(cells).take(PLANES).enumerate() {
        out[begin..begin + means.len()].iter_mut().zip(&means).for_each(|(out, means)| *out = means[plane]);
    }
    Ok(())
}

/// The sum over the voxels of a box, each weighed by the part of it that lies between two places.
#[inline(always)]
fn sum<S: Simd>(field: Scalars<'_>, [begin, end]: [[f32; 3]; 2], [lo, hi]: [[u32; 3]; 2]) -> f32 {
    let mut sums = F::<S>::ZERO;
    for k in lo[2]..=hi[2] {
        for j in lo[1]..=hi[1] {
            let weight = share(begin[1], end[1], j) * share(begin[2], end[2], k);
            sums = sums + row_parts::<S>(field, [begin[0], end[0]], [lo[0], hi[0]], [j, k]) * weight;
        }
    }
    sums.total()
}

/// Extinction, albedo and emission of a cell.
#[inline(always)]
fn coarsen<S: Simd>(inputs: &Inputs<'_>, index: u32, out: &mut [f32; PLANES]) {
    let p = inputs.p;
    let [x, y, ..] = p.cells;
    let cell = [index % x, index / x % y, index / x / y];
    let begin = [0, 1, 2].map(|a| cell[a] as f32 * p.cell[a]);
    let end = [0, 1, 2].map(|a| (cell[a] + 1) as f32 * p.cell[a]);
    let lo = [0, 1, 2].map(|a| (begin[a].floor() as u32).min(p.dims[a] - 1));
    let hi = [0, 1, 2].map(|a| (end[a].ceil() as u32).clamp(1, p.dims[a]) - 1);
    let (mut density, mut scatters, mut shines) = (0.0, [0.0; 3], [0.0; 3]);
    // Where colors do not vary, rows of scalars are summed at once.
    let plain = inputs.scattering.is_empty() && inputs.emission_color.is_empty();
    if plain {
        density = sum::<S>(inputs.density, [begin, end], [lo, hi]);
        let glow = inputs.emission.map_or(density, |emission| sum::<S>(emission, [begin, end], [lo, hi]));
        (scatters, shines) = ([density; 3], [glow; 3]);
    }
    for k in (lo[2]..=hi[2]).filter(|_| !plain) {
        for j in lo[1]..=hi[1] {
            let mut i = lo[0];
            while i <= hi[0] {
                // What holds zero alone adds nothing; only what shines by itself may be where there is no density.
                let mut zeros = inputs.density.empty([i, j, k]);
                if let Some(emission) = inputs.emission {
                    zeros = zeros.min(emission.empty([i, j, k]));
                }
                if zeros > 0 {
                    i += zeros;
                    continue;
                }
                let w = share(begin[0], end[0], i) * share(begin[1], end[1], j) * share(begin[2], end[2], k);
                let rho = inputs.density.texel([i, j, k]);
                let n = ((k * p.dims[1] + j) * p.dims[0] + i) as usize;
                let [mut own, mut glow] = [[rho; 3]; 2];
                if let Some(scattering) = inputs.scattering.get(n) {
                    own.copy_from_slice(&scattering[..3]);
                }
                if let Some(color) = inputs.emission_color.get(n) {
                    glow.copy_from_slice(&color[..3]);
                } else if let Some(emission) = inputs.emission {
                    glow = [emission.texel([i, j, k]); 3];
                }
                density += w * rho;
                scatters = [0, 1, 2].map(|c| scatters[c] + w * own[c]);
                shines = [0, 1, 2].map(|c| shines[c] + w * glow[c]);
                i += 1;
            }
        }
    }
    let [x, y, z] = [0, 1, 2].map(|a| (end[a].min(p.dims[a] as f32) - begin[a]).max(0.0));
    // A cell holds a part of a voxel at the least, but its sides are rounded.
    let volume = (x * y * z).max(1e-30);
    let on = p.emission[3];
    for c in 0..3 {
        let scattering = scatters[c] / volume * p.extinction[c] * p.albedo[c];
        let extinction = (density / volume * p.extinction[c] - on * scattering).max(0.0);
        out[c] = extinction;
        out[3 + c] = if extinction > 0.0 {
            (1.0 - on) * scattering / extinction
        } else {
            (1.0 - on) * p.albedo[c] / (1.0 - on * p.albedo[c])
        };
        out[6 + c] = shines[c] / volume * p.emission[c];
    }
}
