//! Pictures beside each other: figures 11, 12, 14 and 15.

use std::error::Error;
use std::fmt::Write;
use std::sync::Arc;

use airlight::exec::Rendered;
use airlight::media::Phase;
use airlight::scene::{AllEstimate, Estimate, Film, LightBasis, LightsEstimate, Local, Path, Precompute, Scene};
use airlight::transfer::Transfer;

use super::{Lab, Tile, apart, blocks, error, media, ordinates, prose, table, tile, with};
use crate::bases::{made, three_lights};
use crate::percent;

/// Figures 11, 12, 14 and 15.
pub(super) fn sheets(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    bases(page, lab)?;
    resolution(page, lab)?;
    visualization(page, lab)
}

/// A transfer by ordinates in a basis.
fn transfer(lab: &mut Lab<'_>, scene: &Scene, options: Precompute) -> Result<Arc<Transfer>, Box<dyn Error>> {
    Ok(Arc::new(lab.make(scene, &options)?.transfer))
}

fn by_paths(lab: &mut Lab<'_>, scene: &Scene) -> Result<Rendered, Box<dyn Error>> {
    let samples = lab.size(128, 4);
    Ok(lab.renderer.render(&with(scene, AllEstimate::Path(Path { samples, ..Path::default() })))?)
}

/// Bases and their names.
fn light_bases(lab: &Lab<'_>) -> Vec<(String, LightBasis)> {
    let sh = |bands: u32| (format!("SH, {bands} bands ({})", bands * bands), LightBasis::Harmonics { bands });
    let srbf = |functions| (format!("SRBF {functions}"), LightBasis::Radial { functions });
    let dsf = |functions| (format!("DSF {functions}"), LightBasis::Discrete { functions });
    lab.size(vec![sh(6), sh(13), srbf(162), dsf(162), dsf(642)], vec![sh(2), srbf(42), dsf(42)])
}

/// Figure 11.
fn bases(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    let cells = lab.size(32, 8);
    writeln!(page, "\n## Bases of the light\n")?;
    prose(
        page,
        &format!(
            "Figure 11: the pillars under three coloured lights of 15° in radius before grey, and under \
             `scenes/sunset.exr`, by transfers of {cells} cells by ordinates without compression, against `path`, over \
             blocks of 8 × 8 pixels. The paper has 676 harmonics, 642 radial and 642 discrete functions. Harmonics and \
             radial functions shine from everywhere, and each is carried along every direction: ours are as many as \
             discrete functions of the next smaller number. [Pictures](images/figure-11-bases.png): paths, then the \
             bases in the table's order; below each five times its difference."
        ),
    )?;
    table(page, &["light", "basis"], &["blocks", "least radiance", "seconds"])?;
    let scene = media::pillars(lab)?;
    let mut transfers = Vec::new();
    for (name, basis) in light_bases(lab) {
        let made = lab.make(&scene, &Precompute { basis, ..ordinates(cells, 162) })?;
        transfers.push((name, made.transport.as_secs_f64(), Arc::new(made.transfer)));
    }
    let mut rows = Vec::new();
    for (light, mut environment) in [("three lights", made(three_lights)?), ("sunset", media::sky("sunset.exr")?)] {
        environment.visible = false;
        let scene = Scene { environment: Some(environment), ..scene.clone() };
        let paths = by_paths(lab, &scene)?;
        // Of means of 8 × 8 pixels.
        let noise = paths.report.paths.map_or(0.0, |run| run.noise) / 8.0;
        let truth = tile(&paths.film.beauty);
        writeln!(page, "| {light} | `path`, its own noise | {} | | |", percent(noise))?;
        let (mut above, mut below) = (vec![truth.clone()], vec![vec![[0.0; 3]; truth.len()]]);
        for (name, seconds, transfer) in &transfers {
            let film = lab.light(&scene, transfer)?.film;
            let found = tile(&film.beauty);
            let least = found.as_flattened().iter().copied().fold(f32::INFINITY, f32::min);
            writeln!(
                page,
                "| {light} | {name} | {} | {least:.3} | {seconds:.1} |",
                percent(blocks(&film.beauty, &paths.film.beauty, lab.tile()[0] as usize).relative_l2)
            )?;
            below.push(apart(&found, &truth, 5.0));
            above.push(found);
        }
        let white = bright(&paths.film);
        rows.extend([above, below].map(|row| row.into_iter().map(|tile| scaled(tile, white)).collect()));
    }
    lab.sheet("figure-11-bases.png", lab.tile(), rows, 1.0)
}

