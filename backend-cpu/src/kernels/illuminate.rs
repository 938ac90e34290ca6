//! `illuminate`: moments of the unscattered light of analytic lights at the cells of a coarse grid.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{Illuminate, IlluminateParams, LightRecord, MeshRecord};
use rayon::prelude::*;

use super::field::Scalars;
use super::harmonics::{self, harmonics};
use super::light::{incident, to_index};
use super::mesh::{Mesh, line};
use super::sample::{Occupancy, Ray};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, dot, lanes, triple};
use crate::simd::{Floats, Simd};

/// Packets that one task takes at the least.
const TASK: usize = 4;

struct Inputs<'a> {
    p: &'a IlluminateParams,
    density: Scalars<'a>,
    occupancy: Option<Occupancy<'a>>,
    lights: &'a [LightRecord],
    tables: &'a [f32],
    mesh: Mesh<'a>,
    grey: bool,
}

pub(crate) fn run(stage: &Illuminate, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.out)?;
    let (mut out, read) = memory.split();
    let p = &stage.params;
    let inputs = Inputs {
        p,
        density: read.scalars(stage.density)?,
        occupancy: match stage.occupancy {
            Some(buf) => Some(Occupancy::new(read.buf(buf)?, p.occupancy_cells)),
            None => None,
        },
        lights: &read.buf(stage.lights)?[p.light_begin as usize..p.light_end as usize],
        tables: read.buf(stage.tables)?,
        mesh: Mesh::new(read.opt(stage.mesh)?, p.nodes),
        grey: p.extinction[0] == p.extinction[1] && p.extinction[1] == p.extinction[2],
    };
    let cells = p.cells[..3].iter().product::<u32>() as usize;
    let values = (p.bands * p.bands * p.channels) as usize;
    let out: &mut [f32] = bytemuck::cast_slice_mut(out.remove(0));
    let (begin, last) = (range.start as usize, range.end as usize - 1);
    let packets = (range.end as usize - begin).div_ceil(LANES);
    let sums: Vec<Vec<Floats>> = (0..packets)
        .into_par_iter()
        .with_min_len(TASK)
        .map(|n| {
            let first = begin + n * LANES;
            let cell: [usize; LANES] = lanes!(i => (first + i).min(last));
            let mut sums = vec![[0.0; LANES]; values];
            if p.light_begin > 0 {
                // What the passes before left.
                sums.iter_mut().enumerate().for_each(|(v, sum)| *sum = lanes!(i => out[v * cells + cell[i]]));
            }
            let (inputs, to) = (&inputs, &mut sums[..]);
            compiled_for!(isa, illuminate<S>(inputs: &Inputs<'_>, cell: [usize; LANES], to: &mut [Floats]));
            sums
        })
        .collect();
    for (n, sums) in sums.iter().enumerate() {
        let first = begin + n * LANES;
        let count = LANES.min(last + 1 - first);
        for (v, sum) in sums.iter().enumerate() {
            out[v * cells + first..][..count].copy_from_slice(&sum[..count]);
        }
    }
    Ok(())
}

/// Adds the lights at sixteen cells.
#[inline(always)]
fn illuminate<S: Simd>(inputs: &Inputs<'_>, cell: [usize; LANES], sums: &mut [Floats]) {
    let p = inputs.p;
    let [x, y, ..] = p.cells.map(|n| n as usize);
    let place = [
        F::of(lanes!(i => (cell[i] % x) as f32)),
        F::of(lanes!(i => (cell[i] / x % y) as f32)),
        F::of(lanes!(i => (cell[i] / x / y) as f32)),
    ];
    let index = triple!(a => (place[a] + 0.5) * p.cell[a] - 0.5);
    let from = triple!(a => index[a] - (p.dims[a] as f32 - 1.0) * 0.5);
    let rows = [&p.world_x, &p.world_y, &p.world_z];
    let at = triple!(a => from[0] * rows[a][0] + from[1] * rows[a][1] + from[2] * rows[a][2]);
    let t = dot(at, at).sqrt();
    let d = triple!(a => at[a] / t.max(F::splat(f32::MIN_POSITIVE)));
    let mut basis = [F::ZERO; harmonics::MAX];
    for record in inputs.lights {
        let [toward @ .., r, g, b] = arriving::<S>(inputs, record, [d[0], d[1], d[2], t], at, index);
        let lit = r.max(g).max(b).gt(F::ZERO);
        if !lit.any() {
            continue;
        }
        harmonics(inputs.tables, p.bands as usize, toward, &mut basis);
        let power = [r, g, b];
        let channels = p.channels as usize;
        for (v, sum) in sums.iter_mut().enumerate() {
            *sum = (F::of(*sum) + power[v % channels] * basis[v / channels]).0;
        }
    }
}

/// Direction of a light at a place, `t` metres along `d` from the box's centre and `at` in metres from it, and what it
/// brings there.
#[inline(always)]
fn arriving<S: Simd>(
    inputs: &Inputs<'_>,
    record: &LightRecord,
    [x, y, z, t]: [F<S>; 4],
    at: [F<S>; 3],
    index: [F<S>; 3],
) -> [F<S>; 6] {
    let p = inputs.p;
    let light = incident(record, p.light_floor, [x, y, z], t);
    let toward = light.toward;
    let mut lit: M<S> = light.falloff.gt(F::ZERO);
    if p.visibility == 1 && lit.any() {
        let margin = MeshRecord::MARGIN * p.mesh_eye[3];
        let from = triple!(a => at[a] + p.mesh_eye[a]);
        lit = lit.and(inputs.mesh.blocked(&line(from, toward), light.distance - margin, lit).not());
    }
    if !lit.any() {
        return [toward[0], toward[1], toward[2], F::ZERO, F::ZERO, F::ZERO];
    }
    let along = to_index([p.index_x, p.index_y, p.index_z], toward);
    let way = Ray::through(index, along, inputs.density.size(), light.distance, p.cell[3]);
    let column = way.column(inputs.density, inputs.occupancy, lit);
    let mut transmittance = F::ONE;
    let power = triple!(c => {
        if c == 0 || !inputs.grey {
            transmittance = (column * -p.extinction[c]).exp_negative();
        }
        lit.select(light.falloff * record.power[c] * transmittance, F::ZERO)
    });
    [toward[0], toward[1], toward[2], power[0], power[1], power[2]]
}
