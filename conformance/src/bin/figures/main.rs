//! Measures every figure of the reference scene and prints it as Markdown.
//!
//! ```text
//! cargo run --release -p airlight-conformance --bin figures -- -o docs/figures.md --images docs/images
//! cargo run --release -p airlight-conformance --bin figures -- --transfers -o docs/transfers.md --images docs/images
//! ```

mod bases;
mod lights;
mod orders;
mod sequences;
mod sheet;
mod transfers;

use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use airlight::basis::{SphericalHarmonics, healpix, pixel_integrals};
use airlight::glam::DVec3;
use airlight::media::Phase;
use airlight::reference::{BruteForce, BruteSettings};
use airlight::scene::{Content, Elimination, Film, Interpolation, Records, Scene};
use airlight_conformance::{Subject, compare, pictures};
use clap::Parser;
use libtest_mimic::Failed;
use rayon::prelude::*;

/// Measures the figures of the reference scene.
#[derive(Parser)]
struct Args {
    /// Device, as `airlight --device` takes it.
    #[arg(long, default_value = "cpu")]
    device: String,
    /// Writes the page to this file instead of standard output.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes the pictures of bases or transfers to this folder.
    #[arg(long)]
    images: Option<PathBuf>,
    /// The sections on bases alone, which need no device.
    #[arg(long, conflicts_with = "transfers")]
    bases: bool,
    /// The page on precomputed transfer in place of the others, or sections of it: truth, clusters, photons, times,
    /// light, sheets.
    #[arg(long, value_name = "SECTION", num_args = 0.., value_delimiter = ',')]
    transfers: Option<Vec<transfers::Section>>,
    /// That page in sizes that show only that it works.
    #[arg(long, requires = "transfers")]
    quick: bool,
}

/// A number with three digits.
fn number(v: f64) -> String {
    format!("{v:.3}")
}

fn percent(v: f64) -> String {
    format!("{:.3} %", 100.0 * v)
}

/// One render of a scene: its film, the seconds of the stages that prepare records, and of all stages.
struct Run {
    film: Film,
    preparing: f64,
    all: f64,
}

fn render(subject: &Subject, scene: &Scene) -> Result<Run, Failed> {
    let rendered = subject.renderer()?.render(scene)?;
    let seconds: Vec<f64> = rendered.report.stages.iter().map(|s| s.time.as_secs_f64()).collect();
    // The last two are the march's own occupancy and the march.
    let preparing = seconds[..seconds.len().saturating_sub(2)].iter().sum();
    Ok(Run { film: rendered.film, preparing, all: seconds.iter().sum() })
}

fn rgb(film: &Film) -> Vec<f64> {
    film.beauty.iter().flat_map(|p| [p[0], p[1], p[2]]).map(f64::from).collect()
}

fn difference(film: &Film, truth: &Film) -> f64 {
    compare(rgb(film), rgb(truth)).relative_l2
}

/// The reference scene in its environment, quicker: steps of a voxel, four sub-pixel positions.
fn scene(records: Records) -> Result<Scene, Failed> {
    let mut scene = pictures::in_environment(records)?;
    scene.quality.step = 1.0;
    scene.camera.samples = 4;
    Ok(scene)
}

fn reference(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "## Against the reference pictures\n")?;
    writeln!(
        page,
        "Relative L2 error over RGB; alpha beside it. `samples` are sub-pixel positions, which stand for the"
    )?;
    writeln!(
        page,
        "reference's box filter. Seconds are those of the first render, with uploads, and of a machine that may have had other\nwork.\n"
    )?;
    writeln!(page, "| picture | truth | settings | samples | error | limit | alpha | seconds |")?;
    writeln!(page, "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |")?;
    for picture in pictures::pictures() {
        let found = picture.measure(subject).map_err(told)?;
        writeln!(
            page,
            "| {} | {} | {} | {} | {} | {} | {} | {:.2} |",
            picture.name,
            picture.file,
            picture.settings,
            picture.samples().map_err(told)?,
            percent(found.radiance.relative_l2),
            percent(picture.tolerance.relative_l2),
            percent(found.alpha.relative_l2),
            found.seconds
        )?;
    }
    let error = pictures::coefficient_error().map_err(told)?;
    writeln!(page, "\nThe environment's 36 coefficients differ from `sh_env.json` by at most {error:.1e}.")?;
    Ok(writeln!(page, "The point light's picture leaves out the 5 × 5 pixels around (91, 49).\n")?)
}

