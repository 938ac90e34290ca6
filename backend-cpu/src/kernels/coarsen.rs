//! `coarsen`: what a medium does to light, as means over the cells of a coarse grid.

use std::ops::Range;

use airlight_core::device::{DeviceError, Field};
use airlight_core::stage::{Coarsen, CoarsenParams};
use rayon::prelude::*;

use super::field::Scalars;
use super::reduce::share;
use crate::Isa;
use crate::columns::{Columns, Rows, filled, inside, spans, tasks, within};
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::simd::Simd;

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
    let mut means = vec![[0.0; PLANES]; range.len()];
    tasks(&mut means, begin, p.cells[0] as usize).into_par_iter().for_each(|(first, out)| {
        let inputs = &inputs;
        compiled_for!(isa, coarsen<S>(inputs: &Inputs<'_>, first: usize, out: &mut [[f32; PLANES]]));
    });
    let out: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    let cells = stage.params.cells[..3].iter().product::<u32>() as usize;
    out.par_chunks_exact_mut(cells).take(PLANES).enumerate().for_each(|(plane, out)| {
        out[begin..begin + means.len()].iter_mut().zip(&means).for_each(|(out, means)| *out = means[plane]);
    });
    Ok(())
}

/// Extinction, albedo and emission of cells of a row, from `first` on.
#[inline(always)]
fn coarsen<S: Simd>(inputs: &Inputs<'_>, first: usize, out: &mut [[f32; PLANES]]) {
    let p = inputs.p;
    let [x, y, ..] = p.cells;
    let first = first as u32;
    // Where colors do not vary, rows of scalars are summed at once.
    let plain = inputs.scattering.is_empty() && inputs.emission_color.is_empty();
    if plain {
        let row = [first % x, first / x % y, first / x / y];
        sums::<S>(p, inputs.density, row, 0, out);
        if let Some(emission) = inputs.emission {
            sums::<S>(p, emission, row, 1, out);
        }
    }
    for (index, out) in (first..).zip(out) {
        let cell = [index % x, index / x % y, index / x / y];
        if plain {
            let [density, emission, ..] = *out;
            let glow = if inputs.emission.is_some() { emission } else { density };
            *out = optics(p, cell, density, [density; 3], [glow; 3]);
        } else {
            *out = colored(inputs, cell);
        }
    }
}

/// The sums over the voxels of cells of a row, each weighed by the part of it that lies in the cell, to place `to` of each.
#[inline(always)]
fn sums<S: Simd>(
    p: &CoarsenParams,
    field: Scalars<'_>,
    [column, j, k]: [u32; 3],
    to: usize,
    out: &mut [[f32; PLANES]],
) {
    let voxels = |a: usize, n: u32| filled(within(p.cell[a], n), p.dims[a]);
    let rows = Rows { voxels: [voxels(1, j), voxels(2, k)], within: [within(p.cell[1], j), within(p.cell[2], k)] };
    let mut columns = Columns::NONE;
    for (cells, span) in spans(out.len(), |n| voxels(0, column + n)) {
        columns.fill::<S>(field, span, &rows);
        for n in cells {
            let cell = column + n as u32;
            out[n][to] += columns.sum::<S>(within(p.cell[0], cell), voxels(0, cell));
        }
    }
}

/// Extinction, albedo and emission of a cell where colors vary.
fn colored(inputs: &Inputs<'_>, cell: [u32; 3]) -> [f32; PLANES] {
    let p = inputs.p;
    let within = [0, 1, 2].map(|a| within(p.cell[a], cell[a]));
    let voxels = [0, 1, 2].map(|a| filled(within[a], p.dims[a]));
    let (mut density, mut scatters, mut shines) = (0.0, [0.0; 3], [0.0; 3]);
    for k in voxels[2][0]..=voxels[2][1] {
        for j in voxels[1][0]..=voxels[1][1] {
            let mut i = voxels[0][0];
            while i <= voxels[0][1] {
                // What holds zero alone adds nothing; only what shines by itself may be where there is no density.
                let mut zeros = inputs.density.empty([i, j, k]);
                if let Some(emission) = inputs.emission {
                    zeros = zeros.min(emission.empty([i, j, k]));
                }
                if zeros > 0 {
                    i += zeros;
                    continue;
                }
                let w = share(within[0], i) * share(within[1], j) * share(within[2], k);
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
    optics(p, cell, density, scatters, shines)
}

/// What sums over a cell make of light in it.
#[inline(always)]
fn optics(p: &CoarsenParams, cell: [u32; 3], density: f32, scatters: [f32; 3], shines: [f32; 3]) -> [f32; PLANES] {
    let [x, y, z] = [0, 1, 2].map(|a| inside(within(p.cell[a], cell[a]), p.dims[a]));
    // A cell holds a part of a voxel at the least, but its sides are rounded.
    let volume = (x * y * z).max(1e-30);
    let on = p.emission[3];
    let mut out = [0.0; PLANES];
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
    out
}
