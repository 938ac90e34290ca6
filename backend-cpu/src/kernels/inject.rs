//! `inject`: the density of a medium that is described instead of sampled.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::media::LARGEST;
use airlight_core::stage::{BlobRecord, Inject, InjectParams, inject_kind};
use rayon::prelude::*;

use super::noise::noise_factor;
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, dot, lanes, triple};
use crate::simd::Simd;

const BRICK: usize = Inject::BRICK as usize;
/// Packets of a brick: two rows of eight samples each.
const PACKETS: usize = BRICK * BRICK * BRICK / LANES;
/// Packets of a slice of a brick.
const ACROSS: usize = PACKETS / BRICK;

/// The density of a brick: packet z · 4 + y / 2, lane y % 2 · 8 + x.
type Sums<S> = [F<S>; PACKETS];

struct Inputs<'a> {
    p: &'a InjectParams,
    base: &'a [f32],
    blobs: &'a [BlobRecord],
    starts: &'a [u32],
    list: &'a [u32],
}

/// A row of bricks along x: eight rows of samples in each of up to eight slices.
struct Row<'a> {
    y: u32,
    z: u32,
    bricks: Range<u32>,
    slices: Vec<&'a mut [f32]>,
}

pub(crate) fn run(stage: &Inject, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        base: match stage.base {
            Some(field) => read.field(field)?,
            None => &[],
        },
        blobs: read.opt(stage.blobs)?,
        starts: read.opt(stage.starts)?,
        list: read.opt(stage.list)?,
    };
    let [nx, ny, nz] = [0, 1, 2].map(|a| p.dims[a] as usize);
    let out = &mut bytemuck::cast_slice_mut::<u8, f32>(out.remove(0))[..nx * ny * nz];
    let mut rows = rows(p, range, out);
    rows.par_iter_mut().for_each(|row| {
        let inputs = &inputs;
        compiled_for!(isa, inject<S>(inputs: &Inputs<'_>, row: &mut Row<'_>));
    });
    Ok(())
}

/// The rows of bricks that a range of the work axis touches, with the samples that are theirs.
fn rows<'a>(p: &InjectParams, range: Range<u32>, out: &'a mut [f32]) -> Vec<Row<'a>> {
    let [across, deep, ..] = p.bricks;
    let (nx, slice) = (p.dims[0] as usize, p.dims[0] as usize * p.dims[1] as usize);
    let mut rows = Vec::new();
    let layers = range.start / (across * deep)..range.end.div_ceil(across * deep);
    let from = layers.start as usize * BRICK * slice;
    for (z, layer) in layers.zip(out[from..].chunks_mut(BRICK * slice)) {
        let mut bands: Vec<Vec<&mut [f32]>> = (0..deep).map(|_| Vec::with_capacity(BRICK)).collect();
        for samples in layer.chunks_mut(slice) {
            bands.iter_mut().zip(samples.chunks_mut(BRICK * nx)).for_each(|(band, samples)| band.push(samples));
        }
        for (y, slices) in (0..).zip(bands) {
            let first = (z * deep + y) * across;
            let bricks =
                range.start.clamp(first, first + across) - first..range.end.clamp(first, first + across) - first;
            if !bricks.is_empty() {
                rows.push(Row { y, z, bricks, slices });
            }
        }
    }
    rows
}

