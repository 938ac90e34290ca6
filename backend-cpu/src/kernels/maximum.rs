//! The maximum of a field over a coarse cell.

use airlight_core::stage::{Reduce, ReduceParams};

use super::field::Scalars;
use crate::packet::F;
use crate::simd::Simd;

/// The maximum over every voxel that a lookup in the widened cell can touch, or over probes: over the rows of this pass.
#[inline(always)]
pub(crate) fn maximum<S: Simd>(p: &ReduceParams, field: Scalars<'_>, cell: [u32; 3]) -> f32 {
    if p.coarse[3] > 0 {
        return probe(p, field, cell);
    }
    let margin = [0, 1, 2].map(|a| p.cell[3] * p.cell[a] + Reduce::SLACK);
    let last = [0, 1, 2].map(|a| (p.dims[a] - 1) as f32);
    let begin = [0, 1, 2].map(|a| cell[a] as f32 * p.cell[a] - 0.5 - margin[a]);
    let end = [0, 1, 2].map(|a| (cell[a] + 1) as f32 * p.cell[a] - 0.5 + margin[a]);
    let lo = [0, 1, 2].map(|a| begin[a].floor().clamp(0.0, last[a]) as u32);
    let hi = [0, 1, 2].map(|a| (end[a].floor() + 1.0).clamp(0.0, last[a]) as u32);
    let across = hi[1] - lo[1] + 1;
    let rows = across * (hi[2] - lo[2] + 1);
    if field.uniform(lo, hi) {
        return field.texel(lo).max(0.0);
    }
    let mut most = F::<S>::ZERO;
    for row in p.row_begin..p.row_end.min(rows) {
        let (j, k) = (lo[1] + row % across, lo[2] + row / across);
        let mut i = lo[0];
        while i <= hi[0] {
            let run = field.run::<S>([i, j, k], hi[0]);
            most = run.texels.max(most);
            i += run.count;
        }
    }
    most.max_lane()
}

/// The maximum of n³ lookups, evenly spread over the cell: over the rows of this pass.
fn probe(p: &ReduceParams, field: Scalars<'_>, cell: [u32; 3]) -> f32 {
    let n = p.coarse[3];
    let place = |a: usize, i: u32| (cell[a] as f32 + (i as f32 + 0.5) / n as f32) * p.cell[a] - 0.5;
    let mut most = 0.0f32;
    for row in p.row_begin..p.row_end.min(n * n) {
        let (j, k) = (row % n, row / n);
        for i in 0..n {
            let at = [place(0, i), place(1, j), place(2, k)];
            most = most.max(field.single(at));
        }
    }
    most
}
