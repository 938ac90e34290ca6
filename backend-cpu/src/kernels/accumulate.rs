//! `accumulate`: the mean of the medium over the pictures of a sequence.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Accumulate, AccumulateParams, FAR, March, accumulate_mode};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, apart, dot, lanes, together, triple};
use crate::simd::Simd;

const BLOCK: usize = March::BLOCK as usize;

/// Two vectors of a pixel of a film.
type Pixel = [[f32; 4]; 2];
/// Three vectors of a pixel of a history.
type Kept = [[f32; 4]; 3];

/// Floats of a pixel.
const PIXEL: usize = 8;

#[derive(Clone, Copy)]
struct Inputs<'a> {
    p: &'a AccumulateParams,
    /// Two vectors a pixel.
    medium: &'a [[f32; 4]],
    /// Three vectors a pixel.
    last: &'a [[f32; 4]],
}

/// What is kept of sixteen pixels.
#[derive(Clone, Copy)]
struct Past<S> {
    radiance: [F<S>; 3],
    /// Pictures that it is the mean of.
    count: F<S>,
    transmittance: [F<S>; 3],
    depth: F<S>,
    surface: F<S>,
}

impl<S: Simd> Past<S> {
    /// No history.
    const NONE: Self =
        Self { radiance: [F::ZERO; 3], count: F::ZERO, transmittance: [F::ZERO; 3], depth: F::ZERO, surface: F::ZERO };

    /// No history in lanes that `have` none.
    #[inline(always)]
    fn only(self, have: M<S>) -> Self {
        Self {
            radiance: triple!(c => have.select(self.radiance[c], F::ZERO)),
            count: have.select(self.count, F::ZERO),
            transmittance: triple!(c => have.select(self.transmittance[c], F::ZERO)),
            depth: have.select(self.depth, F::splat(f32::INFINITY)),
            surface: have.select(self.surface, F::splat(FAR)),
        }
    }
}

pub(crate) fn run(stage: &Accumulate, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.next)?;
    memory.take(stage.mean)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let (width, height) = (p.width as usize, p.height as usize);
    let inputs = Inputs { p, medium: read.buf(stage.medium)?, last: read.buf(stage.last)? };
    let mean: &mut [Pixel] = bytemuck::cast_slice_mut(out.remove(1));
    let next: &mut [Kept] = bytemuck::cast_slice_mut(out.remove(0));
    let across = width.div_ceil(BLOCK);
    let rows = next[..width * height].par_chunks_mut(width).zip(mean[..width * height].par_chunks_mut(width));
    rows.enumerate().for_each(|(y, (next, mean))| {
        // The blocks of the range in this row.
        let first = y / BLOCK * across;
        let column = |block: u32| ((block as usize).clamp(first, first + across) - first) * BLOCK;
        let columns = column(range.start)..column(range.end).min(width);
        compiled_for!(
            isa,
            row<S>(inputs: Inputs<'_>, y: usize, columns: Range<usize>, next: &mut [Kept], mean: &mut [Pixel])
        );
    });
    Ok(())
}

/// Some columns of a row.
#[inline(always)]
fn row<S: Simd>(inputs: Inputs<'_>, y: usize, columns: Range<usize>, next: &mut [Kept], mean: &mut [Pixel]) {
    let mut x = columns.start;
    while x < columns.end {
        let end = columns.end.min(x + LANES);
        accumulate::<S>(inputs, [x, y], &mut next[x..end], &mut mean[x..end]);
        x = end;
    }
}

