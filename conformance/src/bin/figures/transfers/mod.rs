//! Precomputed transfer: Zhang, Dong and Ma 2013, tables 1 and 2, figures 10 to 15.

mod clusters;
mod media;
mod photons;
mod sheets;
mod times;
mod truth;

use std::error::Error;
use std::fmt::{self, Write};
use std::path::Path;
use std::sync::Arc;

use airlight::Renderer;
use airlight::exec::{Hooks, Precomputed, Rendered};
use airlight::metric::{self, Difference};
use airlight::scene::{
    AllEstimate, Deposit, Estimate, Film, LightBasis, Orders, Precompute, Scene, TransferEstimate, TransferSolver,
    TransferSource,
};
use airlight::stage::Photons;
use airlight::transfer::{Matrices, Shape, Transfer, compress};
use airlight_conformance::Subject;
use airlight_formats::image::ToneMap;

use super::{sheet, told, written};

/// A section of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Section {
    /// Against the reference pictures; figure 10.
    Truth,
    /// Compression; table 2.
    Clusters,
    /// The number of photons; figure 13.
    Photons,
    /// What making a transfer and lighting with it take; table 1.
    Times,
    /// Full grids lit anew.
    Light,
    /// Figures 11, 12, 14 and 15.
    Sheets,
}

/// Where pictures are rendered, and how large.
struct Lab<'a> {
    renderer: Renderer,
    quick: bool,
    images: Option<&'a Path>,
}

/// Writes the page after each section, so that what a long run has found stays.
pub(super) fn transfers(
    subject: &Subject,
    sections: &[Section],
    quick: bool,
    output: Option<&Path>,
    images: Option<&Path>,
) -> Result<(), Box<dyn Error>> {
    let mut lab = Lab { renderer: subject.renderer().map_err(told)?, quick, images };
    let mut page = String::from("# Precomputed transfer\n\n");
    let name = &subject.info().map_err(told)?.name;
    let build = if cfg!(debug_assertions) { ", as built for development" } else { "" };
    let (with, sizes) = if quick { (" --quick", ", in sizes that show only that it works") } else { ("", "") };
    prose(
        &mut page,
        &format!(
            "Zhang, Dong and Ma 2013, tables 1 and 2 and figures 10 to 15, with our media and settings beside theirs. \
             Measured by `cargo run --release -p airlight-conformance --bin figures -- --transfers{with}` on {} \
             ({name}){build}{sizes}; `--transfers photons` and so on measure one section. The paper's figures are of a \
             laptop's graphics card (GeForce GTX 460M). Errors are relative L2 over RGB, of every pixel of the \
             *picture* unless said otherwise. Cells are those along the longest side. Seconds are wall time, of a \
             machine that may have had other work.",
            subject.name()
        ),
    )?;
    let all = [Section::Truth, Section::Clusters, Section::Photons, Section::Times, Section::Light, Section::Sheets];
    for section in if sections.is_empty() { &all } else { sections } {
        match section {
            Section::Truth => truth::truth(&mut page, &mut lab)?,
            Section::Clusters => clusters::clusters(&mut page, &mut lab)?,
            Section::Photons => photons::photons(&mut page, &mut lab)?,
            Section::Times => times::times(&mut page, &mut lab)?,
            Section::Light => times::again(&mut page, &mut lab)?,
            Section::Sheets => sheets::sheets(&mut page, &mut lab)?,
        }
        if output.is_some() {
            written(&page, output)?;
        }
    }
    match output {
        Some(_) => Ok(()),
        None => written(&page, None),
    }
}

/// A paragraph in lines of at most 120 characters.
fn prose(page: &mut String, text: &str) -> fmt::Result {
    let mut column = 0;
    for word in text.split_whitespace() {
        let length = word.chars().count();
        let space = match column {
            0 => "",
            _ if column + 1 + length > 120 => "\n",
            _ => " ",
        };
        write!(page, "{space}{word}")?;
        column = if space == " " { column + 1 + length } else { length };
    }
    writeln!(page)
}

/// The head of a table: columns of words, then columns of numbers.
fn table(page: &mut String, words: &[&str], numbers: &[&str]) -> fmt::Result {
    let all: Vec<&str> = words.iter().chain(numbers).copied().collect();
    writeln!(page, "\n| {} |", all.join(" | "))?;
    writeln!(page, "|{}{}", " --- |".repeat(words.len()), " ---: |".repeat(numbers.len()))
}

