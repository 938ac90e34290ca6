//! `obstruct`: which of a cell's neighbours lie behind surfaces.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Obstruct, ObstructParams};
use rayon::prelude::*;

use super::mesh::{Mesh, line};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, dot, lanes, triple};
use crate::simd::Simd;

/// Packets that one task takes: some cells have many triangles near, and most none.
const TASK: usize = 4;

struct Inputs<'a> {
    p: &'a ObstructParams,
    mesh: Mesh<'a>,
}

pub(crate) fn run(stage: &Obstruct, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let inputs = Inputs { p: &stage.params, mesh: Mesh::new(read.buf(stage.mesh)?, stage.params.nodes) };
    let out: &mut [u32] = bytemuck::cast_slice_mut(out.remove(0));
    let (start, last) = (range.start as usize, range.end as usize - 1);
    out[start..=last].par_chunks_mut(LANES).with_min_len(TASK).with_max_len(TASK).enumerate().for_each(|(n, words)| {
        let first = start + n * LANES;
        let cell: [usize; LANES] = lanes!(i => (first + i).min(last));
        let inputs = &inputs;
        compiled_for!(isa, obstruct<S>(inputs: &Inputs<'_>, cell: [usize; LANES], words: &mut [u32]));
    });
    Ok(())
}

/// Adds the bits of up to sixteen cells.
#[inline(always)]
fn obstruct<S: Simd>(inputs: &Inputs<'_>, cell: [usize; LANES], words: &mut [u32]) {
    let p = inputs.p;
    let [x, y, ..] = p.cells.map(|n| n as usize);
    let at: [F<S>; 3] = [
        F::of(lanes!(i => (cell[i] % x) as f32)),
        F::of(lanes!(i => (cell[i] / x % y) as f32)),
        F::of(lanes!(i => (cell[i] / x / y) as f32)),
    ];
    let from = center(p, at);
    if p.neighbor_begin == 0 {
        words.fill(0);
    }
    // Most cells have no triangle near. More than what rounding makes of the neighbours' places.
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    let reach =
        triple!(a => rows[a][0].abs() * p.cell[0] + rows[a][1].abs() * p.cell[1] + rows[a][2].abs() * p.cell[2]);
    let reach = triple!(a => from[a].abs() * 1e-6 + 1.001 * reach[a]);
    let lower = triple!(a => from[a] - reach[a]);
    let upper = triple!(a => from[a] + reach[a]);
    let near = inputs.mesh.within(lower, upper);
    if near.is_empty() {
        return;
    }
    for bit in p.neighbor_begin..p.neighbor_end {
        if bit == Obstruct::NEIGHBORS / 2 {
            continue;
        }
        let hop = [bit % 3, bit / 3 % 3, bit / 9];
        let to = center(p, triple!(a => at[a] + (hop[a] as f32 - 1.0)));
        let way = triple!(a => to[a] - from[a]);
        let far = dot(way, way).sqrt();
        let toward = triple!(a => way[a] / far);
        let stands = near.blocked(&line(from, toward), far);
        for (i, word) in words.iter_mut().enumerate() {
            *word |= u32::from(stands.lane(i)) << bit;
        }
    }
}

/// Where the centres of cells are, from the mesh's origin.
#[inline(always)]
fn center<S: Simd>(p: &ObstructParams, cell: [F<S>; 3]) -> [F<S>; 3] {
    let v = triple!(a => (cell[a] + 0.5) * p.cell[a] - 0.5 - (p.dims[a] as f32 - 1.0) * 0.5);
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    triple!(a => v[0] * rows[a][0] + v[1] * rows[a][1] + v[2] * rows[a][2] + p.mesh_eye[a])
}
