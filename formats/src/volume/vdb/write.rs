//! Writing fog volumes that OpenVDB's own library reads, in format version 224.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use airlight_core::media::{BRICK, Grid, IndexBox, Storage, Tile};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::{DMat3, DMat4, DVec3, I64Vec3, IVec3};
use half::f16;

use super::super::fault::{Fault, room};
use super::tree::{LOWER_LOG2, ROOT_SIDE, UPPER_LOG2, UPPER_SIDE};
use super::{ACTIVE_MASK, FLOAT_TREE, HALF_SUFFIX, MAGIC, ZIP};
use crate::error::FormatError;
use crate::output::write_atomically;

/// The format's version, and the version of OpenVDB that is named as the writer's.
const VERSION: u32 = 224;
const LIBRARY: [u32; 2] = [10, 0];

/// The byte before a node's values: what is inactive has the background's value.
const INACTIVE_IS_BACKGROUND: u8 = 0;

/// How [`write_vdb`] packs values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VdbWriteOptions {
    /// Save values as half: half the size, a relative error of up to 2⁻¹¹, and nothing above 65504.
    pub half: bool,
    /// Pack values with zlib.
    pub zip: bool,
}

/// Writes grids as fog volumes under their names. Voxels of the background's value are inactive, and bricks of
/// nothing else are left out; of a dense grid the background is zero. Values outside a grid's bounds are left out of
/// its bricks; a tile is written whole. The file appears whole or not at all.
///
/// # Errors
/// No grid, an empty name or one that two grids share; with `half`, values that it cannot hold; tiles that are not of
/// 8³, 128³ or 4096³ voxels at a multiple of their side; what the operating system refuses.
pub fn write_vdb(path: impl AsRef<Path>, grids: &[(&str, &Grid)], options: VdbWriteOptions) -> Result<(), FormatError> {
    let path = path.as_ref();
    let bytes = encode(grids, options).map_err(|fault| fault.of(path))?;
    write_atomically(path, |file| file.write_all(&bytes).map_err(FormatError::io(path)))
}

/// The bytes that [`write_vdb`] writes; `path` is only for messages.
///
/// # Errors
/// As [`write_vdb`], but for the operating system.
pub fn encode_vdb(path: &Path, grids: &[(&str, &Grid)], options: VdbWriteOptions) -> Result<Vec<u8>, FormatError> {
    encode(grids, options).map_err(|fault| fault.of(path))
}

fn encode(grids: &[(&str, &Grid)], options: VdbWriteOptions) -> Result<Vec<u8>, Fault> {
    if grids.is_empty() {
        return Err(Fault::new("no grid to write"));
    }
    for (n, (name, _)) in grids.iter().enumerate() {
        if name.is_empty() || name.contains(super::NAME_SEPARATOR) || grids[..n].iter().any(|(other, _)| other == name)
        {
            return Err(Fault::new(format!("'{name}' cannot name a grid here: names differ and are not empty")));
        }
    }
    let mut body = Vec::new();
    // Everything before the grids: its length is needed for their offsets, the identity only at the end.
    let mut file = Out { bytes: Vec::new(), options };
    file.raw(&MAGIC);
    file.u32(VERSION);
    file.u32(LIBRARY[0]);
    file.u32(LIBRARY[1]);
    // The list holds offsets.
    file.raw(&[1]);
    let identity = file.bytes.len();
    file.raw(&[b'0'; 36]);
    file.u32(1);
    file.entry("creator", "string", concat!("airlight ", env!("CARGO_PKG_VERSION")).as_bytes());
    file.u32(grids.len() as u32);
    std::mem::swap(&mut body, &mut file.bytes);
    for (name, grid) in grids {
        file.bytes.clear();
        let place = format!("grid '{name}'");
        let blocks = file.grid(name, grid).map_err(|fault| fault.within(&place))?;
        let kind = format!("{FLOAT_TREE}{}", if options.half { HALF_SUFFIX } else { "" });
        let mut list = Out { bytes: body, options };
        list.string(name);
        list.string(&kind);
        list.string("");
        let start = list.bytes.len() + 24;
        for offset in [start, start + blocks, start + file.bytes.len()] {
            list.raw(&(offset as i64).to_le_bytes());
        }
        body = list.bytes;
        let length = file.bytes.len();
        body.try_reserve(length).map_err(|_| Fault::Memory((body.len() + length) as u64))?;
        body.extend_from_slice(&file.bytes);
    }
    let id = uuid(&body);
    body[identity..identity + 36].copy_from_slice(id.as_bytes());
    Ok(body)
}

