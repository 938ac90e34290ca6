//! `photons`: light that the medium scatters, left on the cells of a coarse grid. Sixteen photons walk at a time, as `path`'s.

use std::ops::Range;
use std::sync::atomic::{AtomicI32, Ordering::Relaxed};

use airlight_core::device::DeviceError;
use airlight_core::glam::{IVec3, Vec3};
use airlight_core::stage::{FAR, PhaseParams, PhotonDirection, PhotonParams, Photons, photon_counter, photon_deposit};
use rayon::prelude::*;

use super::bend::{around, bend, bend_density};
use super::field::{Colors, Scalars};
use super::harmonics::{MAX, harmonics};
use super::phase::{Phase, phase};
use super::random::{Draws, Series, draw, draws};
use super::walk::{Ground, Walk, Walks, carried, walk};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, I, LANES, M, lanes, triple};
use crate::simd::{Portable, Simd};

/// Photons that one task takes.
const TASK: u32 = 512;
/// Flights that are kept before their light is left.
const EVENTS: usize = LANES;

struct Inputs<'a> {
    p: &'a PhotonParams,
    ground: Ground<'a>,
    density: Scalars<'a>,
    scattering: Option<Colors<'a>>,
    tables: &'a [f32],
    bends: &'a [f32],
    phase: Phase<'a>,
    directions: &'a [PhotonDirection],
    weights: &'a [[f32; 2]],
    rows: &'a [u32],
    deposits: &'a [AtomicI32],
}

/// A photon on its way, as far as its lane does not walk.
#[derive(Clone, Copy)]
struct Photon {
    /// Of all photons, and where in the list its direction is.
    number: u32,
    source: usize,
    way: Vec3,
    weight: f32,
    /// Scatterings before this flight.
    depth: u32,
    over: bool,
}

/// Where a photon is stopped: in index space, with the density and the extinction there.
struct Stop {
    at: Vec3,
    density: f32,
    extinction: f32,
}

/// A flight that leaves light: of which photon, as [`Photon`] has it; in index space from where, and voxels per metre; on its way
/// through the world; metres of it, and light per metre or all of it.
#[derive(Clone, Copy)]
struct Event {
    number: u32,
    source: usize,
    origin: Vec3,
    direction: Vec3,
    way: Vec3,
    length: f32,
    light: f32,
    depth: u32,
}

/// What photons count.
type Tally = [i32; photon_counter::COUNT as usize];

