//! What is redone when something changes, and what is not.

use std::sync::Arc;

use airlight::glam::{DVec3, Vec3};
use airlight::light::{Environment, Light};
use airlight::media::{Grid, GridMedium, Medium, Phase};
use airlight::scene::{
    Content, Direct, EnvironmentEstimate, Jitter, LightsEstimate, Opacity, Records, Scene, Scheme, Shadow, Solver,
    SurfaceShadow,
};
use libtest_mimic::Failed;

use crate::fixtures::{DIMS, Map, cloud, grey, room, sky};
use crate::{Axis, Case, Record, Subject, check};

pub(crate) fn cases() -> Vec<Case> {
    let contents = [Content::Radiance, Content::Transmittance, Content::Phase];
    let mut cases: Vec<_> = contents
        .into_iter()
        .map(|content| {
            let name = format!("{content:?}").to_lowercase();
            case(&name, scene(content), frames(content)).at("content", name)
        })
        .collect();
    let mut hg = scene(Content::Radiance);
    hg.optics.phase = Phase::HenyeyGreenstein { g: 0.3 };
    cases.push(case("radiance_hg", hg, anisotropy()).at("content", "radiance"));
    let mut unlit = scene(Content::Radiance);
    unlit.environment = None;
    unlit.lights = vec![sun()];
    unlit.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() }));
    cases.push(case("direct", unlit.clone(), lights(&["march"], &["reduce", "march"])));
    unlit.estimate.lights = Some(LightsEstimate::Opacity(Opacity { cells: 5, ..Opacity::default() }));
    cases.push(case("opacity", unlit.clone(), lights(&["propagate", "march"], &["propagate", "reduce", "march"])));
    unlit.estimate.lights =
        Some(LightsEstimate::Opacity(Opacity { cells: 5, scheme: Scheme::Published, ..Opacity::default() }));
    cases.push(case(
        "opacity_published",
        unlit,
        lights(&["propagate", "march"], &["reduce", "propagate", "reduce", "march"]),
    ));
    let mut glowing = scene(Content::Radiance);
    glowing.optics.emission = Vec3::ONE;
    let base = base();
    glowing.medium = Arc::new(base.clone());
    let colored: &[_] = &["project", "relight", "march"];
    let all: &[_] = &["reduce", "project", "relight", "reduce", "march"];
    cases.push(case("optics_that_vary", glowing.clone(), fields(&base, colored, all)).at("content", "radiance"));
    (glowing.environment, glowing.estimate.environment) = (None, None);
    glowing.lights = vec![sun()];
    glowing.estimate.lights = Some(LightsEstimate::Opacity(Opacity { cells: 5, ..Opacity::default() }));
    cases.push(case(
        "optics_that_vary_in_lights",
        glowing,
        fields(&base, &["march"], &["propagate", "reduce", "march"]),
    ));
    cases.push(case("surfaces", surfaces(), of_surfaces()));
    let mut jittered = scene(Content::Radiance);
    jittered.quality.jitter = Jitter::BlueNoise;
    cases.push(case("jitter", jittered.clone(), pictures(&["march"])));
    jittered.quality.scale = 2;
    cases.push(case("jitter_at_half_size", jittered, pictures(&["march", "upsample"])));
    cases.push(sequence());
    cases.push(case("optics_and_picture", scene(Content::Transmittance), optics()).at("content", "transmittance"));
    cases
}

fn case(name: &str, scene: Scene, changes: Axis<Change>) -> Case {
    let checks = format!(
        "After each change of a scene ({}) just the stages run that depend on it, and the film is a fresh renderer's.",
        name.replace('_', " ")
    );
    let (permutations, variants) = (changes.clone(), caches());
    let run = move |subject: &Subject, record: &mut Record| follow(subject, record, scene.clone(), &changes);
    Case::new(format!("keys::{name}"), checks, run).permutes(&permutations).varies(&variants)
}

/// What a device holds already when it renders.
#[derive(Clone, Copy, Debug)]
enum Cache {
    /// Nothing.
    Fresh,
    /// The scene before the change.
    Cached,
    /// The scene.
    Twice,
}

