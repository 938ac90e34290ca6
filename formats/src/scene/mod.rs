//! Scenes: TOML files, strictly read.
//!
//! Every key has a type and a range, and every error its line and column and what would be right. `docs/scene.md`
//! lists the keys. A key that is known but asks for something that is not built yet says so; its plain value
//! (`"none"`, `false`, an empty list or table) is taken.

mod background;
mod camera;
mod described;
mod error;
mod estimate;
mod light;
mod medium;
mod overrides;
mod pending;
mod table;
mod tree;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use airlight_core::media::OpticsError;
use airlight_core::scene::{CameraError, EstimateError, Scene, SceneError};

pub use self::error::SceneFileError;

use self::error::Fault;
use self::medium::ReadVolume;
use self::table::Table;
use self::tree::Node;

/// The longest scene file, in bytes. Volumes and pictures are files of their own.
pub const MAX_BYTES: u64 = 1 << 24;

const SECTIONS: &[&str] =
    &["camera", "medium", "environment", "background", "light", "surface", "estimate", "quality", "animation"];

/// A scene and how it came to be.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The scene; [`Scene::validate`] has passed.
    pub scene: Scene,
    /// What was set right or looks like an oversight.
    pub warnings: Vec<String>,
    /// The files that were read, the scene file first.
    pub files: Vec<PathBuf>,
}

/// Reads a scene and everything that it names.
///
/// `overrides` are pairs of a dotted path (`light.0.intensity`) and a value (TOML, or a bare word that stands for
/// itself), put in place of what the file says; keys and tables that are absent are created.
///
/// # Errors
/// One that says where: a file that cannot be read, an unknown key, a value of the wrong type or out of range, two
/// estimators for the same light, something that is not built yet.
pub fn load_scene(path: &Path, overrides: &[(String, String)]) -> Result<LoadedScene, SceneFileError> {
    let text = read_text(path)?;
    let mut loaded = parse_scene(&text, path, overrides)?;
    loaded.files.insert(0, path.to_path_buf());
    Ok(loaded)
}

/// As [`load_scene`], of a `text` that is in memory. `path` names it in errors; the files that it names are relative to
/// the folder of `path`. [`LoadedScene::files`] holds those alone.
///
/// # Errors
/// As [`load_scene`].
pub fn parse_scene(text: &str, path: &Path, overrides: &[(String, String)]) -> Result<LoadedScene, SceneFileError> {
    parse_with(text, path, overrides, &|path, grid| crate::volume::read(path, grid))
}

fn parse_with(
    text: &str,
    path: &Path,
    overrides: &[(String, String)],
    read: ReadVolume<'_>,
) -> Result<LoadedScene, SceneFileError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let built = Node::document(text).and_then(|mut root| {
        overrides::apply(&mut root, overrides)?;
        build(&root, folder, read)
    });
    built.map_err(|fault| fault.locate(path, text, overrides))
}

fn read_text(path: &Path) -> Result<String, SceneFileError> {
    let whole = |message: String| SceneFileError::whole(path, message);
    let file = File::open(path).map_err(|e| whole(e.to_string()))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| whole(e.to_string()))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(whole(format!("is longer than the {MAX_BYTES} bytes that a scene may have")));
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let line = e.as_bytes()[..at].iter().filter(|b| **b == b'\n').count() + 1;
        whole(format!("is not a scene: line {line} holds bytes that are not UTF-8 text"))
    })
}

/// Everything that is cheap to check comes before the first file is read.
fn build(root: &Node, folder: &Path, read: ReadVolume<'_>) -> Result<LoadedScene, Fault> {
    let sections = Table::root(root, SECTIONS)?;
    let camera = camera::parse(&sections)?;
    let medium = medium::parse(&sections)?;
    let environment = light::environment(&sections)?;
    let lights = light::lights(&sections)?;
    let estimate = estimate::estimate(&sections)?;
    let quality = estimate::quality(&sections)?;
    let background = background::parse(&sections)?;
    pending::surfaces(&sections)?;
    pending::animation(&sections)?;

    let (mut warnings, mut files) = (Vec::new(), Vec::new());
    if environment.is_none() && lights.is_empty() && !medium.optics.emits() {
        warnings.push("nothing shines: the scene has no [environment], no [[light]] and no emission".into());
    }
    let background = background.map(|b| b.load(folder, &camera, &mut files, &mut warnings)).transpose()?;
    let scene = Scene {
        camera,
        optics: medium.optics.clone(),
        environment: environment.map(|e| e.load(folder, &mut files, &mut warnings)).transpose()?,
        medium: medium.load(folder, read, &mut files)?,
        background,
        surfaces: None,
        frame: 0,
        lights,
        estimate,
        quality,
    };
    scene.validate().map_err(|e| {
        let key = responsible(&e);
        Fault::new(root.locate(&key), format!("{key}: {e}"))
    })?;
    Ok(LoadedScene { scene, warnings, files })
}

/// The key whose value a scene's own check refuses.
fn responsible(error: &SceneError) -> String {
    let key = match error {
        SceneError::Camera(e) => match e {
            CameraError::Direction(..) => "camera.target",
            CameraError::Up(_) => "camera.up",
            CameraError::Fov(_) => "camera.fov",
            CameraError::Size { .. } => "camera.size",
            CameraError::Samples(_) => "camera.samples",
        },
        SceneError::Medium(_) => "medium",
        SceneError::Optics(e) => match e {
            OpticsError::Extinction(_) => "medium.extinction",
            OpticsError::Albedo(_) => "medium.albedo",
            OpticsError::Emission(_) => "medium.emission",
            OpticsError::Phase(_) => "medium.phase",
        },
        SceneError::Environment(_) => "environment",
        SceneError::Background { .. } => "background",
        SceneError::Estimate(EstimateError::Range { key, .. }) => return format!("estimate.environment.{key}"),
        SceneError::Estimate(EstimateError::Conflict(_)) => "estimate.environment.content",
        SceneError::Eye(_) => "camera.origin",
        SceneError::Quality { key, .. } => return format!("quality.{key}"),
    };
    key.to_owned()
}

#[cfg(test)]
mod tests;
