//! All orders of scattering, and records by sweeps.

use std::error::Error;
use std::fmt::Write;

use airlight::media::Optics;
use airlight::scene::{Content, Orders, Records, ScatteringEstimate, Solver, Sweeps};
use airlight_conformance::{Subject, pictures, scattering};

use super::{difference, percent, render, scene, told};

/// The sections on sweeps.
pub(super) fn orders(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    pictures_of_all_orders(page, subject)?;
    convergence(page, subject)?;
    swept_records(page, subject)
}

fn pictures_of_all_orders(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "## All orders of scattering\n")?;
    writeln!(
        page,
        "Relative L2 of means over blocks of 8 × 8 pixels, against path traced pictures of another renderer.\n"
    )?;
    writeln!(page, "| picture | by | blocks, relative L2 | limit |\n| --- | --- | --- | --- |")?;
    for picture in scattering::multiple() {
        let found = picture.measure(subject).map_err(told)?;
        let limit = percent(picture.tolerance.relative_l2);
        writeln!(page, "| {} | {} | {} | {limit} |", picture.file, picture.settings, percent(found.relative_l2))?;
    }
    Ok(writeln!(page)?)
}

/// Sweeps until convergence, by albedo.
fn convergence(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(
        page,
        "Sweeps until one changes no more than 10⁻³ of the light, and plainly, without acceleration, in the"
    )?;
    writeln!(page, "reference density of up to 22 optical depths under its environment; 32 cells, 48 directions.\n")?;
    writeln!(page, "| albedo | sweeps | error | as many plain orders, error |\n| --- | --- | --- | --- |")?;
    for albedo in [0.5, 0.9, 0.99, 0.999, 1.0] {
        let at = |orders: Orders| -> Result<_, Box<dyn Error>> {
            let mut scene = pictures::in_environment(Records::default()).map_err(told)?;
            scene.optics = Optics::grey(54.0, albedo);
            (scene.camera.width, scene.camera.height, scene.camera.samples) = (80, 60, 1);
            let sweeps = Sweeps { cells: 32, orders, ..Sweeps::default() };
            scene.estimate.scattering = Some(ScatteringEstimate::Sweeps(sweeps));
            Ok(subject.renderer().map_err(told)?.render(&scene)?)
        };
        let truth = at(Orders::Converged { tolerance: 1e-6 })?;
        let found = at(Orders::default())?;
        let sweeps = found.report.solved.first().map_or(0, |solved| solved.sweeps);
        let plain = at(Orders::Count(sweeps + 1))?;
        let error = |film| percent(difference(film, &truth.film));
        writeln!(page, "| {albedo} | {sweeps} | {} | {} |", error(&found.film), error(&plain.film))?;
    }
    Ok(writeln!(page)?)
}

fn swept_records(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "## Records by sweeps\n")?;
    writeln!(
        page,
        "Against records by marches at the same cells along the same 48 directions: relative L2 of the picture,"
    )?;
    writeln!(page, "and the seconds of the stages that make the records.\n")?;
    writeln!(
        page,
        "| content | cells | sweeps against marches | sweeps, s | marches, s |\n| --- | --- | --- | --- | --- |"
    )?;
    for content in [Content::Radiance, Content::Transmittance] {
        for cells in [25, 50, 72] {
            let by = |solver| {
                let records = Records { cells, solver, ..pictures::records(content, 3, 48) };
                render(subject, &scene(records)?)
            };
            let (swept, marched) = (by(Solver::Sweep).map_err(told)?, by(Solver::March).map_err(told)?);
            writeln!(
                page,
                "| {} | {cells} | {} | {:.3} | {:.3} |",
                format!("{content:?}").to_lowercase(),
                percent(difference(&swept.film, &marched.film)),
                swept.preparing,
                marched.preparing
            )?;
        }
    }
    Ok(writeln!(page)?)
}
