//! What propagated columns and shadows are worth.

use std::error::Error;
use std::fmt::Write;

use airlight::scene::{LightsEstimate, Opacity, Scheme};
use airlight_conformance::{Subject, columns, compare, pictures};

use super::{number, percent, render, told};

/// Columns at the cells' centres against the closed form.
pub(super) fn columns(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "\n## Columns toward a light\n")?;
    writeln!(
        page,
        "Giroud and Biri 2011, equation 6, and what became of it: relative L2 error of the columns at the cells' centres"
    )?;
    writeln!(
        page,
        "against the closed form of a sum of Gaussians, and after each the sum of all columns over the true one. The"
    )?;
    writeln!(page, "reference's 40 Gaussians on 72 × 48 × 60 voxels, and random sets of 30 on 64³.\n")?;
    writeln!(page, "| Gaussians, light | cells | short characteristics | sum | metric | sum | published | sum |")?;
    writeln!(page, "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    for lit in columns::all().map_err(told)? {
        for cells in [32, 64] {
            write!(page, "| {} | {cells} |", lit.name)?;
            for scheme in [Scheme::ShortCharacteristics, Scheme::Metric, Scheme::Published] {
                let found = lit.measure(subject, scheme, cells).map_err(told)?;
                write!(page, " {} | {} |", percent(found.difference.relative_l2), number(found.ratio))?;
            }
            writeln!(page)?;
        }
    }
    Ok(())
}

/// Pictures with propagated shadows against the reference's, and against marched ones.
pub(super) fn shadows(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "\n## Propagated shadows\n")?;
    writeln!(
        page,
        "The reference scene against the reference pictures, by cells; step ½ voxel, 16 samples. Gaussians are"
    )?;
    writeln!(
        page,
        "sampled on 144 cells along the longest side, with steps of one of them. The pixels around the point light are"
    )?;
    writeln!(page, "left out.\n")?;
    writeln!(page, "| picture | scheme | cells | error | seconds, all but the march |")?;
    writeln!(page, "| --- | --- | ---: | ---: | ---: |")?;
    let schemes = [
        ("short characteristics", Scheme::ShortCharacteristics, 32),
        ("short characteristics", Scheme::ShortCharacteristics, 64),
        ("short characteristics", Scheme::ShortCharacteristics, 96),
        ("metric", Scheme::Metric, 64),
        ("published", Scheme::Published, 64),
    ];
    let mut scenes = Vec::new();
    for (name, file, light) in pictures::lights() {
        let mut scene = pictures::scene().map_err(told)?;
        scene.lights = vec![light];
        scenes.push((name, file, scene));
    }
    scenes.push(("Gaussians, point", "blobs_point_single.exr", pictures::gaussians().map_err(told)?));
    for (name, file, mut scene) in scenes {
        for (text, scheme, cells) in schemes {
            scene.estimate.lights = Some(LightsEstimate::Opacity(Opacity { cells, scheme, ..Opacity::default() }));
            let run = render(subject, &scene).map_err(told)?;
            let error = pictures::against(file, &run.film).map_err(told)?.relative_l2;
            writeln!(page, "| {name} | {text} | {cells} | {} | {} |", percent(error), number(run.preparing))?;
        }
    }
    writeln!(page, "\n`direct` with shadow `propagated` (64 cells) against `march`, step 1 voxel, 4 samples.\n")?;
    writeln!(page, "| light | difference |")?;
    writeln!(page, "| --- | ---: |")?;
    for (name, file, light) in pictures::lights() {
        let pictures::Shadows { propagated, marched } = pictures::shadows(subject, file, light).map_err(told)?;
        writeln!(page, "| {name} | {} |", percent(compare(propagated, marched).relative_l2))?;
    }
    Ok(())
}
