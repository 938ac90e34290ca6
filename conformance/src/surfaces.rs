//! Surfaces in a medium against closed forms, and in places where something could go wrong.

use std::sync::Arc;

use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Homogeneous, Optics, Phase};
use airlight::scene::{
    Camera, Direct, Estimate, Film, LightsEstimate, Material, Mesh, Opacity, Quality, Scene, Shadow, SurfaceShadow,
};
use libtest_mimic::Failed;

use crate::fixtures::{DIMS, Map, ball, cloud, grey, room, sky, wall};
use crate::{Axis, Case, Record, Subject, check, rgb, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "surfaces::floor_under_a_lamp_in_fog",
            "A floor that a lamp lights through fog is that of the closed form: Lambert, 1/r², and Beer and Lambert twice.",
            floor,
        )
        .within(&tolerance::LAMP)
        .permutes(&estimators()),
        Case::new(
            "surfaces::shadow_of_a_plate",
            "Fog behind a plate is lit up to the edges of the plate's shadow, as the closed form is.",
            plate,
        )
        .within(&tolerance::SHADOW_EDGE)
        .permutes(&shadows()),
        Case::new(
            "surfaces::no_light_within_a_box",
            "Fog in a closed box is dark under lamps outside, and lit by one inside, whatever its shadows come from.",
            closed_box,
        )
        .permutes(&shadows()),
        Case::new(
            "surfaces::odd_places",
            "Eyes and lights in surfaces, beside the medium and in one place, and meshes without triangles, give films \
             of numbers.",
            odd,
        )
        .permutes(&places())
        .varies(&shadows()),
    ]
}

fn estimators() -> Axis<LightsEstimate> {
    let opacity = Opacity { cells: 9, ..Opacity::default() };
    let direct = Direct { shadow: Shadow::March, surface_shadow: SurfaceShadow::Ray };
    Axis::new("estimator", [("opacity", LightsEstimate::Opacity(opacity)), ("direct", LightsEstimate::Direct(direct))])
}

fn shadows() -> Axis<SurfaceShadow> {
    Axis::new("surface shadow", [("ray", SurfaceShadow::Ray), ("map", SurfaceShadow::Map(256))])
}

fn point(position: DVec3, intensity: Vec3) -> Light {
    Light::point(position, intensity).expect("a light")
}

/// Fog in a box, seen from inside it, with surfaces.
fn fog(low: DVec3, high: DVec3, optics: Optics, surfaces: Mesh) -> Scene {
    Scene {
        camera: Camera {
            origin: DVec3::new(1.1, 0.9, 1.3),
            target: DVec3::new(0.1, 0.0, -0.2),
            up: DVec3::Y,
            fov: 36.0,
            width: 27,
            height: 20,
            samples: 1,
        },
        medium: Arc::new(Homogeneous::new(1.0, low, high).expect("a box")),
        optics,
        environment: None,
        background: None,
        surfaces: Some(Arc::new(surfaces)),
        frame: 0,
        lights: Vec::new(),
        estimate: Estimate { environment: None, lights: None, all: None },
        quality: Quality::default(),
    }
}

/// The directions of a picture's pixels.
fn directions(camera: &Camera) -> impl Iterator<Item = DVec3> {
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    pixels.map(|(x, y)| camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5))
}

fn floor(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let diffuse = Vec3::new(0.7, 0.5, 0.2);
    let extinction = Vec3::new(0.6, 0.4, 0.2);
    let material = Material { diffuse, specular: Vec3::splat(0.3), shininess: 7.0 };
    let ground = wall(DVec3::new(-9.0, 0.0, -9.0), DVec3::new(18.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 18.0), material);
    // Black fog: nothing but the floor sends light.
    let optics = Optics { extinction, albedo: Vec3::ZERO, emission: Vec3::ZERO, phase: Phase::Isotropic };
    let mut scene = fog(DVec3::new(-9.0, -0.5, -9.0), DVec3::new(9.0, 3.0, 9.0), optics, ground);
    let (lamp, intensity) = (DVec3::new(-0.4, 0.8, 0.3), DVec3::new(2.0, 3.0, 1.0));
    scene.lights = vec![point(lamp, intensity.as_vec3())];
    let eye = scene.camera.origin;
    let pixel = |d: DVec3| {
        let t = -eye.y / d.y;
        let at = eye + t * d;
        let way = lamp - at;
        let (r, toward) = (way.length(), way.normalize());
        let mirrored = DVec3::new(-toward.x, toward.y, -toward.z);
        let lobe = 9.0 / std::f64::consts::TAU * (-mirrored.dot(d)).max(0.0).powf(7.0);
        let share = diffuse.as_dvec3() / std::f64::consts::PI + f64::from(0.3f32) * lobe;
        let through = (-(t + r) * extinction.as_dvec3()).exp();
        (share * intensity * toward.y / (r * r) * through).to_array()
    };
    let looks_down = directions(&scene.camera).all(|d| d.y < -0.05);
    check!(looks_down, "not every pixel sees the floor");
    let expected: Vec<_> = directions(&scene.camera).map(pixel).collect();
    record.each(&estimators(), |record, lights| {
        scene.estimate.lights = Some(lights.clone());
        let film = subject.renderer()?.render(&scene)?.film;
        record.film("radiance", &film, expected.iter().copied());
        Ok(())
    })
}

