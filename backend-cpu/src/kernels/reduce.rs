//! `reduce`: coarse mean and maximum of a field.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Reduce, ReduceParams};
use rayon::prelude::*;

use super::sample::Texels;
use crate::device::Memory;

pub(crate) fn run(stage: &Reduce, range: Range<u32>, memory: &mut Memory<'_>) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let density = read.field(stage.density)?;
    let other = stage.other.map(|f| read.field(f)).transpose()?;
    let out: &mut [[f32; 2]] = bytemuck::cast_slice_mut(out.remove(0));
    let part = &mut out[range.start as usize..range.end as usize];
    part.par_iter_mut().enumerate().for_each(|(i, place)| {
        let index = range.start + i as u32;
        let cell = [index % p.coarse[0], index / p.coarse[0] % p.coarse[1], index / p.coarse[0] / p.coarse[1]];
        *place = [mean(p, density, cell), 0.0];
        place[1] = [Some(density), other].into_iter().flatten().map(|f| maximum(p, f, cell)).fold(0.0, f32::max);
    });
    Ok(())
}

/// The mean of the voxels, each weighed by the part of it that lies in the cell.
fn mean(p: &ReduceParams, field: &[f32], cell: [u32; 3]) -> f32 {
    let range = |a: usize| {
        let (from, to) = (cell[a] as f32 * p.cell[a], (cell[a] + 1) as f32 * p.cell[a]);
        let last = p.dims[a] - 1;
        (from, to, (from.floor() as u32).min(last), (to.ceil() as u32).clamp(1, last + 1) - 1)
    };
    // The part of voxel i that lies between `from` and `to`; voxel i fills i to i + 1.
    let share = |(from, to, _, _): (f32, f32, u32, u32), i: u32| (to.min(i as f32 + 1.0) - from.max(i as f32)).max(0.0);
    let [x, y, z] = [range(0), range(1), range(2)];
    let (mut sum, mut weight) = (0.0, 0.0);
    for k in z.2..=z.3 {
        for j in y.2..=y.3 {
            for i in x.2..=x.3 {
                let w = share(x, i) * share(y, j) * share(z, k);
                sum += w * at(p, field, [i, j, k]);
                weight += w;
            }
        }
    }
    if weight > 0.0 { sum / weight } else { 0.0 }
}

fn at(p: &ReduceParams, field: &[f32], [i, j, k]: [u32; 3]) -> f32 {
    field[(k as usize * p.dims[1] as usize + j as usize) * p.dims[0] as usize + i as usize]
}

/// The maximum over every voxel that a lookup in the widened cell can touch, or over probes.
fn maximum(p: &ReduceParams, field: &[f32], cell: [u32; 3]) -> f32 {
    if p.coarse[3] > 0 {
        return probe(p, field, cell);
    }
    let range = |a: usize| {
        let margin = p.cell[3] * p.cell[a] + Reduce::SLACK;
        let from = cell[a] as f32 * p.cell[a] - 0.5 - margin;
        let to = (cell[a] + 1) as f32 * p.cell[a] - 0.5 + margin;
        let last = (p.dims[a] - 1) as f32;
        from.floor().clamp(0.0, last) as u32..=(to.floor() + 1.0).clamp(0.0, last) as u32
    };
    let mut max = 0.0f32;
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                max = max.max(at(p, field, [i, j, k]));
            }
        }
    }
    max
}

/// The maximum of n³ lookups, evenly spread over the cell.
fn probe(p: &ReduceParams, field: &[f32], cell: [u32; 3]) -> f32 {
    let texels = Texels::new(field, p.dims);
    let n = p.coarse[3];
    let place = |a: usize, i: u32| (cell[a] as f32 + (i as f32 + 0.5) / n as f32) * p.cell[a] - 0.5;
    let mut max = 0.0f32;
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                max = max.max(texels.sample_one([place(0, i), place(1, j), place(2, k)]));
            }
        }
    }
    max
}
