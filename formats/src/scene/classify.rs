//! `medium.transfer_function`: what the values of a grid mean.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use airlight_core::media::{
    Classified, ControlPoint, LARGEST, Medium, MediumError, Preset, TransferFunction, TransferFunctionError,
};
use glam::{DVec3, Vec3};

use super::error::Fault;
use super::file::Slot;
use super::grids::{Placement, told_of};
use super::medium::{ReadVolume, placed, volume};
use super::table::{Field, Table, closest, listed};
use super::tree::Entry;

const POINT: &[&str] = &["value", "density", "albedo", "emission", "tint"];

/// Keys of other grids, and of noise, that say what a transfer function says.
const OTHERS: [&str; 7] = [
    "albedo_grid",
    "absorption_grid",
    "emission_grid",
    "temperature_grid",
    "temperature_scale",
    "temperature_reference",
    "noise",
];

/// A medium of values, as the scene describes it.
pub(super) struct Values<'a> {
    pub(super) file: Field<'a>,
    pub(super) name: Option<&'a str>,
    pub(super) bounds: Option<(DVec3, DVec3)>,
    pub(super) coarse: u32,
    pub(super) function: TransferFunction,
}

impl Values<'_> {
    /// Reads the values, unless those of the same keys are kept.
    pub(super) fn load(
        &self,
        folder: &Path,
        read: ReadVolume<'_>,
        (kept, keys): (&mut Slot<Classified>, Vec<Entry>),
        files: &mut Vec<PathBuf>,
    ) -> Result<Arc<dyn Medium>, Fault> {
        let last = kept.get(keys, files, &mut Vec::new(), |files, _| self.read(folder, read, files))?;
        let medium = last.with_function(self.function.clone());
        kept.put(medium.clone());
        Ok(Arc::new(medium))
    }

    fn read(&self, folder: &Path, read: ReadVolume<'_>, files: &mut Vec<PathBuf>) -> Result<Classified, Fault> {
        let (volume, path) = volume(folder, read, &self.file, self.name, files)?;
        let map = placed(&self.file, &path, &volume, volume.grid.bounds(), self.bounds)?;
        let told = |error: MediumError| self.file.from(told_of(&path, error));
        let values = Placement { map, coarse: self.coarse }.lay(volume.grid).map_err(told)?;
        Classified::new(values, self.function.clone()).map_err(told)
    }
}

/// The transfer function of a medium, where it has one.
pub(super) fn transfer_function(medium: &Table<'_>) -> Result<Option<TransferFunction>, Fault> {
    let Some(field) = medium.asked("transfer_function") else { return Ok(None) };
    for key in OTHERS {
        if let Some(other) = medium.asked(key) {
            return Err(
                other.from("a transfer_function says by itself what scatters, absorbs and shines; give one of them")
            );
        }
    }
    let function = match field.list() {
        Ok(points) => of_points(&field, &points)?,
        Err(_) => preset(&field)?,
    };
    let emission = medium.get("emission");
    let strength = emission.as_ref().map_or(Ok(Vec3::ZERO), |f| f.color(f32::MAX))?;
    match (function.emits(), emission.is_some()) {
        (true, false) => Err(field.from("points shine by their emission times the medium's; give emission = 1")),
        (false, true) if strength != Vec3::ZERO => {
            Err(field.from("the medium has an emission, and no point says where it shines; give a point emission = 1"))
        }
        _ => Ok(Some(function)),
    }
}

fn of_points(field: &Field<'_>, points: &[Field<'_>]) -> Result<TransferFunction, Fault> {
    // Before any is read: the list may be long.
    if points.len() > TransferFunction::MOST {
        return Err(field.from(TransferFunctionError::Count(points.len())));
    }
    let read = points.iter().map(point).collect::<Result<Vec<_>, _>>()?;
    TransferFunction::new(read).map_err(|error| match &error {
        TransferFunctionError::Order { point, .. } | TransferFunctionError::Range { point, .. } => {
            points[*point].from(&error)
        }
        TransferFunctionError::Count(_) => field.from(&error),
    })
}

fn point(field: &Field<'_>) -> Result<ControlPoint, Fault> {
    let table = field.table(POINT)?;
    let value = table.require("value", "{ value = 300, density = 0.5 }")?;
    let value = value.number_where("from -1e15 to 1e15", |v| v.abs() <= f64::from(LARGEST))?;
    let default = ControlPoint::new(value as f32, 0.0);
    let density = |f: Field<'_>| f.number_where("from 0 to 1e15", |v| (0.0..=f64::from(LARGEST)).contains(&v));
    Ok(ControlPoint {
        density: table.or("density", 0.0, density)? as f32,
        albedo: table.or("albedo", default.albedo, |f| f.color(1.0))?,
        emission: table.or("emission", default.emission, |f| f.color(LARGEST))?,
        tint: table.or("tint", default.tint, |f| f.color(1.0))?,
        ..default
    })
}

/// A preset by its name, or with options.
fn preset(field: &Field<'_>) -> Result<TransferFunction, Fault> {
    if field.text().is_ok() {
        let preset = named(field)?;
        return preset.function(preset.range).map_err(|error| field.from(error));
    }
    let table = field.table(&["preset", "density", "range"]).map_err(|fault| match field.text() {
        _ if field.is_table() => fault,
        _ => field.wrong("it must be the name of a preset, a table with one, or a list of control points"),
    })?;
    let preset = named(&table.require("preset", "transfer_function = { preset = \"ct-bone\" }")?)?;
    let range = table.or("range", preset.range, |f| {
        let ends = f.list()?;
        let [low, high] = &ends[..] else { return Err(f.wrong("it must be two values, [low, high]")) };
        let value = |f: &Field<'_>| f.number_where("from -1e15 to 1e15", |v| v.abs() <= f64::from(LARGEST));
        let (low, high) = (value(low)? as f32, value(high)? as f32);
        if low < high { Ok([low, high]) } else { Err(f.wrong("the second value must be above the first")) }
    })?;
    let factor = table.or("density", 1.0, |f| f.number_where("above 0 and at most 1e15", |v| v > 0.0 && v <= 1e15))?;
    preset.function(range).and_then(|f| f.denser(factor as f32)).map_err(|error| field.from(error))
}

fn named(field: &Field<'_>) -> Result<&'static Preset, Fault> {
    let name = field.text()?;
    let names = Preset::ALL.map(|preset| preset.name);
    Preset::named(name).ok_or_else(|| match closest(name, &names) {
        Some(meant) => field.wrong(&format!("did you mean \"{meant}\"?")),
        None => field.wrong(&format!("the presets are {}", listed(names, '"', "and"))),
    })
}