fn caches() -> Axis<Cache> {
    Axis::of("device", [Cache::Fresh, Cache::Cached, Cache::Twice])
}

fn scene(content: Content) -> Scene {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::Isotropic));
    scene.environment = Some(sky());
    let records = Records { cells: 4, bands: 2, directions: 48, content, solver: Solver::March, ..Records::default() };
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    scene
}

/// A change of a scene, and the stages that it costs.
#[derive(Clone)]
struct Change {
    change: Arc<dyn Fn(&mut Scene) + Send + Sync>,
    ran: &'static [&'static str],
}

/// Applies the changes one after the other. After each, the stages that ran must be those listed, a second render
/// must run none, and the film must be that of a fresh renderer, bit for bit.
fn follow(subject: &Subject, record: &mut Record, mut scene: Scene, changes: &Axis<Change>) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    let all = ["reduce", "project", "relight", "reduce", "march"];
    let first = renderer.render(&scene)?.report.ran();
    if scene.environment.is_some() && scene.quality.scale == 1 {
        check!(first == all, "the first frame ran {first:?}");
    }
    record.each(changes, |record, Change { change, ran: expected }| {
        change(&mut scene);
        record.each(&caches(), |record, cache| {
            let film = match cache {
                Cache::Fresh => subject.renderer()?.render(&scene)?.film,
                Cache::Cached => {
                    let rendered = renderer.render(&scene)?;
                    let ran = rendered.report.ran();
                    check!(ran == *expected, "{ran:?} ran, and {expected:?} should have");
                    rendered.film
                }
                Cache::Twice => {
                    let again = renderer.render(&scene)?;
                    check!(again.report.ran().is_empty(), "{:?} ran", again.report.ran());
                    check!(again.report.uploads.is_empty(), "{:?} were uploaded", again.report.uploads);
                    again.film
                }
            };
            record.steady("film", film.beauty.as_flattened());
            Ok(())
        })
    })
}

type Named = (&'static str, Change);

fn change(what: &'static str, f: impl Fn(&mut Scene) + Send + Sync + 'static, ran: &'static [&'static str]) -> Named {
    (what, Change { change: Arc::new(f), ran })
}

fn changes<const N: usize>(changes: [Named; N]) -> Axis<Change> {
    Axis::new("change", changes)
}

fn sun() -> Light {
    Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::ONE).expect("a light")
}

fn light(scene: &mut Scene) -> &mut Environment {
    scene.environment.as_mut().expect("the scenes here have one")
}

fn frames(content: Content) -> Axis<Change> {
    // The stages before `march` that a new light, and a new place of the eye, cost.
    let (relit, seen): (&'static [&'static str], &'static [&'static str]) = match content {
        // The light is in the records.
        Content::Radiance => (&["project", "relight", "march"], &["march"]),
        // A new light needs no new records.
        Content::Transmittance => (&["relight", "march"], &["march"]),
        // Records look at the eye.
        Content::Phase => (&["relight", "march"], &["project", "relight", "march"]),
    };
    changes([
        change("nothing", |_| (), &[]),
        change("the light's strength", |s| light(s).scale = Vec3::new(1.0, 2.0, 0.5), relit),
        change("the light's rotation", |s| light(s).rotation = 40.0, relit),
        change("another light", |s| s.environment = Some(Environment::uniform(Vec3::ONE).expect("radiance")), {
            // It is visible, and is uploaded for the march.
            relit
        }),
        change("the eye's place", |s| s.camera.origin += DVec3::new(0.1, 0.2, -0.1), seen),
        change("the view's direction", |s| s.camera.target += DVec3::new(0.05, 0.0, 0.02), &["march"]),
        change(
            "the medium",
            |s| s.medium = cloud(Map::Plain, DIMS, grey(Phase::Isotropic)).medium,
            &["reduce", "project", "relight", "reduce", "march"],
        ),
    ])
}

