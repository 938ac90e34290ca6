//! Recording the pieces of a dispatch.

use std::ops::Range;

use airlight_core::device::DeviceError;
use wgpu::{BindGroup, Buffer, ComputePass, QuerySet};

use crate::batch::UNIFORM;
use crate::gpu::Gpu;
use crate::groups::{Entry, Groups};
use crate::pipeline::Pipeline;
use crate::source::Launch;
use crate::store::Bound;
use crate::texels::Copy;

/// A piece of a dispatch.
#[derive(Debug)]
pub(crate) struct Shot<'s> {
    /// Units of the work axis.
    pub(crate) range: Range<u32>,
    /// First group of the buffers that are bound in parts.
    pub(crate) first: u32,
    /// The unit past the last of those that a workgroup of a sweep takes in order, from `first` on.
    pub(crate) past: u32,
    pub(crate) bound: Bound<'s>,
}

/// The pieces of a dispatch that one pipeline runs.
#[derive(Debug)]
pub(crate) struct Launches<'s> {
    pub(crate) pipeline: &'s Pipeline,
    pub(crate) params: &'s [u8],
    /// Units that a workgroup takes, or items of a unit.
    pub(crate) units: u32,
    /// What the first unit of an invocation is a multiple of.
    pub(crate) aligned: u32,
    /// Where units run in order, one a dispatch: the items of a unit.
    pub(crate) sequential: Option<u32>,
    /// Buffers to be copied before.
    pub(crate) copies: Vec<Copy<'s>>,
    /// Those to be copied back behind it.
    pub(crate) written: Vec<Copy<'s>>,
    pub(crate) shots: Vec<Shot<'s>>,
}

/// Records all launches in order, a pass each, between two time stamps where they are given.
pub(crate) fn record(
    gpu: &mut Gpu,
    groups: &mut Groups,
    limits: &wgpu::Limits,
    what: &'static str,
    all: &[Launches<'_>],
    stamps: Option<(&QuerySet, u32)>,
) -> Result<(), DeviceError> {
    let room = gpu.make_room(all.iter().map(Launches::room).sum())?;
    room.outgrown.iter().for_each(|gone| groups.forget_buffer(gone));
    let ready = all.iter().map(|launches| launches.ready(gpu, groups, limits, &room.uniforms));
    let ready = ready.collect::<Result<Vec<_>, DeviceError>>()?;
    let commands = gpu.guarded(0, || {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (n, (launches, ready)) in all.iter().zip(&ready).enumerate() {
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
            launches.encode(&mut pass, ready);
            drop(pass);
            launches.written.iter().for_each(|copy| copy.encode_back(&mut encoder));
        }
        encoder.finish()
    })?;
    gpu.record(what, commands)
}

/// What launches bind: the parameters and where each dispatch stands, whose workgroups are told too; and buffers and
/// textures of each shot.
struct Ready {
    constants: BindGroup,
    params: u32,
    dispatches: Vec<(u32, [u32; 2])>,
    shots: Vec<Vec<BindGroup>>,
}

impl Launches<'_> {
    /// Bytes of the parameters and of where each dispatch stands.
    fn room(&self) -> u64 {
        (self.params.len().next_multiple_of(UNIFORM) + self.dispatches().count() * UNIFORM) as u64
    }

    fn ready(
        &self,
        gpu: &mut Gpu,
        groups: &mut Groups,
        limits: &wgpu::Limits,
        uniforms: &Buffer,
    ) -> Result<Ready, DeviceError> {
        let most = limits.max_compute_workgroups_per_dimension.max(1);
        let params = gpu.batch.push_params(self.params);
        let threads = gpu.threads;
        let place = |(shot, start, count): (&Shot<'_>, u32, u32)| {
            let workgroups = (start % self.aligned + count).div_ceil(self.units);
            let across = workgroups.min(most).max(1);
            let Shot { first, past, .. } = *shot;
            let share = workgroups / threads;
            let launch = Launch { start, count, first, across, infinity: f32::INFINITY, threads, share, past };
            (gpu.batch.push_params(bytemuck::bytes_of(&launch)), [across, workgroups.div_ceil(across)])
        };
        let dispatches = self.dispatches().map(place).collect();
        let [constants, rest @ ..] = &self.pipeline.layouts[..] else {
            return Err(DeviceError::Invalid("a kernel without parameters".into()));
        };
        let entries = [(0, self.params.len()), (1, size_of::<Launch>())];
        let entries = entries.map(|(number, bytes)| Entry::Buffer(number, uniforms.clone(), 0, bytes as u64));
        let sampler = self.pipeline.sampler.iter().map(|sampler| Entry::Sampler(2, sampler.clone()));
        let constants = groups.of(gpu, constants, entries.into_iter().chain(sampler).collect())?;
        let shots = self.shots.iter().map(|shot| {
            let all = rest.iter().zip(shot.bound.entries());
            all.map(|(layout, entries)| groups.of(gpu, layout, entries)).collect()
        });
        let shots = shots.collect::<Result<_, DeviceError>>()?;
        Ok(Ready { constants, params, dispatches, shots })
    }

    fn encode(&self, pass: &mut ComputePass<'_>, ready: &Ready) {
        pass.set_pipeline(&self.pipeline.compute);
        let groups = self.shots.iter().zip(&ready.shots).flat_map(|(shot, groups)| {
            // Units of one piece see the same buffers.
            (0..self.units_of(shot).len()).map(move |n| (n == 0).then_some(groups))
        });
        for (groups, &(launch, [x, y])) in groups.zip(&ready.dispatches) {
            pass.set_bind_group(0, &ready.constants, &[ready.params, launch]);
            for (number, group) in (1..).zip(groups.into_iter().flatten()) {
                pass.set_bind_group(number, group, &[]);
            }
            // Each dispatch sees what the ones before it wrote.
            pass.dispatch_workgroups(x, y, 1);
        }
    }

    /// The first units of a shot's dispatches.
    fn units_of(&self, shot: &Shot<'_>) -> Range<u32> {
        let Range { start, end } = shot.range;
        if self.sequential.is_some() { start..end } else { start..start + 1 }
    }

    /// The dispatches in order: the piece, its first unit, and its units or the items of the one.
    fn dispatches(&self) -> impl Iterator<Item = (&Shot<'_>, u32, u32)> {
        self.shots.iter().flat_map(|shot| {
            let count = self.sequential.unwrap_or(shot.range.len() as u32);
            self.units_of(shot).map(move |unit| (shot, unit, count))
        })
    }
}