/// The small picture that brute force renders too: half-voxel steps, one ray a pixel.
fn small(records: Records) -> Result<Scene, Failed> {
    let mut scene = pictures::in_environment(records)?;
    scene.quality.step = 0.5;
    (scene.camera.width, scene.camera.height, scene.camera.samples) = (32, 24, 1);
    Ok(scene)
}

/// The small picture by brute force, under the light and along the directions that `transmittance` records of `bands`
/// bands have: what is left between the two is the record grid.
fn by_brute_force(scene: &Scene, bands: u32, nside: u32) -> Result<Vec<f64>, Box<dyn Error>> {
    let environment = scene.environment.as_ref().ok_or("the scene has no environment")?;
    let basis = SphericalHarmonics::new(bands)?;
    let light = environment.project_sh(&basis);
    let integrals = pixel_integrals(nside, &basis);
    let among: Vec<_> = healpix::directions(nside)
        .into_iter()
        .zip(integrals.chunks_exact(light.len()))
        .map(|(direction, b)| {
            let moment = light.iter().zip(b).map(|(f, b)| DVec3::from_array(*f) * *b).sum::<DVec3>();
            (direction, moment)
        })
        .collect();
    let brute = BruteForce::among(scene, &BruteSettings { nodes: 1, ..BruteSettings::default() }, &among);
    let (width, pixels) = (scene.camera.width, scene.camera.width * scene.camera.height);
    let pixel = |i| brute.pixel(i % width, i / width);
    Ok((0..pixels).into_par_iter().flat_map_iter(|i| pixel(i).into_iter().take(3)).collect())
}

fn cells(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "## Error against the number of cells\n")?;
    writeln!(
        page,
        "Delalandre, Gautron and Marvie 2013, figure 4. Content `transmittance`, 3 bands, 192 directions, step 1"
    )?;
    writeln!(
        page,
        "voxel, 4 samples. *Brute force* is every ray's every point under the same light along the same directions, in"
    )?;
    writeln!(
        page,
        "f64 with exact columns, on a picture of 32 × 24 pixels (records at half-voxel steps there): what is left is the"
    )?;
    writeln!(
        page,
        "record grid. *Converged* is 144 cells, two to a voxel, trilinear. *Reference* is env_single_sh3.exr.\n"
    )?;
    writeln!(
        page,
        "| cells | interpolation | against brute force | against converged | against reference | seconds, records | seconds, all |"
    )?;
    writeln!(page, "| ---: | --- | ---: | ---: | ---: | ---: | ---: |")?;
    let records = |cells| Records { cells, ..pictures::records(Content::Transmittance, 3, 192) };
    let converged = render(subject, &scene(records(144)).map_err(told)?).map_err(told)?.film;
    let brute = by_brute_force(&small(records(10)).map_err(told)?, 3, 4)?;
    for (name, interpolation) in [("trilinear", Interpolation::Trilinear), ("nearest", Interpolation::Nearest)] {
        for cells in [10, 25, 50, 100] {
            let run =
                render(subject, &scene(Records { interpolation, ..records(cells) }).map_err(told)?).map_err(told)?;
            let outside = pictures::against("env_single_sh3.exr", &run.film).map_err(told)?.relative_l2;
            let inside = difference(&run.film, &converged);
            let little = small(Records { interpolation, ..records(cells) }).map_err(told)?;
            let little = render(subject, &little).map_err(told)?.film;
            writeln!(
                page,
                "| {cells} | {name} | {} | {} | {} | {} | {} |",
                percent(compare(rgb(&little), brute.clone()).relative_l2),
                percent(inside),
                percent(outside),
                number(run.preparing),
                number(run.all)
            )?;
        }
    }
    Ok(writeln!(page)?)
}

