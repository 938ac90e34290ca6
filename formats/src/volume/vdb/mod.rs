//! OpenVDB files, versions 220 to 224: the container of grids. Trees of float values, saved as float or half, are read.
//!
//! Source: the behaviour of OpenVDB's `io` and `tree` modules, and files that its library wrote.

mod blosc;
mod codec;
mod transform;
mod tree;
mod write;

use std::collections::HashMap;
use std::ops::Range;

use airlight_core::media::{Grid, IndexBox, Storage};
use glam::{DAffine3, IVec3, UVec3};

use super::bytes::Reader;
use super::fault::Fault;
use super::text::shown;
use super::{GridInfo, Volume, choose};
use codec::Codec;
use tree::{Extent, Tree};
pub use write::{VdbWriteOptions, encode_vdb, write_vdb};

/// " BDV", as 64 bits.
const MAGIC: [u8; 8] = [0x20, 0x42, 0x44, 0x56, 0, 0, 0, 0];

/// The version whose nodes first say how their inactive values are packed, and whose grids carry their own flags.
const NODE_MASK_VERSION: u32 = 222;

/// Stands between a grid's name and its number where several grids share the name.
const NAME_SEPARATOR: char = '\u{1e}';

/// The type of tree that is read, and what is added to it where values are saved as half.
const FLOAT_TREE: &str = "Tree_float_5_4_3";
const HALF_SUFFIX: &str = "_HalfFloat";

/// Bits of a grid's compression flags.
const ZIP: u32 = 1;
const ACTIVE_MASK: u32 = 2;
const BLOSC: u32 = 4;

/// Whether a file that begins so is an OpenVDB file.
pub(super) fn is_vdb(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// A file's list of grids.
struct Archive<'a> {
    bytes: &'a [u8],
    version: u32,
    /// Compression of grids that carry no flags of their own.
    compression: u32,
    grids: Vec<Descriptor>,
}

/// An entry of the list.
struct Descriptor {
    name: String,
    tree_type: String,
    /// The grid whose tree this one shares.
    parent: Option<String>,
    /// Where the grid is in the file. Grids do not overlap, so that all of them take no longer than the file.
    range: Range<usize>,
}

/// What stands before a grid's tree.
struct Head {
    compression: u32,
    class: String,
    /// Whether the metadata says that values are saved as half; none: it does not speak of it.
    half: Option<bool>,
    /// The type of the map, and the map where it is affine.
    map: Result<DAffine3, Fault>,
    /// Offset of the tree, where the map's end is known.
    tree: usize,
}

/// A name as users see and give it.
fn name(unique: &str) -> String {
    match unique.split_once(NAME_SEPARATOR) {
        Some((name, number)) => format!("{}[{}]", shown(name), shown(number)),
        None => shown(unique),
    }
}

/// Metadata: a list of names, types and values, each value with its size.
fn metadata<'a>(r: &mut Reader<'a>) -> Result<HashMap<String, &'a [u8]>, Fault> {
    let mut found = HashMap::new();
    for _ in 0..r.u32()? {
        let name = r.string()?;
        r.string()?;
        let size = r.u32()? as usize;
        found.insert(name, r.take(size)?);
    }
    Ok(found)
}

