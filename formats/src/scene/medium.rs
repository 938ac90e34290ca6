//! `[medium]`: first what the scene says, then the volumes it names.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use airlight_core::media::{
    Classified, Detailed, FractalNoise, Grid, Homogeneous, IndexBox, Lattice, Medium, MediumError, Optics, Phase,
    PhaseTable,
};
use glam::{DAffine3, DVec3, Vec3};

use super::classify::{self, Values};
use super::described::{self, Described};
use super::error::Fault;
use super::file::Slot;
use super::grids::{self, Grids, Placement};
use super::table::{Field, Table};
use super::tree::Entry;
use crate::FormatError;
use crate::volume::Volume;

/// Reads one grid of a volume file: [`crate::volume::read`], or what a test puts in its place.
pub(super) type ReadVolume<'a> = &'a dyn Fn(&Path, Option<&str>) -> Result<Volume, FormatError>;

const OPTICS: &[&str] = &["extinction", "albedo", "anisotropy", "phase", "emission"];
const GRID: &[&str] = &["file", "grid", "bounds", "coarse", "transfer_function", "noise"];
const HOMOGENEOUS: &[&str] = &["density", "bounds"];

const PHASES: &[(&str, &[&str])] = &[
    ("isotropic", &[]),
    ("henyey-greenstein", &["g"]),
    ("rayleigh", &[]),
    ("double-hg", &["forward", "backward", "weight"]),
    ("table", &["angles", "values"]),
];

/// Where the density comes from.
enum Source<'a> {
    /// From values that stay where their meaning changes.
    Values(Values<'a>),
    Whole(Whole<'a>),
}

/// A medium that is kept, or made anew as a whole.
enum Whole<'a> {
    Homogeneous {
        density: f32,
        bounds: Field<'a>,
    },
    Grid {
        file: Field<'a>,
        name: Option<&'a str>,
        bounds: Option<(DVec3, DVec3)>,
        coarse: u32,
        grids: Grids<'a>,
        detail: Option<FractalNoise>,
    },
    Described(Described<'a>),
}

/// A medium as the scene describes it, before any volume is read.
pub(super) struct Plan<'a> {
    pub(super) optics: Optics,
    /// The keys that the density depends on.
    keys: Vec<Entry>,
    source: Source<'a>,
}

pub(super) fn parse<'a>(root: &Table<'a>) -> Result<Plan<'a>, Fault> {
    let medium = root.require("medium", "[medium] with kind = \"grid\" and file = \"cloud.vdb\"")?;
    let keys = |own: &[&'static str]| [OPTICS, own].concat();
    let (grid, homogeneous) = ([keys(GRID), grids::KEYS.to_vec()].concat(), keys(HOMOGENEOUS));
    let gaussians = keys(described::GAUSSIANS);
    let (height_fog, noise) = (keys(described::HEIGHT_FOG), keys(described::NOISE));
    let (kind, table) = medium.kinds(
        None,
        &[
            ("grid", &grid),
            ("gaussians", &gaussians),
            ("homogeneous", &homogeneous),
            ("height-fog", &height_fog),
            ("noise", &noise),
        ],
    )?;
    let optics = optics(&table)?;
    let source = match kind {
        "homogeneous" => {
            let bounds = table.require("bounds", "bounds = [[0, 0, 0], [1, 1, 1]]")?;
            bounds.bounds()?;
            let density = table.or("density", 1.0, |f| f.number_where("at least 0", |v| v >= 0.0))?;
            Source::Whole(Whole::Homogeneous { density: density as f32, bounds })
        }
        "grid" => grid_source(&table)?,
        other => Source::Whole(Whole::Described(Described::parse(other, &table)?)),
    };
    Ok(Plan { optics, keys: table.without(OPTICS), source })
}

fn grid_source<'a>(table: &Table<'a>) -> Result<Source<'a>, Fault> {
    let file = table.require("file", "file = \"cloud.vdb\"")?;
    file.text()?;
    let name = table.get("grid").map(|f| f.text()).transpose()?;
    let bounds = table.get("bounds").map(|f| f.bounds()).transpose()?;
    let coarse = grids::coarse(table)?;
    if let Some(function) = classify::transfer_function(table)? {
        return Ok(Source::Values(Values { file, name, bounds, coarse, function }));
    }
    let grids = Grids::parse(table)?;
    let detail = table.wanted("noise").map(|f| described::detail(&f)).transpose()?;
    Ok(Source::Whole(Whole::Grid { file, name, bounds, coarse, grids, detail }))
}

fn optics(table: &Table<'_>) -> Result<Optics, Fault> {
    table.exclusive("anisotropy", "phase")?;
    let g = |f: Field<'_>| f.number_where("above -1 and below 1", |g| g.abs() < 1.0);
    let phase = match (table.get("anisotropy"), table.get("phase")) {
        (Some(field), _) => match g(field)? {
            0.0 => Phase::Isotropic,
            g => Phase::HenyeyGreenstein { g },
        },
        (None, Some(field)) => phase(&field)?,
        (None, None) => Phase::Isotropic,
    };
    Ok(Optics {
        extinction: table.or("extinction", Vec3::ONE, |f| f.color(f32::MAX))?,
        albedo: table.or("albedo", Vec3::ONE, |f| f.color(1.0))?,
        emission: table.or("emission", Vec3::ZERO, |f| f.color(f32::MAX))?,
        phase,
    })
}

