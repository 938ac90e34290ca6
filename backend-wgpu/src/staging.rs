//! Staging memory for what the host writes: chunks that stay mapped until they are sent, and come back when the device is
//! done with them. The host waits only when all of them are under way.

use std::sync::mpsc::{self, Receiver, Sender};

use airlight_core::device::DeviceError;
use wgpu::{
    Buffer, BufferAsyncError, BufferDescriptor, BufferUsages, MapMode, Origin3d, TexelCopyBufferInfo,
    TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect,
};

use crate::atlas::extent;
use crate::gpu::Gpu;

/// Bytes of a chunk. No row of a texture is longer.
pub(crate) const CHUNK: u64 = 2 << 20;
/// The most chunks.
const MOST: usize = 16;
/// What parts of a chunk, and rows of texels in it, begin at multiples of.
const ALIGN: u64 = 256;

/// The chunks.
#[derive(Debug)]
pub(crate) struct Staging {
    /// Mapped, and empty.
    free: Vec<Buffer>,
    /// Mapped, and filled up to here.
    open: Option<(Buffer, u64)>,
    /// To be sent.
    full: Vec<Buffer>,
    /// How many there are, wherever they are.
    chunks: usize,
    /// Where they come back to.
    home: Sender<Result<Buffer, BufferAsyncError>>,
    back: Receiver<Result<Buffer, BufferAsyncError>>,
}

impl Default for Staging {
    fn default() -> Self {
        let (home, back) = mpsc::channel();
        Self { free: Vec::new(), open: None, full: Vec::new(), chunks: 0, home, back }
    }
}

/// A part of a chunk.
struct Place {
    chunk: Buffer,
    offset: u64,
    bytes: u64,
}

/// A block of a texture, in texels, and bytes of a texel.
pub(crate) struct Block {
    pub(crate) origin: [u32; 3],
    pub(crate) size: [u32; 3],
    pub(crate) texel: u32,
}

impl Staging {
    /// What is left of the open chunk.
    fn room(&self) -> u64 {
        self.open.as_ref().map_or(0, |(_, used)| CHUNK - used)
    }

    /// The next bytes of the open chunk, `most` or as many as there are.
    fn take(&mut self, most: u64) -> Option<Place> {
        let (chunk, used) = self.open.as_mut()?;
        let bytes = most.min(CHUNK - *used);
        let place = Place { chunk: chunk.clone(), offset: *used, bytes };
        *used = (*used + bytes).next_multiple_of(ALIGN);
        Some(place)
    }

    /// Takes in the chunks that came back. Those of a device that was lost do not.
    fn collect(&mut self) {
        for back in self.back.try_iter() {
            match back {
                Ok(chunk) => self.free.push(chunk),
                Err(_) => self.chunks -= 1,
            }
        }
    }

    /// Unmaps what was filled, which a submission may read then.
    pub(crate) fn close(&mut self) -> Vec<Buffer> {
        let mut all = std::mem::take(&mut self.full);
        all.extend(self.open.take().map(|(chunk, _)| chunk));
        all.iter().for_each(Buffer::unmap);
        all
    }

    /// Asks for chunks back that were handed to the queue.
    pub(crate) fn recall(&self, chunks: &[Buffer]) {
        for chunk in chunks {
            let (home, own) = (self.home.clone(), chunk.clone());
            chunk.map_async(MapMode::Write, .., move |mapped| {
                // Nobody is at home once the device was dropped.
                let _ = home.send(mapped.map(|()| own));
            });
        }
    }
}

impl Gpu {
    /// Opens a chunk that is free, as soon as there is one. What was open is full.
    fn open_chunk(&mut self) -> Result<(), DeviceError> {
        self.staging.full.extend(self.staging.open.take().map(|(chunk, _)| chunk));
        loop {
            self.staging.collect();
            if let Some(chunk) = self.staging.free.pop() {
                self.staging.open = Some((chunk, 0));
                return Ok(());
            }
            if self.staging.chunks < MOST {
                // Not counted among what a steady frame does not make: how many there are depends on how far the device is behind.
                let usage = BufferUsages::MAP_WRITE | BufferUsages::COPY_SRC;
                let description =
                    BufferDescriptor { label: Some("staging"), size: CHUNK, usage, mapped_at_creation: true };
                let chunk = self.guarded(CHUNK, || self.device.create_buffer(&description))?;
                self.staging.free.push(chunk);
                self.staging.chunks += 1;
                continue;
            }
            let more = self.wait_next()?;
            self.staging.collect();
            if !more && self.staging.free.is_empty() && self.staging.chunks == MOST {
                return Err(DeviceError::Backend("staging memory does not come back".into()));
            }
        }
    }

