//! Fields in bricks: an atlas of bricks side by side in one texture, and a texture of the index.

use airlight_core::device::{BrickLayout, DeviceError, FieldSpec, Limits};
use wgpu::{Extent3d, Texture, TextureFormat, TextureView};

use crate::gpu::Gpu;
use crate::memory::texture;
use crate::staging::Block;

/// Places of bricks in an atlas, and where each block finds its own.
#[derive(Debug)]
pub(crate) struct Atlas {
    layout: BrickLayout,
    /// Blocks of the field along x, y and z.
    blocks: [u32; 3],
    /// Bricks side by side along x, y and z.
    slots: [u32; 3],
    index: Texture,
    pub(crate) index_view: TextureView,
}

/// Bits of a place along an axis in a word of the index.
pub(crate) const SLOT_BITS: u32 = 10;
/// Set in a word of the index that names a brick of one value.
pub(crate) const CONSTANT: u32 = 1 << 31;

/// How bricks lie side by side in a texture of no more than `side` texels along each axis: so many along x, y and z, with
/// few places to spare. None where they are too many.
fn slots(bricks: u32, side: u32) -> Option<[u32; 3]> {
    let most = (side / BrickLayout::SIDE).min(1 << SLOT_BITS);
    let x = bricks.min(most);
    let rows = bricks.div_ceil(x.max(1));
    let z = rows.div_ceil(most.max(1));
    (most > 0 && z <= most).then(|| [x, rows.div_ceil(z), z])
}

impl Atlas {
    /// The index, filled with zeros, and the texels along each axis of the texture of bricks.
    pub(crate) fn new(
        gpu: &Gpu,
        spec: &FieldSpec,
        layout: BrickLayout,
        limits: &Limits,
    ) -> Result<(Self, [u32; 3]), DeviceError> {
        let (blocks, side) = (BrickLayout::blocks(spec.dims), limits.field_side);
        let longest = blocks.into_iter().max().unwrap_or(0);
        let exceeds =
            |what, requested: u32, limit: u64| Err(DeviceError::Limit { what, requested: requested.into(), limit });
        if longest > side {
            return exceeds("the blocks of a field along an axis", longest, side.into());
        }
        let Some(slots) = slots(layout.bricks, side) else {
            let most = u64::from((side / BrickLayout::SIDE).min(1 << SLOT_BITS)).pow(3);
            return exceeds("the bricks of a field", layout.bricks, most);
        };
        let index = texture(gpu, blocks, TextureFormat::R32Uint, 4)?;
        let index_view = gpu.guarded(0, || index.create_view(&Default::default()))?;
        Ok((Self { layout, blocks, slots, index, index_view }, slots.map(|n| n * BrickLayout::SIDE)))
    }

    /// The place of a brick.
    fn slot(&self, brick: u32) -> [u32; 3] {
        let [x, y, _] = self.slots;
        [brick % x, brick / x % y, brick / x / y]
    }

    /// What a kernel finds for a block: the place of its brick, and whether that holds one value.
    fn word(&self, brick: u32) -> u32 {
        let [x, y, z] = self.slot(brick);
        let constant = if brick < self.layout.constants { CONSTANT } else { 0 };
        x | y << SLOT_BITS | z << (2 * SLOT_BITS) | constant
    }

    /// Writes words of the index from the word `first` on.
    pub(crate) fn write_index(&self, gpu: &mut Gpu, first: u32, data: &[u8]) -> Result<(), DeviceError> {
        let words = data.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        let words: Vec<u32> = words.map(|brick| self.word(brick)).collect();
        let [x, y, _] = self.blocks;
        let (mut at, mut left) = (first, words.as_slice());
        while !left.is_empty() {
            let (column, row, plane) = (at % x, at / x % y, at / x / y);
            let rows = left.len() as u32 / x;
            // Whole planes, whole rows, or a part of one.
            let size = match (column, row) {
                (0, 0) if rows >= y => [x, y, rows / y],
                (0, _) if rows > 0 => [x, rows.min(y - row), 1],
                _ => [(x - column).min(left.len() as u32), 1, 1],
            };
            let (part, rest) = left.split_at(size.iter().product::<u32>() as usize);
            let block = Block { origin: [column, row, plane], size, texel: 4 };
            gpu.write_texels(&self.index, block, bytemuck::cast_slice(part))?;
            (at, left) = (at + part.len() as u32, rest);
        }
        Ok(())
    }

    /// Writes whole bricks of texels of so many bytes into the texture of bricks, from brick `first` on.
    pub(crate) fn write_bricks(
        &self,
        gpu: &mut Gpu,
        bricks: &Texture,
        spec: &FieldSpec,
        first: u32,
        data: &[u8],
    ) -> Result<(), DeviceError> {
        let texel = spec.format.bytes() as usize;
        let stride = BrickLayout::brick_bytes(spec.format) as usize;
        let row = BrickLayout::SIDE as usize * texel;
        let (mut at, mut left) = (first, data);
        while !left.is_empty() {
            // Bricks beside each other go at once: row after row of all of them.
            let [x, y, z] = self.slot(at);
            let count = (self.slots[0] - x).min((left.len() / stride) as u32);
            let (part, rest) = left.split_at(count as usize * stride);
            let mut box_of_all = Vec::with_capacity(part.len());
            for line in 0..BrickLayout::TEXELS / BrickLayout::SIDE as usize {
                box_of_all.extend(part.chunks_exact(stride).flat_map(|brick| &brick[line * row..(line + 1) * row]));
            }
            let origin = [x, y, z].map(|n| n * BrickLayout::SIDE);
            let size = [count, 1, 1].map(|n| n * BrickLayout::SIDE);
            gpu.write_texels(bricks, Block { origin, size, texel: texel as u32 }, &box_of_all)?;
            (at, left) = (at + count, rest);
        }
        Ok(())
    }
}

/// A size as wgpu has it.
pub(crate) fn extent([width, height, depth]: [u32; 3]) -> Extent3d {
    Extent3d { width, height, depth_or_array_layers: depth }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bricks_lie_side_by_side_with_few_places_to_spare() {
        for bricks in [1, 5, 227, 228, 227 * 227 + 1, 1_000_000, 227 * 227 * 227] {
            let [x, y, z] = slots(bricks, 2048).unwrap();
            assert!([x, y, z].iter().all(|&n| (1..=227).contains(&n)), "{bricks}: {x} {y} {z}");
            // A row, and a row of each plane, at the most.
            let spare = x * y * z - bricks;
            assert!(spare < x * (1 + z), "{bricks}: {x} {y} {z}");
        }
        assert_eq!(slots(227 * 227 * 227 + 1, 2048), None);
        assert_eq!(slots(1, 8), None);
        // Places of larger textures are counted in ten bits.
        assert_eq!(slots(5000, 1 << 14).unwrap(), [1024, 5, 1]);
    }
}
