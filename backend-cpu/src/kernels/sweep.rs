//! `sweep`: light along many directions at the cells of a coarse grid, each from its neighbours upwind.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Sweep, SweepDirection, SweepParams};
use rayon::prelude::*;

use super::segment::segment;
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, apart, lanes};
use crate::simd::{Floats, Simd};

/// Cells whose moments one task adds up: few enough that their moments stay in the first cache.
const CHUNK: usize = 256;

/// Directions that are added to moments at a time.
const LIGHTS: usize = 4;

/// Directions that are swept side by side, plane by plane, so that the sources of cells are read once for all of them.
const SIDE_BY_SIDE: usize = 2;

/// A direction and its radiance at all cells.
struct Swept<'a> {
    direction: usize,
    light: &'a mut [f32],
}

struct Inputs<'a> {
    p: &'a SweepParams,
    /// What lies x fastest, and the same y fastest, then x: rows of planes normal to x.
    upright: Cells<'a>,
    turned: Cells<'a>,
    directions: &'a [SweepDirection],
    source_weights: &'a [f32],
    weights: &'a [f32],
    obstructed: &'a [u32],
}

/// What the cells hold.
#[derive(Clone, Copy)]
struct Cells<'a> {
    extinction: &'a [f32],
    albedo: &'a [f32],
    emission: &'a [f32],
    sources: &'a [f32],
    /// Values from a cell to the next along x, y and z.
    pitch: [usize; 3],
}

impl<'a> Cells<'a> {
    fn new([extinction, albedo, emission, sources]: [&'a [f32]; 4], pitch: [usize; 3]) -> Self {
        Self { extinction, albedo, emission, sources, pitch }
    }
}

/// A plane of cells with what they send on, in rows along the first of its axes. Around it lies a border of one cell of
/// what stands beyond, and behind it a packet's room.
struct Plane {
    /// Floats of a row, and of all rows.
    pitch: usize,
    size: usize,
    /// Cells of a row, and rows.
    cells: [usize; 2],
    radiance: Vec<f32>,
    extinction: Vec<f32>,
    source: Vec<f32>,
    emission: Vec<f32>,
    /// Which neighbours lie behind surfaces; empty where none do.
    obstructed: Vec<u32>,
}

pub(crate) fn run(stage: &Sweep, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.radiance)?;
    memory.take(stage.moments)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let directions = &read.buf(stage.directions)?[..p.directions as usize];
    let (optics, sources) = (read.buf(stage.optics)?, read.opt(stage.sources)?);
    let [x, y] = [p.cells[0], p.cells[1]].map(|n| n as usize);
    let cells = p.count() as usize;
    let channels = p.channels as usize;
    let [extinction, albedo, emission] = [
        &optics[..if p.grey == 1 { 1 } else { channels } * cells],
        &optics[3 * cells..][..channels * cells],
        &optics[6 * cells..][..channels * p.emits as usize * cells],
    ];
    let held = [extinction, albedo, emission, sources];
    // Rows along y are a fraction of what is swept, and a third of the directions reads each of them many times.
    let across = directions.iter().any(|way| way.axis == 0);
    let turned = held.map(|of| if across { turned(of, x, y, isa) } else { Vec::new() });
    let inputs = Inputs {
        p,
        upright: Cells::new(held, [1, x, x * y]),
        turned: Cells::new(turned.each_ref().map(|of| &of[..]), [y, 1, x * y]),
        directions,
        source_weights: read.opt(stage.source_weights)?,
        weights: read.buf(stage.weights)?,
        obstructed: read.opt(stage.obstructed)?,
    };
    let moments: &mut [f32] = bytemuck::cast_slice_mut(out.remove(1));
    let radiance: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    let each = p.count() as usize * p.channels as usize;
    let mut at = range.start;
    while at < range.end {
        let (batch, step) = (at / p.batch_steps(), at % p.batch_steps());
        let first = (batch * p.batch) as usize;
        let count = inputs.directions.len().min(first + p.batch as usize) - first;
        if step == p.cells[3] {
            gathered(&inputs, &radiance[..count * each], first, isa, moments);
            at += 1;
            continue;
        }
        let steps = step..p.cells[3].min(step + range.end - at);
        at += steps.end - steps.start;
        groups(&inputs, first, radiance.chunks_exact_mut(each).take(count)).into_par_iter().for_each(|mut group| {
            let (inputs, steps, group) = (&inputs, steps.clone(), &mut group[..]);
            compiled_for!(isa, sweep<S>(inputs: &Inputs<'_>, steps: Range<u32>, group: &mut [Swept<'_>]));
        });
    }
    Ok(())
}

