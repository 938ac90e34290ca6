//! Media that transfers are made of.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use airlight::glam::{DAffine3, DVec3, UVec3, Vec3};
use airlight::light::{Environment, Light};
use airlight::media::{FractalNoise, Grid, GridMedium, Lattice, Medium, Noise, Optics, Phase};
use airlight::scene::{Camera, Content, Estimate, Quality, Scene};
use airlight_conformance::pictures;
use airlight_formats::image::load_environment;
use airlight_formats::scene::load_scene;

use super::Lab;
use crate::told;

/// A file of `scenes/`.
pub(super) fn scenes(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes")).join(name)
}

/// A sky of `scenes/`, hidden.
pub(super) fn sky(name: &str) -> Result<Environment, Box<dyn Error>> {
    let (mut environment, _) = load_environment(&scenes(name))?;
    environment.visible = false;
    Ok(environment)
}

/// A medium in a box of a metre, seen from above a corner.
fn boxed(lab: &Lab<'_>, medium: Arc<dyn Medium>, optics: Optics) -> Result<Scene, Box<dyn Error>> {
    let [width, height] = lab.tile();
    Ok(Scene {
        camera: Camera {
            origin: DVec3::new(2.1, 1.5, 2.6),
            target: DVec3::new(0.5, 0.42, 0.5),
            up: DVec3::Y,
            fov: 30.0,
            width,
            height,
            samples: 1,
        },
        medium,
        optics,
        environment: Some(sky("studio.exr")?),
        background: None,
        surfaces: None,
        frame: 0,
        lights: Vec::new(),
        estimate: Estimate::none(),
        quality: Quality::default(),
    })
}

/// Grey smoke of random density, isotropic: its mean optical depth across is 8.
pub(super) fn smoke(lab: &Lab<'_>) -> Result<Scene, Box<dyn Error>> {
    let lattice = Lattice::of_cells(lab.size(96, 16), DVec3::ZERO, DVec3::ONE)?;
    let medium = Noise::new(1.0, FractalNoise::new(0.3, 4, 7, 2.5)?, lattice)?;
    boxed(lab, Arc::new(medium), Optics::grey(8.0, 0.95))
}

/// Dense pillars on a dense floor in thin haze, grey and isotropic.
pub(super) fn pillars(lab: &Lab<'_>) -> Result<Scene, Box<dyn Error>> {
    let n: u32 = lab.size(96, 24);
    let edge = 1.0 / f64::from(n);
    let stands =
        [(0.2, 0.25, 0.8), (0.5, 0.15, 0.55), (0.8, 0.3, 0.7), (0.3, 0.6, 0.4), (0.62, 0.62, 0.85), (0.85, 0.8, 0.5)];
    let density = |p: DVec3| -> f64 {
        // From 1 inside to 0 within two voxels.
        let inside = |depth: f64| (0.5 + depth / (2.0 * edge)).clamp(0.0, 1.0);
        let pillar = |&(x, z, top): &(f64, f64, f64)| inside((0.075 - (p.x - x).hypot(p.z - z)).min(top - p.y));
        let floor = inside(0.06 - p.y);
        stands.iter().map(pillar).fold(floor, f64::max).max(0.01)
    };
    let at = |i: u32| (UVec3::new(i % n, i / n % n, i / n / n).as_dvec3() + 0.5) * edge;
    let values = (0..n * n * n).map(|i| density(at(i)) as f32).collect();
    let to_world = DAffine3::from_translation(DVec3::splat(0.5 * edge)) * DAffine3::from_scale(DVec3::splat(edge));
    let grid = Grid::dense(UVec3::splat(n), to_world, values)?;
    boxed(lab, Arc::new(GridMedium::new(Arc::new(grid), None)?), Optics::grey(40.0, 0.95))
}

/// The reference cloud in its environment, smaller: grey extinction, coloured albedo, isotropic.
pub(super) fn cloud(lab: &Lab<'_>) -> Result<Scene, Box<dyn Error>> {
    let mut scene = pictures::in_environment(pictures::records(Content::Radiance, 1, 48)).map_err(told)?;
    scene.quality.step = 1.0;
    [scene.camera.width, scene.camera.height] = lab.tile();
    scene.camera.samples = 1;
    Ok(scene)
}

/// The same, scattering forward.
pub(super) fn forward_cloud(lab: &Lab<'_>) -> Result<Scene, Box<dyn Error>> {
    let mut scene = cloud(lab)?;
    scene.optics.phase = Phase::HenyeyGreenstein { g: 0.5 };
    Ok(scene)
}

/// A scene of `scenes/` in its environment and its directional lights alone, hidden and small.
fn filed(lab: &Lab<'_>, name: &str) -> Result<Scene, Box<dyn Error>> {
    let mut scene = load_scene(&scenes(name), &[])?.scene;
    scene.lights.retain(|light| matches!(light, Light::Directional { .. }));
    if let Some(environment) = &mut scene.environment {
        environment.visible = false;
    }
    [scene.camera.width, scene.camera.height] = lab.tile();
    scene.camera.samples = 1;
    Ok(scene)
}

/// `scenes/head.toml`.
pub(super) fn head(lab: &Lab<'_>) -> Result<Scene, Box<dyn Error>> {
    filed(lab, "head.toml")
}

/// `scenes/cumulus.toml`.
pub(super) fn cumulus(lab: &Lab<'_>) -> Result<Scene, Box<dyn Error>> {
    filed(lab, "cumulus.toml")
}

/// A white light from afar.
pub(super) fn sun(to_light: [f64; 3], irradiance: f32) -> Result<Light, Box<dyn Error>> {
    Ok(Light::directional(DVec3::from(to_light), Vec3::splat(irradiance))?)
}