fn phase(field: &Field<'_>) -> Result<Phase, Fault> {
    let (kind, table) = field.kinds(None, PHASES)?;
    let g = |key, example| table.require(key, example)?.number_where("above -1 and below 1", |g| g.abs() < 1.0);
    Ok(match kind {
        "isotropic" => Phase::Isotropic,
        "rayleigh" => Phase::Rayleigh,
        "henyey-greenstein" => Phase::HenyeyGreenstein { g: g("g", "g = 0.5")? },
        "double-hg" => Phase::DoubleHenyeyGreenstein {
            forward: g("forward", "forward = 0.8")?,
            backward: g("backward", "backward = -0.3")?,
            weight: table
                .require("weight", "weight = 0.9")?
                .number_where("from 0 to 1", |w| (0.0..=1.0).contains(&w))?,
        },
        _ => {
            let numbers = |key, example| -> Result<Vec<f64>, Fault> {
                table.require(key, example)?.list()?.iter().map(Field::number).collect()
            };
            let angles = numbers("angles", "angles = [0, 90, 180]")?;
            let values = numbers("values", "values = [2, 0.5, 1]")?;
            Phase::Table(Arc::new(PhaseTable::new(&angles, &values).map_err(|e| field.from(e))?))
        }
    })
}

impl Plan<'_> {
    /// Reads the volumes, unless the medium is kept. Adds the files to `files`.
    pub(super) fn load(
        &self,
        folder: &Path,
        read: ReadVolume<'_>,
        (kept, values): (&mut Slot<Arc<dyn Medium>>, &mut Slot<Classified>),
        files: &mut Vec<PathBuf>,
    ) -> Result<Arc<dyn Medium>, Fault> {
        let source = match &self.source {
            Source::Values(medium) => {
                let keys = self.keys.iter().filter(|e| e.key != "transfer_function").cloned().collect();
                return medium.load(folder, read, (values, keys), files);
            }
            Source::Whole(source) => source,
        };
        kept.get(self.keys.clone(), files, &mut Vec::new(), |files, _| source.read(folder, read, files))
    }
}

impl Whole<'_> {
    fn read(&self, folder: &Path, read: ReadVolume<'_>, files: &mut Vec<PathBuf>) -> Result<Arc<dyn Medium>, Fault> {
        match self {
            Self::Homogeneous { density, bounds } => {
                let (min, max) = bounds.bounds()?;
                Ok(Arc::new(Homogeneous::new(*density, min, max).map_err(|e| bounds.from(e))?))
            }
            Self::Described(described) => described.load(folder, files),
            Self::Grid { file, name, bounds, coarse, grids, detail } => {
                let (density, path) = volume(folder, read, file, *name, files)?;
                let grid =
                    |key: &Field<'_>| read(&path, Some(key.text()?)).map(|volume| volume.grid).map_err(|e| key.from(e));
                let reaching = grids.reaching(&grid)?;
                let map = placed(file, &path, &density, reaching.window(&density.grid), *bounds)?;
                let placement = Placement { map, coarse: *coarse };
                let medium = Arc::new(grids.medium((file, &path), (density.grid, reaching), &placement, &grid)?);
                Ok(match detail {
                    Some(noise) => Arc::new(Detailed::new(medium, *noise)),
                    None => medium,
                })
            }
        }
    }
}

/// Reads the grid that a scene names first, and its path.
pub(super) fn volume(
    folder: &Path,
    read: ReadVolume<'_>,
    file: &Field<'_>,
    name: Option<&str>,
    files: &mut Vec<PathBuf>,
) -> Result<(Volume, PathBuf), Fault> {
    let path = folder.join(file.text()?);
    let volume = read(&path, name).map_err(|e| file.from(e))?;
    files.push(path.clone());
    Ok((volume, path))
}

/// The map of the world that takes the box of a volume's `window` to where the scene has it; none where it lies already.
pub(super) fn placed(
    file: &Field<'_>,
    path: &Path,
    volume: &Volume,
    window: IndexBox,
    bounds: Option<(DVec3, DVec3)>,
) -> Result<Option<DAffine3>, Fault> {
    match bounds {
        Some(bounds) => refit(&volume.grid, window, bounds).map(Some).map_err(|e| file.from(grids::told_of(path, e))),
        None if !volume.placed => {
            let what = "does not say where its box lies; give bounds = [[x, y, z], [x, y, z]] in metres";
            Err(file.from(format!("{} {what}", path.display())))
        }
        None => Ok(None),
    }
}

/// The map of the world that takes the (axis-aligned) box of the grids' `window` onto `bounds`.
fn refit(density: &Grid, window: IndexBox, (min, max): (DVec3, DVec3)) -> Result<DAffine3, MediumError> {
    let first = DAffine3::from_translation(window.min.as_dvec3());
    let (low, high) = Lattice::new(window.dims, density.index_to_world() * first)?.world_bounds();
    let scale = DAffine3::from_scale((max - min) / (high - low));
    Ok(DAffine3::from_translation(min) * scale * DAffine3::from_translation(-low))
}
