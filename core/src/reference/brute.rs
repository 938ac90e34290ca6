//! Brute force over a whole scene, in f64: all light that the medium scatters at most once.
//!
//! It knows nothing of stages, estimators, records or step lengths. A trilinear field is a cubic along a ray between
//! two planes of its lattice, so columns of density are exact: the ray is cut at every plane and two Gauss points serve
//! each piece. View rays are cut as well where they pass a plane of a light and an edge of a surface, so that no piece
//! is lit in part, and beside a light at distances from it that double. Each of their pieces takes
//! [`BruteSettings::nodes`] Gauss points. The sphere is cut into texels of the environment, and those into as many
//! parts as make [`BruteSettings::rows`] rows.

use std::f64::consts::PI;

use glam::{DAffine3, DVec2, DVec3};

use super::closed::transmittance;
use super::facets::Facets;
use super::lookup::clip;
use crate::basis::quadrature::gauss_legendre;
use crate::light::Light;
use crate::media::OpticsField;
use crate::scene::Scene;

/// How fine the quadratures are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BruteSettings {
    /// Rows of the sphere's quadrature, at least; there are twice as many columns.
    pub rows: u32,
    /// Gauss points on each piece of a view ray between two planes of the lattice.
    pub nodes: usize,
}

impl Default for BruteSettings {
    fn default() -> Self {
        Self { rows: 32, nodes: 3 }
    }
}

/// A part of the sphere.
struct Part {
    direction: DVec3,
    solid_angle: f64,
    radiance: DVec3,
}

/// A scene, ready to be integrated pixel by pixel.
///
/// Included are: emission, seen and scattered once; the environment, seen where it is visible and scattered once;
/// every light, scattered once; surfaces, which end view rays, shadow lights, and are lit by lights alone: what comes
/// from all around passes through them. [`Scene::estimate`](crate::scene::Scene), `background` and `quality` are not
/// read. Rims of spots may lie within pieces.
pub struct BruteForce<'s> {
    scene: &'s Scene,
    dims: [u32; 4],
    to_index: DAffine3,
    density: Vec<f64>,
    /// Of each channel, as the eye sees it; none where it is the density.
    scattering: Option<[Vec<f64>; 3]>,
    emission: Option<[Vec<f64>; 3]>,
    facets: Facets<'s>,
    sphere: Vec<Part>,
    pair: Vec<(f64, f64)>,
    nodes: Vec<(f64, f64)>,
}

impl<'s> BruteForce<'s> {
    /// Reads the medium and cuts the sphere.
    pub fn new(scene: &'s Scene, settings: &BruteSettings) -> Self {
        Self::under(scene, settings, |d| scene.environment.as_ref().map_or(DVec3::ZERO, |e| e.radiance(d)))
    }

    /// As [`BruteForce::new`], with `radiance` in place of the environment's where it is scattered: a truncation of
    /// it, say, which may be negative.
    pub fn under(scene: &'s Scene, settings: &BruteSettings, radiance: impl Fn(DVec3) -> DVec3) -> Self {
        Self::with_sphere(scene, settings, sphere(scene, settings.rows, radiance))
    }

    /// As [`BruteForce::new`], with light from a few directions alone in place of the environment's where it is
    /// scattered: unit directions toward it and the integrals of radiance that each stands for, W m⁻². So an
    /// estimator's own set of directions can be held apart from the rest of its error.
    pub fn among(scene: &'s Scene, settings: &BruteSettings, light: &[(DVec3, DVec3)]) -> Self {
        let part = |&(direction, radiance)| Part { direction, solid_angle: 1.0, radiance };
        Self::with_sphere(scene, settings, light.iter().map(part).collect())
    }

