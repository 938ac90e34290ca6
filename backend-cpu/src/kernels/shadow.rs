//! `shadow`: maps of how far lights reach.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{FAR, LightRecord, MeshRecord, Shadow, ShadowParams};
use rayon::prelude::*;

use super::face::face;
use super::mesh::{Mesh, line};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, dot, lanes, triple};
use crate::simd::Simd;

/// Packets that one task takes at the least.
const TASK: usize = 8;

struct Inputs<'a> {
    p: &'a ShadowParams,
    lights: &'a [LightRecord],
    mesh: Mesh<'a>,
}

pub(crate) fn run(stage: &Shadow, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        lights: &read.buf(stage.lights)?[..p.lights as usize],
        mesh: Mesh::new(read.buf(stage.mesh)?, p.nodes),
    };
    let out: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    let face = (p.side * p.side) as usize;
    let (start, end) = (range.start as usize, range.end as usize);
    // A packet is within one face.
    let mut packets = Vec::new();
    let mut rest = &mut out[start..end];
    let mut at = start;
    while at < end {
        let count = LANES.min(end - at).min(face - at % face);
        let (packet, others) = rest.split_at_mut(count);
        packets.push((at, packet));
        (rest, at) = (others, at + count);
    }
    // Faces that see nothing are done in no time: small tasks are what threads can share.
    packets.into_par_iter().with_min_len(TASK).with_max_len(TASK).for_each(|(first, reach)| {
        let inputs = &inputs;
        compiled_for!(isa, shadow<S>(inputs: &Inputs<'_>, first: usize, reach: &mut [f32]));
    });
    Ok(())
}

/// Up to sixteen texels of a face from `first` on.
#[inline(always)]
fn shadow<S: Simd>(inputs: &Inputs<'_>, first: usize, reach: &mut [f32]) {
    let p = inputs.p;
    let side = p.side as usize;
    let number = first / (side * side);
    // The light whose face it is.
    let last = inputs.lights.iter().skip(1).take_while(|light| light.power[3] as usize <= number).count();
    let light = &inputs.lights[last];
    let of = face(light, number - light.power[3] as usize, p.extent);
    let texel: [usize; LANES] = lanes!(i => first + i);
    let x = (F::<S>::of(lanes!(i => (texel[i] % side) as f32)) + 0.5) * (2.0 / p.side as f32) - 1.0;
    let y = (F::of(lanes!(i => (texel[i] / side % side) as f32)) + 0.5) * (2.0 / p.side as f32) - 1.0;
    let across = triple!(a => (x * of.right[a] + y * of.up[a]) * of.half_width);
    let (range, limit) = ([p.node_begin, p.node_end], F::splat(f32::INFINITY));
    let found = if light.position[3] == 0.0 {
        let origin = triple!(a => across[a] - p.extent * of.forward[a]);
        let forward = triple!(a => F::splat(of.forward[a]));
        inputs.mesh.nearest(&line(origin, forward), 0.0, limit, range).distance
    } else {
        let toward = triple!(a => across[a] + of.forward[a]);
        let size = dot(toward, toward).sqrt();
        let way = line(triple!(a => F::splat(light.position[a])), triple!(a => toward[a] / size));
        inputs.mesh.nearest(&way, MeshRecord::MARGIN * p.extent, limit, range).distance / size
    };
    for (i, place) in reach.iter_mut().enumerate() {
        let found = found.0[i].min(FAR);
        *place = if p.node_begin > 0 { found.min(*place) } else { found };
    }
}
