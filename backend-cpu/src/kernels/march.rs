//! `march`: view rays through the medium.

use airlight_core::blue_noise;
use airlight_core::stage::{FAR, LightRecord, March, MarchParams, MeshRecord, alone, shadow_kind, surface_shadow};

use super::face::{face, side_of};
use super::field::{Colors, Places};
use super::harmonics::{self, harmonics};
use super::light::{Incident, incident, to_index};
use super::mesh::line;
use super::phase::phase;
use super::phong::{normal, phong};
use super::sample::{Ahead, Ray, Samples};
use super::segment::{decays, segment};
use super::sky::sky;
use crate::film::{Pixels, SIDE, lanes_of, packets};
use crate::inputs::Inputs;
use crate::packet::{F, LANES, M, dot, each, lanes, triple};
use crate::simd::{Floats, Part, Simd};

/// Steps whose density is looked up together, so that each waits less for its own.
const TOGETHER: usize = 2;

/// Sixteen pixels from `corner` on: the mean over their sub-pixel positions.
#[inline(always)]
pub(crate) fn march<S: Simd>(inputs: &Inputs<'_>, corner: [usize; 2], out: &mut Pixels) {
    let p = inputs.p;
    let marched: M<S> = if p.alone == alone::RIMS { rim(inputs, corner) } else { M::ALL };
    if !marched.any() {
        let (zero, one) = ([0.0; LANES], [1.0; LANES]);
        out[0] = [[zero, zero, zero, [March::UNMARCHED; LANES]], [one, one, one, [f32::INFINITY; LANES]]];
        return;
    }
    // The same pixels of the full picture. Those past its edge are marched as its last and never stored.
    let scale = p.scale as usize;
    let full = |n: usize, size: u32| (n * scale + scale / 2).min(size as usize - 1);
    let fx = F::of(lanes!(i => full(corner[0] + i % SIDE, p.full_width) as f32));
    let fy = F::of(lanes!(i => full(corner[1] + i / SIDE, p.full_height) as f32));
    let pixel = |i: usize| fy.0[i] as usize * p.full_width as usize + fx.0[i] as usize;
    let each = p.surface_samples as usize;
    let seen = |s: usize, c: usize| F::of(lanes!(i => inputs.surface[pixel(i) * each + s % each][c]));
    let (mut color, mut through) = ([F::ZERO; 3], [F::ZERO; 3]);
    let (mut stopped, mut stopped_at) = (F::ZERO, F::ZERO);
    if p.sample_begin > 0 {
        // The sums of the passes before.
        [color[0], color[1], color[2], stopped] = packets(&out[0][0]);
        [through[0], through[1], through[2], stopped_at] = packets(&out[0][1]);
    }
    let ends = p.step_end == March::ALL_STEPS;
    // Y_k of the direction, where the in-scatter has layers.
    let mut basis = [F::ZERO; harmonics::MAX];
    for s in p.sample_begin as usize..p.sample_end as usize {
        let a = (fx + inputs.tables[2 * s]) * (2.0 / p.full_width as f32) - 1.0;
        let b = -((fy + inputs.tables[2 * s + 1]) * (2.0 / p.full_height as f32) - 1.0);
        let d = triple!(c => a * p.right[c] + b * p.up[c] + p.forward[c]);
        let length = dot(d, d).sqrt();
        let d = triple!(c => d[c] / length);
        let surface = (!inputs.surface.is_empty()).then(|| [seen(s, 0), seen(s, 1), seen(s, 2), seen(s, 3)]);
        let limit = surface.map_or(F::splat(f32::INFINITY), |s| s[3]);
        let reach = marched.select(limit, F::ZERO);
        let mut path = Path::enter(inputs, d, reach, jitter(inputs, corner, s));
        if p.step_begin > 0 {
            path.resume(&out[1]);
        }
        if p.cells[3].max(p.scattered_cells[3]) > 1 {
            harmonics(&inputs.tables[p.harmonics_at as usize..], p.bands as usize, d, &mut basis);
        }
        path.walk(inputs, &basis);
        if !ends {
            out[1] = path.keep();
            return;
        }
        let mut behind = match &inputs.environment {
            Some(environment) => sky(environment, d),
            None => [F::ZERO; 3],
        };
        if p.alone != alone::NO {
            behind = [F::ZERO; 3];
        } else if let Some(surface) = &surface {
            let hit = limit.lt(F::splat(f32::INFINITY));
            behind = triple!(c => hit.select(surface[c], behind[c]));
        }
        color = triple!(c => color[c] + path.radiance[c] + path.transmittance[c] * behind[c]);
        through = triple!(c => through[c] + path.transmittance[c]);
        stopped = stopped + path.stopped;
        stopped_at = stopped_at + path.stopped * path.ray.middle(0.0) + path.stopped_in * path.ray.step;
    }
    if p.sample_end < p.samples {
        out[0] = lanes_of([[color[0], color[1], color[2], stopped], [through[0], through[1], through[2], stopped_at]]);
        return;
    }
    let scale = 1.0 / p.samples as f32;
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    let alpha = (F::splat(3.0 * p.samples as f32) - (through[0] + through[1] + through[2])) * (scale / 3.0);
    let last = match (p.alone, inputs.surface.is_empty()) {
        (alone::NO, _) => alpha,
        (_, true) => F::splat(FAR),
        (_, false) => marched.select(seen(0, 3).min(F::splat(FAR)), F::splat(March::UNMARCHED)),
    };
    let beauty = [color[0] * scale, color[1] * scale, color[2] * scale, last];
    let depth = stopped.gt(F::ZERO).select(stopped_at / stopped, F::splat(f32::INFINITY));
    out[0] = lanes_of([beauty, [through[0] * scale, through[1] * scale, through[2] * scale, depth]]);
}