/// Directions from `first` on and their radiance, in groups of those that pass through the same planes in the same order.
fn groups<'a>(inputs: &Inputs<'_>, first: usize, radiance: impl Iterator<Item = &'a mut [f32]>) -> Vec<Vec<Swept<'a>>> {
    let mut groups: Vec<Vec<Swept<'a>>> = Vec::new();
    let course = |way: &SweepDirection| (way.axis, way.down >> way.axis & 1);
    for (n, light) in radiance.enumerate() {
        let swept = Swept { direction: first + n, light };
        let own = course(&inputs.directions[first + n]);
        let fits = |group: &&mut Vec<Swept<'_>>| {
            group.len() < SIDE_BY_SIDE && course(&inputs.directions[group[0].direction]) == own
        };
        match groups.iter_mut().find(fits) {
            Some(group) => group.push(swept),
            None => groups.push(vec![swept]),
        }
    }
    groups
}

/// The moments of a batch whose first direction is `first`, over tasks of some cells each.
fn gathered(inputs: &Inputs<'_>, radiance: &[f32], first: usize, isa: Isa, moments: &mut [f32]) {
    let p = inputs.p;
    let (cells, values) = (p.count() as usize, (p.coefficients * p.moment_channels()) as usize);
    let moments = &mut moments[..cells * values];
    if p.planar == 1 {
        // All values of some cells at a time: their radiance is read from memory once.
        let mut parts: Vec<Vec<&mut [f32]>> = (0..cells.div_ceil(CHUNK)).map(|_| Vec::new()).collect();
        for plane in moments.chunks_exact_mut(cells) {
            parts.iter_mut().zip(plane.chunks_mut(CHUNK)).for_each(|(parts, part)| parts.push(part));
        }
        parts.into_par_iter().enumerate().for_each(|(n, mut sums)| {
            let (start, sums) = (n * CHUNK, &mut sums[..]);
            compiled_for!(
                isa,
                gather<S>(inputs: &Inputs<'_>, radiance: &[f32], first: usize, start: usize, sums: &mut [&mut [f32]])
            );
        });
        return;
    }
    moments.par_chunks_mut(CHUNK * values).enumerate().for_each(|(n, records)| {
        let count = records.len() / values;
        let mut room = vec![0.0; records.len()];
        let mut sums: Vec<&mut [f32]> = room.chunks_exact_mut(count).collect();
        for (value, sums) in sums.iter_mut().enumerate() {
            sums.iter_mut().zip(records.chunks_exact(values)).for_each(|(sum, record)| *sum = record[value]);
        }
        let (start, all) = (n * CHUNK, &mut sums[..]);
        compiled_for!(
            isa,
            gather<S>(inputs: &Inputs<'_>, radiance: &[f32], first: usize, start: usize, all: &mut [&mut [f32]])
        );
        for (value, sums) in sums.iter().enumerate() {
            records.chunks_exact_mut(values).zip(&**sums).for_each(|(record, sum)| record[value] = *sum);
        }
    });
}

/// Planes of values with x and y exchanged.
fn turned(values: &[f32], x: usize, y: usize, isa: Isa) -> Vec<f32> {
    let mut out = vec![0.0; values.len()];
    out.par_chunks_exact_mut(x * y).zip(values.par_chunks_exact(x * y)).for_each(|(out, from)| {
        compiled_for!(isa, turn<S>(from: &[f32], x: usize, y: usize, out: &mut [f32]));
    });
    out
}

/// A slice with x and y exchanged, sixteen rows of four columns at a time; the last ones again with those before where fewer are left.
#[inline(always)]
fn turn<S: Simd>(from: &[f32], x: usize, y: usize, out: &mut [f32]) {
    if x < 4 || y < LANES {
        for (i, out) in out.chunks_exact_mut(y).enumerate() {
            copy(out, &from[i..], x);
        }
        return;
    }
    for row in (0..y).step_by(LANES).map(|row| row.min(y - LANES)) {
        for column in (0..x).step_by(4).map(|column| column.min(x - 4)) {
            let from = &from[row * x + column..];
            let columns = apart::<S>(lanes!(i => *from[i * x..].first_chunk().expect("four columns are left")));
            for i in 0..4 {
                out[(column + i) * y + row..][..LANES].copy_from_slice(&columns[i].0);
            }
        }
    }
}

impl Plane {
    fn new(inputs: &Inputs<'_>, axis: usize) -> Self {
        let p = inputs.p;
        let [b, c] = SweepDirection::others(axis);
        let cells = [b, c].map(|a| p.cells[a] as usize);
        let pitch = cells[0] + 2;
        let size = pitch * (cells[1] + 2) + LANES;
        let room = |planes: u32| vec![0.0; size * planes as usize];
        Self {
            pitch,
            size,
            cells,
            radiance: room(p.channels),
            extinction: room(if p.grey == 1 { 1 } else { p.channels }),
            source: room(p.channels),
            emission: room(p.channels * p.emits),
            obstructed: vec![0; if inputs.obstructed.is_empty() { 0 } else { size }],
        }
    }

    /// Where cell (0, `row`) lies.
    #[inline(always)]
    fn row(&self, row: usize) -> usize {
        (row + 1) * self.pitch + 1
    }

    /// Takes plane `plane` of a direction: what its cells hold but their sources, and their radiance where it is there.
    #[inline(always)]
    fn load<S: Simd>(&mut self, inputs: &Inputs<'_>, axis: usize, plane: usize, light: Option<&[f32]>) {
        let cells = inputs.p.count() as usize;
        let of = if axis == 0 { inputs.turned } else { inputs.upright };
        let [b, c] = SweepDirection::others(axis);
        let place = |pitch: [usize; 3], row: usize| plane * pitch[axis] + row * pitch[c];
        for row in 0..self.cells[1] {
            let (to, count) = (self.row(row), self.cells[0]);
            let from = place(of.pitch, row);
            for (values, out) in [(of.extinction, &mut self.extinction), (of.emission, &mut self.emission)] {
                for (channel, part) in out.chunks_exact_mut(self.size).enumerate() {
                    let first = channel * cells + from;
                    for (at, out) in (first..first + count).step_by(LANES).zip(part[to..].chunks_exact_mut(LANES)) {
                        out.copy_from_slice(&packet::<S>(values, at).0);
                    }
                }
            }
            let (from, stride) = (place(inputs.upright.pitch, row), inputs.upright.pitch[b]);
            if !inputs.obstructed.is_empty() {
                copy(&mut self.obstructed[to..to + count], &inputs.obstructed[from..], stride);
            }
            if let Some(light) = light {
                for (part, values) in self.radiance.chunks_exact_mut(self.size).zip(light.chunks_exact(cells)) {
                    copy(&mut part[to..to + count], &values[from..], stride);
                }
            }
        }
        for part in self.extinction.chunks_exact_mut(self.size).chain(self.emission.chunks_exact_mut(self.size)) {
            border(part, self.pitch, self.cells, Some(0.0));
        }
    }

    /// Stores the radiance of plane `plane` of a direction.
    #[inline(always)]
    fn store(&self, inputs: &Inputs<'_>, axis: usize, plane: usize, light: &mut [f32]) {
        let pitch = inputs.upright.pitch;
        let [b, c] = SweepDirection::others(axis);
        let count = self.cells[0];
        for (part, out) in self.radiance.chunks_exact(self.size).zip(light.chunks_exact_mut(inputs.p.count() as usize))
        {
            for row in 0..self.cells[1] {
                let values = &part[self.row(row)..][..count];
                let out = &mut out[plane * pitch[axis] + row * pitch[c]..];
                if pitch[b] > 1 {
                    out.iter_mut().step_by(pitch[b]).zip(values).for_each(|(out, value)| *out = *value);
                } else if count < LANES {
                    out[..count].copy_from_slice(values);
                } else {
                    // By whole packets, the last of which ends where the row does.
                    for at in (0..count).step_by(LANES).map(|at| at.min(count - LANES)) {
                        out[at..][..LANES].copy_from_slice(&values[at..][..LANES]);
                    }
                }
            }
        }
    }
}

/// A row out of memory whose values lie `stride` apart.
#[inline(always)]
fn copy<T: Copy>(out: &mut [T], from: &[T], stride: usize) {
    if stride == 1 {
        out.copy_from_slice(&from[..out.len()]);
    } else {
        out.iter_mut().zip(from.iter().step_by(stride)).for_each(|(out, from)| *out = *from);
    }
}

/// Fills the border of a plane: with a value, or with the cells beside it.
#[inline(always)]
fn border(part: &mut [f32], pitch: usize, [count, rows]: [usize; 2], value: Option<f32>) {
    for row in 1..=rows {
        let first = row * pitch + 1;
        part[first - 1] = value.unwrap_or(part[first]);
        part[first + count] = value.unwrap_or(part[first + count - 1]);
    }
    for (to, from) in [(0, 1), (rows + 1, rows)] {
        match value {
            Some(value) => part[to * pitch..(to + 1) * pitch].fill(value),
            None => part.copy_within(from * pitch..(from + 1) * pitch, to * pitch),
        }
    }
}

/// Some steps of directions that pass through the same planes.
#[inline(always)]
fn sweep<S: Simd>(inputs: &Inputs<'_>, steps: Range<u32>, group: &mut [Swept<'_>]) {
    let p = inputs.p;
    let way = &inputs.directions[group[0].direction];
    let (axis, cells) = (way.axis as usize, [p.cells[0], p.cells[1], p.cells[2]]);
    let mut before: Vec<Plane> = group.iter().map(|_| Plane::new(inputs, axis)).collect();
    let mut here: Vec<Plane> = group.iter().map(|_| Plane::new(inputs, axis)).collect();
    for before in &mut before {
        // Beyond the box.
        before.radiance.fill(p.boundary);
    }
    for step in steps.clone() {
        let Some(plane) = way.plane(cells, step) else { break };
        if step > 0 && step == steps.start {
            let last = way.plane(cells, step - 1).unwrap_or(plane) as usize;
            for (before, swept) in before.iter_mut().zip(&*group) {
                before.load::<S>(inputs, axis, last, Some(swept.light));
                for part in before.radiance.chunks_exact_mut(before.size) {
                    border(part, before.pitch, before.cells, Some(p.boundary));
                }
            }
            sources::<S>(inputs, group, last, &mut before);
        }
        sources::<S>(inputs, group, plane as usize, &mut here);
        for ((before, here), swept) in before.iter().zip(&mut here).zip(&mut *group) {
            here.load::<S>(inputs, axis, plane as usize, None);
            advance::<S>(inputs, &inputs.directions[swept.direction], step == 0, before, here);
            here.store(inputs, axis, plane as usize, swept.light);
            for part in here.radiance.chunks_exact_mut(here.size) {
                border(part, here.pitch, here.cells, Some(p.boundary));
            }
        }
        std::mem::swap(&mut before, &mut here);
    }
}

/// Where the packets of a plane lie, and from each the four cells around Y.
struct Place {
    /// Floats of a channel.
    size: usize,
    at: usize,
    count: usize,
    around: [usize; 4],
}

impl Place {
    /// The packets of each channel that there is.
    #[inline(always)]
    fn own<'a>(&self, values: &'a [f32]) -> [&'a [Floats]; 3] {
        let mut out = [&[][..]; 3];
        for (out, part) in out.iter_mut().zip(values.chunks_exact(self.size)) {
            *out = packets(part, self.at, self.count);
        }
        out
    }

    /// The same of the four cells around Y.
    #[inline(always)]
    fn upwind<'a>(&self, values: &'a [f32]) -> [[&'a [Floats]; 4]; 3] {
        let mut out = [[&[][..]; 4]; 3];
        for (out, part) in out.iter_mut().zip(values.chunks_exact(self.size)) {
            for (out, by) in out.iter_mut().zip(self.around) {
                *out = packets(part, self.at.wrapping_add(by), self.count);
            }
        }
        out
    }
}

