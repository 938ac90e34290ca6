//! Renders a large volume and tells what it takes: a cube of voxels of which a share is filled by balls, held sparse, or all
//! of it dense. `large DEVICE SIDE PERCENT [f16]`: `large cpu 1024 5`, `large opencl 512 100 f16`.

use std::sync::Arc;
use std::time::Instant;

use airlight::Renderer;
use airlight::device::Bytes;
use airlight::glam::{DAffine3, DVec3, IVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::{BRICK, Brick, Grid, GridMedium, IndexBox, Medium, Optics, Storage};
use airlight::scene::{Camera, Direct, Estimate, LightsEstimate, Precision, Quality, Scene, Shadow};

/// Balls in a cube of one metre that together fill a share of it.
struct Balls(Vec<(DVec3, f64)>);

impl Balls {
    /// Balls that do not touch: one in the middle of each cell of a grid, with radii that differ.
    fn new(share: f64) -> Self {
        const ACROSS: i32 = 7;
        let radius = (share / (f64::from(ACROSS.pow(3)) * 4.18879)).cbrt();
        let cell = |n: i32| {
            let at = IVec3::new(n % ACROSS, n / ACROSS % ACROSS, n / ACROSS / ACROSS).as_dvec3();
            ((at + 0.5) / f64::from(ACROSS), radius * (1.0 + 0.2 * f64::from(n * 37 % 11 - 5) / 5.0))
        };
        Self((0..ACROSS.pow(3)).map(cell).collect())
    }

    /// Density of a ball at a place: falls to zero at its rim.
    fn density(&self, n: usize, p: DVec3) -> f32 {
        let (center, radius) = self.0[n];
        (1.0 - p.distance(center) / radius).max(0.0) as f32
    }

    /// The stored bricks of a sparse grid of `side` voxels.
    fn bricks(&self, side: i32) -> Vec<Brick> {
        let (voxel, brick) = (1.0 / f64::from(side), f64::from(BRICK));
        let mut bricks = Vec::new();
        for (n, &(center, radius)) in self.0.iter().enumerate() {
            let low = ((center - radius) / voxel / brick).floor().as_ivec3().max(IVec3::ZERO);
            let high = ((center + radius) / voxel / brick).floor().as_ivec3().min(IVec3::splat(side / BRICK - 1));
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        let origin = IVec3::new(x, y, z) * BRICK;
                        let mut values = Box::new([0.0f32; 512]);
                        for (i, value) in (0..).zip(values.iter_mut()) {
                            let at = origin + IVec3::new(i & 7, i >> 3 & 7, i >> 6);
                            *value = self.density(n, (at.as_dvec3() + 0.5) * voxel);
                        }
                        if values.iter().any(|v| *v > 0.0) {
                            bricks.push(Brick { origin, values });
                        }
                    }
                }
            }
        }
        bricks
    }
}

/// The most memory that this process has taken, in bytes.
fn peak() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().split(' ').next()?.parse::<u64>().ok()).unwrap_or(0) * 1024
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [device, side, percent, rest @ ..] = args.as_slice() else {
        return Err("give a device, voxels along a side and percent that are filled; and f16".into());
    };
    let (side, percent): (u32, f64) = (side.parse()?, percent.parse()?);
    let density = if rest.iter().any(|arg| arg == "f16") { Precision::F16 } else { Precision::F32 };
    let bounds = IndexBox { min: IVec3::ZERO, dims: UVec3::splat(side) };
    let place = DAffine3::from_scale(DVec3::splat(1.0 / f64::from(side)));
    let storage = if percent < 100.0 {
        let bricks = Balls::new(percent / 100.0).bricks(side as i32);
        Storage::Sparse { background: 0.0, bricks, tiles: Vec::new() }
    } else {
        let wave = |n: u64| 0.5 + 0.5 * ((n % 97) as f32 / 97.0);
        Storage::Dense((0..bounds.volume()).map(wave).collect())
    };
    let grid = Grid::new(bounds, place, storage)?;
    println!("the grid takes {}", Bytes(grid.bytes()));
    let made = Instant::now();
    let medium = GridMedium::new(Arc::new(grid), None)?;
    if let Some(bricks) = medium.density_bricks() {
        println!("{:?}, in {:.2} s", bricks.layout(), made.elapsed().as_secs_f64());
    }
    let shadows = Direct { shadow: Shadow::March, ..Direct::default() };
    let scene = Scene {
        camera: Camera {
            origin: DVec3::new(1.9, 1.3, 2.2),
            target: DVec3::splat(0.5),
            up: DVec3::Y,
            fov: 28.0,
            width: 128,
            height: 128,
            samples: 1,
        },
        medium: Arc::new(medium),
        optics: Optics::grey(20.0, 0.9),
        environment: None,
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![Light::directional(DVec3::new(0.3, 1.0, 0.2), Vec3::ONE)?],
        estimate: Estimate { lights: Some(LightsEstimate::Direct(shadows)), ..Estimate::none() },
        quality: Quality { density, ..Quality::default() },
    };
    let mut renderer = Renderer::new(airlight::open(device)?);
    let begin = Instant::now();
    let rendered = renderer.render(&scene)?;
    let report = rendered.report;
    println!(
        "{:.2} s in all, of which {:.2} s uploads",
        begin.elapsed().as_secs_f64(),
        report.upload_time.as_secs_f64()
    );
    for stage in &report.stages {
        println!("{}: {:.3} s", stage.stage, stage.time.as_secs_f64());
    }
    let alpha: f32 = rendered.film.beauty.iter().map(|p| p[3]).sum();
    println!("mean alpha {:.4}", alpha / rendered.film.beauty.len() as f32);
    println!("resources take {}, this process has taken up to {}", Bytes(report.bytes), Bytes(peak()));
    Ok(())
}