/// RGB of a film, or of another picture of as many values a pixel.
type Tile = Vec<[f32; 3]>;

fn tile(pixels: &[[f32; 4]]) -> Tile {
    pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect()
}

/// `times` |a - b|.
fn apart(a: &[[f32; 3]], b: &[[f32; 3]], times: f32) -> Tile {
    a.iter().zip(b).map(|(a, b)| [0, 1, 2].map(|c| times * (a[c] - b[c]).abs())).collect()
}

fn error(found: &Film, truth: &Film) -> f64 {
    metric::difference(&found.beauty, &truth.beauty).relative_l2
}

impl Lab<'_> {
    fn size<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// Columns and rows of a picture of a sheet.
    fn tile(&self) -> [u32; 2] {
        self.size([200, 150], [40, 30])
    }

    /// Makes a transfer.
    fn make(&mut self, scene: &Scene, options: &Precompute) -> Result<Precomputed, Box<dyn Error>> {
        Ok(self.renderer.precompute(scene, options, &mut Hooks::default())?)
    }

    /// The scene in its light by a transfer.
    fn light(&mut self, scene: &Scene, transfer: &Arc<Transfer>) -> Result<Rendered, Box<dyn Error>> {
        Ok(self.renderer.render(&by(scene, transfer))?)
    }

    /// Writes rows of pictures, all multiplied so that `white` is as bright as white.
    fn sheet(&self, name: &str, size: [u32; 2], mut rows: Vec<Vec<Tile>>, white: f32) -> Result<(), Box<dyn Error>> {
        let Some(images) = self.images else { return Ok(()) };
        rows.iter_mut().flatten().flatten().flatten().for_each(|v| *v /= white);
        sheet::sheet(&images.join(name), size, &rows, ToneMap::default())
    }
}

/// The scene by a transfer alone.
fn by(scene: &Scene, transfer: &Arc<Transfer>) -> Scene {
    let estimate = TransferEstimate { source: TransferSource::Made(transfer.clone()), ..TransferEstimate::default() };
    with(scene, AllEstimate::Transfer(estimate))
}

/// The scene by an estimator of all light.
fn with(scene: &Scene, all: AllEstimate) -> Scene {
    Scene { estimate: Estimate { all: Some(all), ..Estimate::none() }, ..scene.clone() }
}

/// Without compression, by ordinates along as many directions as the bands need.
fn ordinates(cells: u32, functions: u32) -> Precompute {
    Precompute {
        cells,
        basis: LightBasis::Discrete { functions },
        solver: TransferSolver::Ordinates { directions: None },
        clusters: None,
        ..Precompute::default()
    }
}

/// Without compression, by photons.
fn by_photons(cells: u32, functions: u32, count: f64, deposit: Deposit) -> Precompute {
    Precompute {
        solver: TransferSolver::Photons { count, deposit, radius: Photons::RADIUS },
        ..ordinates(cells, functions)
    }
}

/// Light that is scattered once.
fn direct(options: Precompute) -> Precompute {
    Precompute { orders: Orders::Count(1), ..options }
}

/// Of a transfer that is whole, one of clusters.
fn compressed(whole: &Transfer, clusters: usize, components: usize) -> Result<Transfer, Box<dyn Error>> {
    let Shape { bands, basis, .. } = *whole.shape();
    let width = (bands * bands * basis.count()) as usize;
    let mut channels = Vec::new();
    for channel in whole.channels() {
        channels.push(compress(&Matrices { width, values: channel.matrices.clone() }, clusters, components));
    }
    let clusters = channels.first().map_or(0, |channel| channel.errors.len() as u32);
    let shape = Shape { clusters, components: components as u32, ..whole.shape().clone() };
    Ok(Transfer::new(shape, *whole.origin(), channels)?)
}

/// Relative L2 of a transfer's matrices, all channels together.
fn matrices_apart(found: &Transfer, truth: &Transfer) -> f64 {
    let all = |transfer: &Transfer| {
        transfer.channels().iter().flat_map(|channel| channel.matrices.clone()).map(f64::from).collect::<Vec<_>>()
    };
    airlight_conformance::compare(all(found), all(truth)).relative_l2
}

/// Relative L2 of means over blocks of 8 × 8 pixels.
fn blocks(found: &[[f32; 4]], truth: &[[f32; 4]], width: usize) -> Difference {
    metric::difference(&metric::block_means(found, width, 8), &metric::block_means(truth, width, 8))
}
