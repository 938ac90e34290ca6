//! Makes the cumulus of `scenes/cumulus.toml`: `cargo run --release -p airlight-formats --example cumulus -- OUT.vdb`.
//!
//! A cumulus is a heap of thermals: large bubbles over a flat base, each covered by smaller ones, and those by smaller
//! ones again. The signed distance to their union is eroded by fractal noise, most where the surface is youngest (high
//! up), and density rises from zero at the surface to one over a few voxels. Everything follows from the constants
//! below; the same file comes out on every machine that rounds as IEEE 754 says.

use std::path::PathBuf;

use airlight_core::glam::{DAffine3, DQuat, DVec3, IVec3, UVec3, Vec3};
use airlight_core::media::{Grid, IndexBox, Storage};
use airlight_formats::volume::{VdbWriteOptions, write_vdb};

/// Voxels along x, y and z, and their edge in metres: the cloud is about 1.2 km wide.
const DIMS: [u32; 3] = [224, 144, 184];
const VOXEL: f32 = 6.25;
/// Height of the flat base above the grid's floor, metres.
const BASE: f32 = 60.0;
/// Depth over which density rises from the surface inward, metres.
const SOFT: f32 = 36.0;

struct Bubble {
    center: Vec3,
    radius: f32,
}

/// A small counter-based generator (SplitMix64), so that no dependency can change the cloud.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    fn between(&mut self, a: f32, b: f32) -> f32 {
        a + (b - a) * self.next()
    }

    /// A direction, upward more often than downward.
    fn upward(&mut self) -> Vec3 {
        let y = self.between(-0.35, 1.0);
        let phi = self.between(0.0, std::f32::consts::TAU);
        let r = (1.0 - y * y).max(0.0).sqrt();
        Vec3::new(r * phi.cos(), y, r * phi.sin())
    }
}

fn bubbles() -> Vec<Bubble> {
    let mut random = Random(20130506);
    let extent = Vec3::from_array(DIMS.map(|d| d as f32)) * VOXEL;
    let middle = Vec3::new(0.5 * extent.x, BASE, 0.5 * extent.z);
    // Main thermals: the tallest off the middle, so that the cloud leans.
    let main = [
        (-0.02, 0.27, 0.04, 0.235),
        (-0.23, 0.15, -0.06, 0.19),
        (0.19, 0.18, 0.10, 0.20),
        (0.10, 0.40, -0.03, 0.165),
        (0.32, 0.08, -0.07, 0.13),
        (-0.37, 0.07, 0.09, 0.11),
        (-0.10, 0.12, 0.24, 0.15),
        (0.06, 0.10, -0.24, 0.15),
        (-0.12, 0.36, 0.02, 0.13),
    ];
    let side = extent.x.min(extent.z);
    let mut all: Vec<Bubble> = main
        .iter()
        .map(|&(x, y, z, r)| Bubble { center: middle + Vec3::new(x, y, z) * side, radius: r * side })
        .collect();
    // Each generation sits on the surface of the one before.
    let mut from = 0;
    for (count, smallest, largest) in [(18, 0.26, 0.50), (11, 0.26, 0.46), (5, 0.3, 0.5)] {
        let to = all.len();
        for parent in from..to {
            for _ in 0..count {
                let radius = all[parent].radius * random.between(smallest, largest);
                let center = all[parent].center + random.upward() * (all[parent].radius - 0.25 * radius);
                all.push(Bubble { center, radius });
            }
        }
        from = to;
    }
    all
}

