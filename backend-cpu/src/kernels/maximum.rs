//! The maximum of a field over a coarse cell.

use airlight_core::stage::{Reduce, ReduceParams};

use super::field::Scalars;

/// The first and the last voxel along axis `a` that a lookup in the widened cell `n` can touch.
#[inline(always)]
pub(crate) fn touched(p: &ReduceParams, a: usize, n: u32) -> [u32; 2] {
    let margin = p.cell[3] * p.cell[a] + Reduce::SLACK;
    let last = (p.dims[a] - 1) as f32;
    let begin = n as f32 * p.cell[a] - 0.5 - margin;
    let end = (n + 1) as f32 * p.cell[a] - 0.5 + margin;
    [begin.floor().clamp(0.0, last) as u32, (end.floor() + 1.0).clamp(0.0, last) as u32]
}

/// The maximum of n³ lookups, evenly spread over the cell, and no less than zero.
pub(crate) fn probe(p: &ReduceParams, field: Scalars<'_>, cell: [u32; 3]) -> f32 {
    let n = p.coarse[3];
    let place = |a: usize, i: u32| (cell[a] as f32 + (i as f32 + 0.5) / n as f32) * p.cell[a] - 0.5;
    let mut most = 0.0f32;
    for row in 0..n * n {
        let (j, k) = (row % n, row / n);
        for i in 0..n {
            let at = [place(0, i), place(1, j), place(2, k)];
            most = most.max(field.single(at));
        }
    }
    most
}
