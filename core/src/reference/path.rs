//! Twin of the stage [`Path`](crate::stage::Path): one path after another, each to its end.

use std::f64::consts::PI;

use glam::DVec3;

use super::flight::{Bends, Draws, Ground, Walk, around, choose};
use super::lookup::{Samples, Tints, apply, xyz};
use super::march::incident;
use super::mesh::{Hit, nearest};
use super::sky::sky;
use super::trace::view;
use crate::stage::{FAR, LightRecord, MeshRecord, Path, PathParams, PathRecord};

/// What the bindings of [`Path`](crate::stage::Path) hold.
#[derive(Clone, Copy, Debug)]
pub struct PathInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// Density that scatters.
    pub scattering: Option<&'a [[f32; 4]]>,
    /// Density that the eye's ray sees scatter, where it is another.
    pub seen: Option<&'a [[f32; 4]]>,
    /// Emission density.
    pub emission: Option<&'a [f32]>,
    /// Emission density with a colour.
    pub emission_color: Option<&'a [[f32; 4]]>,
    /// Texels of the environment; more may follow.
    pub environment: Option<&'a [[f32; 4]]>,
    /// Mean and maximum of each cell.
    pub majorant: &'a [[f32; 2]],
    /// Lights.
    pub lights: &'a [LightRecord],
    /// Tables.
    pub tables: &'a [f32],
    /// Boxes, which are not read, and triangles.
    pub mesh: &'a [MeshRecord],
    /// What stands behind the pixels.
    pub background: Option<&'a [[f32; 4]]>,
}

/// What [`Path`](crate::stage::Path) writes after all samples: sums, paths under way (none), the film.
pub fn path(params: &PathParams, inputs: &PathInputs<'_>) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let (mut sums, mut film) = (Vec::new(), Vec::new());
    let pixels = params.width * params.height;
    let n = f64::from(params.samples);
    for pixel in 0..pixels {
        let (mut light, mut through, mut squares, mut stopped, mut stopped_at) =
            (DVec3::ZERO, DVec3::ZERO, 0.0, 0.0, 0.0);
        for sample in 0..params.samples {
            let draws = Draws::new(pixel, sample, params.frame);
            let tracer = Tracer { params, inputs, pixel, draws, found: Found::default() };
            let found = tracer.trace();
            light += found.light;
            through += found.through;
            squares += (found.light.element_sum() / 3.0).powi(2);
            stopped += found.stopped;
            stopped_at += found.stopped_at;
        }
        sums.extend([light.x, light.y, light.z, n, through.x, through.y, through.z, squares]);
        sums.extend([stopped, stopped_at, 0.0, 0.0]);
        let depth = if stopped > 0.0 { stopped_at / stopped } else { f64::INFINITY };
        film.extend((light / n).to_array());
        film.push(1.0 - through.element_sum() / (3.0 * n));
        film.extend((through / n).to_array());
        film.push(depth);
    }
    (sums, vec![0.0; pixels as usize * size_of::<PathRecord>() / 4], film)
}

/// What a sample adds.
#[derive(Default)]
struct Found {
    light: DVec3,
    through: DVec3,
    stopped: f64,
    stopped_at: f64,
}

struct Tracer<'a> {
    params: &'a PathParams,
    inputs: &'a PathInputs<'a>,
    pixel: u32,
    draws: Draws,
    found: Found,
}

/// A tentative collision: metres along, and there σt, σs and j over the rate.
struct Collision {
    t: f64,
    extinction: DVec3,
    scattering: DVec3,
    seen: DVec3,
    emission: DVec3,
}

/// Where a path scatters.
struct Spot {
    place: DVec3,
    /// Of the ray that came there.
    from: DVec3,
    surface: Option<Hit>,
}

