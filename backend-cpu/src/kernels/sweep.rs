//! `sweep`: light along many directions at the cells of a coarse grid, each from its neighbours upwind.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Sweep, SweepDirection, SweepParams};
use rayon::prelude::*;

use super::segment::segment;
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, lanes};
use crate::simd::Simd;

/// Cells whose moments one task adds up: few enough that the radiance of all directions stays in the cache.
const CHUNK: usize = 512;

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
    optics: &'a [f32],
    sources: &'a [f32],
    /// Values from a cell to the next along x, y and z.
    pitch: [usize; 3],
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
    // Rows along y are a fraction of what is swept, and a third of the directions reads each of them many times.
    let across = directions.iter().any(|way| way.axis == 0);
    let [turned_optics, turned_sources] =
        [optics, sources].map(|of| if across { turned(of, x, y) } else { Vec::new() });
    let inputs = Inputs {
        p,
        upright: Cells { optics, sources, pitch: [1, x, x * y] },
        turned: Cells { optics: &turned_optics, sources: &turned_sources, pitch: [y, 1, x * y] },
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
        radiance.par_chunks_exact_mut(each).take(count).enumerate().for_each(|(n, light)| {
            let (inputs, direction, steps) = (&inputs, first + n, steps.clone());
            compiled_for!(
                isa,
                sweep<S>(inputs: &Inputs<'_>, direction: usize, steps: Range<u32>, light: &mut [f32])
            );
        });
    }
    Ok(())
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
        parts.into_par_iter().enumerate().for_each(|(n, parts)| {
            for (value, sums) in parts.into_iter().enumerate() {
                let start = n * CHUNK;
                compiled_for!(
                    isa,
                    gather<S>(
                        inputs: &Inputs<'_>,
                        radiance: &[f32],
                        first: usize,
                        value: usize,
                        start: usize,
                        sums: &mut [f32],
                    )
                );
            }
        });
        return;
    }
    moments.par_chunks_mut(CHUNK * values).enumerate().for_each(|(n, records)| {
        let mut sums = vec![0.0; records.len() / values];
        for value in 0..values {
            sums.iter_mut().zip(records.chunks_exact(values)).for_each(|(sum, record)| *sum = record[value]);
            let (sums, start) = (&mut sums[..], n * CHUNK);
            compiled_for!(
                isa,
                gather<S>(inputs: &Inputs<'_>, radiance: &[f32], first: usize, value: usize, start: usize, sums: &mut [f32])
            );
            records.chunks_exact_mut(values).zip(&*sums).for_each(|(record, sum)| record[value] = *sum);
        }
    });
}

