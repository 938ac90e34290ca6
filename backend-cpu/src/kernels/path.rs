//! `path`: unbiased paths of light through everything. One path at a time: paths part ways at once, and packets of them would
//! have little in common.

use std::f32::consts::PI;
use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::glam::Vec3;
use airlight_core::stage::{FAR, LightRecord, MeshRecord, Path, PathParams, PathRecord, path_mode};
use bytemuck::Zeroable;
use rayon::prelude::*;

use super::angle::{angle, angle_of_cosine};
use super::bend::{around, bend, choose};
use super::field::{Colors, Scalars};
use super::light::incident;
use super::mesh::{Mesh, line};
use super::phase::Phase;
use super::random::{Draws, circle, draw, draws};
use super::sky::{Sky, sky};
use super::spot::{Spot, dull, scattered, scattered_density, spot};
use super::walk::{Ground, Walk, advance, carried, stands, walk};
use crate::device::Memory;
use crate::packet::{self, M, triple};
use crate::simd::Portable;

/// Pixels that one task takes.
const TASK: usize = 16;

/// Packets of which one lane counts.
type F = packet::F<Portable>;

struct Inputs<'a> {
    p: &'a PathParams,
    ground: Ground<'a>,
    density: Scalars<'a>,
    scattering: Option<Colors<'a>>,
    seen: Option<Colors<'a>>,
    emission: Option<Scalars<'a>>,
    emission_color: Option<Colors<'a>>,
    environment: Option<Sky<'a>>,
    lights: &'a [LightRecord],
    tables: &'a [f32],
    bends: &'a [f32],
    materials: &'a [f32],
    phase: Phase<'a>,
    mesh: Option<Mesh<'a>>,
    background: &'a [[f32; 4]],
}

/// Three vectors of a pixel's sums.
type Sums = [[f32; 4]; 3];
/// Two vectors of a pixel of a film.
type Pixel = [[f32; 4]; 2];

/// A path on its way, as [`PathRecord`] keeps it.
#[derive(Clone, Copy)]
struct Way {
    mode: u32,
    place: Vec3,
    direction: Vec3,
    next: Vec3,
    density: f32,
    weight: Vec3,
    total: f32,
    light: Vec3,
    chosen: f32,
    pending: Vec3,
    stopped: f32,
    ratio: Vec3,
    stopped_at: f32,
    through: Vec3,
    surface: f32,
    depth: u32,
    triangle: u32,
}

pub(crate) fn run(stage: &Path, range: Range<u32>, memory: &mut Memory<'_>) -> Result<(), DeviceError> {
    memory.take(stage.sums)?;
    memory.take(stage.paths)?;
    memory.take(stage.film)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let [x, y, z, _] = p.dims;
    let colors = |field| match field {
        Some(field) => Ok(Some(Colors::new(bytemuck::cast_slice(read.field(field)?), [x, y, z, 1]))),
        None => Ok::<_, DeviceError>(None),
    };
    let tables = read.buf(stage.tables)?;
    let inputs = Inputs {
        p,
        ground: Ground {
            dims: p.dims,
            index: [p.index_x, p.index_y, p.index_z],
            cells: p.majorant_cells,
            majorant: read.buf(stage.majorant)?,
            densest: p.densest,
            least: p.least,
        },
        density: read.scalars(stage.density)?,
        scattering: colors(stage.scattering)?,
        seen: colors(stage.seen)?,
        emission: match stage.emission {
            Some(field) => Some(read.scalars(field)?),
            None => None,
        },
        emission_color: colors(stage.emission_color)?,
        environment: Sky::of(read, stage.environment, [p.environment_width, p.environment_height], p.environment)?,
        lights: &read.opt(stage.lights)?[..p.lights as usize],
        tables,
        bends: tables.get(p.bends_at as usize..).unwrap_or_default(),
        materials: tables.get(p.materials_at as usize..).unwrap_or_default(),
        phase: Phase {
            kind: p.phase_kind,
            lobes: p.phase,
            table: &tables[p.phase_at as usize..][..p.phase_size as usize],
        },
        mesh: match stage.mesh {
            Some(mesh) => Some(Mesh::new(read.buf(mesh)?, p.nodes)),
            None => None,
        },
        background: read.opt(stage.background)?,
    };
    let part = range.start as usize..range.end as usize;
    let film: &mut [Pixel] = &mut bytemuck::cast_slice_mut(out.remove(2))[part.clone()];
    let paths: &mut [PathRecord] = &mut bytemuck::cast_slice_mut(out.remove(1))[part.clone()];
    let sums: &mut [Sums] = &mut bytemuck::cast_slice_mut(out.remove(0))[part];
    let tasks = sums.par_chunks_mut(TASK).zip(paths.par_chunks_mut(TASK)).zip(film.par_chunks_mut(TASK));
    tasks.enumerate().for_each(|(n, ((sums, paths), film))| {
        let (inputs, first) = (&inputs, range.start + (n * TASK) as u32);
        for (((sums, record), film), pixel) in sums.iter_mut().zip(paths).zip(film).zip(first..) {
            path(inputs, pixel, sums, record, film);
        }
    });
    Ok(())
}

