//! `reconstruct`: in-scattered radiance from what clusters of transfer matrices make of light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Reconstruct, ReconstructParams};
use rayon::prelude::*;

use super::harmonics::{self, harmonics};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, dot, lanes, triple};

/// Cells that one task takes.
const CHUNK: usize = 64 * LANES;

struct Inputs<'a> {
    p: &'a ReconstructParams,
    rows: &'a [u32],
    clusters: &'a [u32],
    weights: &'a [f32],
    radiance: &'a [[f32; 4]],
    /// The phase function's moments.
    beta: &'a [f32],
    /// Constants of spherical harmonics.
    constants: &'a [f32],
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
    let (rows, clusters) = (read.buf(stage.rows)?, read.buf(stage.clusters)?);
    let (weights, radiance) = (read.opt(stage.weights)?, read.buf(stage.radiance)?);
    let inputs = &Inputs { p, rows, clusters, weights, radiance, beta, constants };
    let (start, end, layers) = (range.start as usize, range.end as usize, p.layers() as usize);
    let out: &mut [[f32; 4]] = bytemuck::cast_slice_mut(out.remove(0));
    out[start * layers..end * layers].par_chunks_mut(CHUNK * layers).enumerate().for_each(|(n, out)| {
        let first = start + n * CHUNK;
        compiled_for!(isa, reconstruct(inputs: &Inputs<'_>, first: usize, out: &mut [[f32; 4]]));
    });
    Ok(())
}

/// The layers of the cells from `first` on.
#[inline(always)]
fn reconstruct(inputs: &Inputs<'_>, first: usize, out: &mut [[f32; 4]]) {
    let p = inputs.p;
    let (layers, moments) = (p.layers() as usize, p.coefficients() as usize);
    let mut basis = [F::ZERO; harmonics::MAX];
    let (mut light, mut other) = ([[0.0; 4]; harmonics::MAX], [[0.0; 4]; harmonics::MAX]);
    let light = &mut light[..moments];
    for (n, out) in out.chunks_mut(LANES * layers).enumerate() {
        let cell = first + n * LANES;
        let rows = &inputs.rows[cell..][..out.len() / layers];
        if p.view == 1 && rows.iter().any(|row| *row > 0) {
            harmonics(inputs.constants, p.bands as usize, view_direction(p, cell), &mut basis);
        }
        for (i, (&row, out)) in rows.iter().zip(out.chunks_exact_mut(layers)).enumerate() {
            if row == 0 {
                out.fill([0.0; 4]);
                continue;
            }
            arriving(inputs, row.min(p.rows) as usize - 1, light, &mut other[..moments]);
            if p.view == 0 {
                for ((out, light), beta) in out.iter_mut().zip(&*light).zip(inputs.beta) {
                    *out = [beta * light[0], beta * light[1], beta * light[2], 0.0];
                }
            } else {
                let mut sum = [0.0; 4];
                for ((light, beta), basis) in light.iter().zip(inputs.beta).zip(&basis) {
                    let weight = beta * basis.0[i];
                    for c in 0..4 {
                        sum[c] += weight * light[c];
                    }
                }
                out[0] = [sum[0], sum[1], sum[2], 0.0];
            }
        }
    }
}

/// The moments of a row; a channel serves all of RGB, or each its own component.
#[inline(always)]
fn arriving(inputs: &Inputs<'_>, row: usize, to: &mut [[f32; 4]], other: &mut [[f32; 4]]) {
    restored(inputs, 0, row, to);
    for c in 1..inputs.p.channels as usize {
        restored(inputs, c, row, other);
        for (to, other) in to.iter_mut().zip(&*other) {
            to[c] = other[c];
        }
    }
}

/// The moments of a row in a channel: its cluster's mean, and what it weighs the components.
#[inline(always)]
fn restored(inputs: &Inputs<'_>, channel: usize, row: usize, to: &mut [[f32; 4]]) {
    let p = inputs.p;
    let (components, moments) = (p.components as usize, to.len());
    let place = channel * p.rows as usize + row;
    let cluster = inputs.clusters[place].min(p.clusters - 1) as usize;
    let first = (channel * p.clusters as usize + cluster) * (1 + components) * moments;
    let (mean, rest) = inputs.radiance[first..][..(1 + components) * moments].split_at(moments);
    let weights = &inputs.weights[place * components..][..components];
    to.copy_from_slice(mean);
    for (component, weight) in rest.chunks_exact(moments).zip(weights) {
        for (to, value) in to.iter_mut().zip(component) {
            for c in 0..4 {
                to[c] += weight * value[c];
            }
        }
    }
}

/// Unit direction in the world from the eye to the center of each of sixteen cells from `cell` on; +Z where the cell is
/// at the eye.
#[inline(always)]
fn view_direction(p: &ReconstructParams, cell: usize) -> [F; 3] {
    let [x, y, ..] = p.cells.map(|n| n as usize);
    let place = [
        F(lanes!(i => ((cell + i) % x) as f32)),
        F(lanes!(i => ((cell + i) / x % y) as f32)),
        F(lanes!(i => ((cell + i) / x / y) as f32)),
    ];
    let v = triple!(a => (place[a] + 0.5) * p.cell[a] - 0.5 - p.eye[a]);
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    let w = triple!(a => v[0] * rows[a][0] + v[1] * rows[a][1] + v[2] * rows[a][2]);
    let distance = dot(w, w).sqrt();
    let away = distance.gt(F::ZERO);
    let ahead = [F::ZERO, F::ZERO, F::ONE];
    triple!(a => away.select(w[a] / distance, ahead[a]))
}
