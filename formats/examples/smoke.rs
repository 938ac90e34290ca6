//! Makes the smoke of `scenes/smoke.toml`: `cargo run --release -p airlight-formats --example smoke -- OUT.json`.
//!
//! A plume over a small fire: Gaussians along a column that widens and sways as it rises, heaped around puffs that stand
//! off its axis in turn, so that it billows. Near the source they are small and dense; further up they spread, and what
//! they hold is thinned by the volume they take. Everything follows from the constants below.

use std::fmt::Write as _;
use std::path::PathBuf;

use airlight_core::glam::DVec3;
use airlight_core::random::{hash, unit};

/// Puffs, and Gaussians in each.
const PUFFS: u32 = 40;
const EACH: u32 = 20;
/// Height of the plume, metres.
const HEIGHT: f64 = 2.6;

/// A number from `low` to `high` for a puff, a Gaussian in it and a purpose.
fn between(low: f64, high: f64, puff: u32, blob: u32, purpose: u32) -> f64 {
    low + (high - low) * f64::from(unit(hash([puff, blob, purpose, 2011])))
}

fn direction(puff: u32, blob: u32, purpose: u32) -> DVec3 {
    let y = between(-1.0, 1.0, puff, blob, purpose);
    let phi = between(0.0, std::f64::consts::TAU, puff, blob, purpose + 1);
    let r = (1.0 - y * y).sqrt();
    DVec3::new(r * phi.cos(), y, r * phi.sin())
}

/// The middle of the plume at a height: it leans with a light wind and sways about that.
fn axis(y: f64) -> DVec3 {
    DVec3::new(0.10 * y * y + 0.10 * (2.6 * y).sin() * y.min(1.0), y, 0.07 * (3.4 * y + 0.8).sin() * y.min(1.0))
}

fn main() {
    let Some(out) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: smoke OUT.json");
        std::process::exit(2);
    };
    let mut text = String::from("[\n");
    for puff in 0..PUFFS {
        let share = (f64::from(puff) + between(0.0, 1.0, puff, 0, 0)) / f64::from(PUFFS);
        let y = HEIGHT * share.powf(1.1);
        let wide = 0.035 + 0.16 * y.powf(0.9);
        // Puffs stand off the axis at angles of the golden section.
        let turn = f64::from(puff) * 2.399_963;
        let middle = axis(y) + DVec3::new(turn.cos(), 0.0, turn.sin()) * 0.55 * wide;
        for blob in 0..EACH {
            let radius = wide * between(0.0, 1.0, puff, blob, 1).cbrt();
            let center = middle + direction(puff, blob, 2) * radius * DVec3::new(1.0, 0.8, 1.0);
            let width = wide * between(0.13, 0.4, puff, blob, 4);
            // The plume thins as it widens and as its end is reached.
            let thinning = (0.11 / (0.05 + wide)).powf(1.3) * (1.0 - share.powi(4));
            let c = thinning * between(0.35, 1.0, puff, blob, 5) * (0.27 * wide / width).powf(0.8);
            let [x, y, z] = center.to_array();
            let last = puff + 1 == PUFFS && blob + 1 == EACH;
            // Writing to a String cannot fail.
            let _ =
                write!(text, "  {{ \"center\": [{x:.4}, {y:.4}, {z:.4}], \"a\": {:.3}, \"c\": {c:.4} }}", 1.0 / width);
            text += if last { "\n" } else { ",\n" };
        }
    }
    text += "]\n";
    if let Err(error) = std::fs::write(&out, text) {
        eprintln!("{}: {error}", out.display());
        std::process::exit(1);
    }
}
