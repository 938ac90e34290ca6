//! What making a transfer and lighting with it take: table 1.

use std::error::Error;
use std::fmt::Write;
use std::sync::Arc;
use std::time::Instant;

use airlight::exec::Rendered;
use airlight::media::Phase;
use airlight::random::{hash, unit};
use airlight::scene::{Deposit, LightBasis, Scene};
use airlight::transfer::{Channel, Origin, Shape, Transfer};

use super::{Lab, by, by_photons, compressed, media, prose, table};

/// The paper's table 1: data, voxels, millions of photons, seconds of precomputation, milliseconds of radiance and of a
/// frame.
const PUBLISHED: [(&str, &str, &str, &str, &str, &str); 7] = [
    ("smoke plume", "300 × 300 × 150", "3.6", "110", "0.8", "20"),
    ("smoke wall", "400 × 300 × 100", "3.8", "165", "0.8", "23"),
    ("aneurism", "256 × 256 × 256", "3.9", "81", "0.9", "19"),
    ("bonsai", "256 × 256 × 256", "3.9", "113", "0.9", "20"),
    ("bone", "512 × 512 × 512", "7.9", "241", "1", "23"),
    ("part", "504 × 504 × 228", "9.7", "395", "1", "25"),
    ("machine room", "417 × 345 × 60", "3", "73", "0.7", "21"),
];

/// Table 1.
pub(super) fn times(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    let (cells, functions) = lab.size((32, 162), (8, 42));
    let clusters = lab.size(128, 8);
    let [width, height] = lab.tile();
    writeln!(page, "\n## Times\n")?;
    prose(
        page,
        &format!(
            "Table 1: {functions} functions, {cells} cells, N = 1 photon along tracks, {clusters} clusters of 4 \
             components. *Relight* is a turn of the environment: its projection, and the stages `evaluate` and \
             `reconstruct`. *Frame* is a turn of the eye: `reconstruct`, where the phase function has a direction, and \
             the march of {width} × {height} pixels. Both are the least of {TIMES} times."
        ),
    )?;
    table(
        page,
        &["medium", "voxels", "transfer cells"],
        &[
            "rows",
            "channels",
            "bands",
            "photons, millions",
            "precomputation, s",
            "compression, s",
            "relight, ms",
            "frame, ms",
            "transfer, MiB",
        ],
    )?;
    for (name, scene) in [
        ("smoke of random density", media::smoke(lab)?),
        ("pillars", media::pillars(lab)?),
        ("reference cloud", media::cloud(lab)?),
        ("head", media::head(lab)?),
        ("cumulus", media::cumulus(lab)?),
    ] {
        let made = lab.make(&scene, &by_photons(cells, functions, 1.0, Deposit::Track))?;
        let begin = Instant::now();
        let transfer = Arc::new(compressed(&made.transfer, clusters, 4)?);
        let compression = begin.elapsed().as_secs_f64();
        let (relight, frame) = (relit(lab, &scene, &transfer)?.0, turned(lab, &scene, &transfer)?);
        let dims = scene.medium.lattice().dims();
        let survey = &made.survey;
        let [x, y, z] = survey.cells;
        writeln!(
            page,
            "| {name} | {} × {} × {} | {x} × {y} × {z} | {} | {} | {} | {:.2} | {:.1} | {compression:.1} | \
             {relight:.1} | {frame:.0} | {:.1} |",
            dims.x,
            dims.y,
            dims.z,
            survey.rows.len(),
            survey.channels,
            survey.bands,
            made.flown.photons as f64 * 1e-6,
            made.transport.as_secs_f64(),
            transfer.bytes() as f64 / f64::from(1 << 20),
        )?;
    }
    writeln!(page, "\nThe paper's, of 642 functions and 128 clusters:")?;
    table(page, &["data", "voxels"], &["photons, millions", "precomputation, s", "radiance, ms", "frame, ms"])?;
    for (data, voxels, photons, seconds, radiance, frame) in PUBLISHED {
        writeln!(page, "| {data} | {voxels} | {photons} | {seconds} | {radiance} | {frame} |")?;
    }
    Ok(())
}

/// Milliseconds of the stages of a picture whose names these are.
fn stages(rendered: &Rendered, names: &[&str]) -> f64 {
    let ran = rendered.report.stages.iter().filter(|stage| stage.ran && names.contains(&stage.stage));
    1e3 * ran.map(|stage| stage.time.as_secs_f64()).sum::<f64>()
}

