//! Makes the fire of `scenes/ember.toml`: `cargo run --release -p airlight-formats --example ember -- OUT.vdb`.
//!
//! Flames lick up from a round bed and end in smoke: soot within a column that sways and widens as it rises, torn by
//! noise that is stretched upward low down and rounder above, and a temperature that is highest in the flames' cores and
//! falls off outward and upward. Two grids on one lattice: `density` and `temperature`, in kelvin. Everything follows
//! from the constants below.

use std::path::PathBuf;

use airlight_core::glam::{DAffine3, DQuat, DVec3, IVec3, UVec3};
use airlight_core::media::{FractalNoise, Grid, IndexBox, Storage};
use airlight_formats::volume::{VdbWriteOptions, write_vdb};

/// Voxels along x, y and z, and their edge in metres.
const DIMS: UVec3 = UVec3::new(56, 96, 56);
const VOXEL: f64 = 0.025;
/// Height at which the flames end and smoke is left, metres.
const FLAMES: f64 = 1.45;

/// Smooth from 0 at `a` to 1 at `b`.
fn rise(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The noise at a place in metres.
fn value(noise: &FractalNoise, p: DVec3) -> f64 {
    noise.value(p / noise.scale())
}

struct Fire {
    sway: [FractalNoise; 2],
    tears: FractalNoise,
    billows: FractalNoise,
}

impl Fire {
    /// Density and temperature at a place over the middle of the bed, metres.
    fn at(&self, p: DVec3) -> (f64, f64) {
        let y = p.y;
        let height = y / (f64::from(DIMS.y) * VOXEL);
        // The flow carries what is below upward: noise is sampled along it, stretched where it is fast.
        let stretched = DVec3::new(p.x, 0.42 * y, p.z);
        let aside = DVec3::new(value(&self.sway[0], stretched), 0.0, value(&self.sway[1], stretched));
        let axis = DVec3::new(0.10 * (2.2 * y + 0.4).sin() * height, 0.0, 0.08 * (2.9 * y + 1.9).sin() * height);
        let q = p - axis + aside * (0.10 + 0.32 * height);
        let radius = q.x.hypot(q.z);
        let width = 0.19 + 0.09 * rise(0.0, 0.2, y) - 0.12 * rise(0.2, 0.9, y) + 0.30 * rise(0.7, 2.3, y);
        let torn = value(&self.tears, stretched);
        let billow = value(&self.billows, p);
        // 1 on the axis, 0 at the rim.
        let inside = 1.0 - radius / width;
        let flame =
            rise(0.0, 0.8, inside + 0.75 * torn - 0.7 * rise(0.3, FLAMES, y)) * (1.0 - rise(0.6 * FLAMES, FLAMES, y));
        let smoke = rise(-0.1, 0.5, inside + 0.75 * billow) * rise(0.4, 1.4, y) * (1.0 - rise(1.6, 2.35, y));
        let density = 0.35 * flame + 0.9 * smoke * (1.0 - 0.8 * flame);
        let core = flame * (1.0 - 0.25 * rise(0.0, FLAMES, y));
        let heat = if flame > 0.0 { 900.0 + 1350.0 * core } else { 0.0 };
        // What the flames leave glows a little further, and cools.
        let ember = 1050.0 * rise(0.1, 0.6, inside) * (1.0 - rise(0.5 * FLAMES, 1.25 * FLAMES, y));
        (density, heat.max(ember).max(300.0))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path: PathBuf = std::env::args_os().nth(1).ok_or("usage: ember OUT.vdb")?.into();
    let noise = |scale, octaves, seed| FractalNoise::new(scale, octaves, seed, 1.0);
    let fire = Fire {
        sway: [noise(0.5, 3, 11)?, noise(0.5, 3, 12)?],
        tears: noise(0.20, 4, 13)?,
        billows: noise(0.42, 4, 14)?,
    };
    let middle = DVec3::new(0.5 * f64::from(DIMS.x), 0.0, 0.5 * f64::from(DIMS.z));
    let count = DIMS.element_product();
    let (mut density, mut temperature) = (Vec::new(), Vec::new());
    for n in 0..count {
        let index = UVec3::new(n % DIMS.x, n / DIMS.x % DIMS.y, n / DIMS.x / DIMS.y);
        let (rho, heat) = fire.at((index.as_dvec3() + 0.5 - middle) * VOXEL);
        // A few steps of each are as good to the eye, and make a smaller file.
        let rho = (rho * 128.0).round() / 128.0;
        density.push(rho as f32);
        temperature.push(if rho > 0.0 { ((heat / 10.0).round() * 10.0) as f32 } else { 0.0 });
    }
    let place = (0.5 - middle) * VOXEL;
    let map = DAffine3::from_scale_rotation_translation(DVec3::splat(VOXEL), DQuat::IDENTITY, place);
    let grid = |values| Grid::new(IndexBox { min: IVec3::ZERO, dims: DIMS }, map, Storage::Dense(values));
    let grids = [("density", &grid(density)?), ("temperature", &grid(temperature)?)];
    write_vdb(&path, &grids, VdbWriteOptions { half: true, zip: true })?;
    Ok(())
}
