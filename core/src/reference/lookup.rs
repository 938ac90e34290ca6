//! Lookups, rays through the box and phase functions, as the normative sampling rules state them.

use glam::DVec3;

use crate::media::Phase;
use crate::stage::PhaseParams;

/// The first three of four floats.
pub(super) fn xyz(v: [f32; 4]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// A linear map given by its rows, applied to `v`.
pub(super) fn apply(rows: [[f32; 4]; 3], v: DVec3) -> DVec3 {
    DVec3::from(rows.map(|row| xyz(row).dot(v)))
}

/// Values on a lattice, x fastest.
#[derive(Clone, Copy)]
pub(super) struct Samples<'a, T> {
    pub(super) values: &'a [T],
    pub(super) dims: [usize; 3],
}

impl<'a, T: Copy> Samples<'a, T> {
    pub(super) fn new(values: &'a [T], dims: [u32; 4]) -> Self {
        Self { values, dims: [0, 1, 2].map(|a| dims[a] as usize) }
    }

    /// The value at (i, j, k), each index clamped to the lattice.
    fn clamped(&self, index: [f64; 3]) -> T {
        let [i, j, k] = [0, 1, 2].map(|a| index[a].clamp(0.0, (self.dims[a] - 1) as f64) as usize);
        self.values[(k * self.dims[1] + j) * self.dims[0] + i]
    }

    /// The nearest value.
    pub(super) fn nearest(&self, p: DVec3) -> T {
        self.clamped(p.to_array().map(|v| (v + 0.5).floor()))
    }

    /// The eight values around `p` with their trilinear weights.
    pub(super) fn around(&self, p: DVec3) -> [(T, f64); 8] {
        let low = p.floor();
        let f = p - low;
        std::array::from_fn(|corner| {
            let high = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 = (0..3).map(|a| if high[a] == 1 { f[a] } else { 1.0 - f[a] }).product();
            (self.clamped([0, 1, 2].map(|a| low[a] + high[a] as f64)), weight)
        })
    }
}

impl Samples<'_, f32> {
    pub(super) fn trilinear(&self, p: DVec3) -> f64 {
        self.around(p).iter().map(|&(v, w)| f64::from(v) * w).sum()
    }
}

impl Samples<'_, [f32; 4]> {
    pub(super) fn trilinear(&self, p: DVec3) -> DVec3 {
        self.around(p).iter().map(|&(v, w)| xyz(v) * w).sum()
    }
}

/// A density of each channel: colours, or one density of all three.
#[derive(Clone, Copy)]
pub(super) enum Tints<'a> {
    Colors(Samples<'a, [f32; 4]>),
    Density(Samples<'a, f32>),
}

impl<'a> Tints<'a> {
    /// Of `colors` where there are any, else of `density`.
    pub(super) fn new(colors: Option<&'a [[f32; 4]]>, density: &'a [f32], dims: [u32; 4]) -> Self {
        match colors {
            Some(colors) => Self::Colors(Samples::new(colors, dims)),
            None => Self::Density(Samples::new(density, dims)),
        }
    }

    pub(super) fn trilinear(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Colors(samples) => samples.trilinear(p),
            Self::Density(samples) => DVec3::splat(samples.trilinear(p)),
        }
    }
}

/// The part of a ray of index space within the box of `dims` voxels and between 0 and `limit`: from, to. Where it
/// misses, `to` is less than `from`.
pub(super) fn clip(origin: DVec3, direction: DVec3, dims: [u32; 4], limit: f64) -> (f64, f64) {
    let (mut near, mut far) = (0.0f64, limit);
    for a in 0..3 {
        let (low, high) = (-0.5, f64::from(dims[a]) - 0.5);
        if direction[a] == 0.0 {
            if origin[a] < low || origin[a] > high {
                far = f64::NEG_INFINITY;
            }
            continue;
        }
        let walls = [(low - origin[a]) / direction[a], (high - origin[a]) / direction[a]];
        near = near.max(walls[0].min(walls[1]));
        far = far.min(walls[0].max(walls[1]));
    }
    (near, far)
}

/// A ray in index space, cut into equal steps. Its parameter is metres of the world.
pub(super) struct Steps {
    origin: DVec3,
    direction: DVec3,
    start: f64,
    /// Length of a step.
    pub(super) length: f64,
    /// Their number.
    pub(super) count: u64,
}

impl Steps {
    /// The part of the ray within the box of `dims` voxels and between 0 and `limit` metres, in ceil(length/longest)
    /// steps.
    pub(super) fn new(origin: DVec3, direction: DVec3, dims: [u32; 4], limit: f64, longest: f64) -> Self {
        let (near, far) = clip(origin, direction, dims, limit);
        let inside = (far - near).max(0.0);
        let count = (inside / longest).ceil();
        let length = if count > 0.0 { inside / count } else { 0.0 };
        Self { origin, direction, start: near, length, count: count as u64 }
    }

    /// The same part of the ray in `count` steps.
    pub(super) fn in_steps(self, count: u64) -> Self {
        let inside = self.length * self.count as f64;
        let count = if self.count > 0 { count } else { 0 };
        Self { length: if count > 0 { inside / count as f64 } else { 0.0 }, count, ..self }
    }

    /// The middle of step `k`: metres along the ray, and the point in index space.
    pub(super) fn middle(&self, k: u64) -> (f64, DVec3) {
        self.within(k, 0.5)
    }

    /// As [`Steps::middle`], at the part `place` of the step.
    pub(super) fn within(&self, k: u64, place: f64) -> (f64, DVec3) {
        let t = self.start + (k as f64 + place) * self.length;
        (t, self.origin + t * self.direction)
    }

    /// The column of `density`, in units of density times metres.
    pub(super) fn column(&self, density: Samples<'_, f32>) -> f64 {
        (0..self.count).map(|k| density.trilinear(self.middle(k).1) * self.length).sum()
    }
}

/// The phase function that parameters and table describe, at cosine `c`.
pub(super) fn phase(kind: u32, lobes: [f32; 4], table: &[f32], c: f64) -> f64 {
    match kind {
        PhaseParams::HENYEY_GREENSTEIN => {
            let [forward, backward, weight, _] = lobes.map(f64::from);
            Phase::DoubleHenyeyGreenstein { forward, backward, weight }.eval(c)
        }
        PhaseParams::RAYLEIGH => Phase::Rayleigh.eval(c),
        PhaseParams::TABLE => {
            let place = c.clamp(-1.0, 1.0).acos() / std::f64::consts::PI * (table.len() - 1) as f64;
            let below = (place.floor() as usize).min(table.len() - 2);
            let f = place - below as f64;
            f64::from(table[below]) * (1.0 - f) + f64::from(table[below + 1]) * f
        }
        _ => Phase::Isotropic.eval(c),
    }
}
