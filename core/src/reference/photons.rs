//! Twin of the stage [`Photons`]: one photon after another, each flight with the light that it leaves.

use std::ops::Range;

use glam::DVec3;

use super::flight::{Bends, Draws, Ground, Walk, around};
use super::lookup::{Samples, Tints, apply, xyz};
use crate::basis::{Basis, SphericalHarmonics};
use crate::stage::{PhaseParams, PhotonDirection, PhotonParams, Photons, photon_counter, photon_deposit};

/// What the bindings of [`Photons`] hold.
#[derive(Clone, Copy, Debug)]
pub struct PhotonInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// Density that scatters.
    pub scattering: Option<&'a [[f32; 4]]>,
    /// Mean and maximum of each cell.
    pub majorant: &'a [[f32; 2]],
    /// Tables.
    pub tables: &'a [f32],
    /// The listed directions.
    pub directions: &'a [PhotonDirection],
    /// Their weights.
    pub weights: &'a [[f32; 2]],
    /// For each cell its row plus 1.
    pub rows: &'a [u32],
}

/// What the photons of some units of [`Photons`] add to deposits and counters.
pub fn photons(
    params: &PhotonParams,
    inputs: &PhotonInputs<'_>,
    units: Range<u32>,
) -> (Vec<i64>, [u32; photon_counter::COUNT as usize]) {
    let harmonics = SphericalHarmonics::new(params.bands);
    let mut all = All {
        params,
        inputs,
        moments: vec![0.0; params.coefficients() as usize],
        deposits: vec![0; params.deposits() as usize],
        counters: [0; photon_counter::COUNT as usize],
    };
    // `validate` has seen that there are so many bands.
    if let Ok(harmonics) = harmonics {
        units.for_each(|unit| all.photon(unit, &harmonics));
    }
    (all.deposits, all.counters)
}

struct All<'a> {
    params: &'a PhotonParams,
    inputs: &'a PhotonInputs<'a>,
    /// Y_j of the flight that leaves light.
    moments: Vec<f64>,
    deposits: Vec<i64>,
    counters: [u32; photon_counter::COUNT as usize],
}

/// A flight through the cells: where it begins and how far it goes on in a metre, in cells; its metres.
struct Flight {
    origin: DVec3,
    direction: DVec3,
    length: f64,
}

