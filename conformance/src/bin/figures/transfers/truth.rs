//! Transfers against the reference pictures.

use std::error::Error;
use std::fmt::Write;
use std::sync::Arc;

use airlight::media::Phase;
use airlight::metric;
use airlight::scene::{Content, Deposit, Precompute};
use airlight_conformance::pictures;

use super::{Lab, apart, blocks, by_photons, direct, ordinates, prose, table, tile};
use crate::{percent, told};

/// A picture of the reference set.
struct Truth {
    file: &'static str,
    orders: &'static str,
    phase: Phase,
    direct: bool,
    /// What block means are held to.
    limit: f64,
}

/// The reference pictures, and figure 10.
pub(super) fn truth(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    writeln!(page, "\n## Against the reference pictures\n")?;
    prose(
        page,
        "The reference cloud in its environment by transfers that are not compressed, against pictures of another \
         renderer's paths. *Blocks* are means of 8 × 8 pixels. Moments have four bands unless six are said, or one where \
         light is scattered evenly; ordinates go along 48 directions, or 108 where it is scattered forward. Photons leave \
         light along their tracks, and *N* is how many there are for each cell of the box's faces and each function. Steps of \
         a voxel, 4 samples a pixel. Figure 10: [truth, transfer and ten times the difference](images/figure-10-truth.png), \
         of the last settings by ordinates of each picture: light scattered once, all orders, and all orders scattered \
         forward.",
    )?;
    table(
        page,
        &["truth", "orders", "solver"],
        &["cells", "functions", "blocks", "limit", "picture", "rows", "seconds"],
    )?;
    let forward = Phase::HenyeyGreenstein { g: 0.5 };
    let truths = [
        Truth { file: "env_single.exr", orders: "one", phase: Phase::Isotropic, direct: true, limit: 0.01 },
        Truth { file: "env_multi.exr", orders: "all", phase: Phase::Isotropic, direct: false, limit: 0.015 },
        Truth { file: "env_hg0.5_multi.exr", orders: "all, forward", phase: forward, direct: false, limit: 0.03 },
    ];
    let mut rows = Vec::new();
    for truth in truths {
        let Truth { file, orders, ref phase, limit, .. } = truth;
        let mut scene = pictures::in_environment(pictures::records(Content::Radiance, 1, 48)).map_err(told)?;
        (scene.camera.samples, scene.quality.step, scene.optics.phase) = (4, 1.0, phase.clone());
        let expected = pictures::truth(file).map_err(told)?;
        let mut shown = Vec::new();
        for (solver, options) in settings(lab, &truth) {
            let made = lab.make(&scene, &options)?;
            let (seconds, count) = (made.transport.as_secs_f64(), made.survey.rows.len());
            let found = lab.light(&scene, &Arc::new(made.transfer))?.film.beauty;
            let (cells, functions) = (options.cells, options.basis.count());
            writeln!(
                page,
                "| {file} | {orders} | {solver} | {cells} | {functions} | {} | {} | {} | {count} | {seconds:.1} |",
                percent(blocks(&found, &expected, 160).relative_l2),
                percent(limit),
                percent(metric::difference(&found, &expected).relative_l2),
            )?;
            if solver.starts_with("ordinates") {
                shown = found;
            }
        }
        let (found, expected) = (tile(&shown), tile(&expected));
        let difference = apart(&found, &expected, 10.0);
        rows.push(vec![expected, found, difference]);
    }
    lab.sheet("figure-10-truth.png", [160, 120], rows, 0.5)
}

/// Solvers by their names, and their options.
fn settings(lab: &Lab<'_>, truth: &Truth) -> Vec<(String, Precompute)> {
    if truth.direct {
        let sizes: &[(u32, u32)] = lab.size(&[(24, 642), (48, 162), (48, 642), (72, 642)], &[(16, 42)]);
        return sizes.iter().map(|&(c, f)| ("ordinates".into(), direct(ordinates(c, f)))).collect();
    }
    let isotropic = truth.phase.is_isotropic();
    let swept: &[(u32, u32)] = match isotropic {
        true => lab.size(&[(24, 162), (40, 162), (32, 642)], &[(12, 42)]),
        false => lab.size(&[(24, 162)], &[(12, 42)]),
    };
    let flown: &[(u32, u32, f64)] = match isotropic {
        true => lab.size(&[(24, 162, 10.0), (40, 162, 10.0), (40, 642, 1.0)], &[(12, 42, 1.0)]),
        false => lab.size(&[(24, 162, 10.0), (40, 162, 10.0)], &[(12, 42, 1.0)]),
    };
    let photons = |&(c, f, n): &(u32, u32, f64)| (format!("photons, N = {n}"), by_photons(c, f, n, Deposit::Track));
    let by_ordinates = swept.iter().map(|&(c, f)| ("ordinates".into(), ordinates(c, f)));
    let four: Vec<(String, Precompute)> = by_ordinates.chain(flown.iter().map(photons)).collect();
    if isotropic {
        return four;
    }
    // Four bands, as are ordinary, leave a part of the forward peak out.
    let six = four.iter().map(|(solver, options)| (format!("{solver}, 6 bands"), Precompute { bands: 6, ..*options }));
    let six: Vec<_> = six.collect();
    four.into_iter().chain(six).collect()
}
