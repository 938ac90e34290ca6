//! `reduce`: coarse mean and maximum of a field.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Reduce, ReduceParams};
use rayon::prelude::*;

use super::field::Scalars;
use super::maximum::maximum;
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, lanes};
use crate::simd::Simd;

pub(crate) fn run(stage: &Reduce, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let density = read.scalars(stage.density)?;
    let other = match stage.other {
        Some(field) => Some(read.scalars(field)?),
        None => None,
    };
    let out: &mut [[f32; 2]] = bytemuck::cast_slice_mut(out.remove(0));
    let part = &mut out[range.start as usize..range.end as usize];
    part.par_iter_mut().zip(range).for_each(|(place, index)| {
        let (p, out): (&ReduceParams, _) = (p, place);
        compiled_for!(
            isa,
            reduce<S>(
                p: &ReduceParams,
                density: Scalars<'_>,
                other: Option<Scalars<'_>>,
                index: u32,
                out: &mut [f32; 2],
            )
        );
    });
    Ok(())
}

/// Mean and maximum of a cell, from what the passes before left.
#[inline(always)]
fn reduce<S: Simd>(p: &ReduceParams, density: Scalars<'_>, other: Option<Scalars<'_>>, index: u32, out: &mut [f32; 2]) {
    let [x, y, ..] = p.coarse;
    let cell = [index % x, index / x % y, index / x / y];
    let [sum, most] = if p.row_begin > 0 { *out } else { [0.0; 2] };
    let mut most = most.max(maximum::<S>(p, density, cell));
    if let Some(other) = other {
        most = most.max(maximum::<S>(p, other, cell));
    }
    *out = [mean::<S>(p, density, cell, sum), most];
}

/// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
#[inline(always)]
pub(crate) fn share(begin: f32, end: f32, i: u32) -> f32 {
    (end.min(i as f32 + 1.0) - begin.max(i as f32)).max(0.0)
}

/// The same of voxels from `i` on.
#[inline(always)]
fn shares<S: Simd>(begin: f32, end: f32, i: u32) -> F<S> {
    let i = F::of(lanes!(n => n as f32)) + i as f32;
    ((i + 1.0).min(F::splat(end)) - i.max(F::splat(begin))).max(F::ZERO)
}

/// Parts of the sum over a row of voxels, from one to another along x, each weighed by the part of it that lies between two
/// places there.
#[inline(always)]
pub(crate) fn row_parts<S: Simd>(
    field: Scalars<'_>,
    [begin, end]: [f32; 2],
    [first, last]: [u32; 2],
    [j, k]: [u32; 2],
) -> F<S> {
    let (mut sums, mut i) = (F::<S>::ZERO, first);
    while i <= last {
        let run = field.run::<S>([i, j, k], last);
        sums = sums + run.texels * shares(begin, end, i);
        i += run.count;
    }
    sums
}

/// The mean of the voxels, each weighed by the part of it that lies in the cell: the sum so far with the rows of this
/// pass, and in the last pass divided.
#[inline(always)]
fn mean<S: Simd>(p: &ReduceParams, field: Scalars<'_>, cell: [u32; 3], before: f32) -> f32 {
    let begin = [0, 1, 2].map(|a| cell[a] as f32 * p.cell[a]);
    let end = [0, 1, 2].map(|a| (cell[a] + 1) as f32 * p.cell[a]);
    let lo = [0, 1, 2].map(|a| (begin[a].floor() as u32).min(p.dims[a] - 1));
    let hi = [0, 1, 2].map(|a| (end[a].ceil() as u32).clamp(1, p.dims[a]) - 1);
    let across = hi[1] - lo[1] + 1;
    // What holds zero alone adds nothing.
    let zero = field.uniform(lo, hi) && field.texel(lo) == 0.0;
    let rows = if zero { 0 } else { across * (hi[2] - lo[2] + 1) };
    let mut sum = before;
    for row in p.row_begin..p.row_end.min(rows) {
        let (j, k) = (lo[1] + row % across, lo[2] + row / across);
        // Row by row, so that passes of some rows each add up to the same.
        let weight = share(begin[1], end[1], j) * share(begin[2], end[2], k);
        sum += row_parts::<S>(field, [begin[0], end[0]], [lo[0], hi[0]], [j, k]).total() * weight;
    }
    if p.row_end < Reduce::ALL_ROWS {
        return sum;
    }
    let [x, y, z] = [0, 1, 2].map(|a| (end[a].min(p.dims[a] as f32) - begin[a]).max(0.0));
    let weight = x * y * z;
    if weight > 0.0 { sum / weight } else { 0.0 }
}
