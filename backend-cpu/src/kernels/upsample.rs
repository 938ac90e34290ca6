//! `upsample`: the picture from a film of the medium alone.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{FAR, March, Upsample, UpsampleParams};
use rayon::prelude::*;

use super::sky::{Sky, sky};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, dot, lanes, triple};
use crate::simd::Simd;

const BLOCK: usize = March::BLOCK as usize;
/// Rows of a block that a packet takes.
const ROWS: usize = LANES / BLOCK;

/// Two vectors of a pixel.
type Pixel = [[f32; 4]; 2];

struct Inputs<'a> {
    p: &'a UpsampleParams,
    medium: &'a [Pixel],
    rims: &'a [Pixel],
    surface: &'a [[f32; 4]],
    normals: &'a [[f32; 4]],
    environment: Option<Sky<'a>>,
    subpixels: &'a [f32],
}

/// A film smaller than the picture: the one near rims, or the one of everything.
#[derive(Clone, Copy)]
struct Small<'a> {
    scale: u32,
    width: u32,
    height: u32,
    film: &'a [Pixel],
}

/// What is summed over pixels of a small film: radiance, transmittance, light stopped, and the same weighed with its
/// distance.
type Sums = [f32; 8];

/// Sums over pixels of a small film.
#[derive(Default)]
struct Medium {
    sums: Sums,
    weight: f32,
    /// How much of the nearest pixels, by their bilinear weights, was marched.
    marched: f32,
}

/// Where the pixels of a block fall among those of a small film, along one side.
struct Side {
    /// The pixel of the small film at or before each, or the first one, and the one behind it.
    pairs: [[u32; 2]; BLOCK],
    /// How far each is on its way between them.
    parts: [f32; BLOCK],
}

/// The pixels of a small film that a block looks at.
struct Patch<'a> {
    small: Small<'a>,
    sides: [Side; 2],
    /// Of the rows of pixels from the first on, as far as they are looked at.
    sums: [[Sums; BLOCK + 2]; BLOCK + 2],
    /// How far their surfaces are.
    distances: [[f32; BLOCK + 2]; BLOCK + 2],
}