/// The parts of a ray, up to `end`, whose light passes by the plate |x|, |z| ≤ ½ at y = 0 under light from `to_light`.
fn lit(eye: DVec3, d: DVec3, to_light: DVec3, end: f64) -> Vec<[f64; 2]> {
    // The point's place in the plate's plane, as the light sees it, is linear along the ray; it is in the shadow below.
    let cast = |v: DVec3| v - v.y / to_light.y * to_light;
    let (place, slope) = (cast(eye), cast(d));
    let (mut near, mut far) = (0.0, end);
    for (p, s, low, high) in
        [(place.x, slope.x, -0.5, 0.5), (place.z, slope.z, -0.5, 0.5), (eye.y, d.y, f64::NEG_INFINITY, 0.0)]
    {
        let walls = [(low - p) / s, (high - p) / s];
        near = walls[0].min(walls[1]).max(near);
        far = walls[0].max(walls[1]).min(far);
    }
    if near < far { vec![[0.0, near], [far, end]] } else { vec![[0.0, end]] }
}

fn plate(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let black = Material { diffuse: Vec3::ZERO, ..Material::default() };
    let plate = wall(DVec3::new(-0.5, 0.0, -0.5), DVec3::X, DVec3::Z, black);
    let optics = Optics::grey(0.5, 0.8);
    let mut scene = fog(DVec3::new(-2.0, -1.5, -2.0), DVec3::new(2.0, 1.5, 2.0), optics, plate);
    scene.quality.step = 0.05;
    let to_light = DVec3::new(0.4, 0.9, -0.3).normalize();
    scene.lights = vec![Light::directional(to_light, Vec3::ONE)?];
    let (eye, sigma) = (scene.camera.origin, f64::from(scene.optics.extinction.x));
    let scattered = f64::from(scene.optics.albedo.x) / (4.0 * std::f64::consts::PI);
    let mut shaded = 0;
    let expected: Vec<_> = directions(&scene.camera)
        .map(|d| {
            let walls = |a: usize, wall: f64| (wall * d[a].signum() - eye[a]) / d[a];
            let leave = walls(0, 2.0).min(walls(1, 1.5)).min(walls(2, 2.0));
            let met = -eye.y / d.y;
            let at = eye + met * d;
            let stops = met > 0.0 && at.x.abs() < 0.5 && at.z.abs() < 0.5;
            let parts = lit(eye, d, to_light, if stops { met } else { leave });
            shaded += usize::from(parts.len() > 1);
            let light = parts.iter().map(|[a, b]| (-sigma * a).exp() - (-sigma * b).exp()).sum::<f64>();
            [scattered * light; 3]
        })
        .collect();
    check!(shaded > 50, "only {shaded} rays pass through the shadow");
    record.each(&shadows(), |record, &surface_shadow| {
        let direct = Direct { shadow: Shadow::None, surface_shadow };
        scene.estimate.lights = Some(LightsEstimate::Direct(direct));
        let film = subject.renderer()?.render(&scene)?.film;
        record.film("radiance", &film, expected.iter().copied());
        Ok(())
    })
}

/// Six walls of a box.
fn chest(low: DVec3, high: DVec3) -> Mesh {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * (high - low));
    let side = |corner: DVec3, u: DVec3, v: DVec3| wall(corner, u, v, Material::default());
    let sides = [side(low, x, y), side(low, y, z), side(low, z, x)];
    let others = [side(low + z, x, y), side(low + x, y, z), side(low + y, z, x)];
    Mesh::joined(&[sides, others].concat()).expect("twelve triangles")
}

