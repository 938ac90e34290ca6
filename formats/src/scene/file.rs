//! A scene file that is read once, and a scene of it for every frame.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use airlight_core::light::Environment;
use airlight_core::media::{Classified, Medium};
use airlight_core::scene::{Background, Mesh, SceneError};
use airlight_core::transfer::Transfer;

use super::animation::{self, Animation};
use super::error::Fault;
use super::medium::ReadVolume;
use super::table::Table;
use super::tree::{Entry, Node, Value};
use super::{LoadedScene, LoadedSurface, Parts, SECTIONS, SceneFileError, build, overrides, read_text, refused};
use crate::sequence::numbered;

/// Files that may be sequences, by their keys.
const SEQUENCES: [[&str; 2]; 4] =
    [["medium", "file"], ["environment", "file"], ["background", "color"], ["background", "depth"]];

/// A scene file, from which the scene of any frame is made.
///
/// What frames have in common is read once: a medium, an environment, a background and surfaces stay the same (the same
/// [`Version`](airlight_core::Version)) from one frame to the next where neither their files nor their keys change, so
/// that a renderer redoes only what depends on what moved. The medium's optics and the environment's scale, rotation
/// and visibility may change without that. Files that change on the disk meanwhile are not read again.
#[derive(Debug)]
pub struct SceneFile {
    path: PathBuf,
    /// Whether the scene lies in the file of that path.
    stored: bool,
    text: String,
    overrides: Vec<(String, String)>,
    root: Node,
    animation: Option<Animation>,
    kept: Kept,
}

/// What the last frame read.
#[derive(Debug)]
pub(super) struct Kept {
    /// Whether the file of a transfer is read.
    pub(super) reads_transfer: bool,
    pub(super) medium: Slot<Arc<dyn Medium>>,
    /// Of a medium that is classified, as the last frame had it.
    pub(super) values: Slot<Classified>,
    pub(super) environment: Slot<Environment>,
    pub(super) background: Slot<Background>,
    pub(super) surfaces: Slot<(Arc<Mesh>, Vec<LoadedSurface>)>,
    pub(super) transfer: Slot<Arc<Transfer>>,
}

impl Default for Kept {
    fn default() -> Self {
        Self {
            reads_transfer: true,
            values: Slot::default(),
            medium: Slot::default(),
            environment: Slot::default(),
            background: Slot::default(),
            surfaces: Slot::default(),
            transfer: Slot::default(),
        }
    }
}

/// A part of the scene that was read, and the keys that it was read by.
#[derive(Debug)]
pub(super) struct Slot<T>(Option<Part<T>>);

#[derive(Debug)]
struct Part<T> {
    keys: Vec<Entry>,
    value: T,
    files: Vec<PathBuf>,
    warnings: Vec<String>,
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Clone> Slot<T> {
    /// What was read by the same keys, or else what `read` reads: it adds the files to its first argument and warnings to
    /// its second. Both are told anew every time.
    pub(super) fn get(
        &mut self,
        keys: Vec<Entry>,
        files: &mut Vec<PathBuf>,
        warnings: &mut Vec<String>,
        read: impl FnOnce(&mut Vec<PathBuf>, &mut Vec<String>) -> Result<T, Fault>,
    ) -> Result<T, Fault> {
        // What no longer serves makes room before anything is read.
        let part = match self.0.take().filter(|part| part.keys == keys) {
            Some(part) => part,
            None => {
                let (mut files, mut warnings) = (Vec::new(), Vec::new());
                let value = read(&mut files, &mut warnings)?;
                Part { keys, value, files, warnings }
            }
        };
        let part = self.0.insert(part);
        files.extend_from_slice(&part.files);
        warnings.extend_from_slice(&part.warnings);
        Ok(part.value.clone())
    }
}

impl<T> Slot<T> {
    /// Keeps a value in place of what was read by the same keys.
    pub(super) fn put(&mut self, value: T) {
        if let Some(part) = &mut self.0 {
            part.value = value;
        }
    }
}

impl SceneFile {
    /// Reads a scene file, none of those that it names. `overrides` are as for [`load_scene`](super::load_scene).
    ///
    /// # Errors
    /// One that says where: a file that cannot be read, an unknown key, a value of the wrong type or out of range, a
    /// track of the animation that cannot be followed.
    pub fn open(path: &Path, overrides: &[(String, String)]) -> Result<Self, SceneFileError> {
        let text = read_text(path)?;
        Ok(Self { stored: true, ..Self::parse(&text, path, overrides)? })
    }

