//! Whole renders against closed forms.

use std::f64::consts::PI;
use std::sync::Arc;

use airlight::glam::{DAffine3, DMat3, DQuat, DVec3, UVec3, Vec3};
use airlight::light::{BlackBody, Environment, Light};
use airlight::media::{Classified, ControlPoint, Grid, GridMedium, Homogeneous, Optics, Phase, TransferFunction};
use airlight::reference::closed::{LitBox, emission_absorption, transmittance};
use airlight::scene::{
    Background, Content, Direct, EnvironmentEstimate, Estimate, LightsEstimate, Opacity, Quality, Records, Scene,
    Shadow, Solver,
};
use libtest_mimic::Failed;

use crate::fixtures::{camera, chromatic, grey, noise, phases};
use crate::{Axis, Case, Record, Subject, check, tolerance};

/// The box of every scene here, metres.
const BOX: LitBox = LitBox {
    min: DVec3::new(-0.35, -0.4, -0.3),
    max: DVec3::new(0.5, 0.25, 0.7),
    scattering: 0.0,
    extinction: 0.0,
    to_light: DVec3::Y,
    irradiance: 0.0,
};

const DENSITY: f32 = 0.8;

pub(crate) fn cases() -> Vec<Case> {
    let straight =
        |optics: Optics| move |s: &Subject, r: &mut Record| beer_lambert(s, r, fog(optics.clone()), DMat3::IDENTITY);
    let through = "Transmittance and alpha of a black box are Beer and Lambert's";
    let mut cases = vec![
        Case::new("closed::beer_lambert_grey", format!("{through}."), straight(grey(Phase::Isotropic))),
        Case::new(
            "closed::beer_lambert_chromatic",
            format!("{through}, in each channel."),
            straight(chromatic(Phase::Isotropic)),
        ),
        Case::new(
            "closed::beer_lambert_rotated_lattice",
            format!("{through}, where the box is a turned lattice of constant samples."),
            rotated,
        ),
        Case::new("closed::emission", "A box that glows and absorbs shows the integral of both.", emission),
        Case::new("closed::absorption", format!("{through}, where one grid scatters and another absorbs."), absorption),
        Case::new("closed::temperature", "A box of one heat glows in the colour of its black body.", temperature),
        Case::new(
            "closed::white_sky_behind_a_black_medium",
            "A visible environment shines through a black box as its transmittance lets it.",
            behind,
        ),
        Case::new(
            "closed::background",
            "A background of colours and distances is seen through what a black box leaves before it.",
            |s, r| background(s, r, true, true),
        ),
        Case::new(
            "closed::background_without_colors",
            "Surfaces without colours are black, and the environment is seen between them.",
            |s, r| background(s, r, false, true),
        ),
        Case::new(
            "closed::background_without_depth",
            "A background of colours alone is seen behind a whole black box.",
            |s, r| background(s, r, true, false),
        ),
    ];
    cases = cases.into_iter().map(|case| case.within(&tolerance::CLOSED)).collect();
    cases.push(
        Case::new(
            "closed::classified",
            "A box of one value between two control points, scattered once in a directional light, is the closed form's of \
             what the points say between them, times their tint.",
            classified,
        )
        .within(&tolerance::LIT_BOX)
        .permutes(&shadows()),
    );
    cases.push(
        Case::new(
            "closed::albedo_shares",
            "A directional light scattered once in a box that one grid makes scatter and another absorb, with shares of \
             the albedo in each channel, is the closed form's with the product of all.",
            shares,
        )
        .within(&tolerance::LIT_BOX)
        .permutes(&shadows()),
    );
    for (name, phase) in phases() {
        let optics = chromatic(phase.clone());
        let checks = format!("A directional light scattered once in a box is the closed form's ({name}).");
        let run = move |s: &Subject, r: &mut Record| directional(s, r, &optics);
        let case = Case::new(format!("closed::directional_{name}"), checks, run);
        cases.push(case.within(&tolerance::LIT_BOX).at("phase", name).permutes(&shadows()));
        for content in [Content::Radiance, Content::Transmittance, Content::Phase] {
            if content == Content::Transmittance && !phase.is_isotropic() {
                continue;
            }
            let (phase, content_name) = (phase.clone(), format!("{content:?}").to_lowercase());
            let case = Case::new(
                format!("closed::thin_uniform_{content_name}_{name}"),
                format!(
                    "A thin medium lit alike from everywhere scatters albedo · alpha · L (records of {content_name}, \
                     {name})."
                ),
                move |s, r| thin(s, r, phase.clone(), content),
            );
            cases.push(case.within(&tolerance::THIN).at("phase", name).at("content", content_name));
        }
    }
    cases
}

