//! What is redone when something changes, and what is not.

use std::sync::Arc;

use airlight::glam::{DVec3, Vec3};
use airlight::light::{Environment, Light};
use airlight::media::Phase;
use airlight::scene::{Content, EnvironmentEstimate, Records, Scene};
use libtest_mimic::Failed;

use crate::compare::same_bits;
use crate::fixtures::{DIMS, Map, cloud, grey, sky};
use crate::{Case, Subject, check};

pub(crate) fn cases() -> Vec<Case> {
    let contents = [Content::Radiance, Content::Transmittance, Content::Phase];
    let mut cases: Vec<_> = contents
        .into_iter()
        .map(|content| Case::new(format!("keys::{content:?}").to_lowercase(), move |subject| frames(subject, content)))
        .collect();
    cases.push(Case::new("keys::radiance_hg", radiance_hg));
    cases.push(Case::new("keys::direct", direct));
    cases.push(Case::new("keys::optics_and_picture", optics));
    cases
}

fn scene(content: Content) -> Scene {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::Isotropic));
    scene.environment = Some(sky());
    let records = Records { cells: 4, bands: 2, directions: 48, content, ..Records::default() };
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    scene
}

type Change<'a> = (&'a str, Box<dyn Fn(&mut Scene)>, &'a [&'a str]);

/// Applies the changes one after the other. After each, the stages that ran must be those listed, a second render
/// must run none, and the film must be that of a fresh device, bit for bit.
fn follow(subject: &Subject, mut scene: Scene, changes: &[Change<'_>]) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    let all = ["reduce", "project", "relight", "reduce", "march"];
    let first = renderer.render(&scene)?.report.ran();
    if scene.environment.is_some() {
        check!(first == all, "the first frame ran {first:?}");
    }
    for (what, change, expected) in changes {
        change(&mut scene);
        let rendered = renderer.render(&scene)?;
        let ran = rendered.report.ran();
        check!(ran == *expected, "{what}: {ran:?} ran, and {expected:?} should have");
        let again = renderer.render(&scene)?;
        check!(again.report.ran().is_empty(), "{what}, twice: {:?} ran", again.report.ran());
        check!(again.report.uploads.is_empty(), "{what}, twice: {:?} were uploaded", again.report.uploads);
        let fresh = subject.renderer()?.render(&scene)?;
        let bits = |film: &airlight::scene::Film| bytemuck::cast_slice::<_, f32>(&film.beauty).to_vec();
        same_bits(what, &bits(&rendered.film), &bits(&fresh.film))?;
        same_bits(what, &bits(&again.film), &bits(&fresh.film))?;
    }
    Ok(())
}

fn change<'a>(what: &'a str, f: impl Fn(&mut Scene) + 'static, ran: &'a [&'a str]) -> Change<'a> {
    (what, Box::new(f), ran)
}

fn light(scene: &mut Scene) -> &mut Environment {
    scene.environment.as_mut().expect("the scenes here have one")
}

fn frames(subject: &Subject, content: Content) -> Result<(), Failed> {
    // The stages before `march` that a new light, and a new place of the eye, cost.
    let (relit, seen): (&[&str], &[&str]) = match content {
        // The light is in the records.
        Content::Radiance => (&["project", "relight", "march"], &["march"]),
        // A new light needs no new records.
        Content::Transmittance => (&["relight", "march"], &["march"]),
        // Records look at the eye.
        Content::Phase => (&["relight", "march"], &["project", "relight", "march"]),
    };
    let changes = [
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
    ];
    follow(subject, scene(content), &changes)
}

/// The phase function's moments enter when records are lit, so a new one needs no new records.
fn radiance_hg(subject: &Subject) -> Result<(), Failed> {
    let mut scene = scene(Content::Radiance);
    scene.optics.phase = Phase::HenyeyGreenstein { g: 0.3 };
    let changes = [
        change("nothing", |_| (), &[]),
        change("the anisotropy", |s| s.optics.phase = Phase::HenyeyGreenstein { g: 0.5 }, &["relight", "march"]),
        change("the eye's place", |s| s.camera.origin += DVec3::new(0.1, 0.2, -0.1), &["march"]),
    ];
    follow(subject, scene, &changes)
}

fn direct(subject: &Subject) -> Result<(), Failed> {
    let mut scene = scene(Content::Radiance);
    scene.environment = None;
    scene.lights = vec![Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::ONE)?];
    let changes = [
        change("nothing", |_| (), &[]),
        change(
            "the light's place",
            |s| s.lights = vec![Light::point(DVec3::new(0.5, 1.0, 0.3), Vec3::ONE).expect("a light")],
            &["march"],
        ),
        change("the eye's place", |s| s.camera.origin += DVec3::new(0.1, 0.2, -0.1), &["march"]),
        change(
            "the medium",
            |s| s.medium = cloud(Map::Plain, DIMS, grey(Phase::Isotropic)).medium,
            &["reduce", "march"],
        ),
    ];
    follow(subject, scene, &changes)
}

fn optics(subject: &Subject) -> Result<(), Failed> {
    let medium = cloud(Map::Rotated, DIMS, grey(Phase::Isotropic)).medium;
    let changes = [
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
    ];
    follow(subject, scene(Content::Transmittance), &changes)
}

fn records(scene: &mut Scene) -> &mut Records {
    match &mut scene.estimate.environment {
        Some(EnvironmentEstimate::Records(records)) => records,
        None => unreachable!("the scenes here are lit by records"),
    }
}
