//! The truth of a scene by brute force in f64, single scattering, as a picture:
//! `cargo run --release -p airlight-formats --example truth -- SCENE.toml SAMPLES OUT.exr`.
//!
//! SAMPLES are sub-pixel positions, in place of the scene's. `R`, `G`, `B` are linear radiance, `A` is 1 - mean transmittance.
//! `benches/peers` holds renderers to it.

use std::path::Path;
use std::process::ExitCode;

use airlight_core::reference::{BruteForce, BruteSettings};
use airlight_formats::image::{Exr, write_exr_channels};
use airlight_formats::scene::load_scene;
use rayon::prelude::*;

/// Points on each piece of a view ray between two planes of the lattice. Columns are exact, pieces shorter than a voxel;
/// one point for two is off by a thousandth in the picture of `benches/peers`.
const NODES: usize = 2;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, samples, output] = arguments.as_slice() else {
        eprintln!("usage: truth SCENE.toml SAMPLES OUT.exr");
        return ExitCode::from(2);
    };
    match run(Path::new(scene), samples, Path::new(output)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(scene: &Path, samples: &str, output: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let scene = load_scene(scene, &[("camera.samples".to_owned(), samples.to_owned())])?.scene;
    let truth = BruteForce::new(&scene, &BruteSettings { rows: 1, nodes: NODES });
    let (width, height) = (scene.camera.width, scene.camera.height);
    let pixels: Vec<[f64; 4]> =
        (0..width * height).into_par_iter().map(|i| truth.pixel(i % width, i / width)).collect();
    let channel = |c: usize| pixels.iter().map(|p| p[c] as f32).collect();
    let channels =
        ["R", "G", "B", "A"].into_iter().enumerate().map(|(c, name)| (name.to_owned(), channel(c))).collect();
    write_exr_channels(output, Exr { width, height, channels, metadata: Vec::new() })?;
    Ok(())
}
