//! Whole pictures of rooms: a Cornell box with a medium inside against brute force, and creases against the rules.

use std::sync::Arc;

use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Gaussian, Gaussians, Homogeneous, Lattice, Medium, Optics, Phase};
use airlight::reference::{self, BruteForce, BruteSettings, UpsampleInputs};
use airlight::scene::{
    Camera, Direct, Estimate, Film, LightsEstimate, Material, Mesh, Quality, Scene, Shadow, Shape, SurfaceShadow,
};
use airlight::stage::UpsampleParams;
use bytemuck::Zeroable;
use libtest_mimic::Failed;
use rayon::prelude::*;

use crate::frames::by_the_processor;
use crate::surfaces::chest;
use crate::{Axis, Case, Record, Subject, check, compare, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "rooms::cornell_box",
            "A Cornell box with a medium and a lamp inside is brute force's: walls and blocks lit through the medium, \
             and the medium lit past the blocks.",
            cornell_box,
        )
        .within(&tolerance::CORNELL_BOX)
        .permutes(&media()),
        Case::new(
            "rooms::creases",
            "A picture of half the size, made larger, keeps the creases between the walls of a room full of glow, as \
             closed forms and the rules of small films have it.",
            creases,
        )
        .within(&tolerance::CLOSED),
    ]
}

/// What fills the room and some of what is before it.
fn media() -> Axis<Arc<dyn Medium>> {
    let (low, high) = (DVec3::new(-0.6, -0.55, -0.57), DVec3::new(0.58, 0.61, 0.66));
    let blob = |x, y, z, c| Gaussian { center: DVec3::new(x, y, z), a: 2.2, c };
    let blobs = vec![blob(-0.25, 0.05, 0.2, 1.3), blob(0.2, -0.2, -0.15, 0.9), blob(0.05, 0.3, 0.1, 0.6)];
    let lattice = Lattice::of_cells(22, low, high).expect("a box");
    let fog: Arc<dyn Medium> = Arc::new(Homogeneous::new(0.8, low, high).expect("a box"));
    let clouds: Arc<dyn Medium> = Arc::new(Gaussians::new(blobs, lattice).expect("Gaussians"));
    Axis::new("medium", [("homogeneous", fog), ("Gaussians", clouds)])
}

fn cornell_box(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let material = Material { diffuse: Vec3::splat(0.73), specular: Vec3::splat(0.1), shininess: 6.0 };
    record.each(&media(), |record, medium| {
        let direct = Direct { shadow: Shadow::March, surface_shadow: SurfaceShadow::Ray };
        let scene = Scene {
            camera: Camera {
                origin: DVec3::new(0.12, 0.07, 1.9),
                target: DVec3::new(0.01, -0.02, 0.0),
                up: DVec3::Y,
                fov: 40.0,
                width: 24,
                height: 20,
                samples: 1,
            },
            medium: Arc::clone(medium),
            optics: Optics {
                phase: Phase::HenyeyGreenstein { g: 0.3 },
                extinction: Vec3::new(1.0, 1.2, 1.5),
                ..Optics::grey(1.0, 0.8)
            },
            environment: None,
            background: None,
            surfaces: Some(Arc::new(Shape::CornellBox.mesh(material)?)),
            frame: 0,
            lights: vec![Light::point(DVec3::new(0.06, 0.27, 0.13), Vec3::new(1.2, 1.0, 0.8))?],
            estimate: Estimate { lights: Some(LightsEstimate::Direct(direct)), ..Estimate::none() },
            quality: Quality { step: 0.5, steps: Some(400), ..Quality::default() },
        };
        let truth = BruteForce::new(&scene, &BruteSettings { rows: 1, nodes: 5 });
        let places = 0..scene.camera.width * scene.camera.height;
        let pixel = |i: u32| truth.pixel(i % scene.camera.width, i / scene.camera.width);
        let expected: Vec<[f64; 4]> = places.into_par_iter().map(pixel).collect();
        let film = subject.renderer()?.render(&scene)?.film;
        record.film("radiance", &film, expected.iter().map(|p| [p[0], p[1], p[2]]));
        record.hold("alpha", film.beauty.iter().map(|p| p[3]), expected.iter().map(|p| p[3]));
        // Each part of it counts: what the walls send, what the medium does, and what the blocks hide from it.
        let seen = |film: &Film| film.beauty.iter().flat_map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>();
        let unshadowed = Direct { surface_shadow: SurfaceShadow::None, ..direct };
        let without = [
            ("walls", Scene { surfaces: None, ..scene.clone() }),
            ("medium", Scene { optics: Optics { albedo: Vec3::ZERO, ..scene.optics.clone() }, ..scene.clone() }),
            (
                "shadows",
                Scene {
                    estimate: Estimate { lights: Some(LightsEstimate::Direct(unshadowed)), ..Estimate::none() },
                    ..scene.clone()
                },
            ),
        ];
        for (what, scene) in without {
            let apart = compare(
                seen(&by_the_processor(&scene)?).into_iter().map(f64::from),
                expected.iter().flat_map(|p| [p[0], p[1], p[2]]),
            );
            let least = 10.0 * record.tolerance().relative_l2;
            check!(
                apart.relative_l2 > least,
                "without {what} it is {:.2e} off: the case tries nothing",
                apart.relative_l2
            );
        }
        Ok(())
    })
}

