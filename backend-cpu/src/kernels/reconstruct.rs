//! `reconstruct`: in-scattered radiance from what clusters of transfer matrices make of light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Reconstruct, ReconstructParams};
use rayon::prelude::*;

use super::harmonics::{self, harmonics};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, dot, lanes, triple};
use crate::simd::{Floats, Simd};

/// Cells that one task takes.
const CHUNK: usize = 64 * LANES;

/// Values of a moment: RGBA.
const WIDTH: usize = 4;
/// All bits of the colors of RGBA.
const COLOR: [u32; WIDTH] = [u32::MAX, u32::MAX, u32::MAX, 0];
/// Moments of a packet.
const FOUR: usize = LANES / WIDTH;

struct Inputs<'a> {
    p: &'a ReconstructParams,
    rows: &'a [u32],
    clusters: &'a [u32],
    weights: &'a [f32],
    /// RGBA, flat.
    radiance: &'a [f32],
    /// The phase function's moments, four at a time, each for RGBA; zero past the last.
    beta: &'a [Floats],
    /// Constants of spherical harmonics.
    constants: &'a [f32],
    /// The bits that are kept of RGBA: all of the colors. Not a constant, for which the compiler would take a sum of four apart into
    /// what is needed of it.
    color: [u32; WIDTH],
}

/// A row in a channel: the moments of its cluster's mean and components, and what it weighs the components.
struct Row<'a> {
    radiance: &'a [f32],
    weights: &'a [f32],
}

pub(crate) fn run(
    stage: &Reconstruct,
    range: Range<u32>,
    memory: &mut Memory<'_>,
    isa: Isa,
) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let (beta, constants) = read.buf(stage.tables)?.split_at(p.coefficients() as usize);
    let weight = |j: usize| beta.get(j).copied().unwrap_or(0.0);
    let beta: Vec<Floats> = (0..beta.len().div_ceil(FOUR)).map(|n| lanes!(l => weight(n * FOUR + l / WIDTH))).collect();
    let (rows, clusters) = (read.buf(stage.rows)?, read.buf(stage.clusters)?);
    let (weights, radiance) = (read.opt(stage.weights)?, bytemuck::cast_slice(read.buf(stage.radiance)?));
    let inputs = &Inputs { p, rows, clusters, weights, radiance, beta: &beta, constants, color: COLOR };
    let (start, end, values) = (range.start as usize, range.end as usize, p.layers() as usize * WIDTH);
    let out: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    out[start * values..end * values].par_chunks_mut(CHUNK * values).enumerate().for_each(|(n, out)| {
        let first = start + n * CHUNK;
        compiled_for!(isa, reconstruct<S>(inputs: &Inputs<'_>, first: usize, out: &mut [f32]));
    });
    Ok(())
}

/// The layers of the cells from `first` on.
#[inline(always)]
fn reconstruct<S: Simd>(inputs: &Inputs<'_>, first: usize, out: &mut [f32]) {
    let p = inputs.p;
    let (values, moments) = (p.layers() as usize * WIDTH, p.coefficients() as usize);
    if p.view == 0 && moments == 1 {
        return match p.channels {
            3 => singles::<3>(inputs, first, out),
            _ => singles::<1>(inputs, first, out),
        };
    }
    let color = M::of(lanes!(i => COLOR[i % WIDTH]));
    let mut basis = [F::<S>::ZERO; harmonics::MAX];
    for (n, out) in out.chunks_mut(LANES * values).enumerate() {
        let cell = first + n * LANES;
        let rows = &inputs.rows[cell..][..out.len() / values];
        if p.view == 1 && rows.iter().any(|row| *row > 0) {
            harmonics(inputs.constants, p.bands as usize, view_direction(p, cell), &mut basis);
        }
        for (i, (&place, out)) in rows.iter().zip(out.chunks_exact_mut(values)).enumerate() {
            if place == 0 {
                out.fill(0.0);
                continue;
            }
            let place = place.min(p.rows) as usize - 1;
            let red = row(inputs, moments, 0, place);
            let others = if p.channels == 3 {
                Some([row(inputs, moments, 1, place), row(inputs, moments, 2, place)])
            } else {
                None
            };
            let mut sum = F::<S>::ZERO;
            for (n, &beta) in inputs.beta.iter().enumerate() {
                let j = n * FOUR;
                let light = color.select(arriving(moments, &red, &others, j), F::ZERO) * F::of(beta);
                if p.view == 1 {
                    // Past the last moment all light is zero.
                    sum = sum + light * F::of(lanes!(l => basis[(j + l / WIDTH).min(harmonics::MAX - 1)].0[i]));
                } else {
                    let to = &mut out[j * WIDTH..];
                    match to.first_chunk_mut::<LANES>() {
                        Some(all) => *all = light.0,
                        None => to[..WIDTH].copy_from_slice(&light.0[..WIDTH]),
                    }
                }
            }
            if p.view == 1 {
                for (c, to) in out.iter_mut().enumerate() {
                    *to = sum.0[c] + sum.0[WIDTH + c] + sum.0[2 * WIDTH + c] + sum.0[3 * WIDTH + c];
                }
            }
        }
    }
}

/// The layer of the cells from `first` on where light has one moment: a register of four, of which a packet would be a quarter.
#[inline(always)]
fn singles<const CHANNELS: u32>(inputs: &Inputs<'_>, first: usize, out: &mut [f32]) {
    let beta = inputs.beta[0][0];
    let (out, _) = out.as_chunks_mut::<WIDTH>();
    for (&place, out) in inputs.rows[first..].iter().zip(out) {
        if place == 0 {
            *out = [0.0; WIDTH];
            continue;
        }
        let place = place.min(inputs.p.rows) as usize - 1;
        let light = match CHANNELS {
            3 => [single(inputs, 0, place)[0], single(inputs, 1, place)[1], single(inputs, 2, place)[2], 0.0],
            _ => single(inputs, 0, place),
        };
        for c in 0..WIDTH {
            out[c] = f32::from_bits((light[c] * beta).to_bits() & inputs.color[c]);
        }
    }
}

/// The one moment of a row in a channel: its cluster's mean, and what it weighs the components.
#[inline(always)]
fn single(inputs: &Inputs<'_>, channel: usize, place: usize) -> [f32; WIDTH] {
    let row = row(inputs, 1, channel, place);
    let (values, _) = row.radiance.as_chunks::<WIDTH>();
    let mut sum = values[0];
    for (value, weight) in values[1..].iter().zip(row.weights) {
        for c in 0..WIDTH {
            sum[c] += value[c] * weight;
        }
    }
    sum
}

/// Where a row's values lie in a channel.
#[inline(always)]
fn row<'a>(inputs: &Inputs<'a>, moments: usize, channel: usize, row: usize) -> Row<'a> {
    let p = inputs.p;
    let components = p.components as usize;
    let place = channel * p.rows as usize + row;
    let cluster = inputs.clusters[place].min(p.clusters - 1) as usize;
    let values = (1 + components) * moments * WIDTH;
    Row {
        radiance: &inputs.radiance[(channel * p.clusters as usize + cluster) * values..][..values],
        weights: &inputs.weights[place * components..][..components],
    }
}

