//! Columns of voxels: what a row of cells holds of a field, added up along y and z, voxel by voxel along x. A row of voxels
//! is read once for all cells that it crosses, sixteen voxels at a time, and sums wait in registers. The order of the sums
//! is that of blocks of bricks, also where there are none, so that they are the same in every layout.

use std::ops::Range;

use airlight_core::device::BrickLayout;

use crate::kernels::field::Scalars;
use crate::kernels::reduce::share;
use crate::packet::{F, LANES, lanes};
use crate::simd::Simd;

/// Voxels along x that are held at once.
const SPAN: usize = 256;
const _: () = assert!(SPAN.is_multiple_of(LANES));

/// The rows of voxels of a row of cells, along y and along z.
pub(crate) struct Rows {
    /// The first and the last.
    pub(crate) voxels: [[u32; 2]; 2],
    /// Between which places a voxel weighs in sums: by the part of it that lies there.
    pub(crate) within: [[f32; 2]; 2],
}

/// Sums and maxima of columns.
pub(crate) struct Columns {
    first: u32,
    last: u32,
    sums: [f32; SPAN + LANES],
    most: [f32; SPAN + LANES],
}

impl Columns {
    /// No columns.
    pub(crate) const NONE: Self = Self { first: 0, last: 0, sums: [0.0; SPAN + LANES], most: [0.0; SPAN + LANES] };

    /// Holds the columns from `first` to `last`, as many as [`spans`] says.
    #[inline(always)]
    pub(crate) fn fill<S: Simd>(&mut self, field: Scalars<'_>, [first, last]: [u32; 2], rows: &Rows) {
        (self.first, self.last) = (first, last);
        let mut i = first;
        while i <= last {
            let count = field.stretch(i, last);
            let [sums, most] = column::<S>(field, [i, count], rows);
            let at = (i - first) as usize;
            self.sums[at..][..LANES].copy_from_slice(&sums.0);
            self.most[at..][..LANES].copy_from_slice(&most.0);
            i += count;
        }
    }

    /// The sum of the columns from one to another, those that are held, each weighed by the part of it that lies between two
    /// places.
    #[inline(always)]
    pub(crate) fn sum<S: Simd>(&self, [begin, end]: [f32; 2], [lo, hi]: [u32; 2]) -> f32 {
        let (mut sums, mut i) = (F::<S>::ZERO, lo.max(self.first));
        let last = hi.min(self.last);
        while i <= last {
            // Nothing is held past the last.
            let weights = shares(begin, end.min((last + 1) as f32), i);
            sums = sums + weights.gt(F::ZERO).select(held(&self.sums, i - self.first) * weights, F::ZERO);
            i += LANES as u32;
        }
        sums.total()
    }

    /// The maximum of the columns from one to another, those that are held.
    #[inline(always)]
    pub(crate) fn most<S: Simd>(&self, [lo, hi]: [u32; 2]) -> f32 {
        let (mut most, mut i) = (F::<S>::ZERO, lo.max(self.first));
        let last = hi.min(self.last);
        while i <= last {
            let within = F::of(lanes!(n => n as f32)).lt(F::splat((last - i + 1) as f32));
            most = within.select(held(&self.most, i - self.first).max(most), most);
            i += LANES as u32;
        }
        most.max_lane()
    }
}

/// Sixteen of them.
#[inline(always)]
fn held<S: Simd>(columns: &[f32; SPAN + LANES], at: u32) -> F<S> {
    let held: &[f32] = &columns[at as usize..][..LANES];
    F::of(lanes!(n => held[n]))
}

/// The parts of voxels from `i` on that lie between two places.
#[inline(always)]
fn shares<S: Simd>(begin: f32, end: f32, i: u32) -> F<S> {
    let i = F::of(lanes!(n => n as f32)) + i as f32;
    ((i + 1.0).min(F::splat(end)) - i.max(F::splat(begin))).max(F::ZERO)
}

/// The weighed sums of some columns from `i` on, and their maxima, which are no less than zero; zeros behind them.
#[inline(always)]
fn column<S: Simd>(field: Scalars<'_>, [i, count]: [u32; 2], rows: &Rows) -> [F<S>; 2] {
    let [[first, to], [lowest, top]] = rows.voxels;
    let [row, slice] = field.pitch();
    let block_end = |n: u32| n | (BrickLayout::BLOCK - 1);
    let (mut sums, mut most) = (F::ZERO, F::ZERO);
    let mut below = lowest;
    while below <= top {
        let above = top.min(block_end(below));
        let mut near = first;
        while near <= to {
            let far = to.min(block_end(near));
            // What holds zero alone adds nothing.
            if field.empty([i, near, below]) == 0 {
                let start = field.at([i, near, below]);
                for k in below..=above {
                    let share_of_slice = share(rows.within[1], k);
                    let start = start + (k - below) as usize * slice;
                    for j in near..=far {
                        let texels = field.run::<S>(start + (j - near) as usize * row, count);
                        most = texels.max(most);
                        let weight = share(rows.within[0], j) * share_of_slice;
                        if weight > 0.0 {
                            sums = sums + texels * weight;
                        }
                    }
                }
            }
            near = far + 1;
        }
        below = above + 1;
    }
    [sums, most]
}