    fn with_sphere(scene: &'s Scene, settings: &BruteSettings, sphere: Vec<Part>) -> Self {
        let lattice = scene.medium.lattice();
        let d = lattice.dims();
        let voxels = d.x as usize * d.y as usize;
        // Channel `c` of a field of so many values a voxel.
        let read = |values: usize, c: usize, write: &dyn Fn(u32, &mut [f32])| -> Vec<f64> {
            let mut slice = vec![0.0f32; voxels * values];
            let mut channel = Vec::new();
            for k in 0..d.z {
                write(k, &mut slice);
                channel.extend(slice.iter().skip(c).step_by(values).map(|&v| f64::from(v)));
            }
            channel
        };
        let colors = |field: OpticsField<'_>| [0, 1, 2].map(|c| read(4, c, &|k, out| field.slice(k, out)));
        let grey = |field: OpticsField<'_>| [0, 1, 2].map(|_| read(1, 0, &|k, out| field.slice(k, out)));
        let fields = scene.medium.optics_fields();
        let density = read(1, 0, &|k, out| scene.medium.density_slice(k, out));
        let scattering = fields.seen.or(fields.scattering).map(colors);
        let emission = fields.emission_color.map(colors).or_else(|| fields.emission.map(grey));
        Self {
            scene,
            dims: [d.x, d.y, d.z, 0],
            to_index: lattice.world_to_index(),
            density,
            scattering,
            emission,
            facets: Facets::new(scene.surfaces.as_deref()),
            sphere,
            pair: gauss_legendre(2),
            nodes: gauss_legendre(settings.nodes),
        }
    }

    /// RGB (W m⁻² sr⁻¹) and alpha = 1 - mean transmittance of the pixel in column `x`, row `y`: the mean over the
    /// camera's sub-pixel positions.
    pub fn pixel(&self, x: u32, y: u32) -> [f64; 4] {
        let camera = &self.scene.camera;
        let places = camera.subpixels();
        let mut sum = [0.0; 4];
        for place in &places {
            let at = DVec2::new(x.into(), y.into()) + *place;
            let found = self.ray(camera.origin, camera.direction(at.x, at.y));
            (0..4).for_each(|c| sum[c] += found[c] / places.len() as f64);
        }
        sum
    }

    /// RGB and alpha along the ray from `origin` in the unit direction `d`.
    pub fn ray(&self, origin: DVec3, d: DVec3) -> [f64; 4] {
        let optics = &self.scene.optics;
        let (extinction, albedo) = (optics.extinction.as_dvec3(), optics.albedo.as_dvec3());
        let (start, along) = self.carry(origin, d);
        let surface = self.facets.nearest(origin, d);
        let end = surface.as_ref().map_or(f64::INFINITY, |hit| hit.distance);
        let (near, far) = clip(start, along, self.dims, end);
        let mut cuts = self.cuts(start, along, near, far);
        cuts.extend(self.breaks(origin, d, near, far));
        cuts.sort_by(f64::total_cmp);
        let mut color = DVec3::ZERO;
        let mut column = 0.0;
        for piece in cuts.windows(2) {
            for &(x, w) in &self.nodes {
                let t = 0.5 * (piece[0] + piece[1]) + 0.5 * (piece[1] - piece[0]) * x;
                let at = start + t * along;
                let scattering = self.tinted(&self.scattering, at) * extinction * albedo;
                let reaching = exp(-(column + self.smooth(start, along, piece[0], t)) * extinction);
                let mut source = self.emission(at);
                if scattering != DVec3::ZERO {
                    source += scattering * self.scattered(origin + t * d, d);
                }
                color += 0.5 * (piece[1] - piece[0]) * w * reaching * source;
            }
            column += self.smooth(start, along, piece[0], piece[1]);
        }
        let through = exp(-column * extinction);
        if let Some(hit) = surface {
            let x = origin + hit.distance * d;
            let reflected = |light| {
                let (toward, arriving) = self.lit(x, light)?;
                Some(self.facets.reflect(&hit, d, toward) * arriving)
            };
            color += through * self.scene.lights.iter().filter_map(reflected).sum::<DVec3>();
        } else if let Some(environment) = self.scene.environment.as_ref().filter(|e| e.visible) {
            color += through * environment.radiance(d);
        }
        [color.x, color.y, color.z, 1.0 - (through.x + through.y + through.z) / 3.0]
    }

