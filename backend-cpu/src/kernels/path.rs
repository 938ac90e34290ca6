//! `path`: unbiased paths of light through everything. Sixteen of them walk at a time; paths part ways at once, and packets of
//! what else happens to them would have little in common.

use std::f32::consts::PI;
use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::glam::Vec3;
use airlight_core::stage::{FAR, MeshRecord, Path, PathRecord, path_mode};
use bytemuck::Zeroable;
use rayon::prelude::*;

use super::angle::{angle, angle_of_cosine};
use super::bend::{around, bend, choose};
use super::light::incident;
use super::mesh::line;
use super::random::{Draws, Series, circle, draw, draws};
use super::sky::sky;
use super::spot::{Spot, dull, scattered, scattered_density, spot};
use super::walk::{Walk, Walks, carried, walk};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{self, I, LANES, M, triple};
use crate::paths::{PathInputs as Inputs, Way, keep, resume};
use crate::simd::{Portable, Simd};

/// Pixels that one task takes.
const TASK: usize = 128;

/// Packets of which one lane counts.
type F = packet::F<Portable>;

/// Three vectors of a pixel's sums.
type Sums = [[f32; 4]; 3];
/// Two vectors of a pixel of a film.
type Pixel = [[f32; 4]; 2];

pub(crate) fn run(stage: &Path, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.sums)?;
    memory.take(stage.paths)?;
    memory.take(stage.film)?;
    let (mut out, read) = memory.split();
    let inputs = Inputs::new(stage, read)?;
    let part = range.start as usize..range.end as usize;
    let film: &mut [Pixel] = &mut bytemuck::cast_slice_mut(out.remove(2))[part.clone()];
    let paths: &mut [PathRecord] = &mut bytemuck::cast_slice_mut(out.remove(1))[part.clone()];
    let sums: &mut [Sums] = &mut bytemuck::cast_slice_mut(out.remove(0))[part];
    let tasks = sums.par_chunks_mut(TASK).zip(paths.par_chunks_mut(TASK)).zip(film.par_chunks_mut(TASK));
    tasks.enumerate().for_each(|(n, ((sums, records), film))| {
        let part = &mut Part { first: range.start + (n * TASK) as u32, sums, records, film };
        let inputs = &inputs;
        compiled_for!(isa, path<S>(inputs: &Inputs<'_>, part: &mut Part<'_>));
    });
    Ok(())
}

/// Pixels of a task.
struct Part<'a> {
    /// Number of the first.
    first: u32,
    sums: &'a mut [Sums],
    records: &'a mut [PathRecord],
    film: &'a mut [Pixel],
}

/// A pixel and its path, as far as its lane does not walk.
#[derive(Clone, Copy)]
struct Lane {
    /// Number within the task.
    pixel: usize,
    sums: Sums,
    way: Way,
}

/// Where a path meets what may stop it: in index space, and metres along; the density there, and the rate.
struct Met {
    at: Vec3,
    t: f32,
    density: f32,
    rate: f32,
}

/// The turns of the pixels of a task. Each lane takes the next pixel when it is done with one: all walk together, and whatever
/// else happens to a path happens to it alone.
#[inline(always)]
fn path<S: Simd>(inputs: &Inputs<'_>, part: &mut Part<'_>) {
    let count = part.sums.len();
    let mut lanes = [Lane { pixel: 0, sums: Sums::default(), way: resume(&PathRecord::zeroed()) }; LANES];
    let (mut on, mut numbers) = (Walks::<S>::idle(), Series::<S>::idle());
    // Lanes that walk, those that are to be seen to, and the turns that each has left.
    let (mut walking, mut halted, mut left) = (M::<S>::NONE, 0u32, I::<S>::ZERO);
    let mut next = 0;
    for (i, lane) in lanes.iter_mut().enumerate().take(count) {
        let (walk, own) = open(inputs, part, next, lane);
        on.set(&inputs.ground, i, &walk);
        numbers.set(i, &own);
        left.0[i] = turns(inputs);
        halted |= 1 << i;
        next += 1;
    }
    loop {
        while halted != 0 {
            let i = halted.trailing_zeros() as usize;
            let lane = &mut lanes[i];
            let mut own = numbers.get(i);
            halted &= halted - 1;
            let done = lane.way.mode == path_mode::IDLE && lane.sums[0][3] >= inputs.p.samples as f32;
            if done || left.0[i] == 0 {
                close(part, lane, &on.get(i), &own);
                if next == count {
                    continue;
                }
                let (walk, own) = open(inputs, part, next, lane);
                on.set(&inputs.ground, i, &walk);
                numbers.set(i, &own);
                left.0[i] = turns(inputs);
                next += 1;
            } else if walks(&lane.way) && !on.over.lane(i) {
                walking.set(i, true);
                continue;
            } else {
                left.0[i] -= 1;
                if let Some(walk) = happen(inputs, part.first, lane, None, &mut own) {
                    on.set(&inputs.ground, i, &walk);
                }
                numbers.set(i, &own);
            }
            halted |= 1 << i;
        }
        if !walking.any() {
            break;
        }
        let rate = on.advance(&inputs.ground, &mut numbers, walking);
        left = left.plus(walking.choose(-1));
        let met = walking.and(rate.gt(packet::F::ZERO));
        if met.any() {
            let at = on.stands();
            let density = inputs.density.sample(at);
            let mut bits = met.bits();
            while bits != 0 {
                let i = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let (lane, mut own) = (&mut lanes[i], numbers.get(i));
                let at = Vec3::from(triple!(a => at[a].0[i]));
                let met = Met { at, t: on.t.0[i], density: density.0[i], rate: rate.0[i] };
                if let Some(walk) = happen(inputs, part.first, lane, Some(&met), &mut own) {
                    on.set(&inputs.ground, i, &walk);
                } else if !walks(&lane.way) || lane.way.mode != path_mode::FLIGHT && lane.way.ratio == Vec3::ZERO {
                    on.over.set(i, true);
                }
                numbers.set(i, &own);
            }
        }
        let stop = walking.and(on.over.or(left.below(1)));
        halted = stop.bits();
        walking = walking.and(stop.not());
    }
}

