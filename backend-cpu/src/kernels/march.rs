//! `march`: view rays through the medium.

use std::ops::Range;

use airlight_core::blue_noise;
use airlight_core::device::DeviceError;
use airlight_core::stage::{FAR, LightRecord, March, MarchParams, MeshRecord, alone, shadow_kind, surface_shadow};
use rayon::prelude::*;

use super::face::{face, side_of};
use super::field::{Colors, Place, Scalars};
use super::harmonics::{self, harmonics};
use super::light::{Incident, incident, to_index};
use super::mesh::{Mesh, line};
use super::phase::{Phase, phase};
use super::phong::{normal, phong};
use super::sample::{Occupancy, Ray};
use super::segment::segment;
use super::sky::{Sky, sky};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, dot, lanes, triple};

const BLOCK: usize = March::BLOCK as usize;
/// Pixels along each side of a packet.
const SIDE: usize = 4;

struct Inputs<'a> {
    p: &'a MarchParams,
    density: Scalars<'a>,
    scattering: Option<Colors<'a>>,
    emission: Option<Scalars<'a>>,
    emission_color: Option<Colors<'a>>,
    occupancy: Option<Occupancy<'a>>,
    in_scatter: Option<Colors<'a>>,
    scattered: Option<Colors<'a>>,
    light_depth: Option<Colors<'a>>,
    lights: &'a [LightRecord],
    phase: Phase<'a>,
    tables: &'a [f32],
    environment: Option<Sky<'a>>,
    surface: &'a [[f32; 4]],
    mesh: Mesh<'a>,
    shadow_map: &'a [f32],
    grey: bool,
}

/// What is kept of sixteen pixels: the film, which holds sums between passes, and the path where rays are cut.
struct Pixels {
    film: [[F; 4]; 2],
    path: [[F; 4]; 2],
}

pub(crate) fn run(stage: &March, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.film)?;
    if let Some(paths) = stage.paths {
        memory.take(paths)?;
    }
    let (out, read) = memory.split();
    let p = &stage.params;
    let density = Scalars::new(read.field(stage.density)?, p.dims);
    let tables = read.buf(stage.tables)?;
    let [x, y, z, _] = p.dims;
    let colors = |field| match field {
        Some(field) => Ok(Some(Colors::new(bytemuck::cast_slice(read.field(field)?), [x, y, z, 1]))),
        None => Ok::<_, DeviceError>(None),
    };
    let inputs = Inputs {
        p,
        density,
        scattering: colors(stage.scattering)?,
        emission: match stage.emission {
            Some(field) => Some(Scalars::new(read.field(field)?, p.dims)),
            None => None,
        },
        emission_color: colors(stage.emission_color)?,
        occupancy: match stage.occupancy {
            Some(buf) => Some(Occupancy::new(read.buf(buf)?, p.occupancy_cells)),
            None => None,
        },
        in_scatter: match stage.in_scatter {
            Some(field) => Some(Colors::new(bytemuck::cast_slice(read.field(field)?), p.cells)),
            None => None,
        },
        scattered: match stage.scattered {
            Some(field) => Some(Colors::new(bytemuck::cast_slice(read.field(field)?), p.scattered_cells)),
            None => None,
        },
        light_depth: match stage.light_depth {
            Some(field) => Some(Colors::new(bytemuck::cast_slice(read.field(field)?), p.light_cells)),
            None => None,
        },
        lights: &read.opt(stage.lights)?[..p.lights as usize],
        phase: Phase {
            kind: p.phase_kind,
            lobes: p.phase,
            table: &tables[p.phase_at as usize..][..p.phase_size as usize],
        },
        tables,
        environment: match stage.environment {
            Some(field) => Some(Sky {
                texels: bytemuck::cast_slice(read.field(field)?),
                width: p.environment_width,
                height: p.environment_height,
                tint: p.environment,
            }),
            None => None,
        },
        surface: read.opt(stage.surface)?,
        mesh: Mesh::new(read.opt(stage.mesh)?, p.nodes),
        shadow_map: read.opt(stage.shadow_map)?,
        grey: [p.extinction, p.light_extinction].iter().all(|e| e[0] == e[1] && e[1] == e[2]),
    };
    let mut out = out.into_iter().map(bytemuck::cast_slice_mut::<u8, Kept>);
    let (film, paths) = (out.next().unwrap_or_default(), out.next().unwrap_or_default());
    let (width, height) = (p.width as usize, p.height as usize);
    let across = width.div_ceil(BLOCK);
    // Whole rows of blocks are disjoint parts of the film; a task takes one row's blocks within the range.
    let (first, last) = (range.start as usize / across, (range.end as usize).div_ceil(across));
    let span = first * BLOCK * width..(last * BLOCK).min(height) * width;
    let film = &mut film[span.clone()];
    let mut paths = paths.get_mut(span).unwrap_or_default().chunks_mut(BLOCK * width);
    let rows: Vec<Rows<'_>> = film
        .chunks_mut(BLOCK * width)
        .map(|film| Rows { film, paths: paths.next().unwrap_or_default(), width })
        .collect();
    let whole = first * across == range.start as usize && last * across == range.end as usize;
    rows.into_par_iter().enumerate().for_each(|(n, mut rows)| {
        let row = first + n;
        let blocks = (0..across).filter(|x| whole || range.contains(&((row * across + x) as u32)));
        // Blocks of one row are independent too: with few rows the cores would otherwise idle.
        let done: Vec<(usize, Block)> = blocks
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|x| (x, block(&inputs, isa, [x * BLOCK, row * BLOCK], &rows)))
            .collect();
        for (x, block) in done {
            rows.store(x * BLOCK, &block);
        }
    });
    Ok(())
}