/// The turns of a pixel.
fn path(inputs: &Inputs<'_>, pixel: u32, sums: &mut Sums, record: &mut PathRecord, film: &mut Pixel) {
    let p = inputs.p;
    if p.fresh == 1 {
        (*sums, *record) = ([[0.0; 4]; 3], PathRecord::zeroed());
    }
    let [mut light, mut seen, mut stop] = *sums;
    let mut way = resume(record);
    let mut on = kept(inputs, record);
    let mut numbers = draws(pixel, light[3] as u32, p.frame, record.count[1]);
    for _ in 0..p.turns {
        let mut sets_out = true;
        if way.mode == path_mode::IDLE {
            if light[3] >= p.samples as f32 {
                break;
            }
            numbers = draws(pixel, light[3] as u32, p.frame, 0);
            way = begin(inputs, pixel, &mut numbers);
            meet(inputs, &mut way);
        } else if way.mode == path_mode::DEPART {
            (way.direction, way.mode) = (way.next, path_mode::FLIGHT);
            meet(inputs, &mut way);
        } else {
            sets_out = turn(inputs, pixel, &mut way, &mut on, &mut numbers) && scatter(inputs, &mut way, &mut numbers);
        }
        if sets_out {
            let (origin, direction) = (placed(inputs, way.place), carried(&inputs.ground, way.direction));
            on = walk(&inputs.ground, origin, direction, limit(inputs, &way, pixel));
        }
        if way.mode == path_mode::IDLE {
            let l = way.light;
            let mean = (l.x + l.y + l.z) * (1.0 / 3.0);
            light = [light[0] + l.x, light[1] + l.y, light[2] + l.z, light[3] + 1.0];
            let t = way.through;
            seen = [seen[0] + t.x, seen[1] + t.y, seen[2] + t.z, seen[3] + mean * mean];
            stop = [stop[0] + way.stopped, stop[1] + way.stopped_at, 0.0, 0.0];
        }
    }
    *sums = [light, seen, stop];
    *record = keep(&way, &on, &numbers);
    let share = 1.0 / light[3].max(1.0);
    let through = triple!(c => seen[c] * share);
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    let stops = (3.0 * light[3] - (seen[0] + seen[1] + seen[2])) * (share / 3.0);
    let depth = if stop[0] > 0.0 { stop[1] / stop[0] } else { f32::INFINITY };
    *film =
        [[light[0] * share, light[1] * share, light[2] * share, stops], [through[0], through[1], through[2], depth]];
}

/// A place of the world, from the eye, in index space.
#[inline]
fn placed(inputs: &Inputs<'_>, x: Vec3) -> Vec3 {
    let eye = inputs.p.eye;
    let row = |a: usize, r: [f32; 4]| eye[a] + (x.x * r[0] + x.y * r[1] + x.z * r[2]);
    let rows = inputs.ground.index;
    Vec3::new(row(0, rows[0]), row(1, rows[1]), row(2, rows[2]))
}

/// The walk that a record keeps.
fn kept(inputs: &Inputs<'_>, of: &PathRecord) -> Walk {
    let ([x, y, z, t], [dx, dy, dz, far]) = (of.place, of.way);
    let [i, j, k, over] = of.cell;
    let cell = [i as i32, j as i32, k as i32];
    let direction = carried(&inputs.ground, Vec3::new(dx, dy, dz));
    Walk { origin: placed(inputs, Vec3::new(x, y, z)), direction, t, far, cell, over: over == 1 }
}