/// The phase function's moments enter when records are lit, so a new one needs no new records.
fn anisotropy() -> Axis<Change> {
    changes([
        change("nothing", |_| (), &[]),
        change("the anisotropy", |s| s.optics.phase = Phase::HenyeyGreenstein { g: 0.5 }, &["relight", "march"]),
        change("the eye's place", |s| s.camera.origin += DVec3::new(0.1, 0.2, -0.1), &["march"]),
    ])
}

/// Changes of analytic lights, with what another place of the light and another medium cost.
fn lights(moved: &'static [&'static str], medium: &'static [&'static str]) -> Axis<Change> {
    changes([
        change("nothing", |_| (), &[]),
        change(
            "the light's place",
            |s| s.lights = vec![Light::point(DVec3::new(0.5, 1.0, 0.3), Vec3::ONE).expect("a light")],
            moved,
        ),
        change(
            "the light's color",
            |s| s.lights = vec![Light::point(DVec3::new(0.5, 1.0, 0.3), Vec3::X).expect("a light")],
            &["march"],
        ),
        change("the eye's place", |s| s.camera.origin += DVec3::new(0.1, 0.2, -0.1), &["march"]),
        change("the medium", |s| s.medium = cloud(Map::Plain, DIMS, grey(Phase::Isotropic)).medium, medium),
    ])
}

/// The medium of [`scene`], for grids to be added.
fn base() -> GridMedium {
    GridMedium::new(constant(0.5), None).expect("a density")
}

fn constant(value: f32) -> Arc<Grid> {
    let map = Map::Plain.lattice(DIMS).index_to_world();
    let values = vec![value; DIMS.element_product() as usize];
    Arc::new(Grid::dense(DIMS, map, values).expect("as many values as voxels"))
}

/// Changes of the fields of a medium's optics, with what another heat and another absorption cost.
fn fields(base: &GridMedium, heat: &'static [&'static str], absorption: &'static [&'static str]) -> Axis<Change> {
    let shared = |medium: &GridMedium, share: f32| {
        let grid = constant(share);
        medium.clone().with_albedo([grid.clone(), grid.clone(), grid]).expect("shares")
    };
    let hot = |medium: &GridMedium, kelvin: f32| {
        medium.clone().with_temperature(constant(kelvin), 1.0, 1500.0).expect("a temperature")
    };
    let half = shared(base, 0.5);
    let most = shared(&half, 0.9);
    let warm = hot(&most, 1500.0);
    let white = hot(&warm, 6000.0);
    let colder = shared(&white, 0.3);
    let black = colder.clone().with_absorption(constant(0.2)).expect("an absorption");
    let to = |what, medium: GridMedium, ran| {
        let medium: Arc<dyn Medium> = Arc::new(medium);
        change(what, move |s| s.medium = Arc::clone(&medium), ran)
    };
    changes([
        change("nothing", |_| (), &[]),
        to("an albedo that varies", half, &["march"]),
        to("another", most, &["march"]),
        to("a temperature", warm, heat),
        to("another temperature", white, heat),
        to("one more albedo", colder, &["march"]),
        to("an absorption", black, absorption),
    ])
}

/// A lit cloud with surfaces.
fn surfaces() -> Scene {
    let mut scene = scene(Content::Radiance);
    scene.environment = None;
    scene.estimate.environment = None;
    scene.lights = vec![sun()];
    scene.surfaces = Some(Arc::new(room()));
    let direct = Direct { shadow: Shadow::March, surface_shadow: SurfaceShadow::Map(16) };
    scene.estimate.lights = Some(LightsEstimate::Direct(direct));
    scene
}

/// Table 1 of Giroud and Biri, with surfaces.
fn of_surfaces() -> Axis<Change> {
    let lamp = |color: Vec3| vec![Light::point(DVec3::new(0.5, 1.0, 0.3), color).expect("a light")];
    let direct = |surface_shadow| Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, surface_shadow }));
    changes([
        change("nothing", |_| (), &[]),
        change("the light's place", move |s| s.lights = lamp(Vec3::ONE), &["shadow", "shade", "march"]),
        change("the light's color", move |s| s.lights = lamp(Vec3::X), &["shade", "march"]),
        change("the eye's place", |s| s.camera.origin += DVec3::new(0.1, 0.2, -0.1), &["trace", "shade", "march"]),
        change(
            "the medium",
            |s| s.medium = cloud(Map::Plain, DIMS, grey(Phase::Isotropic)).medium,
            &["reduce", "shade", "march"],
        ),
        change("albedo", |s| s.optics.albedo = Vec3::splat(0.3), &["march"]),
        change("the surfaces", |s| s.surfaces = Some(Arc::new(room())), &["shadow", "trace", "shade", "march"]),
        change("rays for maps", move |s| s.estimate.lights = direct(SurfaceShadow::Ray), &["march"]),
    ])
}

