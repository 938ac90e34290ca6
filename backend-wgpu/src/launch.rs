//! Sending the pieces of a dispatch to the queue.

use std::ops::Range;

use airlight_core::device::DeviceError;
use bytemuck::Zeroable;
use wgpu::{
    BindGroup, BindGroupEntry, BindGroupLayout, BindingResource, Buffer, BufferBinding, BufferSize, BufferUsages,
    ComputePass, QuerySet, SubmissionIndex,
};

use crate::gpu::Gpu;
use crate::pipeline::Pipeline;
use crate::source::Launch;
use crate::store::Bound;
use crate::texels::Copy;

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

/// The pieces of a dispatch that one pipeline runs.
#[derive(Debug)]
pub(crate) struct Launches<'s> {
    pub(crate) pipeline: &'s Pipeline,
    pub(crate) params: &'s [u8],
    /// Units that a workgroup takes, or items of a unit.
    pub(crate) units: u32,
    /// Where units run in order, one a dispatch: the items of a unit.
    pub(crate) sequential: Option<u32>,
    /// Buffers to be copied before.
    pub(crate) copies: Vec<Copy<'s>>,
    pub(crate) shots: Vec<Shot<'s>>,
}

/// Sends all launches in order, a pass each, between two time stamps where they are given.
pub(crate) fn send(
    gpu: &Gpu,
    limits: &wgpu::Limits,
    all: &[Launches<'_>],
    stamps: Option<(&QuerySet, u32)>,
) -> Result<SubmissionIndex, DeviceError> {
    let uniforms =
        all.iter().map(|launches| launches.uniforms(gpu, limits)).collect::<Result<Vec<_>, DeviceError>>()?;
    gpu.guarded(0, || {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (n, (launches, uniforms)) in all.iter().zip(&uniforms).enumerate() {
            launches.copies.iter().for_each(|copy| copy.encode(&mut encoder));
            let (begins, ends) = (n == 0, n + 1 == all.len());
            let stamps = stamps.filter(|_| begins || ends);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: stamps.map(|(query_set, first)| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: begins.then_some(first),
                    end_of_pass_write_index: ends.then_some(first + 1),
                }),
            });
            launches.encode(gpu, &mut pass, uniforms);
        }
        gpu.queue.submit([encoder.finish()])
    })
}

/// The parameters and where each dispatch stands, in a buffer; the workgroups of each dispatch.
struct Uniforms {
    buffer: Buffer,
    sizes: Vec<[u32; 2]>,
}

impl Launches<'_> {
    fn uniforms(&self, gpu: &Gpu, limits: &wgpu::Limits) -> Result<Uniforms, DeviceError> {
        let most = limits.max_compute_workgroups_per_dimension.max(1);
        let params = self.params.len().next_multiple_of(UNIFORM);
        let mut uniforms = self.params.to_vec();
        let mut sizes = Vec::new();
        for (shot, start, count) in self.dispatches() {
            let workgroups = count.div_ceil(self.units);
            let across = workgroups.min(most).max(1);
            let first = shot.first;
            let launch = Launch { start, count, first, across, infinity: f32::INFINITY, ..Launch::zeroed() };
            uniforms.resize(params + sizes.len() * UNIFORM, 0);
            uniforms.extend(bytemuck::bytes_of(&launch));
            sizes.push([across, workgroups.div_ceil(across)]);
        }
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let buffer = gpu.buffer("parameters", uniforms.len() as u64, usage)?;
        gpu.guarded(0, || gpu.queue.write_buffer(&buffer, 0, &uniforms))?;
        Ok(Uniforms { buffer, sizes })
    }

    fn encode(&self, gpu: &Gpu, pass: &mut ComputePass<'_>, uniforms: &Uniforms) {
        let params = self.params.len().next_multiple_of(UNIFORM);
        pass.set_pipeline(&self.pipeline.compute);
        let mut bound: Option<&Bound<'_>> = None;
        for (n, ((shot, ..), &[x, y])) in self.dispatches().zip(&uniforms.sizes).enumerate() {
            let at = (params + n * UNIFORM) as u64;
            pass.set_bind_group(0, &self.constants(gpu, &uniforms.buffer, at), &[]);
            // Units of one piece see the same buffers.
            if !bound.is_some_and(|bound| std::ptr::eq(bound, &shot.bound)) {
                for (group, bind) in (1..).zip(bind(gpu, self.pipeline, &shot.bound)) {
                    pass.set_bind_group(group, &bind, &[]);
                }
                bound = Some(&shot.bound);
            }
            // Each dispatch sees what the ones before it wrote.
            pass.dispatch_workgroups(x, y, 1);
        }
    }

    /// The dispatches in order: the piece, its first unit, and its units or the items of the one.
    fn dispatches(&self) -> impl Iterator<Item = (&Shot<'_>, u32, u32)> {
        self.shots.iter().flat_map(|shot| {
            let (units, count) = match self.sequential {
                Some(items) => (shot.range.clone(), items),
                None => (shot.range.start..shot.range.start + 1, shot.range.len() as u32),
            };
            units.map(move |unit| (shot, unit, count))
        })
    }

    /// Parameters, where the dispatch stands, and the filter of fields that are filtered by the texture unit.
    fn constants(&self, gpu: &Gpu, uniforms: &Buffer, launch_at: u64) -> BindGroup {
        let launch = (1, uniforms, launch_at, size_of::<Launch>() as u64);
        let mut entries = buffers(&[(0, uniforms, 0, self.params.len() as u64), launch]);
        let sampler = self.pipeline.sampler.as_ref();
        entries.extend(sampler.map(|s| BindGroupEntry { binding: 2, resource: BindingResource::Sampler(s) }));
        group(gpu, &self.pipeline.layouts[0], &entries)
    }
}

/// Buffers and textures.
fn bind(gpu: &Gpu, pipeline: &Pipeline, bound: &Bound<'_>) -> Vec<BindGroup> {
    let textures = bound
        .textures
        .iter()
        .map(|&(binding, view)| BindGroupEntry { binding, resource: BindingResource::TextureView(view) });
    let entries = [buffers(&bound.buffers), textures.collect()];
    pipeline.layouts[1..].iter().zip(&entries).map(|(layout, entries)| group(gpu, layout, entries)).collect()
}

fn group(gpu: &Gpu, layout: &BindGroupLayout, entries: &[BindGroupEntry<'_>]) -> BindGroup {
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries })
}

fn buffers<'b>(all: &[(u32, &'b Buffer, u64, u64)]) -> Vec<BindGroupEntry<'b>> {
    let entry = |&(binding, buffer, offset, bytes): &(u32, &'b Buffer, u64, u64)| {
        let size = BufferSize::new(bytes);
        BindGroupEntry { binding, resource: BindingResource::Buffer(BufferBinding { buffer, offset, size }) }
    };
    all.iter().map(entry).collect()
}
