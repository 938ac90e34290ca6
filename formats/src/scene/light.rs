//! `[environment]` and `[[light]]`.

use std::path::{Path, PathBuf};

use airlight_core::light::{Environment, Light, LightError};
use glam::{DVec3, Vec3};

use super::error::Fault;
use super::file::Slot;
use super::table::{Field, Table};
use super::tree::Entry;
use crate::image::load_environment;

/// `[environment]` before its picture is read.
pub(super) struct Plan<'a> {
    source: Source<'a>,
    /// The keys that the picture depends on.
    keys: Vec<Entry>,
    scale: Vec3,
    rotation: f64,
    visible: bool,
}

enum Source<'a> {
    File(Field<'a>),
    Uniform(Field<'a>),
}

pub(super) fn environment<'a>(root: &Table<'a>) -> Result<Option<Plan<'a>>, Fault> {
    let Some(field) = root.wanted("environment") else { return Ok(None) };
    let table = field.table(&["file", "radiance", "scale", "rotation", "visible"])?;
    table.exclusive("file", "radiance")?;
    let source = match (table.get("file"), table.get("radiance")) {
        (Some(file), _) => {
            file.text()?;
            Source::File(file)
        }
        (None, Some(radiance)) => {
            radiance.color(f32::MAX)?;
            Source::Uniform(radiance)
        }
        (None, None) => return Err(table.fault("environment needs file = \"sky.exr\" or radiance = 1")),
    };
    Ok(Some(Plan {
        source,
        keys: table.without(&["scale", "rotation", "visible"]),
        scale: table.or("scale", Vec3::ONE, |f| f.color(f32::MAX))?,
        rotation: table.or("rotation", 0.0, |f| f.number())?,
        visible: table.or("visible", true, |f| f.flag())?,
    }))
}

impl Plan<'_> {
    /// Reads the picture, unless it is kept. Adds the file to `files` and what was strange about it to `warnings`.
    pub(super) fn load(
        self,
        folder: &Path,
        kept: &mut Slot<Environment>,
        files: &mut Vec<PathBuf>,
        warnings: &mut Vec<String>,
    ) -> Result<Environment, Fault> {
        let source = self.source;
        let mut environment = kept.get(self.keys, files, warnings, |files, warnings| match source {
            Source::File(field) => {
                let path = folder.join(field.text()?);
                let (environment, told) = load_environment(&path).map_err(|e| field.from(e))?;
                files.push(path);
                warnings.extend(told);
                Ok(environment)
            }
            Source::Uniform(field) => Environment::uniform(field.color(f32::MAX)?).map_err(|e| field.from(e)),
        })?;
        (environment.scale, environment.rotation, environment.visible) = (self.scale, self.rotation, self.visible);
        Ok(environment)
    }
}

const KINDS: &[(&str, &[&str])] = &[
    ("directional", &["to_light", "irradiance"]),
    ("point", &["position", "intensity"]),
    ("spot", &["position", "target", "intensity", "cutoff", "beam"]),
];

pub(super) fn lights(root: &Table<'_>) -> Result<Vec<Light>, Fault> {
    let Some(field) = root.asked("light") else { return Ok(Vec::new()) };
    field.list()?.iter().map(light).collect()
}

fn light(field: &Field<'_>) -> Result<Light, Fault> {
    let (kind, table) = field.kinds(None, KINDS)?;
    let color = |key, example| table.require(key, example)?.color(f32::MAX);
    let vector = |key, example| -> Result<DVec3, Fault> { table.require(key, example)?.vector() };
    let made = match kind {
        "directional" => {
            Light::directional(vector("to_light", "to_light = [0, 1, 0]")?, color("irradiance", "irradiance = 3")?)
        }
        "point" => Light::point(vector("position", "position = [0, 2, 0]")?, color("intensity", "intensity = 10")?),
        _ => {
            let angle = |f: Field<'_>| f.number_where("from 0 to 180 degrees", |v| (0.0..=180.0).contains(&v));
            let cutoff = angle(table.require("cutoff", "cutoff = 20")?)?;
            // Full intensity to three quarters of the way, as Mitsuba has it.
            let beam = table.or("beam", 0.75 * cutoff, angle)?;
            let (position, target) =
                (vector("position", "position = [0, 2, 0]")?, vector("target", "target = [0, 0, 0]")?);
            Light::spot(position, target, color("intensity", "intensity = 10")?, beam, cutoff)
        }
    };
    made.map_err(|e| {
        let key = match &e {
            LightError::Direction(_) if kind == "directional" => "to_light",
            LightError::Direction(_) => "target",
            LightError::Position(_) => "position",
            LightError::Power { what, .. } => what,
            LightError::Cone { .. } => "beam",
        };
        table.get(key).map_or_else(|| field.from(&e), |f| f.from(&e))
    })
}