/// Where the medium's own shadow comes from.
fn shadows() -> Axis<LightsEstimate> {
    let marched = LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() });
    let propagated = LightsEstimate::Opacity(Opacity { cells: 9, ..Opacity::default() });
    Axis::new("shadow", [("marched", marched), ("propagated", propagated)])
}

fn fog(optics: Optics) -> Scene {
    Scene {
        camera: camera(29, 22, 1),
        medium: Arc::new(Homogeneous::new(DENSITY, BOX.min, BOX.max).expect("a box")),
        optics,
        environment: None,
        background: None,
        surfaces: None,
        frame: 0,
        lights: Vec::new(),
        estimate: Estimate::single(),
        quality: Quality::default(),
    }
}

/// For each pixel the way through the box, turned by `turn` about the origin.
fn ways(scene: &Scene, turn: DMat3) -> Vec<(DVec3, DVec3, f64)> {
    let camera = &scene.camera;
    let back = turn.transpose();
    let origin = back * camera.origin;
    let pixel = |i: u32| {
        let (x, y) = (f64::from(i % camera.width) + 0.5, f64::from(i / camera.width) + 0.5);
        let d = back * camera.direction(x, y);
        (origin, d, BOX.clip(origin, d).map_or(0.0, |(near, far)| far - near))
    };
    (0..camera.width * camera.height).map(pixel).collect()
}

fn extinction(scene: &Scene, c: usize) -> f64 {
    f64::from(scene.optics.extinction[c] * DENSITY)
}

fn beer_lambert(subject: &Subject, record: &mut Record, mut scene: Scene, turn: DMat3) -> Result<(), Failed> {
    scene.optics.albedo = Vec3::ZERO;
    let film = subject.renderer()?.render(&scene)?.film;
    let through: Vec<[f64; 3]> = ways(&scene, turn)
        .into_iter()
        .map(|(_, _, way)| [0, 1, 2].map(|c| transmittance(extinction(&scene, c) * way)))
        .collect();
    let hit = through.iter().filter(|t| t[0] < 0.5).count();
    check!(hit > 50, "only {hit} pixels see the box");
    let size = [film.width, film.height];
    record.picture("transmittance", size, film.transmittance.iter().copied(), through.iter().copied());
    let alpha = film.beauty.iter().map(|p| p[3]);
    record.hold("alpha", alpha, through.iter().map(|t| 1.0 - (t[0] + t[1] + t[2]) / 3.0));
    check!(film.beauty.iter().all(|p| p[..3] == [0.0; 3]), "a black medium without light is not black");
    Ok(())
}

/// A lattice of constant samples: clamped lookups make it homogeneous to its walls.
fn rotated(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.3, -0.8, 0.5).normalize(), 0.7));
    let mut scene = fog(chromatic(Phase::Isotropic));
    scene.medium = Arc::new(GridMedium::new(constant(DENSITY, turn)?, None)?);
    beer_lambert(subject, record, scene, turn)
}

/// Samples along each side of [`constant`].
const SAMPLES: UVec3 = UVec3::new(7, 5, 9);

/// The box as a lattice of one value, turned about the origin.
fn constant(value: f32, turn: DMat3) -> Result<Arc<Grid>, Failed> {
    let edges = (BOX.max - BOX.min) / SAMPLES.as_dvec3();
    let map = DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(edges), turn * (BOX.min + 0.5 * edges));
    Ok(Arc::new(Grid::dense(SAMPLES, map, vec![value; SAMPLES.element_product() as usize])?))
}

/// The share of the density that scatters in [`divided`].
const SCATTERS: f32 = 0.75;

/// The box as a lattice whose density scatters in part and absorbs in part.
fn divided() -> Result<GridMedium, Failed> {
    let part = |share: f32| constant(DENSITY * share, DMat3::IDENTITY);
    Ok(GridMedium::new(part(SCATTERS)?, None)?.with_absorption(part(1.0 - SCATTERS)?)?)
}

fn absorption(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = fog(chromatic(Phase::Isotropic));
    scene.medium = Arc::new(divided()?);
    beer_lambert(subject, record, scene, DMat3::IDENTITY)
}

/// What absorbs alone does not shine.
fn temperature(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let (kelvin, reference) = (2100.0, 1800.0);
    let mut scene = fog(chromatic(Phase::Isotropic));
    scene.medium = Arc::new(divided()?.with_temperature(constant(2.1, DMat3::IDENTITY)?, 1000.0, reference)?);
    scene.optics.albedo = Vec3::ZERO;
    scene.optics.emission = Vec3::new(2.0, 0.9, 0.3);
    let film = subject.renderer()?.render(&scene)?.film;
    let color = BlackBody::new(reference).color(kelvin);
    let glow = |c: usize, way| {
        let emission = f64::from(scene.optics.emission[c] * DENSITY * SCATTERS) * color[c];
        emission_absorption(emission, extinction(&scene, c), way)
    };
    let expected = ways(&scene, DMat3::IDENTITY).into_iter().map(|(_, _, way)| [0, 1, 2].map(|c| glow(c, way)));
    record.film("emission", &film, expected);
    Ok(())
}