/// Four moments of a row from `j` on; a channel serves all of RGB, or each its own component.
#[inline(always)]
fn arriving<S: Simd>(moments: usize, row: &Row<'_>, others: &Option<[Row<'_>; 2]>, j: usize) -> F<S> {
    let first = restored(moments, row, j);
    let Some([green, blue]) = others else { return first };
    let (green, blue) = (restored(moments, green, j), restored(moments, blue, j));
    let is_green = M::of(lanes!(i => if i % WIDTH == 1 { u32::MAX } else { 0 }));
    let is_blue = M::of(lanes!(i => if i % WIDTH == 2 { u32::MAX } else { 0 }));
    is_green.select(green, is_blue.select(blue, first))
}

/// Four moments of a row in a channel from `j` on: its cluster's mean, and what it weighs the components.
#[inline(always)]
fn restored<S: Simd>(moments: usize, row: &Row<'_>, j: usize) -> F<S> {
    let (from, pitch) = (&row.radiance[j * WIDTH..], moments * WIDTH);
    // Squares end with four or with one, behind which all is zero. Asked in a loop, a packet would be put together in memory.
    if moments - j >= FOUR { summed::<S, FOUR>(row, from, pitch) } else { summed::<S, 1>(row, from, pitch) }
}

/// So many moments of the mean and the weighed components, each `pitch` behind the one before.
#[inline(always)]
fn summed<S: Simd, const COUNT: usize>(row: &Row<'_>, from: &[f32], pitch: usize) -> F<S> {
    let mut sum = four::<S, COUNT>(from);
    let mut at = pitch;
    for &weight in row.weights {
        sum = sum + four::<S, COUNT>(&from[at..]) * weight;
        at += pitch;
    }
    sum
}

/// So many moments, at most four, and zeros.
#[inline(always)]
fn four<S: Simd, const COUNT: usize>(moments: &[f32]) -> F<S> {
    let moments = &moments[..COUNT * WIDTH];
    F::of(lanes!(i => if i < COUNT * WIDTH { moments[i] } else { 0.0 }))
}

/// Unit direction in the world from the eye to the center of each of sixteen cells from `cell` on; +Z where the cell is
/// at the eye.
#[inline(always)]
fn view_direction<S: Simd>(p: &ReconstructParams, cell: usize) -> [F<S>; 3] {
    let [x, y, ..] = p.cells.map(|n| n as usize);
    let place = [
        F::of(lanes!(i => ((cell + i) % x) as f32)),
        F::of(lanes!(i => ((cell + i) / x % y) as f32)),
        F::of(lanes!(i => ((cell + i) / x / y) as f32)),
    ];
    let v = triple!(a => (place[a] + 0.5) * p.cell[a] - 0.5 - p.eye[a]);
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    let w = triple!(a => v[0] * rows[a][0] + v[1] * rows[a][1] + v[2] * rows[a][2]);
    let distance = dot(w, w).sqrt();
    let away = distance.gt(F::ZERO);
    let ahead = [F::ZERO, F::ZERO, F::ONE];
    triple!(a => away.select(w[a] / distance, ahead[a]))
}
