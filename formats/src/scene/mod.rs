//! Scenes: TOML files, strictly read.
//!
//! Every key has a type and a range, and every error its line and column and what would be right. `docs/scene.md`
//! lists the keys. A key that is known but asks for something that is not built yet says so; its plain value
//! (`"none"`, `false`, an empty list or table) is taken.

mod animation;
mod background;
mod camera;
mod classify;
mod described;
mod error;
mod estimate;
mod file;
mod grids;
mod light;
mod medium;
mod overrides;
mod surface;
mod table;
mod transfer;
mod tree;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use airlight_core::light::Light;
use airlight_core::media::OpticsError;
use airlight_core::scene::{
    AllEstimate, Camera, CameraError, Estimate, EstimateError, Material, Quality, Scene, SceneError, TransferSource,
};
use glam::DVec3;

pub use self::animation::{Animation, Curve, Track};
pub use self::error::SceneFileError;
pub use self::file::SceneFile;

use self::error::Fault;
use self::file::Kept;
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
    /// The `[[surface]]`s whose triangles are [`Scene::surfaces`], in the scene's order.
    pub surfaces: Vec<LoadedSurface>,
    /// Where `estimate.all.file` is.
    pub transfer_file: Option<PathBuf>,
}

/// A `[[surface]]` of a scene.
#[derive(Clone, Debug)]
pub struct LoadedSurface {
    /// The file as the scene names it, or the shape.
    pub source: String,
    /// How many triangles it has.
    pub triangles: usize,
    /// Lower and upper corner of the box around it, metres.
    pub bounds: (DVec3, DVec3),
    /// Its materials with their names, which are empty where there are none.
    pub materials: Vec<(String, Material)>,
}

/// Reads a scene and everything that it names: its [first frame](SceneFile::first_frame) where it is animated.
///
/// `overrides` are pairs of a dotted path (`light.0.intensity`) and a value (TOML, or a bare word that stands for
/// itself), put in place of what the file says; keys and tables that are absent are created.
///
/// # Errors
/// One that says where: a file that cannot be read, an unknown key, a value of the wrong type or out of range, two
/// estimators for the same light, something that is not built yet.
pub fn load_scene(path: &Path, overrides: &[(String, String)]) -> Result<LoadedScene, SceneFileError> {
    let mut file = SceneFile::open(path, overrides)?;
    file.frame(file.first_frame())
}

/// As [`load_scene`], of a `text` that is in memory. `path` names it in errors; the files that it names are relative to
/// the folder of `path`. [`LoadedScene::files`] holds those alone.
///
/// # Errors
/// As [`load_scene`].
pub fn parse_scene(text: &str, path: &Path, overrides: &[(String, String)]) -> Result<LoadedScene, SceneFileError> {
    let mut file = SceneFile::parse(text, path, overrides)?;
    file.frame(file.first_frame())
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

/// The sections, before any file that they name is read.
struct Parts<'a> {
    camera: Camera,
    medium: medium::Plan<'a>,
    environment: Option<light::Plan<'a>>,
    lights: Vec<Light>,
    estimate: Estimate,
    transfer: Option<transfer::Plan<'a>>,
    quality: Quality,
    background: Option<background::Plan<'a>>,
    surfaces: Vec<surface::Plan<'a>>,
}

impl<'a> Parts<'a> {
    fn parse(sections: &Table<'a>) -> Result<Self, Fault> {
        let (estimate, transfer) = estimate::estimate(sections)?;
        Ok(Self {
            camera: camera::parse(sections)?,
            medium: medium::parse(sections)?,
            environment: light::environment(sections)?,
            lights: light::lights(sections)?,
            estimate,
            transfer,
            quality: estimate::quality(sections)?,
            background: background::parse(sections)?,
            surfaces: surface::parse(sections)?,
        })
    }
}

/// The scene of a frame. Everything that is cheap to check comes before the first file is read.
fn build(root: &Node, frame: u32, folder: &Path, read: ReadVolume<'_>, kept: &mut Kept) -> Result<LoadedScene, Fault> {
    let Parts { camera, medium, environment, lights, mut estimate, transfer, quality, background, surfaces } =
        Parts::parse(&Table::root(root, SECTIONS)?)?;
    let (mut warnings, mut files) = (Vec::new(), Vec::new());
    if environment.is_none() && lights.is_empty() && !medium.optics.emits() {
        warnings.push("nothing shines: the scene has no [environment], no [[light]] and no emission".into());
    }
    let background =
        background.map(|b| b.load(folder, &camera, &mut kept.background, &mut files, &mut warnings)).transpose()?;
    let (mesh, surfaces) = surface::load(&surfaces, folder, &mut kept.surfaces, &mut files, &mut warnings)?;
    let transfer_file = transfer.as_ref().map(|transfer| transfer.path(folder)).transpose()?;
    if let (Some(transfer), Some(AllEstimate::Transfer(estimate))) = (&transfer, &mut estimate.all)
        && kept.reads_transfer
    {
        let (phase, slot) = (&medium.optics.phase, &mut kept.transfer);
        let made = transfer.load(folder, phase, slot, &mut files, &mut warnings)?;
        estimate.source = TransferSource::Made(made);
    }
    let scene = Scene {
        camera,
        optics: medium.optics.clone(),
        environment: environment
            .map(|e| e.load(folder, &mut kept.environment, &mut files, &mut warnings))
            .transpose()?,
        medium: medium.load(folder, read, (&mut kept.medium, &mut kept.values), &mut files)?,
        background,
        surfaces: mesh,
        frame,
        lights,
        estimate,
        quality,
    };
    scene.validate().map_err(|e| refused(root, &e))?;
    Ok(LoadedScene { scene, warnings, files, surfaces, transfer_file })
}

/// What a scene's own check refuses, at the key that is responsible.
fn refused(root: &Node, error: &SceneError) -> Fault {
    let key = responsible(error);
    Fault::new(root.locate(&key), format!("{key}: {error}"))
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
        SceneError::Estimate(EstimateError::Part { part, what }) => match &**what {
            EstimateError::Range { key, .. } => return format!("estimate.{part}.{key}"),
            EstimateError::Conflict(_) if *part == "environment" => "estimate.environment.content",
            _ => return format!("estimate.{part}"),
        },
        SceneError::Estimate(EstimateError::Sun(_)) => "estimate.environment.extract_sun",
        // What brings all light, beside others or in a scene that it does not fit.
        SceneError::Estimate(_) => "estimate.all",
        SceneError::Eye(_) => "camera.origin",
        SceneError::Quality { key, .. } => return format!("quality.{key}"),
    };
    key.to_owned()
}

#[cfg(test)]
mod tests;
