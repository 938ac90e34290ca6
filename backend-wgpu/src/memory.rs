//! What a device holds: buffers, and fields as textures.

use airlight_core::device::{
    BrickLayout, DeviceError, FieldFormat, FieldSpec, Layout, Limits, ResourceSpec, Slabs, Usage,
};
use wgpu::{Buffer, BufferUsages, Texture, TextureDimension, TextureFormat, TextureUsages, TextureView};

use crate::atlas::{Atlas, extent};
use crate::gpu::Gpu;
use crate::source::MAX_SLABS;
use crate::staging::Block;
use crate::texels::Texels;

/// A resource.
#[derive(Debug)]
pub(crate) enum Resource {
    Buffer(Memory),
    Field(Volume),
    /// A texture of our own.
    Texels(Texels),
}

/// A buffer and what was asked for, which it may exceed by less than four words.
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

/// A field. Its layers lie one behind the other along z, and that axis is cut into slabs that fit a texture each. One in
/// bricks has a texture of bricks, and beside it an index.
#[derive(Debug)]
pub(crate) struct Volume {
    pub(crate) spec: FieldSpec,
    pub(crate) slabs: Slabs,
    pub(crate) textures: Vec<(Texture, TextureView)>,
    pub(crate) atlas: Option<Atlas>,
}

/// The format of a field's textures.
pub(crate) fn texture_format(format: FieldFormat) -> TextureFormat {
    match format {
        FieldFormat::Scalar => TextureFormat::R32Float,
        FieldFormat::Half { .. } => TextureFormat::R16Float,
        FieldFormat::Rgba => TextureFormat::Rgba32Float,
    }
}

/// A texture of texels of so many bytes, filled with zeros.
pub(crate) fn texture(gpu: &Gpu, size: [u32; 3], format: TextureFormat, texel: u64) -> Result<Texture, DeviceError> {
    // Not every device stores halves, and what is published is of 32 bits.
    let stored =
        if format == TextureFormat::R16Float { TextureUsages::empty() } else { TextureUsages::STORAGE_BINDING };
    let description = wgpu::TextureDescriptor {
        label: Some("field"),
        size: extent(size),
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D3,
        format,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST | stored,
        view_formats: &[],
    };
    let bytes = size.map(u64::from).iter().product::<u64>() * texel;
    gpu.texture(bytes, &description)
}

impl Resource {
    /// Makes what is asked for, filled with zeros.
    pub(crate) fn new(gpu: &Gpu, spec: &ResourceSpec, limits: &Limits) -> Result<Self, DeviceError> {
        match spec {
            ResourceSpec::Buffer { bytes, .. } => {
                // A binding holds at least one element, also where nothing is in it; copies end with a whole texel.
                let size = bytes.checked_next_multiple_of(16).unwrap_or(*bytes).max(16);
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
            Self::Texels(texels) => ResourceSpec::Buffer { bytes: texels.bytes, usage: Usage::Work },
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
        if let Layout::Bricks(layout) = spec.layout {
            let (atlas, size) = Atlas::new(gpu, &spec, layout, limits)?;
            let bricks = texture(gpu, size, texture_format(spec.format), spec.format.bytes())?;
            let view = gpu.guarded(0, || bricks.create_view(&Default::default()))?;
            let slabs = Slabs { len: 1, per_slab: 1 };
            return Ok(Self { spec, slabs, textures: vec![(bricks, view)], atlas: Some(atlas) });
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
            let size = [x, y, slabs.range(slab).len() as u32];
            let texture = texture(gpu, size, texture_format(spec.format), spec.format.bytes())?;
            let view = gpu.guarded(0, || texture.create_view(&Default::default()))?;
            Ok((texture, view))
        });
        let textures = textures.collect::<Result<_, DeviceError>>()?;
        Ok(Self { spec, slabs, textures, atlas: None })
    }

    /// Writes whole z-slices, layer fastest, then x, y and z; or words of the index, or whole bricks.
    pub(crate) fn write(&self, gpu: &mut Gpu, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        if let Some(atlas) = &self.atlas {
            let index = BrickLayout::index_bytes(self.spec.dims);
            if offset < index {
                return atlas.write_index(gpu, (offset / 4) as u32, data);
            }
            let first = (offset - index) / BrickLayout::brick_bytes(self.spec.format);
            return atlas.write_bricks(gpu, &self.textures[0].0, &self.spec, first as u32, data);
        }
        let first = (offset / self.spec.slice_bytes()) as u32;
        let (layers, texel) = (self.spec.layers as usize, self.spec.format.bytes() as usize);
        if layers == 1 {
            return self.write_slices(gpu, first, data);
        }
        for (n, slice) in data.chunks_exact(self.spec.slice_bytes() as usize).enumerate() {
            let z = first + n as u32;
            for layer in 0..layers {
                let texels = slice.chunks_exact(texel).skip(layer).step_by(layers);
                let one: Vec<u8> = texels.flatten().copied().collect();
                self.write_slices(gpu, layer as u32 * self.spec.dims[2] + z, &one)?;
            }
        }
        Ok(())
    }

    /// Writes slices from one on, counted through all layers.
    fn write_slices(&self, gpu: &mut Gpu, first: u32, data: &[u8]) -> Result<(), DeviceError> {
        let [width, height, _] = self.spec.dims;
        let texel = self.spec.format.bytes() as u32;
        let bytes = width as usize * height as usize * texel as usize;
        let (mut next, mut left) = (first, data);
        while !left.is_empty() {
            let (slab, z) = self.slabs.locate(next);
            let depth = (self.slabs.range(slab).end - next).min((left.len() / bytes) as u32);
            let (now, rest) = left.split_at(depth as usize * bytes);
            let block = Block { origin: [0, 0, z], size: [width, height, depth], texel };
            gpu.write_texels(&self.textures[slab as usize].0, block, now)?;
            (next, left) = (next + depth, rest);
        }
        Ok(())
    }
}
