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
use crate::packet::{F, I, LANES, M, dot, lanes, triple};
use crate::simd::{Floats, Portable, Simd};

/// Packets that one task integrates in.
const TASK: usize = 32;
/// Packets of a step from which on tasks share them.
const MANY: usize = 256;

struct Inputs<'a> {
    p: &'a PropagateParams,
    density: Scalars<'a>,
    occupancy: &'a [[f32; 2]],
    lights: &'a [LightPlace],
    faces: &'a [LightFace],
}

/// Sixteen cells; what is beyond `count` repeats the first one.
struct Cells {
    at: [[i32; 3]; LANES],
    count: usize,
}

pub(crate) fn run(stage: &Propagate, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.values)?;
    memory.take(stage.out)?;
    let (mut written, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        density: read.scalars(stage.density)?,
        occupancy: read.opt(stage.occupancy)?,
        lights: &read.buf(stage.lights)?[..p.lights as usize],
        faces: if p.scheme == scheme::SHORT_CHARACTERISTICS { read.opt(stage.faces)? } else { &[] },
    };
    let out: &mut [[f32; 4]] = bytemuck::cast_slice_mut(written.remove(1));
    let values: &mut [f32] = bytemuck::cast_slice_mut(written.remove(0));
    let values = &mut values[..p.count() as usize * inputs.lights.len()];
    propagate(&inputs, isa, &range, values);
    if range.end > p.finished() {
        lay_out(p, values, out);
    }
    Ok(())
}

/// Runs a range of units.
fn propagate(inputs: &Inputs<'_>, isa: Isa, range: &Range<u32>, values: &mut [f32]) {
    let (count, first) = (inputs.p.count() as usize, inputs.p.integrated());
    let lights = range.start as usize..range.end.min(first) as usize;
    if let Some(integrated) = values.get_mut(lights.start * count..lights.end * count) {
        integrated.par_chunks_mut(count).zip(lights).for_each(|(values, light)| {
            let tasks = values.par_chunks_mut(TASK * LANES).enumerate();
            tasks.for_each(|(task, values)| integrate(inputs, isa, light, task * TASK * LANES, values));
        });
    }
    let step = |unit: u32| unit.clamp(first, inputs.p.finished()) - first;
    let steps = step(range.start)..step(range.end);
    // Lights do not wait for each other.
    values.par_chunks_mut(count).enumerate().for_each(|(light, values)| {
        steps.clone().for_each(|step| finish(inputs, isa, step as usize, light, values));
    });
}

/// Items of a step of a light, of which some may be no cells.
fn items(p: &PropagateParams, face: Option<&LightFace>) -> usize {
    face.map_or(p.items / p.lights, |face| face.count_0 * face.count_1) as usize
}