/// How often what takes milliseconds is timed.
const TIMES: u32 = 9;

/// The least, which other work on the machine disturbs least.
fn least(values: Vec<f64>) -> f64 {
    values.into_iter().fold(f64::INFINITY, f64::min)
}

/// Milliseconds in which a turned environment lights the medium, and those of `evaluate` and of `reconstruct`.
fn relit(lab: &mut Lab<'_>, scene: &Scene, transfer: &Arc<Transfer>) -> Result<(f64, f64, f64), Box<dyn Error>> {
    let mut scene = by(scene, transfer);
    lab.renderer.render(&scene)?;
    let (mut all, mut evaluate, mut reconstruct) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..TIMES {
        if let Some(environment) = &mut scene.environment {
            environment.rotation += 25.0;
        }
        let rendered = lab.renderer.render(&scene)?;
        let (first, second) = (stages(&rendered, &["evaluate"]), stages(&rendered, &["reconstruct"]));
        if first == 0.0 || second == 0.0 {
            return Err("a turned environment was not lit anew".into());
        }
        all.push(1e3 * rendered.report.upload_time.as_secs_f64() + first + second);
        evaluate.push(first);
        reconstruct.push(second);
    }
    Ok((least(all), least(evaluate), least(reconstruct)))
}

/// Milliseconds of a picture from another place.
fn turned(lab: &mut Lab<'_>, scene: &Scene, transfer: &Arc<Transfer>) -> Result<f64, Box<dyn Error>> {
    let mut scene = by(scene, transfer);
    lab.renderer.render(&scene)?;
    let mut all = Vec::new();
    for _ in 0..TIMES {
        let arm = scene.camera.origin - scene.camera.target;
        scene.camera.origin = scene.camera.target + arm.rotate_axis(scene.camera.up.normalize(), 0.05);
        let rendered = lab.renderer.render(&scene)?;
        all.push(stages(&rendered, &["reconstruct", "march"]));
    }
    Ok(least(all))
}

/// Lighting full grids anew, whatever is in their matrices.
pub(super) fn again(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    let (cells, functions) = lab.size((64, 642), (8, 42));
    let clusters = lab.size(128, 8);
    writeln!(page, "\n## A new light\n")?;
    prose(
        page,
        &format!(
            "Every one of {cells}³ cells lit anew by {functions} functions, {clusters} clusters of 4 components, \
             matrices of random numbers; the least of {TIMES} times, milliseconds. *All* has the environment's \
             projection and uploads too. The paper has about 1 ms."
        ),
    )?;
    table(page, &["medium"], &["evaluate", "reconstruct", "all"])?;
    for (name, channels, bands) in [("grey, isotropic", 1, 1), ("coloured, isotropic", 3, 1), ("grey, 4 bands", 1, 4)] {
        let mut scene = media::smoke(lab)?;
        if channels == 3 {
            scene.optics.albedo.x = 0.9;
        }
        if bands > 1 {
            scene.optics.phase = Phase::HenyeyGreenstein { g: 0.5 };
        }
        let transfer = random(Origin::of(&scene), cells, functions, (clusters, channels, bands))?;
        let (all, evaluate, reconstruct) = relit(lab, &scene, &Arc::new(transfer))?;
        writeln!(page, "| {name} | {evaluate:.2} | {reconstruct:.2} | {all:.2} |")?;
    }
    Ok(())
}

/// A transfer of random numbers in every cell.
fn random(
    origin: Origin,
    cells: u32,
    functions: u32,
    (clusters, channels, bands): (u32, u32, u32),
) -> Result<Transfer, Box<dyn Error>> {
    let components = 4;
    let rows = cells * cells * cells;
    let values = |count: u32, seed: u32| (0..count).map(|i| unit(hash([i, seed, 0]))).collect();
    let channel = |seed: u32| Channel {
        matrices: values(clusters * (1 + components) * bands * bands * functions, 2 * seed),
        clusters: (0..rows).map(|row| hash([row, seed, 1]) % clusters).collect(),
        weights: values(rows * components, 2 * seed + 1),
        errors: vec![0.0; clusters as usize],
        loss: 0.0,
    };
    let basis = LightBasis::Discrete { functions };
    let shape = Shape { cells: [cells; 3], rows: (0..rows).collect(), basis, bands, clusters, components };
    Ok(Transfer::new(shape, origin, (0..channels).map(channel).collect())?)
}