/// Two vectors of a pixel: of the film, or of the path.
type Kept = [[f32; 4]; 2];

/// Film and path of a block's pixels, row by row.
type Block = [[[Kept; 2]; BLOCK]; BLOCK];

/// The pixels of a row of blocks; no paths where rays are not cut.
struct Rows<'a> {
    film: &'a mut [Kept],
    paths: &'a mut [Kept],
    width: usize,
}

impl Rows<'_> {
    /// What earlier passes left of the block whose first column is `x`.
    fn load(&self, x: usize, block: &mut Block) {
        let count = BLOCK.min(self.width - x);
        for (j, line) in self.film.chunks_exact(self.width).enumerate() {
            (0..count).for_each(|i| block[j][i][0] = line[x + i]);
        }
        for (j, line) in self.paths.chunks_exact(self.width).enumerate() {
            (0..count).for_each(|i| block[j][i][1] = line[x + i]);
        }
    }

    fn store(&mut self, x: usize, block: &Block) {
        let count = BLOCK.min(self.width - x);
        for (j, line) in self.film.chunks_exact_mut(self.width).enumerate() {
            (0..count).for_each(|i| line[x + i] = block[j][i][0]);
        }
        for (j, line) in self.paths.chunks_exact_mut(self.width).enumerate() {
            (0..count).for_each(|i| line[x + i] = block[j][i][1]);
        }
    }
}

