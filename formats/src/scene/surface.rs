//! `[[surface]]`: files and shapes, what they are made of and where they stand.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use airlight_core::scene::{Material, Mesh, Placement, Shape};
use glam::{DVec3, Vec3};

use super::LoadedSurface;
use super::error::Fault;
use super::file::Slot;
use super::table::{Field, Table};
use crate::mesh;

const KEYS: &[&str] = &["file", "shape", "material", "position", "rotation", "scale"];
/// The least and the largest size of a factor of `scale`.
const SCALES: (f64, f64) = (1e-9, 1e9);

enum Source<'a> {
    File(Field<'a>),
    Shape(&'a str, Shape),
}

/// What a scene says of a material; the rest is as the file or the default has it.
#[derive(Default)]
struct Changes {
    diffuse: Option<Vec3>,
    specular: Option<Vec3>,
    shininess: Option<f32>,
}

/// A `[[surface]]` before its file is read.
pub(super) struct Plan<'a> {
    field: Field<'a>,
    table: Table<'a>,
    source: Source<'a>,
    changes: Changes,
    placement: Placement,
}

pub(super) fn parse<'a>(root: &Table<'a>) -> Result<Vec<Plan<'a>>, Fault> {
    let Some(list) = root.asked("surface") else { return Ok(Vec::new()) };
    list.list()?.into_iter().map(surface).collect()
}

fn surface(field: Field<'_>) -> Result<Plan<'_>, Fault> {
    let table = field.table(KEYS)?;
    table.exclusive("file", "shape")?;
    let source = match table.get("file") {
        Some(file) => {
            file.text()?;
            Source::File(file)
        }
        None => {
            let shape = table.require("shape", "shape = \"plane\", or file = \"room.obj\"")?;
            Source::Shape(shape.text()?, shape.choice(&Shape::NAMES.map(|(name, shape)| (name, Some(shape))))?)
        }
    };
    let default = Placement::default();
    let placement = Placement {
        position: table.or("position", default.position, |f| f.vector())?,
        rotation: table.or("rotation", default.rotation, |f| f.vector())?,
        scale: table.or("scale", default.scale, |f| scale(&f))?,
    };
    let changes = table.get("material").map(|f| changes(&f)).transpose()?.unwrap_or_default();
    Ok(Plan { field, table, source, changes, placement })
}

fn scale(field: &Field<'_>) -> Result<DVec3, Fault> {
    let v = field.number_or_vector()?;
    let (least, most) = SCALES;
    if v.to_array().iter().all(|v| (least..=most).contains(&v.abs())) {
        return Ok(v);
    }
    let what = format!("each factor must be from {least:e} to {most:e} in size; a negative one mirrors");
    Err(field.wrong(&what))
}

fn changes(field: &Field<'_>) -> Result<Changes, Fault> {
    let table = field.table(&["diffuse", "specular", "shininess"])?;
    let color = |key| table.get(key).map(|f| f.color(1.0)).transpose();
    let most = f64::from(Material::MAX_SHININESS);
    let words = format!("from 0 to {most}");
    let exponent = |f: Field<'_>| f.number_where(&words, |v| (0.0..=most).contains(&v));
    let shininess = table.get("shininess").map(exponent).transpose()?.map(|v| v as f32);
    Ok(Changes { diffuse: color("diffuse")?, specular: color("specular")?, shininess })
}

impl Changes {
    fn apply(&self, material: Material) -> Material {
        Material {
            diffuse: self.diffuse.unwrap_or(material.diffuse),
            specular: self.specular.unwrap_or(material.specular),
            shininess: self.shininess.unwrap_or(material.shininess),
        }
    }
}

/// All surfaces as one mesh, where there are any, and each apart: made anew unless they are kept. Adds the files that
/// were read to `files` and what was strange about them to `warnings`.
pub(super) fn load(
    plans: &[Plan<'_>],
    folder: &Path,
    kept: &mut Slot<(Arc<Mesh>, Vec<LoadedSurface>)>,
    files: &mut Vec<PathBuf>,
    warnings: &mut Vec<String>,
) -> Result<(Option<Arc<Mesh>>, Vec<LoadedSurface>), Fault> {
    let Some(last) = plans.last() else { return Ok((None, Vec::new())) };
    // Frames of one scene have the same surfaces with the same keys: only values differ.
    let keys = plans.iter().flat_map(|plan| plan.table.without(&[])).collect();
    let (mesh, surfaces) = kept.get(keys, files, warnings, |files, warnings| {
        let made = plans.iter().map(|plan| plan.load(folder, files, warnings)).collect::<Result<Vec<_>, _>>()?;
        let (mut meshes, surfaces): (Vec<_>, Vec<_>) = made.into_iter().unzip();
        let mesh =
            if meshes.len() == 1 { meshes.remove(0) } else { Mesh::joined(&meshes).map_err(|e| last.field.from(e))? };
        Ok((Arc::new(mesh), surfaces))
    })?;
    Ok((Some(mesh), surfaces))
}

impl Plan<'_> {
    /// Makes the surface. Adds the files that were read to `files` and what was strange about them to `warnings`.
    fn load(
        &self,
        folder: &Path,
        files: &mut Vec<PathBuf>,
        warnings: &mut Vec<String>,
    ) -> Result<(Mesh, LoadedSurface), Fault> {
        let (source, own, names) = match &self.source {
            Source::Shape(name, shape) => {
                let mesh = shape.mesh(Material::default()).map_err(|e| self.field.from(e))?;
                let names = vec![String::new(); mesh.materials().len()];
                ((*name).to_owned(), mesh, names)
            }
            Source::File(field) => {
                let path = folder.join(field.text()?);
                let file = mesh::read(&path).map_err(|e| field.from(e))?;
                // A material of the scene's own takes the place of one that is missing.
                let missing = if self.changes.diffuse.is_none() { file.missing } else { Vec::new() };
                let told = file.warnings.into_iter().chain(missing);
                warnings.extend(told.map(|text| format!("{}: {text}", path.display())));
                files.push(path);
                files.extend(file.files);
                (field.text()?.to_owned(), file.mesh, file.names)
            }
        };
        let materials = match &self.source {
            // The walls of a Cornell box keep their colours.
            Source::Shape(..) => {
                let changed = |(i, m): (usize, &Material)| {
                    let diffuse = if i == 0 { self.changes.diffuse } else { None };
                    Changes { diffuse, ..self.changes }.apply(*m)
                };
                own.materials().iter().enumerate().map(changed).collect()
            }
            Source::File(_) => own.materials().iter().map(|m| self.changes.apply(*m)).collect::<Vec<_>>(),
        };
        let mesh = own.placed(&self.placement.map(), materials).map_err(|e| self.field.from(e))?;
        if mesh.degenerate() > 0 {
            let (lost, all) = (mesh.degenerate(), own.triangles().len());
            warnings
                .push(format!("{source}: {lost} of {all} triangles have no area where they stand and are left out"));
        }
        let bounds = mesh.bounds().ok_or_else(|| self.field.from("no triangle has an area where it stands"))?;
        let materials = names.into_iter().zip(mesh.materials().iter().copied()).collect();
        let surface = LoadedSurface { source, triangles: mesh.triangles().len(), bounds, materials };
        Ok((mesh, surface))
    }
}