/// So many packets from a place on.
#[inline(always)]
fn packets(values: &[f32], at: usize, count: usize) -> &[Floats] {
    &values[at..].as_chunks().0[..count]
}

/// Radiance of the plane `here` from the one `before`, which lies beyond the box where `first`.
#[inline(always)]
fn advance<S: Simd>(inputs: &Inputs<'_>, way: &SweepDirection, first: bool, before: &Plane, here: &mut Plane) {
    let p = inputs.p;
    let [b, c] = SweepDirection::others(way.axis as usize);
    let on = |axis: usize, by: usize| if way.down >> axis & 1 == 1 { by.wrapping_neg() } else { by };
    let (across, down) = (on(b, 1), on(c, here.pitch));
    let (f, g) = (way.first, way.second);
    let weights = [(1.0 - f) * (1.0 - g), f * (1.0 - g), (1.0 - f) * g, f * g];
    let bits = [way.bit(0, 0), way.bit(1, 0), way.bit(0, 1), way.bit(1, 1)];
    // Packets run on from row to row; what they make of the border between is overwritten.
    let begin = here.row(0);
    let count = (here.row(here.cells[1] - 1) + here.cells[0] - begin).div_ceil(LANES);
    let around = [0, across, down, across.wrapping_add(down)];
    let place = Place { size: here.size, at: begin, count, around };
    // Asked for once a plane, so that packets are loaded without looking for where they lie.
    let lights = place.upwind(&before.radiance);
    let [extinctions, sources, emissions] = [&here.extinction, &here.source, &here.emission].map(|of| place.own(of));
    let upwind = [&before.extinction, &before.source, &before.emission].map(|of| place.upwind(of));
    for n in 0..count {
        let mut closed = [M::<S>::of([0; LANES]); 4];
        if !here.obstructed.is_empty() {
            let words = &here.obstructed[begin + n * LANES..][..LANES];
            for i in 0..4 {
                closed[i] = M::of(lanes!(k => if words[k] >> bits[i] & 1 == 1 { u32::MAX } else { 0 }));
            }
        }
        let from = Around { weights, closed, any: !here.obstructed.is_empty() };
        let (mut e, mut mean, mut tau) = (F::<S>::ZERO, F::ZERO, F::ZERO);
        for channel in 0..p.channels as usize {
            if channel == 0 || p.grey == 0 {
                let own = F::of(extinctions[channel][n]);
                let extinction = own + mix(&upwind[0][channel], n, &from, own);
                tau = extinction * (0.5 * way.length);
                (e, mean) = segment(tau);
            }
            let mut light = e * mix(&lights[channel], n, &from, F::ZERO);
            if p.source_coefficients > 0 {
                let own = F::of(sources[channel][n]);
                let upwind = if first { own } else { mix(&upwind[1][channel], n, &from, own) };
                light = light + own * (tau * mean) + (upwind - own) * leaning(tau, e, mean);
            }
            if p.emits == 1 {
                let own = F::of(emissions[channel][n]);
                let emission = own + mix(&upwind[2][channel], n, &from, own);
                light = light + mean * (0.5 * way.length) * emission;
            }
            here.radiance[channel * here.size + begin + n * LANES..][..LANES].copy_from_slice(&light.0);
        }
    }
}