/// An identity that equal contents share, so that equal grids make equal files: 128 bits of FNV-1a, marked as a UUID
/// of version 8 (made by the writer's own rule).
fn uuid(bytes: &[u8]) -> String {
    const PRIME: u128 = (1 << 88) + 0x13b;
    const BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    let hash = bytes.iter().fold(BASIS, |hash, byte| (hash ^ u128::from(*byte)).wrapping_mul(PRIME));
    let hash = hash & !(0xf << 76) & !(3 << 62) | 8 << 76 | 2 << 62;
    let hex = format!("{hash:032x}");
    [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]].join("-")
}

/// 8³ values in the file's order, z fastest.
type Leaf = Box<[f32; 512]>;

/// A node's children and tiles by their number in it; `fill` is what the rest holds.
struct Node<T> {
    fill: f32,
    tiles: BTreeMap<usize, f32>,
    children: BTreeMap<usize, T>,
}

impl<T> Node<T> {
    fn new(fill: f32) -> Self {
        Self { fill, tiles: BTreeMap::new(), children: BTreeMap::new() }
    }
}

type Lower = Node<Leaf>;
type Upper = Node<Lower>;

/// The tree as it is written.
struct Tree {
    background: f32,
    tiles: BTreeMap<[i32; 3], f32>,
    nodes: BTreeMap<[i32; 3], Upper>,
    active: Option<(IVec3, IVec3)>,
    active_voxels: i64,
}

fn floor(p: IVec3, side: i32) -> IVec3 {
    p - p.rem_euclid(IVec3::splat(side))
}

/// The number of the child of `side` voxels at `p` in its node.
fn slot(p: IVec3, log2: u32, side: i32) -> usize {
    let q = p.rem_euclid(IVec3::splat(side << log2)) / side;
    ((q.x << (2 * log2)) + (q.y << log2) + q.z) as usize
}

impl Tree {
    fn is_background(&self, value: f32) -> bool {
        value == self.background || value.to_bits() == self.background.to_bits()
    }

    fn extend(&mut self, min: IVec3, max: IVec3, voxels: i64) {
        let (a, b) = self.active.unwrap_or((min, max));
        self.active = Some((a.min(min), b.max(max)));
        self.active_voxels = self.active_voxels.saturating_add(voxels);
    }

    fn upper(&mut self, p: IVec3) -> &mut Upper {
        let key = floor(p, ROOT_SIDE).to_array();
        let fill = self.tiles.remove(&key).unwrap_or(self.background);
        self.nodes.entry(key).or_insert_with(|| Node::new(fill))
    }

    fn lower(&mut self, p: IVec3) -> &mut Lower {
        let upper = self.upper(p);
        let n = slot(p, UPPER_LOG2, UPPER_SIDE);
        let fill = upper.tiles.remove(&n).unwrap_or(upper.fill);
        upper.children.entry(n).or_insert_with(|| Node::new(fill))
    }