fn block(inputs: &Inputs<'_>, isa: Isa, corner: [usize; 2], rows: &Rows<'_>) -> Block {
    let mut block = Block::default();
    if inputs.p.sample_begin > 0 || inputs.p.step_begin > 0 {
        rows.load(corner[0], &mut block);
    }
    for packet in 0..(BLOCK / SIDE) * (BLOCK / SIDE) {
        let at = [packet % (BLOCK / SIDE) * SIDE, packet / (BLOCK / SIDE) * SIDE];
        let pixel = |i: usize| (at[1] + i / SIDE, at[0] + i % SIDE);
        let load = |part: usize, half: usize| {
            [0, 1, 2, 3].map(|c| {
                F(std::array::from_fn(|i| {
                    let (y, x) = pixel(i);
                    block[y][x][part][half][c]
                }))
            })
        };
        let mut pixels = Pixels { film: [load(0, 0), load(0, 1)], path: [load(1, 0), load(1, 1)] };
        let (place, out) = ([corner[0] + at[0], corner[1] + at[1]], &mut pixels);
        compiled_for!(isa, march(inputs: &Inputs<'_>, place: [usize; 2], out: &mut Pixels));
        for i in 0..LANES {
            let (y, x) = pixel(i);
            block[y][x] = [pixels.film, pixels.path].map(|kept| kept.map(|v| v.map(|c| c.0[i])));
        }
    }
    block
}

/// Sixteen pixels from `corner` on: the mean over their sub-pixel positions.
#[inline(always)]
fn march(inputs: &Inputs<'_>, corner: [usize; 2], out: &mut Pixels) {
    let p = inputs.p;
    let marched = if p.alone == alone::RIMS { rim(inputs, corner) } else { F::ZERO.lt(F::ONE) };
    if !marched.any() {
        out.film = [
            [F::ZERO, F::ZERO, F::ZERO, F::splat(March::UNMARCHED)],
            [F::ONE, F::ONE, F::ONE, F::splat(f32::INFINITY)],
        ];
        return;
    }
    // The same pixels of the full picture. Those past its edge are marched as its last and never stored.
    let scale = p.scale as usize;
    let full = |n: usize, size: u32| (n * scale + scale / 2).min(size as usize - 1);
    let fx = F(lanes!(i => full(corner[0] + i % SIDE, p.full_width) as f32));
    let fy = F(lanes!(i => full(corner[1] + i / SIDE, p.full_height) as f32));
    let pixel = |i: usize| fy.0[i] as usize * p.full_width as usize + fx.0[i] as usize;
    let each = p.surface_samples as usize;
    let seen = |s: usize, c: usize| F(lanes!(i => inputs.surface[pixel(i) * each + s % each][c]));
    let (mut color, mut through) = ([F::ZERO; 3], [F::ZERO; 3]);
    let (mut stopped, mut stopped_at) = (F::ZERO, F::ZERO);
    if p.sample_begin > 0 {
        // The sums of the passes before.
        [color[0], color[1], color[2], stopped] = out.film[0];
        [through[0], through[1], through[2], stopped_at] = out.film[1];
    }
    let ends = p.step_end == March::ALL_STEPS;
    for s in p.sample_begin as usize..p.sample_end as usize {
        let a = (fx + inputs.tables[2 * s]) * (2.0 / p.full_width as f32) - 1.0;
        let b = -((fy + inputs.tables[2 * s + 1]) * (2.0 / p.full_height as f32) - 1.0);
        let d = triple!(c => a * p.right[c] + b * p.up[c] + p.forward[c]);
        let length = dot(d, d).sqrt();
        let d = triple!(c => d[c] / length);
        let surface = (!inputs.surface.is_empty()).then(|| [seen(s, 0), seen(s, 1), seen(s, 2), seen(s, 3)]);
        let limit = surface.map_or(F::splat(f32::INFINITY), |s| s[3]);
        let reach = marched.select(limit, F::ZERO);
        let mut path = Path::enter(inputs, d, reach, jitter(inputs, corner, s));
        if p.step_begin > 0 {
            path.resume(&out.path);
        }
        path.walk(inputs);
        if !ends {
            out.path = path.keep();
            return;
        }
        let mut behind = inputs.environment.map_or([F::ZERO; 3], |environment| sky(&environment, d));
        if p.alone != alone::NO {
            behind = [F::ZERO; 3];
        } else if let Some(surface) = &surface {
            let hit = limit.lt(F::splat(f32::INFINITY));
            behind = triple!(c => hit.select(surface[c], behind[c]));
        }
        color = triple!(c => color[c] + path.radiance[c] + path.transmittance[c] * behind[c]);
        through = triple!(c => through[c] + path.transmittance[c]);
        stopped = stopped + path.stopped;
        stopped_at = stopped_at + path.stopped_at;
    }
    if p.sample_end < p.samples {
        out.film = [[color[0], color[1], color[2], stopped], [through[0], through[1], through[2], stopped_at]];
        return;
    }
    let scale = 1.0 / p.samples as f32;
    let mean = (through[0] + through[1] + through[2]) * (scale / 3.0);
    let last = match (p.alone, inputs.surface.is_empty()) {
        (alone::NO, _) => F::ONE - mean,
        (_, true) => F::splat(FAR),
        (_, false) => marched.select(seen(0, 3).min(F::splat(FAR)), F::splat(March::UNMARCHED)),
    };
    let beauty = [color[0] * scale, color[1] * scale, color[2] * scale, last];
    let depth = stopped.gt(F::ZERO).select(stopped_at / stopped, F::splat(f32::INFINITY));
    out.film = [beauty, [through[0] * scale, through[1] * scale, through[2] * scale, depth]];
}

/// Which lanes lie near a rim: of the surfaces of five by five pixels around, the nearest and the farthest.
#[inline(always)]
fn rim(inputs: &Inputs<'_>, corner: [usize; 2]) -> M {
    let p = inputs.p;
    let (mut nearest, mut farthest) = (F::splat(FAR), F::ZERO);
    let around = |n: usize, size: u32| n.clamp(2, size as usize + 1) - 2;
    let full = |n: usize, size: u32| ((n as u32 * p.scale + p.scale / 2).min(size - 1)) as usize;
    let distance = |i: usize, k: usize| {
        let column = full(around(corner[0] + i % SIDE + k % 5, p.width), p.full_width);
        let row = full(around(corner[1] + i / SIDE + k / 5, p.height), p.full_height);
        inputs.surface[row * p.full_width as usize + column][3].min(FAR)
    };
    for k in 0..25 {
        let distance = F(lanes!(i => distance(i, k)));
        (nearest, farthest) = (nearest.min(distance), farthest.max(distance));
    }
    nearest.lt(farthest * March::RIM)
}

/// Where the samples of a sub-pixel position lie within their steps.
#[inline(always)]
fn jitter(inputs: &Inputs<'_>, corner: [usize; 2], s: usize) -> F {
    let p = inputs.p;
    if p.jittered == 0 {
        return F::splat(0.5);
    }
    const TILE: usize = blue_noise::SIDE as usize;
    let at = p.jitter_at as usize;
    let tile = &inputs.tables[at + p.samples as usize..][..TILE * TILE];
    let place = F(lanes!(i => tile[(corner[1] + i / SIDE) % TILE * TILE + (corner[0] + i % SIDE) % TILE]));
    let place = place + inputs.tables[at + s] + p.jitter_offset;
    place - place.floor()
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
    basis: [F; harmonics::MAX],
}

impl Path {
    /// The path along `d` before its first step.
    #[inline(always)]
    fn enter(inputs: &Inputs<'_>, d: [F; 3], limit: F, place: F) -> Self {
        let p = inputs.p;
        let index = to_index(rows(p), d);
        let origin = triple!(a => F::splat(p.eye[a]));
        let mut basis = [F::ZERO; harmonics::MAX];
        if p.cells[3].max(p.scattered_cells[3]) > 1 {
            harmonics(&inputs.tables[p.harmonics_at as usize..], p.bands as usize, d, &mut basis);
        }
        let mut ray = Ray::through(origin, index, inputs.density.size(), limit, p.step);
        if p.steps > 0 {
            ray = ray.in_steps(p.steps as f32);
        }
        ray.place = place;
        Self {
            direction: d,
            ray,
            radiance: [F::ZERO; 3],
            transmittance: [F::ONE; 3],
            stopped: F::ZERO,
            stopped_at: F::ZERO,
            basis,
        }
    }

    /// The path as an earlier pass left it.
    #[inline(always)]
    fn resume(&mut self, [light, through]: &[[F; 4]; 2]) {
        [self.radiance[0], self.radiance[1], self.radiance[2], self.stopped] = *light;
        [self.transmittance[0], self.transmittance[1], self.transmittance[2], self.stopped_at] = *through;
    }

    /// What the next pass needs of the path.
    #[inline(always)]
    fn keep(&self) -> [[F; 4]; 2] {
        let ([r, g, b], [x, y, z]) = (self.radiance, self.transmittance);
        [[r, g, b, self.stopped], [x, y, z, self.stopped_at]]
    }

    /// The steps of this pass.
    #[inline(always)]
    fn walk(&mut self, inputs: &Inputs<'_>) {
        let p = inputs.p;
        let (last, cut) = (self.ray.steps.max_lane().min(p.step_end as f32), F::splat(p.cut));
        let scatters = p.albedo[0] + p.albedo[1] + p.albedo[2] > 0.0;
        let mut k = p.step_begin as f32;
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
            let at = self.ray.along(t);
            let optics = optics(inputs, at, active);
            let dense = optics.scattering[0].max(optics.scattering[1]).max(optics.scattering[2]).gt(F::ZERO);
            let mut light = [F::ZERO; 3];
            if scatters && dense.any() {
                gathered(inputs, at, &self.basis, dense, &mut light);
                scattered_light(inputs, at, &self.basis, dense, &mut light);
                direct(inputs, at, self.direction, t, dense, &mut light);
            }
            let delta = self.ray.step;
            let Optics { extinction, scattering, emission } = optics;
            let first = segment(extinction[0] * delta);
            let (second, third) = if inputs.grey {
                (first, first)
            } else {
                (segment(extinction[1] * delta), segment(extinction[2] * delta))
            };
            let pieces = [first, second, third];
            let reach = triple!(c => self.transmittance[c] * delta * pieces[c].1);
            let sent = triple!(c => scattering[c] * light[c] + emission[c]);
            let share = extinction[0] * reach[0] + extinction[1] * reach[1] + extinction[2] * reach[2];
            self.radiance = triple!(c => self.radiance[c] + reach[c] * sent[c]);
            self.transmittance = triple!(c => self.transmittance[c] * pieces[c].0);
            self.stopped = self.stopped + share;
            self.stopped_at = self.stopped_at + share * t;
            k += 1.0;
        }
    }
}

/// The rows of the map from metres to voxels.
#[inline(always)]
fn rows(p: &MarchParams) -> [[f32; 4]; 3] {
    [p.index_x, p.index_y, p.index_z]
}

/// J from the field of in-scattered radiance, added to `light`.
#[inline(always)]
fn gathered(inputs: &Inputs<'_>, at: [F; 3], basis: &[F; harmonics::MAX], dense: M, light: &mut [F; 3]) {
    let p = inputs.p;
    let Some(field) = inputs.in_scatter else { return };
    let place = triple!(a => (at[a] + 0.5) * p.cells_per_voxel[a] - 0.5);
    layered(p.cells[3], basis, dense, light, |i| in_scatter_at(p, field, triple!(a => place[a].0[i])));
}

#[inline(always)]
fn in_scatter_at<'a>(p: &MarchParams, field: Colors<'a>, place: [f32; 3]) -> Place<'a> {
    if p.trilinear == 1 { field.sample(place) } else { field.nearest(place) }
}