impl Tracer<'_> {
    fn draw(&mut self) -> f64 {
        self.draws.draw()
    }

    fn trace(mut self) -> Found {
        let p = self.params;
        let (x, y) = (self.pixel % p.width, self.pixel / p.width);
        let at = [f64::from(x) + self.draw(), f64::from(y) + self.draw()];
        let d = view([p.forward, p.right, p.up], [p.width, p.height], at);
        let Some((mut weight, mut spot)) = self.seen(d) else { return self.found };
        for depth in 1.. {
            // What is drawn for the way on is drawn before the walk toward the light.
            let looked = self.look(weight, &spot);
            let onward = self.onward(&mut weight, &spot, depth);
            if let Some((pending, toward, distance)) = looked {
                self.shadow(pending, spot.place, toward, distance);
            }
            let Some((toward, density)) = onward else { break };
            match self.fly(&mut weight, spot.place, toward, density) {
                Some(next) if depth < p.max_depth && weight != DVec3::ZERO => spot = next,
                _ => break,
            }
        }
        self.found
    }

    /// Walks the ray from the eye. The place where the path first scatters, with its weight.
    fn seen(&mut self, d: DVec3) -> Option<(DVec3, Spot)> {
        let p = self.params;
        let back = self.inputs.background.map_or([0.0, 0.0, 0.0, FAR], |all| all[self.pixel as usize]);
        let hit = self.meet(DVec3::ZERO, d);
        let limit = hit.as_ref().map_or(f64::INFINITY, |hit| hit.distance).min(back[3].into());
        let (mut ratio, mut total) = (DVec3::ONE, 0.0);
        let mut chosen: Option<(DVec3, Option<f64>)> = None;
        let mut walk = self.walk(DVec3::ZERO, d, limit);
        while let Some(at) = self.next(&mut walk) {
            self.found.light += ratio * at.emission;
            let stopped = ratio.dot(at.extinction);
            self.found.stopped += stopped;
            self.found.stopped_at += stopped * at.t;
            self.offer(ratio * at.seen, Some(at.t), &mut total, &mut chosen);
            ratio = self.faint(ratio * (1.0 - at.extinction));
            if ratio == DVec3::ZERO {
                break;
            }
        }
        self.found.through = ratio;
        let hit = hit.filter(|hit| hit.distance < f64::from(back[3]));
        if hit.is_some() {
            self.offer(ratio, None, &mut total, &mut chosen);
        } else if back[3] < FAR {
            self.found.light += ratio * xyz(back);
        } else if p.visible == 1 {
            self.found.light += ratio * self.surroundings(d);
        }
        let (weight, t) = chosen?;
        let (t, surface) = match t {
            Some(t) => (t, None),
            None => (hit.as_ref()?.distance, hit),
        };
        Some((weight * total, self.spot(t * d, d, surface)))
    }

    /// A place to scatter at, in proportion to the weights of all; none of `t` is that on a surface.
    fn offer(&mut self, weights: DVec3, t: Option<f64>, total: &mut f64, chosen: &mut Option<(DVec3, Option<f64>)>) {
        let weight = weights.element_sum();
        if weight > 0.0 {
            *total += weight;
            if self.draw() * *total < weight {
                *chosen = Some((weights / weight, t));
            }
        }
    }

    /// On to the next place to scatter at; the environment is seen where there is none.
    fn fly(&mut self, weight: &mut DVec3, place: DVec3, d: DVec3, density: f64) -> Option<Spot> {
        let hit = self.meet(place, d);
        let mut walk = self.walk(place, d, hit.as_ref().map_or(f64::INFINITY, |hit| hit.distance));
        while let Some(at) = self.next(&mut walk) {
            self.found.light += *weight * at.emission;
            let real = weight.dot(at.extinction) / weight.element_sum();
            if self.draw() < real {
                *weight *= at.scattering / real;
                return Some(self.spot(place + at.t * d, d, None));
            }
            *weight *= (1.0 - at.extinction) / (1.0 - real);
        }
        if let Some(hit) = hit {
            let t = hit.distance;
            return Some(self.spot(place + t * d, d, Some(hit)));
        }
        let share = if self.inputs.environment.is_some() { density / (density + self.sky_density(d)) } else { 1.0 };
        self.found.light += *weight * self.surroundings(d) * share;
        None
    }

    /// Chooses a light: what comes from it but for the medium, its direction and distance.
    fn look(&mut self, weight: DVec3, spot: &Spot) -> Option<(DVec3, DVec3, f64)> {
        let p = self.params;
        if p.choices == 0 {
            return None;
        }
        let item = self.choose(p.choices_at, p.choices);
        let (toward, distance, arriving) = if item < p.lights {
            let light = &self.inputs.lights[item as usize];
            let (toward, distance, falloff) = incident(light, p.light_floor, 1.0, spot.place);
            (toward, distance, xyz(light.power) * falloff / self.chance(item))
        } else {
            let toward = self.toward_sky();
            let density = self.sky_density(toward) + self.density(spot, toward);
            (toward, f64::INFINITY, if density > 0.0 { self.surroundings(toward) / density } else { DVec3::ZERO })
        };
        let pending = weight * self.scattered(spot, toward) * arriving;
        let free = distance - f64::from(MeshRecord::MARGIN * p.mesh_eye[3]);
        let from = xyz(p.mesh_eye) + spot.place;
        let dark = pending == DVec3::ZERO || nearest(self.inputs.mesh, p.nodes, from, toward, [0.0, free]).is_some();
        (!dark).then_some((pending, toward, distance))
    }

    /// What the medium lets through of a light.
    fn shadow(&mut self, pending: DVec3, place: DVec3, toward: DVec3, distance: f64) {
        let mut ratio = DVec3::ONE;
        let mut walk = self.walk(place, toward, distance);
        while ratio != DVec3::ZERO
            && let Some(at) = self.next(&mut walk)
        {
            ratio = self.faint(ratio * (1.0 - at.extinction));
        }
        self.found.light += pending * ratio;
    }

    /// T, or nothing by the chance that makes up for it where T is faint.
    fn faint(&mut self, ratio: DVec3) -> DVec3 {
        let (most, faint) = (ratio.max_element(), f64::from(Path::FAINT));
        if most >= faint {
            ratio
        } else if self.draw() * faint < most {
            ratio * (faint / most)
        } else {
            DVec3::ZERO
        }
    }

    fn ground(&self) -> Ground<'_> {
        let (p, majorant) = (self.params, self.inputs.majorant);
        Ground { dims: p.dims, cells: p.majorant_cells, majorant, densest: p.densest, least: p.least }
    }

    fn walk(&self, place: DVec3, d: DVec3, limit: f64) -> Walk {
        let p = self.params;
        let rows = [p.index_x, p.index_y, p.index_z];
        self.ground().walk(xyz(p.eye) + apply(rows, place), apply(rows, d), limit)
    }

    /// The next tentative collision of a walk.
    fn next(&mut self, walk: &mut Walk) -> Option<Collision> {
        let mut draws = self.draws;
        let rate = self.ground().next(walk, &mut draws);
        self.draws = draws;
        rate.map(|rate| self.collision(walk, rate))
    }

    fn collision(&self, walk: &Walk, rate: f64) -> Collision {
        let (p, inputs) = (self.params, self.inputs);
        let at = walk.place();
        let density = Samples::new(inputs.density, p.dims).trilinear(at);
        let scatters = Tints::new(inputs.scattering, inputs.density, p.dims).trilinear(at);
        let seen = Tints::new(inputs.seen.or(inputs.scattering), inputs.density, p.dims).trilinear(at);
        let source = Tints::new(inputs.emission_color, inputs.emission.unwrap_or(inputs.density), p.dims).trilinear(at);
        let extinction = xyz(p.extinction) / rate;
        Collision {
            t: walk.t,
            extinction: (density * extinction).min(DVec3::ONE),
            scattering: scatters * extinction * xyz(p.albedo),
            seen: seen * extinction * xyz(p.albedo),
            emission: source * xyz(p.emission) / rate,
        }
    }

    fn meet(&self, place: DVec3, d: DVec3) -> Option<Hit> {
        let p = self.params;
        nearest(self.inputs.mesh, p.nodes, xyz(p.mesh_eye) + place, d, [0.0, f64::INFINITY])
    }

    /// Where a path scatters; normals are turned to the side that it comes from, and it goes on from a margin before a surface.
    fn spot(&self, place: DVec3, from: DVec3, surface: Option<Hit>) -> Spot {
        let Some(mut hit) = surface else { return Spot { place, from, surface } };
        hit.facet *= -hit.facet.dot(from).signum();
        if hit.normal.dot(hit.facet) < 0.0 {
            hit.normal = -hit.normal;
        }
        let margin = f64::from(MeshRecord::MARGIN * self.params.mesh_eye[3]);
        Spot { place: place + margin * hit.facet, from, surface: Some(hit) }
    }

    fn surroundings(&self, d: DVec3) -> DVec3 {
        let p = self.params;
        let of = |texels| sky([p.environment_width, p.environment_height], p.environment, texels, d);
        self.inputs.environment.map_or(DVec3::ZERO, of)
    }

    fn value(&self, at: u32) -> f64 {
        self.inputs.tables[at as usize].into()
    }

    fn choose(&mut self, at: u32, count: u32) -> u32 {
        choose(&self.inputs.tables[at as usize..], count, &mut self.draws)
    }

    fn chance(&self, item: u32) -> f64 {
        self.value(self.params.choices_at + Path::CHOICE * item + 2)
    }

    fn toward_sky(&mut self) -> DVec3 {
        let p = self.params;
        let cell = self.choose(p.sky_at, p.sky_columns * p.sky_rows);
        let (column, row) = (cell % p.sky_columns, cell / p.sky_columns);
        let u = (f64::from(column) + self.draw()) / f64::from(p.sky_columns) - f64::from(p.environment[3]);
        let (above, below) = (self.value(p.edges_at + row), self.value(p.edges_at + row + 1));
        let y = above + (below - above) * self.draw();
        let (sin, cos) = (2.0 * PI * u).sin_cos();
        let planar = (1.0 - y * y).max(0.0).sqrt();
        DVec3::new(planar * sin, y, -planar * cos)
    }

    /// The probability that the environment is chosen and drawn along `d`, per steradian.
    fn sky_density(&self, d: DVec3) -> f64 {
        let p = self.params;
        let u = (d.x.atan2(-d.z) / (2.0 * PI) + f64::from(p.environment[3])).rem_euclid(1.0);
        let v = d.y.clamp(-1.0, 1.0).acos() / PI;
        let cell = |at: f64, cells: u32| ((at * f64::from(cells)) as u32).min(cells - 1);
        let number = cell(v, p.sky_rows) * p.sky_columns + cell(u, p.sky_columns);
        self.value(p.sky_at + Path::CHOICE * number + 2) * self.chance(p.lights)
    }

    fn bends(&self) -> Bends<'_> {
        let p = self.params;
        Bends::new(p.phase_kind, p.phase, self.inputs.tables, p.phase_at, p.phase_size, p.bends_at)
    }

    /// Diffuse and specular reflectance, and the exponent.
    fn material(&self, hit: &Hit) -> (DVec3, DVec3, f64) {
        let at = self.params.materials_at + 8 * hit.material;
        let rgb = |at: u32| DVec3::new(self.value(at), self.value(at + 1), self.value(at + 2));
        (rgb(at), rgb(at + 4), self.value(at + 3))
    }

    /// The share of light from `toward` that is scattered back, per steradian: on a surface times the cosine.
    fn scattered(&self, spot: &Spot, toward: DVec3) -> DVec3 {
        let Some(hit) = &spot.surface else { return DVec3::splat(self.bends().phase(toward.dot(spot.from))) };
        let facing = hit.normal.dot(toward);
        if facing <= 0.0 || hit.facet.dot(toward) <= 0.0 {
            return DVec3::ZERO;
        }
        let (diffuse, specular, n) = self.material(hit);
        let cosine = mirrored(hit, spot.from).dot(toward);
        let lobe = if cosine > 0.0 { (n + 2.0) / (2.0 * PI) * cosine.powf(n) } else { 0.0 };
        facing * (diffuse / PI + lobe * specular)
    }

    /// The part of a surface's directions that are drawn from its diffuse term.
    fn dull(&self, hit: &Hit) -> f64 {
        let (diffuse, specular, _) = self.material(hit);
        if specular == DVec3::ZERO { 1.0 } else { diffuse.element_sum() / (diffuse + specular).element_sum() }
    }

    /// The probability that a path goes on toward `toward`, per steradian.
    fn density(&self, spot: &Spot, toward: DVec3) -> f64 {
        let Some(hit) = &spot.surface else { return self.bends().density(toward.dot(spot.from)) };
        let n = self.material(hit).2;
        let cosine = mirrored(hit, spot.from).dot(toward).max(0.0);
        let part = self.dull(hit);
        let lobe = if cosine > 0.0 { (n + 1.0) / (2.0 * PI) * cosine.powf(n) } else { 0.0 };
        part * hit.normal.dot(toward).max(0.0) / PI + (1.0 - part) * lobe
    }

    /// The direction in which a path goes on and the probability of that, unless it ends after its scattering `depth`.
    fn onward(&mut self, weight: &mut DVec3, spot: &Spot, depth: u32) -> Option<(DVec3, f64)> {
        let p = self.params;
        let shines = p.emission[..3].iter().any(|e| *e > 0.0);
        if depth >= p.max_depth && self.inputs.environment.is_none() && !shines {
            return None;
        }
        let toward = self.direction(spot);
        let density = self.density(spot, toward);
        *weight *= if density > 0.0 { self.scattered(spot, toward) / density } else { DVec3::ZERO };
        let mut stays = (weight.max_element() / f64::from(Path::WEAK)).min(1.0);
        if depth >= Path::LONG {
            stays = stays.min(1.0 - 1.0 / f64::from(Path::LONG));
        }
        if stays < 1.0 && self.draw() >= stays {
            return None;
        }
        *weight /= stays;
        Some((toward, density))
    }

    /// Draws a direction.
    fn direction(&mut self, spot: &Spot) -> DVec3 {
        if let Some(hit) = &spot.surface {
            return if self.draw() < self.dull(hit) {
                let c = self.draw().sqrt();
                around(hit.normal, c, self.draw())
            } else {
                let c = (1.0 - self.draw()).powf(1.0 / (self.material(hit).2 + 1.0));
                around(mirrored(hit, spot.from), c, self.draw())
            };
        }
        let mut draws = self.draws;
        let c = self.bends().draw(&mut draws);
        self.draws = draws;
        around(spot.from, c, self.draw())
    }
}