    /// J: what the point `x` of the world scatters into a view ray along `d`, per unit of scattering.
    pub fn scattered(&self, x: DVec3, d: DVec3) -> DVec3 {
        let optics = &self.scene.optics;
        let mut sum = DVec3::ZERO;
        for part in &self.sphere {
            let (start, along) = self.carry(x, part.direction);
            let phase = optics.phase.eval(part.direction.dot(d)) * part.solid_angle;
            sum += phase * self.arriving(start, along, part.radiance);
        }
        for (toward, arriving) in self.scene.lights.iter().filter_map(|light| self.lit(x, light)) {
            sum += optics.phase.eval(toward.dot(d)) * arriving;
        }
        sum
    }

    /// Direction toward a light and the irradiance that arrives of it; none in a shadow.
    fn lit(&self, x: DVec3, light: &Light) -> Option<(DVec3, DVec3)> {
        let (toward, distance, irradiance) = light.at(x, 0.0);
        if irradiance == DVec3::ZERO || self.facets.hide(x, toward, distance) {
            return None;
        }
        let (start, along) = self.carry(x, toward);
        let column = self.column(start, along, distance);
        Some((toward, irradiance * exp(-column * self.scene.optics.extinction.as_dvec3())))
    }

    /// Parameters between `near` and `far` of a view ray where light begins or ends, or grows much.
    fn breaks(&self, origin: DVec3, d: DVec3, near: f64, far: f64) -> Vec<f64> {
        let mut cuts = Vec::new();
        for light in &self.scene.lights {
            cuts.extend(self.facets.edges(origin, d, light));
            if let Light::Point { position, .. } | Light::Spot { position, .. } = *light {
                let middle = (position - origin).dot(d);
                let mut apart = (origin + middle * d - position).length().max(1e-6 * (far - near));
                cuts.push(middle);
                while apart < far - near {
                    cuts.extend([middle - apart, middle + apart]);
                    apart *= 2.0;
                }
            }
        }
        cuts.retain(|t| *t > near && *t < far);
        cuts
    }

    /// Radiance that reaches `start` along a ray from far away with `radiance`, attenuated, and what the medium emits
    /// on the way.
    fn arriving(&self, start: DVec3, along: DVec3, radiance: DVec3) -> DVec3 {
        let extinction = self.scene.optics.extinction.as_dvec3();
        if !self.scene.optics.emits() {
            return radiance * exp(-self.column(start, along, f64::INFINITY) * extinction);
        }
        let (near, far) = clip(start, along, self.dims, f64::INFINITY);
        let (mut sum, mut column) = (DVec3::ZERO, 0.0);
        for piece in self.cuts(start, along, near, far).windows(2) {
            for &(x, w) in &self.nodes {
                let t = 0.5 * (piece[0] + piece[1]) + 0.5 * (piece[1] - piece[0]) * x;
                let reaching = exp(-(column + self.smooth(start, along, piece[0], t)) * extinction);
                sum += 0.5 * (piece[1] - piece[0]) * w * reaching * self.emission(start + t * along);
            }
            column += self.smooth(start, along, piece[0], piece[1]);
        }
        sum + radiance * exp(-column * extinction)
    }

    /// A ray of the world in index space; its parameter stays metres.
    fn carry(&self, origin: DVec3, d: DVec3) -> (DVec3, DVec3) {
        (self.to_index.transform_point3(origin), self.to_index.transform_vector3(d))
    }

    /// Column of density (metres) from `start` on to the end of the box or `limit`.
    fn column(&self, start: DVec3, along: DVec3, limit: f64) -> f64 {
        let (near, far) = clip(start, along, self.dims, limit);
        self.cuts(start, along, near, far).windows(2).map(|p| self.smooth(start, along, p[0], p[1])).sum()
    }

    /// Column over a piece without a plane of the lattice inside: a cubic, so two Gauss points are exact.
    fn smooth(&self, start: DVec3, along: DVec3, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        self.pair.iter().map(|&(x, w)| half * w * self.density(start + (middle + half * x) * along)).sum()
    }

