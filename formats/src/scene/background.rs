//! `[background]`.

use std::path::{Path, PathBuf};

use airlight_core::light::clamp_texels;
use airlight_core::scene::{Background, Camera};

use super::error::Fault;
use super::file::Slot;
use super::table::{Field, Table};
use crate::image::{read_depth, read_image};

/// `[background]` before its pictures are read.
pub(super) struct Plan<'a> {
    table: Table<'a>,
    color: Option<Field<'a>>,
    depth: Option<Field<'a>>,
}

pub(super) fn parse<'a>(root: &Table<'a>) -> Result<Option<Plan<'a>>, Fault> {
    let Some(field) = root.asked("background") else { return Ok(None) };
    let table = field.table(&["color", "depth"])?;
    let (color, depth) = (table.wanted("color"), table.wanted("depth"));
    for file in [&color, &depth].into_iter().flatten() {
        file.text()?;
    }
    if color.is_none() && depth.is_none() {
        return Err(table.fault("background needs color = \"beauty.exr\", depth = \"depth.exr\" or both"));
    }
    Ok(Some(Plan { table, color, depth }))
}

impl Plan<'_> {
    /// Reads the pictures, unless they are kept, which must be of the camera's size. Adds the files to `files` and what was strange about them
    /// to `warnings`.
    pub(super) fn load(
        &self,
        folder: &Path,
        camera: &Camera,
        kept: &mut Slot<Background>,
        files: &mut Vec<PathBuf>,
        warnings: &mut Vec<String>,
    ) -> Result<Background, Fault> {
        kept.get(self.table.without(&[]), files, warnings, |files, warnings| self.read(folder, camera, files, warnings))
    }

    fn read(
        &self,
        folder: &Path,
        camera: &Camera,
        files: &mut Vec<PathBuf>,
        warnings: &mut Vec<String>,
    ) -> Result<Background, Fault> {
        let mut color = None;
        if let Some(field) = &self.color {
            let path = folder.join(field.text()?);
            let mut image = read_image(&path).map_err(|e| field.from(e))?.image;
            size(field, &path, [image.width, image.height], camera)?;
            let (odd, all) = (clamp_texels(&mut image.texels), image.texels.len());
            if odd > 0 {
                let text = format!("{odd} of {all} pixels hold negative or non-finite values, which count as 0");
                warnings.push(format!("{}: {text}", path.display()));
            }
            color = Some(image.texels);
            files.push(path);
        }
        let mut depth = None;
        if let Some(field) = &self.depth {
            let path = folder.join(field.text()?);
            let image = read_depth(&path).map_err(|e| field.from(e))?;
            size(field, &path, [image.width, image.height], camera)?;
            if image.odd > 0 {
                let (odd, all) = (image.odd, image.values.len());
                let text = format!("{odd} of {all} distances are negative or not numbers, which count as no surface");
                warnings.push(format!("{}: {text}", path.display()));
            }
            depth = Some(image.values);
            files.push(path);
        }
        Background::new(camera.width, camera.height, color, depth).map_err(|e| self.table.fault(e.to_string()))
    }
}

fn size(field: &Field<'_>, path: &Path, [width, height]: [u32; 2], camera: &Camera) -> Result<(), Fault> {
    if [width, height] == [camera.width, camera.height] {
        return Ok(());
    }
    let (path, w, h) = (path.display(), camera.width, camera.height);
    Err(field.from(format!("{path} has {width} × {height} pixels and camera.size is {w} × {h}; both must be equal")))
}