/// What up to sixteen pixels of a row leave to the next picture, and their mean.
#[inline(always)]
fn accumulate<S: Simd>(inputs: Inputs<'_>, [x, y]: [usize; 2], next: &mut [Kept], mean: &mut [Pixel]) {
    let p = inputs.p;
    let last = mean.len() - 1;
    let at: [usize; LANES] = lanes!(i => y * p.width as usize + x + i.min(last));
    let column = F::<S>::of(lanes!(i => (x + i.min(last)) as f32));
    let [r, g, b, surface] = apart(lanes!(i => inputs.medium[2 * at[i]]));
    let [tr, tg, tb, depth] = apart(lanes!(i => inputs.medium[2 * at[i] + 1]));
    let (light, through) = ([r, g, b], [tr, tg, tb]);
    let past = if p.mode == accumulate_mode::MOVED {
        clamped(inputs, followed(inputs, column, y, surface, depth), [x, y], last)
    } else {
        recalled(inputs, at)
    };
    let count = past.count.min(F::splat(p.most));
    let share = F::ONE / (count + 1.0);
    let before = count * stopped(past.transmittance, past.depth);
    let added = stopped(through, depth);
    let (had, adds) = (before.gt(F::ZERO), added.gt(F::ZERO));
    let both = past.depth + (depth - past.depth) * (added / (before + added));
    let either = adds.select(depth, had.select(past.depth, F::splat(f32::INFINITY)));
    let mixed = Past {
        radiance: triple!(c => past.radiance[c] + (light[c] - past.radiance[c]) * share),
        count: count + 1.0,
        transmittance: triple!(c => past.transmittance[c] + (through[c] - past.transmittance[c]) * share),
        depth: had.and(adds).select(both, either),
        surface,
    };
    let again = if p.mode == accumulate_mode::AGAIN { past.count.gt(F::ZERO) } else { M::NONE };
    // It was not marched.
    let bare = surface.lt(F::ZERO);
    let now = |marched: F<S>, kept: F<S>, own: F<S>| bare.select(own, again.select(kept, marched));
    let radiance = triple!(c => now(mixed.radiance[c], past.radiance[c], light[c]));
    let transmittance = triple!(c => now(mixed.transmittance[c], past.transmittance[c], through[c]));
    let depth = now(mixed.depth, past.depth, depth);
    let count = now(mixed.count, past.count, F::ZERO);
    let [r, g, b] = radiance;
    let (counted, seen) = (together([r, g, b, count]), together([r, g, b, surface]));
    let [tr, tg, tb] = transmittance;
    let through = together([tr, tg, tb, depth]);
    for (i, (next, mean)) in next.iter_mut().zip(mean).enumerate() {
        *next = [counted[i], through[i], [surface.0[i], 0.0, 0.0, 0.0]];
        *mean = [seen[i], through[i]];
    }
}

/// The history of pixels; none where it is not finite.
#[inline(always)]
fn recalled<S: Simd>(inputs: Inputs<'_>, at: [usize; LANES]) -> Past<S> {
    let [r, g, b, count] = apart::<S>(lanes!(i => inputs.last[3 * at[i]]));
    let [tr, tg, tb, depth] = apart(lanes!(i => inputs.last[3 * at[i] + 1]));
    let surface = F::of(lanes!(i => inputs.last[3 * at[i] + 2][0]));
    let light = finite(r).and(finite(g)).and(finite(b));
    let through = finite(tr).and(finite(tg)).and(finite(tb));
    let past = Past { radiance: [r, g, b], count, transmittance: [tr, tg, tb], depth, surface };
    past.only(light.and(through).and(finite(count)))
}

