//! Media that a scene describes instead of naming a volume: sums of Gaussians, height fog, noise.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use airlight_core::media::{FractalNoise, Gaussian, Gaussians, HeightFog, Lattice, Medium, MediumError, Noise};
use glam::DVec3;

use super::error::Fault;
use super::table::{Field, Table};

pub(super) const GAUSSIANS: &[&str] = &["file", "blobs", "bounds", "cells"];
pub(super) const HEIGHT_FOG: &[&str] = &["density", "falloff", "base", "bounds", "cells"];
pub(super) const NOISE: &[&str] = &["density", "scale", "octaves", "seed", "contrast", "bounds", "cells"];
/// Keys of the noise that gives detail to a grid.
const DETAIL: &[&str] = &["scale", "octaves", "seed", "contrast"];

/// The longest file of Gaussians, in bytes.
const MAX_BYTES: u64 = 1 << 28;

/// What is described.
enum What<'a> {
    /// In the scene itself.
    Blobs(Field<'a>, Vec<Gaussian>),
    /// In a file.
    File(Field<'a>),
    HeightFog {
        density: f64,
        falloff: f64,
        base: f64,
    },
    Noise {
        density: f64,
        noise: FractalNoise,
    },
}

/// A medium that is described.
pub(super) struct Described<'a> {
    bounds: Field<'a>,
    lattice: Lattice,
    what: What<'a>,
}

impl<'a> Described<'a> {
    /// Reads the keys of a `[medium]` of such a kind.
    pub(super) fn parse(kind: &str, table: &Table<'a>) -> Result<Self, Fault> {
        let bounds = table.require("bounds", "bounds = [[0, 0, 0], [1, 1, 1]]")?;
        let (min, max) = bounds.bounds()?;
        let cells = table.or("cells", 64, |f| f.whole(1..=4096))?;
        let lattice = Lattice::of_cells(cells, min, max).map_err(|e| bounds.from(e))?;
        let density = || table.or("density", 1.0, density);
        let what = match kind {
            "gaussians" => {
                table.exclusive("file", "blobs")?;
                match table.get("file") {
                    Some(file) => {
                        file.text()?;
                        What::File(file)
                    }
                    None => {
                        let example = "blobs = [{ center = [0, 0, 0], a = 9.0, c = 2.0 }], or file = \"blobs.json\"";
                        let list = table.require("blobs", example)?;
                        let blobs = list.list()?.iter().map(blob).collect::<Result<_, _>>()?;
                        What::Blobs(list, blobs)
                    }
                }
            }
            "height-fog" => What::HeightFog {
                density: density()?,
                falloff: table.or("falloff", 1.0, |f| f.number_where("at least 0", |v| v >= 0.0))?,
                base: table.or("base", min.y, |f| f.number())?,
            },
            _ => What::Noise { density: density()?, noise: noise(table)? },
        };
        Ok(Self { bounds, lattice, what })
    }

    /// Makes the medium. Adds the files that were read to `files`.
    pub(super) fn load(&self, folder: &Path, files: &mut Vec<PathBuf>) -> Result<Arc<dyn Medium>, Fault> {
        let lattice = self.lattice.clone();
        let gaussians = |blobs, from: &Field<'_>, place: String| -> Result<Arc<dyn Medium>, Fault> {
            let medium = Gaussians::new(blobs, lattice.clone());
            Ok(Arc::new(medium.map_err(|e: MediumError| from.from(format!("{place}{e}")))?))
        };
        match &self.what {
            What::Blobs(field, blobs) => gaussians(blobs.clone(), field, String::new()),
            What::File(file) => {
                let path = folder.join(file.text()?);
                let blobs = read_blobs(&path).map_err(|e| file.from(e))?;
                let medium = gaussians(blobs, file, format!("{}: ", path.display()))?;
                files.push(path);
                Ok(medium)
            }
            What::HeightFog { density, falloff, base } => {
                let medium = HeightFog::new(*density, *falloff, *base, lattice.clone());
                Ok(Arc::new(medium.map_err(|e| self.bounds.from(e))?))
            }
            What::Noise { density, noise } => {
                let medium = Noise::new(*density, *noise, lattice.clone());
                Ok(Arc::new(medium.map_err(|e| self.bounds.from(e))?))
            }
        }
    }
}

fn density(field: Field<'_>) -> Result<f64, Fault> {
    field.number_where("from 0 to 1e15", |v| (0.0..=1e15).contains(&v))
}

fn blob(field: &Field<'_>) -> Result<Gaussian, Fault> {
    let blob = field.table(&["center", "a", "c"])?;
    Ok(Gaussian {
        center: blob.require("center", "center = [0, 0, 0]")?.vector()?,
        a: blob.require("a", "a = 9.0")?.number_where("from 1e-15 to 1e15", |v| (1e-15..=1e15).contains(&v))?,
        c: density(blob.require("c", "c = 2.0")?)?,
    })
}

/// The keys of a noise.
fn noise(table: &Table<'_>) -> Result<FractalNoise, Fault> {
    let scale = table.require("scale", "scale = 0.5, in metres")?;
    let width = scale.number_where("above 0", |v| v > 0.0)?;
    let octaves = table.or("octaves", 4, |f| f.whole(1..=FractalNoise::MAX_OCTAVES))?;
    let seed = table.or("seed", 0, |f| f.whole(0..=u32::MAX))?;
    let most = FractalNoise::MAX_CONTRAST;
    let contrast = table.or("contrast", 1.0, |f| f.number_where("from 0 to 1000", |v| (0.0..=most).contains(&v)))?;
    FractalNoise::new(width, octaves, seed, contrast).map_err(|e| scale.from(e))
}

/// The noise that gives detail to a grid.
pub(super) fn detail(field: &Field<'_>) -> Result<FractalNoise, Fault> {
    noise(&field.table(DETAIL)?)
}

/// A Gaussian as files hold it. Keys that are not known are errors, as they are in scenes.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    #[serde(alias = "b")]
    center: [f64; 3],
    a: f64,
    c: f64,
}

/// Reads a JSON list of Gaussians. Errors begin with the path, and with line and column where they have a place.
fn read_blobs(path: &Path) -> Result<Vec<Gaussian>, String> {
    let whole = |what: String| format!("{}: {what}", path.display());
    let file = File::open(path).map_err(|e| whole(e.to_string()))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| whole(e.to_string()))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(whole(format!("is longer than the {MAX_BYTES} bytes that a list of Gaussians may have")));
    }
    let entries: Vec<Entry> = serde_json::from_slice(&bytes).map_err(|e| {
        // The error ends with its own words for the place.
        let text = e.to_string();
        let what = text.split(" at line ").next().unwrap_or_default();
        let right = "the file is a list of { \"center\": [x, y, z], \"a\": 9.0, \"c\": 2.0 }";
        format!("{}:{}:{}: {what}; {right}", path.display(), e.line(), e.column())
    })?;
    let gaussian = |e: Entry| Gaussian { center: DVec3::from_array(e.center), a: e.a, c: e.c };
    Ok(entries.into_iter().map(gaussian).collect())
}