/// Which lanes lie near a rim: of the surfaces of five by five pixels around, the nearest and the farthest.
#[inline(always)]
fn rim<S: Simd>(inputs: &Inputs<'_>, corner: [usize; 2]) -> M<S> {
    let p = inputs.p;
    let (mut nearest, mut farthest) = (F::splat(FAR), F::ZERO);
    let around = |n: usize, size: u32| n.clamp(2, size as usize + 1) - 2;
    let full = |n: usize, size: u32| ((n as u32 * p.scale + p.scale / 2).min(size - 1)) as usize;
    let distance = |i: usize, k: usize| {
        let column = full(around(corner[0] + i % SIDE + k % 5, p.width), p.full_width);
        let row = full(around(corner[1] + i / SIDE + k / 5, p.height), p.full_height);
        inputs.surface[row * p.full_width as usize + column][3].min(FAR)
    };
    for k in 0..25 {
        let distance = F::of(lanes!(i => distance(i, k)));
        (nearest, farthest) = (nearest.min(distance), farthest.max(distance));
    }
    nearest.lt(farthest * March::RIM)
}

/// Where the samples of a sub-pixel position lie within their steps.
#[inline(always)]
fn jitter<S: Simd>(inputs: &Inputs<'_>, corner: [usize; 2], s: usize) -> F<S> {
    let p = inputs.p;
    if p.jittered == 0 {
        return F::splat(0.5);
    }
    const TILE: usize = blue_noise::SIDE as usize;
    let at = p.jitter_at as usize;
    let tile = &inputs.tables[at + p.samples as usize..][..TILE * TILE];
    let place = F::of(lanes!(i => tile[(corner[1] + i / SIDE) % TILE * TILE + (corner[0] + i % SIDE) % TILE]));
    let place = place + inputs.tables[at + s] + p.jitter_offset;
    place - place.floor()
}

/// One view ray of each lane.
struct Path<S> {
    direction: [F<S>; 3],
    ray: Ray<S>,
    radiance: [F<S>; 3],
    transmittance: [F<S>; 3],
    /// Light stopped so far, of all channels or of the one that serves all, and the same weighed with the number of its
    /// step.
    stopped: F<S>,
    stopped_in: F<S>,
}

impl<S: Simd> Path<S> {
    /// The path along `d` before its first step.
    #[inline(always)]
    fn enter(inputs: &Inputs<'_>, d: [F<S>; 3], limit: F<S>, place: F<S>) -> Self {
        let p = inputs.p;
        let index = to_index(rows(p), d);
        let origin = triple!(a => F::splat(p.eye[a]));
        let mut ray = Ray::through(origin, index, inputs.density.size(), limit, p.step);
        if p.steps > 0 {
            ray = ray.in_steps(p.steps as f32);
        }
        ray.place = place;
        Self {
            direction: d,
            ray,
            radiance: [F::ZERO; 3],
            transmittance: [F::ONE; 3],
            stopped: F::ZERO,
            stopped_in: F::ZERO,
        }
    }

