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

/// Sums over pixels of a small film.
#[derive(Default)]
struct Medium {
    radiance: [f32; 3],
    transmittance: [f32; 3],
    /// Light stopped, and the same weighed with its distance.
    stopped: f32,
    stopped_at: f32,
    weight: f32,
    /// How much of the nearest pixels, by their bilinear weights, was marched.
    marched: f32,
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
        environment: match stage.environment {
            Some(field) => Some(Sky {
                texels: bytemuck::cast_slice(read.field(field)?),
                width: p.environment_width,
                height: p.environment_height,
                tint: p.environment,
            }),
            None => None,
        },
        subpixels: read.buf(stage.subpixels)?,
    };
    let inputs = &inputs;
    let film: &mut [Pixel] = bytemuck::cast_slice_mut(out.remove(0));
    let (width, height) = (p.full_width as usize, p.full_height as usize);
    let across = width.div_ceil(BLOCK);
    film[..width * height].par_chunks_mut(BLOCK * width).enumerate().for_each(|(row, film)| {
        for column in (0..across).filter(|x| range.contains(&((row * across + x) as u32))) {
            for part in 0..BLOCK / ROWS {
                let corner = [column * BLOCK, row * BLOCK + part * ROWS];
                let mut pixels = [[[0.0; 4]; 2]; LANES];
                let out = &mut pixels;
                compiled_for!(isa, upsample<S>(inputs: &Inputs<'_>, corner: [usize; 2], out: &mut [Pixel; LANES]));
                let lines = film.chunks_exact_mut(width).skip(part * ROWS);
                for (line, found) in lines.zip(pixels.chunks_exact(BLOCK)) {
                    let line = &mut line[corner[0]..];
                    let count = line.len().min(BLOCK);
                    line[..count].copy_from_slice(&found[..count]);
                }
            }
        }
    });
    Ok(())
}

/// Sixteen pixels from `corner` on, in rows of a block's width. Those past the picture's edge are as its last.
#[inline(always)]
fn upsample<S: Simd>(inputs: &Inputs<'_>, corner: [usize; 2], out: &mut [Pixel; LANES]) {
    let p = inputs.p;
    let (width, height) = (p.full_width as usize, p.full_height as usize);
    let x: [usize; LANES] = lanes!(i => (corner[0] + i % BLOCK).min(width - 1));
    let y: [usize; LANES] = lanes!(i => (corner[1] + i / BLOCK).min(height - 1));
    let behind = behind::<S>(inputs, x, y);
    for i in 0..LANES {
        let distance = seen(inputs, x[i], y[i], 0)[3].min(FAR);
        let mut found = Medium::default();
        if !inputs.rims.is_empty() {
            found = around(inputs, [x[i] as u32, y[i] as u32], small(p, p.scale / 2, inputs.rims), distance);
        }
        if found.marched < 1.0 {
            let whole = around(inputs, [x[i] as u32, y[i] as u32], small(p, p.scale, inputs.medium), distance);
            found = mixed(found, whole);
        }
        let through = triple!(c => found.transmittance[c] / found.weight);
        let color = triple!(c => found.radiance[c] / found.weight + through[c] * behind[c].0[i]);
        let depth = if found.stopped > 0.0 { found.stopped_at / found.stopped } else { f32::INFINITY };
        let mean = (through[0] + through[1] + through[2]) * (1.0 / 3.0);
        out[i] = [[color[0], color[1], color[2], 1.0 - mean], [through[0], through[1], through[2], depth]];
    }
}

/// A film of so many pixels of the picture along each side of one of its own.
fn small<'a>(p: &UpsampleParams, scale: u32, film: &'a [Pixel]) -> Small<'a> {
    Small { scale, width: p.full_width.div_ceil(scale), height: p.full_height.div_ceil(scale), film }
}

/// As much of one film as was marched of it, and the rest of another.
fn mixed(fine: Medium, whole: Medium) -> Medium {
    if fine.marched == 0.0 {
        return whole;
    }
    let (a, b) = (fine.marched / fine.weight, (1.0 - fine.marched) / whole.weight);
    Medium {
        radiance: triple!(c => a * fine.radiance[c] + b * whole.radiance[c]),
        transmittance: triple!(c => a * fine.transmittance[c] + b * whole.transmittance[c]),
        stopped: a * fine.stopped + b * whole.stopped,
        stopped_at: a * fine.stopped_at + b * whole.stopped_at,
        weight: 1.0,
        marched: 1.0,
    }
}

