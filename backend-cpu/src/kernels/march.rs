//! `march`: view rays through the medium.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{LightRecord, March, MarchParams, shadow_kind};
use rayon::prelude::*;

use super::harmonics;
use super::phase::Phase;
use super::sample::{Occupancy, Place, Ray, Texels, sample_rgba};
use super::segment::segment;
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, dot, lanes, triple};

const BLOCK: usize = March::BLOCK as usize;
/// Pixels along each side of a packet.
const SIDE: usize = 4;

struct Inputs<'a> {
    p: &'a MarchParams,
    density: Texels<'a>,
    emission: Option<Texels<'a>>,
    occupancy: Option<Occupancy<'a>>,
    in_scatter: &'a [[f32; 4]],
    lights: &'a [LightRecord],
    phase: Phase<'a>,
    tables: &'a [f32],
    environment: &'a [[f32; 4]],
    surface: &'a [[f32; 4]],
    grey: bool,
}

/// The film of sixteen pixels.
struct Pixels {
    color: [F; 4],
    behind: [F; 4],
}

pub(crate) fn run(stage: &March, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.film)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let density = Texels::new(read.field(stage.density)?, p.dims);
    let tables = read.buf(stage.tables)?;
    let inputs = Inputs {
        p,
        density,
        emission: match stage.emission {
            Some(field) => Some(Texels::new(read.field(field)?, p.dims)),
            None => None,
        },
        occupancy: match stage.occupancy {
            Some(buf) => Some(Occupancy::new(read.buf(buf)?, p.occupancy_cells)),
            None => None,
        },
        in_scatter: match stage.in_scatter {
            Some(field) => bytemuck::cast_slice(read.field(field)?),
            None => &[],
        },
        lights: &read.opt(stage.lights)?[..p.lights as usize],
        phase: Phase {
            kind: p.phase_kind,
            lobes: p.phase,
            table: &tables[p.phase_at as usize..][..p.phase_size as usize],
        },
        tables,
        environment: read.opt(stage.environment)?,
        surface: read.opt(stage.surface)?,
        grey: p.extinction[0] == p.extinction[1] && p.extinction[1] == p.extinction[2],
    };
    let film: &mut [[[f32; 4]; 2]] = bytemuck::cast_slice_mut(out.remove(0));
    let (width, height) = (p.width as usize, p.height as usize);
    let across = width.div_ceil(BLOCK);
    // Whole rows of blocks are disjoint parts of the film; a task takes one row's blocks within the range.
    let (first, last) = (range.start as usize / across, (range.end as usize).div_ceil(across));
    let rows = &mut film[first * BLOCK * width..(last * BLOCK).min(height) * width];
    let whole = first * across == range.start as usize && last * across == range.end as usize;
    rows.par_chunks_mut(BLOCK * width).enumerate().for_each(|(n, rows)| {
        let row = first + n;
        let blocks = (0..across).filter(|x| whole || range.contains(&((row * across + x) as u32)));
        // Blocks of one row are independent too: with few rows the cores would otherwise idle.
        let done: Vec<(usize, Block)> = blocks
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|x| (x, block(&inputs, isa, [x * BLOCK, row * BLOCK])))
            .collect();
        for (x, block) in done {
            for (j, line) in rows.chunks_exact_mut(width).enumerate() {
                let from = x * BLOCK;
                let count = BLOCK.min(width - from);
                line[from..from + count].copy_from_slice(&block[j][..count]);
            }
        }
    });
    Ok(())
}

/// The film of a block, row by row.
type Block = [[[[f32; 4]; 2]; BLOCK]; BLOCK];

