//! Sending the pieces of a dispatch to the queue.

use std::ops::Range;

use airlight_core::device::DeviceError;
use bytemuck::Zeroable;
use wgpu::{
    BindGroup, BindGroupEntry, BindingResource, Buffer, BufferBinding, BufferSize, BufferUsages, QuerySet,
    SubmissionIndex,
};

use crate::gpu::Gpu;
use crate::pipeline::Pipeline;
use crate::source::Launch;
use crate::store::Bound;

/// Uniforms begin at multiples of this; WebGPU lets no adapter ask for more.
const UNIFORM: usize = 256;

/// A piece of a dispatch.
#[derive(Debug)]
pub(crate) struct Shot<'s> {
    /// Units of the work axis.
    pub(crate) range: Range<u32>,
    /// First group of the buffers that are bound in parts.
    pub(crate) first: u32,
    pub(crate) bound: Bound<'s>,
}

/// The pieces of a dispatch.
#[derive(Debug)]
pub(crate) struct Launches<'s> {
    pub(crate) params: &'s [u8],
    /// Units that a workgroup takes.
    pub(crate) units: u32,
    pub(crate) shots: Vec<Shot<'s>>,
    pub(crate) limits: &'s wgpu::Limits,
}

impl Launches<'_> {
    /// Sends all pieces as one pass, between two time stamps where they are given.
    pub(crate) fn run(
        &self,
        gpu: &Gpu,
        pipeline: &Pipeline,
        stamps: Option<(&QuerySet, u32)>,
    ) -> Result<SubmissionIndex, DeviceError> {
        let most = self.limits.max_compute_workgroups_per_dimension.max(1);
        let params = self.params.len().next_multiple_of(UNIFORM);
        let mut uniforms = self.params.to_vec();
        let mut sizes = Vec::new();
        for (n, shot) in self.shots.iter().enumerate() {
            let workgroups = (shot.range.len() as u32).div_ceil(self.units);
            let across = workgroups.min(most).max(1);
            let launch = Launch {
                start: shot.range.start,
                count: shot.range.len() as u32,
                first: shot.first,
                across,
                infinity: f32::INFINITY,
                ..Launch::zeroed()
            };
            uniforms.resize(params + n * UNIFORM, 0);
            uniforms.extend(bytemuck::bytes_of(&launch));
            sizes.push([across, workgroups.div_ceil(across)]);
        }
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let buffer = gpu.buffer("parameters", uniforms.len() as u64, usage)?;
        gpu.guarded(0, || {
            gpu.queue.write_buffer(&buffer, 0, &uniforms);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: stamps.map(|(query_set, first)| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(first),
                    end_of_pass_write_index: Some(first + 1),
                }),
            });
            pass.set_pipeline(&pipeline.compute);
            for ((n, shot), [x, y]) in self.shots.iter().enumerate().zip(sizes) {
                let at = (params + n * UNIFORM) as u64;
                for (group, bind) in (0..).zip(self.bind(gpu, pipeline, &buffer, at, &shot.bound)) {
                    pass.set_bind_group(group, &bind, &[]);
                }
                pass.dispatch_workgroups(x, y, 1);
            }
            drop(pass);
            gpu.queue.submit([encoder.finish()])
        })
    }

    fn bind(
        &self,
        gpu: &Gpu,
        pipeline: &Pipeline,
        uniforms: &Buffer,
        launch_at: u64,
        bound: &Bound<'_>,
    ) -> Vec<BindGroup> {
        let launch = (1, uniforms, launch_at, size_of::<Launch>() as u64);
        let fixed = [(0, uniforms, 0, self.params.len() as u64), launch];
        let textures = bound
            .textures
            .iter()
            .map(|&(binding, view)| BindGroupEntry { binding, resource: BindingResource::TextureView(view) });
        let sampler = pipeline.sampler.as_ref();
        let sampler = sampler.map(|s| BindGroupEntry { binding: 2, resource: BindingResource::Sampler(s) });
        let fixed = buffers(&fixed).into_iter().chain(sampler).collect();
        let entries = [fixed, buffers(&bound.buffers), textures.collect()];
        let layouts = pipeline.layouts.iter().zip(&entries);
        let group = |(layout, entries): (_, &Vec<_>)| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries })
        };
        layouts.map(group).collect()
    }
}

fn buffers<'b>(all: &[(u32, &'b Buffer, u64, u64)]) -> Vec<BindGroupEntry<'b>> {
    let entry = |&(binding, buffer, offset, bytes): &(u32, &'b Buffer, u64, u64)| {
        let size = BufferSize::new(bytes);
        BindGroupEntry { binding, resource: BindingResource::Buffer(BufferBinding { buffer, offset, size }) }
    };
    all.iter().map(entry).collect()
}
