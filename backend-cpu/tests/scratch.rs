#![allow(missing_docs)]
use airlight_core::exec::Renderer;
use airlight_core::glam::{DVec3, Vec3};
use airlight_core::light::{Environment, Light};
use airlight_core::media::{Homogeneous, Optics, Phase};
use airlight_core::reference::{BruteForce, BruteSettings};
use airlight_core::scene::*;
use airlight_cpu::CpuDevice;
use std::sync::Arc;

fn scene(depth: f32, phase: Phase, samples: u32, max: Option<u32>) -> Scene {
    Scene {
        camera: Camera {
            origin: DVec3::new(1.2, 0.9, 1.7),
            target: DVec3::new(0.1, 0.3, 0.2),
            up: DVec3::Y,
            fov: 25.0,
            width: 32,
            height: 24,
            samples: 1,
        },
        medium: Arc::new(Homogeneous::new(1.0, DVec3::new(-0.3, 0.1, -0.2), DVec3::new(0.4, 0.6, 0.7)).unwrap()),
        optics: Optics { phase, ..Optics::grey(depth, 1.0) },
        environment: Some(Environment::uniform(Vec3::ONE).unwrap()),
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![],
        estimate: Estimate {
            environment: None,
            lights: None,
            all: Some(AllEstimate::Path(Path { samples, max_depth: max, ..Path::default() })),
        },
        quality: Quality::default(),
    }
}
fn mean(f: &Film) -> [f64; 4] {
    let mut s = [0.0; 4];
    for p in &f.beauty {
        for c in 0..4 {
            s[c] += f64::from(p[c]) / f.beauty.len() as f64;
        }
    }
    s
}

#[test]
#[ignore]
fn furnace() {
    let mut r = Renderer::new(Box::new(CpuDevice::new()));
    for depth in [0.5, 5.0, 30.0] {
        for phase in [
            Phase::Isotropic,
            Phase::HenyeyGreenstein { g: 0.5 },
            Phase::HenyeyGreenstein { g: -0.3 },
            Phase::Rayleigh,
            Phase::DoubleHenyeyGreenstein { forward: 0.7, backward: -0.3, weight: 0.8 },
        ] {
            let t = std::time::Instant::now();
            let out = r.render(&scene(depth, phase.clone(), 64, None)).unwrap();
            println!(
                "{depth} {phase:?} mean {:?} {:?} {:.2}s",
                mean(&out.film),
                out.report.paths,
                t.elapsed().as_secs_f64()
            );
        }
    }
}
#[test]
fn single() {
    let mut r = Renderer::new(Box::new(CpuDevice::new()));
    for phase in [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.5 }] {
        let mut s = scene(3.0, phase, 16384, Some(1));
        (s.camera.width, s.camera.height) = (8, 6);
        s.optics.extinction = Vec3::new(4.0, 2.0, 1.0);
        s.optics.albedo = Vec3::new(0.9, 0.5, 0.2);
        s.environment = None;
        s.lights = vec![
            Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.0, 1.0)).unwrap(),
            Light::point(DVec3::new(0.9, 1.2, 0.3), Vec3::new(1.0, 2.0, 0.5)).unwrap(),
        ];
        let out = r.render(&s).unwrap();
        s.camera.samples = 256;
        let b = BruteForce::new(&s, &BruteSettings { rows: 1, nodes: 40 });
        let mut e = [0.0; 4];
        for y in 0..6 {
            for x in 0..8 {
                let p = b.pixel(x, y);
                for c in 0..4 {
                    e[c] += p[c] / 48.0;
                }
            }
        }
        println!("found {:?} expected {:?} {:?}", mean(&out.film), e, out.report.paths);
    }
}