    /// Sends what fills chunks, and gives `least` to `most` bytes of one.
    fn place(&mut self, least: u64, most: u64) -> Result<Place, DeviceError> {
        if self.staging.room() < least {
            self.send()?;
            self.open_chunk()?;
        }
        self.staging.take(most).ok_or_else(|| DeviceError::Backend("no staging memory is open".into()))
    }

    /// Fills a part of a chunk, with rows at multiples of `stride` bytes.
    fn fill<'d>(&self, place: &Place, rows: impl Iterator<Item = &'d [u8]>, stride: usize) -> Result<(), DeviceError> {
        let range = place.offset..place.offset + place.bytes;
        let mut view = self
            .guarded(0, || place.chunk.get_mapped_range_mut(range))?
            .map_err(|error| DeviceError::Backend(format!("staging: {error}")))?;
        for (n, row) in rows.enumerate() {
            view.slice(n * stride..n * stride + row.len()).copy_from_slice(row);
        }
        Ok(())
    }

    /// Writes whole words into a buffer, in order with what is dispatched.
    pub(crate) fn write_buffer(&mut self, to: &Buffer, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        let (mut at, mut left) = (offset, data);
        while !left.is_empty() {
            let place = self.place(ALIGN, left.len() as u64)?;
            let (now, rest) = left.split_at(place.bytes as usize);
            self.fill(&place, std::iter::once(now), 0)?;
            self.copies()?.copy_buffer_to_buffer(&place.chunk, place.offset, to, at, place.bytes);
            (at, left) = (at + place.bytes, rest);
        }
        Ok(())
    }

    /// Copies the parameters of a batch, by a command before all of it, from chunks that are sent with it.
    pub(crate) fn write_ahead(&mut self, to: &Buffer, data: &[u8]) -> Result<wgpu::CommandBuffer, DeviceError> {
        let mut encoder = self.guarded(0, || self.device.create_command_encoder(&Default::default()))?;
        let (mut at, mut left) = (0, data);
        while !left.is_empty() {
            if self.staging.room() < ALIGN {
                self.open_chunk()?;
            }
            let Some(place) = self.staging.take(left.len() as u64) else { continue };
            let (now, rest) = left.split_at(place.bytes as usize);
            self.fill(&place, std::iter::once(now), 0)?;
            encoder.copy_buffer_to_buffer(&place.chunk, place.offset, to, at, place.bytes);
            (at, left) = (at + place.bytes, rest);
        }
        self.guarded(0, || encoder.finish())
    }

    /// Writes a block of a texture: x fastest, then y and z.
    pub(crate) fn write_texels(&mut self, to: &Texture, block: Block, data: &[u8]) -> Result<(), DeviceError> {
        let Block { origin: [x, y, z], size: [width, height, depth], texel } = block;
        let row = width as usize * texel as usize;
        let stride = (row as u64).next_multiple_of(ALIGN);
        let (mut done, mut left) = (0, data);
        while done < height * depth {
            let (line, slice) = (done % height, done / height);
            // At least the rest of a slice where that fits a chunk; whole slices where there is room for more.
            let least = u64::from(height - line).min(CHUNK / stride) * stride;
            let place = self.place(least, u64::from(height * depth - done) * stride)?;
            let fit = (place.bytes / stride) as u32;
            let block = if line == 0 && fit >= height {
                [width, height, fit / height]
            } else {
                [width, fit.min(height - line), 1]
            };
            let rows = block[1] * block[2];
            let (now, rest) = left.split_at(rows as usize * row);
            self.fill(&place, now.chunks_exact(row), stride as usize)?;
            let source = TexelCopyBufferInfo {
                buffer: &place.chunk,
                layout: TexelCopyBufferLayout {
                    offset: place.offset,
                    bytes_per_row: Some(stride as u32),
                    rows_per_image: Some(block[1]),
                },
            };
            let target = TexelCopyTextureInfo {
                texture: to,
                mip_level: 0,
                origin: Origin3d { x, y: y + line, z: z + slice },
                aspect: TextureAspect::All,
            };
            self.copies()?.copy_buffer_to_texture(source, target, extent(block));
            (done, left) = (done + rows, rest);
        }
        Ok(())
    }
}
