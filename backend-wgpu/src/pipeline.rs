//! Kernels built for the device.

use std::fmt::Write as _;

use airlight_core::device::DeviceError;
use wgpu::{
    BindGroupLayout, BindGroupLayoutEntry, BindingType, BufferBindingType, ComputePipeline, PipelineCompilationOptions,
    Sampler, SamplerBindingType, ShaderModule, ShaderStages, StorageTextureAccess, TextureFormat, TextureSampleType,
    TextureViewDimension,
};

use crate::gpu::Gpu;
use crate::memory::texture_format;
use crate::source::{Fetched, Shape, ShapeKind, Text, index_binding, slab_binding};
use crate::texels;

/// A kernel built for bindings of one shape.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub(crate) compute: ComputePipeline,
    /// Parameters, buffers and textures; the last are left out where there are none.
    pub(crate) layouts: Vec<BindGroupLayout>,
    /// What it filters fields with.
    pub(crate) sampler: Option<Sampler>,
}

fn entry(binding: u32, ty: BindingType) -> BindGroupLayoutEntry {
    BindGroupLayoutEntry { binding, visibility: ShaderStages::COMPUTE, ty, count: None }
}

fn buffer(ty: BufferBindingType) -> BindingType {
    // Parameters stand elsewhere for every dispatch.
    BindingType::Buffer { ty, has_dynamic_offset: ty == BufferBindingType::Uniform, min_binding_size: None }
}

/// A storage texture that is read.
fn stored(format: TextureFormat, view_dimension: TextureViewDimension) -> BindingType {
    BindingType::StorageTexture { access: StorageTextureAccess::ReadOnly, format, view_dimension }
}

/// A storage texture that is written, and may be read.
fn held(format: TextureFormat) -> BindingType {
    let (access, view_dimension) = (StorageTextureAccess::ReadWrite, TextureViewDimension::D2);
    BindingType::StorageTexture { access, format, view_dimension }
}

/// The buffers and textures of a stage's bindings.
fn entries(shapes: &[Shape], fetched: Fetched, filtered: bool) -> [Vec<BindGroupLayoutEntry>; 2] {
    let (mut buffers, mut textures) = (Vec::new(), Vec::new());
    for (index, shape) in shapes.iter().enumerate() {
        match shape.kind {
            ShapeKind::Read if fetched.has(index) => {
                let stored = stored(texels::format(fetched.words(index, shape.element)), TextureViewDimension::D2);
                textures.push(entry(slab_binding(index, 0), stored));
            }
            ShapeKind::Write if fetched.has(index) => {
                textures.push(entry(slab_binding(index, 0), held(texels::format(fetched.words(index, shape.element)))));
            }
            ShapeKind::Read | ShapeKind::Write => {
                let read_only = shape.kind == ShapeKind::Read;
                buffers.push(entry(index as u32, buffer(BufferBindingType::Storage { read_only })));
            }
            ShapeKind::Field { slabs, format, bricks, .. } => {
                let sampled = |sample_type| BindingType::Texture {
                    sample_type,
                    view_dimension: TextureViewDimension::D3,
                    multisampled: false,
                };
                let read = |format, sample_type| match fetched.has(index) {
                    true => stored(format, TextureViewDimension::D3),
                    false => sampled(sample_type),
                };
                // Where kernels load texels, 32-bit floats need not be filterable.
                let ty = read(texture_format(format), TextureSampleType::Float { filterable: filtered });
                let index_ty = read(TextureFormat::R32Uint, TextureSampleType::Uint);
                textures.extend((0..slabs).map(|slab| entry(slab_binding(index, slab), ty)));
                textures.extend(bricks.then(|| entry(index_binding(index), index_ty)));
            }
        }
    }
    [buffers, textures]
}

impl Pipeline {
    /// Builds a stage's kernel, which filters fields with `sampler` where there is one.
    pub(crate) fn of_stage(
        gpu: &Gpu,
        name: &str,
        text: &Text,
        (shapes, fetched): (&[Shape], Fetched),
        sampler: Option<&Sampler>,
    ) -> Result<Self, DeviceError> {
        Self::build(gpu, name, text, entries(shapes, fetched, sampler.is_some()), sampler)
    }

    /// Builds the kernel that publishes a buffer as a slab of a field.
    pub(crate) fn of_publish(gpu: &Gpu, text: &Text, format: TextureFormat) -> Result<Self, DeviceError> {
        let slab = BindingType::StorageTexture {
            access: StorageTextureAccess::WriteOnly,
            format,
            view_dimension: TextureViewDimension::D3,
        };
        let source = entry(0, buffer(BufferBindingType::Storage { read_only: true }));
        Self::build(gpu, "publish", text, [vec![source], vec![entry(0, slab)]], None)
    }

    /// Builds a kernel that reads or writes one buffer and some textures, all as `group` 2 has them.
    pub(crate) fn of_engine(
        gpu: &Gpu,
        name: &str,
        text: &Text,
        read_only: bool,
        textures: &[BindingType],
    ) -> Result<Self, DeviceError> {
        let textures = (0..).zip(textures).map(|(binding, ty)| entry(binding, *ty)).collect();
        let memory = entry(0, buffer(BufferBindingType::Storage { read_only }));
        Self::build(gpu, name, text, [vec![memory], textures], None)
    }

    fn build(
        gpu: &Gpu,
        name: &str,
        text: &Text,
        [buffers, textures]: [Vec<BindGroupLayoutEntry>; 2],
        sampler: Option<&Sampler>,
    ) -> Result<Self, DeviceError> {
        let module = compile(gpu, name, text)?;
        let uniform = buffer(BufferBindingType::Uniform);
        let mut fixed = vec![entry(0, uniform), entry(1, uniform)];
        fixed.extend(sampler.map(|_| entry(2, BindingType::Sampler(SamplerBindingType::Filtering))));
        let mut groups = vec![fixed, buffers];
        groups.extend(Some(textures).filter(|textures| !textures.is_empty()));
        gpu.count(|made| &mut made.pipelines);
        gpu.guarded(0, || {
            let layouts: Vec<_> = groups
                .iter()
                .map(|entries| {
                    let description = wgpu::BindGroupLayoutDescriptor { label: Some(name), entries };
                    gpu.device.create_bind_group_layout(&description)
                })
                .collect();
            let all: Vec<_> = layouts.iter().map(Some).collect();
            let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: &all,
                immediate_size: 0,
            });
            let compute = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(name),
                // Kernels write what they share before they read it.
                compilation_options: PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            });
            Self { compute, layouts, sampler: sampler.cloned() }
        })
    }
}

/// Compiles a kernel's text; faults name their file and line.
pub(crate) fn compile(gpu: &Gpu, name: &str, text: &Text) -> Result<ShaderModule, DeviceError> {
    let source = wgpu::ShaderSource::Wgsl(text.whole.as_str().into());
    let mut said = String::new();
    let module = gpu.guarded(0, || {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source });
        for message in pollster::block_on(module.get_compilation_info()).messages {
            if message.message_type == wgpu::CompilationMessageType::Error {
                let (file, line) = text.place(message.location.map_or(0, |at| at.line_number as usize));
                // Writing to a String cannot fail.
                let _ = write!(said, "{file}:{line}: {}", message.message.trim());
            }
        }
        module
    });
    match module {
        Err(DeviceError::Backend(_)) if !said.is_empty() => Err(DeviceError::Backend(said)),
        other => other,
    }
}