/// The medium in a pixel whose surface is so far away; nothing where none of the nearest pixels was marched.
fn around(inputs: &Inputs<'_>, [x, y]: [u32; 2], small: Small<'_>, distance: f32) -> Medium {
    let p = inputs.p;
    let (x0, y0) = (first(small, x), first(small, y));
    let (x1, y1) = ((x0 + 1).min(small.width - 1), (y0 + 1).min(small.height - 1));
    let fx = part(x, stands(small, x0, p.full_width), stands(small, x1, p.full_width));
    let fy = part(y, stands(small, y0, p.full_height), stands(small, y1, p.full_height));
    let mut sum = Medium::default();
    for (sx, sy, share) in
        [(x0, y0, (1.0 - fx) * (1.0 - fy)), (x1, y0, fx * (1.0 - fy)), (x0, y1, (1.0 - fx) * fy), (x1, y1, fx * fy)]
    {
        let [[.., other], _] = held(small, sx, sy);
        if other < 0.0 {
            continue;
        }
        sum.marched += share;
        add(&mut sum, small, sx, sy, share * fit(distance, other) * alike(inputs, [x, y], small, [sx, sy]));
    }
    if sum.marched == 0.0 || sum.weight >= Upsample::FIT {
        return sum;
    }
    let (mut least, mut at) = (FAR, [x0, y0]);
    for i in 0..16 {
        let sx = ((x0 + i % 4).max(1) - 1).min(small.width - 1);
        let sy = ((y0 + i / 4).max(1) - 1).min(small.height - 1);
        let [[.., other], _] = held(small, sx, sy);
        let apart = (1.0 / distance.max(1e-6) - 1.0 / other.max(1e-6)).abs();
        if other >= 0.0 && apart < least {
            (least, at) = (apart, [sx, sy]);
        }
    }
    sum = Medium { marched: sum.marched, ..Medium::default() };
    add(&mut sum, small, at[0], at[1], 1.0);
    sum
}

/// The pixel of a small film at or before pixel `n` of the full picture, along one side; the first one before it.
fn first(small: Small<'_>, n: u32) -> u32 {
    n.saturating_sub(small.scale / 2) / small.scale
}

/// Where pixel `n` of a small film stands among `size` pixels.
fn stands(small: Small<'_>, n: u32, size: u32) -> u32 {
    (n * small.scale + small.scale / 2).min(size - 1)
}

/// How far `n` is on its way from `a` to `b`.
fn part(n: u32, a: u32, b: u32) -> f32 {
    if n <= a || b <= a { 0.0 } else { (n - a) as f32 / (b - a) as f32 }
}

/// How well surfaces of two distances fit.
fn fit(a: f32, b: f32) -> f32 {
    let nearer = 1.0 - a.min(b) / a.max(b).max(1e-30);
    (2.0 - nearer / Upsample::NEAR).clamp(0.0, 1.0)
}

/// How well the normals in a pixel and in one of a small film fit.
fn alike(inputs: &Inputs<'_>, [x, y]: [u32; 2], small: Small<'_>, [sx, sy]: [u32; 2]) -> f32 {
    let (p, width) = (inputs.p, inputs.p.full_width);
    let (fx, fy) = (stands(small, sx, width), stands(small, sy, p.full_height));
    let at = [y * width + x, fy * width + fx].map(|at| inputs.normals.get(at as usize * p.normals_each as usize));
    let [Some(here), Some(there)] = at else { return 1.0 };
    let cosine = |a: &[f32; 4], b: &[f32; 4]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if cosine(here, here) == 0.0 || cosine(there, there) == 0.0 {
        return 1.0;
    }
    let cosine = cosine(here, there);
    ((cosine - Upsample::COSINE) / (1.0 - Upsample::COSINE)).clamp(0.0, 1.0)
}

/// A pixel of a small film.
fn held(small: Small<'_>, sx: u32, sy: u32) -> Pixel {
    small.film[(sy * small.width + sx) as usize]
}

/// Adds a pixel of a small film.
fn add(sum: &mut Medium, small: Small<'_>, sx: u32, sy: u32, weight: f32) {
    let [light, through] = held(small, sx, sy);
    sum.radiance = triple!(c => sum.radiance[c] + weight * light[c]);
    sum.transmittance = triple!(c => sum.transmittance[c] + weight * through[c]);
    sum.weight += weight;
    if through[3] < FAR {
        let stopped = weight * (1.0 - (through[0] + through[1] + through[2]) * (1.0 / 3.0)).max(1e-9);
        sum.stopped += stopped;
        sum.stopped_at += stopped * through[3];
    }
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
