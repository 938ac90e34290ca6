//! Free flights against a majorant, and directions in which scattering bends.

use std::f64::consts::PI;

use glam::DVec3;

use super::lookup::{clip, phase};
use crate::random::{hash, unit};
use crate::stage::{Path, PhaseParams};

/// The draws of a sample of a pixel in a picture, or of whatever has three numbers.
#[derive(Clone, Copy)]
pub(super) struct Draws {
    first: u32,
    second: u32,
    pub(super) next: u32,
}

impl Draws {
    pub(super) fn new(pixel: u32, sample: u32, frame: u32) -> Self {
        let key = |half: u32| hash([sample, pixel, frame.wrapping_mul(2).wrapping_add(half)]);
        Self { first: key(0), second: key(1), next: 0 }
    }

    pub(super) fn draw(&mut self) -> f64 {
        let number = self.next;
        self.next = number.wrapping_add(1);
        unit(hash([self.second, self.first.wrapping_add(number)])).into()
    }
}

/// What is flown through.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub(super) dims: [u32; 4],
    /// Cells of the majorant along x, y, z; voxels of a cell's side.
    pub(super) cells: [u32; 4],
    /// Mean and maximum of each.
    pub(super) majorant: &'a [[f32; 2]],
    pub(super) densest: f32,
    pub(super) least: f32,
}

/// A walk along a ray of index space.
pub(super) struct Walk {
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    pub(super) t: f64,
    pub(super) far: f64,
    cell: [i64; 3],
    /// Ways within a cell so far.
    pub(super) steps: u32,
}

impl Walk {
    /// Where it stands.
    pub(super) fn place(&self) -> DVec3 {
        self.origin + self.t * self.direction
    }
}

impl Ground<'_> {
    pub(super) fn walk(&self, origin: DVec3, direction: DVec3, limit: f64) -> Walk {
        let (near, far) = clip(origin, direction, self.dims, limit);
        let at = (origin + near * direction + 0.5) / f64::from(self.cells[3]);
        let cell = [0, 1, 2].map(|a| (at[a].floor() as i64).clamp(0, i64::from(self.cells[a]) - 1));
        Walk { origin, direction, t: near, far, cell, steps: 0 }
    }

    /// On to the next tentative collision of a walk: the rate there.
    pub(super) fn next(&self, walk: &mut Walk, draws: &mut Draws) -> Option<f64> {
        let [x, y, z, side] = self.cells.map(i64::from);
        while walk.t < walk.far && (0..3).all(|a| (0..[x, y, z][a]).contains(&walk.cell[a])) {
            walk.steps += 1;
            let leave = |a: usize| {
                let wall = ((walk.cell[a] + i64::from(walk.direction[a] > 0.0)) * side) as f64 - 0.5;
                let leave = (wall - walk.origin[a]) / walk.direction[a];
                if walk.direction[a] == 0.0 { f64::INFINITY } else { leave }
            };
            let axis = [0, 1, 2].into_iter().min_by(|&a, &b| leave(a).total_cmp(&leave(b))).unwrap_or(0);
            let exit = leave(axis).min(walk.far);
            let most = self.majorant[((walk.cell[2] * y + walk.cell[1]) * x + walk.cell[0]) as usize][1];
            let rate = if most > 0.0 { f64::from(most * self.densest).max(self.least.into()) } else { 0.0 };
            if rate > 0.0 {
                let t = walk.t - (1.0 - draws.draw()).ln() / rate;
                if t < exit {
                    walk.t = t;
                    return Some(rate);
                }
            }
            walk.t = walk.t.max(exit);
            walk.cell[axis] += if walk.direction[axis] > 0.0 { 1 } else { -1 };
        }
        None
    }
}

/// One of `count` items of the choice that `items` begins with, in proportion to their weights.
pub(super) fn choose(items: &[f32], count: u32, draws: &mut Draws) -> u32 {
    let place = ((draws.draw() * f64::from(count)) as u32).min(count - 1);
    let item = (Path::CHOICE * place) as usize;
    if draws.draw() < items[item].into() { place } else { items[item + 1] as u32 }
}

/// A phase function, with the choice among the pieces of its table.
#[derive(Clone, Copy)]
pub(super) struct Bends<'a> {
    pub(super) kind: u32,
    pub(super) lobes: [f32; 4],
    pub(super) table: &'a [f32],
    pub(super) pieces: &'a [f32],
}

impl<'a> Bends<'a> {
    /// Of tables that hold its own from `at` on, and the choice from `pieces` on.
    pub(super) fn new(kind: u32, lobes: [f32; 4], tables: &'a [f32], at: u32, size: u32, pieces: u32) -> Self {
        let of = |at: u32| tables.get(at as usize..).unwrap_or_default();
        Self { kind, lobes, table: &of(at)[..size as usize], pieces: of(pieces) }
    }

    /// p(c).
    pub(super) fn phase(&self, c: f64) -> f64 {
        phase(self.kind, self.lobes, self.table, c)
    }

    fn last(&self) -> u32 {
        self.table.len() as u32 - 1
    }

    /// A cosine of scattering.
    pub(super) fn draw(&self, draws: &mut Draws) -> f64 {
        let c = match self.kind {
            PhaseParams::HENYEY_GREENSTEIN => {
                let [forward, backward, weight, _] = self.lobes.map(f64::from);
                let g = if weight == 1.0 || draws.draw() < weight { forward } else { backward };
                let x = 2.0 * draws.draw() - 1.0;
                // The textbook's inverse, which divides by g.
                let base = (1.0 - g * g) / (1.0 + g * x);
                if g.abs() < 1e-9 { x } else { (1.0 + g * g - base * base) / (2.0 * g) }
            }
            PhaseParams::RAYLEIGH => {
                let q = 4.0 * draws.draw() - 2.0;
                let root = (q + (q * q + 1.0).sqrt()).cbrt();
                root - 1.0 / root
            }
            PhaseParams::TABLE => {
                let last = self.last();
                let piece = choose(self.pieces, last, draws);
                let edge = |i: u32| (PI * f64::from(i) / f64::from(last)).cos();
                edge(piece) + (edge(piece + 1) - edge(piece)) * draws.draw()
            }
            _ => 2.0 * draws.draw() - 1.0,
        };
        c.clamp(-1.0, 1.0)
    }

    /// The probability of that, per steradian.
    pub(super) fn density(&self, c: f64) -> f64 {
        if self.kind != PhaseParams::TABLE {
            return self.phase(c);
        }
        let last = self.last();
        let piece = (c.clamp(-1.0, 1.0).acos() / PI * f64::from(last)) as u32;
        self.pieces[(Path::CHOICE * piece.min(last - 1) + 2) as usize].into()
    }
}

/// The direction at cosine `c` to a unit `d`, so many turns around it.
pub(super) fn around(d: DVec3, c: f64, turn: f64) -> DVec3 {
    let s = if d.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + d.z);
    let b = d.x * d.y * a;
    let (u, v) = (DVec3::new(1.0 + s * d.x * d.x * a, s * b, -s * d.x), DVec3::new(b, s + d.y * d.y * a, -d.y));
    let (sin, cos) = (2.0 * PI * turn).sin_cos();
    let planar = (1.0 - c * c).max(0.0).sqrt();
    (planar * (cos * u + sin * v) + c * d).normalize()
}