/// Which columns are held at once, the first and the last, and for which of some cells of a row, each of which holds those
/// from one of `voxels` to another: for as many cells as fit, or one after the other for one that does not.
pub(crate) fn spans(cells: usize, voxels: impl Fn(u32) -> [u32; 2]) -> impl Iterator<Item = (Range<usize>, [u32; 2])> {
    let (mut group, mut columns) = (0..0, [0, 0]);
    std::iter::from_fn(move || {
        if columns[0] >= columns[1] {
            if group.end == cells {
                return None;
            }
            let first = voxels(group.end as u32)[0];
            let mut end = voxels(group.end as u32)[1] + 1;
            group = group.end..group.end + 1;
            while group.end < cells && voxels(group.end as u32)[1] - first < SPAN as u32 {
                end = voxels(group.end as u32)[1] + 1;
                group.end += 1;
            }
            columns = [first, end];
        }
        let first = columns[0];
        columns[0] = columns[1].min(first + SPAN as u32);
        Some((group.clone(), [first, columns[0] - 1]))
    })
}

/// Where cell `n` of so many voxels begins and ends along an axis.
#[inline(always)]
pub(crate) fn within(side: f32, n: u32) -> [f32; 2] {
    [n as f32 * side, (n + 1) as f32 * side]
}

/// The first and the last of so many voxels that lie between two places.
#[inline(always)]
pub(crate) fn filled([begin, end]: [f32; 2], voxels: u32) -> [u32; 2] {
    [(begin.floor() as u32).min(voxels - 1), (end.ceil() as u32).clamp(1, voxels) - 1]
}

/// How much of so many voxels lies between two places.
#[inline(always)]
pub(crate) fn inside([begin, end]: [f32; 2], voxels: u32) -> f32 {
    (end.min(voxels as f32) - begin).max(0.0)
}

/// Cells of a grid in tasks, each of them cells of one row along x that lie together: the first cell, and where what comes of
/// them goes. `cells` begin with cell `begin`; a row has `across` of them.
pub(crate) fn tasks<T>(cells: &mut [T], begin: usize, across: usize) -> Vec<(usize, &mut [T])> {
    /// The most cells of a task.
    const MOST: usize = 64;
    let (mut tasks, mut left, mut cell) = (Vec::new(), cells, begin);
    while !left.is_empty() {
        let (task, rest) = left.split_at_mut((across - cell % across).min(MOST).min(left.len()));
        (left, cell) = (rest, cell + task.len());
        tasks.push((cell - task.len(), task));
    }
    tasks
}

#[cfg(test)]
mod tests {
    use airlight_core::device::{FieldFormat, FieldSpec};

    use super::*;
    use crate::simd::Portable;

    #[test]
    fn columns_are_sums_and_maxima_of_their_voxels() {
        // Wider than what is held at once.
        let dims = [SPAN as u32 + 40, 11, 9];
        let voxel = |i: u32, j: u32, k: u32| ((i * 7 + j * 5 + k * 3) % 17) as f32;
        let mut texels = Vec::new();
        for k in 0..dims[2] {
            for j in 0..dims[1] {
                texels.extend((0..dims[0]).map(|i| voxel(i, j, k)));
            }
        }
        texels.push(0.0);
        let field = Scalars::new(&texels, &FieldSpec::dense(dims, 1, FieldFormat::Scalar));
        let rows = Rows { voxels: [[1, 10], [0, 8]], within: [[2.5, 9.25], [1.0, 8.0]] };
        let mut columns = Columns::NONE;
        for first in [0, 3, 40] {
            let last = dims[0].min(first + SPAN as u32) - 1;
            columns.fill::<Portable>(field, [first, last], &rows);
            for [lo, hi] in [[first, last], [first + 1, first + 18], [first + 20, first + 20]] {
                let along = [lo as f32 + 0.5, hi as f32 + 1.0];
                let (mut sum, mut most) = (0.0, 0.0f32);
                for k in 0..=8 {
                    for j in 1..=10 {
                        for i in lo..=hi {
                            let weight = share(along, i) * share(rows.within[0], j) * share(rows.within[1], k);
                            sum += f64::from(voxel(i, j, k)) * f64::from(weight);
                            most = most.max(voxel(i, j, k));
                        }
                    }
                }
                let found = columns.sum::<Portable>(along, [lo, hi]);
                // Sums below 2^24 of quarters and eighths are exact.
                assert_eq!(f64::from(found), sum, "{lo} to {hi}");
                assert_eq!(columns.most::<Portable>([lo, hi]), most, "{lo} to {hi}");
            }
        }
    }

    #[test]
    fn spans_are_all_columns_of_all_cells() {
        let held = |side: u32, cells: usize| spans(cells, move |n| [n * side, n * side + side]).collect::<Vec<_>>();
        let half = SPAN as u32 / 2;
        // A column more than a cell's side: two cells of half of the span do not fit.
        assert_eq!(held(half, 2), [(0..1, [0, half]), (1..2, [half, 2 * half])]);
        assert_eq!(held(half / 2, 5), [(0..3, [0, 3 * half / 2]), (3..5, [3 * half / 2, 5 * half / 2])]);
        let wide = 5 * half;
        assert_eq!(
            held(wide, 1),
            [(0..1, [0, 2 * half - 1]), (0..1, [2 * half, 4 * half - 1]), (0..1, [4 * half, wide])]
        );
        assert_eq!(held(wide, 0), []);
    }

    #[test]
    fn tasks_are_all_cells_in_order_and_lie_in_rows() {
        let mut cells: Vec<usize> = (5..700).collect();
        let mut next = 5;
        for (first, cells) in tasks(&mut cells, 5, 100) {
            assert_eq!((first, cells[0]), (next, next));
            assert_eq!(first / 100, cells[cells.len() - 1] / 100);
            next += cells.len();
        }
        assert_eq!(next, 700);
    }
}
