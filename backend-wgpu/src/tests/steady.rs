//! What a frame like the one before it does not make anew.

use std::sync::Arc;

use airlight_core::exec::Renderer;
use airlight_core::glam::{DVec3, UVec3, Vec3};
use airlight_core::light::{Environment, Light};
use airlight_core::media::{Grid, GridMedium, Lattice, Optics};
use airlight_core::scene::{Camera, Estimate, Jitter, Quality, Scene};

use super::device;
use crate::WgpuDevice;
use crate::gpu::Made;
use crate::part::Steady;

fn medium(version: u32) -> GridMedium {
    let dims = UVec3::new(13, 9, 11);
    let lattice = Lattice::in_box(dims, DVec3::new(-0.4, 0.0, -0.3), DVec3::new(0.9, 0.8, 0.7)).unwrap();
    let value = |i: u32| (i % 7 + version) as f32 * if i.is_multiple_of(3) { 0.0 } else { 0.2 };
    let grid = Grid::dense(dims, lattice.index_to_world(), (0..dims.element_product()).map(value).collect()).unwrap();
    GridMedium::new(Arc::new(grid), None).unwrap()
}

pub(super) fn scene() -> Scene {
    Scene {
        camera: Camera {
            origin: DVec3::new(1.9, 1.3, 2.2),
            target: DVec3::new(0.25, 0.4, 0.2),
            up: DVec3::Y,
            fov: 38.0,
            width: 44,
            height: 32,
            samples: 1,
        },
        medium: Arc::new(medium(1)),
        optics: Optics::grey(3.0, 0.9),
        environment: Some(Environment::uniform(Vec3::new(0.5, 1.0, 2.0)).unwrap()),
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![Light::point(DVec3::new(0.7, 0.9, 1.1), Vec3::new(0.2, 0.4, 0.3)).unwrap()],
        estimate: Estimate::single(),
        quality: Quality::default(),
    }
}

/// Frames until numbers that stay are built for: frames wait, and then there is the one that builds.
const SETTLED: usize = Steady::WAITS as usize + 1;

/// What each of some more frames than these makes.
fn frames(change: impl Fn(&mut Scene, u32)) -> Option<Vec<Made>> {
    let mut renderer = Renderer::new(Box::new(device()?));
    let mut scene = scene();
    let made = |renderer: &mut Renderer| renderer.device_mut().downcast_mut::<WgpuDevice>().unwrap().gpu.made();
    let mut before = made(&mut renderer);
    let frames = (0..SETTLED as u32 + 8).map(|frame| {
        scene.frame = frame;
        change(&mut scene, frame);
        renderer.render(&scene).unwrap();
        let now = made(&mut renderer);
        let since = |of: fn(Made) -> u64| of(now) - of(before);
        let all = Made {
            buffers: since(|made| made.buffers),
            textures: since(|made| made.textures),
            groups: since(|made| made.groups),
            pipelines: since(|made| made.pipelines),
            reads: since(|made| made.reads),
        };
        before = now;
        all
    });
    Some(frames.collect())
}

/// A frame that makes nothing, and reads its film.
const STEADY: Made = Made { buffers: 0, textures: 0, groups: 0, pipelines: 0, reads: 1 };

#[test]
fn frames_of_a_moving_eye_make_nothing_once_they_stand() {
    let Some(frames) = frames(|scene, frame| scene.camera.origin.x += 0.01 * f64::from(frame)) else { return };
    assert!(frames[0].buffers > 0 && frames[0].groups > 0 && frames[0].pipelines > 0, "{frames:?}");
    assert!(frames[SETTLED..].iter().all(|made| *made == STEADY), "{frames:?}");
}

#[test]
fn frames_of_changing_light_and_media_make_nothing_once_they_stand() {
    let change = |scene: &mut Scene, frame| {
        scene.medium = Arc::new(medium(frame + 1));
        scene.environment = Some(Environment::uniform(Vec3::splat(1.0 + frame as f32)).unwrap());
    };
    let Some(frames) = frames(change) else { return };
    assert!(frames[SETTLED..].iter().all(|made| *made == STEADY), "{frames:?}");
}

#[test]
fn numbers_that_change_with_every_frame_do_not_make_kernels() {
    let change = |scene: &mut Scene, frame| {
        scene.quality = Quality { jitter: Jitter::BlueNoise, temporal: true, scale: 2, ..Quality::default() };
        scene.camera.origin.x += 0.01 * f64::from(frame);
    };
    let Some(frames) = frames(change) else { return };
    // It takes a few to know what changes.
    assert!(frames[SETTLED + 3..].iter().all(|made| *made == STEADY), "{frames:?}");
}