/// The path that a record keeps.
fn resume(of: &PathRecord) -> Way {
    let xyz = |v: [f32; 4]| Vec3::new(v[0], v[1], v[2]);
    Way {
        mode: of.count[0],
        place: xyz(of.place),
        direction: xyz(of.way),
        next: xyz(of.next),
        density: of.next[3],
        weight: xyz(of.weight),
        total: of.weight[3],
        light: xyz(of.light),
        chosen: of.light[3],
        pending: xyz(of.pending),
        stopped: of.pending[3],
        ratio: xyz(of.ratio),
        stopped_at: of.ratio[3],
        through: xyz(of.through),
        surface: of.through[3],
        depth: of.count[2],
        triangle: of.count[3],
    }
}

/// What a record keeps of a path.
fn keep(of: &Way, on: &Walk, numbers: &Draws) -> PathRecord {
    PathRecord {
        place: of.place.extend(on.t).to_array(),
        way: of.direction.extend(on.far).to_array(),
        next: of.next.extend(of.density).to_array(),
        weight: of.weight.extend(of.total).to_array(),
        light: of.light.extend(of.chosen).to_array(),
        pending: of.pending.extend(of.stopped).to_array(),
        ratio: of.ratio.extend(of.stopped_at).to_array(),
        through: of.through.extend(of.surface).to_array(),
        cell: [on.cell[0] as u32, on.cell[1] as u32, on.cell[2] as u32, on.over.into()],
        count: [of.mode, numbers.next, of.depth, of.triangle],
    }
}

/// A path at the eye.
fn begin(inputs: &Inputs<'_>, pixel: u32, numbers: &mut Draws) -> Way {
    let p = inputs.p;
    let (x, y) = (pixel % p.width, pixel / p.width);
    let a = (x as f32 + draw(numbers)) * (2.0 / p.width as f32) - 1.0;
    let b = 1.0 - (y as f32 + draw(numbers)) * (2.0 / p.height as f32);
    let axis = |v: [f32; 4]| Vec3::new(v[0], v[1], v[2]);
    let toward = a * axis(p.right) + b * axis(p.up) + axis(p.forward);
    let direction = toward / toward.dot(toward).sqrt();
    Way {
        mode: path_mode::VIEW,
        place: Vec3::ZERO,
        direction,
        next: Vec3::ZERO,
        density: 0.0,
        weight: Vec3::ZERO,
        total: 0.0,
        light: Vec3::ZERO,
        chosen: 0.0,
        pending: Vec3::ZERO,
        stopped: 0.0,
        ratio: Vec3::ONE,
        stopped_at: 0.0,
        through: Vec3::ONE,
        surface: FAR,
        depth: 0,
        triangle: 0,
    }
}

/// Where the ray meets a surface.
fn meet(inputs: &Inputs<'_>, way: &mut Way) {
    way.surface = FAR;
    let Some(mesh) = inputs.mesh else { return };
    let of = line(from_mesh(inputs, way.place), splat(way.direction));
    let hit = mesh.nearest(&of, 0.0, F::splat(FAR), [0, inputs.p.nodes]);
    if hit.distance.0[0] < FAR {
        (way.surface, way.triangle) = (hit.distance.0[0], hit.triangle[0]);
    }
}

/// A place from the mesh's origin.
fn from_mesh(inputs: &Inputs<'_>, place: Vec3) -> [F; 3] {
    let eye = inputs.p.mesh_eye;
    splat(Vec3::new(eye[0], eye[1], eye[2]) + place)
}

fn splat(v: Vec3) -> [F; 3] {
    [F::splat(v.x), F::splat(v.y), F::splat(v.z)]
}

/// What stands behind a pixel; nothing without a background.
fn behind(inputs: &Inputs<'_>, pixel: u32) -> [f32; 4] {
    if inputs.background.is_empty() { [0.0, 0.0, 0.0, FAR] } else { inputs.background[pixel as usize] }
}

/// Where the ray ends; that from the eye also at what stands behind everything.
fn limit(inputs: &Inputs<'_>, way: &Way, pixel: u32) -> f32 {
    if way.mode == path_mode::VIEW { way.surface.min(behind(inputs, pixel)[3]) } else { way.surface }
}

