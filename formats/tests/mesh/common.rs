//! Files in memory.

use std::path::Path;

use airlight_formats::FormatError;
use airlight_formats::mesh::{Format, MeshFile, parse};
use glam::DVec3;

/// A file of `format` with others beside it.
pub(crate) fn read(format: Format, bytes: &[u8], beside: &[(&str, &[u8])]) -> Result<MeshFile, String> {
    let open = |name: &str| match beside.iter().find(|(n, _)| *n == name) {
        Some((_, bytes)) => Ok(bytes.to_vec()),
        None => Err(FormatError::io(name)(std::io::Error::from(std::io::ErrorKind::NotFound))),
    };
    parse(format, Path::new("room"), bytes, &open).map_err(|e| e.to_string())
}

/// The corners of triangles and their material.
pub(crate) fn triangles(file: &MeshFile) -> Vec<([DVec3; 3], u32)> {
    let at = |v: u32| file.mesh.positions()[v as usize];
    file.mesh.triangles().iter().map(|t| (t.vertices.map(at), t.material)).collect()
}

/// The total area.
pub(crate) fn area(file: &MeshFile) -> f64 {
    triangles(file).iter().map(|([a, b, c], _)| 0.5 * (*b - *a).cross(*c - *a).length()).sum()
}

/// The sum of the triangles' normals, each as long as twice its area.
pub(crate) fn facing(file: &MeshFile) -> DVec3 {
    triangles(file).iter().map(|([a, b, c], _)| (*b - *a).cross(*c - *a)).sum()
}