    /// As [`SceneFile::open`], of a `text` that is in memory; see [`parse_scene`](super::parse_scene).
    ///
    /// # Errors
    /// As [`SceneFile::open`].
    pub fn parse(text: &str, path: &Path, overrides: &[(String, String)]) -> Result<Self, SceneFileError> {
        let read = || {
            let mut root = Node::document(text)?;
            overrides::apply(&mut root, overrides)?;
            let sections = Table::root(&root, SECTIONS)?;
            Parts::parse(&sections)?;
            let animation = animation::parse(&root, &sections, overrides)?;
            Ok((root, animation))
        };
        let (root, animation) = read().map_err(|fault: Fault| fault.locate(path, text, overrides))?;
        Ok(Self {
            path: path.to_path_buf(),
            stored: false,
            text: text.to_owned(),
            overrides: overrides.to_vec(),
            root,
            animation,
            kept: Kept::default(),
        })
    }

    /// The same for making the transfer that the scene names: its file is not read, and may be missing.
    #[must_use]
    pub fn without_transfer(mut self) -> Self {
        self.kept.reads_transfer = false;
        self
    }

    /// What `[animation]` says.
    pub fn animation(&self) -> Option<&Animation> {
        self.animation.as_ref()
    }

    /// The frame that stands for the scene where none is asked for: the first of `[animation]`, or 0 without it.
    pub fn first_frame(&self) -> u32 {
        self.animation.as_ref().map_or(0, |a| *a.frames.start())
    }

    /// Checks frames as far as that goes without reading the files that they name, which must be there.
    ///
    /// # Errors
    /// As [`SceneFile::frame`], for the first frame that has one.
    pub fn check(&self, frames: RangeInclusive<u32>) -> Result<(), SceneFileError> {
        let last = if self.varies() { *frames.end() } else { *frames.start() };
        (*frames.start()..=last).try_for_each(|frame| {
            let root = self.at(frame);
            let check = || {
                let parts = Parts::parse(&Table::root(&root, SECTIONS)?)?;
                parts.validate().map_err(|e| refused(&root, &e))?;
                SEQUENCES.iter().try_for_each(|key| self.find(&root, key))
            };
            check().map_err(|fault| self.locate(fault, frame))
        })
    }

    /// The scene of a frame. Sequences are read at its number.
    ///
    /// # Errors
    /// As [`load_scene`](super::load_scene). Where the scene changes from frame to frame the error names this one.
    pub fn frame(&mut self, frame: u32) -> Result<LoadedScene, SceneFileError> {
        self.frame_with(frame, &|path, grid| crate::volume::read(path, grid))
    }

    pub(super) fn frame_with(&mut self, frame: u32, read: ReadVolume<'_>) -> Result<LoadedScene, SceneFileError> {
        let root = self.at(frame);
        let folder = self.path.parent().unwrap_or(Path::new(""));
        match build(&root, frame, folder, read, &mut self.kept) {
            Ok(mut loaded) => {
                if self.stored {
                    loaded.files.insert(0, self.path.clone());
                }
                Ok(loaded)
            }
            Err(fault) => Err(self.locate(fault, frame)),
        }
    }

    /// The tree as it is at a frame.
    fn at(&self, frame: u32) -> Node {
        let mut root = self.root.clone();
        if let Some(animation) = &self.animation {
            animation.apply(&mut root, frame);
        }
        for key in SEQUENCES {
            if let Some(Node { value: Value::Text(name), .. }) = root.at_mut(&key)
                && let Some(path) = numbered(Path::new(name), frame)
            {
                *name = path.display().to_string();
            }
        }
        root
    }

    /// Whether frames differ.
    fn varies(&self) -> bool {
        let sequence = |key| {
            matches!(self.root.at(key), Some(Node { value: Value::Text(name), .. })
            if numbered(Path::new(name), 0).is_some())
        };
        self.animation.as_ref().is_some_and(|a| !a.tracks.is_empty()) || SEQUENCES.iter().any(|key| sequence(key))
    }

    /// The file of a key must be there.
    fn find(&self, root: &Node, key: &[&str; 2]) -> Result<(), Fault> {
        let Some(Node { value: Value::Text(name), origin }) = root.at(key) else { return Ok(()) };
        let path = self.path.parent().unwrap_or(Path::new("")).join(name);
        let fault = |e| Fault::new(*origin, format!("{}: {}: {e}", key.join("."), path.display()));
        std::fs::metadata(&path).map(drop).map_err(fault)
    }

    fn locate(&self, mut fault: Fault, frame: u32) -> SceneFileError {
        if self.varies() {
            fault.message = format!("frame {frame}: {}", fault.message);
        }
        fault.locate(&self.path, &self.text, &self.overrides)
    }
}

impl Parts<'_> {
    /// What the parts themselves refuse.
    fn validate(&self) -> Result<(), SceneError> {
        self.camera.validate()?;
        self.medium.optics.validate()?;
        Ok(self.estimate.validate(&self.medium.optics.phase)?)
    }
}