/// The history of what pixels of a row show, where the last view saw it.
#[inline(always)]
fn followed<S: Simd>(inputs: Inputs<'_>, x: F<S>, y: usize, distance: F<S>, depth: F<S>) -> Past<S> {
    let p = inputs.p;
    let along = |v: [F<S>; 3], axis: [f32; 4]| v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2];
    let (width, height, scale) = (p.full_width as f32, p.full_height as f32, p.scale as f32);
    let half = (p.scale / 2) as f32;
    let fx = (x * scale + half).min(F::splat((p.full_width - 1) as f32));
    let fy = (y as u32 * p.scale + p.scale / 2).min(p.full_height - 1);
    let a = (fx + 0.5) * (2.0 / width) - 1.0;
    let b = 1.0 - (fy as f32 + 0.5) * (2.0 / height);
    let toward = triple!(c => a * p.right[c] + F::splat(b * p.up[c]) + F::splat(p.forward[c]));
    let size = dot(toward, toward).sqrt();
    let direction = triple!(c => toward[c] / size);
    let (deep, near) = (depth.lt(F::splat(FAR)), distance.lt(F::splat(FAR)));
    let t = deep.select(depth, distance);
    let seen = deep.or(near);
    let point = triple!(c => seen.select(F::splat(p.moved[c]) + t * direction[c], direction[c]));
    let ahead = along(point, p.last_forward);
    let px = (along(point, p.last_right) / ahead + 1.0) * (0.5 * width) - 0.5;
    let py = (F::ONE - along(point, p.last_up) / ahead) * (0.5 * height) - 0.5;
    let (u, v) = ((px - half) / scale, (py - half) / scale);
    let (right, bottom) = (p.width as f32 - 1.0, p.height as f32 - 1.0);
    let across = u.ge(F::splat(-0.5)).and(F::splat(right + 0.5).ge(u));
    let down = v.ge(F::splat(-0.5)).and(F::splat(bottom + 0.5).ge(v));
    let within = ahead.gt(F::ZERO).and(across).and(down);
    if !within.any() {
        return Past::NONE.only(M::NONE);
    }
    let there = triple!(c => F::splat(p.moved[c]) + distance * direction[c]);
    let surface = near.select(dot(there, there).sqrt(), F::splat(FAR));
    let mut sum = Past { surface, ..Past::NONE };
    let (mut weights, mut stops) = (F::ZERO, F::ZERO);
    let (left, top) = (u.floor(), v.floor());
    for (across, down) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (column, row) = (left + across, top + down);
        let share = (F::ONE - (u - column).abs()) * (F::ONE - (v - row).abs());
        let row = row.max(F::ZERO).min(F::splat(bottom)).to_int();
        let column = column.max(F::ZERO).min(F::splat(right)).to_int();
        let past = recalled(inputs, lanes!(i => row.0[i] as usize * p.width as usize + column.0[i] as usize));
        let weight = past.count.gt(F::ZERO).select(share * fit(past.surface, surface), F::ZERO);
        sum.radiance = triple!(c => sum.radiance[c] + weight * past.radiance[c]);
        sum.transmittance = triple!(c => sum.transmittance[c] + weight * past.transmittance[c]);
        sum.count = sum.count + weight * past.count;
        weights = weights + weight;
        let stop = weight * stopped(past.transmittance, past.depth);
        let stands = stop.gt(F::ZERO);
        stops = stands.select(stops + stop, stops);
        sum.depth = stands.select(sum.depth + stop * past.depth, sum.depth);
    }
    let mean = Past {
        radiance: triple!(c => sum.radiance[c] / weights),
        count: sum.count / weights,
        transmittance: triple!(c => sum.transmittance[c] / weights),
        depth: stops.gt(F::ZERO).select(sum.depth / stops, F::splat(f32::INFINITY)),
        surface,
    };
    mean.only(within.and(weights.ge(F::splat(Accumulate::FIT))))
}