fn block(inputs: &Inputs<'_>, isa: Isa, corner: [usize; 2]) -> Block {
    let mut block = Block::default();
    for packet in 0..(BLOCK / SIDE) * (BLOCK / SIDE) {
        let at = [packet % (BLOCK / SIDE) * SIDE, packet / (BLOCK / SIDE) * SIDE];
        let mut pixels = Pixels { color: [F::ZERO; 4], behind: [F::ZERO; 4] };
        let (place, out) = ([corner[0] + at[0], corner[1] + at[1]], &mut pixels);
        compiled_for!(isa, march(inputs: &Inputs<'_>, place: [usize; 2], out: &mut Pixels));
        for i in 0..LANES {
            block[at[1] + i / SIDE][at[0] + i % SIDE] = [pixels.color.map(|c| c.0[i]), pixels.behind.map(|c| c.0[i])];
        }
    }
    block
}

/// Sixteen pixels from `corner` on: the mean over their sub-pixel positions.
#[inline(always)]
fn march(inputs: &Inputs<'_>, corner: [usize; 2], out: &mut Pixels) {
    let p = inputs.p;
    let x = F(lanes!(i => (corner[0] + i % SIDE) as f32));
    let y = F(lanes!(i => (corner[1] + i / SIDE) as f32));
    // Pixels past the picture's edge are marched as its last and never stored.
    let pixel = |i: usize| {
        let (x, y) = (corner[0] + i % SIDE, corner[1] + i / SIDE);
        y.min(p.height as usize - 1) * p.width as usize + x.min(p.width as usize - 1)
    };
    let surface = (!inputs.surface.is_empty())
        .then(|| -> [F; 4] { [0, 1, 2, 3].map(|c| F(lanes!(i => inputs.surface[pixel(i)][c]))) });
    let limit = surface.map_or(F::splat(f32::INFINITY), |s| s[3]);
    let (mut color, mut through) = ([F::ZERO; 3], [F::ZERO; 3]);
    let (mut stopped, mut stopped_at) = (F::ZERO, F::ZERO);
    for s in 0..p.samples as usize {
        let a = (x + inputs.tables[2 * s]) * (2.0 / p.width as f32) - 1.0;
        let b = -((y + inputs.tables[2 * s + 1]) * (2.0 / p.height as f32) - 1.0);
        let d = triple!(c => a * p.right[c] + b * p.up[c] + p.forward[c]);
        let length = dot(d, d).sqrt();
        let d = triple!(c => d[c] / length);
        let mut path = Path::new(inputs, d, limit);
        path.walk(inputs);
        for c in 0..3 {
            let behind = match &surface {
                Some(surface) if inputs.environment.is_empty() => {
                    limit.lt(F::splat(f32::INFINITY)).select(surface[c], F::ZERO)
                }
                Some(surface) => limit.lt(F::splat(f32::INFINITY)).select(surface[c], environment(inputs, d, c)),
                None if inputs.environment.is_empty() => F::ZERO,
                None => environment(inputs, d, c),
            };
            color[c] = color[c] + path.radiance[c] + path.transmittance[c] * behind;
            through[c] = through[c] + path.transmittance[c];
        }
        stopped = stopped + path.stopped;
        stopped_at = stopped_at + path.stopped_at;
    }
    let scale = 1.0 / p.samples as f32;
    let mean = (through[0] + through[1] + through[2]) * (scale / 3.0);
    out.color = [color[0] * scale, color[1] * scale, color[2] * scale, F::ONE - mean];
    let depth = stopped.gt(F::ZERO).select(stopped_at / stopped, F::splat(f32::INFINITY));
    out.behind = [through[0] * scale, through[1] * scale, through[2] * scale, depth];
}

/// One view ray of each lane.
struct Path {
    direction: [F; 3],
    ray: Ray,
    radiance: [F; 3],
    transmittance: [F; 3],
    /// Light stopped so far, and the same weighed with its distance.
    stopped: F,
    stopped_at: F,
    /// Y_k of the direction, where the in-scatter has layers.
    harmonics: [F; harmonics::MAX],
}

impl Path {
    #[inline(always)]
    fn new(inputs: &Inputs<'_>, d: [F; 3], limit: F) -> Self {
        let p = inputs.p;
        let index = to_index(p, d);
        let origin = triple!(a => F::splat(p.eye[a]));
        let mut harmonics = [F::ZERO; harmonics::MAX];
        if p.cells[3] > 1 {
            harmonics::eval(&inputs.tables[p.harmonics_at as usize..], p.bands as usize, d, &mut harmonics);
        }
        Self {
            direction: d,
            ray: Ray::through(origin, index, inputs.density.size(), limit, p.step),
            radiance: [F::ZERO; 3],
            transmittance: [F::ONE; 3],
            stopped: F::ZERO,
            stopped_at: F::ZERO,
            harmonics,
        }
    }

    #[inline(always)]
    fn walk(&mut self, inputs: &Inputs<'_>) {
        let p = inputs.p;
        let (last, cut) = (self.ray.steps.max_lane(), F::splat(p.cut));
        let scatters = p.albedo[0] + p.albedo[1] + p.albedo[2] > 0.0;
        let mut k = 0.0;
        while k < last {
            let brightest = self.transmittance[0].max(self.transmittance[1]).max(self.transmittance[2]);
            let active = F::splat(k).lt(self.ray.steps).and(brightest.ge(cut));
            if !active.any() {
                break;
            }
            let t = self.ray.middle(k);
            if let Some(next) = inputs.occupancy.and_then(|o| o.skip(&self.ray, t, k, active)) {
                k = next;
                continue;
            }
            let at = self.ray.at(t);
            let optics = optics(inputs, at, active);
            let dense = optics.extinction[0].max(optics.extinction[1]).max(optics.extinction[2]).gt(F::ZERO);
            let mut light = [F::ZERO; 3];
            if scatters && dense.any() {
                self.in_scatter(inputs, at, dense, &mut light);
                self.direct(inputs, at, t, dense, &mut light);
            }
            let delta = self.ray.step;
            let Optics { extinction, albedo, emission } = optics;
            let first = segment(extinction[0] * delta);
            let (second, third) = if inputs.grey {
                (first, first)
            } else {
                (segment(extinction[1] * delta), segment(extinction[2] * delta))
            };
            let pieces = [first, second, third];
            let reach = triple!(c => self.transmittance[c] * delta * pieces[c].1);
            let sent = triple!(c => extinction[c] * albedo[c] * light[c] + emission[c]);
            let share = extinction[0] * reach[0] + extinction[1] * reach[1] + extinction[2] * reach[2];
            self.radiance = triple!(c => self.radiance[c] + reach[c] * sent[c]);
            self.transmittance = triple!(c => self.transmittance[c] * pieces[c].0);
            self.stopped = self.stopped + share;
            self.stopped_at = self.stopped_at + share * t;
            k += 1.0;
        }
    }

    /// J from the field of in-scattered radiance, added to `light`.
    #[inline(always)]
    fn in_scatter(&self, inputs: &Inputs<'_>, at: [F; 3], dense: M, light: &mut [F; 3]) {
        let p = inputs.p;
        if inputs.in_scatter.is_empty() {
            return;
        }
        let place = triple!(a => (at[a] + 0.5) * p.cells_per_voxel[a] - 0.5);
        let dims = triple!(a => p.cells[a] as usize);
        let (layers, trilinear) = (p.cells[3] as usize, p.trilinear == 1);
        for i in 0..LANES {
            if !dense.lane(i) {
                continue;
            }
            let place = Place::new(dims, layers, triple!(a => place[a].0[i]), trilinear);
            if layers == 1 {
                let j = sample_rgba(inputs.in_scatter, place, 0);
                for c in 0..3 {
                    light[c].0[i] += j[c];
                }
                continue;
            }
            for k in 0..layers {
                let j = sample_rgba(inputs.in_scatter, place, k);
                for c in 0..3 {
                    light[c].0[i] += self.harmonics[k].0[i] * j[c];
                }
            }
        }
    }

    /// J from each light, added to `light`.
    #[inline(always)]
    fn direct(&self, inputs: &Inputs<'_>, at: [F; 3], t: F, dense: M, light: &mut [F; 3]) {
        let p = inputs.p;
        for record in inputs.lights {
            let (toward, distance, falloff) = incident(p, record, self.direction, t);
            let lit = dense.and(falloff.gt(F::ZERO));
            if !lit.any() {
                continue;
            }
            let scale = inputs.phase.eval(dot(toward, self.direction)) * falloff;
            let scale = lit.select(scale, F::ZERO);
            let column = if p.shadow == shadow_kind::MARCH {
                let ray = Ray::through(at, to_index(p, toward), inputs.density.size(), distance, p.step);
                ray.column(inputs.density, inputs.occupancy, lit)
            } else {
                F::ZERO
            };
            let mut transmittance = F::ONE;
            for c in 0..3 {
                if c == 0 || !inputs.grey {
                    transmittance = (column * -p.extinction[c]).exp_negative();
                }
                light[c] = light[c] + scale * transmittance * record.power[c];
            }
        }
    }
}

/// What the medium does to light at a point, per channel.
struct Optics {
    /// σt, 1/m.
    extinction: [F; 3],
    albedo: [f32; 3],
    /// j, W m⁻³ sr⁻¹.
    emission: [F; 3],
}

/// The optics at `at` in index space; lanes that are not active see nothing there.
#[inline(always)]
fn optics(inputs: &Inputs<'_>, at: [F; 3], active: M) -> Optics {
    let p = inputs.p;
    let density = active.select(inputs.density.sample(at), F::ZERO);
    let mut source = density;
    if let Some(emission) = inputs.emission {
        source = active.select(emission.sample(at), F::ZERO);
    }
    Optics {
        extinction: triple!(c => density * p.extinction[c]),
        albedo: triple!(c => p.albedo[c]),
        emission: triple!(c => source * p.emission[c]),
    }
}

/// A direction of the world in voxels per metre.
#[inline(always)]
fn to_index(p: &MarchParams, d: [F; 3]) -> [F; 3] {
    let rows = [&p.index_x, &p.index_y, &p.index_z];
    triple!(a => d[0] * rows[a][0] + d[1] * rows[a][1] + d[2] * rows[a][2])
}

/// Unit direction toward the light, distance to it, and what falloff and cone leave of its power, `t` metres along
/// the view ray.
#[inline(always)]
fn incident(p: &MarchParams, light: &LightRecord, d: [F; 3], t: F) -> ([F; 3], F, F) {
    if light.position[3] == 0.0 {
        let toward = triple!(a => F::splat(light.position[a]));
        return (toward, F::splat(f32::INFINITY), F::ONE);
    }
    let v = triple!(a => F::splat(light.position[a]) - t * d[a]);
    let square = dot(v, v);
    let distance = square.sqrt();
    let far = distance.max(F::splat(f32::MIN_POSITIVE));
    let toward = triple!(a => v[a] / far);
    let mut falloff = F::ONE / square.max(F::splat(p.light_floor));
    if light.cone[2] == 1.0 {
        let [beam, cutoff, ..] = light.cone;
        let axis = triple!(a => F::splat(-light.axis[a]));
        // A cone without a rim is a step at the cutoff.
        let rim = (cutoff - beam).max(1e-6);
        falloff = falloff * dot(axis, toward).each(|c| ((cutoff - c.clamp(-1.0, 1.0).acos()) / rim).clamp(0.0, 1.0));
    }
    (toward, distance, falloff)
}

/// Channel `c` of the environment's radiance from `d`.
#[inline(always)]
fn environment(inputs: &Inputs<'_>, d: [F; 3], c: usize) -> F {
    let p = inputs.p;
    F(lanes!(i => sky(p, inputs.environment, triple!(a => d[a].0[i]), c)))
}

fn sky(p: &MarchParams, texels: &[[f32; 4]], d: [f32; 3], c: usize) -> f32 {
    use std::f32::consts::PI;
    let (width, height) = (p.environment_width as i32, p.environment_height as i32);
    let u = d[0].atan2(-d[2]) / (2.0 * PI) + p.environment[3];
    let (x, y) = ((u - u.floor()) * width as f32 - 0.5, d[1].clamp(-1.0, 1.0).acos() / PI * height as f32 - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let texel = |i: i32, j: i32| texels[(j.clamp(0, height - 1) * width + i.rem_euclid(width)) as usize][c];
    let (i, j) = (x0 as i32, y0 as i32);
    let row = |j: i32| texel(i, j) + (texel(i + 1, j) - texel(i, j)) * (x - x0);
    (row(j) + (row(j + 1) - row(j)) * (y - y0)) * p.environment[c]
}
