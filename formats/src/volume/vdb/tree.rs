//! Trees of the usual shape: a root, nodes of 32³ and 16³ children, leaves of 8³ voxels.

use std::collections::HashSet;

use airlight_core::media::{BRICK, Brick, Tile};
use glam::IVec3;

use super::super::bytes::Reader;
use super::super::fault::{Fault, room};
use super::codec::{Codec, is_on};

/// Voxels along a side of what the root holds, and of what the nodes of the next level hold.
pub(super) const ROOT_SIDE: i32 = 4096;
pub(super) const UPPER_SIDE: i32 = 128;

/// Logarithms of the children along a side of the two levels of nodes.
pub(super) const UPPER_LOG2: u32 = 5;
pub(super) const LOWER_LOG2: u32 = 4;

/// Bytes of a leaf's mask.
const LEAF_MASK: usize = 64;

/// Inclusive bounds of indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    /// The lowest index.
    pub(super) min: IVec3,
    /// The highest.
    pub(super) max: IVec3,
}

/// A tree as it is read.
pub(super) struct Tree {
    /// The value of what the tree leaves out.
    pub(super) background: f32,
    /// Leaves, where values were asked for.
    pub(super) bricks: Vec<Brick>,
    /// Tiles whose value is not the background's, active or not.
    pub(super) tiles: Vec<Tile>,
    /// Where voxels and tiles are active.
    pub(super) active: Option<Extent>,
    /// How many voxels are active.
    pub(super) active_voxels: u64,
    /// Offset of the byte after the tree.
    pub(super) end: usize,
    codec: Codec,
    scratch: Vec<f32>,
}

/// Where child `n` of a node lies within it; z is fastest in the file.
fn offset(n: usize, log2: u32) -> IVec3 {
    let (n, low) = (n as i32, (1 << log2) - 1);
    IVec3::new(n >> (2 * log2), n >> log2 & low, n & low)
}

/// Appends without the abort of an allocation that fails.
fn push<T>(items: &mut Vec<T>, item: T) -> Result<(), Fault> {
    items.try_reserve(1).map_err(|_| Fault::Memory((items.len() as u64 + 1) * size_of::<T>() as u64))?;
    items.push(item);
    Ok(())
}

/// The active bounds of a leaf, within it.
fn leaf_extent(mask: &[u8]) -> Option<Extent> {
    let mut extent: Option<Extent> = None;
    // A byte is a row of z at one (x, y).
    for (n, row) in mask.iter().enumerate().filter(|(_, row)| **row != 0) {
        let at = |z: u32| IVec3::new(n as i32 >> 3, n as i32 & 7, z as i32);
        let (low, high) = (at(row.trailing_zeros()), at(7 - row.leading_zeros()));
        extent = Some(match extent {
            None => Extent { min: low, max: high },
            Some(e) => Extent { min: e.min.min(low), max: e.max.max(high) },
        });
    }
    extent
}

impl Tree {
    /// An empty tree whose values `codec` reads.
    pub(super) fn new(codec: Codec) -> Self {
        Self {
            background: 0.0,
            bricks: Vec::new(),
            tiles: Vec::new(),
            active: None,
            active_voxels: 0,
            end: 0,
            codec,
            scratch: Vec::new(),
        }
    }

    /// Reads topology and tiles, and the leaves' values too where `values`.
    pub(super) fn read(&mut self, r: &mut Reader<'_>, values: bool) -> Result<(), Fault> {
        let buffers = r.i32()?;
        if buffers != 1 {
            return Err(r.fault(format!("{buffers} buffers in a tree, where 1 belongs")));
        }
        self.background = r.f32()?;
        self.codec.background = self.background;
        let (tiles, children) = (r.u32()?, r.u32()?);
        let mut seen = HashSet::new();
        let mut leaves = Vec::new();
        for _ in 0..tiles {
            let origin = root_key(r, &mut seen)?;
            let (value, active) = (r.f32()?, r.u8()? != 0);
            self.tile(origin, ROOT_SIDE, value, active)?;
        }
        for _ in 0..children {
            let origin = root_key(r, &mut seen)?;
            self.node(r, origin, UPPER_LOG2, UPPER_SIDE, &mut leaves)?;
        }
        if values {
            self.bricks = room(leaves.len())?;
            for origin in leaves {
                self.leaf(r, origin)?;
            }
        }
        self.end = r.at();
        Ok(())
    }