fn closed_box(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    // The medium ends before the walls, farther than a texel of the maps is wide there.
    let (low, high) = (DVec3::new(-0.4, -0.3, -0.5), DVec3::new(0.5, 0.4, 0.45));
    let margin = DVec3::splat(0.1);
    let optics = Optics::grey(2.0, 0.9);
    let mut scene = fog(low, high, optics, chest(low - margin, high + margin));
    scene.camera.origin = DVec3::new(0.42, 0.3, 0.4);
    scene.camera.target = DVec3::new(-0.2, -0.1, -0.3);
    scene.camera.fov = 90.0;
    let outside = vec![
        point(DVec3::new(1.0, 1.2, -0.3), Vec3::ONE),
        Light::directional(DVec3::new(-0.3, 1.0, 0.4), Vec3::ONE)?,
        Light::spot(DVec3::new(-1.5, 0.2, 0.3), DVec3::ZERO, Vec3::splat(9.0), 10.0, 30.0)?,
    ];
    let inside = vec![point(DVec3::new(0.02, 0.1, -0.1), Vec3::ONE)];
    record.each(&shadows(), |record, &surface_shadow| {
        scene.estimate.lights =
            Some(LightsEstimate::Opacity(Opacity { cells: 8, surface_shadow, ..Opacity::default() }));
        scene.lights = outside.clone();
        let dark = subject.renderer()?.render(&scene)?.film;
        record.score("light", "from outside", sum(&dark), 0.0);
        scene.lights = inside.clone();
        let bright = subject.renderer()?.render(&scene)?.film;
        let least = rgb(&bright).map(|p| p[0]).fold(f32::INFINITY, f32::min);
        check!(least > 0.0, "a lamp inside leaves a pixel dark");
        Ok(())
    })
}

fn sum(film: &Film) -> f64 {
    rgb(film).flatten().map(f64::from).sum()
}

/// A change of a scene with surfaces, a medium and a lamp.
type Place = Arc<dyn Fn(&mut Scene) + Send + Sync>;

fn places() -> Axis<Place> {
    let center = Map::Plain.lattice(DIMS).center();
    let put = |scene: &mut Scene, mesh: Mesh| scene.surfaces = Some(Arc::new(mesh));
    let lamps = |scene: &mut Scene, at: &[DVec3]| scene.lights = at.iter().map(|&at| point(at, Vec3::ONE)).collect();
    let place = |name: &'static str, change: Place| (name, change);
    Axis::new(
        "place",
        [
            place("no light", Arc::new(|s| s.lights.clear())),
            place(
                "no triangles",
                Arc::new(move |s| put(s, Mesh::new(vec![], vec![], vec![], vec![]).expect("a mesh"))),
            ),
            place("a lamp on a wall", Arc::new(move |s| lamps(s, &[DVec3::new(0.0, 0.25, 0.3)]))),
            place("a lamp in a corner", Arc::new(move |s| lamps(s, &[DVec3::new(-0.4, -0.3, 0.1)]))),
            place("a lamp at a cell's centre, twice", Arc::new(move |s| lamps(s, &[center, center]))),
            place(
                "a lamp at the eye",
                Arc::new(move |s| {
                    let eye = s.camera.origin;
                    lamps(s, &[eye]);
                }),
            ),
            place(
                "a lamp in a ball",
                Arc::new(move |s| {
                    put(s, ball(center, 0.3, 3, Material::default()));
                    lamps(s, &[center]);
                }),
            ),
            place(
                "the eye in a ball",
                Arc::new(move |s| {
                    put(s, ball(center, 0.3, 3, Material::default()));
                    s.camera.origin = center + DVec3::new(0.01, 0.02, -0.03);
                }),
            ),
            place("the eye on a wall", Arc::new(|s| s.camera.origin = DVec3::new(-0.4, -0.3, 0.1))),
            place(
                "surfaces beside the medium",
                Arc::new(move |s| put(s, ball(DVec3::new(9.0, 0.0, 0.0), 2.0, 3, Material::default()))),
            ),
            place("a black medium", Arc::new(|s| s.optics.albedo = Vec3::ZERO)),
            place("no estimator", Arc::new(|s| s.estimate.lights = None)),
        ],
    )
}

fn odd(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    record.each(&places(), |record, change| {
        record.each(&shadows(), |record, &surface_shadow| {
            let surface_shadow = match surface_shadow {
                SurfaceShadow::Map(_) => SurfaceShadow::Map(32),
                other => other,
            };
            let mut scene = cloud(Map::Plain, DIMS, grey(Phase::HenyeyGreenstein { g: 0.3 }));
            scene.surfaces = Some(Arc::new(room()));
            scene.environment = Some(sky());
            (scene.camera.width, scene.camera.height, scene.camera.samples) = (13, 9, 2);
            scene.lights = vec![point(DVec3::new(-0.2, 0.9, 0.6), Vec3::ONE)];
            scene.estimate.environment = None;
            let opacity = Opacity { cells: 5, surface_shadow, ..Opacity::default() };
            scene.estimate.lights = Some(LightsEstimate::Opacity(opacity));
            change(&mut scene);
            let film = renderer.render(&scene)?.film;
            let all = film.beauty.as_flattened().iter().chain(film.transmittance.as_flattened());
            let odd = all.filter(|v| !v.is_finite() || **v < -1e-6).count()
                + film.depth.iter().filter(|d| d.is_nan()).count();
            record.score("film", "values that are no light", odd as f64, 0.0);
            Ok(())
        })
    })
}
