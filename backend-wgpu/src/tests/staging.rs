//! What the host writes and reads, past what staging memory holds.

use wgpu::{
    BufferUsages, Extent3d, TexelCopyBufferInfo, TexelCopyBufferLayout, TextureDescriptor, TextureDimension,
    TextureFormat, TextureUsages,
};

use super::{content, device, filled};
use crate::staging::Block;

#[test]
fn buffers_larger_than_all_staging_memory_arrive_whole() {
    let Some(mut device) = device() else { return };
    // 40 MB of writes, and of what is read back, both beyond 32 MiB.
    let values: Vec<u32> = (0..10_000_000u32).map(|i| i.wrapping_mul(2_654_435_761)).collect();
    let small = filled(&mut device, 0, &[7u32, 8, 9]);
    let large = filled(&mut device, 1, &values);
    assert_eq!(content(&mut device, small), [7, 8, 9]);
    assert!(content(&mut device, large) == values);
}

#[test]
fn textures_are_written_by_slices_and_by_rows() {
    let Some(mut device) = device() else { return };
    let gpu = &mut device.gpu;
    // Slices of less than a chunk and of more, rows that are not multiples of 256 bytes.
    for [width, height, depth] in [[37, 23, 70], [300, 700, 3], [64, 1, 5]] {
        let size = Extent3d { width, height, depth_or_array_layers: depth };
        let description = TextureDescriptor {
            label: None,
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D3,
            format: TextureFormat::Rgba32Uint,
            usage: TextureUsages::COPY_SRC | TextureUsages::COPY_DST,
            view_formats: &[],
        };
        let texture = gpu.texture(0, &description).unwrap();
        let values: Vec<u32> = (0..4 * width * height * depth).map(|i| i ^ i << 13).collect();
        // All slices but the first, then that one.
        let slice = (4 * width * height) as usize;
        for (z, values) in [(1, &values[slice..]), (0, &values[..slice])] {
            let block =
                Block { origin: [0, 0, z], size: [width, height, if z == 0 { 1 } else { depth - 1 }], texel: 16 };
            gpu.write_texels(&texture, block, bytemuck::cast_slice(values)).unwrap();
        }
        let row = (16 * width).next_multiple_of(256);
        let bytes = u64::from(row * height * depth);
        let buffer = gpu.buffer("back", bytes, BufferUsages::COPY_DST | BufferUsages::COPY_SRC).unwrap();
        let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(height) };
        let to = TexelCopyBufferInfo { buffer: &buffer, layout };
        gpu.copies().unwrap().copy_texture_to_buffer(texture.as_image_copy(), to, size);
        let mut back = vec![0; bytes as usize];
        gpu.read(&buffer, 0, &mut back).unwrap();
        let rows = back.chunks_exact(row as usize).flat_map(|row| &row[..16 * width as usize]);
        let found: Vec<u32> = bytemuck::pod_collect_to_vec(&rows.copied().collect::<Vec<u8>>());
        assert!(found == values, "{width} × {height} × {depth}");
    }
}