/// ∫ s e^-s ds / τ over 0 to τ, what of a source at Y arrives where that at X is zero: by its series where τ is small.
#[inline(always)]
fn leaning<S: Simd>(tau: F<S>, e: F<S>, mean: F<S>) -> F<S> {
    let series = (((tau * (-1.0 / 30.0) + 1.0 / 8.0) * tau - 1.0 / 3.0) * tau + 0.5) * tau;
    tau.lt(F::splat(0.05)).select(series, mean - e)
}

/// What packets of cells take from the four cells around Y.
struct Around<S> {
    weights: [f32; 4],
    /// Which of them lie behind surfaces.
    closed: [M<S>; 4],
    /// Whether there are surfaces.
    any: bool,
}

/// Packet `n` between the four cells around Y; `own` stands for those behind surfaces.
#[inline(always)]
fn mix<S: Simd>(values: &[&[Floats]; 4], n: usize, from: &Around<S>, own: F<S>) -> F<S> {
    let mut sum = F::ZERO;
    for i in 0..4 {
        let mut value = F::of(values[i][n]);
        if from.any {
            value = from.closed[i].select(own, value);
        }
        sum = sum + value * from.weights[i];
    }
    sum
}

/// What the cells of plane `plane` of directions that pass through it scatter toward each.
#[inline(always)]
fn sources<S: Simd>(inputs: &Inputs<'_>, group: &[Swept<'_>], plane: usize, to: &mut [Plane]) {
    if inputs.p.source_coefficients == 0 {
        return;
    }
    match (group, &mut *to) {
        ([a, b], [first, second]) => source::<S, 2>(inputs, [a.direction, b.direction], plane, [first, second]),
        _ => {
            for (swept, to) in group.iter().zip(&mut *to) {
                source::<S, 1>(inputs, [swept.direction], plane, [to]);
            }
        }
    }
    for to in to {
        for part in to.source.chunks_exact_mut(to.size) {
            border(part, to.pitch, to.cells, None);
        }
    }
}