fn creases(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let (low, high) = (DVec3::new(-0.9, -0.7, -0.8), DVec3::new(0.8, 0.75, 0.9));
    let camera = Camera {
        origin: DVec3::new(0.43, 0.31, 0.52),
        target: DVec3::new(-0.9, -0.65, -0.75),
        up: DVec3::Y,
        fov: 75.0,
        width: 45,
        height: 35,
        samples: 1,
    };
    let margin = DVec3::splat(0.2);
    let optics = Optics {
        extinction: Vec3::new(0.7, 1.1, 1.6),
        albedo: Vec3::ZERO,
        emission: Vec3::new(1.5, 0.9, 0.4),
        phase: Phase::Isotropic,
    };
    let walls: Mesh = chest(low, high);
    let scene = Scene {
        camera,
        medium: Arc::new(Homogeneous::new(1.0, low - margin, high + margin)?),
        optics: optics.clone(),
        environment: None,
        background: None,
        surfaces: Some(Arc::new(walls)),
        frame: 0,
        lights: Vec::new(),
        estimate: Estimate::none(),
        quality: Quality { scale: 2, ..Quality::default() },
    };
    // From within a box the nearest wall ahead along each axis ends a ray.
    let wall = |x: u32, y: u32| {
        let d = camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let way = |a: usize| (if d[a] > 0.0 { high[a] } else { low[a] } - camera.origin[a]) / d[a];
        let axis = (0..3).min_by(|&a, &b| way(a).total_cmp(&way(b))).unwrap_or(0);
        let mut normal = DVec3::ZERO;
        normal[axis] = -d[axis].signum();
        (way(axis), normal)
    };
    let mut params = UpsampleParams::zeroed();
    [params.forward, params.right, params.up] = camera.axes().map(|a| a.as_vec3().extend(0.0).to_array());
    (params.full_width, params.full_height, params.scale) = (camera.width, camera.height, 2);
    (params.width, params.height) = (camera.width.div_ceil(2), camera.height.div_ceil(2));
    (params.samples, params.surface_samples, params.normals_each) = (1, 1, 1);
    let pixels = |width: u32, height: u32| (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
    let medium: Vec<[f32; 4]> = pixels(params.width, params.height)
        .flat_map(|(x, y)| {
            let (distance, _) = wall((2 * x + 1).min(camera.width - 1), (2 * y + 1).min(camera.height - 1));
            let through = [0, 1, 2].map(|c| (-f64::from(optics.extinction[c]) * distance).exp());
            let glow = [0, 1, 2].map(|c| f64::from(optics.emission[c] / optics.extinction[c]) * (1.0 - through[c]));
            [[glow[0], glow[1], glow[2], distance], [through[0], through[1], through[2], 1.0]]
        })
        .map(|v| v.map(|v| v as f32))
        .collect();
    let seen: Vec<_> = pixels(camera.width, camera.height).map(|(x, y)| wall(x, y)).collect();
    let surface: Vec<[f32; 4]> = seen.iter().map(|(distance, _)| [0.0, 0.0, 0.0, *distance as f32]).collect();
    let normals: Vec<[f32; 4]> = seen.iter().map(|(_, normal)| normal.as_vec3().extend(0.0).to_array()).collect();
    let inputs = UpsampleInputs {
        medium: &medium,
        rims: None,
        surface: Some(&surface),
        normals: Some(&normals),
        environment: None,
        subpixels: &[0.5, 0.5],
    };
    let colors = |film: &[f64]| film.chunks_exact(8).map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>();
    let expected = colors(&reference::upsample(&params, &inputs));
    let blind = colors(&reference::upsample(&params, &UpsampleInputs { normals: None, ..inputs }));
    let apart = compare(blind.into_iter().flatten(), expected.iter().copied().flatten()).relative_l2;
    check!(apart > 10.0 * record.tolerance().relative_l2, "creases make {apart:.2e}: the case tries nothing");
    record.film("radiance", &subject.renderer()?.render(&scene)?.film, expected);
    Ok(())
}
