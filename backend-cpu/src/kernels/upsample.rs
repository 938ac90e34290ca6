//! `upsample`: the picture from a film of the medium alone.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{FAR, March, Upsample, UpsampleParams};
use rayon::prelude::*;

use super::sky::{Sky, sky};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, I, LANES, apart, dot, lanes, lerp, together, triple};
use crate::simd::Simd;

const BLOCK: usize = March::BLOCK as usize;
/// Rows of a block that a packet takes.
const ROWS: usize = LANES / BLOCK;

/// Two vectors of a pixel.
type Pixel = [[f32; 4]; 2];

struct Inputs<'a> {
    p: &'a UpsampleParams,
    medium: &'a [[f32; 4]],
    rims: &'a [[f32; 4]],
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
    /// Two vectors a pixel.
    film: &'a [[f32; 4]],
}

/// What is summed over pixels of a small film: radiance, transmittance, light stopped, and the same weighed with its
/// distance.
type Sums<S> = [F<S>; 8];

/// Sums over pixels of a small film.
#[derive(Clone, Copy)]
struct Medium<S> {
    sums: Sums<S>,
    weight: F<S>,
    /// How much of the nearest pixels, by their bilinear weights, was marched.
    marched: F<S>,
}

/// Where the pixels of a block fall among those of a small film, along one side.
struct Side {
    /// The pixel of the small film at or before each, or the first one, and the one behind it.
    pairs: [[u32; 2]; BLOCK],
    /// How far each is on its way between them.
    parts: [f32; BLOCK],
}

/// Pixels of a row of a small film: those at or before the columns of a block, then those behind them.
#[derive(Clone, Copy)]
struct Row<S> {
    sums: Sums<S>,
    /// How far their surfaces are.
    distance: F<S>,
}

/// The pixels of a small film that a block looks at.
struct Patch<'a, S> {
    small: Small<'a>,
    sides: [Side; 2],
    /// From the first row on that is looked at.
    rows: [Row<S>; BLOCK + 2],
    /// One over the distances of the surfaces four by four around, as far as they were asked for: of rows from the one
    /// before the first on, the two columns up to each of the block and the two behind; infinite where nothing was
    /// marched.
    inverses: Option<[[F<S>; 2]; BLOCK + 4]>,
}

