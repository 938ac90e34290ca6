//! What few steps, jittered and accumulated, and small films are worth.

use std::error::Error;
use std::fmt::Write;

use airlight::scene::{Film, Jitter, Scene};
use airlight_conformance::{Subject, sequences};

use super::{number, percent, render, told};

/// The steps of what pictures are held to, in place of the truth.
const MANY: u32 = 2048;

/// Steps, pictures and scales against many steps at full size.
pub(super) fn steps(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "\n## Few steps, jittered and accumulated\n")?;
    writeln!(
        page,
        "Clouds under a sun and a spot with a hard rim, before surfaces, 160 × 120; against {MANY} steps a ray. The mean of"
    )?;
    writeln!(page, "64 pictures differs from that of 256 by the last column.\n")?;
    writeln!(page, "| steps | pictures | error | mean FLIP | against 256 pictures |")?;
    writeln!(page, "| ---: | ---: | ---: | ---: | ---: |")?;
    let scene = sequences::beam(160, 120).map_err(told)?;
    let film = |scene: &Scene| render(subject, scene).map(|run| run.film).map_err(told);
    let truth = film(&sequences::in_steps(&scene, MANY, Jitter::None, false))?;
    let everywhere = |film: &Film, truth: &Film| percent(sequences::error(film, truth, |_| true));
    for steps in [32, 128] {
        let film = film(&sequences::in_steps(&scene, steps, Jitter::None, false))?;
        let flip = format!("{:.5}", sequences::mean_flip(&film, &truth));
        writeln!(page, "| {steps} | unjittered | {} | {flip} | |", everywhere(&film, &truth))?;
    }
    let after = [1, 4, 16, 64, 256];
    let jittered = sequences::in_steps(&scene, 32, Jitter::BlueNoise, true);
    let mut renderer = subject.renderer().map_err(told)?;
    let films = sequences::sequence(&mut renderer, &jittered, &after).map_err(told)?;
    for (film, pictures) in films.iter().zip(after) {
        let error = everywhere(film, &truth);
        let flip = format!("{:.5}", sequences::mean_flip(film, &truth));
        let settled = everywhere(film, &films[films.len() - 1]);
        writeln!(page, "| 32 | {pictures} | {error} | {flip} | {settled} |")?;
    }
    writeln!(page, "\n## Marched small\n")?;
    writeln!(
        page,
        "The same clouds without the spot, 320 × 240: along rims (within three pixels of where depths differ by a twentieth)"
    )?;
    writeln!(
        page,
        "and away from them; steps of ½ voxel against full size, and 32 jittered steps against {MANY} steps at full size."
    )?;
    writeln!(
        page,
        "Rays are those that are marched for each pixel; seconds those of all stages in steps of ½ voxel.\n"
    )?;
    writeln!(page, "| scale | away | along rims | jittered, away | jittered, along rims | rays | seconds |")?;
    writeln!(page, "| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    let scene = sequences::scene(320, 240).map_err(told)?;
    let truth = film(&sequences::in_steps(&scene, MANY, Jitter::None, false))?;
    let fine = sequences::small(subject, &scene, None).map_err(told)?;
    let few = sequences::in_steps(&scene, 32, Jitter::BlueNoise, false);
    let coarse = sequences::small(subject, &few, Some(&truth)).map_err(told)?;
    for (scale, (fine, coarse)) in [1, 2, 4].into_iter().zip(fine.iter().zip(&coarse)) {
        let columns = [fine.away, fine.along, coarse.away, coarse.along].map(percent).join(" | ");
        writeln!(page, "| {scale} | {columns} | {:.3} | {} |", fine.rays, number(fine.seconds))?;
    }
    Ok(())
}
