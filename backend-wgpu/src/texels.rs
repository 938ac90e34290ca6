//! Copies of buffers as storage textures, for drivers that load texels faster than memory (`adapter::fetches`). A copy is
//! made anew when a stage reads it after its buffer was written. Textures of our own, which kernels write, are of the same kind.

use std::cell::Cell;

use airlight_core::device::DeviceError;
use wgpu::{
    Buffer, CommandEncoder, Extent3d, Origin3d, TexelCopyBufferInfo, TexelCopyBufferLayout, TexelCopyTextureInfo,
    Texture, TextureAspect, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
};

use crate::gpu::Gpu;
use crate::source::TEXELS_ACROSS;

/// A buffer's copy: texels of so many words in rows of [`TEXELS_ACROSS`].
#[derive(Debug)]
pub(crate) struct Texels {
    texture: Texture,
    pub(crate) view: TextureView,
    words: u32,
    pub(crate) bytes: u64,
    /// Whether it holds what the buffer holds, once what was sent is done.
    pub(crate) fresh: Cell<bool>,
}

/// The format of texels of so many words, one or four.
pub(crate) fn format(words: u32) -> TextureFormat {
    match words {
        1 => TextureFormat::R32Uint,
        _ => TextureFormat::Rgba32Uint,
    }
}

/// Width and height of the copy of a buffer of so many bytes, in texels of so many words.
pub(crate) fn extent(bytes: u64, words: u32) -> (u64, u64) {
    let texels = bytes.div_ceil(4 * u64::from(words)).max(1);
    let across = texels.min(TEXELS_ACROSS.into());
    (across, texels.div_ceil(across))
}

/// Whether the copy of a buffer of so many bytes, in texels of so many words, fits a texture of these limits.
pub(crate) fn fits(bytes: u64, words: u32, limits: &wgpu::Limits) -> bool {
    let (width, height) = extent(bytes, words);
    width.max(height) <= limits.max_texture_dimension_2d.into()
}

impl Texels {
    /// Of a buffer of so many bytes whose copy, as [`extent`] has it, fits the device's textures.
    pub(crate) fn new(gpu: &Gpu, bytes: u64, words: u32) -> Result<Self, DeviceError> {
        let (width, height) = extent(bytes, words);
        let description = TextureDescriptor {
            label: Some("buffer as texels"),
            size: Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: format(words),
            usage: TextureUsages::STORAGE_BINDING | TextureUsages::COPY_DST | TextureUsages::COPY_SRC,
            view_formats: &[],
        };
        let texture = gpu.texture(width * height * 4 * u64::from(words), &description)?;
        let view = gpu.guarded(0, || texture.create_view(&Default::default()))?;
        Ok(Self { texture, view, words, bytes, fresh: Cell::new(false) })
    }

    /// Whether its texels are of so many words.
    pub(crate) fn of(&self, words: u32) -> bool {
        self.words == words
    }
}

/// A copy to be made of a buffer of so many bytes.
#[derive(Debug)]
pub(crate) struct Copy<'s> {
    pub(crate) buffer: &'s Buffer,
    pub(crate) bytes: u64,
    pub(crate) texels: &'s Texels,
}

impl Copy<'_> {
    /// Copies the buffer.
    pub(crate) fn encode(&self, encoder: &mut CommandEncoder) {
        self.pieces().for_each(|(memory, texels, size)| encoder.copy_buffer_to_texture(memory, texels, size));
    }

    /// Copies back into the buffer.
    pub(crate) fn encode_back(&self, encoder: &mut CommandEncoder) {
        self.pieces().for_each(|(memory, texels, size)| encoder.copy_texture_to_buffer(texels, memory, size));
    }

    /// Whole rows, then what is left.
    fn pieces(&self) -> impl Iterator<Item = (TexelCopyBufferInfo<'_>, TexelCopyTextureInfo<'_>, Extent3d)> {
        let Self { buffer, bytes, texels: Texels { texture, words, .. } } = self;
        let texel = 4 * u64::from(*words);
        let count = bytes.div_ceil(texel).max(1);
        let across = u64::from(texture.width());
        let pieces = [(0, across, count / across), (count - count % across, count % across, 1)];
        pieces.into_iter().filter(|&(_, width, height)| width > 0 && height > 0).map(move |(first, width, height)| {
            let bytes_per_row = (height > 1).then_some((across * texel) as u32);
            let layout = TexelCopyBufferLayout { offset: first * texel, bytes_per_row, rows_per_image: None };
            let texels = TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: Origin3d { x: 0, y: (first / across) as u32, z: 0 },
                aspect: TextureAspect::All,
            };
            let size = Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 };
            (TexelCopyBufferInfo { buffer, layout }, texels, size)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_holds_every_element_in_as_few_rows_as_it_takes() {
        let across = u64::from(TEXELS_ACROSS);
        assert_eq!(extent(0, 1), (1, 1));
        assert_eq!(extent(28, 1), (7, 1));
        assert_eq!(extent(32, 4), (2, 1));
        assert_eq!(extent(36, 4), (3, 1));
        assert_eq!(extent(across * 8, 2), (across, 1));
        assert_eq!(extent(across * 8 + 8, 2), (across, 2));
        assert_eq!(extent(across * 16 * 3 - 16, 4), (across, 3));
    }
}