    /// The path as an earlier pass left it.
    #[inline(always)]
    fn resume(&mut self, [light, through]: &[[Floats; 4]; 2]) {
        [self.radiance[0], self.radiance[1], self.radiance[2], self.stopped] = packets(light);
        [self.transmittance[0], self.transmittance[1], self.transmittance[2], self.stopped_in] = packets(through);
    }

    /// What the next pass needs of the path.
    #[inline(always)]
    fn keep(&self) -> [[Floats; 4]; 2] {
        let ([r, g, b], [x, y, z]) = (self.radiance, self.transmittance);
        lanes_of([[r, g, b, self.stopped], [x, y, z, self.stopped_in]])
    }

    /// The steps of this pass.
    #[inline(always)]
    fn walk(&mut self, inputs: &Inputs<'_>, basis: &[F<S>; harmonics::MAX]) {
        let p = inputs.p;
        let (last, samples) = (self.ray.steps.max_lane().min(p.step_end as f32), self.ray.samples(inputs.occupancy));
        let mut k = p.step_begin as f32;
        while k < last {
            let mut until = last;
            if let Some(occupancy) = inputs.occupancy {
                let active = F::splat(k).lt(self.ray.steps).and(self.open(inputs));
                if !active.any() {
                    break;
                }
                match occupancy.skip(&samples, k, active) {
                    Ahead::Empty(next) => {
                        k = next;
                        continue;
                    }
                    Ahead::Dense(next) => until = next.min(last),
                }
            }
            let next = match (inputs.plain, inputs.lit) {
                (true, false) => self.plain::<false>(inputs, &samples, basis, k, until),
                (true, true) => self.plain::<true>(inputs, &samples, basis, k, until),
                (false, _) => self.colored(inputs, &samples, basis, k, until),
            };
            if next < until {
                break;
            }
            k = next;
        }
        if inputs.grey {
            self.transmittance = [self.transmittance[0]; 3];
        }
    }

    /// Steps from `k` until another, or less where nothing behind them is seen: the step behind. One channel serves all,
    /// and what scatters, where it is `LIT`, is a part of what stops.
    #[inline(always)]
    fn plain<const LIT: bool>(
        &mut self,
        inputs: &Inputs<'_>,
        samples: &Samples<S>,
        basis: &[F<S>; harmonics::MAX],
        mut k: f32,
        until: f32,
    ) -> f32 {
        let p = inputs.p;
        let thickness = self.ray.step * p.extinction[0];
        // The last of those looked up together may lie behind what was asked of.
        let steps = self.ray.steps.min(F::splat(p.step_end as f32));
        while k < until {
            // What is looked up waits for no transmittance: only what comes of it does.
            if !F::splat(k).lt(steps).and(self.open(inputs)).any() {
                break;
            }
            let at = each!(n in TOGETHER, [F::ZERO; 3] => samples.sampled(k + n as f32));
            let density = inputs.density.several::<S, TOGETHER>(at);
            let density = each!(n in TOGETHER, F::ZERO => F::splat(k + n as f32).lt(steps).select(density[n], F::ZERO));
            let passed = decays(each!(n in TOGETHER, F::ZERO => density[n] * thickness));
            for n in 0..TOGETHER {
                let ((e, lost), open) = (passed[n], self.open(inputs));
                let stops = open.select(self.transmittance[0] * lost, F::ZERO);
                if LIT {
                    let dense = density[n].gt(F::ZERO).and(open);
                    if dense.any() {
                        let light = self.light(inputs, at[n], basis, self.ray.middle(k + n as f32), dense);
                        self.radiance = triple!(c => self.radiance[c] + stops * (light[c] * p.albedo[c]));
                    }
                }
                self.transmittance[0] = open.select(self.transmittance[0] * e, self.transmittance[0]);
                self.stop(stops, k + n as f32);
            }
            k += TOGETHER as f32;
        }
        k
    }

    /// The same where channels differ, what scatters is a field of its own, or the medium emits.
    #[inline(always)]
    fn colored(
        &mut self,
        inputs: &Inputs<'_>,
        samples: &Samples<S>,
        basis: &[F<S>; harmonics::MAX],
        mut k: f32,
        until: f32,
    ) -> f32 {
        while k < until {
            let (within, open) = (F::splat(k).lt(self.ray.steps), self.open(inputs));
            if !within.and(open).any() {
                break;
            }
            let stops = self.step(inputs, samples.sampled(k), basis, self.ray.middle(k), within, open);
            self.stop(stops, k);
            k += 1.0;
        }
        k
    }