/// J of light that was scattered before, added to `light`.
#[inline(always)]
fn scattered_light(inputs: &Inputs<'_>, at: [F; 3], basis: &[F; harmonics::MAX], dense: M, light: &mut [F; 3]) {
    let p = inputs.p;
    let Some(field) = inputs.scattered else { return };
    let place = triple!(a => (at[a] + 0.5) * p.scattered_cells_per_voxel[a] - 0.5);
    layered(p.scattered_cells[3], basis, dense, light, |i| field.sample(triple!(a => place[a].0[i])));
}

/// J from the layers of a field, one a coefficient, at each lane's place.
#[inline(always)]
fn layered<'a>(
    layers: u32,
    basis: &[F; harmonics::MAX],
    dense: M,
    light: &mut [F; 3],
    place: impl Fn(usize) -> Place<'a>,
) {
    for i in 0..LANES {
        if !dense.lane(i) {
            continue;
        }
        let place = place(i);
        for k in 0..layers as usize {
            let (j, weight) = (place.layer(k), if layers == 1 { 1.0 } else { basis[k].0[i] });
            for c in 0..3 {
                light[c].0[i] += weight * j[c];
            }
        }
    }
}

/// J from each light, added to `light`.
#[inline(always)]
fn direct(inputs: &Inputs<'_>, at: [F; 3], direction: [F; 3], t: F, dense: M, light: &mut [F; 3]) {
    let p = inputs.p;
    let mut depths = [F::ZERO; 4];
    let away = if p.phong[3] > 0.0 { normal(inputs.density, rows(p), at) } else { [F::ZERO; 3] };
    for (n, record) in inputs.lights.iter().enumerate() {
        if n % 4 == 0 {
            depths = light_depths(inputs, at, dense, n / 4);
        }
        let light_at = incident(record, p.light_floor, direction, t);
        let Incident { toward, distance, falloff } = light_at;
        let lit = dense.and(falloff.gt(F::ZERO));
        if !lit.any() {
            continue;
        }
        let seen = visibility(inputs, record, &light_at, direction, t, lit);
        let lit = lit.and(seen.gt(F::ZERO));
        if !lit.any() {
            continue;
        }
        let scatters = if p.phong[3] > 0.0 {
            phong(p.phong, away, toward, direction)
        } else {
            phase(&inputs.phase, dot(toward, direction))
        };
        let scale = lit.select(scatters * falloff * seen, F::ZERO);
        let mut column = depths[n % 4];
        if p.shadow == shadow_kind::MARCH || p.shadow == shadow_kind::MEAN {
            let ray = Ray::through(at, to_index(rows(p), toward), inputs.density.size(), distance, p.step);
            column = if p.shadow == shadow_kind::MARCH {
                ray.column(inputs.density, inputs.occupancy, lit)
            } else {
                column * (ray.step * ray.steps)
            };
        }
        let mut transmittance = F::ONE;
        for c in 0..3 {
            if c == 0 || !inputs.grey {
                transmittance = (column * -p.light_extinction[c]).exp_negative();
            }
            light[c] = light[c] + scale * transmittance * record.power[c];
        }
    }
}