fn shares(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let shares = [0.9f32, 0.5, 0.7];
    let mut scene = fog(chromatic(Phase::HenyeyGreenstein { g: 0.4 }));
    let [red, green, blue] = shares.map(|share| constant(share, DMat3::IDENTITY));
    scene.medium = Arc::new(divided()?.with_albedo([red?, green?, blue?])?);
    // As fine as in a homogeneous box.
    scene.quality.step = (BOX.max - BOX.min).min_element() / 64.0 / scene.medium.voxel();
    lit_once(subject, record, scene, shares.map(|share| share * SCATTERS))
}

fn classified(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = fog(chromatic(Phase::HenyeyGreenstein { g: 0.4 }));
    // A quarter of the way from the first point to the second is a density of 0.8.
    let point = |value, density, albedo: [f32; 3], tint: [f32; 3]| ControlPoint {
        albedo: Vec3::from(albedo),
        tint: Vec3::from(tint),
        ..ControlPoint::new(value, density)
    };
    let function = TransferFunction::new(vec![
        point(-120.0, 0.4, [0.5, 1.0, 0.25], [1.0, 0.5, 0.25]),
        point(280.0, 2.0, [0.9, 0.6, 0.65], [0.6, 0.9, 0.25]),
    ])?;
    scene.medium = Arc::new(Classified::new(constant(-20.0, DMat3::IDENTITY)?, function)?);
    scene.quality.step = (BOX.max - BOX.min).min_element() / 64.0 / scene.medium.voxel();
    lit_once(subject, record, scene, [0.6 * 0.9, 0.9 * 0.6, 0.35 * 0.25])
}

fn emission(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = fog(chromatic(Phase::Isotropic));
    scene.optics.albedo = Vec3::ZERO;
    scene.optics.emission = Vec3::new(2.0, 0.9, 0.3);
    let film = subject.renderer()?.render(&scene)?.film;
    let glow =
        |c: usize, way| emission_absorption((scene.optics.emission[c] * DENSITY).into(), extinction(&scene, c), way);
    let expected = ways(&scene, DMat3::IDENTITY).into_iter().map(|(_, _, way)| [0, 1, 2].map(|c| glow(c, way)));
    record.film("emission", &film, expected);
    Ok(())
}

/// A visible environment shines through.
fn behind(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = fog(chromatic(Phase::Isotropic));
    scene.optics.albedo = Vec3::ZERO;
    scene.environment = Some(Environment::uniform(Vec3::new(0.5, 1.0, 2.0))?);
    let film = subject.renderer()?.render(&scene)?.film;
    let expected = ways(&scene, DMat3::IDENTITY)
        .into_iter()
        .map(|(_, _, way)| [0, 1, 2].map(|c| [0.5, 1.0, 2.0][c] * transmittance(extinction(&scene, c) * way)));
    record.film("background", &film, expected);
    Ok(())
}

/// A picture made elsewhere, whose surfaces stand before, within and behind a black medium, or nowhere; and an
/// environment, which is seen only where there is neither colour nor surface.
fn background(subject: &Subject, record: &mut Record, colored: bool, deep: bool) -> Result<(), Failed> {
    let mut scene = fog(chromatic(Phase::Isotropic));
    scene.optics.albedo = Vec3::ZERO;
    scene.environment = Some(Environment::uniform(Vec3::new(0.5, 1.0, 2.0))?);
    let ways = ways(&scene, DMat3::IDENTITY);
    let walls = |i: usize| BOX.clip(ways[i].0, ways[i].1);
    let depth: Vec<f32> = (0..ways.len())
        .map(|i| {
            let (near, far) = walls(i).unwrap_or((1.0, 2.0));
            [0.5 * near, near + 0.3 * (far - near), far + 0.1, f64::INFINITY, f64::from(f32::MAX)][i % 5] as f32
        })
        .collect();
    let color: Vec<[f32; 3]> = noise(91, 3 * ways.len()).chunks_exact(3).map(|c| [c[0], 1.0 + c[1], c[2]]).collect();
    let (width, height) = (scene.camera.width, scene.camera.height);
    let given = (colored.then(|| color.clone()), deep.then(|| depth.clone()));
    scene.background = Some(Background::new(width, height, given.0, given.1)?);
    let film = subject.renderer()?.render(&scene)?.film;
    let limit = |i: usize| if deep { f64::from(depth[i]) } else { f64::INFINITY };
    let through = |i: usize| {
        let way = walls(i).map_or(0.0, |(near, far)| (far.min(limit(i)) - near).max(0.0));
        [0, 1, 2].map(|c| transmittance(extinction(&scene, c) * way))
    };
    let seen = |i: usize| match (colored, i % 5) {
        (true, _) => color[i].map(f64::from),
        (false, 0..=2) => [0.0; 3],
        (false, _) => [0.5, 1.0, 2.0],
    };
    let left: Vec<_> = (0..ways.len()).map(through).collect();
    record.hold(
        "transmittance",
        film.transmittance.iter().flatten().map(|v| f64::from(*v)),
        left.iter().flatten().copied(),
    );
    record.film("background", &film, left.iter().enumerate().map(|(i, t)| [0, 1, 2].map(|c| seen(i)[c] * t[c])));
    let within = (0..ways.len()).filter(|i| i % 5 == 1 && walls(*i).is_some()).count();
    check!(within > 20, "only {within} surfaces stand within the medium");
    Ok(())
}