    /// Books light that is stopped in step `k`.
    #[inline(always)]
    fn stop(&mut self, light: F<S>, k: f32) {
        self.stopped = self.stopped + light;
        self.stopped_in = self.stopped_in + light * k;
    }

    /// Where the next step may still be seen.
    #[inline(always)]
    fn open(&self, inputs: &Inputs<'_>) -> M<S> {
        let mut brightest = self.transmittance[0];
        if !inputs.grey {
            brightest = brightest.max(self.transmittance[1]).max(self.transmittance[2]);
        }
        brightest.ge(F::splat(inputs.p.cut))
    }

    /// A step through any medium: the light that it stops, as [`Path::stopped`] counts it.
    #[inline(always)]
    fn step(
        &mut self,
        inputs: &Inputs<'_>,
        at: [F<S>; 3],
        basis: &[F<S>; harmonics::MAX],
        t: F<S>,
        within: M<S>,
        open: M<S>,
    ) -> F<S> {
        let Optics { extinction, scattering, emission } = optics::<S>(inputs, at, within);
        let mut sent = emission;
        if inputs.lit {
            let dense = scattering[0].max(scattering[1]).max(scattering[2]).gt(F::ZERO).and(open);
            if dense.any() {
                let light = self.light(inputs, at, basis, t, dense);
                sent = triple!(c => scattering[c] * light[c] + emission[c]);
            }
        }
        let (delta, shines) = (self.ray.step, inputs.lit || inputs.emits);
        if inputs.grey {
            // One channel serves all; the others are made from it at the end.
            let (e, mean) = segment(extinction[0] * delta);
            let reach = open.select(self.transmittance[0] * delta * mean, F::ZERO);
            if shines {
                self.radiance = triple!(c => self.radiance[c] + reach * sent[c]);
            }
            self.transmittance[0] = open.select(self.transmittance[0] * e, self.transmittance[0]);
            return extinction[0] * reach;
        }
        let pieces = triple!(c => segment(extinction[c] * delta));
        let reach = triple!(c => open.select(self.transmittance[c] * delta * pieces[c].1, F::ZERO));
        if shines {
            self.radiance = triple!(c => self.radiance[c] + reach[c] * sent[c]);
        }
        self.transmittance = triple!(c => open.select(self.transmittance[c] * pieces[c].0, self.transmittance[c]));
        extinction[0] * reach[0] + extinction[1] * reach[1] + extinction[2] * reach[2]
    }

    /// J of the `dense` lanes, at `at` in index space and `t` metres along the ray.
    #[inline(always)]
    fn light(
        &self,
        inputs: &Inputs<'_>,
        at: [F<S>; 3],
        basis: &[F<S>; harmonics::MAX],
        t: F<S>,
        dense: M<S>,
    ) -> [F<S>; 3] {
        S::by_itself(Light { inputs, at, direction: self.direction, t, dense, basis })
    }
}

/// What J of some lanes is made of.
struct Light<'a, S> {
    inputs: &'a Inputs<'a>,
    at: [F<S>; 3],
    direction: [F<S>; 3],
    t: F<S>,
    dense: M<S>,
    basis: &'a [F<S>; harmonics::MAX],
}

impl<S: Simd> Part for Light<'_, S> {
    type Made = [F<S>; 3];

    #[inline(always)]
    fn make(self) -> [F<S>; 3] {
        let Self { inputs, at, direction, t, dense, basis } = self;
        let mut light = [F::ZERO; 3];
        gathered(inputs, at, basis, dense, &mut light);
        scattered_light(inputs, at, basis, dense, &mut light);
        direct::<S>(inputs, at, direction, t, dense, &mut light);
        light
    }
}

/// The rows of the map from metres to voxels.
#[inline(always)]
fn rows(p: &MarchParams) -> [[f32; 4]; 3] {
    [p.index_x, p.index_y, p.index_z]
}

/// J from the field of in-scattered radiance, added to `light`.
#[inline(always)]
fn gathered<S: Simd>(
    inputs: &Inputs<'_>,
    at: [F<S>; 3],
    basis: &[F<S>; harmonics::MAX],
    dense: M<S>,
    light: &mut [F<S>; 3],
) {
    let p = inputs.p;
    let Some(field) = inputs.in_scatter else { return };
    let place = triple!(a => (at[a] + 0.5) * p.cells_per_voxel[a] - 0.5);
    layered(field, &in_scatter_at(p, field, place), p.cells[3], basis, dense, light);
}