/// The direction that a surface mirrors a ray in.
fn mirrored(hit: &Hit, from: DVec3) -> DVec3 {
    from - 2.0 * from.dot(hit.normal) * hit.normal
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::light::Environment;
    use crate::media::Phase;
    use crate::stage::PathTables;

    /// One voxel of 2 m around (0, 0, -3), seen by 16 × 16 pixels from the origin.
    fn params(extinction: f32, albedo: f32, samples: u32) -> PathParams {
        let mut p = PathParams::zeroed();
        (p.dims, p.majorant_cells) = ([1, 1, 1, 0], [1, 1, 1, 8]);
        let row = |a: usize| [0, 1, 2, 3].map(|i| if i == a { 0.5 } else { 0.0 });
        [p.index_x, p.index_y, p.index_z] = [row(0), row(1), row(2)];
        p.eye = [0.0, 0.0, 1.5, 0.0];
        (p.forward, p.right, p.up) = ([0.0, 0.0, -1.0, 0.0], [0.3, 0.0, 0.0, 0.0], [0.0, 0.3, 0.0, 0.0]);
        (p.extinction, p.albedo, p.densest) = ([extinction; 4], [albedo; 4], extinction);
        (p.width, p.height, p.samples, p.max_depth, p.light_floor) = (16, 16, samples, u32::MAX, 1e-6);
        p
    }

    /// Means of radiance and alpha.
    fn mean(p: &PathParams, inputs: &PathInputs<'_>) -> [f64; 2] {
        let (_, _, film) = path(p, inputs);
        let pixels = film.chunks_exact(8);
        let n = pixels.len() as f64;
        pixels.fold([0.0; 2], |sum, v| [sum[0] + v[0] / n, sum[1] + v[3] / n])
    }

    fn inputs<'a>(tables: &'a [f32], lights: &'a [LightRecord]) -> PathInputs<'a> {
        PathInputs {
            density: &[1.0],
            scattering: None,
            seen: None,
            emission: None,
            emission_color: None,
            environment: None,
            // Twice the density, so that half of the collisions are none.
            majorant: &[[1.0, 2.0]],
            lights,
            tables,
            mesh: &[],
            background: None,
        }
    }

    #[test]
    fn a_furnace_is_white() {
        let sky = Environment::uniform(glam::Vec3::ONE).unwrap();
        let phase = Phase::HenyeyGreenstein { g: 0.5 };
        let tables = PathTables { phase: &phase, chances: vec![1.0], materials: vec![], environment: Some(&sky) };
        let mut p = params(1.5, 1.0, 40);
        tables.place(&mut p);
        (p.visible, p.environment, p.environment_width, p.environment_height) = (1, [1.0, 1.0, 1.0, 0.0], 1, 1);
        let values = tables.values();
        let [radiance, _] = mean(&p, &PathInputs { environment: Some(&[[1.0; 4]]), ..inputs(&values, &[]) });
        // Ten thousand paths, whose radiance differs by less than one.
        assert!((radiance - 1.0).abs() < 0.03, "{radiance}");
    }

    /// Thin, so that what is scattered twice and what is stopped on the way count for little.
    #[test]
    fn a_thin_box_scatters_phase_times_irradiance_times_depth() {
        let tables = PathTables { phase: &Phase::Rayleigh, chances: vec![1.0], materials: vec![], environment: None };
        let mut p = params(1e-3, 0.8, 20);
        tables.place(&mut p);
        (p.lights, p.choices) = (1, 1);
        let mut light = LightRecord::zeroed();
        (light.position, light.power) = ([0.0, 1.0, 0.0, 0.0], [2.0; 4]);
        let values = tables.values();
        // A rate far above the density, so that many collisions count a little each.
        let [radiance, alpha] = mean(&p, &PathInputs { majorant: &[[1.0, 400.0]], ..inputs(&values, &[light]) });
        // Seen at about a right angle to the light.
        let expected = 3.0 / (16.0 * PI) * 2.0 * 0.8 * alpha;
        assert!((radiance / expected - 1.0).abs() < 0.05 && alpha > 1e-3, "{radiance} {expected} {alpha}");
        // Two metres across, or a little less than three along the slanted rays.
        assert!((alpha / 2e-3 - 1.0).abs() < 0.1, "{alpha}");
    }
}