/// What is to be as bright as white: three times the mean of what the film shows.
fn bright(film: &Film) -> f32 {
    let (sum, alpha) =
        film.beauty.iter().fold((0.0, 0.0), |(sum, alpha), p| (sum + p[0].max(p[1]).max(p[2]), alpha + p[3]));
    3.0 * sum / alpha.max(f32::MIN_POSITIVE)
}

fn scaled(tile: Tile, white: f32) -> Tile {
    tile.into_iter().map(|pixel| pixel.map(|v| v / white)).collect()
}

/// Figure 12.
fn resolution(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    let (fine, functions) = lab.size((48, 162), (12, 42));
    writeln!(page, "\n## Resolution\n")?;
    prose(
        page,
        &format!(
            "Figure 12: the pillars under one directional light by transfers of {fine} and of {} cells, {functions} \
             functions, by ordinates. The paper halves its data, and finds 4.3 %; ours keep theirs for the eye. \
             [Pictures](images/figure-12-resolution.png): fine, coarse, and ten times the difference.",
            fine / 2
        ),
    )?;
    table(page, &[], &["cells", "rows", "seconds", "picture, against the finer"])?;
    let mut scene = media::pillars(lab)?;
    (scene.environment, scene.lights) = (None, vec![media::sun([0.5, 0.9, 0.7], 6.0)?]);
    let mut films: Vec<Film> = Vec::new();
    for cells in [fine, fine / 2] {
        let made = lab.make(&scene, &ordinates(cells, functions))?;
        let (seconds, rows) = (made.transport.as_secs_f64(), made.survey.rows.len());
        let film = lab.light(&scene, &Arc::new(made.transfer))?.film;
        let against = films.first().map_or(String::new(), |finer| percent(error(&film, finer)));
        writeln!(page, "| {cells} | {rows} | {seconds:.1} | {against} |")?;
        films.push(film);
    }
    let [finer, coarser] = [&films[0], &films[1]].map(|film| tile(&film.beauty));
    let difference = apart(&coarser, &finer, 10.0);
    lab.sheet("figure-12-resolution.png", lab.tile(), vec![vec![finer, coarser, difference]], bright(&films[0]))
}

/// Figures 14 and 15.
fn visualization(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    let (cells, functions) = lab.size((32, 162), (8, 42));
    let mut scene = media::head(lab)?;
    scene.optics.phase = Phase::Isotropic;
    scene.environment = None;
    let (key, back) = (media::sun([0.9, -0.2, 1.0], 9.0)?, media::sun([-0.7, -0.6, 0.2], 9.0)?);
    let discrete = transfer(lab, &scene, ordinates(cells, functions))?;
    scene.lights = vec![key];
    let estimate = Estimate { lights: Some(LightsEstimate::Local(Local::default())), ..Estimate::none() };
    let local = lab.renderer.render(&Scene { estimate, ..scene.clone() })?.film;
    let keyed = lab.light(&scene, &discrete)?.film;
    scene.lights.push(back);
    let both = lab.light(&scene, &discrete)?.film;
    writeln!(page, "\n## Volume visualization\n")?;
    prose(
        page,
        &format!(
            "Figure 14: the head of `scenes/head.toml`, isotropic, by [`local` under a key light; by a transfer of \
             {cells} cells and {functions} functions under the same; and under another from behind \
             too](images/figure-14-local.png). Each is as bright as its own mean asks for."
        ),
    )?;
    let row = [&local, &keyed, &both].map(|film| scaled(tile(&film.beauty), bright(film)));
    lab.sheet("figure-14-local.png", lab.tile(), vec![row.to_vec()], 1.0)?;

    scene.lights.clear();
    scene.environment = Some(media::sky("sunset.exr")?);
    let bands = lab.size(6, 2);
    let smooth =
        transfer(lab, &scene, Precompute { basis: LightBasis::Harmonics { bands }, ..ordinates(cells, functions) })?;
    let (smooth, sharp) = (lab.light(&scene, &smooth)?.film, lab.light(&scene, &discrete)?.film);
    let paths = by_paths(lab, &scene)?.film;
    let off = |film: &Film| percent(blocks(&film.beauty, &paths.beauty, lab.tile()[0] as usize).relative_l2);
    writeln!(page)?;
    prose(
        page,
        &format!(
            "Figure 15: the same under `scenes/sunset.exr`, whose sun stands in it, by [SH of {bands} bands, DSF \
             {functions} and `path`](images/figure-15-sh-dsf.png). Against paths, over such blocks, the first is off \
             by {} and the second by {}.",
            off(&smooth),
            off(&sharp)
        ),
    )?;
    let row = [&smooth, &sharp, &paths].map(|film| tile(&film.beauty));
    lab.sheet("figure-15-sh-dsf.png", lab.tile(), vec![row.to_vec()], bright(&paths))
}
