//! Whole pictures, against the processor's.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use airlight_core::device::Device;
use airlight_core::exec::{ExecError, Hooks, RenderError, Renderer};
use airlight_core::glam::{DVec3, UVec3};
use airlight_core::media::{Homogeneous, Optics, Phase};
use airlight_core::scene::{Content, Elimination, Film, Records, Scene};
use airlight_cpu::CpuDevice;

use super::scenes::{self, Case};
use super::{device, relative_l2, small_device};

/// Both devices decide alike and compute in 32-bit floats. They differ by some units in the last place (6e-8 each) in
/// exp, in angles and in contraction: 5e-7 was measured on lavapipe. Twenty times that leaves room for drivers whose exp
/// and division are only as good as WGSL asks, and is far below what a mistake of placement costs on these scenes (a step
/// or a cell off by one: percents).
const TOLERANCE: f64 = 1e-5;

/// The vectors of a film as they can be compared: depth as its inverse, which is finite.
fn values(film: &Film) -> [Vec<f32>; 3] {
    [
        film.beauty.iter().flatten().copied().collect(),
        film.transmittance.iter().flatten().copied().collect(),
        film.depth.iter().map(|d| 1.0 / d).collect(),
    ]
}

fn compare(name: &str, got: &Film, expected: &Film) {
    for (what, (got, expected)) in
        ["beauty", "transmittance", "depth"].iter().zip(values(got).iter().zip(&values(expected)))
    {
        let error = relative_l2(got, expected);
        assert!(error < TOLERANCE, "{name}: {what} differs by {error:e}");
    }
}

fn on_cpu(scene: &Scene) -> Film {
    Renderer::new(Box::new(CpuDevice::new())).render(scene).unwrap().film
}

#[test]
fn every_scene_is_the_processors() {
    let Some(device) = device() else { return };
    // One renderer for all: what a scene does not need any more is dropped, what another needs is made.
    let mut renderer = Renderer::new(Box::new(device));
    for Case { name, scene } in scenes::all() {
        let rendered = renderer.render(&scene).unwrap();
        compare(name, &rendered.film, &on_cpu(&scene));
        assert!(renderer.render(&scene).unwrap().report.ran().is_empty(), "{name}: ran again");
    }
}

#[test]
fn small_limits_cut_every_resource_and_change_nothing() {
    // Textures of 23 slices, so that 25 layers of records take 8 slabs; bindings of two rows of blocks of the film.
    let Some(device) = small_device(33 << 10, 23) else { return };
    let mut renderer = Renderer::new(Box::new(device));
    for Case { name, scene } in scenes::all() {
        compare(name, &renderer.render(&scene).unwrap().film, &on_cpu(&scene));
    }
}

#[test]
fn a_sky_past_a_binding_and_past_a_texture_is_the_processors() {
    // Bindings of 64 texels of the sky's 84, and textures of 27.
    let Some(device) = small_device(1024, 3) else { return };
    let mut scene = scenes::all().into_iter().find(|case| case.name == "sky").unwrap().scene;
    scene.medium = Arc::new(Homogeneous::new(0.5, DVec3::ZERO, DVec3::new(0.9, 0.7, 1.1)).unwrap());
    (scene.camera.width, scene.camera.height, scene.camera.samples) = (3, 9, 4);
    scene.estimate.environment = None;
    compare("sky", &Renderer::new(Box::new(device)).render(&scene).unwrap().film, &on_cpu(&scene));
}

#[test]
fn records_past_the_largest_binding_are_the_processors() {
    // As software adapters and WebGPU's defaults have it.
    const BINDING: u64 = 128 << 20;
    let Some(mut device) = device() else { return };
    device.info.limits.binding_bytes = BINDING;
    let medium = scenes::medium(UVec3::new(12, 9, 10), false);
    let optics = Optics { phase: Phase::HenyeyGreenstein { g: 0.5 }, ..Optics::grey(6.0, 0.9) };
    let records =
        Records { cells: 144, directions: 48, elimination: Elimination::None, ..scenes::records(Content::Radiance, 3) };
    let lattice = medium.lattice();
    let grid = records.grid(lattice.edges() * lattice.dims().as_dvec3());
    let bytes = 4 * 3 * 9 * grid.iter().map(|&cells| u64::from(cells)).product::<u64>();
    assert!(bytes > BINDING, "records of {bytes} bytes show nothing");
    let mut scene = scenes::scene(Arc::clone(&medium), optics, records, vec![]);
    (scene.camera.width, scene.camera.height, scene.camera.samples) = (16, 9, 1);
    scene.quality.step = 4.0;
    let rendered = Renderer::new(Box::new(device)).render(&scene).unwrap();
    compare("large records", &rendered.film, &on_cpu(&scene));
}

#[test]
fn a_cancelled_picture_does_not_spoil_the_next() {
    let Some(gpu) = device() else { return };
    let optics = || Optics::grey(9.0, 0.9);
    let scene = || {
        let medium = scenes::medium(UVec3::new(11, 7, 9), false);
        scenes::scene(medium, optics(), scenes::records(Content::Radiance, 1), vec![])
    };
    let devices: [Box<dyn Device>; 2] = [Box::new(gpu), Box::new(CpuDevice::new())];
    for device in devices {
        let mut renderer = Renderer::new(device);
        // Once its pace is known, a stage is no longer waited for: what was dispatched is still under way.
        renderer.render(&scene()).unwrap();
        let (cancel, next) = (AtomicBool::new(false), scene());
        let mut calls = 0;
        let mut progress = |_| {
            calls += 1;
            cancel.store(calls == 4, Ordering::Relaxed);
        };
        let mut hooks = Hooks { progress: Some(&mut progress), cancel: Some(&cancel) };
        let cancelled = renderer.render_with(&next, &mut hooks).unwrap_err();
        assert_eq!(cancelled, RenderError::Exec(ExecError::Cancelled));
        let film = renderer.render(&next).unwrap().film;
        compare("after cancelling", &film, &on_cpu(&next));
    }
}
