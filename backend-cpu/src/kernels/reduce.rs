//! `reduce`: coarse mean and maximum of a field.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Reduce, ReduceParams};
use rayon::prelude::*;

use super::field::Scalars;
use super::maximum::{probe, touched};
use crate::Isa;
use crate::columns::{Columns, Rows, filled, inside, spans, tasks, within};
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::simd::Simd;

pub(crate) fn run(stage: &Reduce, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    // Loops may turn as often as they need to: the last pass does all.
    if p.row_end < Reduce::ALL_ROWS {
        return Ok(());
    }
    let density = read.scalars(stage.density)?;
    let other = match stage.other {
        Some(field) => Some(read.scalars(field)?),
        None => None,
    };
    let out: &mut [[f32; 2]] = bytemuck::cast_slice_mut(out.remove(0));
    let part = &mut out[range.start as usize..range.end as usize];
    tasks(part, range.start as usize, p.coarse[0] as usize).into_par_iter().for_each(|(first, out)| {
        compiled_for!(
            isa,
            reduce<S>(
                p: &ReduceParams,
                density: Scalars<'_>,
                other: Option<Scalars<'_>>,
                first: usize,
                out: &mut [[f32; 2]],
            )
        );
    });
    Ok(())
}

/// Mean and maximum of cells of a row, from `first` on.
#[inline(always)]
fn reduce<S: Simd>(
    p: &ReduceParams,
    density: Scalars<'_>,
    other: Option<Scalars<'_>>,
    first: usize,
    out: &mut [[f32; 2]],
) {
    let [x, y, ..] = p.coarse;
    let [column, j, k] = [first as u32 % x, first as u32 / x % y, first as u32 / x / y];
    // The maximum touches all voxels that the mean does.
    let voxels =
        |a: usize, n: u32| if p.coarse[3] > 0 { filled(within(p.cell[a], n), p.dims[a]) } else { touched(p, a, n) };
    let rows = Rows { voxels: [voxels(1, j), voxels(2, k)], within: [within(p.cell[1], j), within(p.cell[2], k)] };
    let mut columns = Columns::NONE;
    out.fill([0.0; 2]);
    for (cells, span) in spans(out.len(), |n| voxels(0, column + n)) {
        columns.fill::<S>(density, span, &rows);
        for n in cells.clone() {
            let (along, touched) = (within(p.cell[0], column + n as u32), voxels(0, column + n as u32));
            out[n][0] += columns.sum::<S>(along, filled(along, p.dims[0]));
            out[n][1] = out[n][1].max(columns.most::<S>(touched));
        }
        if let Some(other) = other {
            columns.fill::<S>(other, span, &rows);
            for n in cells {
                out[n][1] = out[n][1].max(columns.most::<S>(voxels(0, column + n as u32)));
            }
        }
    }
    for (n, out) in out.iter_mut().enumerate() {
        let cell = [column + n as u32, j, k];
        out[0] = mean(p, cell, out[0]);
        if p.coarse[3] > 0 {
            out[1] = other.map_or(0.0, |other| probe(p, other, cell)).max(probe(p, density, cell));
        }
    }
}

/// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
#[inline(always)]
pub(crate) fn share([begin, end]: [f32; 2], i: u32) -> f32 {
    (end.min(i as f32 + 1.0) - begin.max(i as f32)).max(0.0)
}

/// The mean over a cell with this sum.
#[inline(always)]
fn mean(p: &ReduceParams, cell: [u32; 3], sum: f32) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|a| inside(within(p.cell[a], cell[a]), p.dims[a]));
    let weight = x * y * z;
    if weight > 0.0 { sum / weight } else { 0.0 }
}