/// Turns of a pixel.
fn turns(inputs: &Inputs<'_>) -> i32 {
    inputs.p.turns.min(i32::MAX as u32) as i32
}

/// Whether a path is on a walk, which may be at its end.
fn walks(way: &Way) -> bool {
    matches!(way.mode, path_mode::VIEW | path_mode::SHADOW | path_mode::FLIGHT)
}

/// Takes up a pixel: its walk and draws.
fn open(inputs: &Inputs<'_>, part: &mut Part<'_>, pixel: usize, lane: &mut Lane) -> (Walk, Draws) {
    if inputs.p.fresh == 1 {
        (part.sums[pixel], part.records[pixel]) = (Sums::default(), PathRecord::zeroed());
    }
    let record = &part.records[pixel];
    *lane = Lane { pixel, sums: part.sums[pixel], way: resume(record) };
    let numbers = draws(part.first + pixel as u32, lane.sums[0][3] as u32, inputs.p.frame, record.count[1]);
    (kept(inputs, record), numbers)
}

/// Lays down a pixel.
fn close(part: &mut Part<'_>, lane: &Lane, on: &Walk, numbers: &Draws) {
    let Lane { pixel, sums: [light, seen, stop], ref way } = *lane;
    part.sums[pixel] = lane.sums;
    part.records[pixel] = keep(way, on, numbers);
    let share = 1.0 / light[3].max(1.0);
    let through = triple!(c => seen[c] * share);
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    let stops = (3.0 * light[3] - (seen[0] + seen[1] + seen[2])) * (share / 3.0);
    let depth = if stop[0] > 0.0 { stop[1] / stop[0] } else { f32::INFINITY };
    part.film[pixel] =
        [[light[0] * share, light[1] * share, light[2] * share, stops], [through[0], through[1], through[2], depth]];
}

/// A turn of a path but for the step of its walk, which may have met something. The walk that it sets out on.
fn happen(inputs: &Inputs<'_>, first: u32, lane: &mut Lane, met: Option<&Met>, numbers: &mut Draws) -> Option<Walk> {
    let Lane { pixel, sums, way } = lane;
    let pixel = first + *pixel as u32;
    let mut sets_out = true;
    if way.mode == path_mode::IDLE {
        *numbers = draws(pixel, sums[0][3] as u32, inputs.p.frame, 0);
        *way = begin(inputs, pixel, numbers);
        meet(inputs, way);
    } else if way.mode == path_mode::DEPART {
        (way.direction, way.mode) = (way.next, path_mode::FLIGHT);
        meet(inputs, way);
    } else {
        let scatters = match met {
            Some(met) => turn(inputs, way, met, numbers),
            None => arrive(inputs, pixel, way, numbers),
        };
        sets_out = scatters && scatter(inputs, way, numbers);
    }
    if way.mode == path_mode::IDLE {
        let (l, t) = (way.light, way.through);
        let mean = (l.x + l.y + l.z) * (1.0 / 3.0);
        let [light, seen, stop] = *sums;
        *sums = [
            [light[0] + l.x, light[1] + l.y, light[2] + l.z, light[3] + 1.0],
            [seen[0] + t.x, seen[1] + t.y, seen[2] + t.z, seen[3] + mean * mean],
            [stop[0] + way.stopped, stop[1] + way.stopped_at, 0.0, 0.0],
        ];
    }
    sets_out.then(|| {
        let (origin, direction) = (placed(inputs, way.place), carried(&inputs.ground, way.direction));
        walk(&inputs.ground, origin, direction, limit(inputs, way, pixel))
    })
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

/// What is met on a walk. Whether the path scatters where it now is.
fn turn(inputs: &Inputs<'_>, way: &mut Way, met: &Met, numbers: &mut Draws) -> bool {
    let Met { at, t, density, rate } = *met;
    let extinction = extinction(inputs, density, rate);
    if way.mode == path_mode::SHADOW {
        way.ratio = faint(way.ratio * (Vec3::ONE - extinction), numbers);
        return false;
    }
    let scattering = scattering(inputs, at, extinction, rate);
    let emission = emission(inputs, at, rate);
    if way.mode == path_mode::VIEW {
        way.light += way.ratio * emission;
        let stopped = way.ratio.dot(extinction);
        way.stopped += stopped;
        way.stopped_at += stopped * t;
        offer(way, way.ratio * tinted(inputs, at, scattering, rate), t, numbers);
        way.ratio = faint(way.ratio * (Vec3::ONE - extinction), numbers);
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
    way.place += t * way.direction;
    if way.weight == Vec3::ZERO || way.depth >= inputs.p.max_depth {
        way.mode = path_mode::IDLE;
        return false;
    }
    way.surface = FAR;
    true
}

/// σt/μ, at most 1: lookups are good to a rounding.
fn extinction(inputs: &Inputs<'_>, density: f32, rate: f32) -> Vec3 {
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