/// A turn of a walk. Whether the path scatters where it now is.
fn turn(inputs: &Inputs<'_>, pixel: u32, way: &mut Way, on: &mut Walk, numbers: &mut Draws) -> bool {
    if on.over {
        return arrive(inputs, pixel, way, numbers);
    }
    let rate = advance(&inputs.ground, on, numbers);
    if rate == 0.0 {
        return false;
    }
    let at = stands(on);
    let extinction = extinction(inputs, at, rate);
    if way.mode == path_mode::SHADOW {
        way.ratio = faint(way.ratio * (Vec3::ONE - extinction), numbers);
        on.over = way.ratio == Vec3::ZERO;
        return false;
    }
    let scattering = scattering(inputs, at, extinction, rate);
    let emission = emission(inputs, at, rate);
    if way.mode == path_mode::VIEW {
        way.light += way.ratio * emission;
        let stopped = way.ratio.dot(extinction);
        way.stopped += stopped;
        way.stopped_at += stopped * on.t;
        offer(way, way.ratio * tinted(inputs, at, scattering, rate), on.t, numbers);
        way.ratio = faint(way.ratio * (Vec3::ONE - extinction), numbers);
        on.over = way.ratio == Vec3::ZERO;
        return false;
    }
    way.light += way.weight * emission;
    let whole = way.weight.x + way.weight.y + way.weight.z;
    let real = way.weight.dot(extinction) / whole;
    if draw(numbers) >= real {
        way.weight = way.weight * (Vec3::ONE - extinction) / (1.0 - real);
        return false;
    }
    way.weight = way.weight * scattering / real;
    way.place += on.t * way.direction;
    if way.weight == Vec3::ZERO || way.depth >= inputs.p.max_depth {
        way.mode = path_mode::IDLE;
        return false;
    }
    way.surface = FAR;
    true
}

/// σt/μ, at most 1: lookups are good to a rounding.
fn extinction(inputs: &Inputs<'_>, at: Vec3, rate: f32) -> Vec3 {
    let density = inputs.density.single(at.to_array());
    let e = inputs.p.extinction;
    (density / rate * Vec3::new(e[0], e[1], e[2])).min(Vec3::ONE)
}

/// σs/μ.
fn scattering(inputs: &Inputs<'_>, at: Vec3, extinction: Vec3, rate: f32) -> Vec3 {
    let (a, e) = (inputs.p.albedo, inputs.p.extinction);
    let albedo = Vec3::new(a[0], a[1], a[2]);
    match inputs.scattering {
        Some(field) => {
            let [r, g, b, _] = field.sample(at.to_array()).layer(0);
            Vec3::new(r, g, b) / rate * Vec3::new(e[0], e[1], e[2]) * albedo
        }
        None => extinction * albedo,
    }
}

/// σs/μ as the eye sees it.
fn tinted(inputs: &Inputs<'_>, at: Vec3, scattering: Vec3, rate: f32) -> Vec3 {
    let (a, e) = (inputs.p.albedo, inputs.p.extinction);
    match inputs.seen {
        Some(field) => {
            let [r, g, b, _] = field.sample(at.to_array()).layer(0);
            Vec3::new(r, g, b) / rate * Vec3::new(e[0], e[1], e[2]) * Vec3::new(a[0], a[1], a[2])
        }
        None => scattering,
    }
}

/// j/μ.
fn emission(inputs: &Inputs<'_>, at: Vec3, rate: f32) -> Vec3 {
    let e = inputs.p.emission;
    if e[0] + e[1] + e[2] == 0.0 {
        return Vec3::ZERO;
    }
    let source = if let Some(color) = inputs.emission_color {
        let [r, g, b, _] = color.sample(at.to_array()).layer(0);
        Vec3::new(r, g, b)
    } else {
        Vec3::splat(inputs.emission.unwrap_or(inputs.density).single(at.to_array()))
    };
    source / rate * Vec3::new(e[0], e[1], e[2])
}

/// T, or nothing by the chance that makes up for it where T is faint.
fn faint(ratio: Vec3, numbers: &mut Draws) -> Vec3 {
    let most = ratio.x.max(ratio.y).max(ratio.z);
    if most >= Path::FAINT {
        return ratio;
    }
    if draw(numbers) * Path::FAINT < most { ratio * (Path::FAINT / most) } else { Vec3::ZERO }
}

