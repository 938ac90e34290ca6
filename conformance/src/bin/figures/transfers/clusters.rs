//! Compression by clusters: table 2.

use std::error::Error;
use std::fmt::Write;
use std::sync::Arc;
use std::time::Instant;

use airlight::scene::{Precompute, Scene};

use super::{Lab, compressed, error, media, ordinates, prose, table};
use crate::percent;

/// Clusters, and the paper's error and seconds.
const PUBLISHED: [(usize, &str, &str); 4] =
    [(32, "2.2 %", "12"), (64, "1.3 %", "19"), (128, "0.9 %", "31"), (256, "0.8 %", "52")];

/// Components of a cluster beside its mean, as the paper has them.
const COMPONENTS: usize = 4;

/// Table 2.
pub(super) fn clusters(page: &mut String, lab: &mut Lab<'_>) -> Result<(), Box<dyn Error>> {
    writeln!(page, "\n## Compression by clusters\n")?;
    prose(
        page,
        "Table 2: transfers by ordinates, compressed to clusters of a mean and 4 components, against the same without \
         compression: their pictures, their matrices (of the worst channel), and the seconds of compression on the \
         host. The paper's smoke, its size and its light are not given; its seconds are of 642 functions. Ours are \
         smoke of random density, grey and isotropic; the reference cloud, forward with coloured albedo; and the head \
         of `scenes/head.toml`.",
    )?;
    table(
        page,
        &["medium"],
        &[
            "cells",
            "rows",
            "matrix",
            "channels",
            "clusters",
            "picture",
            "published",
            "matrices",
            "seconds",
            "published",
        ],
    )?;
    let few = lab.size(162, 42);
    let cells = lab.size(32, 8);
    medium(page, lab, "smoke", &media::smoke(lab)?, ordinates(cells, lab.size(642, 42)))?;
    medium(page, lab, "reference cloud", &media::forward_cloud(lab)?, ordinates(cells, few))?;
    medium(page, lab, "head", &media::head(lab)?, ordinates(cells, few))
}

fn medium(
    page: &mut String,
    lab: &mut Lab<'_>,
    name: &str,
    scene: &Scene,
    options: Precompute,
) -> Result<(), Box<dyn Error>> {
    let (cells, functions) = (options.cells, options.basis.count());
    let made = lab.make(scene, &options)?;
    let whole = Arc::new(made.transfer);
    let truth = lab.light(scene, &whole)?.film;
    let survey = made.survey;
    let (rows, moments, channels) = (survey.rows.len(), survey.bands * survey.bands, survey.channels);
    for (count, published_error, published_seconds) in PUBLISHED {
        let count = lab.size(count, count / 8);
        let begin = Instant::now();
        let transfer = compressed(&whole, count, COMPONENTS)?;
        let seconds = begin.elapsed().as_secs_f64();
        let loss = transfer.channels().iter().map(|channel| channel.loss).fold(0.0, f32::max);
        let film = lab.light(scene, &Arc::new(transfer))?.film;
        writeln!(
            page,
            "| {name} | {cells} | {rows} | {moments} × {functions} | {channels} | {count} | {} | {published_error} | \
             {} | {seconds:.1} | {published_seconds} |",
            percent(error(&film, &truth)),
            percent(loss.into()),
        )?;
    }
    Ok(())
}