impl All<'_> {
    fn count(&mut self, counter: u32) {
        self.counters[counter as usize] += 1;
    }

    fn photon(&mut self, unit: u32, harmonics: &SphericalHarmonics) {
        let (p, inputs) = (self.params, self.inputs);
        let source = &inputs.directions[(unit % p.listed) as usize];
        let number = (p.round + unit / p.listed) * p.directions + source.number;
        let mut draws = Draws::new(number, 0, p.seed);
        let rows = [p.index_x, p.index_y, p.index_z];
        let (dims, majorant) = (p.dims, inputs.majorant);
        let ground = Ground { dims, cells: p.majorant_cells, majorant, densest: p.densest, least: p.least };
        let bends = Bends::new(p.phase_kind, p.phase, inputs.tables, p.phase_at, p.phase_size, p.bends_at);
        // What belongs to the first flight counts with the first that leaves light.
        if p.begin == 1 {
            self.count(photon_counter::PHOTONS);
        }
        let mut way = -xyz(source.toward);
        let mut walk = ground.walk(self.entry(source, apply(rows, way), &mut draws), apply(rows, way), f64::INFINITY);
        let (mut weight, mut turns) = (1.0, 0);
        for depth in 0..p.end {
            let leaves = depth >= p.begin;
            let found = self.fly(&ground, &mut walk, &mut draws);
            turns += walk.steps + u32::from(found.is_none());
            if turns > p.turns {
                if leaves || p.begin == 1 {
                    self.count(photon_counter::TRUNCATED);
                }
                return;
            }
            let at = walk.place();
            let mut over = found.is_none();
            // What the flight counts: per metre, or all.
            let mut light = if p.deposit == photon_deposit::TRACK { weight } else { 0.0 };
            if let Some((extinction, albedo)) = found {
                if p.deposit == photon_deposit::COLLISION {
                    light = weight / extinction;
                }
                if p.deposit == photon_deposit::ABSORPTION {
                    if draws.draw() >= albedo {
                        light = weight / (extinction * (1.0 - albedo));
                        over = true;
                    }
                } else {
                    weight *= albedo;
                }
            }
            if leaves && light > 0.0 {
                harmonics.eval(-way, &mut self.moments);
                self.leave(source, &walk, light, Draws::new(number, depth, p.seed));
            }
            let weak = f64::from(Photons::WEAK);
            if !over && weight < weak {
                over = draws.draw() * weak >= weight;
                weight = weak;
            }
            if over {
                return;
            }
            if depth + 1 == p.end {
                break;
            }
            let c = bends.draw(&mut draws);
            if p.phase_kind == PhaseParams::TABLE {
                weight *= bends.phase(c) / bends.density(c);
            }
            way = around(way, c, draws.draw());
            walk = ground.walk(at, apply(rows, way), f64::INFINITY);
        }
        if p.end > p.max_depth {
            self.count(photon_counter::TRUNCATED);
        }
    }

    /// A place of index space on one of the walls that let in what flies `along`.
    fn entry(&self, source: &PhotonDirection, along: DVec3, draws: &mut Draws) -> DVec3 {
        let wall = draws.draw();
        let axis = if wall < source.first.into() {
            0
        } else if wall < source.second.into() {
            1
        } else {
            2
        };
        let mut at = DVec3::ZERO;
        for a in (0..3).filter(|&a| a != axis) {
            at[a] = draws.draw();
        }
        at[axis] = if along[axis] > 0.0 { 0.0 } else { 1.0 };
        let [x, y, z, _] = self.params.dims.map(f64::from);
        at * DVec3::new(x, y, z) - 0.5
    }

    /// On to a collision: extinction and albedo there. None where the photon leaves the box.
    fn fly(&self, ground: &Ground<'_>, walk: &mut Walk, draws: &mut Draws) -> Option<(f64, f64)> {
        let (p, inputs) = (self.params, self.inputs);
        loop {
            let rate = ground.next(walk, draws)?;
            let at = walk.place();
            let density = Samples::new(inputs.density, p.dims).trilinear(at);
            let extinction = (density * f64::from(p.densest)).min(rate);
            if draws.draw() * rate < extinction {
                let scatters = Tints::new(inputs.scattering, inputs.density, p.dims).trilinear(at);
                return Some((extinction, scatters[p.channel as usize] / density * f64::from(p.albedo)));
            }
        }
    }

    /// Leaves the light of the flight that `walk` has flown.
    fn leave(&mut self, source: &PhotonDirection, walk: &Walk, light: f64, rounding: Draws) {
        let p = self.params;
        self.count(photon_counter::DEPOSITS);
        let light = light * f64::from(source.toward[3]) / f64::from(p.volume) * f64::from(p.scale);
        let ratio = DVec3::from([0, 1, 2].map(|a| f64::from(p.cells[a]) / f64::from(p.dims[a])));
        let flight = Flight { origin: (walk.origin + 0.5) * ratio, direction: walk.direction * ratio, length: walk.t };
        let parts = if p.deposit == photon_deposit::TRACK {
            self.lengths(&flight)
        } else {
            self.shares((walk.place() + 0.5) * ratio)
        };
        if parts.is_empty() {
            self.count(photon_counter::LOST);
        }
        for (cell, part) in parts {
            let mut rounding = rounding;
            rounding.next = cell as u32;
            let up = rounding.draw();
            let row = u64::from(self.inputs.rows[cell] - 1);
            for i in source.weights..source.weights + source.count {
                let [number, value] = self.inputs.weights[i as usize];
                let at = (row * u64::from(p.lights) + number as u64) * u64::from(p.coefficients());
                for (j, moment) in self.moments.iter().enumerate() {
                    let value = (light * part * f64::from(value) * moment + up).floor() as i64;
                    let sum = &mut self.deposits[at as usize + j];
                    *sum = sum.saturating_add(value);
                }
            }
        }
    }

    /// Every cell with a row, by its number and place.
    fn cells(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let ([x, y, z, _], rows) = (self.params.cells.map(|n| n as usize), self.inputs.rows);
        let place = move |n: usize| DVec3::new((n % x) as f64, (n / x % y) as f64, (n / (x * y)) as f64);
        (0..x * y * z).filter(|&n| rows[n] > 0).map(move |n| (n, place(n)))
    }

    /// The metres of a flight in each cell that it crosses.
    fn lengths(&self, flight: &Flight) -> Vec<(usize, f64)> {
        let within = |(number, low): (usize, DVec3)| {
            let (mut near, mut far) = (0.0f64, flight.length);
            for a in 0..3 {
                let [one, other] = [low[a], low[a] + 1.0].map(|wall| (wall - flight.origin[a]) / flight.direction[a]);
                if flight.direction[a] != 0.0 {
                    (near, far) = (near.max(one.min(other)), far.min(one.max(other)));
                } else if !(low[a]..low[a] + 1.0).contains(&flight.origin[a]) {
                    far = 0.0;
                }
            }
            (far > near).then_some((number, far - near))
        };
        self.cells().filter_map(within).collect()
    }

    /// The parts of the cells around a place, 1 in all.
    fn shares(&self, place: DVec3) -> Vec<(usize, f64)> {
        let square = f64::from(self.params.radius).powi(2);
        let kernel = |(number, low): (usize, DVec3)| {
            let base = square - (low + 0.5).distance_squared(place);
            (base > 0.0).then_some((number, base.powi(3)))
        };
        let parts: Vec<(usize, f64)> = self.cells().filter_map(kernel).collect();
        let sum: f64 = parts.iter().map(|(_, part)| part).sum();
        parts.into_iter().map(|(number, part)| (number, part / sum)).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;
    use crate::basis::healpix;
    use crate::media::{Lattice, Phase};
    use crate::random::{hash, unit};
    use crate::stage::{PhotonTable, photon_tables};

    const EXTINCTION: f32 = 1.5;

    /// Moments of what is left in an even box of 2 × 2 × 1 cells under light that is 1 from everywhere, over their scale, and counts.
    fn left(albedo: f32, deposit: u32, rounds: u32, change: fn(&mut PhotonParams)) -> (Vec<f64>, [u32; 5]) {
        let lattice = Lattice::in_box(UVec3::new(2, 1, 3), DVec3::ZERO, DVec3::new(1.0, 0.8, 1.2)).unwrap();
        let mut p = PhotonParams::new(&lattice, UVec3::new(2, 2, 1), 500);
        let table = PhotonTable::new(&lattice, &healpix::directions(2), 1, |_, _, out| out.push((0, 1.0)));
        table.place(&mut p);
        let tables = photon_tables(1, &Phase::HenyeyGreenstein { g: 0.4 }, &mut p);
        (p.majorant_cells, p.lights, p.rows, p.rounds, p.deposit) = ([1, 1, 1, 3], 1, 4, rounds, deposit);
        (p.densest, p.albedo, p.scale) = (EXTINCTION, albedo, 1e4);
        change(&mut p);
        let inputs = PhotonInputs {
            density: &[1.0; 6],
            scattering: None,
            // Half of the collisions are none.
            majorant: &[[1.0, 2.0]],
            tables: &tables,
            directions: &table.directions,
            weights: &table.weights,
            rows: &[1, 2, 3, 4],
        };
        let (deposits, counters) = photons(&p, &inputs, 0..p.listed * p.rounds);
        let unit = f64::from(p.scale) * f64::from(p.directions * p.rounds);
        (deposits.into_iter().map(|v| v as f64 / unit).collect(), counters)
    }

    /// The mean of what reaches a place of the box unscattered, of light that is 1 from everywhere.
    fn unscattered() -> f64 {
        let n = 20_000;
        let through = |i: u32| {
            let [x, y, z, c, turn] = [0, 1, 2, 3, 4].map(|k| f64::from(unit(hash([i, k, 77]))));
            let way = around(DVec3::Z, 2.0 * c - 1.0, turn);
            let place = DVec3::new(x, 0.8 * y, 1.2 * z);
            let leave = |a: usize| {
                let end = if way[a] > 0.0 { [1.0, 0.8, 1.2][a] } else { 0.0 };
                (end - place[a]) / way[a]
            };
            (-f64::from(EXTINCTION) * leave(0).min(leave(1)).min(leave(2))).exp()
        };
        (0..n).map(through).sum::<f64>() / f64::from(n)
    }

    #[test]
    fn a_furnace_is_white() {
        for deposit in [photon_deposit::TRACK, photon_deposit::COLLISION] {
            let (moments, counters) = left(1.0, deposit, 300, |_| ());
            let y = 1.0 / (4.0 * std::f64::consts::PI).sqrt();
            let mean = moments.iter().sum::<f64>() / 4.0 * y;
            // Fourteen thousand photons of a few flights, twenty thousand places.
            assert!((mean + unscattered() - 1.0).abs() < 0.01, "{mean} {}", unscattered());
            assert_eq!(counters[photon_counter::PHOTONS as usize], 300 * 48);
            assert_eq!(counters[photon_counter::TRUNCATED as usize], 0);
        }
    }

    #[test]
    fn kinds_agree_and_black_media_scatter_nothing() {
        let sum = |deposit| left(0.6, deposit, 2000, |_| ()).0.iter().sum::<f64>();
        let tracks = sum(photon_deposit::TRACK);
        for deposit in [photon_deposit::COLLISION, photon_deposit::ABSORPTION] {
            // Seven thousand absorptions.
            assert!((sum(deposit) / tracks - 1.0).abs() < 0.03, "{} {tracks}", sum(deposit));
            let (moments, counters) = left(0.0, deposit, 10, |_| ());
            assert!(moments.iter().all(|v| *v == 0.0) && counters[photon_counter::DEPOSITS as usize] == 0);
        }
    }

    #[test]
    fn windows_of_flights_and_ranges_of_photons_add_up() {
        for deposit in [photon_deposit::TRACK, photon_deposit::ABSORPTION] {
            let of = |change| left(0.9, deposit, 4, change);
            let (whole, counters) = of(|_| ());
            let (first, some) = of(|p| p.end = 3);
            let (rest, more) = of(|p| p.begin = 3);
            for i in 0..4 {
                assert!((first[i] + rest[i] - whole[i]).abs() < 1e-9 && whole[i] > 0.0);
            }
            for i in 0..5 {
                assert_eq!(some[i] + more[i], counters[i], "{i}");
            }
        }
    }

    #[test]
    fn photons_that_are_given_up_are_counted() {
        let (_, counters) = left(1.0, photon_deposit::TRACK, 10, |p| (p.max_depth, p.end) = (1, 2));
        let (_, short) = left(1.0, photon_deposit::TRACK, 10, |p| p.turns = 2);
        for counters in [counters, short] {
            let truncated = counters[photon_counter::TRUNCATED as usize];
            assert!(truncated > 50 && truncated < 480, "{truncated}");
        }
    }
}