/// A place on the eye's ray to scatter at, `t` metres along, with its weights.
fn offer(way: &mut Way, weights: Vec3, t: f32, numbers: &mut Draws) {
    let weight = weights.x + weights.y + weights.z;
    if weight > 0.0 {
        way.total += weight;
        if draw(numbers) * way.total < weight {
            (way.weight, way.chosen) = (weights / weight, t);
        }
    }
}

/// The end of a walk. Whether the path scatters where it now is.
fn arrive(inputs: &Inputs<'_>, pixel: u32, way: &mut Way, numbers: &mut Draws) -> bool {
    let p = inputs.p;
    if way.mode == path_mode::SHADOW {
        way.light += way.pending * way.ratio;
        way.mode = if way.weight == Vec3::ZERO { path_mode::IDLE } else { path_mode::DEPART };
        return false;
    }
    let (d, mut t, mut goes_on) = (way.direction, way.surface, false);
    // What of the environment is seen.
    let mut share = Vec3::ZERO;
    if way.mode == path_mode::VIEW {
        way.through = way.ratio;
        let back = behind(inputs, pixel);
        if way.surface < back[3].min(FAR) {
            offer(way, way.ratio, -1.0, numbers);
        } else if back[3] < FAR {
            way.light += way.ratio * Vec3::new(back[0], back[1], back[2]);
        } else if p.visible == 1 {
            share = way.ratio;
        }
        goes_on = way.total > 0.0;
        way.weight *= way.total;
        if way.chosen >= 0.0 {
            (t, way.surface) = (way.chosen, FAR);
        }
    } else if way.surface < FAR {
        goes_on = way.depth < p.max_depth;
    } else {
        share = way.weight * share_of_scattering(inputs, d, way.density);
    }
    if share != Vec3::ZERO {
        way.light += share * surroundings(inputs, d);
    }
    if goes_on {
        way.place += t * d;
    } else {
        way.mode = path_mode::IDLE;
    }
    goes_on
}

/// The environment's radiance; none without one.
fn surroundings(inputs: &Inputs<'_>, d: Vec3) -> Vec3 {
    match &inputs.environment {
        Some(environment) => {
            let [r, g, b] = sky(environment, splat(d));
            Vec3::new(r.0[0], g.0[0], b.0[0])
        }
        None => Vec3::ZERO,
    }
}

/// The share of scattering, of that density, in what is seen of the environment along `d` (balance heuristic).
fn share_of_scattering(inputs: &Inputs<'_>, d: Vec3, density: f32) -> f32 {
    if inputs.environment.is_none() {
        return 1.0;
    }
    density / (density + sky_density(inputs, d))
}

/// The probability that the environment is chosen and drawn along `d`, per steradian.
fn sky_density(inputs: &Inputs<'_>, d: Vec3) -> f32 {
    let p = inputs.p;
    let u = angle(F::splat(d.x), F::splat(-d.z)).0[0] / (2.0 * PI) + p.environment[3];
    let column = ((u - u.floor()) * p.sky_columns as f32) as u32;
    let row = (angle_of_cosine(F::splat(d.y)).0[0] / PI * p.sky_rows as f32) as u32;
    let cell = row.min(p.sky_rows - 1) * p.sky_columns + column.min(p.sky_columns - 1);
    inputs.tables[(p.sky_at + Path::CHOICE * cell + 2) as usize] * chance(inputs, p.lights)
}

/// The probability that a light, or behind them all the environment, is chosen.
fn chance(inputs: &Inputs<'_>, item: u32) -> f32 {
    inputs.tables[(inputs.p.choices_at + Path::CHOICE * item + 2) as usize]
}

/// A direction toward the environment.
fn toward_sky(inputs: &Inputs<'_>, numbers: &mut Draws) -> Vec3 {
    let p = inputs.p;
    let choice = &inputs.tables[p.sky_at as usize..];
    let cell = choose(choice, (p.sky_columns * p.sky_rows) as usize, numbers) as u32;
    let u = ((cell % p.sky_columns) as f32 + draw(numbers)) / p.sky_columns as f32 - p.environment[3];
    let edges = &inputs.tables[(p.edges_at + cell / p.sky_columns) as usize..];
    let y = edges[0] + (edges[1] - edges[0]) * draw(numbers);
    let [c, s] = circle(u - u.floor());
    let planar = (1.0 - y * y).max(0.0).sqrt();
    Vec3::new(planar * s, y, -planar * c)
}

