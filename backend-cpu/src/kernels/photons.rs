//! `photons`: light that the medium scatters, left on the cells of a coarse grid. One photon at a time, as `path`'s.

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
use super::random::{Draws, draw, draws};
use super::walk::{Ground, Walk, advance, carried, stands, walk};
use crate::device::Memory;
use crate::packet::{self, LANES, lanes, triple};
use crate::simd::Portable;

/// Photons that one task takes.
const TASK: usize = 256;
/// Flights that are kept before their light is left: no more than a packet has lanes.
const EVENTS: usize = Photons::EVENTS as usize;

/// Packets of which one lane counts.
type F = packet::F<Portable>;

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

/// A photon on its way.
struct Photon {
    on: Walk,
    way: Vec3,
    weight: f32,
    /// Scatterings before this flight.
    depth: u32,
    turns: u32,
    over: bool,
}

/// A flight that leaves light: in index space from where, and voxels per metre; on its way through the world; metres of it, and light
/// per metre or all of it.
#[derive(Clone, Copy)]
struct Event {
    origin: Vec3,
    direction: Vec3,
    way: Vec3,
    length: f32,
    light: f32,
    depth: u32,
}

/// What a photon counts.
type Tally = [i32; photon_counter::COUNT as usize];

pub(crate) fn run(stage: &Photons, range: Range<u32>, memory: &mut Memory<'_>) -> Result<(), DeviceError> {
    memory.take(stage.deposits)?;
    memory.take(stage.counters)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let [x, y, z, _] = p.dims;
    let tables = read.buf(stage.tables)?;
    let counters = shared(bytemuck::cast_slice_mut(out.remove(1)));
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
    (range.start..range.end).into_par_iter().with_min_len(TASK).for_each(|unit| {
        for (count, counter) in photons(&inputs, unit).into_iter().zip(counters) {
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

/// The photon of a unit.
fn photons(inputs: &Inputs<'_>, unit: u32) -> Tally {
    let p = inputs.p;
    let source = &inputs.directions[(unit % p.listed) as usize];
    let number = (p.round + unit / p.listed) * p.directions + source.number;
    let mut numbers = draws(number, 0, p.seed, 0);
    let mut photon = enter(inputs, source, &mut numbers);
    let mut tally = Tally::default();
    if p.begin == 1 {
        tally[photon_counter::PHOTONS as usize] = 1;
    }
    let none = Event { origin: Vec3::ZERO, direction: Vec3::ZERO, way: Vec3::ZERO, length: 0.0, light: 0.0, depth: 0 };
    let mut events = [none; EVENTS];
    let mut values = [F::ZERO; MAX];
    while !photon.over {
        let count = trace(inputs, &mut photon, &mut numbers, &mut events, &mut tally);
        if count == 0 {
            continue;
        }
        // Toward where the light of each event comes from.
        let toward = triple!(a => F::of(lanes!(i => if i < count { -events[i].way[a] } else { 0.0 })));
        harmonics(inputs.tables, p.bands as usize, toward, &mut values);
        for (i, event) in events[..count].iter().enumerate() {
            let mut moments = [0.0; MAX];
            moments.iter_mut().zip(&values).take((p.bands * p.bands) as usize).for_each(|(m, v)| *m = v.0[i]);
            let rounding = draws(number, event.depth, p.seed, 0);
            deposit(inputs, source, event, &moments, rounding, &mut tally);
        }
    }
    tally
}

/// A photon where it enters the box.
fn enter(inputs: &Inputs<'_>, source: &PhotonDirection, numbers: &mut Draws) -> Photon {
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
    let on = walk(&inputs.ground, origin, along, FAR);
    Photon { on, way, weight: 1.0, depth: 0, turns: 0, over: false }
}

/// Follows a photon until it has made so many flights that leave light as are kept, or is no more. How many it made.
fn trace(
    inputs: &Inputs<'_>,
    photon: &mut Photon,
    numbers: &mut Draws,
    events: &mut [Event; EVENTS],
    tally: &mut Tally,
) -> usize {
    let p = inputs.p;
    let mut count = 0;
    while !photon.over && count < EVENTS {
        let leaves = photon.depth >= p.begin;
        if photon.turns >= p.turns {
            photon.over = true;
            tally[photon_counter::TRUNCATED as usize] += i32::from(leaves || p.begin == 1);
            break;
        }
        photon.turns += 1;
        let mut light = 0.0;
        let mut at = photon.on.origin;
        if photon.on.over {
            photon.over = true;
            light = if p.deposit == photon_deposit::TRACK { photon.weight } else { 0.0 };
        } else {
            let rate = advance(&inputs.ground, &mut photon.on, numbers);
            if rate == 0.0 {
                continue;
            }
            at = stands(&photon.on);
            let density = inputs.density.single(at.to_array());
            let extinction = (density * p.densest).min(rate);
            if draw(numbers) * rate >= extinction {
                continue;
            }
            let scatters = albedo(inputs, at, density);
            match p.deposit {
                photon_deposit::TRACK => light = photon.weight,
                photon_deposit::COLLISION => light = photon.weight / extinction,
                _ => {
                    if draw(numbers) >= scatters {
                        light = photon.weight / (extinction * (1.0 - scatters));
                        photon.over = true;
                    }
                }
            }
            if p.deposit != photon_deposit::ABSORPTION {
                photon.weight *= scatters;
            }
        }
        if leaves && light > 0.0 {
            let track = p.deposit == photon_deposit::TRACK;
            let origin = if track { photon.on.origin } else { at };
            let (direction, length) = (photon.on.direction, photon.on.t);
            events[count] = Event { origin, direction, way: photon.way, length, light, depth: photon.depth };
            count += 1;
        }
        if photon.weight < Photons::WEAK && !photon.over {
            photon.over = draw(numbers) * Photons::WEAK >= photon.weight;
            photon.weight = Photons::WEAK;
        }
        if photon.over {
            break;
        }
        photon.depth += 1;
        if photon.depth >= p.end {
            photon.over = true;
            tally[photon_counter::TRUNCATED as usize] += i32::from(p.end > p.max_depth);
            break;
        }
        let c = bend(&inputs.phase, inputs.bends, numbers);
        if p.phase_kind == PhaseParams::TABLE {
            photon.weight *= phase(&inputs.phase, F::splat(c)).0[0] / bend_density(&inputs.phase, inputs.bends, c);
        }
        photon.way = around(photon.way, c, draw(numbers));
        photon.on = walk(&inputs.ground, at, carried(&inputs.ground, photon.way), FAR);
    }
    count
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
fn deposit(
    inputs: &Inputs<'_>,
    source: &PhotonDirection,
    event: &Event,
    moments: &[f32; MAX],
    rounding: Draws,
    tally: &mut Tally,
) {
    let p = inputs.p;
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
                add(place, (light * value * moment + up).floor(), tally);
            }
        }
    }
    true
}

/// Adds to an integer, and counts what it does not hold.
fn add(place: &AtomicI32, value: f32, tally: &mut Tally) {
    let mut held = false;
    // What is not a number is not held either.
    if value.abs() < 2_147_483_648.0 {
        let more = value as i32;
        let before = if more == 0 { 0 } else { place.fetch_add(more, Relaxed) };
        let after = before.wrapping_add(more);
        held = (before ^ after) & (more ^ after) >= 0;
    }
    tally[photon_counter::OVERFLOWS as usize] += i32::from(!held);
}
