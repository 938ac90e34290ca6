//! `propagate`: columns or mean densities from every cell to each light.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::propagate::scheme;
use airlight_core::stage::{LightFace, LightPlace, Propagate, PropagateParams};
use rayon::prelude::*;

use super::field::Scalars;
use super::sample::Ray;
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, dot, lanes, triple};
use crate::simd::{Floats, Portable, Simd};

/// Packets that one task takes at the least.
const TASK: usize = 8;

struct Inputs<'a> {
    p: &'a PropagateParams,
    density: Scalars<'a>,
    occupancy: &'a [[f32; 2]],
    lights: &'a [LightPlace],
    faces: &'a [LightFace],
}

/// Sixteen cells that a step finishes for a light; those that are none are negative.
struct Cells<'a> {
    light: usize,
    place: &'a LightPlace,
    face: Option<&'a LightFace>,
    at: [[i32; 3]; LANES],
}

/// Where a value goes in the output, and the value.
type Done = (usize, f32);

pub(crate) fn run(stage: &Propagate, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        density: read.scalars(stage.density)?,
        occupancy: read.opt(stage.occupancy)?,
        lights: &read.buf(stage.lights)?[..p.lights as usize],
        faces: read.opt(stage.faces)?,
    };
    let out: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    let each = (p.items / p.lights) as usize;
    let packets = each.div_ceil(LANES);
    for step in range {
        // A step reads what earlier ones wrote, and nothing of its own.
        let known = &*out;
        let done: Vec<Done> = (0..packets * inputs.lights.len())
            .into_par_iter()
            .with_min_len(TASK)
            .flat_map_iter(|n| propagate(&inputs, known, isa, step, n / packets, n % packets * LANES))
            .collect();
        for (place, value) in done {
            out[place] = value;
        }
    }
    Ok(())
}

/// Sixteen items of a step for a light, from `first` on.
fn propagate(
    inputs: &Inputs<'_>,
    known: &[f32],
    isa: Isa,
    step: u32,
    light: usize,
    first: usize,
) -> impl Iterator<Item = Done> + use<> {
    let p = inputs.p;
    let place = &inputs.lights[light];
    let short = p.scheme == scheme::SHORT_CHARACTERISTICS;
    let face = short.then(|| &inputs.faces[step as usize * inputs.lights.len() + light]);
    let item = |i: usize| match face {
        Some(face) => on_face(face, (first + i) as u32),
        None => in_shell(p, place, step, (first + i) as u32),
    };
    let mut at = [0; LANES].map(|_| [-1; 3]);
    let mut live = None;
    for (i, at) in at.iter_mut().enumerate() {
        let cell = item(i).filter(|&cell| inside(p, cell));
        *at = cell.unwrap_or([-1; 3]);
        live = live.or(cell);
    }
    let mut values = [0.0; LANES];
    let mut done = [None; LANES];
    if let Some(live) = live {
        // Lanes without a cell repeat another and are not stored.
        let cells = Cells { light, place, face, at: at.map(|at| if at[0] < 0 { live } else { at }) };
        if short {
            let (cells, values) = (&cells, &mut values);
            compiled_for!(isa, mean<S>(inputs: &Inputs<'_>, known: &[f32], cells: &Cells<'_>, values: &mut Floats));
        } else {
            values = lanes!(i => gathered(inputs, known, &cells, cells.at[i]));
        }
        for i in 0..LANES {
            done[i] = (at[i][0] >= 0).then(|| (index(p, at[i], light), values[i]));
        }
    }
    // The last light's items also write what lies beyond it in its layer.
    let lanes = (p.cells[3] * PropagateParams::LANES) as usize;
    let beyond = if light + 1 == inputs.lights.len() { lanes - light } else { 1 };
    done.into_iter()
        .flatten()
        .flat_map(move |(place, value)| (0..beyond).map(move |k| (place + k, if k == 0 { value } else { 0.0 })))
}

