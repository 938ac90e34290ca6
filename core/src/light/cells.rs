//! The sphere in cells: pieces of the texels of an environment, row by row, with the exact flux of each.

use std::f64::consts::PI;
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::Environment;
use crate::basis::healpix;
use crate::basis::quadrature::gauss_legendre;

/// Cells of the sub-sampling along a pixel's side, at least: 64 a pixel.
const CELLS_PER_SIDE: f64 = 8.0;

/// Look-ups along a pixel's side that share out the cells on its edge. With the tips of pixels that reach between two
/// corners of a cell, which are given to its neighbour, this leaves up to 0.3 % of a pixel's area (n ≤ 8).
const LOOKUPS_PER_SIDE: f64 = 64.0;

/// Blocks of rows that are summed apart, on several threads, and joined in their order: sums do not depend on threads.
const BLOCKS: usize = 32;

/// The most sums of blocks that are held at once: those of many functions over many pixels take tens of MiB each.
const HELD: usize = 8;

/// Hands each block of so many rows to `sum`, and what comes of it to `join`, block by block.
pub(super) fn in_blocks<T: Send>(rows: usize, sum: impl Fn(Range<usize>) -> T + Sync, mut join: impl FnMut(T)) {
    let each = rows.div_ceil(BLOCKS).max(1);
    let blocks: Vec<_> = (0..rows).step_by(each).map(|first| first..(first + each).min(rows)).collect();
    for some in blocks.chunks(rayon::current_num_threads().clamp(1, HELD)) {
        let found: Vec<T> = some.par_iter().map(|rows| sum(rows.clone())).collect();
        found.into_iter().for_each(&mut join);
    }
}

/// A piece of the sphere that lies within one texel.
pub(super) struct Cell<'a> {
    pub(super) direction: DVec3,
    /// Exact integral of the radiance over the cell, W m⁻².
    pub(super) flux: DVec3,
    /// Pixels that the cell touches, and how much of it each holds; sums to 1.
    pub(super) shares: &'a [(usize, f64)],
}

/// The sphere in cells, with the pixels of [`healpix`] that they touch.
pub(super) struct Cells<'a> {
    pub(super) grid: CellGrid<'a>,
    nside: u32,
    /// Look-ups along a cell's sides, where it lies on an edge.
    refine: usize,
}

impl<'a> Cells<'a> {
    /// None without pixels.
    pub(super) fn new(environment: &'a Environment, nside: u32) -> Option<Self> {
        if nside == 0 {
            return None;
        }
        let side = healpix::side(nside);
        let grid = CellGrid::new(environment, side / CELLS_PER_SIDE);
        let refine = (grid.width.max(grid.height) / (side / LOOKUPS_PER_SIDE)).ceil() as usize;
        Some(Self { grid, nside, refine })
    }

    /// Visits the cells of some rows that are not dark.
    pub(super) fn for_each(&self, rows: Range<usize>, mut visit: impl FnMut(&Cell<'_>)) {
        let Self { grid, nside, refine } = self;
        let (nside, refine) = (*nside, *refine);
        let phi = |column: f64| grid.azimuth(column);
        // The pixels at the cells' corners, on the upper and the lower edge of a row of cells.
        let edge = |row: usize| -> Vec<usize> {
            let (sin, cos) = (grid.height * row as f64).sin_cos();
            runs(grid.columns + 1, |column| healpix::pixel_at(nside, cos, sin, phi(column as f64)))
        };
        let mut edges = (rows.start, edge(rows.start), edge(rows.start + 1));
        let mut shares = Vec::new();
        grid.for_each(rows, |[row, column], direction, flux| {
            if edges.0 != row {
                let upper = if edges.0 + 1 == row { std::mem::take(&mut edges.2) } else { edge(row) };
                edges = (row, upper, edge(row + 1));
            }
            let (_, upper, lower) = &edges;
            let corners = [upper[column], upper[column + 1], lower[column], lower[column + 1]];
            shares.clear();
            if corners.iter().all(|&c| c == corners[0]) {
                shares.push((corners[0], 1.0));
            } else {
                share_out(nside, [row, column], refine, grid.height, phi, &mut shares);
            }
            visit(&Cell { direction, flux, shares: &shares });
        });
    }
}

/// The sphere in cells, each of which lies within one texel.
pub(super) struct CellGrid<'a> {
    environment: &'a Environment,
    /// Cells of a texel along each axis.
    cuts: [usize; 2],
    columns: usize,
    /// Radians of azimuth, and from pole to pole.
    width: f64,
    height: f64,
}

