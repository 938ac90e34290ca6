//! `airlight compare`

use std::path::{Path, PathBuf};

use airlight::light::Image;
use airlight::metric::{difference, flip};
use airlight_formats::image::{ToneMap, read_image, write_png_rgb8};
use serde_json::json;

use crate::failure::Failure;
use crate::{Done, output};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The picture in question (.exr, .hdr).
    a: PathBuf,
    /// The picture to hold it to (.exr, .hdr).
    b: PathBuf,
    /// End with code 3 where the relative L2 difference is above this.
    #[arg(long, value_name = "X", value_parser = bound)]
    max_rel_l2: Option<f64>,
    /// Write FLIP per pixel as a .png: black for no difference, through red and yellow to white.
    #[arg(short, long = "output", value_name = "DIFF.png")]
    output: Option<PathBuf>,
    /// Print JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

fn bound(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v >= 0.0 && v.is_finite() => Ok(v),
        _ => Err("a finite number of at least 0 is needed".into()),
    }
}

pub(crate) fn run(options: &Options) -> Done {
    if let Some(path) = options.output.as_ref().filter(|p| p.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")))
    {
        return Err(Failure::input(format!("{}: the difference is written as .png", path.display())));
    }
    let (a, b) = (read(&options.a)?, read(&options.b)?);
    if (a.width, a.height) != (b.width, b.height) {
        return Err(Failure::input(format!(
            "{} is {} × {} pixels and {} is {} × {}; pictures must have one size to be compared",
            options.a.display(),
            a.width,
            a.height,
            options.b.display(),
            b.width,
            b.height
        )));
    }
    let d = difference(&a.texels, &b.texels);
    let (flips, mean_flip) = flips(&a.texels, &b.texels, [a.width, a.height]);
    if let Some(path) = &options.output {
        let pixels: Vec<u8> = flips.iter().flat_map(|&v| heat(v)).collect();
        write_png_rgb8(path, a.width, a.height, &pixels).map_err(Failure::output)?;
    }
    if options.json {
        output::json(&json!({
            "size": [a.width, a.height],
            "relative_l2": output::number(d.relative_l2),
            "max_abs": output::number(d.max_abs),
            "mean_ratio": d.mean_ratio.map(output::number),
            "flip": output::number(mean_flip),
            "flip_tone_map": TONE_MAP,
        }))?;
    } else {
        output::line(&format!("relative L2  {}", output::short(d.relative_l2)))?;
        output::line(&format!("max abs      {}", output::short(d.max_abs)))?;
        output::line(&format!("mean ratio   {}", output::triple(d.mean_ratio)))?;
        output::line(&format!("FLIP         {} ({TONE_MAP})", output::short(mean_flip)))?;
    }
    match options.max_rel_l2 {
        // What is not a number is not within the bound either.
        Some(bound) if d.relative_l2.is_nan() || d.relative_l2 > bound => {
            Err(Failure::short(format!("relative L2 {} is above {bound}", output::short(d.relative_l2))))
        }
        _ => Ok(()),
    }
}

/// What FLIP sees, in words.
pub(crate) const TONE_MAP: &str = "mean over pixels, clamped to 0..1 and sRGB-encoded, 67 pixels per degree";

fn read(path: &Path) -> Result<Image, Failure> {
    Ok(read_image(path)?.image)
}

/// FLIP of two pictures as a screen shows them without tone mapping: of each pixel, and the mean.
pub(crate) fn flips(a: &[[f32; 3]], b: &[[f32; 3]], [width, height]: [u32; 2]) -> (Vec<f32>, f64) {
    let display = |texels: &[[f32; 3]]| texels.iter().map(|&t| ToneMap::LINEAR.encode(t)).collect::<Vec<_>>();
    let flips = flip(&display(a), &display(b), width as usize, height as usize);
    let mean = flips.iter().map(|&v| f64::from(v)).sum::<f64>() / flips.len() as f64;
    (flips, mean)
}

/// Black, red, yellow, white.
fn heat(v: f32) -> [u8; 3] {
    [0.0, 1.0, 2.0].map(|from| ((3.0 * v - from).clamp(0.0, 1.0) * 255.0).round() as u8)
}