#[inline(always)]
fn inject<S: Simd>(inputs: &Inputs<'_>, row: &mut Row<'_>) {
    let p = inputs.p;
    let nx = p.dims[0] as usize;
    for x in row.bricks.clone() {
        let brick = [x, row.y, row.z];
        let wide = (nx - x as usize * BRICK).min(BRICK);
        let mut sums: Sums<S> = [F::ZERO; PACKETS];
        let more = p.dims[3] == inject_kind::GAUSSIANS && p.list_begin > 0;
        if more {
            // What the passes before left.
            for (z, slice) in row.slices.iter().enumerate() {
                for (y, line) in slice.chunks(nx).enumerate() {
                    let lane = y % 2 * BRICK;
                    sums[z * ACROSS + y / 2].0[lane..lane + wide].copy_from_slice(&line[x as usize * BRICK..][..wide]);
                }
            }
        }
        match p.dims[3] {
            inject_kind::GAUSSIANS => gaussians(inputs, brick, &mut sums),
            inject_kind::HEIGHT_FOG => {
                for (n, sum) in sums.iter_mut().enumerate() {
                    *sum = (-place(p, brick, n)[1].max(F::ZERO)).exp_negative() * p.density;
                }
            }
            kind => {
                for (n, sum) in sums.iter_mut().enumerate() {
                    let value = if kind == inject_kind::DETAIL { base(inputs, brick, n) } else { F::splat(p.density) };
                    *sum = value * noise_factor(place(p, brick, n), p.octaves, p.seed, p.contrast);
                }
            }
        }
        for (z, slice) in row.slices.iter_mut().enumerate() {
            for (y, line) in slice.chunks_mut(nx).enumerate() {
                let lane = y % 2 * BRICK;
                let values = sums[z * ACROSS + y / 2].min(F::splat(LARGEST));
                line[x as usize * BRICK..][..wide].copy_from_slice(&values.0[lane..lane + wide]);
            }
        }
    }
}

/// Indices of the samples of packet `n`.
#[inline(always)]
fn indices<S: Simd>(brick: [u32; 3], n: usize) -> [F<S>; 3] {
    let first = triple!(a => (brick[a] as usize * BRICK) as f32);
    let y = first[1] + (n % ACROSS * 2) as f32;
    [
        F::of(lanes!(i => first[0] + (i % BRICK) as f32)),
        F::of(lanes!(i => y + (i / BRICK) as f32)),
        F::splat(first[2] + (n / ACROSS) as f32),
    ]
}

/// The base at the samples of packet `n`; beyond the lattice, where nothing is kept, that of the last.
#[inline(always)]
fn base<S: Simd>(inputs: &Inputs<'_>, brick: [u32; 3], n: usize) -> F<S> {
    let at = indices::<S>(brick, n);
    let last = triple!(a => inputs.p.dims[a] as usize - 1);
    let (nx, ny) = (last[0] + 1, last[1] + 1);
    F::of(lanes!(i => {
        let [x, y, z] = triple!(a => (at[a].0[i] as usize).min(last[a]));
        inputs.base[(z * ny + y) * nx + x]
    }))
}

/// Places of the samples of packet `n`.
#[inline(always)]
fn place<S: Simd>(p: &InjectParams, brick: [u32; 3], n: usize) -> [F<S>; 3] {
    let at = indices(brick, n);
    let rows = [p.place_x, p.place_y, p.place_z];
    triple!(a => at[0] * rows[a][0] + at[1] * rows[a][1] + at[2] * rows[a][2] + F::splat(rows[a][3]))
}

/// e^-q, or 0 from [`Inject::FAR`] on.
#[inline(always)]
fn bell<S: Simd>(q: F<S>) -> F<S> {
    q.lt(F::splat(Inject::FAR)).select((-q.min(F::splat(Inject::FAR))).exp_negative(), F::ZERO)
}

