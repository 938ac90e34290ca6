//! `trace`: where view rays meet surfaces.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Trace, TraceParams};
use rayon::prelude::*;

use super::mesh::{Line, Mesh, line};
use super::view::{View, view};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, lanes, triple};
use crate::simd::Simd;

/// Packets that one task takes at the least.
const TASK: usize = 8;

struct Inputs<'a> {
    p: &'a TraceParams,
    view: View<'a>,
    mesh: Mesh<'a>,
    /// Last position of the range.
    last: usize,
}

pub(crate) fn run(stage: &Trace, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.hits)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        view: View {
            axes: [p.forward, p.right, p.up],
            size: [p.width, p.height],
            samples: p.samples,
            positions: read.buf(stage.tables)?,
        },
        mesh: Mesh::new(read.buf(stage.mesh)?, p.nodes),
        last: range.end as usize - 1,
    };
    let out: &mut [[[f32; 4]; 2]] = bytemuck::cast_slice_mut(out.remove(0));
    let out = &mut out[range.start as usize..range.end as usize];
    out.par_chunks_mut(LANES).with_min_len(TASK).enumerate().for_each(|(n, hits)| {
        let (inputs, first) = (&inputs, range.start as usize + n * LANES);
        compiled_for!(isa, trace<S>(inputs: &Inputs<'_>, first: usize, hits: &mut [[[f32; 4]; 2]]));
    });
    Ok(())
}

/// Up to sixteen positions from `first` on.
#[inline(always)]
fn trace<S: Simd>(inputs: &Inputs<'_>, first: usize, hits: &mut [[[f32; 4]; 2]]) {
    let p = inputs.p;
    let of = line(triple!(a => F::<S>::splat(p.eye[a])), view(&inputs.view, first, inputs.last));
    let known = p.node_begin > 0;
    let last = hits.len() - 1;
    let limit = if known { F::of(lanes!(i => hits[i.min(last)][0][3])) } else { F::splat(f32::INFINITY) };
    let hit = inputs.mesh.nearest(&of, 0.0, limit, [p.node_begin, p.node_end]);
    for (i, place) in hits.iter_mut().enumerate() {
        if hit.distance.0[i] < f32::INFINITY {
            let (at, material) = inputs.mesh.triangle(hit.triangle[i]);
            let own = facet(inputs.mesh, &of, i, at);
            let [a, b, c] = [3, 4, 5].map(|n| inputs.mesh.place(at + n));
            let weights = triple!(n => hit.weights[n].0[i]);
            let normal = triple!(n => weights[0] * a[n] + weights[1] * b[n] + weights[2] * c[n]);
            let size = dot(normal, normal).sqrt();
            let normal = if size > 0.0 { normal.map(|v| v / size) } else { own };
            let [x, y, z] = if dot(normal, own) < 0.0 { normal.map(|v| -v) } else { normal };
            *place = [[x, y, z, hit.distance.0[i]], [own[0], own[1], own[2], material as f32]];
        } else if !known {
            *place = [[0.0, 0.0, 0.0, f32::INFINITY], [0.0; 4]];
        }
    }
}

/// The normal of the triangle whose records begin at `at`, on the side that the ray of a lane comes from.
#[inline(always)]
fn facet<S: Simd>(mesh: Mesh<'_>, of: &Line<S>, lane: usize, at: usize) -> [f32; 3] {
    let [a, b, c] = [0, 1, 2].map(|n| mesh.place(at + n));
    let (p, q) = (triple!(n => b[n] - a[n]), triple!(n => c[n] - a[n]));
    let across = triple!(n => p[(n + 1) % 3] * q[(n + 2) % 3] - p[(n + 2) % 3] * q[(n + 1) % 3]);
    let size = dot(across, across).sqrt().max(f32::MIN_POSITIVE);
    let own = across.map(|v| v / size);
    if dot(own, triple!(n => of.direction[n].0[lane])) > 0.0 { own.map(|v| -v) } else { own }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