impl<'a> Archive<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, Fault> {
        let mut r = Reader::new(bytes);
        r.take(MAGIC.len())?;
        let version = r.u32()?;
        if !(220..=224).contains(&version) {
            return Err(Fault::Unsupported(format!(
                "an OpenVDB file of format version {version}; airlight reads 220 to 224 (vdb_tool or Houdini can save \
                 it anew)"
            )));
        }
        // The version of the library that wrote the file.
        r.take(8)?;
        let has_offsets = r.u8()? != 0;
        let zipped = version < NODE_MASK_VERSION && r.u8()? != 0;
        // The file's UUID.
        r.take(36)?;
        metadata(&mut r).map_err(|f| f.within("file metadata"))?;
        let count = r.u32()?;
        let mut archive = Self { bytes, version, compression: if zipped { ZIP } else { 0 }, grids: Vec::new() };
        for n in 0..count {
            let entry = |f: Fault| f.within(&format!("grid {} of {count}", n + 1));
            let end = archive.entry(&mut r, has_offsets).map_err(entry)?;
            if n + 1 < count {
                let end = end.or_else(|| archive.end_of_last());
                // Past a grid of another type in a stream nothing can be found.
                let Some(end) = end else { break };
                r = Reader::starting_at(bytes, end).map_err(entry)?;
            }
        }
        Ok(archive)
    }

    /// Reads one entry of the list; gives the offset of the next where the file has it.
    fn entry(&mut self, r: &mut Reader<'a>, has_offsets: bool) -> Result<Option<i64>, Fault> {
        let name = r.string()?;
        let tree_type = r.string()?;
        let parent = r.string()?;
        let offsets = (r.i64()?, r.i64()?, r.i64()?);
        let parent = (!parent.is_empty()).then_some(parent);
        let next = r.at();
        // In a file that was written as a stream the offsets are empty and the grid follows here.
        let (start, end) = if has_offsets { (offsets.0, offsets.2) } else { (next as i64, self.bytes.len() as i64) };
        if start < next as i64 || end < start {
            return Err(Fault::new(format!(
                "the offsets of '{}' are {start} to {end}; a grid lies after its entry in the list, at byte {next}",
                self::name(&name)
            )));
        }
        // What lies past the end of a file that is cut is missed when it is read.
        let inside = |offset: i64| usize::try_from(offset).unwrap_or(usize::MAX).min(self.bytes.len());
        self.grids.push(Descriptor { name, tree_type, parent, range: inside(start)..inside(end) });
        Ok(has_offsets.then_some(end))
    }

    /// The offset of the byte after the grid that was listed last, which in a stream only its tree can tell.
    fn end_of_last(&self) -> Option<i64> {
        let grid = self.grids.last()?;
        let head = self.head(grid).ok().filter(|head| head.map.is_ok())?;
        if grid.parent.is_some() {
            return Some(head.tree as i64);
        }
        self.float_tree(grid).ok()?;
        self.tree(grid, &head, true).ok().map(|tree| tree.end as i64)
    }

    fn head(&self, grid: &Descriptor) -> Result<Head, Fault> {
        let mut r = Reader::starting_at(&self.bytes[..grid.range.end], grid.range.start as i64)?;
        let compression = if self.version >= NODE_MASK_VERSION { r.u32()? } else { self.compression };
        if compression & !(ZIP | ACTIVE_MASK | BLOSC) != 0 {
            return Err(Fault::Unsupported(format!(
                "has compression flags {compression:#x}, which airlight knows not"
            )));
        }
        let metadata = metadata(&mut r)?;
        let text = |key: &str| String::from_utf8_lossy(metadata.get(key).copied().unwrap_or_default()).into_owned();
        let half = metadata.get("is_saved_as_half_float").map(|value| value.first().is_some_and(|b| *b != 0));
        let map = transform::read(&mut r);
        Ok(Head { compression, class: text("class"), half, map, tree: r.at() })
    }

    /// Refuses trees of other types than float.
    fn float_tree(&self, grid: &Descriptor) -> Result<(), Fault> {
        if grid.tree_type.strip_suffix(HALF_SUFFIX).unwrap_or(&grid.tree_type) == FLOAT_TREE {
            return Ok(());
        }
        Err(Fault::Unsupported(format!("is of type {}; airlight reads {FLOAT_TREE}", shown(&grid.tree_type))))
    }

    /// The tree that stands in the grid's own range.
    fn tree(&self, grid: &Descriptor, head: &Head, values: bool) -> Result<Tree, Fault> {
        let half = head.half.unwrap_or(grid.tree_type.ends_with(HALF_SUFFIX));
        let mut r = Reader::starting_at(&self.bytes[..grid.range.end], head.tree as i64)?;
        let mut tree = Tree::new(Codec::new(self.version, head.compression, half));
        tree.read(&mut r, values)?;
        Ok(tree)
    }

    /// The grid that holds the tree of `grid`: itself, or the one that it is an instance of.
    fn owner<'b>(&'b self, grid: &'b Descriptor) -> Result<&'b Descriptor, Fault> {
        let Some(parent) = &grid.parent else { return Ok(grid) };
        let found = self.grids.iter().find(|other| other.name == *parent && other.parent.is_none());
        found.ok_or_else(|| Fault::new(format!("shares the tree of '{}', which is not there", name(parent))))
    }

    fn tree_of(&self, grid: &Descriptor, values: bool) -> Result<Tree, Fault> {
        let owner = self.owner(grid)?;
        self.float_tree(owner)?;
        self.tree(owner, &self.head(owner)?, values)
    }

    /// What is known of a grid without its tree.
    fn info(&self, grid: &Descriptor) -> GridInfo {
        let half = grid.tree_type.ends_with(HALF_SUFFIX);
        let kind = grid.tree_type.strip_suffix(HALF_SUFFIX).unwrap_or(&grid.tree_type);
        let value_type = match kind.strip_prefix("Tree_").and_then(|t| t.split('_').next()) {
            Some("float") if half => "half".into(),
            Some(name) if half => format!("{} as half", shown(name)),
            Some(name) => shown(name),
            None => shown(kind),
        };
        let mut info = GridInfo {
            name: name(&grid.name),
            value_type,
            class: String::new(),
            encoding: String::new(),
            usable: self.float_tree(grid).map_err(|f| f.text()),
            bounds: None,
            index_to_world: None,
            active_voxels: None,
            placed: true,
        };
        let head = match self.head(grid) {
            Ok(head) => head,
            Err(fault) => {
                info.usable = info.usable.and(Err(format!("cannot be read: {}", fault.text())));
                return info;
            }
        };
        info.encoding = match head.compression & (ZIP | BLOSC) {
            0 => "raw",
            ZIP => "zip",
            _ => "blosc",
        }
        .into();
        if head.compression & ACTIVE_MASK != 0 {
            info.encoding += " + active mask";
        }
        if info.usable.is_ok() {
            if head.class == "level set" {
                info.usable =
                    Err("is a level set: its values are distances, not densities; save it as a fog volume".into());
            } else if let Err(fault) = &head.map {
                let known = matches!(fault, Fault::Unsupported(_));
                info.usable = Err(if known { fault.text() } else { format!("cannot be read: {}", fault.text()) });
            }
        }
        info.index_to_world = head.map.ok();
        info.class = shown(&head.class);
        info
    }
}