/// Value noise on the integers, smooth and in [-1, 1].
fn noise(p: Vec3, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let s = f * f * (3.0 - 2.0 * f);
    let corner = |dx: i32, dy: i32, dz: i32| {
        let at = cell.as_ivec3() + IVec3::new(dx, dy, dz);
        let mut h = seed ^ (at.x as u32).wrapping_mul(0x8da6_b343) ^ (at.y as u32).wrapping_mul(0xd816_3841);
        h ^= (at.z as u32).wrapping_mul(0xcb1a_b31f);
        h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
        h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
        ((h ^ (h >> 16)) >> 8) as f32 / (1u32 << 23) as f32 - 1.0
    };
    let x = |dy, dz| corner(0, dy, dz) + (corner(1, dy, dz) - corner(0, dy, dz)) * s.x;
    let y = |dz| x(0, dz) + (x(1, dz) - x(0, dz)) * s.y;
    y(0) + (y(1) - y(0)) * s.z
}

/// A sum of octaves of noise, each of half the size and a little over half the strength, in about [-1, 1].
fn fractal(p: Vec3, size: f32, octaves: u32) -> f32 {
    let (mut sum, mut strength, mut total, mut scale) = (0.0, 1.0, 0.0, 1.0 / size);
    for octave in 0..octaves {
        sum += strength * noise(p * scale, 77 + octave);
        total += strength;
        strength *= 0.55;
        scale *= 2.03;
    }
    sum / total
}

/// Signed distance to the union of all bubbles, at every voxel centre; far from them a large number.
fn distances(bubbles: &[Bubble]) -> Vec<f32> {
    let [nx, ny, nz] = DIMS.map(|d| d as usize);
    let mut distance = vec![f32::INFINITY; nx * ny * nz];
    for b in bubbles {
        let reach = b.radius + SOFT;
        let range = |c: f32, n: usize| {
            let from = ((c - reach) / VOXEL - 0.5).floor().clamp(0.0, n as f32) as usize;
            let to = ((c + reach) / VOXEL + 0.5).ceil().clamp(0.0, n as f32) as usize;
            from..to
        };
        for k in range(b.center.z, nz) {
            for j in range(b.center.y, ny) {
                for i in range(b.center.x, nx) {
                    let p = (Vec3::new(i as f32, j as f32, k as f32) + 0.5) * VOXEL;
                    let place = &mut distance[(k * ny + j) * nx + i];
                    *place = place.min(p.distance(b.center) - b.radius);
                }
            }
        }
    }
    distance
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path: PathBuf = std::env::args_os().nth(1).ok_or("usage: cumulus OUT.vdb")?.into();
    let [nx, ny, _] = DIMS.map(|d| d as usize);
    let mut density = distances(&bubbles());
    for (n, value) in density.iter_mut().enumerate() {
        let p = (Vec3::new((n % nx) as f32, (n / nx % ny) as f32, (n / nx / ny) as f32) + 0.5) * VOXEL;
        let height = ((p.y - BASE) / 500.0).clamp(0.0, 1.0);
        // Erosion: rounder low down, more torn on top; the base is flat but for slow undulations.
        let torn = (46.0 + 30.0 * height) * fractal(p, 120.0, 6) + 14.0;
        let base = BASE + 14.0 * fractal(p * Vec3::new(1.0, 0.0, 1.0), 210.0, 3) - p.y;
        let depth = -(*value + torn).max(base);
        let rise = (depth / SOFT).clamp(0.0, 1.0);
        let body = 0.75 + 0.35 * fractal(p, 90.0, 4);
        let smooth = rise * rise * (3.0 - 2.0 * rise);
        // Two decimal digits of a half: less would band, more would only fill the file.
        *value = ((smooth * body).clamp(0.0, 1.0) * 256.0).round() / 256.0;
    }
    let dims = UVec3::from_array(DIMS);
    let map = DAffine3::from_scale_rotation_translation(
        DVec3::splat(VOXEL.into()),
        DQuat::IDENTITY,
        DVec3::new(-0.5 * f64::from(VOXEL) * f64::from(DIMS[0]), 0.0, -0.5 * f64::from(VOXEL) * f64::from(DIMS[2])),
    );
    let grid = Grid::new(IndexBox { min: IVec3::ZERO, dims }, map, Storage::Dense(density))?;
    write_vdb(&path, &[("density", &grid)], VdbWriteOptions { half: true, zip: true })?;
    Ok(())
}