/// Cell `n` of a face.
fn on_face(face: &LightFace, n: u32) -> Option<[i32; 3]> {
    if face.axis == LightFace::NONE || n >= face.count_0 * face.count_1 {
        return None;
    }
    let first = (face.first_0 + n % face.count_0) as i32;
    let second = (face.first_1 + n / face.count_0) as i32;
    let plane = face.plane as i32;
    Some(match face.axis {
        0 => [plane, first, second],
        1 => [first, plane, second],
        _ => [first, second, plane],
    })
}

/// Item `n` of the shell `step` hops from the light's first cell: of a row along x, the cell on one side or the other.
fn in_shell(p: &PropagateParams, light: &LightPlace, step: u32, n: u32) -> Option<[i32; 3]> {
    let (y, z) = (n / 2 % p.cells[1], n / 2 / p.cells[1]);
    let left = step as i32 - y.abs_diff(light.first[1]) as i32 - z.abs_diff(light.first[2]) as i32;
    // Where no hop is left, both sides are one cell.
    let twice = left == 0 && n % 2 == 1;
    let x = light.first[0] as i32 + if n.is_multiple_of(2) { left } else { -left };
    (left >= 0 && !twice).then_some([x, y as i32, z as i32])
}

/// Mean density along the way within the box.
#[inline(always)]
fn mean<S: Simd>(inputs: &Inputs<'_>, known: &[f32], cells: &Cells<'_>, out: &mut Floats) {
    let p = inputs.p;
    let Some(face) = cells.face else { return };
    let (place, size, axis) = (&cells.place.place, inputs.density.size(), face.axis as usize);
    let has_place = place[3] == 1.0;
    let at = triple!(a => F::of(lanes!(i => cells.at[i][a] as f32)));
    let u = triple!(a => if has_place { F::splat(place[a]) - at[a] } else { F::splat(place[a]) });
    let origin = triple!(a => (at[a] + 0.5) * p.cell[a] - 0.5);
    // At a light a way so short that nothing changes along it, and so long that its column is a normal number: devices
    // may take others for 0.
    let metres = metres(p, u).max(F::splat(1e-30));
    let toward = triple!(a => u[a] * p.cell[a] / metres);
    let limit = if has_place { metres } else { F::splat(f32::INFINITY) };
    let all = M::ALL;
    let way = Ray::through(origin, toward, size, limit, p.cell[3]);
    let length = way.step * way.steps;
    if face.near == 1 {
        let column = way.column(inputs.density, None, all) / length.max(F::splat(1e-30));
        *out = way.steps.gt(F::ZERO).select(column, inputs.density.sample::<S>(origin)).0;
        return;
    }
    let longest = u[axis].max(-u[axis]);
    let piece = Ray::through(origin, toward, size, metres / longest, p.cell[3]);
    let rest = length - piece.step * piece.steps;
    let mut beyond = F::ZERO;
    for i in 0..LANES {
        if rest.0[i] > 0.0 {
            beyond.0[i] = interpolated(p, known, cells, cells.at[i], triple!(a => u[a].0[i]), longest.0[i], axis);
        }
    }
    *out = ((piece.column(inputs.density, None, all) + beyond * rest) / length).0;
}

/// Mean density where the way meets the next plane of centres along `axis`.
#[inline(always)]
fn interpolated(
    p: &PropagateParams,
    known: &[f32],
    cells: &Cells<'_>,
    at: [i32; 3],
    u: [f32; 3],
    longest: f32,
    axis: usize,
) -> f32 {
    let far = cells.place.place[3] == 0.0;
    let hop = u.map(|u| if u < 0.0 { -1 } else { 1 });
    let b = if axis == 0 { 1 } else { 0 };
    let c = if axis == 2 { 1 } else { 2 };
    let along_b = nodes(at[b], p.cells[b] as i32, u[b], longest, far);
    let along_c = nodes(at[c], p.cells[c] as i32, u[c], longest, far);
    let mut sum = 0.0;
    for j in 0..4 {
        for i in 0..4 {
            let weight = along_b[i] * along_c[j];
            let mut cell = at;
            cell[axis] += hop[axis];
            cell[b] += hop[b] * (i as i32 - 1);
            cell[c] += hop[c] * (j as i32 - 1);
            // Cells without weight may not be known yet.
            if weight != 0.0 && inside(p, cell) {
                sum += weight * known[index(p, cell, cells.light)];
            }
        }
    }
    sum.max(0.0)
}

