//! Lays a cloud over the frame of another renderer, on that renderer's device, and writes overlay.png:
//! `cargo run --release -p airlight --features wgpu --example overlay -- [WIDTH HEIGHT]`, from the repository's folder.
//!
//! The other renderer (`raster.rs`) draws into a texture with a z-buffer. Both stay on the device: airlight reads them
//! there, ends its rays where the z-buffer does, and leaves the film in a texture. Only the picture on disk is read back.

mod raster;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use airlight::engine::{Depth, FrameTextures, WgpuDevice, export_film, surface};
use airlight::exec::{Hooks, Renderer};
use airlight::glam::{DAffine3, DQuat, DVec3, Vec3};
use airlight::light::{Environment, Light};
use airlight::media::{GridMedium, Optics};
use airlight::scene::{Camera, Estimate, Film, Quality, Scene};
use airlight::{Version, wgpu};
use airlight_formats::image::{ToneMap, write_png};
use airlight_formats::volume;
use raster::{NEAR, Raster};

/// Radiance of the engine's sky.
const SKY: [f64; 3] = [0.20, 0.32, 0.55];

fn scene(width: u32, height: u32) -> Result<Scene, Box<dyn std::error::Error>> {
    // Some 11 m wide, with its flat base just above the floor.
    let place =
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.05), DQuat::IDENTITY, DVec3::new(-5.6, -0.2, -4.6));
    let cloud = volume::read(Path::new("scenes/cumulus.vdb"), None)?.grid.placed_by(place);
    let mut environment = Environment::uniform(Vec3::from_array(SKY.map(|c| c as f32)))?;
    // The engine's colours stand behind the medium.
    environment.visible = false;
    Ok(Scene {
        camera: Camera {
            origin: DVec3::new(1.5, 4.2, 17.0),
            target: DVec3::new(0.2, 2.6, 0.0),
            up: DVec3::Y,
            fov: 36.0,
            width,
            height,
            samples: 1,
        },
        medium: Arc::new(GridMedium::new(Arc::new(cloud), None)?),
        optics: Optics::grey(2.5, 0.99),
        environment: Some(environment),
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![Light::directional(DVec3::new(0.5, 0.8, 0.35), Vec3::new(24.0, 21.6, 18.4))?],
        estimate: Estimate::default(),
        quality: Quality { step: 1.5, ..Quality::default() },
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<u32> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let (width, height) = match arguments[..] {
        [width, height] => (width, height),
        _ => (640, 400),
    };
    let mut scene = scene(width, height)?;
    let engine = Raster::new(width, height)?;
    let out = engine.target(wgpu::TextureFormat::Rgba32Float);
    let device = WgpuDevice::from_wgpu(engine.device.clone(), engine.queue.clone())?;
    let mut renderer = Renderer::new(Box::new(device));

    // The second frame waits for nothing: it only submits. (On a software device, submitting is executing.)
    for frame in 0..2 {
        scene.camera.origin.x -= 0.5 * f64::from(frame);
        engine.draw(&scene.camera, SKY);
        let begin = Instant::now();
        let depth = Depth::Perspective { at_zero: f64::INFINITY, at_one: NEAR };
        let drawn = FrameTextures { color: Some(&engine.color), depth: Some((&engine.depth, depth)) };
        let behind = surface(Version::fresh(), &scene.camera, drawn);
        let left = renderer.render_on_device(&scene, Some(behind), &mut Hooks::default())?;
        export_film(&mut renderer, &left, &out, None)?;
        println!("frame {frame}: {:?} to submit, ran {}", begin.elapsed(), left.report.ran().join(", "));
    }

    let pixels = (width * height) as usize;
    let bytes = engine.read(&out, 16)?;
    let beauty: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
    let film =
        Film { width, height, beauty, transmittance: vec![[1.0; 3]; pixels], depth: vec![f32::INFINITY; pixels] };
    write_png(Path::new("overlay.png"), &film, ToneMap::default())?;
    println!("overlay.png");
    Ok(())
}
