//! `accumulate`: the mean of the medium over the pictures of a sequence.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Accumulate, AccumulateParams, FAR, March, accumulate_mode};
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::triple;

const BLOCK: usize = March::BLOCK as usize;

/// Two vectors of a pixel of a film.
type Pixel = [[f32; 4]; 2];
/// Three vectors of a pixel of a history.
type Kept = [[f32; 4]; 3];

#[derive(Clone, Copy)]
struct Inputs<'a> {
    p: &'a AccumulateParams,
    medium: &'a [Pixel],
    last: &'a [Kept],
}

/// What is kept of a pixel.
#[derive(Clone, Copy)]
struct Past {
    radiance: [f32; 3],
    /// Pictures that it is the mean of.
    count: f32,
    transmittance: [f32; 3],
    depth: f32,
    surface: f32,
}

/// No history.
const NONE: Past = Past { radiance: [0.0; 3], count: 0.0, transmittance: [0.0; 3], depth: f32::INFINITY, surface: FAR };

pub(crate) fn run(stage: &Accumulate, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.next)?;
    memory.take(stage.mean)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        medium: bytemuck::cast_slice(read.buf(stage.medium)?),
        last: bytemuck::cast_slice(read.buf(stage.last)?),
    };
    let mean: &mut [Pixel] = bytemuck::cast_slice_mut(out.remove(1));
    let next: &mut [Kept] = bytemuck::cast_slice_mut(out.remove(0));
    let (width, height) = (p.width as usize, p.height as usize);
    let across = width.div_ceil(BLOCK);
    let rows = next[..width * height].par_chunks_mut(width).zip(mean[..width * height].par_chunks_mut(width));
    rows.enumerate().for_each(|(y, (next, mean))| {
        for (x, (next, mean)) in next.iter_mut().zip(mean).enumerate() {
            if range.contains(&((y / BLOCK * across + x / BLOCK) as u32)) {
                let (at, next, mean) = ([x as u32, y as u32], &mut *next, &mut *mean);
                compiled_for!(isa, accumulate(inputs: Inputs<'_>, at: [u32; 2], next: &mut Kept, mean: &mut Pixel));
            }
        }
    });
    Ok(())
}

/// What a pixel leaves to the next picture, and its mean.
#[inline(always)]
fn accumulate(inputs: Inputs<'_>, [x, y]: [u32; 2], next: &mut Kept, mean: &mut Pixel) {
    let p = inputs.p;
    let at = (y * p.width + x) as usize;
    let [[r, g, b, surface], [tr, tg, tb, depth]] = inputs.medium[at];
    let (light, through) = ([r, g, b], [tr, tg, tb]);
    let past = if p.mode == accumulate_mode::MOVED {
        clamped(inputs, followed(inputs, x, y), x, y)
    } else {
        recalled(inputs, at)
    };
    let count = past.count.min(p.most);
    let mut now = past;
    if p.mode != accumulate_mode::AGAIN || past.count == 0.0 {
        let share = 1.0 / (count + 1.0);
        now.radiance = triple!(c => past.radiance[c] + (light[c] - past.radiance[c]) * share);
        now.transmittance = triple!(c => past.transmittance[c] + (through[c] - past.transmittance[c]) * share);
        let before = count * stopped(past.transmittance, past.depth);
        let added = stopped(through, depth);
        now.depth = if before > 0.0 && added > 0.0 {
            past.depth + (depth - past.depth) * (added / (before + added))
        } else if added > 0.0 {
            depth
        } else if before > 0.0 {
            past.depth
        } else {
            f32::INFINITY
        };
        now.count = count + 1.0;
    }
    if surface < 0.0 {
        // It was not marched.
        now = Past { radiance: light, count: 0.0, transmittance: through, depth, surface: FAR };
    }
    let ([r, g, b], [tr, tg, tb]) = (now.radiance, now.transmittance);
    let through = [tr, tg, tb, now.depth];
    *next = [[r, g, b, now.count], through, [surface, 0.0, 0.0, 0.0]];
    *mean = [[r, g, b, surface], through];
}

/// The history of a pixel; none where it is not finite.
#[inline(always)]
fn recalled(inputs: Inputs<'_>, at: usize) -> Past {
    let [[r, g, b, count], [tr, tg, tb, depth], [surface, ..]] = inputs.last[at];
    if [r, g, b, count, tr, tg, tb].into_iter().all(finite) {
        Past { radiance: [r, g, b], count, transmittance: [tr, tg, tb], depth, surface }
    } else {
        NONE
    }
}

/// The history of what a pixel shows, where the last view saw it.
#[inline(always)]
fn followed(inputs: Inputs<'_>, x: u32, y: u32) -> Past {
    let p = inputs.p;
    let [[.., distance], [.., depth]] = inputs.medium[(y * p.width + x) as usize];
    let dot = |a: [f32; 3], b: [f32; 4]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length = |v: [f32; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let (width, height, scale) = (p.full_width as f32, p.full_height as f32, p.scale as f32);
    let fx = (x * p.scale + p.scale / 2).min(p.full_width - 1);
    let fy = (y * p.scale + p.scale / 2).min(p.full_height - 1);
    let a = (fx as f32 + 0.5) * (2.0 / width) - 1.0;
    let b = 1.0 - (fy as f32 + 0.5) * (2.0 / height);
    let toward = triple!(c => a * p.right[c] + b * p.up[c] + p.forward[c]);
    let direction = triple!(c => toward[c] / length(toward));
    let seen = |t: f32| triple!(c => p.moved[c] + t * direction[c]);
    let point = if depth < FAR {
        seen(depth)
    } else if distance < FAR {
        seen(distance)
    } else {
        direction
    };
    let ahead = dot(point, p.last_forward);
    if ahead <= 0.0 {
        return NONE;
    }
    let px = (dot(point, p.last_right) / ahead + 1.0) * (0.5 * width) - 0.5;
    let py = (1.0 - dot(point, p.last_up) / ahead) * (0.5 * height) - 0.5;
    let (u, v) = ((px - (p.scale / 2) as f32) / scale, (py - (p.scale / 2) as f32) / scale);
    let (right, bottom) = (p.width as f32 - 1.0, p.height as f32 - 1.0);
    if !((-0.5..=right + 0.5).contains(&u) && (-0.5..=bottom + 0.5).contains(&v)) {
        return NONE;
    }
    let surface = if distance < FAR { length(seen(distance)) } else { FAR };
    let mut sum = Past { depth: 0.0, surface, ..NONE };
    let (mut weights, mut stops) = (0.0, 0.0);
    for (across, down) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (column, row) = (u.floor() + across, v.floor() + down);
        let share = (1.0 - (u - column).abs()) * (1.0 - (v - row).abs());
        let place = row.clamp(0.0, bottom) as usize * p.width as usize + column.clamp(0.0, right) as usize;
        let past = recalled(inputs, place);
        let weight = if past.count > 0.0 { share * fit(past.surface, surface) } else { 0.0 };
        sum.radiance = triple!(c => sum.radiance[c] + weight * past.radiance[c]);
        sum.transmittance = triple!(c => sum.transmittance[c] + weight * past.transmittance[c]);
        sum.count += weight * past.count;
        weights += weight;
        let stop = weight * stopped(past.transmittance, past.depth);
        if stop > 0.0 {
            stops += stop;
            sum.depth += stop * past.depth;
        }
    }
    if weights < Accumulate::FIT {
        return NONE;
    }
    sum.radiance = triple!(c => sum.radiance[c] / weights);
    sum.transmittance = triple!(c => sum.transmittance[c] / weights);
    sum.count /= weights;
    sum.depth = if stops > 0.0 { sum.depth / stops } else { f32::INFINITY };
    sum
}

/// A history within the range of the pixels around.
#[inline(always)]
fn clamped(inputs: Inputs<'_>, past: Past, x: u32, y: u32) -> Past {
    let p = inputs.p;
    let (mut least, mut most) = ([[FAR; 3]; 2], [[-FAR; 3]; 2]);
    for i in 0..9 {
        let column = ((x + i % 3).max(1) - 1).min(p.width - 1);
        let row = ((y + i / 3).max(1) - 1).min(p.height - 1);
        let pixel = inputs.medium[(row * p.width + column) as usize];
        if pixel[0][3] < 0.0 {
            continue;
        }
        for (half, values) in pixel.iter().enumerate() {
            least[half] = triple!(c => least[half][c].min(values[c]));
            most[half] = triple!(c => most[half][c].max(values[c]));
        }
    }
    let within = |v: [f32; 3], half: usize| triple!(c => v[c].max(least[half][c]).min(most[half][c]));
    Past { radiance: within(past.radiance, 0), transmittance: within(past.transmittance, 1), ..past }
}

/// Whether a value is neither infinite nor no number.
#[inline(always)]
fn finite(v: f32) -> bool {
    v.is_finite()
}

/// How well surfaces of two distances fit.
#[inline(always)]
fn fit(a: f32, b: f32) -> f32 {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    let nearer = 1.0 - a.min(b).min(1e30) / a.max(b).clamp(1e-30, 1e30);
    (2.0 - nearer / Accumulate::NEAR).clamp(0.0, 1.0)
}

/// What is stopped, with which a depth is weighed; nothing where there is no depth.
#[inline(always)]
fn stopped(transmittance: [f32; 3], depth: f32) -> f32 {
    if !finite(depth) {
        return 0.0;
    }
    ((3.0 - (transmittance[0] + transmittance[1] + transmittance[2])) * (1.0 / 3.0)).max(1e-9)
}