/// A history within the range of the pixels around; `last` counts the pixels behind the first at `x`, `y`.
#[inline(always)]
fn clamped<S: Simd>(inputs: Inputs<'_>, past: Past<S>, [x, y]: [usize; 2], last: usize) -> Past<S> {
    /// Columns of a packet, and one beside it at each end.
    const WINDOW: usize = LANES + 2;
    let p = inputs.p;
    let (width, floats): (_, &[f32]) = (p.width as usize, bytemuck::cast_slice(inputs.medium));
    let rows = [y.max(1) - 1, y, (y + 1).min(p.height as usize - 1)];
    // The range of each column, all values of a pixel side by side, two pixels a packet.
    let (mut least, mut most) = ([FAR; PIXEL * WINDOW], [-FAR; PIXEL * WINDOW]);
    let surfaces = M::<S>::of(lanes!(i => if i % PIXEL == 3 { u32::MAX } else { 0 }));
    let mut i = 0;
    while i < last + 3 {
        let columns = [(x + i).max(1) - 1, x + i].map(|column| column.min(width - 1));
        let (mut low, mut high) = (F::<S>::splat(FAR), F::<S>::splat(-FAR));
        for row in rows {
            let [a, b] = columns.map(|column| PIXEL * (row * width + column));
            let (a, b) = (&floats[a..][..PIXEL], &floats[b..][..PIXEL]);
            let pair = F::<S>::of(lanes!(i => if i < PIXEL { a[i] } else { b[i - PIXEL] }));
            let (mut below, mut above) = (pair.min(low), pair.max(high));
            if surfaces.and(pair.lt(F::ZERO)).any() {
                let bare = M::<S>::of(lanes!(i => if pair.0[i / PIXEL * PIXEL + 3] < 0.0 { u32::MAX } else { 0 }));
                (below, above) = (bare.select(low, below), bare.select(high, above));
            }
            (low, high) = (below, above);
        }
        least[PIXEL * i..][..LANES].copy_from_slice(&low.0);
        most[PIXEL * i..][..LANES].copy_from_slice(&high.0);
        i += 2;
    }
    // The range of three columns in place of the first.
    let (mut ranges, mut i) = ([[0.0; PIXEL * LANES]; 2], 0);
    while i <= last {
        let at = |of: &[f32; PIXEL * WINDOW], n: usize| F::<S>::of(lanes!(l => of[PIXEL * (i + n) + l]));
        let low = at(&least, 0).min(at(&least, 1)).min(at(&least, 2));
        let high = at(&most, 0).max(at(&most, 1)).max(at(&most, 2));
        ranges[0][PIXEL * i..][..LANES].copy_from_slice(&low.0);
        ranges[1][PIXEL * i..][..LANES].copy_from_slice(&high.0);
        i += 2;
    }
    let [low, high]: [&[[f32; 4]]; 2] = [bytemuck::cast_slice(&ranges[0]), bytemuck::cast_slice(&ranges[1])];
    let (least, most) = (apart::<S>(lanes!(i => low[2 * i])), apart::<S>(lanes!(i => high[2 * i])));
    let radiance = triple!(c => past.radiance[c].max(least[c]).min(most[c]));
    let (least, most) = (apart::<S>(lanes!(i => low[2 * i + 1])), apart::<S>(lanes!(i => high[2 * i + 1])));
    let transmittance = triple!(c => past.transmittance[c].max(least[c]).min(most[c]));
    Past { radiance, transmittance, ..past }
}

/// Whether values are neither infinite nor no numbers.
#[inline(always)]
fn finite<S: Simd>(v: F<S>) -> M<S> {
    v.abs().lt(F::splat(f32::INFINITY))
}

/// How well surfaces of two distances fit.
#[inline(always)]
fn fit<S: Simd>(a: F<S>, b: F<S>) -> F<S> {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    let far = F::splat(1e30);
    let nearer = F::ONE - a.min(b).min(far) / a.max(b).max(F::splat(1e-30)).min(far);
    (F::splat(2.0) - nearer / Accumulate::NEAR).max(F::ZERO).min(F::ONE)
}

/// What is stopped, with which a depth is weighed; nothing where there is no depth.
#[inline(always)]
fn stopped<S: Simd>(transmittance: [F<S>; 3], depth: F<S>) -> F<S> {
    let stops = (F::splat(3.0) - (transmittance[0] + transmittance[1] + transmittance[2])) * (1.0 / 3.0);
    finite(depth).select(stops.max(F::splat(1e-9)), F::ZERO)
}
