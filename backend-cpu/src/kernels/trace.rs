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
use crate::packet::{F, LANES, dot, lanes, together, triple};
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
    let met = hit.distance.lt(F::splat(f32::INFINITY));
    let (mut normals, mut facets) = ([[0.0, 0.0, 0.0, f32::INFINITY]; LANES], [[0.0; 4]; LANES]);
    if met.any() {
        let at = inputs.mesh.triangles(hit.triangle);
        let own = facet(inputs.mesh, &of, at);
        let [a, b, c] = [inputs.mesh.places(at, 3), inputs.mesh.places(at, 4), inputs.mesh.places(at, 5)];
        let normal = triple!(n => hit.weights[0] * a[n] + hit.weights[1] * b[n] + hit.weights[2] * c[n]);
        let size = dot(normal, normal).sqrt();
        let long = size.gt(F::ZERO);
        let normal = triple!(n => long.select(normal[n] / size, own[n]));
        let away = dot(normal, own).lt(F::ZERO);
        let normal = triple!(n => met.select(away.select(-normal[n], normal[n]), F::ZERO));
        let own = triple!(n => met.select(own[n], F::ZERO));
        let material = met.select(a[3].bits().to_float(), F::ZERO);
        normals = together([normal[0], normal[1], normal[2], hit.distance]);
        facets = together([own[0], own[1], own[2], material]);
    }
    for (i, place) in hits.iter_mut().enumerate() {
        // Else what earlier passes found stands.
        if met.lane(i) || !known {
            *place = [normals[i], facets[i]];
        }
    }
}

/// The normals of the triangles whose records begin at `at`, on the side that the rays come from.
#[inline(always)]
fn facet<S: Simd>(mesh: Mesh<'_>, of: &Line<S>, at: [usize; LANES]) -> [F<S>; 3] {
    let [a, b, c] = [mesh.places(at, 0), mesh.places(at, 1), mesh.places(at, 2)];
    let (p, q) = (triple!(n => b[n] - a[n]), triple!(n => c[n] - a[n]));
    let across = triple!(n => p[(n + 1) % 3] * q[(n + 2) % 3] - p[(n + 2) % 3] * q[(n + 1) % 3]);
    let size = dot(across, across).sqrt().max(F::splat(f32::MIN_POSITIVE));
    let own = triple!(n => across[n] / size);
    let away = dot(own, of.direction).gt(F::ZERO);
    triple!(n => away.select(-own[n], own[n]))
}