#[inline(always)]
fn in_scatter_at<S: Simd>(p: &MarchParams, field: Colors<'_>, place: [F<S>; 3]) -> Places<S> {
    field.places(place, p.trilinear == 1)
}

/// J of light that was scattered before, added to `light`.
#[inline(always)]
fn scattered_light<S: Simd>(
    inputs: &Inputs<'_>,
    at: [F<S>; 3],
    basis: &[F<S>; harmonics::MAX],
    dense: M<S>,
    light: &mut [F<S>; 3],
) {
    let p = inputs.p;
    let Some(field) = inputs.scattered else { return };
    let place = triple!(a => (at[a] + 0.5) * p.scattered_cells_per_voxel[a] - 0.5);
    layered(field, &field.places(place, true), p.scattered_cells[3], basis, dense, light);
}

/// J from the layers of a field, one a coefficient, at each lane's place.
#[inline(always)]
fn layered<S: Simd>(
    field: Colors<'_>,
    places: &Places<S>,
    layers: u32,
    basis: &[F<S>; harmonics::MAX],
    dense: M<S>,
    light: &mut [F<S>; 3],
) {
    let one = [F::ONE];
    let weights = if layers == 1 { &one } else { &basis[..layers as usize] };
    let sums: [F<S>; 3] = field.sums(places, 0, weights, dense);
    *light = triple!(c => light[c] + sums[c]);
}

/// J from each light, added to `light`.
#[inline(always)]
fn direct<S: Simd>(
    inputs: &Inputs<'_>,
    at: [F<S>; 3],
    direction: [F<S>; 3],
    t: F<S>,
    dense: M<S>,
    light: &mut [F<S>; 3],
) {
    let p = inputs.p;
    let mut depths = [F::ZERO; 4];
    let away = if p.phong[3] > 0.0 { normal::<S>(inputs.density, rows(p), at) } else { [F::ZERO; 3] };
    for (n, record) in inputs.lights.iter().enumerate() {
        if n % 4 == 0 {
            depths = light_depths(inputs, at, dense, n / 4);
        }
        let light_at = incident(record, p.light_floor, direction, t);
        let Incident { toward, distance, falloff } = light_at;
        let lit = dense.and(falloff.gt(F::ZERO));
        if !lit.any() {
            continue;
        }
        let seen = visibility(inputs, record, &light_at, direction, t, lit);
        let lit = lit.and(seen.gt(F::ZERO));
        if !lit.any() {
            continue;
        }
        let scatters = if p.phong[3] > 0.0 {
            phong(p.phong, away, toward, direction)
        } else {
            phase(&inputs.phase, dot(toward, direction))
        };
        let scale = lit.select(scatters * falloff * seen, F::ZERO);
        let mut column = depths[n % 4];
        let size = inputs.density.size();
        if p.shadow == shadow_kind::MARCH {
            let ray = Ray::through(at, to_index(rows(p), toward), size, distance, p.step);
            column = ray.column(inputs.density, inputs.occupancy, lit);
        } else if p.shadow == shadow_kind::MEAN {
            column = column * Ray::reach(at, to_index(rows(p), toward), size, distance);
        }
        let mut transmittance = F::ONE;
        for c in 0..3 {
            if c == 0 || !inputs.grey {
                transmittance = (column * -p.light_extinction[c]).exp_negative();
            }
            light[c] = light[c] + scale * transmittance * record.power[c];
        }
    }
}

/// How much of the light passes by the surfaces, `t` metres along the view ray.
#[inline(always)]
fn visibility<S: Simd>(
    inputs: &Inputs<'_>,
    record: &LightRecord,
    light: &Incident<S>,
    d: [F<S>; 3],
    t: F<S>,
    lit: M<S>,
) -> F<S> {
    let p = inputs.p;
    let extent = p.mesh_eye[3];
    let at = triple!(a => t * d[a] + p.mesh_eye[a]);
    match p.surface_shadow {
        surface_shadow::RAY => {
            let free = light.distance - MeshRecord::MARGIN * extent;
            inputs.mesh.blocked(&line(at, light.toward), free, lit).select(F::ZERO, F::ONE)
        }
        surface_shadow::MAP => mapped(inputs, record, light, at, lit),
        _ => F::ONE,
    }
}