pub(crate) fn run(stage: &Upsample, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.film)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        medium: bytemuck::cast_slice(read.buf(stage.medium)?),
        rims: bytemuck::cast_slice(read.opt(stage.rims)?),
        surface: read.opt(stage.surface)?,
        normals: read.opt(stage.normals)?,
        environment: Sky::of(read, stage.environment, [p.environment_width, p.environment_height], p.environment)?,
        subpixels: read.buf(stage.subpixels)?,
    };
    let inputs = &inputs;
    let film: &mut [Pixel] = bytemuck::cast_slice_mut(out.remove(0));
    let (width, height) = (p.full_width as usize, p.full_height as usize);
    let across = width.div_ceil(BLOCK);
    film[..width * height].par_chunks_mut(BLOCK * width).enumerate().for_each(|(row, film)| {
        for column in (0..across).filter(|x| range.contains(&((row * across + x) as u32))) {
            let corner = [column * BLOCK, row * BLOCK];
            let mut pixels = [[[0.0; 4]; 2]; BLOCK * BLOCK];
            let out = &mut pixels;
            compiled_for!(isa, upsample<S>(inputs: &Inputs<'_>, corner: [usize; 2], out: &mut [Pixel; BLOCK * BLOCK]));
            for (line, found) in film.chunks_exact_mut(width).zip(pixels.chunks_exact(BLOCK)) {
                let line = &mut line[corner[0]..];
                let count = line.len().min(BLOCK);
                line[..count].copy_from_slice(&found[..count]);
            }
        }
    });
    Ok(())
}

/// The pixels of a block from `corner` on, row by row. Those past the picture's edge are as its last.
#[inline(always)]
fn upsample<S: Simd>(inputs: &Inputs<'_>, corner: [usize; 2], out: &mut [Pixel; BLOCK * BLOCK]) {
    let p = inputs.p;
    let size = [p.full_width as usize, p.full_height as usize];
    let at = |a: usize, n: usize| (corner[a] + n).min(size[a] - 1);
    let whole = Patch::new(p, p.scale, inputs.medium, corner);
    let level = (inputs.surface.is_empty() && inputs.rims.is_empty()).then(|| whole.level());
    let rims = (!inputs.rims.is_empty()).then(|| Patch::new(p, p.scale / 2, inputs.rims, corner));
    for (part, out) in out.chunks_exact_mut(LANES).enumerate() {
        let x: [usize; LANES] = lanes!(i => at(0, i % BLOCK));
        let y: [usize; LANES] = lanes!(i => at(1, part * ROWS + i / BLOCK));
        let behind = behind::<S>(inputs, x, y);
        for i in 0..LANES {
            let (place, full) = ([i % BLOCK, part * ROWS + i / BLOCK], [x[i] as u32, y[i] as u32]);
            let mut found = Medium::default();
            if let Some(level) = &level {
                found = whole.between(level, place);
            } else {
                let distance = seen(inputs, x[i], y[i], 0)[3].min(FAR);
                if let Some(rims) = &rims {
                    found = rims.around(inputs, place, full, distance);
                }
                if found.marched < 1.0 {
                    found = mixed(found, whole.around(inputs, place, full, distance));
                }
            }
            let [r, g, b, tr, tg, tb, stopped, stopped_at] = found.sums;
            let through = [tr / found.weight, tg / found.weight, tb / found.weight];
            let light = [r / found.weight, g / found.weight, b / found.weight];
            let color = triple!(c => light[c] + through[c] * behind[c].0[i]);
            let depth = if stopped > 0.0 { stopped_at / stopped } else { f32::INFINITY };
            // Exactly nothing where all came through, also where a product and a sum are rounded as one.
            let whole = 3.0 * found.weight;
            let alpha = (whole - (tr + tg + tb)) / whole;
            out[i] = [[color[0], color[1], color[2], alpha], [through[0], through[1], through[2], depth]];
        }
    }
}

/// As much of one film as was marched of it, and the rest of another.
#[inline(always)]
fn mixed(fine: Medium, whole: Medium) -> Medium {
    if fine.marched == 0.0 {
        return whole;
    }
    let (a, b) = (fine.marched / fine.weight, (1.0 - fine.marched) / whole.weight);
    let mut sums = fine.sums;
    for (sum, whole) in sums.iter_mut().zip(whole.sums) {
        *sum = a * *sum + b * whole;
    }
    Medium { sums, weight: 1.0, marched: 1.0 }
}

impl Side {
    /// Of the pixels from `begin` on among `size`, in a film of `small` pixels.
    #[inline(always)]
    fn new(scale: u32, small: u32, begin: usize, size: u32) -> Self {
        let stands = |n: u32| (n * scale + scale / 2).min(size - 1);
        let mut side = Self { pairs: [[0; 2]; BLOCK], parts: [0.0; BLOCK] };
        for n in 0..BLOCK {
            let full = (begin + n).min(size as usize - 1) as u32;
            let first = full.saturating_sub(scale / 2) / scale;
            let next = (first + 1).min(small - 1);
            side.pairs[n] = [first, next];
            side.parts[n] = part(full, stands(first), stands(next));
        }
        side
    }

    /// The first pixel that is looked at, and how many are.
    #[inline(always)]
    fn span(&self) -> (u32, usize) {
        let first = self.pairs[0][0];
        (first, (self.pairs[BLOCK - 1][1] - first) as usize + 1)
    }
}

impl<'a> Patch<'a> {
    /// Of a film of so many pixels of the picture along each side of one of its own, for the block from `corner` on.
    #[inline(always)]
    fn new(p: &UpsampleParams, scale: u32, film: &'a [Pixel], corner: [usize; 2]) -> Self {
        let (width, height) = (p.full_width.div_ceil(scale), p.full_height.div_ceil(scale));
        let small = Small { scale, width, height, film };
        let sides =
            [Side::new(scale, width, corner[0], p.full_width), Side::new(scale, height, corner[1], p.full_height)];
        let [(x, across), (y, down)] = [sides[0].span(), sides[1].span()];
        let mut sums = [[[0.0; 8]; BLOCK + 2]; BLOCK + 2];
        let mut distances = [[0.0; BLOCK + 2]; BLOCK + 2];
        for j in 0..down {
            let line = &film[((y as usize + j) * width as usize + x as usize)..][..across];
            for (i, pixel) in line.iter().enumerate() {
                (sums[j][i], distances[j][i]) = (sums_of(pixel), pixel[0][3]);
            }
        }
        Self { small, sides, sums, distances }
    }

    /// What is summed, at the columns of the block and the rows of the small film. Where there is no surface all pixels fit, and
    /// weights are those along x times those along y.
    #[inline(always)]
    fn level(&self) -> [[Sums; BLOCK]; BLOCK + 2] {
        let side = &self.sides[0];
        let mut level = [[[0.0; 8]; BLOCK]; BLOCK + 2];
        for (line, sums) in level.iter_mut().zip(&self.sums).take(self.sides[1].span().1) {
            for n in 0..BLOCK {
                let ([a, b], first) = (side.pairs[n], side.pairs[0][0]);
                line[n] = lerp(&sums[(a - first) as usize], &sums[(b - first) as usize], side.parts[n]);
            }
        }
        level
    }

    /// The medium in a pixel of the block, between the rows of a level.
    #[inline(always)]
    fn between(&self, level: &[[Sums; BLOCK]; BLOCK + 2], [x, y]: [usize; 2]) -> Medium {
        let side = &self.sides[1];
        let ([a, b], first) = (side.pairs[y], side.pairs[0][0]);
        let sums = lerp(&level[(a - first) as usize][x], &level[(b - first) as usize][x], side.parts[y]);
        Medium { sums, weight: 1.0, marched: 1.0 }
    }

    /// The medium in a pixel of the block, which is `full` of the picture and whose surface is so far away; nothing where
    /// none of the nearest pixels was marched.
    #[inline(always)]
    fn around(&self, inputs: &Inputs<'_>, [x, y]: [usize; 2], full: [u32; 2], distance: f32) -> Medium {
        let [([x0, x1], fx), ([y0, y1], fy)] =
            [(self.sides[0].pairs[x], self.sides[0].parts[x]), (self.sides[1].pairs[y], self.sides[1].parts[y])];
        let mut sum = Medium::default();
        for (sx, sy, share) in
            [(x0, y0, (1.0 - fx) * (1.0 - fy)), (x1, y0, fx * (1.0 - fy)), (x0, y1, (1.0 - fx) * fy), (x1, y1, fx * fy)]
        {
            let (i, j) = ((sx - self.sides[0].pairs[0][0]) as usize, (sy - self.sides[1].pairs[0][0]) as usize);
            let other = self.distances[j][i];
            if other < 0.0 {
                continue;
            }
            sum.marched += share;
            let fits = fit(distance, other) * alike(inputs, full, self.small, [sx, sy]);
            sum.add(&self.sums[j][i], share * fits);
        }
        if sum.marched == 0.0 || sum.weight >= Upsample::FIT {
            return sum;
        }
        Medium { marched: sum.marched, ..nearest(self.small, [x0, y0], distance) }
    }
}

/// Sums a part `f` of the way from some to others.
#[inline(always)]
fn lerp(a: &Sums, b: &Sums, f: f32) -> Sums {
    let mut out = [0.0; 8];
    for c in 0..8 {
        out[c] = (1.0 - f) * a[c] + f * b[c];
    }
    out
}

/// Of the sixteen pixels around, the one whose surface is nearest to that of a pixel.
#[inline(never)]
fn nearest(small: Small<'_>, [x0, y0]: [u32; 2], distance: f32) -> Medium {
    let held = |sx: u32, sy: u32| &small.film[(sy * small.width + sx) as usize];
    let (mut least, mut at) = (FAR, [x0, y0]);
    for i in 0..16 {
        let sx = ((x0 + i % 4).max(1) - 1).min(small.width - 1);
        let sy = ((y0 + i / 4).max(1) - 1).min(small.height - 1);
        let other = held(sx, sy)[0][3];
        let apart = (1.0 / distance.clamp(1e-6, 1e30) - 1.0 / other.clamp(1e-6, 1e30)).abs();
        if other >= 0.0 && apart < least {
            (least, at) = (apart, [sx, sy]);
        }
    }
    let mut sum = Medium::default();
    sum.add(&sums_of(held(at[0], at[1])), 1.0);
    sum
}

/// How far `n` is on its way from `a` to `b`.
#[inline(always)]
fn part(n: u32, a: u32, b: u32) -> f32 {
    if n <= a || b <= a { 0.0 } else { (n - a) as f32 / (b - a) as f32 }
}

/// How well surfaces of two distances fit.
#[inline(always)]
fn fit(a: f32, b: f32) -> f32 {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    let nearer = 1.0 - a.min(b).min(1e30) / a.max(b).clamp(1e-30, 1e30);
    (2.0 - nearer / Upsample::NEAR).clamp(0.0, 1.0)
}

/// How well the normals in a pixel and in one of a small film fit.
fn alike(inputs: &Inputs<'_>, [x, y]: [u32; 2], small: Small<'_>, [sx, sy]: [u32; 2]) -> f32 {
    let (p, width) = (inputs.p, inputs.p.full_width);
    let stands = |n: u32, size: u32| (n * small.scale + small.scale / 2).min(size - 1);
    let (fx, fy) = (stands(sx, width), stands(sy, p.full_height));
    let at = [y * width + x, fy * width + fx].map(|at| inputs.normals.get(at as usize * p.normals_each as usize));
    let [Some(here), Some(there)] = at else { return 1.0 };
    let cosine = |a: &[f32; 4], b: &[f32; 4]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if cosine(here, here) == 0.0 || cosine(there, there) == 0.0 {
        return 1.0;
    }
    let cosine = cosine(here, there);
    ((cosine - Upsample::COSINE) / (1.0 - Upsample::COSINE)).clamp(0.0, 1.0)
}

impl Medium {
    /// Adds a pixel of a small film.
    #[inline(always)]
    fn add(&mut self, sums: &Sums, weight: f32) {
        for (sum, more) in self.sums.iter_mut().zip(sums) {
            *sum += weight * more;
        }
        self.weight += weight;
    }
}

/// What a pixel of a small film adds to sums.
#[inline(always)]
fn sums_of([light, through]: &Pixel) -> Sums {
    let (mut stopped, mut stopped_at) = (0.0, 0.0);
    if through[3] < FAR {
        stopped = ((3.0 - (through[0] + through[1] + through[2])) * (1.0 / 3.0)).max(1e-9);
        stopped_at = stopped * through[3];
    }
    [light[0], light[1], light[2], through[0], through[1], through[2], stopped, stopped_at]
}

/// The mean radiance behind the medium over the sub-pixel positions of pixels.
#[inline(always)]
fn behind<S: Simd>(inputs: &Inputs<'_>, x: [usize; LANES], y: [usize; LANES]) -> [F<S>; 3] {
    let p = inputs.p;
    let mut sum = [F::ZERO; 3];
    let (fx, fy) = (F::of(lanes!(i => x[i] as f32)), F::of(lanes!(i => y[i] as f32)));
    for s in 0..p.samples as usize {
        let before: [[f32; 4]; LANES] = lanes!(i => seen(inputs, x[i], y[i], s));
        let hit = F::of(lanes!(i => before[i][3])).lt(F::splat(FAR));
        let mut radiance = [F::ZERO; 3];
        if let Some(environment) = &inputs.environment {
            let a = (fx + inputs.subpixels[2 * s]) * (2.0 / p.full_width as f32) - 1.0;
            let b = -((fy + inputs.subpixels[2 * s + 1]) * (2.0 / p.full_height as f32) - 1.0);
            let toward = triple!(c => a * p.right[c] + b * p.up[c] + p.forward[c]);
            let length = dot(toward, toward).sqrt();
            radiance = sky(environment, triple!(c => toward[c] / length));
        }
        sum = triple!(c => sum[c] + hit.select(F::of(lanes!(i => before[i][c])), radiance[c]));
    }
    triple!(c => sum[c] * (1.0 / p.samples as f32))
}

/// The surface behind a sub-pixel position of a pixel; as far as can be without any.
fn seen(inputs: &Inputs<'_>, x: usize, y: usize, s: usize) -> [f32; 4] {
    if inputs.surface.is_empty() {
        return [0.0, 0.0, 0.0, FAR];
    }
    let each = inputs.p.surface_samples as usize;
    inputs.surface[(y * inputs.p.full_width as usize + x) * each + s % each]
}