/// Weights of the cells at -1, 0, 1 and 2 hops toward the light from cell `x` of `cells` along an axis.
#[inline(always)]
fn nodes(x: i32, cells: i32, u: f32, longest: f32, far: bool) -> [f32; 4] {
    let hop = if u < 0.0 { -1 } else { 1 };
    if !within(x + hop, cells) {
        return [0.0, 1.0, 0.0, 0.0];
    }
    let way = u.abs();
    let f = if way >= longest { 1.0 } else { way / longest };
    let g = 1.0 - f;
    let before = within(x - hop, cells) && (far || way + 1.0 < longest);
    let after = within(x + 2 * hop, cells) && (far || (way - 2.0).abs() < longest);
    match (before, after) {
        (true, true) => [
            -f * g * (1.0 + g) / 6.0,
            (1.0 + f) * g * (1.0 + g) / 2.0,
            (1.0 + f) * f * (1.0 + g) / 2.0,
            -f * g * (1.0 + f) / 6.0,
        ],
        (false, true) => [0.0, g * (1.0 + g) / 2.0, f * (1.0 + g), -f * g / 2.0],
        (true, false) => [-f * g / 2.0, g * (1.0 + f), f * (1.0 + f) / 2.0, 0.0],
        (false, false) => [0.0, g, f, 0.0],
    }
}

/// Column gathered from the neighbours toward the light.
fn gathered(inputs: &Inputs<'_>, known: &[f32], cells: &Cells<'_>, at: [i32; 3]) -> f32 {
    let p = inputs.p;
    let place = &cells.place.place;
    let u = triple!(a => if place[3] == 1.0 { place[a] - at[a] as f32 } else { place[a] });
    let local = inputs.occupancy[index(p, at, 0) / (4 * p.cells[3] as usize)][0];
    let edge = |a: usize| metres(p, triple!(b => F::<Portable>::splat(if a == b { 1.0 } else { 0.0 }))).0[0];
    let published = p.scheme == scheme::PUBLISHED;
    let hops = u[0].abs() + u[1].abs() + u[2].abs();
    if hops == 0.0 {
        return if published { local * (edge(0) + edge(1) + edge(2)) / 3.0 } else { 0.0 };
    }
    let length = if published {
        u[0].abs() * edge(0) + u[1].abs() * edge(1) + u[2].abs() * edge(2)
    } else {
        metres(p, u.map(F::<Portable>::splat)).0[0]
    };
    let mut sum = 0.0;
    for a in 0..3 {
        let mut next = at;
        next[a] += if u[a] < 0.0 { -1 } else { 1 };
        if u[a] != 0.0 && inside(p, next) {
            sum += u[a].abs() * known[index(p, next, cells.light)];
        }
    }
    (local * length + sum) / hops
}

/// Whether cell `x` is one of `cells` along an axis.
#[inline(always)]
fn within(x: i32, cells: i32) -> bool {
    x >= 0 && x < cells
}

/// Whether a cell lies in the grid.
#[inline(always)]
fn inside(p: &PropagateParams, at: [i32; 3]) -> bool {
    (0..3).all(|a| within(at[a], p.cells[a] as i32))
}

/// Where a cell's value for a light lies in the output.
#[inline(always)]
fn index(p: &PropagateParams, at: [i32; 3], light: usize) -> usize {
    let [x, y, z] = at.map(|x| x as usize);
    let [nx, ny, _, layers] = p.cells.map(|n| n as usize);
    ((z * ny + y) * nx + x) * 4 * layers + light
}

/// Metres of a way in cell units.
#[inline(always)]
fn metres<S: Simd>(p: &PropagateParams, u: [F<S>; 3]) -> F<S> {
    let v = triple!(a => u[a] * p.cell[a]);
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    let w = triple!(a => v[0] * rows[a][0] + v[1] * rows[a][1] + v[2] * rows[a][2]);
    dot(w, w).sqrt()
}