pub(crate) fn run(stage: &Upsample, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.film)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        medium: read.buf(stage.medium)?,
        rims: read.opt(stage.rims)?,
        surface: read.opt(stage.surface)?,
        normals: read.opt(stage.normals)?,
        environment: Sky::of(read, stage.environment, [p.environment_width, p.environment_height], p.environment)?,
        subpixels: read.buf(stage.subpixels)?,
    };
    let inputs = &inputs;
    let film: &mut [Pixel] = bytemuck::cast_slice_mut(out.remove(0));
    let (width, height) = (p.full_width as usize, p.full_height as usize);
    let across = width.div_ceil(BLOCK);
    film[..width * height].par_chunks_mut(BLOCK * width).enumerate().with_max_len(1).for_each(|(row, film)| {
        for column in (0..across).filter(|x| range.contains(&((row * across + x) as u32))) {
            let corner = [column * BLOCK, row * BLOCK];
            compiled_for!(isa, upsample<S>(inputs: &Inputs<'_>, corner: [usize; 2], film: &mut [Pixel]));
        }
    });
    Ok(())
}

/// The pixels of a block from `corner` on, into a film that begins with the block's first row. Those past the picture's edge are as its
/// last, and left out.
#[inline(always)]
fn upsample<S: Simd>(inputs: &Inputs<'_>, corner: [usize; 2], film: &mut [Pixel]) {
    let p = inputs.p;
    let size = [p.full_width as usize, p.full_height as usize];
    let at = |a: usize, n: usize| (corner[a] + n).min(size[a] - 1);
    let mut whole = Patch::<S>::new(p, p.scale, inputs.medium, corner);
    let level = (inputs.surface.is_empty() && inputs.rims.is_empty()).then(|| whole.level());
    let mut rims = (!inputs.rims.is_empty()).then(|| Patch::<S>::new(p, p.scale / 2, inputs.rims, corner));
    for (part, lines) in film.chunks_mut(ROWS * size[0]).enumerate() {
        let row = part * ROWS;
        let x: [usize; LANES] = lanes!(i => at(0, i % BLOCK));
        let y: [usize; LANES] = lanes!(i => at(1, row + i / BLOCK));
        let mut found = Medium::NONE;
        if let Some(level) = &level {
            found = whole.between(level, row);
        } else {
            let distance = seen::<S>(inputs, x, y, 0)[3].min(F::splat(FAR));
            if let Some(rims) = &mut rims {
                found = rims.around(inputs, [x, y], row, distance);
            }
            if found.marched.lt(F::ONE).any() {
                found = mixed(found, whole.around(inputs, [x, y], row, distance));
            }
        }
        let [r, g, b, tr, tg, tb, stopped, stopped_at] = found.sums;
        let through = [tr / found.weight, tg / found.weight, tb / found.weight];
        let light = [r / found.weight, g / found.weight, b / found.weight];
        let behind = behind(inputs, x, y);
        let color = triple!(c => light[c] + through[c] * behind[c]);
        let depth = stopped.gt(F::ZERO).select(stopped_at / stopped, F::splat(f32::INFINITY));
        // Exactly nothing where all came through, also where a product and a sum are rounded as one.
        let all = found.weight * 3.0;
        let alpha = (all - (tr + tg + tb)) / all;
        let light = together([color[0], color[1], color[2], alpha]);
        let through = together([through[0], through[1], through[2], depth]);
        for (line, first) in lines.chunks_exact_mut(size[0]).zip((0..LANES).step_by(BLOCK)) {
            let line = &mut line[corner[0]..];
            // So many that the loop is unrolled, or those before the picture's edge.
            match line.first_chunk_mut::<BLOCK>() {
                Some(all) => {
                    for n in 0..BLOCK {
                        all[n] = [light[first + n], through[first + n]];
                    }
                }
                None => {
                    for (n, to) in (first..).zip(line) {
                        *to = [light[n], through[n]];
                    }
                }
            }
        }
    }
}

/// As much of one film as was marched of it, and the rest of another.
#[inline(always)]
fn mixed<S: Simd>(fine: Medium<S>, whole: Medium<S>) -> Medium<S> {
    // Of lanes that have nothing of one of them the other is taken as it is.
    let (some, part) = (fine.marched.gt(F::ZERO), fine.marched.lt(F::ONE));
    let a = some.select(part.select(fine.marched / fine.weight, F::ONE), F::ZERO);
    let b = some.select(part.select((F::ONE - fine.marched) / whole.weight, F::ZERO), F::ONE);
    let mut sums = fine.sums;
    for c in 0..8 {
        sums[c] = a * sums[c] + b * whole.sums[c];
    }
    let weight = some.select(part.select(F::ONE, fine.weight), whole.weight);
    Medium { sums, weight, marched: F::ONE }
}

impl Side {
    /// Of the pixels from `begin` on among `size`, in a film of `small` pixels.
    #[inline(always)]
    fn new(scale: u32, small: u32, begin: usize, size: u32) -> Self {
        let stands = |n: u32| stands(scale, n, size);
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

impl<S: Simd> Row<S> {
    /// Nothing.
    const NONE: Self = Self { sums: [F::ZERO; 8], distance: F::ZERO };

    /// Row `y` of a small film.
    #[inline(always)]
    fn new(small: Small<'_>, y: u32, columns: [usize; LANES]) -> Self {
        let held = small.held(lanes!(i => (y * small.width) as usize + columns[i]));
        Self { sums: sums_of(held), distance: held[0][3] }
    }
}

impl<'a, S: Simd> Patch<'a, S> {
    /// Of a film of so many pixels of the picture along each side of one of its own, for the block from `corner` on.
    #[inline(always)]
    fn new(p: &UpsampleParams, scale: u32, film: &'a [[f32; 4]], corner: [usize; 2]) -> Self {
        let (width, height) = (p.full_width.div_ceil(scale), p.full_height.div_ceil(scale));
        let small = Small { scale, width, height, film };
        let sides =
            [Side::new(scale, width, corner[0], p.full_width), Side::new(scale, height, corner[1], p.full_height)];
        let columns: [usize; LANES] = lanes!(i => sides[0].pairs[i % BLOCK][i / BLOCK] as usize);
        let (first, down) = sides[1].span();
        let mut rows = [Row::NONE; BLOCK + 2];
        let mut j = 0;
        while j < down {
            rows[j] = Row::new(small, first + j as u32, columns);
            j += 1;
        }
        Self { small, sides, rows, inverses: None }
    }

    /// What is summed, at the columns of the block and the rows of the small film, in the first half of the lanes. Where there is no
    /// surface all pixels fit, and weights are those along x times those along y.
    #[inline(always)]
    fn level(&self) -> [Sums<S>; BLOCK + 2] {
        let parts = F::of(lanes!(i => self.sides[0].parts[i % BLOCK]));
        let mut level = [[F::ZERO; 8]; BLOCK + 2];
        let mut j = 0;
        while j < self.sides[1].span().1 {
            for c in 0..8 {
                let sums = &self.rows[j].sums[c];
                level[j][c] = lerp(halves(sums, sums, 0), halves(sums, sums, 1), parts);
            }
            j += 1;
        }
        level
    }

    /// The medium in the pixels of the rows of a packet, from `row` of the block on, between the rows of a level.
    #[inline(always)]
    fn between(&self, level: &[Sums<S>; BLOCK + 2], row: usize) -> Medium<S> {
        let parts = F::of(lanes!(i => self.sides[1].parts[row + i / BLOCK]));
        let [above, below] = [self.pair(row, 0), self.pair(row, 1)];
        let mut found = Medium { weight: F::ONE, marched: F::ONE, ..Medium::NONE };
        for c in 0..8 {
            let a = halves(&level[above[0]][c], &level[above[1]][c], 0);
            let b = halves(&level[below[0]][c], &level[below[1]][c], 0);
            found.sums[c] = lerp(a, b, parts);
        }
        found
    }

    /// The rows of a patch at or before two rows of the block, or behind them.
    #[inline(always)]
    fn pair(&self, row: usize, behind: usize) -> [usize; ROWS] {
        let pairs = &self.sides[1].pairs;
        [(pairs[row][behind] - pairs[0][0]) as usize, (pairs[row + 1][behind] - pairs[0][0]) as usize]
    }

    /// The medium in the pixels of a packet, from `row` of the block on, which are `full` of the picture and whose surfaces are so
    /// far away; nothing where none of the nearest pixels was marched.
    #[inline(always)]
    fn around(&mut self, inputs: &Inputs<'_>, full: [[usize; LANES]; 2], row: usize, distance: F<S>) -> Medium<S> {
        let [across, down] = &self.sides;
        let fx = F::<S>::of(lanes!(i => across.parts[i % BLOCK]));
        let fy = F::<S>::of(lanes!(i => down.parts[row + i / BLOCK]));
        let mut sum = Medium::NONE;
        for i in 0..4 {
            let [right, below] = [i % 2, i / 2];
            let share = if right == 1 { fx } else { F::ONE - fx } * if below == 1 { fy } else { F::ONE - fy };
            let [a, b] = self.pair(row, below);
            let (a, b) = (&self.rows[a], &self.rows[b]);
            let other = halves(&a.distance, &b.distance, right);
            let marched = other.ge(F::ZERO);
            let share = marched.select(share, F::ZERO);
            sum.marched = sum.marched + share;
            let sx: [u32; LANES] = lanes!(i => across.pairs[i % BLOCK][right]);
            let sy: [u32; LANES] = lanes!(i => down.pairs[row + i / BLOCK][below]);
            let fits = fit(distance, other) * alike(inputs, full, self.small, [sx, sy]);
            sum.add(a, b, right, share * fits);
        }
        let lone = sum.marched.gt(F::ZERO).and(sum.weight.lt(F::splat(Upsample::FIT)));
        if lone.any() {
            let nearest = self.nearest(row, distance);
            for c in 0..8 {
                sum.sums[c] = lone.select(nearest[c], sum.sums[c]);
            }
            sum.weight = lone.select(F::ONE, sum.weight);
        }
        sum
    }

    /// Of the sixteen pixels around, the one whose surface is nearest to that of a pixel.
    #[inline(always)]
    fn nearest(&mut self, row: usize, distance: F<S>) -> Sums<S> {
        let [a, b] = self.pair(row, 0);
        let inverses = match &mut self.inverses {
            Some(found) => found,
            none => none.insert(inverses(self.small, &self.sides)),
        };
        let here = F::ONE / distance.max(F::splat(1e-6)).min(F::splat(1e30));
        let (mut least, mut at) = (F::splat(FAR), I::<S>::splat(5));
        for n in 0..16 {
            let there = halves(&inverses[a + n / 4][n % 4 / 2], &inverses[b + n / 4][n % 4 / 2], n % 2);
            let apart = (here - there).abs();
            let nearer = apart.lt(least);
            least = nearer.select(apart, least);
            at = nearer.either(I::splat(n as i32), at);
        }
        let [across, down] = &self.sides;
        let x: [usize; LANES] =
            lanes!(i => beside(across.pairs[i % BLOCK][0], at.0[i] as u32 % 4, self.small.width) as usize);
        let y: [usize; LANES] =
            lanes!(i => beside(down.pairs[row + i / BLOCK][0], at.0[i] as u32 / 4, self.small.height) as usize);
        sums_of(self.small.held(lanes!(i => y[i] * self.small.width as usize + x[i])))
    }
}
/// A half of the lanes of a packet, and the same half of another.
#[inline(always)]
fn halves<S: Simd>(a: &F<S>, b: &F<S>, half: usize) -> F<S> {
    let (a, b) = (&a.0[half * BLOCK..][..BLOCK], &b.0[half * BLOCK..][..BLOCK]);
    F::of(lanes!(i => if i < BLOCK { a[i] } else { b[i - BLOCK] }))
}

/// Where pixel `n` of a small film stands among `size` pixels.
#[inline(always)]
fn stands(scale: u32, n: u32, size: u32) -> u32 {
    (n * scale + scale / 2).min(size - 1)
}

/// How far `n` is on its way from `a` to `b`.
#[inline(always)]
fn part(n: u32, a: u32, b: u32) -> f32 {
    if n <= a || b <= a { 0.0 } else { (n - a) as f32 / (b - a) as f32 }
}

/// How well surfaces of two distances fit.
#[inline(always)]
fn fit<S: Simd>(a: F<S>, b: F<S>) -> F<S> {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    let far = F::splat(1e30);
    let nearer = F::ONE - a.min(b).min(far) / a.max(b).max(F::splat(1e-30)).min(far);
    (F::splat(2.0) - nearer / Upsample::NEAR).max(F::ZERO).min(F::ONE)
}

/// How well the normals in pixels and in those of a small film fit.
#[inline(always)]
fn alike<S: Simd>(
    inputs: &Inputs<'_>,
    [x, y]: [[usize; LANES]; 2],
    small: Small<'_>,
    [sx, sy]: [[u32; LANES]; 2],
) -> F<S> {
    if inputs.normals.is_empty() {
        return F::ONE;
    }
    let (p, width, each) = (inputs.p, inputs.p.full_width as usize, inputs.p.normals_each as usize);
    let fx: [usize; LANES] = lanes!(i => stands(small.scale, sx[i], p.full_width) as usize);
    let fy: [usize; LANES] = lanes!(i => stands(small.scale, sy[i], p.full_height) as usize);
    let [a, b, c, _] = apart::<S>(lanes!(i => inputs.normals[(y[i] * width + x[i]) * each]));
    let here = [a, b, c];
    let [a, b, c, _] = apart::<S>(lanes!(i => inputs.normals[(fy[i] * width + fx[i]) * each]));
    let there = [a, b, c];
    let cosine = (dot(here, there) - Upsample::COSINE) / (1.0 - Upsample::COSINE);
    let both = dot(here, here).gt(F::ZERO).and(dot(there, there).gt(F::ZERO));
    both.select(cosine.max(F::ZERO).min(F::ONE), F::ONE)
}

impl Small<'_> {
    /// The two vectors of pixels.
    #[inline(always)]
    fn held<S: Simd>(&self, at: [usize; LANES]) -> [[F<S>; 4]; 2] {
        [apart(lanes!(i => self.film[2 * at[i]])), apart(lanes!(i => self.film[2 * at[i] + 1]))]
    }
}

impl<S: Simd> Medium<S> {
    /// Nothing.
    const NONE: Self = Self { sums: [F::ZERO; 8], weight: F::ZERO, marched: F::ZERO };

    /// Adds a half of the pixels of one row and the same half of another.
    #[inline(always)]
    fn add(&mut self, a: &Row<S>, b: &Row<S>, half: usize, weight: F<S>) {
        for c in 0..8 {
            self.sums[c] = self.sums[c] + weight * halves(&a.sums[c], &b.sums[c], half);
        }
        self.weight = self.weight + weight;
    }
}

/// What pixels of a small film add to sums.
#[inline(always)]
fn sums_of<S: Simd>([light, through]: [[F<S>; 4]; 2]) -> Sums<S> {
    let stops = (F::splat(3.0) - (through[0] + through[1] + through[2])) * (1.0 / 3.0);
    let deep = through[3].lt(F::splat(FAR));
    let stopped = deep.select(stops.max(F::splat(1e-9)), F::ZERO);
    let stopped_at = deep.select(stopped * through[3], F::ZERO);
    [light[0], light[1], light[2], through[0], through[1], through[2], stopped, stopped_at]
}

/// One over the distances of the surfaces four by four around the pixels of a block, as a patch keeps them.
#[inline(always)]
fn inverses<S: Simd>(small: Small<'_>, sides: &[Side; 2]) -> [[F<S>; 2]; BLOCK + 4] {
    let mut found = [[F::ZERO; 2]; BLOCK + 4];
    let (first, down) = sides[1].span();
    // Found once, so that a loop over lanes is short enough to be unrolled, and what it finds stays in registers.
    let columns: [[usize; LANES]; 2] = [0, 2].map(
        |part| lanes!(i => 2 * beside(sides[0].pairs[i % BLOCK][0], part + (i / BLOCK) as u32, small.width) as usize),
    );
    let mut j = 0;
    while j < down + 2 {
        let line = &small.film[2 * (beside(first, j as u32, small.height) * small.width) as usize..];
        for part in 0..2 {
            let other = F::<S>::of(lanes!(i => line[columns[part][i]][3]));
            let inverse = F::ONE / other.max(F::splat(1e-6)).min(F::splat(1e30));
            found[j][part] = other.ge(F::ZERO).select(inverse, F::splat(f32::INFINITY));
        }
        j += 1;
    }
    found
}

/// Of the four pixels around one along a side, from the one before it on, number `n`; not past the first and the last.
#[inline(always)]
fn beside(at: u32, n: u32, size: u32) -> u32 {
    ((at + n).max(1) - 1).min(size - 1)
}

/// The mean radiance behind the medium over the sub-pixel positions of pixels.
#[inline(always)]
fn behind<S: Simd>(inputs: &Inputs<'_>, x: [usize; LANES], y: [usize; LANES]) -> [F<S>; 3] {
    let p = inputs.p;
    let mut sum = [F::ZERO; 3];
    let (fx, fy) = (F::of(lanes!(i => x[i] as f32)), F::of(lanes!(i => y[i] as f32)));
    for s in 0..p.samples as usize {
        let [red, green, blue, distance] = seen::<S>(inputs, x, y, s);
        let hit = distance.lt(F::splat(FAR));
        let mut radiance = [F::ZERO; 3];
        if let Some(environment) = &inputs.environment
            && hit.not().any()
        {
            let a = (fx + inputs.subpixels[2 * s]) * (2.0 / p.full_width as f32) - 1.0;
            let b = -((fy + inputs.subpixels[2 * s + 1]) * (2.0 / p.full_height as f32) - 1.0);
            let toward = triple!(c => a * p.right[c] + b * p.up[c] + p.forward[c]);
            let length = dot(toward, toward).sqrt();
            radiance = sky(environment, triple!(c => toward[c] / length));
        }
        let surface = [red, green, blue];
        sum = triple!(c => sum[c] + hit.select(surface[c], radiance[c]));
    }
    triple!(c => sum[c] * (1.0 / p.samples as f32))
}

/// The surfaces behind a sub-pixel position of pixels; as far as can be without any.
#[inline(always)]
fn seen<S: Simd>(inputs: &Inputs<'_>, x: [usize; LANES], y: [usize; LANES], s: usize) -> [F<S>; 4] {
    if inputs.surface.is_empty() {
        return [F::ZERO, F::ZERO, F::ZERO, F::splat(FAR)];
    }
    let (width, each) = (inputs.p.full_width as usize, inputs.p.surface_samples as usize);
    apart(lanes!(i => inputs.surface[(y[i] * width + x[i]) * each + s % each]))
}
