//! Renders a small box of fog on the toy, or on the device that is named.

use std::sync::Arc;

use airlight::glam::{DVec3, Vec3};
use airlight::light::{Environment, Light};
use airlight::media::{Homogeneous, Optics};
use airlight::scene::{Camera, Estimate, Quality, Scene};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut providers = airlight::providers();
    providers.push(airlight_toy::PROVIDER);
    let choice = std::env::args().nth(1).unwrap_or("toy".into());
    let mut renderer = airlight::Renderer::new(airlight::open_among(&providers, &choice)?);

    let scene = Scene {
        camera: Camera {
            origin: DVec3::new(1.9, 1.3, 2.2),
            target: DVec3::splat(0.5),
            up: DVec3::Y,
            fov: 40.0,
            width: 24,
            height: 16,
            samples: 1,
        },
        medium: Arc::new(Homogeneous::new(1.0, DVec3::ZERO, DVec3::ONE)?),
        optics: Optics::grey(3.0, 0.9),
        environment: Some(Environment::uniform(Vec3::splat(0.5))?),
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![Light::directional(DVec3::new(0.3, 1.0, 0.2), Vec3::splat(2.0))?],
        estimate: Estimate::default(),
        quality: Quality::default(),
    };
    let film = renderer.render(&scene)?.film;
    println!("the middle is {:?} on {}", film.beauty[8 * 24 + 12], renderer.device().info().name);
    Ok(())
}