    fn extend(&mut self, min: IVec3, max: IVec3) {
        let all = self.active.unwrap_or(Extent { min, max });
        self.active = Some(Extent { min: all.min.min(min), max: all.max.max(max) });
    }

    fn tile(&mut self, origin: IVec3, side: i32, value: f32, active: bool) -> Result<(), Fault> {
        if active {
            self.extend(origin, origin + (side - 1));
            self.active_voxels = self.active_voxels.saturating_add((side as u64).pow(3));
        }
        if value.to_bits() != self.background.to_bits() {
            push(&mut self.tiles, Tile { origin, side: side as u32, value })?;
        }
        Ok(())
    }

    /// A node of (2^log2)³ children of `side` voxels; the origins of its leaves are added to `leaves`.
    fn node(
        &mut self,
        r: &mut Reader<'_>,
        origin: IVec3,
        log2: u32,
        side: i32,
        leaves: &mut Vec<IVec3>,
    ) -> Result<(), Fault> {
        let count = 1usize << (3 * log2);
        let (children, active) = (r.take(count / 8)?, r.take(count / 8)?);
        // Taken out while tiles are made of it; the nodes below use it next.
        let mut values = std::mem::take(&mut self.scratch);
        values.resize(count, 0.0);
        self.codec.values(r, active, &mut values)?;
        for (n, value) in values.iter().enumerate().filter(|(n, _)| !is_on(children, *n)) {
            self.tile(origin + offset(n, log2) * side, side, *value, is_on(active, n))?;
        }
        self.scratch = values;
        for n in (0..count).filter(|n| is_on(children, *n)) {
            let origin = origin + offset(n, log2) * side;
            if log2 == UPPER_LOG2 {
                self.node(r, origin, LOWER_LOG2, BRICK, leaves)?;
            } else {
                let mask = r.take(LEAF_MASK)?;
                self.active_voxels += mask.iter().map(|b| u64::from(b.count_ones())).sum::<u64>();
                if let Some(extent) = leaf_extent(mask) {
                    self.extend(origin + extent.min, origin + extent.max);
                }
                push(leaves, origin)?;
            }
        }
        Ok(())
    }

    fn leaf(&mut self, r: &mut Reader<'_>, origin: IVec3) -> Result<(), Fault> {
        let mask = r.take(LEAF_MASK)?;
        let mut buffers = 1;
        if self.codec.version < super::NODE_MASK_VERSION {
            // The leaf's origin, which its place in the tree has told already.
            r.take(12)?;
            buffers = r.u8()?;
        }
        let mut values = [0.0; 512];
        self.codec.values(r, mask, &mut values)?;
        // Files of that time may hold copies for computations in flight.
        for _ in 1..buffers {
            self.codec.values(r, mask, &mut [0.0; 512])?;
        }
        let mut brick = room(512)?;
        brick.extend((0..512).map(|n| values[(n & 7) << 6 | (n >> 3 & 7) << 3 | n >> 6]));
        let values = brick.into_boxed_slice().try_into().map_err(|_| r.fault("a leaf of other than 512 values"))?;
        self.bricks.push(Brick { origin, values });
        Ok(())
    }
}

/// The origin of a child of the root, which must be one that no other has.
fn root_key(r: &mut Reader<'_>, seen: &mut HashSet<IVec3>) -> Result<IVec3, Fault> {
    let key = IVec3::new(r.i32()?, r.i32()?, r.i32()?);
    if key % ROOT_SIDE != IVec3::ZERO {
        return Err(r.fault(format!("a root entry at {key}; each lies at a multiple of {ROOT_SIDE}")));
    }
    if !seen.insert(key) {
        return Err(r.fault(format!("two root entries at {key}")));
    }
    Ok(key)
}