/// Adds the Gaussians of a brick's list.
#[inline(always)]
fn gaussians<S: Simd>(inputs: &Inputs<'_>, brick: [u32; 3], sums: &mut Sums<S>) {
    let p = inputs.p;
    let bin = triple!(a => (brick[a] >> p.bricks[3]) as usize);
    let bin = (bin[2] * p.bins[1] as usize + bin[1]) * p.bins[0] as usize + bin[0];
    let (start, end) = (inputs.starts[bin] as usize, inputs.starts[bin + 1] as usize);
    let begin = start.saturating_add(p.list_begin as usize).min(end);
    let list = &inputs.list[begin..start.saturating_add(p.list_end as usize).min(end)];
    if p.bins[3] > 0 {
        return separate(inputs, brick, list, sums);
    }
    for (n, sum) in sums.iter_mut().enumerate() {
        let at = place(p, brick, n);
        for &number in list {
            let [bx, by, bz, a2] = inputs.blobs[number as usize].center;
            let c = inputs.blobs[number as usize].amplitude[0];
            let d = [at[0] - F::splat(bx), at[1] - F::splat(by), at[2] - F::splat(bz)];
            *sum = *sum + bell(dot(d, d) * a2) * c;
        }
    }
}

/// The same statements for each packet of a slice. A loop over them would be the one that compilers spread over lanes,
/// with a scatter for each store.
macro_rules! across {
    ($n:ident => $body:expr) => {{
        {
            let $n = 0usize;
            $body
        }
        {
            let $n = 1usize;
            $body
        }
        {
            let $n = 2usize;
            $body
        }
        {
            let $n = 3usize;
            $body
        }
    }};
}
const _: () = assert!(ACROSS == 4, "`across!` names every packet of a slice");

/// Where the lattice's edges stand at right angles, the exponential of a sum of three squares along them is a product
/// of three, and a brick takes 24 exponentials for a Gaussian in place of 512.
#[inline(always)]
fn separate<S: Simd>(inputs: &Inputs<'_>, brick: [u32; 3], list: &[u32], sums: &mut Sums<S>) {
    /// Gaussians whose sums over a slice of the brick stay in registers.
    const TOGETHER: usize = 8;
    let p = inputs.p;
    let rows = [p.place_x, p.place_y, p.place_z];
    let edges = triple!(a => [rows[0][a], rows[1][a], rows[2][a]]);
    let length =
        triple!(a => (edges[a][0] * edges[a][0] + edges[a][1] * edges[a][1] + edges[a][2] * edges[a][2]).sqrt());
    let first = place::<S>(p, brick, 0);
    let corner = triple!(a => first[a].0[0]);
    // Metres from the brick's first sample: along x in the lower lanes and along y in the upper, and along z.
    let level: F<S> = F::of(lanes!(i => (i % BRICK) as f32 * length[i / BRICK]));
    let upright: F<S> = F::of(lanes!(i => (i % BRICK) as f32 * length[2]));
    let (mut x, mut y, mut z) = ([F::ZERO; TOGETHER], [[F::ZERO; ACROSS]; TOGETHER], [F::ZERO; TOGETHER]);
    for some in list.chunks(TOGETHER) {
        for (g, &number) in some.iter().enumerate() {
            let [bx, by, bz, a2] = inputs.blobs[number as usize].center;
            let c = inputs.blobs[number as usize].amplitude[0];
            let d = [corner[0] - bx, corner[1] - by, corner[2] - bz];
            let t = triple!(a => (d[0] * edges[a][0] + d[1] * edges[a][1] + d[2] * edges[a][2]) / length[a]);
            let xy = level + F::of(lanes!(i => t[i / BRICK]));
            let xy = bell(xy * xy * a2);
            let upward = upright + t[2];
            z[g] = bell(upward * upward * a2);
            x[g] = F::of(lanes!(i => xy.0[i % BRICK] * c));
            across!(n => y[g][n] = F::of(lanes!(i => xy.0[BRICK + 2 * n + i / BRICK])));
        }
        for k in 0..BRICK {
            let at = k * ACROSS;
            let mut slice = [sums[at], sums[at + 1], sums[at + 2], sums[at + 3]];
            for g in 0..some.len() {
                if z[g].0[k] == 0.0 {
                    continue;
                }
                let xz = x[g] * z[g].0[k];
                across!(n => slice[n] = slice[n] + xz * y[g][n]);
            }
            across!(n => sums[at + n] = slice[n]);
        }
    }
}