    fn tile(&mut self, tile: &Tile) -> Result<(), Fault> {
        let side = i32::try_from(tile.side).unwrap_or(0);
        if ![BRICK, UPPER_SIDE, ROOT_SIDE].contains(&side) || tile.origin.rem_euclid(IVec3::splat(side)) != IVec3::ZERO
        {
            return Err(Fault::Unsupported(format!(
                "has a tile of {}³ voxels at {}; OpenVDB's are of 8³, 128³ or 4096³ at a multiple of that",
                tile.side, tile.origin
            )));
        }
        match side {
            ROOT_SIDE => drop(self.tiles.insert(tile.origin.to_array(), tile.value)),
            UPPER_SIDE => {
                let n = slot(tile.origin, UPPER_LOG2, UPPER_SIDE);
                self.upper(tile.origin).tiles.insert(n, tile.value);
            }
            _ => {
                let n = slot(tile.origin, LOWER_LOG2, BRICK);
                self.lower(tile.origin).tiles.insert(n, tile.value);
            }
        }
        if !self.is_background(tile.value) {
            self.extend(tile.origin, tile.origin + (side - 1), i64::from(side).pow(3));
        }
        Ok(())
    }

    /// Puts a leaf whose value at index `p` is `value(p)`, unless it would be all background over background.
    fn leaf(&mut self, origin: IVec3, over_tiles: bool, value: impl Fn(IVec3) -> f32) -> Result<(), Fault> {
        let at = |n: i32| origin + IVec3::new(n >> 6, n >> 3 & 7, n & 7);
        let mut values = room(512)?;
        values.extend((0..512).map(|n| value(at(n))));
        let (mut any, mut voxels) = (None::<(IVec3, IVec3)>, 0);
        for n in (0..512).filter(|n| !self.is_background(values[*n as usize])) {
            let (min, max) = any.unwrap_or((at(n), at(n)));
            any = Some((min.min(at(n)), max.max(at(n))));
            voxels += 1;
        }
        match any {
            Some((min, max)) => self.extend(min, max, voxels),
            None if !over_tiles => return Ok(()),
            None => {}
        }
        let n = slot(origin, LOWER_LOG2, BRICK);
        if let Ok(values) = values.into_boxed_slice().try_into() {
            let lower = self.lower(origin);
            lower.tiles.remove(&n);
            lower.children.insert(n, values);
        }
        Ok(())
    }

    fn of(grid: &Grid) -> Result<Self, Fault> {
        let background = match grid.storage() {
            Storage::Dense(_) => 0.0,
            Storage::Sparse { background, .. } => *background,
        };
        let (tiles, nodes) = (BTreeMap::new(), BTreeMap::new());
        let mut tree = Self { background, tiles, nodes, active: None, active_voxels: 0 };
        let IndexBox { min, dims } = grid.bounds();
        let inside = |p: IVec3| {
            (p.as_i64vec3() - min.as_i64vec3()).cmpge(I64Vec3::ZERO).all()
                && (p.as_i64vec3() - min.as_i64vec3()).cmplt(dims.as_i64vec3()).all()
        };
        match grid.storage() {
            Storage::Dense(values) => {
                let first = floor(min, BRICK);
                let count = (min.as_i64vec3() + dims.as_i64vec3() - first.as_i64vec3() + 7) / 8;
                for z in 0..count.z as i32 {
                    for y in 0..count.y as i32 {
                        for x in 0..count.x as i32 {
                            let value = |p: IVec3| {
                                let q = p.as_i64vec3() - min.as_i64vec3();
                                let at = (q.z * i64::from(dims.y) + q.y) * i64::from(dims.x) + q.x;
                                if inside(p) { values[at as usize] } else { background }
                            };
                            tree.leaf(first + IVec3::new(x, y, z) * BRICK, false, value)?;
                        }
                    }
                }
            }
            Storage::Sparse { bricks, tiles, .. } => {
                // Large tiles first: smaller ones and bricks lie over them.
                for side in [ROOT_SIDE, UPPER_SIDE, BRICK, 0] {
                    let known = [ROOT_SIDE, UPPER_SIDE, BRICK].map(|s| s as u32);
                    let of_side = |t: &&Tile| t.side == side as u32 || side == 0 && !known.contains(&t.side);
                    tiles.iter().filter(of_side).try_for_each(|t| tree.tile(t))?;
                }
                for brick in bricks {
                    if brick.origin.rem_euclid(IVec3::splat(BRICK)) != IVec3::ZERO {
                        let what = format!("a brick at {}; each lies at a multiple of {BRICK}", brick.origin);
                        return Err(Fault::new(what));
                    }
                    let value = |p: IVec3| {
                        let q = p - brick.origin;
                        if inside(p) { brick.values[((q.z * BRICK + q.y) * BRICK + q.x) as usize] } else { background }
                    };
                    tree.leaf(brick.origin, !tiles.is_empty(), value)?;
                }
            }
        }
        Ok(tree)
    }
}