impl<'a> CellGrid<'a> {
    /// Cells of at most `size` radians a side.
    pub(super) fn new(environment: &'a Environment, size: f64) -> Self {
        let (w, h) = (environment.image().width as usize, environment.image().height as usize);
        let cuts = [2.0 * PI / w as f64, PI / h as f64].map(|texel| (texel / size).ceil().max(1.0) as usize);
        let (columns, rows) = (w * cuts[0], h * cuts[1]);
        Self { environment, cuts, columns, width: 2.0 * PI / columns as f64, height: PI / rows as f64 }
    }

    /// φ at a place along a row, in cells.
    fn azimuth(&self, column: f64) -> f64 {
        self.environment.azimuth_of_seam() - self.width * column
    }

    /// Rows of cells.
    pub(super) fn rows(&self) -> usize {
        self.environment.image().height as usize * self.cuts[1]
    }

    /// Visits the cells of some rows that are not dark, row by row: row and column, the middle, the flux.
    pub(super) fn for_each(&self, rows: Range<usize>, mut visit: impl FnMut([usize; 2], DVec3, DVec3)) {
        let image = self.environment.image();
        let (w, h) = (image.width as usize, image.height as usize);
        let [cuts_u, cuts_v] = self.cuts;
        let middles: Vec<(f64, f64)> = (0..self.columns).map(|c| self.azimuth(c as f64 + 0.5).sin_cos()).collect();
        let hats: Vec<[f64; 3]> = (0..cuts_u).map(|q| hat_means(cuts_u, q)).collect();
        let mut blended = vec![DVec3::ZERO; w];
        let scale = self.environment.scale.as_dvec3() / self.columns as f64;
        for row in rows {
            let weights = row_weights(h, cuts_v, row);
            let lines = [0, 1, 2].map(|i| &image.texels[neighbour_row(row / cuts_v, i, h) * w..][..w]);
            for (a, value) in blended.iter_mut().enumerate() {
                let line = |i: usize| weights[i] * DVec3::from(lines[i][a].map(f64::from));
                *value = (line(0) + line(1) + line(2)) * scale;
            }
            // The mean of cos θ over the cell, which divides its area in halves.
            let y = 0.5 * ((self.height * row as f64).cos() + (self.height * (row + 1) as f64).cos());
            let planar = ((1.0 - y) * (1.0 + y)).sqrt();
            for a in 0..w {
                let near = [blended[(a + w - 1) % w], blended[a], blended[(a + 1) % w]];
                for (q, hat) in hats.iter().enumerate() {
                    let flux = hat[0] * near[0] + hat[1] * near[1] + hat[2] * near[2];
                    if flux == DVec3::ZERO {
                        continue;
                    }
                    let column = a * cuts_u + q;
                    let (sin, cos) = middles[column];
                    visit([row, column], DVec3::new(planar * sin, y, planar * cos), flux);
                }
            }
        }
    }
}

/// The pixels of so many places along a circle of latitude. A pixel holds an arc of it, a quarter at the most: two places of
/// one pixel that are nearer than that have no other between them, so that few are looked up.
fn runs(count: usize, pixel: impl Fn(usize) -> usize) -> Vec<usize> {
    let mut pixels = vec![0; count];
    let mut parts = Vec::new();
    let step = count.div_ceil(16);
    for first in (0..count).step_by(step) {
        let last = (first + step).min(count - 1);
        parts.push((first, pixel(first), last, pixel(last)));
        while let Some((first, begin, last, end)) = parts.pop() {
            if begin == end || last - first < 2 {
                pixels[first..last].fill(begin);
                pixels[last] = end;
            } else {
                let (middle, between) = (first.midpoint(last), pixel(first.midpoint(last)));
                parts.extend([(first, begin, middle, between), (middle, between, last, end)]);
            }
        }
    }
    pixels
}