pub(crate) fn run(stage: &Photons, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.deposits)?;
    memory.take(stage.counters)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let [x, y, z, _] = p.dims;
    let tables = read.buf(stage.tables)?;
    let counters = shared(bytemuck::cast_slice_mut(out.remove(1)));
    let inputs = Inputs {
        p,
        ground: Ground::new(
            p.dims,
            [p.index_x, p.index_y, p.index_z],
            p.majorant_cells,
            read.buf(stage.majorant)?,
            [p.densest, p.least],
        )?,
        density: read.scalars(stage.density)?,
        scattering: match stage.scattering {
            Some(field) => Some(Colors::new(bytemuck::cast_slice(read.field(field)?), [x, y, z, 1])),
            None => None,
        },
        tables,
        bends: tables.get(p.bends_at as usize..).unwrap_or_default(),
        phase: Phase {
            kind: p.phase_kind,
            lobes: p.phase,
            table: tables.get(p.phase_at as usize..).and_then(|t| t.get(..p.phase_size as usize)).unwrap_or_default(),
        },
        directions: read.buf(stage.directions)?,
        weights: read.buf(stage.weights)?,
        rows: read.buf(stage.rows)?,
        deposits: shared(bytemuck::cast_slice_mut(out.remove(0))),
    };
    let tasks = (range.end - range.start).div_ceil(TASK);
    (0..tasks).into_par_iter().for_each(|n| {
        let begin = range.start + n * TASK;
        let (inputs, units) = (&inputs, begin..range.end.min(begin + TASK));
        let mut tally = Tally::default();
        let counts = &mut tally;
        compiled_for!(isa, photons<S>(inputs: &Inputs<'_>, units: Range<u32>, counts: &mut Tally));
        for (count, counter) in tally.into_iter().zip(counters) {
            if count > 0 {
                counter.fetch_add(count, Relaxed);
            }
        }
    });
    Ok(())
}

/// Integers that several threads add to.
fn shared(values: &mut [i32]) -> &[AtomicI32] {
    // SAFETY: both are of the same size and alignment, as the assertion says, and while the result lives nothing else reaches
    // the values, which are borrowed for as long.
    #[allow(unsafe_code)]
    unsafe {
        const { assert!(align_of::<AtomicI32>() == align_of::<i32>()) };
        &*(std::ptr::from_mut(values) as *const [AtomicI32])
    }
}

/// The photons of some units. Each lane takes the next when one is no more: all walk together, and whatever else happens to a
/// photon happens to it alone.
#[inline(always)]
fn photons<S: Simd>(inputs: &Inputs<'_>, units: Range<u32>, tally: &mut Tally) {
    let p = inputs.p;
    let none = Photon { number: 0, source: 0, way: Vec3::ZERO, weight: 0.0, depth: 0, over: true };
    let mut lanes = [none; LANES];
    let (mut on, mut numbers) = (Walks::<S>::idle(), Series::<S>::idle());
    let (mut at, mut density, mut extinction) = ([F::<S>::ZERO; 3], F::<S>::ZERO, F::<S>::ZERO);
    // Lanes that walk, those that are to be seen to, those of them that were stopped, and the turns that each has left.
    let (mut walking, mut halted, mut stopped, mut left) = (M::<S>::NONE, (1u32 << LANES) - 1, 0u32, I::<S>::ZERO);
    let mut events = Events::default();
    let mut next = units.start;
    loop {
        while halted != 0 {
            let i = halted.trailing_zeros() as usize;
            let photon = &mut lanes[i];
            let stop = stopped >> i & 1 == 1;
            stopped &= !(1 << i);
            if photon.over {
                if next == units.end {
                    halted &= halted - 1;
                    continue;
                }
                let source = (next % p.listed) as usize;
                let number = (p.round + next / p.listed) * p.directions + inputs.directions[source].number;
                let mut own = draws(number, 0, p.seed, 0);
                let (way, walk) = enter(inputs, &inputs.directions[source], &mut own);
                *photon = Photon { number, source, way, weight: 1.0, depth: 0, over: false };
                on.set(&inputs.ground, i, &walk);
                numbers.set(i, &own);
                left.0[i] = p.turns.min(i32::MAX as u32) as i32;
                tally[photon_counter::PHOTONS as usize] += i32::from(p.begin == 1);
                next += 1;
            } else if !stop && left.0[i] == 0 {
                photon.over = true;
                let leaves = photon.depth >= p.begin;
                tally[photon_counter::TRUNCATED as usize] += i32::from(leaves || p.begin == 1);
            } else if !stop && !on.over.lane(i) {
                walking.set(i, true);
                halted &= halted - 1;
            } else {
                left.0[i] -= i32::from(!stop);
                let place = Vec3::from(triple!(a => at[a].0[i]));
                let stop = stop.then(|| Stop { at: place, density: density.0[i], extinction: extinction.0[i] });
                let mut own = numbers.get(i);
                if let Some(walk) = trace(inputs, photon, &on.get(i), stop, &mut own, &mut events, tally) {
                    on.set(&inputs.ground, i, &walk);
                }
                numbers.set(i, &own);
                if events.count == EVENTS {
                    land_all::<S>(inputs, &mut events, tally);
                }
            }
        }
        if !walking.any() {
            break;
        }
        let rate = on.advance(&inputs.ground, &mut numbers, walking);
        left = left.plus(walking.choose(-1));
        let met = walking.and(rate.gt(F::ZERO));
        let mut real = M::NONE;
        if met.any() {
            at = on.stands();
            density = inputs.density.sample(at);
            extinction = (density * p.densest).min(rate);
            real = met.and((numbers.draw(met) * rate).lt(extinction));
        }
        let stop = walking.and(on.over.or(left.below(1)).or(real));
        (halted, stopped) = (stop.bits(), real.bits());
        walking = walking.and(stop.not());
    }
    land_all::<S>(inputs, &mut events, tally);
}

/// The way of a photon, and its walk from where it enters the box.
fn enter(inputs: &Inputs<'_>, source: &PhotonDirection, numbers: &mut Draws) -> (Vec3, Walk) {
    let toward = source.toward;
    let way = -Vec3::new(toward[0], toward[1], toward[2]);
    let along = carried(&inputs.ground, way);
    let wall = draw(numbers);
    let (a, b) = (draw(numbers), draw(numbers));
    // The wall at the lower end lets in what goes up.
    let side = |c: f32| if c > 0.0 { 0.0 } else { 1.0 };
    let at = if wall < source.first {
        Vec3::new(side(along.x), a, b)
    } else if wall < source.second {
        Vec3::new(a, side(along.y), b)
    } else {
        Vec3::new(a, b, side(along.z))
    };
    let [x, y, z, _] = inputs.p.dims;
    let origin = at * Vec3::new(x as f32, y as f32, z as f32) - 0.5;
    (way, walk(&inputs.ground, origin, along, FAR))
}

/// What happens to a photon at the end of its walk `on`, or where it is stopped before. The walk that it goes on by.
fn trace(
    inputs: &Inputs<'_>,
    photon: &mut Photon,
    on: &Walk,
    stop: Option<Stop>,
    numbers: &mut Draws,
    events: &mut Events,
    tally: &mut Tally,
) -> Option<Walk> {
    let p = inputs.p;
    let track = p.deposit == photon_deposit::TRACK;
    let leaves = photon.depth >= p.begin;
    let (mut at, mut light) = (on.origin, 0.0);
    if let Some(stop) = stop {
        at = stop.at;
        let scatters = albedo(inputs, at, stop.density);
        match p.deposit {
            photon_deposit::TRACK => light = photon.weight,
            photon_deposit::COLLISION => light = photon.weight / stop.extinction,
            _ => {
                if draw(numbers) >= scatters {
                    light = photon.weight / (stop.extinction * (1.0 - scatters));
                    photon.over = true;
                }
            }
        }
        if p.deposit != photon_deposit::ABSORPTION {
            photon.weight *= scatters;
        }
    } else {
        photon.over = true;
        light = if track { photon.weight } else { light };
    }
    if leaves && light > 0.0 {
        let Photon { number, source, way, depth, .. } = *photon;
        let origin = if track { on.origin } else { at };
        events.push(Event { number, source, origin, direction: on.direction, way, length: on.t, light, depth });
    }
    if photon.weight < Photons::WEAK && !photon.over {
        photon.over = draw(numbers) * Photons::WEAK >= photon.weight;
        photon.weight = Photons::WEAK;
    }
    if photon.over {
        return None;
    }
    photon.depth += 1;
    if photon.depth >= p.end {
        photon.over = true;
        tally[photon_counter::TRUNCATED as usize] += i32::from(p.end > p.max_depth);
        return None;
    }
    let c = bend(&inputs.phase, inputs.bends, numbers);
    if p.phase_kind == PhaseParams::TABLE {
        let one = F::<Portable>::splat(c);
        photon.weight *= phase(&inputs.phase, one).0[0] / bend_density(&inputs.phase, inputs.bends, c);
    }
    photon.way = around(photon.way, c, draw(numbers));
    Some(walk(&inputs.ground, at, carried(&inputs.ground, photon.way), FAR))
}

/// Flights whose light is still to be left.
struct Events {
    of: [Event; EVENTS],
    count: usize,
}

impl Default for Events {
    fn default() -> Self {
        let (number, source, length, light, depth) = (0, 0, 0.0, 0.0, 0);
        let [origin, direction, way] = [Vec3::ZERO; 3];
        Self { of: [Event { number, source, origin, direction, way, length, light, depth }; EVENTS], count: 0 }
    }
}

impl Events {
    /// Keeps one more, for which there is room.
    fn push(&mut self, event: Event) {
        self.of[self.count] = event;
        self.count += 1;
    }
}

/// Leaves the light of all that are kept.
#[inline(always)]
fn land_all<S: Simd>(inputs: &Inputs<'_>, events: &mut Events, tally: &mut Tally) {
    let count = events.count;
    // Toward where the light of each comes from.
    let toward = triple!(a => F::<S>::of(lanes!(i => if i < count { -events.of[i].way[a] } else { 0.0 })));
    let mut values = [F::ZERO; MAX];
    harmonics(inputs.tables, inputs.p.bands as usize, toward, &mut values);
    for (i, event) in events.of[..count].iter().enumerate() {
        let mut moments = [0.0; MAX];
        let used = (inputs.p.bands * inputs.p.bands) as usize;
        moments.iter_mut().zip(&values).take(used).for_each(|(m, v)| *m = v.0[i]);
        deposit(inputs, event, &moments, tally);
    }
    events.count = 0;
}

/// The albedo at a place of index space, where there is some density.
fn albedo(inputs: &Inputs<'_>, at: Vec3, density: f32) -> f32 {
    let p = inputs.p;
    match inputs.scattering {
        Some(field) => field.sample(at.to_array()).layer(0)[p.channel as usize] / density * p.albedo,
        None => p.albedo,
    }
}

/// Leaves the light of a flight.
fn deposit(inputs: &Inputs<'_>, event: &Event, moments: &[f32; MAX], tally: &mut Tally) {
    let (p, source) = (inputs.p, &inputs.directions[event.source]);
    let rounding = draws(event.number, event.depth, p.seed, 0);
    tally[photon_counter::DEPOSITS as usize] += 1;
    let [x, y, z, _] = p.cells;
    let cells = IVec3::new(x as i32, y as i32, z as i32);
    let voxels = Vec3::new(p.dims[0] as f32, p.dims[1] as f32, p.dims[2] as f32);
    let ratio = cells.as_vec3() / voxels;
    let flight = Event { origin: (event.origin + 0.5) * ratio, direction: event.direction * ratio, ..*event };
    let light = event.light * source.toward[3] / p.volume * p.scale;
    let cargo = Cargo { inputs, source, moments, rounding };
    let received = if p.deposit == photon_deposit::TRACK {
        along(&cargo, cells, &flight, light, tally)
    } else {
        spread(&cargo, cells, flight.origin, light, tally)
    };
    tally[photon_counter::LOST as usize] += i32::from(!received);
}

/// What the cells get of a flight alike.
struct Cargo<'a> {
    inputs: &'a Inputs<'a>,
    source: &'a PhotonDirection,
    moments: &'a [f32; MAX],
    rounding: Draws,
}