/// How much of the light passes by the surfaces, `t` metres along the view ray.
#[inline(always)]
fn visibility(inputs: &Inputs<'_>, record: &LightRecord, light: &Incident, d: [F; 3], t: F, lit: M) -> F {
    let p = inputs.p;
    let extent = p.mesh_eye[3];
    let at = triple!(a => t * d[a] + p.mesh_eye[a]);
    match p.surface_shadow {
        surface_shadow::RAY => {
            let free = light.distance - MeshRecord::MARGIN * extent;
            inputs.mesh.blocked(&line(at, light.toward), free, lit).select(F::ZERO, F::ONE)
        }
        surface_shadow::MAP => mapped(inputs, record, light, at, lit),
        _ => F::ONE,
    }
}

/// The same by the light's map, at a point from the mesh's origin: four comparisons, interpolated.
#[inline(always)]
fn mapped(inputs: &Inputs<'_>, record: &LightRecord, light: &Incident, at: [F; 3], lit: M) -> F {
    let (p, side) = (inputs.p, inputs.p.map_side as usize);
    let parallel = record.position[3] == 0.0;
    let v = if parallel { at } else { triple!(a => -(light.distance * light.toward[a])) };
    let mut sum = F::ONE;
    for i in 0..LANES {
        if !lit.lane(i) {
            continue;
        }
        let v = triple!(a => v[a].0[i]);
        let n = if parallel || record.cone[3] > 0.0 { 0 } else { side_of(v) };
        let of = face(record, n, p.mesh_eye[3]);
        let along = |axis: [f32; 3]| v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2];
        let mut depth = along(of.forward);
        let mut place = [along(of.right) / of.half_width, along(of.up) / of.half_width];
        if parallel {
            depth += p.mesh_eye[3];
            if place[0].abs().max(place[1].abs()) > 1.0 {
                continue;
            }
        } else {
            place = place.map(|x| x / depth.max(1e-30));
        }
        let last = side as f32 - 1.0;
        let q = place.map(|x| ((x * 0.5 + 0.5) * side as f32 - 0.5).max(0.0).min(last));
        let low = q.map(|x| x as usize);
        let f = [q[0] - low[0] as f32, q[1] - low[1] as f32];
        let first = (record.power[3] as usize + n) * side;
        sum.0[i] = 0.0;
        for k in 0..4 {
            let high = [k & 1, k >> 1];
            let across = if high[0] == 1 { f[0] } else { 1.0 - f[0] };
            let down = if high[1] == 1 { f[1] } else { 1.0 - f[1] };
            let (x, y) = ((low[0] + high[0]).min(side - 1), (low[1] + high[1]).min(side - 1));
            let held = inputs.shadow_map[(first + y) * side + x];
            sum.0[i] += if depth <= held { across * down } else { 0.0 };
        }
    }
    sum
}

