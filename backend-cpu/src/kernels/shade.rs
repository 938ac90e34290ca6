//! `shade`: light that surfaces send to the eye.

use std::f32::consts::PI;
use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::{LightRecord, MaterialRecord, MeshRecord, Shade, ShadeParams};
use rayon::prelude::*;

use super::field::Scalars;
use super::light::{incident, to_index};
use super::mesh::{Mesh, line};
use super::sample::{Occupancy, Ray};
use super::view::{View, view};
use crate::Isa;
use crate::device::Memory;
use crate::isa::compiled_for;
use crate::packet::{F, LANES, M, apart, dot, lanes, together, triple};
use crate::simd::Simd;

/// Packets that one task takes at the least.
const TASK: usize = 8;

struct Inputs<'a> {
    p: &'a ShadeParams,
    density: Scalars<'a>,
    occupancy: Option<Occupancy<'a>>,
    lights: &'a [LightRecord],
    view: View<'a>,
    mesh: Mesh<'a>,
    materials: &'a [MaterialRecord],
    hits: &'a [[[f32; 4]; 2]],
    background: &'a [[f32; 4]],
    /// Last position of the range.
    last: usize,
}

/// Sixteen hits: normals, distances, the triangles' normals, materials.
struct Hits<S> {
    normal: [F<S>; 3],
    distance: F<S>,
    facet: [F<S>; 3],
    material: [usize; LANES],
}

pub(crate) fn run(stage: &Shade, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
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
        lights: &read.opt(stage.lights)?[p.light_begin as usize..p.light_end as usize],
        view: View {
            axes: [p.forward, p.right, p.up],
            size: [p.width, p.height],
            samples: p.samples,
            positions: read.buf(stage.tables)?,
        },
        mesh: Mesh::new(read.buf(stage.mesh)?, p.nodes),
        materials: &read.buf(stage.materials)?[..p.materials as usize],
        hits: bytemuck::cast_slice(read.buf(stage.hits)?),
        background: read.opt(stage.background)?,
        last: range.end as usize - 1,
    };
    let out: &mut [[f32; 4]] = bytemuck::cast_slice_mut(out.remove(0));
    let out = &mut out[range.start as usize..range.end as usize];
    out.par_chunks_mut(LANES).with_min_len(TASK).enumerate().for_each(|(n, surface)| {
        let (inputs, first) = (&inputs, range.start as usize + n * LANES);
        compiled_for!(isa, shade<S>(inputs: &Inputs<'_>, first: usize, surface: &mut [[f32; 4]]));
    });
    Ok(())
}

/// Up to sixteen positions from `first` on.
#[inline(always)]
fn shade<S: Simd>(inputs: &Inputs<'_>, first: usize, surface: &mut [[f32; 4]]) {
    let p = inputs.p;
    let unit: [usize; LANES] = lanes!(i => (first + i).min(inputs.last));
    let [x, y, z, distance] = apart(lanes!(i => inputs.hits[unit[i]][0]));
    let behind = |i: usize| {
        let none = [0.0, 0.0, 0.0, f32::INFINITY];
        if inputs.background.is_empty() { none } else { inputs.background[unit[i] / p.samples as usize] }
    };
    let back = F::of(lanes!(i => behind(i)[3]));
    let met = distance.lt(back);
    let mut sum = [F::ZERO; 3];
    if p.light_begin > 0 {
        // What the passes before left.
        let last = surface.len() - 1;
        sum = triple!(c => F::of(lanes!(i => surface[i.min(last)][c])));
    }
    if met.any() {
        let d = view(&inputs.view, first, inputs.last);
        let [fx, fy, fz, _] = apart(lanes!(i => inputs.hits[unit[i]][1]));
        let hits = Hits {
            normal: [x, y, z],
            // Finite where nothing is met, so that nothing odd comes of it.
            distance: met.select(distance, F::ONE),
            facet: [fx, fy, fz],
            material: lanes!(i => (inputs.hits[unit[i]][1][3] as usize).min(inputs.materials.len() - 1)),
        };
        for record in inputs.lights {
            let light = reflected::<S>(inputs, record, d, &hits, met);
            sum = triple!(c => sum[c] + light[c]);
        }
    }
    let light = together([sum[0], sum[1], sum[2], distance]);
    for (i, place) in surface.iter_mut().enumerate() {
        *place = if met.lane(i) { light[i] } else { behind(i) };
    }
}

/// What surfaces send back along `d` of a light.
#[inline(always)]
fn reflected<S: Simd>(inputs: &Inputs<'_>, record: &LightRecord, d: [F<S>; 3], hits: &Hits<S>, met: M<S>) -> [F<S>; 3] {
    let p = inputs.p;
    let light = incident(record, p.light_floor, d, hits.distance);
    let facing = dot(hits.normal, light.toward);
    let lit = light.falloff.gt(F::ZERO).and(facing.gt(F::ZERO)).and(dot(hits.facet, light.toward).gt(F::ZERO));
    let mut lit = lit.and(met);
    if p.visibility == 1 && lit.any() {
        let margin = MeshRecord::MARGIN * p.mesh_eye[3];
        let at = triple!(a => hits.distance * d[a] + p.mesh_eye[a] + hits.facet[a] * margin);
        lit = lit.and(inputs.mesh.blocked(&line(at, light.toward), light.distance - margin, lit).not());
    }
    if !lit.any() {
        return [F::ZERO; 3];
    }
    let rows = [p.index_x, p.index_y, p.index_z];
    let along = to_index(rows, d);
    let at = triple!(a => hits.distance * along[a] + p.eye[a]);
    let way = Ray::through(at, to_index(rows, light.toward), inputs.density.size(), light.distance, p.step);
    let column = way.column(inputs.density, inputs.occupancy, lit);
    let share = material(inputs, hits, d, light.toward);
    let arriving = light.falloff * facing;
    triple!(c => {
        let transmittance = (column * -p.extinction[c]).exp_negative();
        lit.select(arriving * record.power[c] * transmittance * share[c], F::ZERO)
    })
}

/// The share of light from `toward` that the materials send back along `d`, per steradian.
#[inline(always)]
fn material<S: Simd>(inputs: &Inputs<'_>, hits: &Hits<S>, d: [F<S>; 3], toward: [F<S>; 3]) -> [F<S>; 3] {
    let facing = dot(hits.normal, toward);
    let mirrored = triple!(a => facing * hits.normal[a] * 2.0 - toward[a]);
    let cosine = -dot(mirrored, d);
    let of = |i: usize| &inputs.materials[hits.material[i]];
    let lobe: F<S> = F::of(lanes!(i => {
        let n = of(i).diffuse[3];
        if cosine.0[i] > 0.0 { (n + 2.0) / (2.0 * PI) * cosine.0[i].min(1.0).powf(n) } else { 0.0 }
    }));
    triple!(c => F::of(lanes!(i => of(i).diffuse[c] / PI + lobe.0[i] * of(i).specular[c])))
}