/// The source function toward several directions; what is written behind a row means nothing.
#[inline(always)]
fn source<S: Simd, const N: usize>(inputs: &Inputs<'_>, directions: [usize; N], plane: usize, to: [&mut Plane; N]) {
    let p = inputs.p;
    let axis = inputs.directions[directions[0]].axis as usize;
    let of = if axis == 0 { inputs.turned } else { inputs.upright };
    let [_, c] = SweepDirection::others(axis);
    let (cells, channels) = (p.count() as usize, p.channels as usize);
    let count = p.source_coefficients as usize;
    let weights = directions.map(|direction| &inputs.source_weights[direction * count..][..count]);
    for row in 0..to[0].cells[1] {
        let from = plane * of.pitch[axis] + row * of.pitch[c];
        for channel in 0..channels {
            for column in (0..to[0].cells[0]).step_by(LANES) {
                let first = channel * cells + from + column;
                let mut sums = [F::<S>::ZERO; N];
                for k in 0..count {
                    let value = packet(of.sources, k * channels * cells + first);
                    for i in 0..N {
                        sums[i] = sums[i] + value * weights[i][k];
                    }
                }
                let albedo = packet(of.albedo, first);
                for i in 0..N {
                    let at = channel * to[i].size + to[i].row(row) + column;
                    to[i].source[at..][..LANES].copy_from_slice(&(sums[i] * albedo).0);
                }
            }
        }
    }
}