/// Leaves light along a flight, whose places are in cells. Whether any cell has a row.
fn along(cargo: &Cargo<'_>, cells: IVec3, flight: &Event, light: f32, tally: &mut Tally) -> bool {
    let Event { origin, direction, length, .. } = *flight;
    let mut cell = origin.floor().max(Vec3::ZERO).min((cells - 1).as_vec3()).as_ivec3();
    let (mut t, mut received) = (0.0f32, false);
    for _ in 0..cells.x + cells.y + cells.z + 3 {
        let ahead = |a: usize| cell[a] + i32::from(direction[a] > 0.0);
        let leave = triple!(a => (ahead(a) as f32 - origin[a]) / direction[a]);
        let axis = if leave[0] <= leave[1] && leave[0] <= leave[2] {
            0
        } else if leave[1] <= leave[2] {
            1
        } else {
            2
        };
        let exit = leave[axis].min(length);
        if exit > t {
            received |= land(cargo, (cell.z * cells.y + cell.y) * cells.x + cell.x, light * (exit - t), tally);
            t = exit;
        }
        cell[axis] += if direction[axis] > 0.0 { 1 } else { -1 };
        if exit >= length || cell[axis] < 0 || cell[axis] >= cells[axis] {
            break;
        }
    }
    received
}

/// Leaves light on the cells around a place in cells. Whether any has a row.
fn spread(cargo: &Cargo<'_>, cells: IVec3, place: Vec3, light: f32, tally: &mut Tally) -> bool {
    let reach = cargo.inputs.p.radius.ceil() as i32;
    let side = 2 * reach + 1;
    let first = place.floor().as_ivec3() - reach;
    let at = |i: i32| first + IVec3::new(i % side, i / side % side, i / (side * side));
    let mut sum = 0.0;
    for i in 0..side * side * side {
        sum += share(cargo.inputs, cells, at(i), place);
    }
    if sum <= 0.0 {
        return false;
    }
    for i in 0..side * side * side {
        let cell = at(i);
        let part = share(cargo.inputs, cells, cell, place);
        if part > 0.0 {
            land(cargo, (cell.z * cells.y + cell.y) * cells.x + cell.x, light * (part / sum), tally);
        }
    }
    true
}