/// Planes of values with x and y exchanged.
fn turned(values: &[f32], x: usize, y: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(values.len());
    for slice in values.chunks_exact(x * y) {
        (0..x).for_each(|i| out.extend(slice.iter().skip(i).step_by(x)));
    }
    out
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

    /// Takes plane `plane` of a direction: what its cells hold, and their radiance where it is there.
    #[inline(always)]
    fn load<S: Simd>(&mut self, inputs: &Inputs<'_>, direction: usize, plane: usize, light: Option<&[f32]>) {
        let p = inputs.p;
        let way = &inputs.directions[direction];
        let (cells, axis) = (p.count() as usize, way.axis as usize);
        let of = if axis == 0 { inputs.turned } else { inputs.upright };
        let [b, c] = SweepDirection::others(axis);
        let place = |pitch: [usize; 3], row: usize| plane * pitch[axis] + row * pitch[c];
        for row in 0..self.cells[1] {
            let (to, count) = (self.row(row), self.cells[0]);
            let from = place(of.pitch, row);
            for (kind, out) in [(0, &mut self.extinction), (6, &mut self.emission)] {
                let all = of.optics[kind * cells..].chunks_exact(cells);
                for (part, values) in out.chunks_exact_mut(self.size).zip(all) {
                    part[to..to + count].copy_from_slice(&values[from..from + count]);
                }
            }
            if p.source_coefficients > 0 {
                for channel in 0..p.channels as usize {
                    let out = &mut self.source[channel * self.size..][..self.size][to..];
                    source::<S>(inputs, of, direction, channel, from..from + count, out);
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
        for part in self.source.chunks_exact_mut(self.size) {
            border(part, self.pitch, self.cells, None);
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

/// Some steps of a direction.
#[inline(always)]
fn sweep<S: Simd>(inputs: &Inputs<'_>, direction: usize, steps: Range<u32>, light: &mut [f32]) {
    let p = inputs.p;
    let way = &inputs.directions[direction];
    let cells = [p.cells[0], p.cells[1], p.cells[2]];
    let (mut before, mut here) = (Plane::new(inputs, way.axis as usize), Plane::new(inputs, way.axis as usize));
    // Beyond the box.
    before.radiance.fill(p.boundary);
    for step in steps.clone() {
        let Some(plane) = way.plane(cells, step) else { break };
        if step > 0 && step == steps.start {
            let last = way.plane(cells, step - 1).unwrap_or(plane);
            before.load::<S>(inputs, direction, last as usize, Some(light));
            for part in before.radiance.chunks_exact_mut(before.size) {
                border(part, before.pitch, before.cells, Some(p.boundary));
            }
        }
        here.load::<S>(inputs, direction, plane as usize, None);
        advance::<S>(inputs, way, step == 0, &before, &mut here);
        let (count, axis) = (p.count() as usize, way.axis as usize);
        let pitch = [1, p.cells[0] as usize, (p.cells[0] * p.cells[1]) as usize];
        let [b, c] = SweepDirection::others(axis);
        for (part, out) in here.radiance.chunks_exact(here.size).zip(light.chunks_exact_mut(count)) {
            for row in 0..here.cells[1] {
                let values = &part[here.row(row)..][..here.cells[0]];
                let out = &mut out[plane as usize * pitch[axis] + row * pitch[c]..];
                if pitch[b] == 1 {
                    out[..values.len()].copy_from_slice(values);
                } else {
                    out.iter_mut().step_by(pitch[b]).zip(values).for_each(|(out, value)| *out = *value);
                }
            }
        }
        for part in here.radiance.chunks_exact_mut(here.size) {
            border(part, here.pitch, here.cells, Some(p.boundary));
        }
        std::mem::swap(&mut before, &mut here);
    }
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
    let size = here.size;
    let around = [0, across, down, across.wrapping_add(down)];
    let bits = [way.bit(0, 0), way.bit(1, 0), way.bit(0, 1), way.bit(1, 1)];
    // Packets run on from row to row; what they make of the border between is overwritten.
    let end = here.row(here.cells[1] - 1) + here.cells[0];
    for at in (here.row(0)..end).step_by(LANES) {
        let mut closed = [M::<S>::of([0; LANES]); 4];
        if !here.obstructed.is_empty() {
            let words = &here.obstructed[at..at + LANES];
            for i in 0..4 {
                closed[i] = M::of(lanes!(k => if words[k] >> bits[i] & 1 == 1 { u32::MAX } else { 0 }));
            }
        }
        let from = Around { at, around, weights, closed, any: !here.obstructed.is_empty() };
        let (mut e, mut mean, mut tau) = (F::<S>::ZERO, F::ZERO, F::ZERO);
        for channel in 0..p.channels as usize {
            let part = channel * size;
            if channel == 0 || p.grey == 0 {
                let own = load(&here.extinction[part..], at);
                let extinction = own + mix(&before.extinction[part..], &from, own);
                tau = extinction * (0.5 * way.length);
                (e, mean) = segment(tau);
            }
            let mut light = e * mix(&before.radiance[part..], &from, F::ZERO);
            if p.source_coefficients > 0 {
                let own = load(&here.source[part..], at);
                let upwind = if first { own } else { mix(&before.source[part..], &from, own) };
                light = light + own * (tau * mean) + (upwind - own) * leaning(tau, e, mean);
            }
            if p.emits == 1 {
                let own = load(&here.emission[part..], at);
                let emission = own + mix(&before.emission[part..], &from, own);
                light = light + mean * (0.5 * way.length) * emission;
            }
            here.radiance[part + at..][..LANES].copy_from_slice(&light.0);
        }
    }
}

/// ∫ s e^-s ds / τ over 0 to τ, what of a source at Y arrives where that at X is zero: by its series where τ is small.
#[inline(always)]
fn leaning<S: Simd>(tau: F<S>, e: F<S>, mean: F<S>) -> F<S> {
    let series = (((tau * (-1.0 / 30.0) + 1.0 / 8.0) * tau - 1.0 / 3.0) * tau + 0.5) * tau;
    tau.lt(F::splat(0.05)).select(series, mean - e)
}

/// Where the four cells around Y lie from a packet of cells.
struct Around<S> {
    at: usize,
    around: [usize; 4],
    weights: [f32; 4],
    /// Which of them lie behind surfaces.
    closed: [M<S>; 4],
    /// Whether there are surfaces.
    any: bool,
}

/// Between the four cells around Y; `own` stands for those behind surfaces.
#[inline(always)]
fn mix<S: Simd>(values: &[f32], from: &Around<S>, own: F<S>) -> F<S> {
    let mut sum = F::ZERO;
    for i in 0..4 {
        let mut value = load(values, from.at.wrapping_add(from.around[i]));
        if from.any {
            value = from.closed[i].select(own, value);
        }
        sum = sum + value * from.weights[i];
    }
    sum
}

#[inline(always)]
fn load<S: Simd>(values: &[f32], at: usize) -> F<S> {
    let values = values[at..].first_chunk().expect("planes have room for a packet behind them");
    F::of(*values)
}

/// The source function of a row of so many cells, from the first on; what is written behind them means nothing.
#[inline(always)]
fn source<S: Simd>(
    inputs: &Inputs<'_>,
    of: Cells<'_>,
    direction: usize,
    channel: usize,
    row: Range<usize>,
    out: &mut [f32],
) {
    let p = inputs.p;
    let (cells, channels) = (p.count() as usize, p.channels as usize);
    let count = p.source_coefficients as usize;
    let weights = &inputs.source_weights[direction * count..][..count];
    for (first, out) in row.step_by(LANES).zip(out.chunks_exact_mut(LANES)) {
        let mut sum = F::<S>::ZERO;
        for (k, weight) in weights.iter().enumerate() {
            sum = sum + packet(of.sources, (k * channels + channel) * cells + first) * *weight;
        }
        out.copy_from_slice(&(sum * packet(of.optics, (3 + channel) * cells + first)).0);
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

/// One value of the moments of some cells from `start` on: what the batches before left, and the directions of this one.
#[inline(always)]
fn gather<S: Simd>(inputs: &Inputs<'_>, radiance: &[f32], first: usize, value: usize, start: usize, sums: &mut [f32]) {
    let p = inputs.p;
    let (cells, channels, of) = (p.count() as usize, p.channels as usize, p.weight_channels as usize);
    let (k, c) = (value / p.moment_channels() as usize, value % p.moment_channels() as usize);
    if first == 0 {
        sums.fill(0.0);
    }
    for (n, light) in radiance.chunks_exact(cells * channels).enumerate() {
        let weight = inputs.weights[((first + n) * p.coefficients as usize + k) * of + c.min(of - 1)];
        let light = &light[c.min(channels - 1) * cells + start..][..sums.len()];
        sums.iter_mut().zip(light).for_each(|(sum, light)| *sum += weight * light);
    }
}