/// The indices that a grid covers: the active ones and one of background on each side. Where nothing is active, the
/// voxel at index 0 stands for the background everywhere.
fn bounds(active: Option<Extent>) -> Result<IndexBox, Fault> {
    let Extent { min, max } = active.unwrap_or(Extent { min: IVec3::ZERO, max: IVec3::ZERO });
    // The end, one past the border, must be an index too.
    if min.min_element() == i32::MIN || max.max_element() >= i32::MAX - 1 {
        return Err(Fault::new(format!("the active voxels from {min} to {max} leave no room for a border")));
    }
    let sides = max.as_i64vec3() - min.as_i64vec3() + 3;
    Ok(IndexBox { min: min - 1, dims: UVec3::new(sides.x as u32, sides.y as u32, sides.z as u32) })
}

/// What the file holds, with the bounds of its usable grids.
pub(super) fn inspect(bytes: &[u8]) -> Result<Vec<GridInfo>, Fault> {
    let archive = Archive::new(bytes)?;
    // Instances share a tree, which is looked at once.
    let mut known: HashMap<usize, Result<(IndexBox, u64), String>> = HashMap::new();
    let mut infos = Vec::new();
    for grid in &archive.grids {
        let mut info = archive.info(grid);
        if info.usable.is_ok() {
            let look = || {
                let tree = archive.tree_of(grid, false)?;
                Ok((bounds(tree.active)?, tree.active_voxels))
            };
            let told = |fault: Fault| format!("cannot be read: {}", fault.text());
            let found = match archive.owner(grid) {
                Ok(owner) => known.entry(owner.range.start).or_insert_with(|| look().map_err(told)).clone(),
                Err(fault) => Err(told(fault)),
            };
            match found {
                Ok((bounds, voxels)) => (info.bounds, info.active_voxels) = (Some(bounds), Some(voxels)),
                Err(why) => info.usable = Err(why),
            }
        }
        infos.push(info);
    }
    Ok(infos)
}

/// Reads one grid.
pub(super) fn read(bytes: &[u8], wanted: Option<&str>) -> Result<Volume, Fault> {
    let archive = Archive::new(bytes)?;
    let infos: Vec<GridInfo> = archive.grids.iter().map(|grid| archive.info(grid)).collect();
    let chosen = choose(&infos, wanted)?;
    let (grid, name) = (&archive.grids[chosen], infos[chosen].name.clone());
    let place = format!("grid '{name}'");
    let made = || {
        let map = archive.head(grid)?.map?;
        let tree = archive.tree_of(grid, true)?;
        let bounds = bounds(tree.active)?;
        let storage = Storage::Sparse { background: tree.background, bricks: tree.bricks, tiles: tree.tiles };
        Grid::new(bounds, map, storage).map_err(|e| Fault::new(e.to_string()))
    };
    Ok(Volume { grid: made().map_err(|f: Fault| f.within(&place))?, name, placed: true })
}
