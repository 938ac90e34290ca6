//! Error and time by the number of photons: figure 13.

use std::error::Error;
use std::fmt::Write;
use std::sync::Arc;

use airlight::scene::{Deposit, Precompute, TransferSolver};

use super::{Lab, apart, by_photons, error, matrices_apart, media, ordinates, prose, table, tile};
use crate::percent;

/// What is fitted to the number of photons.
struct Run {
    count: f64,
    noise: f64,
    seconds: f64,
}

/// Figure 13.
pub(super) fn photons(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    let (cells, functions) = lab.size((32, 162), (8, 42));
    let counts = lab.size(&[0.1, 0.3, 1.0, 3.0, 10.0][..], &[0.1, 1.0][..]);
    let most: f64 = lab.size(30.0, 10.0);
    writeln!(page, "\n## The number of photons\n")?;
    let swept = lab.size(108, 12);
    prose(
        page,
        &format!(
            "Figure 13: pillars of optical depth 6 on a floor in haze, grey and isotropic, {cells} cells, {functions} \
             functions, without compression. *N* is the number of photons for each cell of the box's faces and each \
             function; one photon serves every function that shines from where it comes. Errors are against ordinates \
             along {swept} directions, whose own error is in them; *noise* is that of the matrices, by their \
             difference from N = {most}. Seconds are of all that carries light; the first row has those of direct \
             light alone. The paper's picture of N = 10 is within 1 %, and its time grows almost linearly with N."
        ),
    )?;
    table(page, &["deposit"], &["N", "photons", "picture", "matrices", "noise", "seconds"])?;
    let scene = media::pillars(lab)?;
    let truth = Arc::new(
        lab.make(
            &scene,
            &Precompute {
                solver: TransferSolver::Ordinates { directions: Some(swept) },
                ..ordinates(cells, functions)
            },
        )?
        .transfer,
    );
    let expected = lab.light(&scene, &truth)?.film;
    let direct = lab.make(&scene, &super::direct(by_photons(cells, functions, 1.0, Deposit::Track)))?;
    writeln!(page, "| none | 0 | 0 | | | | {:.1} |", direct.transport.as_secs_f64())?;
    let mut slopes = Vec::new();
    let mut row = vec![tile(&expected.beauty)];
    for (name, deposit) in
        [("track", Deposit::Track), ("collision", Deposit::Collision), ("absorption", Deposit::Absorption)]
    {
        let last = lab.make(&scene, &by_photons(cells, functions, most, deposit))?.transfer;
        let mut runs = Vec::new();
        for &count in counts {
            let made = lab.make(&scene, &by_photons(cells, functions, count, deposit))?;
            let transfer = Arc::new(made.transfer);
            let film = lab.light(&scene, &transfer)?.film;
            // The run of most photons flies those of the others too, and their difference lacks as much.
            let noise = matrices_apart(&transfer, &last) / (1.0 - count / most).sqrt();
            let seconds = made.transport.as_secs_f64();
            writeln!(
                page,
                "| {name} | {count} | {} | {} | {} | {} | {seconds:.1} |",
                made.flown.photons,
                percent(error(&film, &expected)),
                percent(matrices_apart(&transfer, &truth)),
                percent(noise),
            )?;
            if deposit == Deposit::Track && (count == 1.0 || count == 10.0) {
                let found = tile(&film.beauty);
                let difference = apart(&found, &row[0], 10.0);
                row.extend([found, difference]);
            }
            runs.push(Run { count, noise, seconds });
        }
        let (noise, time) = (slope(&runs, |run| run.noise), slope(&runs, |run| run.seconds));
        slopes.push(format!("{name} {noise:.2} (noise) and {time:.2} (seconds)"));
    }
    writeln!(page)?;
    prose(
        page,
        &format!(
            "Exponents of N, by least squares of logarithms over all rows: {}. Where counting has no bias, that of \
             noise is -½. [Figure 13](images/figure-13-photons.png): ordinates; N = 1 along tracks and ten times its \
             difference; N = 10 and the same.",
            slopes.join("; ")
        ),
    )?;
    lab.sheet("figure-13-photons.png", lab.tile(), vec![row], 1.0)
}

/// The exponent of N in a value of the runs.
fn slope(runs: &[Run], value: impl Fn(&Run) -> f64) -> f64 {
    let points: Vec<(f64, f64)> = runs.iter().map(|run| (run.count.ln(), value(run).ln())).collect();
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (xy, xx) = points.iter().fold((0.0, 0.0), |(xy, xx), p| (xy + (p.0 - x) * (p.1 - y), xx + (p.0 - x).powi(2)));
    xy / xx
}