fn directional(subject: &Subject, record: &mut Record, optics: &Optics) -> Result<(), Failed> {
    lit_once(subject, record, fog(optics.clone()), [1.0; 3])
}

/// A box in a directional light, of whose density `shares` scatter in each channel.
fn lit_once(subject: &Subject, record: &mut Record, mut scene: Scene, shares: [f32; 3]) -> Result<(), Failed> {
    let to_light = DVec3::new(0.5, 0.8, -0.35).normalize();
    let irradiance = [3.0f32, 2.6, 2.0];
    scene.lights = vec![Light::directional(to_light, Vec3::from(irradiance))?];
    let mut renderer = subject.renderer()?;
    let expected = ways(&scene, DMat3::IDENTITY).into_iter().map(|(origin, d, _)| {
        [0, 1, 2].map(|c| {
            let extinction = extinction(&scene, c);
            let lit = LitBox {
                scattering: extinction * f64::from(scene.optics.albedo[c] * shares[c]),
                extinction,
                to_light,
                irradiance: irradiance[c].into(),
                ..BOX
            };
            lit.single_scattering(scene.optics.phase.eval(to_light.dot(d)), origin, d)
        })
    });
    let expected: Vec<[f64; 3]> = expected.collect();
    record.each(&shadows(), |record, shadow| {
        scene.estimate.lights = Some(shadow.clone());
        let film = renderer.render(&scene)?.film;
        record.film("single scattering", &film, expected.iter().copied());
        Ok(())
    })
}

/// A thin medium lit alike from everywhere scatters albedo · alpha · L, whatever its phase function: a phase function
/// that is not normalised shows, and so do directions whose weights do not add up to the sphere.
fn thin(subject: &Subject, record: &mut Record, phase: Phase, content: Content) -> Result<(), Failed> {
    let mut scene = fog(chromatic(phase));
    scene.optics.extinction = Vec3::new(1.5e-3, 1e-3, 0.5e-3);
    let light = [0.5f32, 1.0, 2.0];
    let mut sky = Environment::uniform(Vec3::from(light))?;
    sky.visible = false;
    scene.environment = Some(sky);
    let records = Records { cells: 5, bands: 4, directions: 192, content, solver: Solver::March, ..Records::default() };
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    let film = subject.renderer()?.render(&scene)?.film;
    let expected = ways(&scene, DMat3::IDENTITY).into_iter().map(|(_, _, way)| {
        [0, 1, 2].map(|c| {
            let opacity = 1.0 - transmittance(extinction(&scene, c) * way);
            opacity * f64::from(scene.optics.albedo[c] * light[c])
        })
    });
    // Toward the eye the phase function is taken at the directions, not integrated over their pixels.
    let sharpness: f64 = if content == Content::Phase { quadrature_error(&scene.optics.phase, 4) } else { 0.0 };
    record.within(tolerance::THIN.plus(sharpness), |record| record.film("scattered light", &film, expected));
    Ok(())
}

/// The largest error of Σ p · 4π/n over the directions of 12·`nside`² for some views.
fn quadrature_error(phase: &Phase, nside: u32) -> f64 {
    let directions = airlight::basis::healpix::directions(nside);
    let weight = 4.0 * PI / directions.len() as f64;
    let sum = |view: DVec3| directions.iter().map(|d| phase.eval(d.dot(view)) * weight).sum::<f64>();
    let views = airlight::basis::healpix::directions(7);
    views.into_iter().map(|view| (sum(view) - 1.0).abs()).fold(0.0, f64::max)
}