/// Which pixels hold how much of the cell at \[row, column\], by `refine` squared look-ups.
fn share_out(
    nside: u32,
    [row, column]: [usize; 2],
    refine: usize,
    height: f64,
    phi: impl Fn(f64) -> f64,
    shares: &mut Vec<(usize, f64)>,
) {
    let at = |i: usize| (i as f64 + 0.5) / refine as f64;
    let total: f64 = (0..refine).map(|i| (height * (row as f64 + at(i))).sin()).sum();
    for i in 0..refine {
        let (sin, cos) = (height * (row as f64 + at(i))).sin_cos();
        let share = sin / (total * refine as f64);
        for j in 0..refine {
            let pixel = healpix::pixel_at(nside, cos, sin, phi(column as f64 + at(j)));
            match shares.iter_mut().find(|(p, _)| *p == pixel) {
                Some((_, sum)) => *sum += share,
                None => shares.push((pixel, share)),
            }
        }
    }
}

/// The row above, the row itself, the row below (i = 0, 1, 2), clamped.
pub(super) fn neighbour_row(row: usize, i: usize, h: usize) -> usize {
    (row + i).saturating_sub(1).min(h - 1)
}

/// Mean, over the q-th of `cuts` equal parts of a texel, of the three linear interpolation weights.
fn hat_means(cuts: usize, q: usize) -> [f64; 3] {
    let [before, after] = sides_of_center(cuts, q).map(|(start, end)| {
        // ∫ |t| dt over a part on one side of the centre.
        0.5 * (end * end - start * start).abs() * cuts as f64
    });
    [before, 1.0 - before - after, after]
}

/// Solid-angle integrals 2π ∫ hat sin θ dθ of the three rows' interpolation weights, over row `row` of `cuts`·`h`.
pub(super) fn row_weights(h: usize, cuts: usize, row: usize) -> [f64; 3] {
    let (texel, q) = (row / cuts, row % cuts);
    let mut weights = [0.0; 3];
    for (side, (start, end)) in sides_of_center(cuts, q).into_iter().enumerate() {
        if end <= start {
            continue;
        }
        // A part is at most π/2 long, where the rule integrates t·sin θ to rounding.
        for (node, weight) in gauss_legendre(10) {
            let t = 0.5 * (start + end) + 0.5 * (end - start) * node;
            let theta = PI * (texel as f64 + 0.5 + t) / h as f64;
            let weight = weight * 0.5 * (end - start) * 2.0 * PI * PI / h as f64 * theta.sin();
            weights[1] += weight * (1.0 - t.abs());
            weights[2 * side] += weight * t.abs();
        }
    }
    weights
}

/// The q-th of `cuts` equal parts of a texel that reaches from -½ to ½, cut at its centre: what lies before, what
/// lies after. Either may be empty.
fn sides_of_center(cuts: usize, q: usize) -> [(f64, f64); 2] {
    let (start, end) = (q as f64 / cuts as f64 - 0.5, (q + 1) as f64 / cuts as f64 - 0.5);
    [(start.min(0.0), end.min(0.0)), (start.max(0.0), end.max(0.0))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_a_pixel_are_found_by_their_ends() {
        for nside in [1, 2, 8] {
            for (count, theta) in [(1, 0.3), (2, 0.3), (97, 0.01), (513, 0.7), (1025, 1.5), (4097, 2.9)] {
                let (sin, cos) = f64::sin_cos(theta);
                let pixel = |i: usize| healpix::pixel_at(nside, cos, sin, 1.0 - 2.0 * PI * i as f64 / count as f64);
                let expected: Vec<_> = (0..count).map(pixel).collect();
                assert_eq!(runs(count, pixel), expected, "nside {nside}, {count} at {theta}");
            }
        }
    }
}