/// Changes of the picture's number, and of what stands behind the medium. A picture costs `whole`.
fn pictures(whole: &'static [&'static str]) -> Axis<Change> {
    let none: &'static [&'static str] = &[];
    changes([
        change("nothing", |_| (), none),
        change("the picture's number", |s| s.frame = 7, whole),
        change("nothing again", |_| (), none),
        change("the steps", |s| s.quality.steps = Some(9), whole),
        change("without jitter", |s| s.quality.jitter = Jitter::None, whole),
        // Nothing that is seen depends on it then.
        change("the picture's number, unjittered", |s| s.frame = 8, none),
    ])
}

/// Of a sequence the mean is always brought up to date; all else as without it.
fn sequence() -> Case {
    let checks = "Of a sequence that is accumulated just the stages run that depend on what changed, and the mean.";
    let steps = sequence_changes();
    let permutations = steps.clone();
    Case::new("keys::sequence", checks, move |subject: &Subject, record: &mut Record| {
        let mut renderer = subject.renderer()?;
        let mut scene = scene(Content::Radiance);
        (scene.quality.jitter, scene.quality.temporal) = (Jitter::BlueNoise, true);
        renderer.render(&scene)?;
        record.each(&steps, |_, Change { change, ran: expected }| {
            change(&mut scene);
            let ran = renderer.render(&scene)?.report.ran();
            check!(ran == *expected, "{ran:?} ran, and {expected:?} should have");
            Ok(())
        })
    })
    .permutes(&permutations)
}

fn sequence_changes() -> Axis<Change> {
    changes([
        change("nothing", |_| (), &["accumulate", "upsample"]),
        change("the picture's number", |s| s.frame = 7, &["march", "accumulate", "upsample"]),
        change("the eye's place", |s| s.camera.origin.x += 0.1, &["march", "accumulate", "upsample"]),
        change("without jitter", |s| s.quality.jitter = Jitter::None, &["march", "accumulate", "upsample"]),
        // The mean of equal pictures is brought up to date all the same.
        change("the picture's number, unjittered", |s| s.frame = 8, &["accumulate", "upsample"]),
        change("not accumulated", |s| s.quality.temporal = false, &["march"]),
    ])
}

fn optics() -> Axis<Change> {
    let medium = cloud(Map::Rotated, DIMS, grey(Phase::Isotropic)).medium;
    changes([
        change("samples", |s| s.camera.samples = 3, &["march"]),
        change("the size of the picture", |s| s.camera.width = 31, &["march"]),
        change("albedo", |s| s.optics.albedo = Vec3::splat(0.3), &["march"]),
        change("extinction", |s| s.optics.extinction = Vec3::splat(2.0), &["project", "relight", "march"]),
        change("cells", |s| records(s).cells = 5, &["reduce", "project", "relight", "march"]),
        change("interpolation", |s| records(s).interpolation = airlight::scene::Interpolation::Nearest, {
            // The margin of the elimination changes with it; whether that reaches the records depends on nothing else.
            &["reduce", "project", "relight", "march"]
        }),
        change("the step", |s| s.quality.step = 0.7, &["project", "relight", "march"]),
        change(
            "the medium's place",
            move |s| s.medium = Arc::clone(&medium),
            &["reduce", "project", "relight", "reduce", "march"],
        ),
    ])
}

fn records(scene: &mut Scene) -> &mut Records {
    match &mut scene.estimate.environment {
        Some(EnvironmentEstimate::Records(records)) => records,
        None => unreachable!("the scenes here are lit by records"),
    }
}