fn probes(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "## Elimination of empty cells\n")?;
    writeln!(
        page,
        "Figure 5. 50 cells, 48 directions, 3 bands, content `transmittance`; the error is against none.\n"
    )?;
    writeln!(page, "| interpolation | elimination | error | seconds, records |")?;
    writeln!(page, "| --- | --- | ---: | ---: |")?;
    for (name, interpolation) in [("nearest", Interpolation::Nearest), ("trilinear", Interpolation::Trilinear)] {
        let records = Records { cells: 50, interpolation, ..pictures::records(Content::Transmittance, 3, 48) };
        let with = |elimination| -> Result<Run, Box<dyn Error>> {
            render(subject, &scene(Records { elimination, ..records.clone() }).map_err(told)?).map_err(told)
        };
        let whole = with(Elimination::None)?;
        writeln!(page, "| {name} | none | 0 | {} |", number(whole.preparing))?;
        for (text, elimination) in [
            ("1 probe", Elimination::Probes(1)),
            ("3³ probes", Elimination::Probes(3)),
            ("10³ probes", Elimination::Probes(10)),
            ("exact", Elimination::Exact),
        ] {
            let run = with(elimination)?;
            let error = difference(&run.film, &whole.film);
            writeln!(page, "| {name} | {text} | {error:.1e} | {} |", number(run.preparing))?;
        }
    }
    Ok(writeln!(page)?)
}

fn truncation(page: &mut String, subject: &Subject) -> Result<(), Box<dyn Error>> {
    writeln!(page, "## The whole sky and its coefficients\n")?;
    writeln!(
        page,
        "Figure 3, as numbers: what is lost where the light is truncated (`transmittance`, `phase`), and where the"
    )?;
    writeln!(
        page,
        "phase function is (`radiance`). 40 cells, trilinear, step 1 voxel, 4 samples. Henyey–Greenstein is g = 0.5.\n"
    )?;
    writeln!(page, "| medium | content | bands | directions | error against the whole sky |")?;
    writeln!(page, "| --- | --- | ---: | ---: | ---: |")?;
    let isotropic =
        [(Content::Transmittance, 2), (Content::Transmittance, 3), (Content::Transmittance, 6), (Content::Radiance, 1)];
    let hg = [3, 6, 8, 10].map(|bands| (Content::Radiance, bands));
    let toward_eye = [3, 6, 8, 10].map(|bands| (Content::Phase, bands));
    let rows =
        isotropic.into_iter().map(|row| (false, row)).chain(hg.into_iter().chain(toward_eye).map(|row| (true, row)));
    for (anisotropic, (content, bands)) in rows {
        let directions = if bands < 6 { 192 } else { 768 };
        let mut scene = scene(pictures::records(content, bands, directions)).map_err(told)?;
        let (medium, truth) = if anisotropic {
            scene.optics.phase = Phase::HenyeyGreenstein { g: 0.5 };
            ("Henyey–Greenstein", "env_hg0.5_single.exr")
        } else {
            ("isotropic", "env_single.exr")
        };
        let film = render(subject, &scene).map_err(told)?.film;
        let error = pictures::against(truth, &film).map_err(told)?.relative_l2;
        let content = format!("{content:?}").to_lowercase();
        writeln!(page, "| {medium} | {content} | {bands} | {directions} | {} |", percent(error))?;
    }
    Ok(())
}

fn told(failed: Failed) -> Box<dyn Error> {
    failed.message().unwrap_or("failed without a reason").into()
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    if args.bases {
        let mut page = String::new();
        bases::bases(&mut page, args.images.as_deref())?;
        return written(&page, args.output.as_deref());
    }
    let subject = Subject::of_choice(&args.device);
    if let Some(sections) = &args.transfers {
        return transfers::transfers(&subject, sections, args.quick, args.output.as_deref(), args.images.as_deref());
    }
    let name = subject.device().map_err(told)?.info().name.clone();
    let mut page = String::from("# Figures\n\n");
    writeln!(
        page,
        "Measured by `cargo run --release -p airlight-conformance --bin figures` on {} ({name}).\n",
        args.device
    )?;
    reference(&mut page, &subject)?;
    cells(&mut page, &subject)?;
    probes(&mut page, &subject)?;
    truncation(&mut page, &subject)?;
    lights::columns(&mut page, &subject)?;
    lights::shadows(&mut page, &subject)?;
    sequences::steps(&mut page, &subject)?;
    orders::orders(&mut page, &subject)?;
    bases::bases(&mut page, args.images.as_deref())?;
    written(&page, args.output.as_deref())
}

fn written(page: &str, output: Option<&Path>) -> Result<(), Box<dyn Error>> {
    match output {
        Some(path) => std::fs::write(path, page).map_err(|e| format!("{}: {e}", path.display()))?,
        None => print!("{page}"),
    }
    Ok(())
}
