//! Every instruction set gives the same bits.

use std::sync::Arc;

use airlight_core::device::Device;
use airlight_core::exec::Renderer;
use airlight_core::glam::{DAffine3, DVec3, UVec3, Vec3};
use airlight_core::light::{Environment, Image, Light};
use airlight_core::media::{Grid, GridMedium, Optics, Phase};
use airlight_core::scene::{
    AllEstimate, Camera, Content, EnvironmentEstimate, Estimate, Path, Quality, Records, Scene, Solver,
};
use airlight_cpu::{CpuDevice, Isa};

/// Every stage and every branch of the kernels that computes: records of several layers with emission, three kinds
/// of light, a visible environment.
fn scene(content: Content, phase: Phase) -> Scene {
    let dims = UVec3::new(23, 14, 19);
    let wave = |i: u32| (0.71 * f64::from(i)).sin() + (0.013 * f64::from(i)).cos() - 0.4;
    let values = (0..dims.element_product()).map(|i| wave(i).max(0.0) as f32).collect();
    let map = DAffine3::from_cols(
        DVec3::new(0.04, 0.01, 0.0),
        DVec3::new(-0.01, 0.06, 0.005),
        DVec3::new(0.0, -0.01, 0.05),
        DVec3::new(-0.4, -0.3, -0.5),
    );
    let grid = Grid::dense(dims, map, values).unwrap();
    let texels = (0..32u8).map(|i| [f32::from(i % 5), f32::from(i % 3), 1.0]).collect();
    Scene {
        camera: Camera {
            origin: DVec3::new(1.3, 0.9, 1.7),
            target: DVec3::new(0.1, 0.0, 0.1),
            up: DVec3::Y,
            fov: 36.0,
            width: 43,
            height: 29,
            samples: 3,
        },
        medium: Arc::new(GridMedium::new(Arc::new(grid), None).unwrap()),
        optics: Optics {
            extinction: Vec3::new(9.0, 6.0, 4.0),
            albedo: Vec3::new(0.9, 0.8, 0.7),
            emission: Vec3::new(0.3, 0.2, 0.1),
            phase,
        },
        environment: Some(Environment::new(Image { width: 8, height: 4, texels }).unwrap()),
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![
            Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::ONE).unwrap(),
            Light::point(DVec3::new(-0.5, 0.9, 0.6), Vec3::ONE).unwrap(),
            Light::spot(DVec3::new(0.9, 0.8, -0.9), DVec3::ZERO, Vec3::ONE, 15.0, 30.0).unwrap(),
        ],
        estimate: Estimate {
            environment: Some(EnvironmentEstimate::Records(Records {
                cells: 11,
                content,
                solver: Solver::March,
                ..Records::default()
            })),
            ..Estimate::single()
        },
        quality: Quality { step: 0.7, ..Quality::default() },
    }
}

/// The bits of the last of a sequence of pictures by each instruction set are those of the baseline's.
fn same_bits(what: &str, scenes: &[Scene]) {
    let film = |isa: Isa| {
        let device = CpuDevice::with_isa(isa).expect("an instruction set of this machine");
        assert!(device.info().features.iter().any(|f| f == isa.name()));
        let mut renderer = Renderer::new(Box::new(device));
        let film = scenes.iter().map(|scene| renderer.render(scene).unwrap().film).last().expect("a picture");
        let values = film.beauty.into_iter().flatten().chain(film.transmittance.into_iter().flatten());
        values.chain(film.depth).map(f32::to_bits).collect::<Vec<_>>()
    };
    let baseline = film(Isa::Baseline);
    for isa in Isa::available() {
        assert!(film(isa) == baseline, "{} differs from baseline for {what}", isa.name());
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let hg = Phase::DoubleHenyeyGreenstein { forward: 0.7, backward: -0.3, weight: 0.8 };
    for (content, phase) in
        [(Content::Radiance, hg.clone()), (Content::Phase, hg), (Content::Transmittance, Phase::Isotropic)]
    {
        same_bits(&format!("{content:?}"), &[scene(content, phase)]);
    }
}

#[test]
fn every_instruction_set_follows_the_same_paths() {
    let mut scene = scene(Content::Radiance, Phase::HenyeyGreenstein { g: 0.5 });
    scene.estimate =
        Estimate { all: Some(AllEstimate::Path(Path { samples: 5, ..Path::default() })), ..Estimate::none() };
    same_bits("paths", &[scene]);
}

#[test]
fn every_instruction_set_accumulates_the_same_sequence() {
    let mut first = scene(Content::Radiance, Phase::Isotropic);
    first.quality = Quality { scale: 2, temporal: true, ..Quality::default() };
    first.camera.samples = 1;
    let mut second = Scene { frame: 1, ..first.clone() };
    second.camera.origin += DVec3::new(0.05, -0.02, 0.03);
    same_bits("a sequence", &[first, second]);
}