/// The part of a cell in what is left around a place in cells, but for a factor; 0 where it has no row.
fn share(inputs: &Inputs<'_>, cells: IVec3, cell: IVec3, place: Vec3) -> f32 {
    if cell.cmplt(IVec3::ZERO).any() || cell.cmpge(cells).any() {
        return 0.0;
    }
    if inputs.rows[((cell.z * cells.y + cell.y) * cells.x + cell.x) as usize] == 0 {
        return 0.0;
    }
    let way = cell.as_vec3() + 0.5 - place;
    let base = (inputs.p.radius * inputs.p.radius - way.dot(way)).max(0.0);
    base * base * base
}

/// Adds light to the moments of a cell. Whether it has a row.
fn land(cargo: &Cargo<'_>, cell: i32, light: f32, tally: &mut Tally) -> bool {
    let p = cargo.inputs.p;
    let row = cargo.inputs.rows[cell as usize];
    if row == 0 || row > p.rows {
        return false;
    }
    let mut rounding = cargo.rounding;
    rounding.next = cell as u32;
    let up = draw(&mut rounding);
    let count = p.bands * p.bands;
    let weights = &cargo.inputs.weights[cargo.source.weights as usize..][..cargo.source.count as usize];
    for &[number, value] in weights {
        let number = number as u32;
        if number < p.lights {
            let at = ((row - 1) * p.lights + number) * count;
            let places = &cargo.inputs.deposits[at as usize..][..count as usize];
            for (place, moment) in places.iter().zip(cargo.moments) {
                add(place, light * value * moment + up, tally);
            }
        }
    }
    true
}

/// Adds what lies below a value to an integer, and counts what that does not hold.
#[inline]
fn add(place: &AtomicI32, value: f32, tally: &mut Tally) {
    let mut held = false;
    // What is not a number is not held either.
    if value.abs() < 2_147_483_648.0 {
        // A conversion rounds toward zero; large floats are integers.
        let toward = value as i32;
        let more = toward - i32::from(value < toward as f32);
        let before = if more == 0 { 0 } else { place.fetch_add(more, Relaxed) };
        let after = before.wrapping_add(more);
        held = (before ^ after) & (more ^ after) >= 0;
    }
    tally[photon_counter::OVERFLOWS as usize] += i32::from(!held);
}