/// Draws where the path goes on, and looks at a light before; whether there is one to look at.
fn scatter(inputs: &Inputs<'_>, way: &mut Way, numbers: &mut Draws) -> bool {
    let p = inputs.p;
    way.depth += 1;
    let eye = Vec3::new(p.mesh_eye[0], p.mesh_eye[1], p.mesh_eye[2]);
    let mesh = inputs.mesh.filter(|_| way.surface < FAR);
    let spot = spot(mesh, inputs.materials, eye + way.place, way.direction, way.triangle);
    let from = way.direction;
    let extent = MeshRecord::MARGIN * p.mesh_eye[3];
    way.place += extent * spot.facet;
    let looks = look(inputs, way, &spot, numbers);
    onward(inputs, way, &spot, from, numbers);
    if looks {
        way.mode = path_mode::SHADOW;
    }
    looks
}

/// Chooses a light and what comes from it but for the medium; whether anything does. The ray is then toward the light.
fn look(inputs: &Inputs<'_>, way: &mut Way, spot: &Spot, numbers: &mut Draws) -> bool {
    let p = inputs.p;
    if p.choices == 0 {
        return false;
    }
    let item = choose(&inputs.tables[p.choices_at as usize..], p.choices as usize, numbers) as u32;
    let from = way.direction;
    let (toward, distance, arriving);
    if item < p.lights {
        let record = &inputs.lights[item as usize];
        let light = incident(record, p.light_floor, splat(way.place), F::ONE);
        toward = Vec3::from(triple!(a => light.toward[a].0[0]));
        distance = light.distance.0[0].min(FAR);
        let power = Vec3::new(record.power[0], record.power[1], record.power[2]);
        arriving = light.falloff.0[0] / chance(inputs, item) * power;
    } else {
        toward = toward_sky(inputs, numbers);
        distance = FAR;
        let density = sky_density(inputs, toward) + scattered_density(&inputs.phase, inputs.bends, spot, from, toward);
        arriving = if density > 0.0 { surroundings(inputs, toward) / density } else { Vec3::ZERO };
    }
    way.pending = way.weight * scattered(&inputs.phase, spot, from, toward) * arriving;
    if way.pending == Vec3::ZERO {
        return false;
    }
    if let Some(mesh) = inputs.mesh {
        let free = distance - MeshRecord::MARGIN * p.mesh_eye[3];
        let of = line(from_mesh(inputs, way.place), splat(toward));
        if mesh.blocked(&of, F::splat(free), M::ALL).any() {
            return false;
        }
    }
    (way.direction, way.surface, way.ratio) = (toward, distance, Vec3::ONE);
    true
}

/// Draws where the path goes on, or that it ends.
fn onward(inputs: &Inputs<'_>, way: &mut Way, spot: &Spot, from: Vec3, numbers: &mut Draws) {
    let p = inputs.p;
    way.mode = path_mode::DEPART;
    let shines = p.emission[0] + p.emission[1] + p.emission[2] > 0.0;
    if way.depth >= p.max_depth && inputs.environment.is_none() && !shines {
        way.weight = Vec3::ZERO;
    } else {
        way.next = if spot.surface {
            if draw(numbers) < dull(spot) {
                let c = draw(numbers).sqrt();
                around(spot.normal, c, draw(numbers))
            } else {
                let mirrored = from - 2.0 * from.dot(spot.normal) * spot.normal;
                let c = (1.0 - draw(numbers)).powf(1.0 / (spot.exponent + 1.0));
                around(mirrored, c, draw(numbers))
            }
        } else {
            let c = bend(&inputs.phase, inputs.bends, numbers);
            around(from, c, draw(numbers))
        };
        way.density = scattered_density(&inputs.phase, inputs.bends, spot, from, way.next);
        let share = scattered(&inputs.phase, spot, from, way.next);
        way.weight = if way.density > 0.0 { way.weight * share / way.density } else { Vec3::ZERO };
        let most = way.weight.x.max(way.weight.y).max(way.weight.z);
        let mut stays = (most / Path::WEAK).min(1.0);
        if way.depth >= Path::LONG {
            stays = stays.min(1.0 - 1.0 / Path::LONG as f32);
        }
        if stays < 1.0 {
            way.weight = if draw(numbers) < stays { way.weight / stays } else { Vec3::ZERO };
        }
    }
    if way.weight == Vec3::ZERO {
        way.mode = path_mode::IDLE;
    }
}
