//! What a device holds: buffers, and fields as textures.

use airlight_core::device::{DeviceError, FieldFormat, FieldSpec, Limits, ResourceSpec, Slabs, Usage};
use wgpu::{Buffer, BufferUsages, Extent3d, Texture, TextureDimension, TextureFormat, TextureUsages, TextureView};

use crate::gpu::Gpu;
use crate::source::MAX_SLABS;
use crate::texels::Texels;

/// A resource.
#[derive(Debug)]
pub(crate) enum Resource {
    Buffer(Memory),
    Field(Volume),
}

/// A buffer and what was asked for, which it may exceed by less than a word.
#[derive(Debug)]
pub(crate) struct Memory {
    pub(crate) buffer: Buffer,
    pub(crate) bytes: u64,
    /// Copies as textures, where kernels read those: one for each size of texels.
    pub(crate) texels: Vec<Texels>,
}

impl Memory {
    /// Books that it was written.
    pub(crate) fn changed(&self) {
        self.texels.iter().for_each(|texels| texels.fresh.set(false));
    }
}

/// A field. Its layers lie one behind the other along z, and that axis is cut into slabs that fit a texture each.
#[derive(Debug)]
pub(crate) struct Volume {
    pub(crate) spec: FieldSpec,
    pub(crate) slabs: Slabs,
    pub(crate) textures: Vec<(Texture, TextureView)>,
}

/// The format of a field's textures.
pub(crate) fn texture_format(format: FieldFormat) -> TextureFormat {
    match format {
        FieldFormat::Scalar => TextureFormat::R32Float,
        FieldFormat::Rgba => TextureFormat::Rgba32Float,
    }
}

fn texture(gpu: &Gpu, [width, height, depth]: [u32; 3], format: FieldFormat) -> Result<Texture, DeviceError> {
    let description = wgpu::TextureDescriptor {
        label: Some("field"),
        size: Extent3d { width, height, depth_or_array_layers: depth },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D3,
        format: texture_format(format),
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    };
    let bytes = [width, height, depth].map(u64::from).iter().product::<u64>() * format.bytes();
    gpu.guarded(bytes, || gpu.device.create_texture(&description))
}

impl Resource {
    /// Makes what is asked for, filled with zeros.
    pub(crate) fn new(gpu: &Gpu, spec: &ResourceSpec, limits: &Limits) -> Result<Self, DeviceError> {
        match spec {
            ResourceSpec::Buffer { bytes, .. } => {
                // A binding holds at least one element, also where nothing is in it.
                let size = bytes.next_multiple_of(4).max(16);
                if size > limits.buffer_bytes {
                    let (what, limit) = ("a buffer", limits.buffer_bytes);
                    return Err(DeviceError::Limit { what, requested: size, limit });
                }
                let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
                let buffer = gpu.buffer("buffer", size, usage)?;
                Ok(Self::Buffer(Memory { buffer, bytes: *bytes, texels: Vec::new() }))
            }
            ResourceSpec::Field(spec) => Volume::new(gpu, *spec, limits).map(Self::Field),
        }
    }

    /// What was asked for.
    pub(crate) fn spec(&self) -> ResourceSpec {
        match self {
            Self::Buffer(memory) => ResourceSpec::Buffer { bytes: memory.bytes, usage: Usage::Work },
            Self::Field(volume) => ResourceSpec::Field(volume.spec),
        }
    }
}

impl Volume {
    /// Makes a field, filled with zeros.
    pub(crate) fn new(gpu: &Gpu, spec: FieldSpec, limits: &Limits) -> Result<Self, DeviceError> {
        let [x, y, z] = spec.dims;
        let side = u64::from(limits.field_side);
        let exceeds = |what, requested, limit| Err(DeviceError::Limit { what, requested, limit });
        if x == 0 || y == 0 || z == 0 || spec.layers == 0 {
            return Err(DeviceError::Invalid(format!("a field of {spec:?}")));
        }
        if u64::from(x.max(y)) > side {
            return exceeds("the side of a field along x or y", x.max(y).into(), side);
        }
        let slices = u64::from(z) * u64::from(spec.layers);
        if slices > side * u64::from(MAX_SLABS) {
            return exceeds("the slices of a field, over all its layers", slices, side * u64::from(MAX_SLABS));
        }
        // Slices of a texture have no limit in bytes of their own; `slices` was bounded above.
        let Some(slabs) = Slabs::new(slices as u32, 1, u64::MAX, limits.field_side) else {
            return exceeds("a slice of a field", 1, side);
        };
        let textures = (0..slabs.count()).map(|slab| {
            let texture = texture(gpu, [x, y, slabs.range(slab).len() as u32], spec.format)?;
            let view = gpu.guarded(0, || texture.create_view(&Default::default()))?;
            Ok((texture, view))
        });
        let textures = textures.collect::<Result<_, DeviceError>>()?;
        Ok(Self { spec, slabs, textures })
    }

    /// Writes whole z-slices from slice `first` on: layer fastest, then x, y and z.
    pub(crate) fn write(&self, gpu: &mut Gpu, first: u32, data: &[u8]) -> Result<(), DeviceError> {
        let (layers, texel) = (self.spec.layers as usize, self.spec.format.bytes() as usize);
        for (n, slice) in data.chunks_exact(self.spec.slice_bytes() as usize).enumerate() {
            let z = first + n as u32;
            if layers == 1 {
                self.write_slice(gpu, z, slice)?;
                continue;
            }
            for layer in 0..layers {
                let texels = slice.chunks_exact(texel).skip(layer).step_by(layers);
                let one: Vec<u8> = texels.flatten().copied().collect();
                self.write_slice(gpu, layer as u32 * self.spec.dims[2] + z, &one)?;
            }
        }
        Ok(())
    }

    /// Writes one slice, counted through all layers.
    fn write_slice(&self, gpu: &mut Gpu, slice: u32, data: &[u8]) -> Result<(), DeviceError> {
        let (slab, z) = self.slabs.locate(slice);
        let [width, height, _] = self.spec.dims;
        let target = wgpu::TexelCopyTextureInfo {
            texture: &self.textures[slab as usize].0,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z },
            aspect: wgpu::TextureAspect::All,
        };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(width * self.spec.format.bytes() as u32),
            rows_per_image: Some(height),
        };
        let size = Extent3d { width, height, depth_or_array_layers: 1 };
        gpu.guarded(data.len() as u64, || gpu.queue.write_texture(target, data, layout, size))?;
        gpu.wrote(data.len() as u64)
    }
}