/// The field toward four lights; zero without one.
#[inline(always)]
fn light_depths(inputs: &Inputs<'_>, at: [F; 3], dense: M, layer: usize) -> [F; 4] {
    let mut depths = [F::ZERO; 4];
    let Some(field) = inputs.light_depth.filter(|_| inputs.p.shadow >= shadow_kind::COLUMN) else { return depths };
    let place = triple!(a => (at[a] + 0.5) * inputs.p.light_cells_per_voxel[a] - 0.5);
    for i in 0..LANES {
        if dense.lane(i) {
            let values = field.sample(triple!(a => place[a].0[i])).layer(layer);
            depths[0].0[i] = values[0];
            depths[1].0[i] = values[1];
            depths[2].0[i] = values[2];
            depths[3].0[i] = values[3];
        }
    }
    depths
}

/// What the medium does to light at a point, per channel.
struct Optics {
    /// σt, 1/m.
    extinction: [F; 3],
    /// σs, 1/m.
    scattering: [F; 3],
    /// j, W m⁻³ sr⁻¹.
    emission: [F; 3],
}

/// The optics at `at` in index space; lanes that are not active see nothing there.
#[inline(always)]
fn optics(inputs: &Inputs<'_>, at: [F; 3], active: M) -> Optics {
    let p = inputs.p;
    let density = active.select(inputs.density.sample(at), F::ZERO);
    let mut scatters = [density; 3];
    if let Some(scattering) = inputs.scattering {
        scatters = scattering.packet(at, active);
    }
    let mut source = [density; 3];
    if let Some(color) = inputs.emission_color {
        source = color.packet(at, active);
    } else if let Some(emission) = inputs.emission {
        source = [active.select(emission.sample(at), F::ZERO); 3];
    }
    Optics {
        extinction: triple!(c => density * p.extinction[c]),
        scattering: triple!(c => scatters[c] * p.extinction[c] * p.albedo[c]),
        emission: triple!(c => source[c] * p.emission[c]),
    }
}
