//! Whole pictures, against the processor's.

use std::sync::atomic::{AtomicBool, Ordering};

use airlight_core::device::Device;
use airlight_core::exec::{ExecError, Hooks, RenderError, Renderer};
use airlight_core::glam::UVec3;
use airlight_core::media::Optics;
use airlight_core::scene::{Content, Film, Scene};
use airlight_cpu::CpuDevice;

use super::scenes::{self, Case};
use super::{device, relative_l2, small_device};

/// Both devices decide alike and compute in 32-bit floats. They differ by some units in the last place (6e-8 each) in
/// exp and in the order of sums: 9e-8 was measured on PoCL. Room is left for drivers whose exp and division are
/// only as good as OpenCL asks (3 and 2.5 units), which is far below what a mistake of placement costs on these scenes
/// (a step or a cell off by one: percents).
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
fn small_limits_cut_every_field_and_change_nothing() {
    // Densities of 17 slices of 1092 bytes in two slabs; records of 25 layers, 18,000 bytes a slice, in a slab a slice.
    let Some(device) = small_device(18_200) else { return };
    let mut renderer = Renderer::new(Box::new(device));
    for Case { name, scene } in scenes::all() {
        compare(name, &renderer.render(&scene).unwrap().film, &on_cpu(&scene));
    }
}

#[test]
fn a_cancelled_picture_does_not_spoil_the_next() {
    let Some(opencl) = device() else { return };
    let optics = || Optics::grey(9.0, 0.9);
    let scene = || {
        let medium = scenes::medium(UVec3::new(11, 7, 9), false);
        scenes::scene(medium, optics(), scenes::records(Content::Radiance, 1), vec![])
    };
    let devices: [Box<dyn Device>; 2] = [Box::new(opencl), Box::new(CpuDevice::new())];
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