/// Sixteen values, or as many as there are.
#[inline(always)]
fn packet<S: Simd>(values: &[f32], at: usize) -> F<S> {
    let values = &values[at..];
    match values.first_chunk() {
        Some(whole) => F::of(*whole),
        None => F::of(lanes!(i => if i < values.len() { values[i] } else { 0.0 })),
    }
}

/// Moments of some cells from `start` on, a slice a value: what the batches before left, and the directions of this one.
#[inline(always)]
fn gather<S: Simd>(inputs: &Inputs<'_>, radiance: &[f32], first: usize, start: usize, sums: &mut [&mut [f32]]) {
    if first == 0 {
        sums.iter_mut().for_each(|sums| sums.fill(0.0));
    }
    let count = radiance.len() / (inputs.p.count() * inputs.p.channels) as usize;
    let whole = count / LIGHTS * LIGHTS;
    for n in (0..whole).step_by(LIGHTS) {
        add::<S, LIGHTS>(inputs, radiance, [first, n], start, sums);
    }
    for n in whole..count {
        add::<S, 1>(inputs, radiance, [first, n], start, sums);
    }
}

/// Adds so many directions from number `n` of the batch on, whose first direction is `first`.
#[inline(always)]
fn add<S: Simd, const N: usize>(
    inputs: &Inputs<'_>,
    radiance: &[f32],
    [first, n]: [usize; 2],
    start: usize,
    sums: &mut [&mut [f32]],
) {
    let p = inputs.p;
    let (cells, channels, of) = (p.count() as usize, p.channels as usize, p.weight_channels as usize);
    for (value, sums) in sums.iter_mut().enumerate() {
        let (k, c) = (value / p.moment_channels() as usize, value % p.moment_channels() as usize);
        let count = sums.len();
        let mut weights = [0.0; N];
        let mut lights = [(&[][..], &[][..]); N];
        for i in 0..N {
            weights[i] = inputs.weights[((first + n + i) * p.coefficients as usize + k) * of + c.min(of - 1)];
            let light = &radiance[((n + i) * channels + c.min(channels - 1)) * cells + start..][..count];
            lights[i] = light.as_chunks::<LANES>();
        }
        let (packets, rest) = sums.as_chunks_mut::<LANES>();
        for (at, packet) in packets.iter_mut().enumerate() {
            let mut sum = F::<S>::of(*packet);
            for i in 0..N {
                sum = sum + F::of(lights[i].0[at]) * weights[i];
            }
            *packet = sum.0;
        }
        for (at, sum) in rest.iter_mut().enumerate() {
            for i in 0..N {
                *sum += weights[i] * lights[i].1[at];
            }
        }
    }
}