    /// `near`, `far` and every parameter between them where the ray passes a plane of samples, rising.
    fn cuts(&self, start: DVec3, along: DVec3, near: f64, far: f64) -> Vec<f64> {
        if near >= far {
            return Vec::new();
        }
        let mut cuts = vec![near, far];
        for a in 0..3 {
            let ends = [start[a] + near * along[a], start[a] + far * along[a]];
            let (low, high) = (ends[0].min(ends[1]).ceil(), ends[0].max(ends[1]).floor());
            let planes = (low as i64..=high as i64).map(|plane| (plane as f64 - start[a]) / along[a]);
            cuts.extend(planes.filter(|t| *t > near && *t < far));
        }
        cuts.sort_by(f64::total_cmp);
        cuts
    }

    fn density(&self, at: DVec3) -> f64 {
        self.lookup(&self.density, at)
    }

    /// Emission coefficient j at a point of index space.
    fn emission(&self, at: DVec3) -> DVec3 {
        if self.scene.optics.emits() {
            self.scene.optics.emission.as_dvec3() * self.tinted(&self.emission, at)
        } else {
            DVec3::ZERO
        }
    }

    /// A density of each channel, which is the medium's where there is no other.
    fn tinted(&self, channels: &Option<[Vec<f64>; 3]>, at: DVec3) -> DVec3 {
        match channels {
            Some(channels) => DVec3::from([0, 1, 2].map(|c| self.lookup(&channels[c], at))),
            None => DVec3::splat(self.density(at)),
        }
    }

    fn lookup(&self, values: &[f64], at: DVec3) -> f64 {
        let [nx, ny, _, _] = self.dims.map(|n| n as usize);
        let mut low = [0; 3];
        let mut high = [0; 3];
        let mut f = [0.0; 3];
        for a in 0..3 {
            let last = f64::from(self.dims[a] - 1);
            let floor = at[a].floor();
            (low[a], high[a]) = (floor.clamp(0.0, last) as usize, (floor + 1.0).clamp(0.0, last) as usize);
            f[a] = at[a] - floor;
        }
        let line = |y: usize, z: usize| {
            let row = &values[(z * ny + y) * nx..];
            row[low[0]] * (1.0 - f[0]) + row[high[0]] * f[0]
        };
        let plane = |z: usize| line(low[1], z) * (1.0 - f[1]) + line(high[1], z) * f[1];
        plane(low[2]) * (1.0 - f[2]) + plane(high[2]) * f[2]
    }
}

fn exp(v: DVec3) -> DVec3 {
    DVec3::from(v.to_array().map(|v| transmittance(-v)))
}