/// Bytes as they are written.
struct Out {
    bytes: Vec<u8>,
    options: VdbWriteOptions,
}

impl Out {
    fn raw(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    fn u32(&mut self, n: u32) {
        self.raw(&n.to_le_bytes());
    }

    fn f32(&mut self, x: f32) {
        self.raw(&x.to_le_bytes());
    }

    fn f64s(&mut self, numbers: impl IntoIterator<Item = f64>) {
        numbers.into_iter().for_each(|x| self.raw(&x.to_le_bytes()));
    }

    fn indices(&mut self, p: [i32; 3]) {
        p.iter().for_each(|n| self.raw(&n.to_le_bytes()));
    }

    fn string(&mut self, text: &str) {
        self.u32(text.len() as u32);
        self.raw(text.as_bytes());
    }

    /// An entry of metadata.
    fn entry(&mut self, name: &str, kind: &str, value: &[u8]) {
        self.string(name);
        self.string(kind);
        self.u32(value.len() as u32);
        self.raw(value);
    }

    /// A grid with all that stands before its tree; gives the offset of the leaves' values.
    fn grid(&mut self, name: &str, grid: &Grid) -> Result<usize, Fault> {
        let tree = Tree::of(grid)?;
        self.u32(ACTIVE_MASK | if self.options.zip { ZIP } else { 0 });
        let (min, max) = tree.active.unwrap_or((IVec3::splat(i32::MAX), IVec3::splat(i32::MIN)));
        let bytes = |p: IVec3| p.to_array().iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>();
        self.u32(6);
        self.entry("class", "string", b"fog volume");
        self.entry("file_bbox_max", "vec3i", &bytes(max));
        self.entry("file_bbox_min", "vec3i", &bytes(min));
        self.entry("file_voxel_count", "int64", &tree.active_voxels.to_le_bytes());
        self.entry("is_saved_as_half_float", "bool", &[self.options.half.into()]);
        self.entry("name", "string", name.as_bytes());
        self.map(grid);
        self.topology(&tree)?;
        let blocks = self.bytes.len();
        for leaf in tree.nodes.values().flat_map(|n| n.children.values()).flat_map(|n| n.children.values()) {
            let mask = self.mask(&leaf[..], &tree);
            self.raw(&mask);
            self.values(&leaf[..], &mask)?;
        }
        Ok(blocks)
    }

    fn map(&mut self, grid: &Grid) {
        let map = grid.index_to_world();
        let m = map.matrix3;
        let scale = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
        if m != DMat3::from_diagonal(scale) {
            self.string("AffineMap");
            // The columns of ours are the rows of theirs.
            self.f64s(DMat4::from(map).to_cols_array());
            return;
        }
        let uniform = scale.x == scale.y && scale.y == scale.z;
        self.string(if uniform { "UniformScaleTranslateMap" } else { "ScaleTranslateMap" });
        let inverse = scale.recip();
        for vector in [map.translation, scale, scale.abs(), inverse, inverse * inverse, 0.5 * inverse] {
            self.f64s(vector.to_array());
        }
    }

    fn topology(&mut self, tree: &Tree) -> Result<(), Fault> {
        // One buffer a tree.
        self.u32(1);
        self.f32(tree.background);
        self.u32(tree.tiles.len() as u32);
        self.u32(tree.nodes.len() as u32);
        for (origin, value) in &tree.tiles {
            self.indices(*origin);
            self.f32(*value);
            self.raw(&[u8::from(!tree.is_background(*value))]);
        }
        for (origin, upper) in &tree.nodes {
            self.indices(*origin);
            self.node(upper, UPPER_LOG2, tree)?;
            for lower in upper.children.values() {
                self.node(lower, LOWER_LOG2, tree)?;
                for leaf in lower.children.values() {
                    let mask = self.mask(&leaf[..], tree);
                    self.raw(&mask);
                }
            }
        }
        Ok(())
    }

    fn node<T>(&mut self, node: &Node<T>, log2: u32, tree: &Tree) -> Result<(), Fault> {
        let mut values = vec![node.fill; 1 << (3 * log2)];
        node.tiles.iter().for_each(|(n, value)| values[*n] = *value);
        let mut children = vec![0; values.len() / 8];
        for n in node.children.keys() {
            children[n >> 3] |= 1 << (n & 7);
            values[*n] = tree.background;
        }
        let active = self.mask(&values, tree);
        self.raw(&children);
        self.raw(&active);
        self.values(&values, &active)
    }

    /// A bit for each value that is not the background's.
    fn mask(&self, values: &[f32], tree: &Tree) -> Vec<u8> {
        let bit = |(n, value): (usize, &f32)| u8::from(!tree.is_background(*value)) << n;
        values.chunks(8).map(|row| row.iter().enumerate().map(bit).sum()).collect()
    }

    /// The active ones of a node's values.
    fn values(&mut self, values: &[f32], mask: &[u8]) -> Result<(), Fault> {
        self.raw(&[INACTIVE_IS_BACKGROUND]);
        let on = |n: &usize| mask[n >> 3] >> (n & 7) & 1 != 0;
        let active = (0..values.len()).filter(on).map(|n| values[n]);
        let mut data = Vec::new();
        for value in active {
            if !self.options.half {
                data.extend(value.to_le_bytes());
                continue;
            }
            let half = f16::from_f32(value);
            if half.is_infinite() && value.is_finite() {
                return Err(Fault::new(format!("value {value} is more than half float holds (65504)")));
            }
            data.extend(half.to_le_bytes());
        }
        // Of no half values nothing is written, of no floats their packed size.
        if !self.options.zip || self.options.half && data.is_empty() {
            self.raw(&data);
            return Ok(());
        }
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        let packed = encoder.write_all(&data).and_then(|()| encoder.finish());
        let packed = packed.map_err(|e| Fault::new(format!("zlib: {e}")))?;
        if packed.len() < data.len() {
            self.raw(&(packed.len() as i64).to_le_bytes());
            self.raw(&packed);
        } else {
            self.raw(&(-(data.len() as i64)).to_le_bytes());
            self.raw(&data);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_keys_go_down_for_negative_indices() {
        assert_eq!(floor(IVec3::new(-1, 0, 4096), ROOT_SIDE), IVec3::new(-4096, 0, 4096));
        assert_eq!(slot(IVec3::new(-8, 0, 8), LOWER_LOG2, BRICK), (15 << 8) + 1);
    }

    #[test]
    fn an_identity_has_the_form_of_a_uuid() {
        let id = uuid(b"airlight");
        let parts: Vec<usize> = id.split('-').map(str::len).collect();
        assert_eq!(parts, [8, 4, 4, 4, 12]);
        assert_eq!(id.as_bytes()[14], b'8');
        assert!(b"89ab".contains(&id.as_bytes()[19]), "{id}");
        assert_ne!(id, uuid(b"airligh"));
    }
}
