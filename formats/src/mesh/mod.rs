//! Surfaces: Wavefront OBJ with its .mtl files, and glTF 2.0, read into a [`Mesh`].
//!
//! A file is known by its content first and by its ending second.
//!
//! | format | files | length and axes |
//! | --- | --- | --- |
//! | Wavefront OBJ | `.obj`, and the `.mtl` files that it names | taken as metres and +Y up, as the file has them |
//! | glTF 2.0 | `.gltf` with its `.bin` files or `data:` URIs, `.glb` | metres, +Y up, as the format says |
//!
//! Materials become diffuse and specular reflectance and an exponent (`docs/scene.md` says how); pictures on surfaces are
//! not read, and a warning names them. Triangles whose file gives no normals are flat facets. What a file claims is held
//! against its size before anything is allocated.

mod gltf;
mod mtl;
mod obj;
mod soup;

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use airlight_core::scene::{Material, Mesh};

use crate::error::FormatError;

/// A file format of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// glTF 2.0 as JSON.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
}

impl Format {
    /// The format's name as its own field writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Obj => "Wavefront OBJ",
            Self::Gltf => "glTF 2.0",
            Self::Glb => "glTF 2.0 binary",
        }
    }
}

/// Surfaces of a file.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// The file's format.
    pub format: Format,
    /// Its triangles, at least one, in metres; its materials are those that triangles have.
    pub mesh: Mesh,
    /// The names of the materials; empty where the file gives none.
    pub names: Vec<String>,
    /// The files that it names and that were read.
    pub files: Vec<PathBuf>,
    /// What was left out or set right, without the file's name.
    pub warnings: Vec<String>,
    /// Which materials are missing, so that triangles have [`Material::default`] instead. For who does not give
    /// materials of their own.
    pub missing: Vec<String>,
}

/// Reads a file that another one names: the name as it is written there, relative to that file's folder.
pub type Open<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, FormatError>;

/// Reads the surfaces of a file.
///
/// # Errors
/// A file that cannot be opened, is of no format that is read, is damaged, needs what is not read, or holds no triangle
/// with an area.
pub fn read(path: impl AsRef<Path>) -> Result<MeshFile, FormatError> {
    let path = path.as_ref();
    let bytes = read_file(path)?;
    let format = detect(path, &bytes)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut file = parse(format, path, &bytes, &|name| read_file(&folder.join(name)))?;
    file.files.iter_mut().for_each(|name| *name = folder.join(&*name));
    Ok(file)
}

/// As [`read`], of a file in memory: `path` is only for messages, and the files that it names are asked of `open`.
/// [`MeshFile::files`] are names as they are written in the file.
///
/// # Errors
/// As [`read`].
pub fn parse(format: Format, path: &Path, bytes: &[u8], open: Open<'_>) -> Result<MeshFile, FormatError> {
    let file = match format {
        Format::Obj => obj::parse(path, bytes, open),
        Format::Gltf => gltf::parse(path, bytes, None, open),
        Format::Glb => gltf::parse_binary(path, bytes, open),
    }?;
    if file.mesh.triangles().is_empty() {
        let what = match (file.mesh.degenerate(), &file.warnings[..]) {
            (0, []) => "the file holds no triangles".to_owned(),
            (0, warnings) => format!("the file holds no triangles; {}", warnings.join("; ")),
            (n, _) => format!("none of its {n} triangles has an area"),
        };
        return Err(FormatError::content(path, None, what));
    }
    Ok(file)
}

/// The format of a file that begins with `bytes`.
///
/// # Errors
/// An empty file; a format that is not read.
pub fn detect(path: &Path, bytes: &[u8]) -> Result<Format, FormatError> {
    if bytes.is_empty() {
        return Err(FormatError::content(path, None, "the file is empty"));
    }
    if bytes.starts_with(b"version https://git-lfs") {
        return Err(FormatError::content(path, None, "this is a Git LFS pointer; fetch the file itself: git lfs pull"));
    }
    if bytes.starts_with(gltf::MAGIC) {
        return Ok(Format::Glb);
    }
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let first = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start().first();
    match ending.as_str() {
        "obj" => Ok(Format::Obj),
        "gltf" | "glb" if first == Some(&b'{') => Ok(Format::Gltf),
        "gltf" => Err(FormatError::content(path, None, "not a glTF file: such a file is a JSON object, '{ … }'")),
        "glb" => Err(FormatError::content(path, None, "not a binary glTF file: such a file begins with 'glTF'")),
        _ => Err(FormatError::unsupported(path, "not a surface that airlight reads: .obj, .gltf or .glb")),
    }
}

fn read_file(path: &Path) -> Result<Vec<u8>, FormatError> {
    let kind = fs::metadata(path).map_err(FormatError::io(path))?;
    if kind.is_dir() {
        return Err(FormatError::unsupported(path, "a folder; give the name of a file"));
    }
    if !kind.is_file() {
        return Err(FormatError::unsupported(path, "not a regular file; surfaces are read from one"));
    }
    let mut bytes = Vec::new();
    let wanted = usize::try_from(kind.len()).unwrap_or(usize::MAX);
    bytes.try_reserve_exact(wanted).map_err(|_| {
        let what = format!("{} bytes of memory cannot be had", kind.len());
        FormatError::io(path)(std::io::Error::new(std::io::ErrorKind::OutOfMemory, what))
    })?;
    let file = File::open(path).map_err(FormatError::io(path))?;
    file.take(kind.len()).read_to_end(&mut bytes).map_err(FormatError::io(path))?;
    Ok(bytes)
}

/// Names for people; a long list is cut.
fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const MOST: usize = 6;
    let mut text = names.iter().take(MOST).map(|n| format!("'{}'", n.as_ref())).collect::<Vec<_>>().join(", ");
    if names.len() > MOST {
        text += &format!(" and {} more", names.len() - MOST);
    }
    text
}

/// The user's text, cut where it is long.
fn shown(text: &str) -> String {
    const MOST: usize = 40;
    match text.char_indices().nth(MOST) {
        Some((cut, _)) => format!("{}…", &text[..cut]),
        None => text.to_owned(),
    }
}

/// What a parser knows at its end.
struct Parsed {
    format: Format,
    soup: soup::Soup,
    /// Every material of the file and its name; triangles name them by number.
    materials: Vec<(String, Material)>,
    files: Vec<PathBuf>,
    warnings: Vec<String>,
    missing: Vec<String>,
}

impl Parsed {
    /// Leaves out the materials that no triangle has.
    fn finish(mut self, path: &Path) -> Result<MeshFile, FormatError> {
        let mut places = vec![None; self.materials.len()];
        let (mut names, mut materials) = (Vec::new(), Vec::new());
        for triangle in &mut self.soup.triangles {
            let number = triangle.material as usize;
            let (name, material) = &self.materials[number];
            triangle.material = *places[number].get_or_insert_with(|| {
                names.push(name.clone());
                materials.push(*material);
                materials.len() as u32 - 1
            });
        }
        let mesh = self.soup.mesh(materials).map_err(|e| FormatError::content(path, None, e.to_string()))?;
        let (lost, all) = (mesh.degenerate(), mesh.degenerate() + mesh.triangles().len());
        if lost > 0 {
            self.warnings.push(format!("{lost} of {all} triangles have no area and are left out"));
        }
        let Self { format, files, warnings, missing, .. } = self;
        Ok(MeshFile { format, mesh, names, files, warnings, missing })
    }
}