/// The whole sphere in parts that lie within one texel of the environment each; nothing where no light comes from
/// all around.
fn sphere(scene: &Scene, rows: u32, radiance: impl Fn(DVec3) -> DVec3) -> Vec<Part> {
    if scene.environment.is_none() && !scene.optics.emits() {
        return Vec::new();
    }
    let texels = scene.environment.as_ref().map_or((1, 1), |e| (e.image().width, e.image().height));
    let up = |texels: u32, least: u32| texels * least.div_ceil(texels).max(1);
    let (columns, rows) = (up(texels.0, 2 * rows), up(texels.1, rows));
    let turn = scene.environment.as_ref().map_or(0.0, |e| e.rotation.to_radians());
    let mut parts = Vec::new();
    for row in 0..rows {
        let edge = |row: u32| (PI * f64::from(row) / f64::from(rows)).cos();
        let y = 0.5 * (edge(row) + edge(row + 1));
        let planar = (1.0 - y * y).sqrt();
        for column in 0..columns {
            // u = 0 lies at -Z and grows toward +X, before the turn.
            let (sin, cos) = (PI + turn - 2.0 * PI * (f64::from(column) + 0.5) / f64::from(columns)).sin_cos();
            let direction = DVec3::new(planar * sin, y, planar * cos);
            parts.push(Part {
                direction,
                solid_angle: 2.0 * PI / f64::from(columns) * (edge(row) - edge(row + 1)),
                radiance: radiance(direction),
            });
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DMat3, DQuat, UVec3, Vec3};

    use super::*;
    use crate::light::{Environment, Image, Light};
    use crate::media::{Grid, GridMedium, Homogeneous, Optics, Phase};
    use crate::reference::closed::{LitBox, emission_absorption};
    use crate::scene::{Camera, Estimate, Material, Quality, Shape};

    const MIN: DVec3 = DVec3::new(-0.3, 0.1, -0.2);
    const MAX: DVec3 = DVec3::new(0.4, 0.6, 0.7);

    fn fog(extinction: f32) -> Scene {
        Scene {
            camera: Camera {
                origin: DVec3::new(1.2, 0.9, 1.7),
                target: DVec3::new(0.1, 0.3, 0.2),
                up: DVec3::Y,
                fov: 25.0,
                width: 8,
                height: 6,
                samples: 1,
            },
            medium: Arc::new(Homogeneous::new(1.0, MIN, MAX).unwrap()),
            optics: Optics { albedo: Vec3::new(0.9, 0.5, 0.2), ..Optics::grey(extinction, 1.0) },
            environment: None,
            background: None,
            surfaces: None,
            frame: 0,
            lights: Vec::new(),
            estimate: Estimate::single(),
            quality: Quality::default(),
        }
    }

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance * expected.abs().max(1e-12), "{found} {expected}");
    }

    #[test]
    fn a_lit_box_is_closed() {
        let mut scene = fog(2.0);
        scene.optics.extinction = Vec3::new(3.0, 2.0, 0.5);
        let to_light = DVec3::new(0.5, 0.8, -0.35).normalize();
        scene.optics.phase = Phase::HenyeyGreenstein { g: 0.6 };
        scene.lights = vec![Light::directional(to_light, Vec3::new(3.0, 2.0, 1.0)).unwrap()];
        // The box of one voxel has few planes, so the kinks of the way to the light lie within pieces.
        let truth = BruteForce::new(&scene, &BruteSettings { rows: 1, nodes: 60 });
        for (x, y) in [(4, 3), (2, 4), (6, 1)] {
            let d = scene.camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let found = truth.pixel(x, y);
            let mut through = 0.0;
            for c in 0..3 {
                let extinction = f64::from(scene.optics.extinction[c]);
                let lit = LitBox {
                    min: MIN,
                    max: MAX,
                    scattering: extinction * f64::from(scene.optics.albedo[c]),
                    extinction,
                    to_light,
                    irradiance: [3.0, 2.0, 1.0][c],
                };
                let phase = scene.optics.phase.eval(to_light.dot(d));
                close(found[c], lit.single_scattering(phase, scene.camera.origin, d), 1e-4);
                let (near, far) = lit.clip(scene.camera.origin, d).unwrap();
                through += transmittance(extinction * (far - near)) / 3.0;
            }
            close(found[3], 1.0 - through, 1e-12);
        }
    }

    #[test]
    fn emission_is_closed() {
        let mut scene = fog(3.0);
        scene.optics.albedo = Vec3::ZERO;
        scene.optics.emission = Vec3::new(2.0, 0.9, 0.1);
        let truth = BruteForce::new(&scene, &BruteSettings { rows: 1, nodes: 12 });
        let found = truth.pixel(4, 3);
        let length = -(1.0 - found[3]).ln() / 3.0;
        for c in 0..3 {
            close(found[c], emission_absorption(scene.optics.emission[c].into(), 3.0, length), 1e-9);
        }
    }

    /// Thin and lit alike from everywhere, a medium scatters σs ℓ L. The first order in the depth of its shadow is
    /// left, about half the depth of the box.
    #[test]
    fn a_thin_box_in_a_uniform_sky() {
        let mut scene = fog(1e-4);
        let mut sky = Environment::uniform(Vec3::new(1.0, 2.0, 3.0)).unwrap();
        sky.visible = false;
        scene.environment = Some(sky);
        scene.optics.phase = Phase::HenyeyGreenstein { g: 0.5 };
        let truth = BruteForce::new(&scene, &BruteSettings::default());
        let found = truth.pixel(4, 3);
        for c in 0..3 {
            // 32 rows leave 0.2 % of a phase function with g = 0.5.
            close(found[c], found[3] * f64::from(scene.optics.albedo[c]) * (c as f64 + 1.0), 2e-3);
        }
    }

    /// A plate under light from straight above, seen through its shadow and from above.
    #[test]
    fn a_plate_shadows_and_is_lit() {
        let mut scene = fog(0.5);
        scene.medium = Arc::new(Homogeneous::new(1.0, DVec3::splat(-2.0), DVec3::splat(2.0)).unwrap());
        let material = Material { diffuse: Vec3::new(0.8, 0.4, 0.2), ..Material::default() };
        scene.surfaces = Some(Arc::new(Shape::Plane.mesh(material).unwrap()));
        scene.lights = vec![Light::directional(DVec3::Y, Vec3::splat(3.0)).unwrap()];
        let truth = BruteForce::new(&scene, &BruteSettings { rows: 1, nodes: 12 });
        let through = |length: f64| (-0.5 * length).exp();
        // Lit as far as x = -½ and again from x = ½ on, 2.2 m below the end of the medium.
        let found = truth.ray(DVec3::new(-2.0, -0.2, 0.1), DVec3::X);
        let lit = 1.0 - through(1.5) + through(2.5) - through(4.0);
        let scattered = 3.0 * through(2.2) * scene.optics.phase.eval(0.0);
        for c in 0..3 {
            close(found[c], f64::from(scene.optics.albedo[c]) * scattered * lit, 1e-9);
        }
        scene.optics.albedo = Vec3::ZERO;
        let truth = BruteForce::new(&scene, &BruteSettings { rows: 1, nodes: 12 });
        let d = DVec3::new(0.6, -0.8, 0.0);
        let found = truth.ray(DVec3::new(-0.7, 0.8, 0.1), d);
        for c in 0..3 {
            close(found[c], 3.0 * through(2.0) * f64::from(material.diffuse[c]) / PI * through(1.0), 1e-9);
        }
    }

    /// The column of a turned and mirrored random lattice against a plain sum of many steps, and the environment's
    /// parts against its projection.
    #[test]
    fn columns_are_exact_and_the_sphere_is_whole() {
        let dims = UVec3::new(7, 5, 9);
        let values = (0..315).map(|i| (1.0 + (1.7 * f64::from(i)).sin()) as f32).collect();
        let turn = DMat3::from_quat(DQuat::from_rotation_y(0.4)) * DMat3::from_diagonal(DVec3::new(-0.1, 0.12, 0.07));
        let map = DAffine3::from_mat3_translation(turn, DVec3::new(0.4, 0.1, 0.2));
        let mut scene = fog(1.0);
        scene.medium = Arc::new(GridMedium::new(Arc::new(Grid::dense(dims, map, values).unwrap()), None).unwrap());
        let texels = (0..32u8).map(|i| [f32::from(i % 5), f32::from(i % 3), 1.0]).collect();
        let mut sky = Environment::new(Image { width: 8, height: 4, texels }).unwrap();
        (sky.rotation, sky.visible) = (70.0, false);
        let mean = sky.mean_radiance();
        scene.environment = Some(sky);
        let truth = BruteForce::new(&scene, &BruteSettings::default());
        let flux: DVec3 = truth.sphere.iter().map(|p| p.radiance * p.solid_angle).sum();
        // The midpoint rule over the bilinear function in 8 parts of a texel.
        assert!((flux / (4.0 * PI) - mean).length() < 2e-3, "{} {mean}", flux / (4.0 * PI));
        let d = DVec3::new(-0.5, -0.2, -0.6).normalize();
        let (start, along) = truth.carry(DVec3::new(0.9, 0.7, 1.2), d);
        let (near, far) = clip(start, along, truth.dims, f64::INFINITY);
        let steps = 200_000;
        let h = (far - near) / f64::from(steps);
        let sum: f64 = (0..steps).map(|k| h * truth.density(start + (near + (f64::from(k) + 0.5) * h) * along)).sum();
        assert!(far > near);
        // The midpoint rule's own error.
        close(truth.column(start, along, f64::INFINITY), sum, 1e-8);
    }
}