/// The same by the light's map, at a point from the mesh's origin: four comparisons, interpolated.
#[inline(always)]
fn mapped<S: Simd>(inputs: &Inputs<'_>, record: &LightRecord, light: &Incident<S>, at: [F<S>; 3], lit: M<S>) -> F<S> {
    let (p, side) = (inputs.p, inputs.p.map_side as usize);
    let parallel = record.position[3] == 0.0;
    let first = record.power[3] as usize * side;
    let (mut faces, mut within) = ([0; LANES], M::ALL);
    let (depth, mut place);
    if parallel || record.cone[3] > 0.0 {
        let of = face(record, 0, p.mesh_eye[3]);
        let v = if parallel { at } else { triple!(a => -(light.distance * light.toward[a])) };
        let along = dot(v, triple!(a => F::splat(of.forward[a])));
        let x = dot(v, triple!(a => F::splat(of.right[a]))) / of.half_width;
        let y = dot(v, triple!(a => F::splat(of.up[a]))) / of.half_width;
        (depth, place) = (if parallel { along + p.mesh_eye[3] } else { along }, [x, y]);
        if parallel {
            within = F::ONE.ge(x.abs().max(y.abs()));
        }
    } else {
        let v = triple!(a => -(light.distance * light.toward[a]));
        faces = lanes!(i => side_of(triple!(a => v[a].0[i])));
        let along = |n: usize| F::of(lanes!(i => v[(faces[i] / 2 + n) % 3].0[i]));
        (depth, place) = (along(0).abs(), [along(1), along(2)]);
    }
    if !parallel {
        let ahead = depth.max(F::splat(1e-30));
        place = [place[0] / ahead, place[1] / ahead];
    }
    let top = F::splat(side as f32 - 1.0);
    let x = ((place[0] * 0.5 + 0.5) * side as f32 - 0.5).max(F::ZERO).min(top);
    let y = ((place[1] * 0.5 + 0.5) * side as f32 - 0.5).max(F::ZERO).min(top);
    let (column, row) = (x.to_int(), y.to_int());
    let (fx, fy) = (x - column.to_float(), y - row.to_float());
    let mut sum = F::ZERO;
    for k in 0..4 {
        let (right, below) = (k & 1, k >> 1);
        let across = if right == 1 { fx } else { F::ONE - fx };
        let down = if below == 1 { fy } else { F::ONE - fy };
        let held = F::of(lanes!(i => {
            let (x, y) = ((column.0[i] as usize + right).min(side - 1), (row.0[i] as usize + below).min(side - 1));
            inputs.shadow_map[(first + faces[i] * side + y) * side + x]
        }));
        sum = sum + held.ge(depth).select(across * down, F::ZERO);
    }
    lit.and(within).select(sum, F::ONE)
}

/// The field toward four lights; zero without one.
#[inline(always)]
fn light_depths<S: Simd>(inputs: &Inputs<'_>, at: [F<S>; 3], dense: M<S>, layer: usize) -> [F<S>; 4] {
    let field = inputs.light_depth.filter(|_| inputs.p.shadow >= shadow_kind::COLUMN);
    let Some(field) = field else { return [F::ZERO; 4] };
    let place = triple!(a => (at[a] + 0.5) * inputs.p.light_cells_per_voxel[a] - 0.5);
    field.sums(&field.places(place, true), layer, &[F::ONE], dense)
}

/// What the medium does to light at a point, per channel.
struct Optics<S> {
    /// σt, 1/m.
    extinction: [F<S>; 3],
    /// σs, 1/m.
    scattering: [F<S>; 3],
    /// j, W m⁻³ sr⁻¹.
    emission: [F<S>; 3],
}

/// The optics at `at` in index space; lanes that are not active see nothing there.
#[inline(always)]
fn optics<S: Simd>(inputs: &Inputs<'_>, at: [F<S>; 3], active: M<S>) -> Optics<S> {
    let p = inputs.p;
    let density = active.select(inputs.density.sample::<S>(at), F::ZERO);
    let mut scatters = [density; 3];
    if let Some(scattering) = inputs.scattering {
        scatters = scattering.packet(at, active);
    }
    let mut source = [density; 3];
    if let Some(color) = inputs.emission_color {
        source = color.packet(at, active);
    } else if let Some(emission) = inputs.emission {
        source = [active.select(emission.sample::<S>(at), F::ZERO); 3];
    }
    Optics {
        extinction: triple!(c => density * p.extinction[c]),
        scattering: triple!(c => scatters[c] * p.extinction[c] * p.albedo[c]),
        emission: triple!(c => source[c] * p.emission[c]),
    }
}