/// Integrates in cells from the one of a number on.
fn integrate(inputs: &Inputs<'_>, isa: Isa, light: usize, first: usize, values: &mut [f32]) {
    for (packet, values) in values.chunks_mut(LANES).enumerate() {
        let (place, cells) = (&inputs.lights[light], &Cells::numbered(inputs.p, first + packet * LANES));
        let mut found = [0.0; LANES];
        let out = &mut found;
        compiled_for!(isa, piece<S>(inputs: &Inputs<'_>, place: &LightPlace, cells: &Cells, out: &mut Floats));
        values.copy_from_slice(&found[..values.len()]);
    }
}

/// Finishes the cells of a step for a light.
fn finish(inputs: &Inputs<'_>, isa: Isa, step: usize, light: usize, values: &mut [f32]) {
    let p = inputs.p;
    let place = &inputs.lights[light];
    let face = inputs.faces.get(step * inputs.lights.len() + light);
    let items = items(p, face);
    // What a packet finishes.
    let packet = |known: &[f32], n: usize| {
        let cells = match face {
            Some(face) => Cells::on_face(p, face, n * LANES),
            None => Cells::in_shell(p, place, step, n * LANES..items.min((n + 1) * LANES)),
        };
        let mut found = [0.0; LANES];
        if let Some(face) = face {
            let (axis, cells, out) = (face.axis as usize, &cells, &mut found);
            compiled_for!(
                isa,
                mean<S>(
                    inputs: &Inputs<'_>,
                    place: &LightPlace,
                    axis: usize,
                    known: &[f32],
                    cells: &Cells,
                    out: &mut Floats,
                )
            );
        } else {
            (0..cells.count).for_each(|i| found[i] = gathered(inputs, known, place, cells.at[i]));
        }
        (cells, found)
    };
    let store = |values: &mut [f32], (cells, found): (Cells, Floats)| {
        (0..cells.count).for_each(|i| values[index(p, cells.at[i])] = found[i]);
    };
    // A step reads what earlier ones wrote, and nothing of its own.
    let packets = items.div_ceil(LANES);
    if packets < MANY {
        (0..packets).for_each(|n| store(values, packet(values, n)));
    } else {
        let done: Vec<_> = (0..packets).into_par_iter().with_min_len(TASK).map(|n| packet(values, n)).collect();
        done.into_iter().for_each(|done| store(values, done));
    }
}

/// Lays all values out, with zeros beyond the last light.
fn lay_out(p: &PropagateParams, values: &[f32], out: &mut [[f32; 4]]) {
    let (count, layers) = (p.count() as usize, p.cells[3] as usize);
    let tasks = out[..count * layers].par_chunks_mut(TASK * LANES * layers);
    tasks.enumerate().for_each(|(task, out)| {
        for (cell, out) in (task * TASK * LANES..).zip(out.chunks_mut(layers)) {
            let lanes = out.as_flattened_mut();
            lanes.fill(0.0);
            lanes.iter_mut().zip(values.iter().skip(cell).step_by(count)).for_each(|(lane, value)| *lane = *value);
        }
    });
}

impl Cells {
    /// Cells from the one of a number on.
    fn numbered(p: &PropagateParams, first: usize) -> Self {
        let [nx, ny] = [p.cells[0] as usize, p.cells[1] as usize];
        let count = LANES.min(p.count() as usize - first);
        let at = |n: usize| [n % nx, n / nx % ny, n / nx / ny].map(|x| x as i32);
        Self::new((first..first + count).map(at))
    }

    /// Cells of a face from item `first` on.
    fn on_face(p: &PropagateParams, face: &LightFace, first: usize) -> Self {
        let plane = face.plane as i32;
        let (across, all) = (face.count_0 as usize, (face.count_0 * face.count_1) as usize);
        let at = |n: usize| {
            let (b, c) = (face.first_0 as i32 + (n % across) as i32, face.first_1 as i32 + (n / across) as i32);
            match face.axis {
                0 => [plane, b, c],
                1 => [b, plane, c],
                _ => [b, c, plane],
            }
        };
        Self::new((first..all.min(first + LANES)).map(at).filter(|&at| inside(p, at)))
    }

    /// Cells of the shell `step` hops from the light's first cell: of each row along x, two items, the cell on one side and on the
    /// other.
    fn in_shell(p: &PropagateParams, light: &LightPlace, step: usize, items: Range<usize>) -> Self {
        let at = |n: usize| {
            let (y, z) = ((n / 2) as u32 % p.cells[1], (n / 2) as u32 / p.cells[1]);
            let left = step as i32 - y.abs_diff(light.first[1]) as i32 - z.abs_diff(light.first[2]) as i32;
            // Where no hop is left, both sides are one cell.
            let twice = left == 0 && n % 2 == 1;
            let x = light.first[0] as i32 + if n.is_multiple_of(2) { left } else { -left };
            let at = [x, y as i32, z as i32];
            (left >= 0 && !twice && inside(p, at)).then_some(at)
        };
        Self::new(items.filter_map(at))
    }

    fn new(cells: impl Iterator<Item = [i32; 3]>) -> Self {
        let (mut at, mut count) = ([[0; 3]; LANES], 0);
        for (lane, cell) in at.iter_mut().zip(cells) {
            *lane = cell;
            count += 1;
        }
        // Other lanes are a cell as well.
        let first = at[0];
        at[count..].fill(first);
        Self { at, count }
    }

    fn packets<S: Simd>(&self) -> [I<S>; 3] {
        triple!(a => I::of(lanes!(i => self.at[i][a])))
    }
}

/// Ways from cells to a light.
struct Way<S> {
    /// In cell units.
    u: [F<S>; 3],
    /// Their longest components.
    longest: F<S>,
    /// Where the light is nearer than one cell.
    near: M<S>,
    /// Metres of them within the box.
    length: F<S>,
    /// What is integrated of them.
    piece: Ray<S>,
}

#[inline(always)]
fn way_to<S: Simd>(inputs: &Inputs<'_>, light: &LightPlace, cells: &Cells) -> Way<S> {
    let p = inputs.p;
    let (place, size) = (&light.place, inputs.density.size());
    let has_place = place[3] == 1.0;
    let at = cells.packets::<S>();
    let at = triple!(a => at[a].to_float());
    let u = triple!(a => if has_place { F::splat(place[a]) - at[a] } else { F::splat(place[a]) });
    let origin = triple!(a => (at[a] + 0.5) * p.cell[a] - 0.5);
    // At a light a way so short that nothing changes along it, and so long that its column is a normal number: devices
    // may take others for 0.
    let metres = metres(p, u).max(F::splat(1e-30));
    let toward = triple!(a => u[a] * p.cell[a] / metres);
    let limit = if has_place { metres } else { F::splat(f32::INFINITY) };
    let all = Ray::through(origin, toward, size, limit, p.cell[3]);
    let longest = u[0].abs().max(u[1].abs()).max(u[2].abs());
    let near = if has_place { longest.lt(F::ONE) } else { M::NONE };
    let next = Ray::through(origin, toward, size, metres / longest, p.cell[3]);
    let length = all.step * all.steps;
    let piece = Ray { step: near.select(all.step, next.step), steps: near.select(all.steps, next.steps), ..all };
    Way { u, longest, near, length, piece }
}

/// What is integrated of ways: the mean density of all of it, or the column of a piece.
#[inline(always)]
fn piece<S: Simd>(inputs: &Inputs<'_>, light: &LightPlace, cells: &Cells, out: &mut Floats) {
    let ways = way_to::<S>(inputs, light, cells);
    let column = ways.piece.column(inputs.density, None, M::ALL);
    let mut found = column;
    if ways.near.any() {
        let mean = column / ways.length.max(F::splat(1e-30));
        let here = inputs.density.sample::<S>(ways.piece.origin);
        found = ways.near.select(ways.piece.steps.gt(F::ZERO).select(mean, here), column);
    }
    *out = found.0;
}

/// Mean density along ways within the box, of cells of a face that is normal to `axis`.
#[inline(always)]
fn mean<S: Simd>(inputs: &Inputs<'_>, light: &LightPlace, axis: usize, known: &[f32], cells: &Cells, out: &mut Floats) {
    let ways = way_to::<S>(inputs, light, cells);
    let at = cells.packets::<S>();
    let own = Known::new(inputs.p, known);
    let piece = own.values(own.places(at), M::ALL);
    let rest = ways.length - ways.piece.step * ways.piece.steps;
    let beyond = rest.gt(F::ZERO).select(own.interpolated(light, axis, &ways, at), F::ZERO);
    *out = ways.near.select(piece, (piece + beyond * rest) / ways.length).0;
}

/// The values of a light's cells.
struct Known<'a> {
    values: &'a [f32],
    cells: [i32; 3],
    /// How far neighbours along each axis lie apart.
    pitch: [i32; 3],
}

impl<'a> Known<'a> {
    #[inline(always)]
    fn new(p: &PropagateParams, values: &'a [f32]) -> Self {
        let cells = triple!(a => p.cells[a] as i32);
        assert!(values.len() == p.count() as usize && i32::try_from(values.len()).is_ok(), "a value a cell");
        Self { values, cells, pitch: [1, cells[0], cells[0] * cells[1]] }
    }

    /// Where cells lie.
    #[inline(always)]
    fn places<S: Simd>(&self, at: [I<S>; 3]) -> I<S> {
        at[0].plus(at[1].times(self.pitch[1])).plus(at[2].times(self.pitch[2]))
    }

    /// The values at places in the grid, and zero elsewhere.
    #[inline(always)]
    fn values<S: Simd>(&self, places: I<S>, inside: M<S>) -> F<S> {
        let within = inside.and(places.below(self.values.len() as i32)).and(places.below(0).not());
        let places = within.either(places, I::ZERO);
        // SAFETY: `new` asked for as many values as cells, of which there is one at least; each place is that of one of them.
        #[allow(unsafe_code)]
        let values = F::of(unsafe { S::one(self.values, places.0) });
        within.select(values, F::ZERO)
    }

    /// Mean density where ways meet the next plane of centres along `axis`.
    #[inline(always)]
    fn interpolated<S: Simd>(&self, light: &LightPlace, axis: usize, ways: &Way<S>, at: [I<S>; 3]) -> F<S> {
        let far = light.place[3] == 0.0;
        let (b, c) = (if axis == 0 { 1 } else { 0 }, if axis == 2 { 1 } else { 2 });
        let hop = triple!(a => ways.u[a].lt(F::ZERO).either(I::splat(-1), I::splat(1)));
        let along_b = self.nodes(at[b], hop[b], self.cells[b], ways.u[b], ways.longest, far);
        let along_c = self.nodes(at[c], hop[c], self.cells[c], ways.u[c], ways.longest, far);
        let onward = within(at[axis].plus(hop[axis]), self.cells[axis]);
        let (on, up) = (hop[b].times(self.pitch[b]), hop[c].times(self.pitch[c]));
        let next = self.places(at).plus(hop[axis].times(self.pitch[axis]));
        let mut sum = F::ZERO;
        for j in 0..4 {
            let there = onward.and(within(at[c].plus(hop[c].times(j - 1)), self.cells[c]));
            for i in 0..4 {
                let weight = along_b[i as usize] * along_c[j as usize];
                let inside = there.and(within(at[b].plus(hop[b].times(i - 1)), self.cells[b]));
                // Cells without weight may not be known yet.
                let weighs = weight.lt(F::ZERO).or(weight.gt(F::ZERO)).and(inside);
                let value = self.values(next.plus(on.times(i - 1)).plus(up.times(j - 1)), weighs);
                sum = weighs.select(sum + weight * value, sum);
            }
        }
        sum.max(F::ZERO)
    }

    /// Weights of the cells at -1, 0, 1 and 2 hops toward the light from cells `x` of `cells` along an axis.
    #[inline(always)]
    fn nodes<S: Simd>(&self, x: I<S>, hop: I<S>, cells: i32, u: F<S>, longest: F<S>, far: bool) -> [F<S>; 4] {
        let one = F::ONE;
        let way = u.abs();
        // A division may be off by more than rounding, and at 1 the cell itself must have no weight.
        let f = way.ge(longest).select(one, way / longest);
        let g = one - f;
        let nearer = |m: M<S>| if far { M::ALL } else { m };
        let here = within(x.plus(hop), cells);
        let before = within(x.plus(hop.times(-1)), cells).and(nearer((way + 1.0).lt(longest)));
        let after = within(x.plus(hop.times(2)), cells).and(nearer((way - 2.0).abs().lt(longest)));
        let either = |both: F<S>, after_alone: F<S>, before_alone: F<S>, neither: F<S>, own: F<S>| {
            let with_after = before.select(both, after_alone);
            let without = before.select(before_alone, neither);
            here.select(after.select(with_after, without), own)
        };
        [
            either(-f * g * (g + 1.0) / 6.0, F::ZERO, -f * g / 2.0, F::ZERO, F::ZERO),
            either((f + 1.0) * g * (g + 1.0) / 2.0, g * (g + 1.0) / 2.0, g * (f + 1.0), g, one),
            either((f + 1.0) * f * (g + 1.0) / 2.0, f * (g + 1.0), (f + 1.0) * f / 2.0, f, F::ZERO),
            either(-f * g * (f + 1.0) / 6.0, -f * g / 2.0, F::ZERO, F::ZERO, F::ZERO),
        ]
    }
}

/// Column gathered from the neighbours toward the light.
fn gathered(inputs: &Inputs<'_>, known: &[f32], light: &LightPlace, at: [i32; 3]) -> f32 {
    let p = inputs.p;
    let place = &light.place;
    let u = triple!(a => if place[3] == 1.0 { place[a] - at[a] as f32 } else { place[a] });
    let local = inputs.occupancy[index(p, at)][0];
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
            sum += u[a].abs() * known[index(p, next)];
        }
    }
    (local * length + sum) / hops
}

/// Where cells `x` are among `cells` along an axis.
#[inline(always)]
fn within<S: Simd>(x: I<S>, cells: i32) -> M<S> {
    x.below(cells).and(x.below(0).not())
}

/// Whether a cell lies in the grid.
#[inline(always)]
fn inside(p: &PropagateParams, at: [i32; 3]) -> bool {
    (0..3).all(|a| (0..p.cells[a] as i32).contains(&at[a]))
}

/// The number of a cell.
#[inline(always)]
fn index(p: &PropagateParams, at: [i32; 3]) -> usize {
    let [x, y, z] = at.map(|x| x as usize);
    (z * p.cells[1] as usize + y) * p.cells[0] as usize + x
}

/// Metres of a way in cell units.
#[inline(always)]
fn metres<S: Simd>(p: &PropagateParams, u: [F<S>; 3]) -> F<S> {
    let v = triple!(a => u[a] * p.cell[a]);
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    let w = triple!(a => v[0] * rows[a][0] + v[1] * rows[a][1] + v[2] * rows[a][2]);
    dot(w, w).sqrt()
}
