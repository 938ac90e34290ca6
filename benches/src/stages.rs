//! Single stages on resources of their own.

mod classify;
mod matrices;
mod path;
mod photons;

use airlight::basis::{SphericalHarmonics, healpix, pixel_integrals};
use airlight::device::{Buf, Device, DeviceError, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec, Usage};
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Gaussian, Gaussians, Lattice, Medium};
use airlight::random::{hash, unit};
use airlight::scene::{Camera, Material, Mesh, Triangle};
use airlight::stage::propagate::{self, scheme};
use airlight::stage::{
    Accumulate, AccumulateParams, BlobRecord, FAR, GridParams, Inject, InjectParams, LightPlace, LightRecord, March,
    MarchParams, MaterialRecord, Project, ProjectParams, Propagate, PropagateParams, Reduce, ReduceParams, Relight,
    RelightParams, Shade, ShadeParams, Shadow, ShadowParams, Stage, Trace, TraceParams, Upsample, UpsampleParams,
    accumulate_mode, inject_kind, shadow_kind,
};
use bytemuck::{Pod, Zeroable};

use crate::{BOUNDS, DIMS, density, lattice};

/// Record cells along x, y and z.
pub(crate) const CELLS: [u32; 3] = [36, 24, 28];
/// 12·n² directions, with n = 2.
pub(crate) const NSIDE: u32 = 2;
pub(crate) const BANDS: u32 = 3;
/// Thin enough that no ray ends before the box does.
pub(crate) const EXTINCTION: f32 = 0.5;

/// The stages that have a benchmark.
pub const STAGES: [&str; 20] = [
    "inject",
    "reduce",
    "project",
    "propagate",
    "relight",
    "march",
    "trace",
    "shade",
    "shadow",
    "accumulate",
    "upsample",
    "coarsen",
    "illuminate",
    "sweep",
    "obstruct",
    "path",
    "evaluate",
    "reconstruct",
    "classify",
    "photons",
];

/// A ray of the view, in index space.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    start: [f32; 3],
    step: [f32; 3],
    /// Number of samples.
    pub steps: u32,
}

impl Ray {
    /// From each sample to the next.
    pub fn step(&self) -> [f32; 3] {
        self.step
    }

    /// Sample `k`, the middle of its step.
    pub fn at(&self, k: u32) -> [f32; 3] {
        let t = k as f32 + 0.5;
        [0, 1, 2].map(|a| self.start[a] + t * self.step[a])
    }
}

/// A picture of the whole box, in steps of a voxel.
#[derive(Clone, Debug)]
pub struct View {
    /// Where it is seen from.
    pub camera: Camera,
    /// The ray of each pixel.
    pub rays: Vec<Ray>,
}

impl View {
    /// Of `width` × `height` pixels.
    pub fn new(width: u32, height: u32) -> Self {
        let camera = Camera {
            origin: DVec3::new(2.6, 1.7, 2.9),
            target: 0.5 * (BOUNDS.0 + BOUNDS.1),
            up: DVec3::Y,
            fov: 30.0,
            width,
            height,
            samples: 1,
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let rays = pixels.map(|(x, y)| ray(&camera, f64::from(x) + 0.5, f64::from(y) + 0.5)).collect();
        Self { camera, rays }
    }

    /// Samples of all rays.
    pub fn samples(&self) -> u64 {
        self.rays.iter().map(|ray| u64::from(ray.steps)).sum()
    }
}

/// Clips the ray of a pixel to the box and cuts it into steps of at most a voxel, as `march` does.
fn ray(camera: &Camera, px: f64, py: f64) -> Ray {
    let lattice = lattice();
    let origin = lattice.world_to_index().transform_point3(camera.origin);
    let direction = lattice.world_to_index().transform_vector3(camera.direction(px, py));
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for a in 0..3 {
        let lower = (-0.5 - origin[a]) / direction[a];
        let upper = (f64::from(DIMS[a]) - 0.5 - origin[a]) / direction[a];
        near = near.max(lower.min(upper));
        far = far.min(lower.max(upper));
    }
    let length = (far - near).max(0.0);
    let steps = (length / lattice.shortest_edge()).ceil();
    let delta = if steps > 0.0 { length / steps } else { 0.0 };
    let single = |v: DVec3| v.as_vec3().to_array();
    Ray { start: single(origin + near * direction), step: single(delta * direction), steps: steps as u32 }
}

/// A device with the density on it, and what stages need beside it.
pub struct Rig {
    device: Box<dyn Device>,
    pub(crate) density: Field,
    next: u32,
}

impl Rig {
    /// Puts the density on a device.
    ///
    /// # Errors
    /// A device fault.
    pub fn new(mut device: Box<dyn Device>) -> Result<Self, DeviceError> {
        let spec = FieldSpec::dense(DIMS.to_array(), 1, FieldFormat::Scalar);
        let field = Field { id: ResourceId(0), spec };
        device.create(field.id, &ResourceSpec::Field(spec))?;
        let mut rig = Self { device, density: field, next: 1 };
        rig.upload(&density())?;
        Ok(rig)
    }

    /// Writes the density, and waits until it is there.
    ///
    /// # Errors
    /// A device fault.
    pub fn upload(&mut self, values: &[f32]) -> Result<(), DeviceError> {
        self.device.write(self.density.id, 0, bytemuck::cast_slice(values))?;
        self.device.finish().map(drop)
    }

    /// Runs the whole of a stage, and waits for its end.
    ///
    /// # Errors
    /// A device fault.
    pub fn run(&mut self, stage: &Stage) -> Result<(), DeviceError> {
        self.device.dispatch(stage, 0..stage.axis())?;
        self.device.finish().map(drop)
    }

    /// One of [`STAGES`], on resources of its own, with the number of its elements and what they are, in the plural.
    /// `march` looks at `view`.
    ///
    /// # Errors
    /// No such stage; a device fault.
    pub fn stage(&mut self, name: &str, view: &View) -> Result<(Stage, u64, &'static str), DeviceError> {
        let (made, unit) = match name {
            "reduce" => (self.reduce(), "voxels"),
            "project" => (self.project(), "cells"),
            "propagate" => (self.propagate(CELLS, 1, scheme::SHORT_CHARACTERISTICS), "cells"),
            "relight" => (self.relight([50; 3]), "cells"),
            "march" => (self.march(view), "samples"),
            "trace" => (self.trace(view).map(|(trace, rays)| (Stage::Trace(trace), rays)), "rays"),
            "shade" => (self.shade(view), "hits"),
            "shadow" => (self.shadow(), "texels"),
            "accumulate" => (self.accumulate(view), "pixels"),
            "upsample" => (self.upsample(view), "pixels"),
            "coarsen" => (self.coarsen(), "voxels"),
            "illuminate" => (self.illuminate(), "cells"),
            "sweep" => (self.sweep(), "cells"),
            "obstruct" => (self.obstruct(), "cells"),
            "path" => (self.path(view), "paths"),
            "evaluate" => (self.evaluate(4, false), "products"),
            "reconstruct" => (self.reconstruct(1, 1, false), "cells"),
            "classify" => (self.classify(), "voxels"),
            "photons" => (self.photons(), "photons"),
            "inject" => (self.inject(&gaussians(1000, 64)), "voxels"),
            _ => (Err(DeviceError::Invalid(format!("no benchmark of the stage {name}"))), ""),
        };
        made.map(|(stage, elements)| (stage, elements, unit))
    }

    /// `inject` of a sum of Gaussians. Its elements are the voxels.
    ///
    /// # Errors
    /// A device fault.
    pub fn inject(&mut self, medium: &Gaussians) -> Result<(Stage, u64), DeviceError> {
        let (lattice, bins) = (medium.lattice(), medium.bins());
        let stage = Inject {
            params: InjectParams::new(inject_kind::GAUSSIANS, lattice, InjectParams::centered(lattice)).with_bins(bins),
            base: None,
            blobs: Some(self.fill(&BlobRecord::of(medium))?),
            starts: Some(self.fill(&bins.starts)?),
            list: Some(self.fill(&bins.list)?),
            out: self.make(lattice.voxels(), Usage::Work)?,
        };
        Ok((Stage::Inject(stage), lattice.voxels()))
    }

    pub(crate) fn make<T: Pod>(&mut self, len: u64, usage: Usage) -> Result<Buf<T>, DeviceError> {
        let id = ResourceId(self.next);
        self.next += 1;
        let buf = Buf::new(id, len);
        self.device.create(id, &ResourceSpec::Buffer { bytes: buf.bytes(), usage })?;
        Ok(buf)
    }

    pub(crate) fn fill<T: Pod>(&mut self, data: &[T]) -> Result<Buf<T>, DeviceError> {
        let buf = self.make(data.len() as u64, Usage::Input)?;
        self.device.write(buf.id, 0, bytemuck::cast_slice(data))?;
        Ok(buf)
    }

    /// `reduce` to cells of 8³ voxels. Its elements are the voxels.
    fn reduce(&mut self) -> Result<(Stage, u64), DeviceError> {
        let coarse = DIMS.to_array().map(|d| d.div_ceil(8));
        let out = self.make(count(coarse), Usage::Work)?;
        let params =
            ReduceParams::new(DIMS.extend(0).to_array(), [coarse[0], coarse[1], coarse[2], 0], [8.0, 8.0, 8.0, 0.0]);
        Ok((Stage::Reduce(Reduce { params, density: self.density, other: None, out }), lattice().voxels()))
    }

    /// `project` of 48 directions on 3 bands at every cell. Its elements are the cells.
    fn project(&mut self) -> Result<(Stage, u64), DeviceError> {
        let grid = GridParams::new(&lattice());
        let mut params = ProjectParams::zeroed();
        params.dims = grid.dims;
        [params.index_x, params.index_y, params.index_z] = grid.index;
        [params.world_x, params.world_y, params.world_z] = grid.world;
        params.cells = [CELLS[0], CELLS[1], CELLS[2], 0];
        let side = |a: usize| grid.dims[a] as f32 / CELLS[a] as f32;
        params.cell = [side(0), side(1), side(2), lattice().shortest_edge() as f32];
        params.extinction = [EXTINCTION; 4];
        (params.direction_end, params.coefficients) = (12 * NSIDE * NSIDE, BANDS * BANDS);
        (params.channels, params.weight_channels) = (1, 1);
        let harmonics = SphericalHarmonics::new(BANDS).expect("there are as many bands");
        let weights: Vec<f32> = pixel_integrals(NSIDE, &harmonics).iter().map(|&w| w as f32).collect();
        let directions: Vec<[f32; 4]> =
            healpix::directions(NSIDE).iter().map(|d| d.as_vec3().extend(0.0).to_array()).collect();
        let stage = Project {
            params,
            density: self.density,
            emission: None,
            emission_color: None,
            occupancy: None,
            directions: self.fill(&directions)?,
            weights: self.fill(&weights)?,
            emission_weights: None,
            phase_table: None,
            records: self.make(count(CELLS) * u64::from(BANDS * BANDS), Usage::Work)?,
            emission_records: None,
        };
        Ok((Stage::Project(stage), count(CELLS)))
    }

    /// `propagate` by a scheme (a constant of [`scheme`]), from so many lights within the box, over `cells`. Its elements
    /// are the cells of all lights.
    ///
    /// # Errors
    /// A device fault.
    pub fn propagate(&mut self, cells: [u32; 3], lights: u32, scheme: u32) -> Result<(Stage, u64), DeviceError> {
        let (lattice, grid) = (lattice(), GridParams::new(&lattice()));
        let place = |n: u32| {
            let angle = std::f64::consts::TAU * f64::from(n) / f64::from(lights);
            let size = lattice.edges() * DIMS.as_dvec3();
            let position = lattice.center() + 0.3 * size * DVec3::new(angle.cos(), 0.7, angle.sin());
            LightPlace::new(&Light::Point { position, intensity: Vec3::ONE }, &lattice, cells, scheme)
        };
        let places: Vec<_> = (0..lights).map(place).collect();
        let layers = lights.div_ceil(PropagateParams::LANES);
        let mut params = PropagateParams::zeroed();
        params.dims = grid.dims;
        [params.world_x, params.world_y, params.world_z] = grid.world;
        params.cells = [cells[0], cells[1], cells[2], layers];
        let side = |a: usize| DIMS[a] as f32 / cells[a] as f32;
        params.cell = [side(0), side(1), side(2), lattice.shortest_edge() as f32];
        (params.lights, params.steps, params.scheme) = (lights, propagate::steps(&places, cells, scheme), scheme);
        params.items = PropagateParams::most_items(cells, lights, scheme).unwrap_or(0);
        let (mut occupancy, mut faces) = (None, None);
        if scheme == scheme::SHORT_CHARACTERISTICS {
            faces = Some(self.fill(&propagate::faces(&places, cells))?);
        } else {
            let out = self.make(count(cells), Usage::Work)?;
            let sides = [side(0), side(1), side(2), 0.0];
            let params = ReduceParams::new(grid.dims, [cells[0], cells[1], cells[2], 0], sides);
            self.run(&Stage::Reduce(Reduce { params, density: self.density, other: None, out }))?;
            occupancy = Some(out);
        }
        let stage = Propagate {
            params,
            density: self.density,
            occupancy,
            lights: self.fill(&places)?,
            faces,
            values: self.make(u64::from(lights) * count(cells), Usage::Work)?,
            out: self.make(u64::from(PropagateParams::LANES * layers) * count(cells), Usage::Work)?,
        };
        Ok((Stage::Propagate(stage), u64::from(lights) * count(cells)))
    }

    /// `relight` of 9 coefficients to one layer, of so many cells. Its elements are the cells.
    ///
    /// # Errors
    /// A device fault.
    pub fn relight(&mut self, cells: [u32; 3]) -> Result<(Stage, u64), DeviceError> {
        let (cells, coefficients) = (count(cells), BANDS * BANDS);
        let records: Vec<f32> = (0..cells * u64::from(coefficients)).map(|n| (n % 17) as f32 / 17.0).collect();
        let light: Vec<[f32; 4]> = (0..coefficients).map(|k| [1.0 / (k + 1) as f32; 4]).collect();
        let stage = Relight {
            params: RelightParams {
                cells: cells as u32,
                coefficients,
                channels: 1,
                layers: 1,
                emission_coefficients: 0,
                emission_weight: 0.0,
                planar: 0,
                unused: 0,
            },
            records: self.fill(&records)?,
            emission_records: None,
            light: self.fill(&light)?,
            out: self.make(cells, Usage::Work)?,
        };
        Ok((Stage::Relight(stage), cells))
    }

    /// `upsample` by four along each side. Its elements are the pixels of the full picture.
    fn upsample(&mut self, view: &View) -> Result<(Stage, u64), DeviceError> {
        let (camera, scale) = (&view.camera, 4);
        let mut params = UpsampleParams::zeroed();
        [params.forward, params.right, params.up] = camera.axes().map(four);
        (params.full_width, params.full_height, params.scale) = (camera.width, camera.height, scale);
        (params.width, params.height) = (camera.width.div_ceil(scale), camera.height.div_ceil(scale));
        (params.samples, params.surface_samples) = (1, 1);
        let pixels = view.rays.len() as u64;
        let surface: Vec<[f32; 4]> =
            (0..pixels).map(|n| [0.1, 0.2, 0.3, if n % 200 < 80 { 3.0 } else { FAR }]).collect();
        let stage = Upsample {
            params,
            medium: self.fill(&medium(u64::from(params.width) * u64::from(params.height)))?,
            rims: None,
            surface: Some(self.fill(&surface)?),
            normals: None,
            environment: None,
            subpixels: self.fill(&[0.5f32, 0.5])?,
            film: self.make(2 * pixels, Usage::Output)?,
        };
        Ok((Stage::Upsample(stage), pixels))
    }

    /// `accumulate` where the eye moved. Its elements are the pixels.
    fn accumulate(&mut self, view: &View) -> Result<(Stage, u64), DeviceError> {
        let camera = &view.camera;
        let [forward, right, up] = camera.axes();
        let mut params = AccumulateParams::zeroed();
        [params.forward, params.right, params.up] = [forward, right, up].map(four);
        params.last_forward = params.forward;
        [params.last_right, params.last_up] = [right, up].map(|axis| four(axis / axis.length_squared()));
        params.moved = [0.02, 0.01, -0.03, 0.0];
        (params.width, params.height, params.scale) = (camera.width, camera.height, 1);
        (params.full_width, params.full_height) = (camera.width, camera.height);
        (params.mode, params.most) = (accumulate_mode::MOVED, Accumulate::MOVED);
        let pixels = view.rays.len() as u64;
        let medium = medium(pixels);
        let last: Vec<[f32; 4]> = medium
            .chunks_exact(2)
            .flat_map(|p| [[p[0][0], p[0][1], p[0][2], 5.0], p[1], [p[0][3], 0.0, 0.0, 0.0]])
            .collect();
        let stage = Accumulate {
            params,
            medium: self.fill(&medium)?,
            last: self.fill(&last)?,
            next: self.make(3 * pixels, Usage::Work)?,
            mean: self.make(2 * pixels, Usage::Output)?,
        };
        Ok((Stage::Accumulate(stage), pixels))
    }

    /// `march` without light, without stepping over empty space and without rays that end early: bare lookups and
    /// exponentials. Its elements are the view samples.
    fn march(&mut self, view: &View) -> Result<(Stage, u64), DeviceError> {
        let (grid, camera) = (GridParams::new(&lattice()), &view.camera);
        let mut params = MarchParams::zeroed();
        params.dims = grid.dims;
        [params.index_x, params.index_y, params.index_z] = grid.index;
        params.eye = four(lattice().world_to_index().transform_point3(camera.origin));
        [params.forward, params.right, params.up] = camera.axes().map(four);
        (params.width, params.height, params.samples) = (camera.width, camera.height, 1);
        (params.scale, params.full_width, params.full_height) = (1, camera.width, camera.height);
        (params.sample_end, params.step_end, params.surface_samples) = (1, March::ALL_STEPS, 1);
        params.extinction = [EXTINCTION; 4];
        (params.step, params.cut, params.shadow) = (lattice().shortest_edge() as f32, March::CUT, shadow_kind::NONE);
        let stage = March {
            params,
            density: self.density,
            scattering: None,
            emission: None,
            emission_color: None,
            in_scatter: None,
            scattered: None,
            light_depth: None,
            occupancy: None,
            lights: None,
            tables: self.fill(&[0.5f32, 0.5])?,
            environment: None,
            surface: None,
            mesh: None,
            shadow_map: None,
            paths: None,
            film: self.make(2 * view.rays.len() as u64, Usage::Output)?,
        };
        Ok((Stage::March(stage), view.samples()))
    }

    /// `trace` of a wavy floor. Its elements are the view rays.
    fn trace(&mut self, view: &View) -> Result<(Trace, u64), DeviceError> {
        let (mesh, camera) = (waves(64), &view.camera);
        let hierarchy = mesh.hierarchy().expect("the floor has triangles");
        let mut params = TraceParams::zeroed();
        params.eye = four(camera.origin - hierarchy.origin());
        [params.forward, params.right, params.up] = camera.axes().map(four);
        (params.width, params.height, params.samples) = (camera.width, camera.height, 1);
        (params.nodes, params.node_end) = (hierarchy.nodes(), hierarchy.nodes());
        let rays = view.rays.len() as u64;
        let (tables, mesh) = (self.fill(&[0.5f32, 0.5])?, self.fill(hierarchy.records())?);
        Ok((Trace { params, tables, mesh, hits: self.make(2 * rays, Usage::Work)? }, rays))
    }

    /// `shade` of the same floor under a lamp, its hits from `trace`. Its elements are the view rays.
    fn shade(&mut self, view: &View) -> Result<(Stage, u64), DeviceError> {
        let (trace, rays) = self.trace(view)?;
        let (mesh, camera, grid) = (waves(64), &view.camera, GridParams::new(&lattice()));
        let hierarchy = mesh.hierarchy().expect("the floor has triangles");
        let mut params = ShadeParams::zeroed();
        params.dims = grid.dims;
        [params.index_x, params.index_y, params.index_z] = grid.index;
        params.eye = four(lattice().world_to_index().transform_point3(camera.origin));
        params.mesh_eye = (camera.origin - hierarchy.origin()).as_vec3().extend(hierarchy.extent()).to_array();
        (params.forward, params.right, params.up) = (trace.params.forward, trace.params.right, trace.params.up);
        params.extinction = [EXTINCTION; 4];
        (params.width, params.height, params.samples) = (camera.width, camera.height, 1);
        (params.lights, params.light_end, params.materials, params.visibility) = (1, 1, 1, 1);
        (params.nodes, params.step) = (hierarchy.nodes(), lattice().shortest_edge() as f32);
        params.light_floor = 1e-6;
        let stage = Shade {
            params,
            density: self.density,
            occupancy: None,
            lights: Some(self.fill(&LightRecord::of(&[lamp()], camera.origin))?),
            tables: trace.tables,
            mesh: trace.mesh,
            materials: self.fill(&[MaterialRecord::new(&mesh.materials()[0])])?,
            hits: trace.hits,
            background: None,
            out: self.make(rays, Usage::Output)?,
        };
        self.run(&Stage::Trace(trace))?;
        Ok((Stage::Shade(stage), rays))
    }

    /// `shadow` of the same floor under a lamp. Its elements are the texels.
    fn shadow(&mut self) -> Result<(Stage, u64), DeviceError> {
        const SIDE: u32 = 128;
        let mesh = waves(64);
        let hierarchy = mesh.hierarchy().expect("the floor has triangles");
        let texels = u64::from(6 * SIDE * SIDE);
        let stage = Shadow {
            params: ShadowParams {
                lights: 1,
                faces: 6,
                side: SIDE,
                nodes: hierarchy.nodes(),
                node_begin: 0,
                node_end: hierarchy.nodes(),
                extent: hierarchy.extent(),
                unused: 0,
            },
            lights: self.fill(&LightRecord::of(&[lamp()], hierarchy.origin()))?,
            mesh: self.fill(hierarchy.records())?,
            out: self.make(texels, Usage::Work)?,
        };
        Ok((Stage::Shadow(stage), texels))
    }
}

fn lamp() -> Light {
    Light::Point { position: DVec3::new(0.3, 1.5, 0.4), intensity: Vec3::ONE }
}

/// A floor of 2 n² triangles under the medium.
pub(crate) fn waves(n: u32) -> Mesh {
    let at = |i: u32, j: u32| {
        let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
        DVec3::new(3.0 * u - 1.5, 0.1 * (9.0 * u + 14.0 * v).sin(), 3.0 * v - 1.5)
    };
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| at(i, j))).collect();
    let corner = |i: u32, j: u32| j * (n + 1) + i;
    let triangles = (0..n * n).flat_map(|k| {
        let (i, j) = (k % n, k / n);
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)];
        [[a, b, c], [b, d, c]].map(|vertices| Triangle { vertices, material: 0 })
    });
    Mesh::new(positions, vec![], triangles.collect(), vec![Material::default()]).expect("a floor")
}

/// A film of the medium alone, with a surface behind a part of it.
fn medium(pixels: u64) -> Vec<[f32; 4]> {
    let pixel = |n: u64| {
        let surface = if n % 50 < 20 { 3.0 } else { FAR };
        [[0.3, 0.2, 0.1, surface], [0.5, 0.6, 0.7, 2.0 + (n % 7) as f32 / 10.0]]
    };
    (0..pixels).flat_map(pixel).collect()
}

/// So many Gaussians, a cube number, on a jittered grid that fills a unit cube of `cells` a side: each is as wide as the
/// grid's spacing, so that neighbours run into each other, as particles of smoke do.
pub fn gaussians(count: u32, cells: u32) -> Gaussians {
    let side = f64::from(count).cbrt().round() as u32;
    let place = |n: u32, key: u32| f64::from(n) + f64::from(unit(hash([n, key, 1])));
    let blob = |n: u32| {
        let at = DVec3::new(place(n % side, n), place(n / side % side, n + 1), place(n / side / side, n + 2));
        Gaussian { center: at / f64::from(side), a: f64::from(side), c: 1.0 }
    };
    let lattice = Lattice::of_cells(cells, DVec3::ZERO, DVec3::ONE).expect("a unit cube");
    Gaussians::new((0..side.pow(3)).map(blob).collect(), lattice).expect("Gaussians in range")
}

fn four(v: DVec3) -> [f32; 4] {
    v.as_vec3().extend(0.0).to_array()
}

pub(crate) fn count(sides: [u32; 3]) -> u64 {
    sides.iter().map(|&n| u64::from(n)).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_has_a_benchmark() {
        let sorted = |mut names: Vec<&'static str>| {
            names.sort();
            names
        };
        assert_eq!(sorted(STAGES.to_vec()), sorted(Stage::NAMES.to_vec()));
    }

    #[test]
    fn columns_spread_by_every_scheme_from_many_lights() {
        let mut rig = Rig::new(airlight::open("cpu").unwrap()).unwrap();
        for scheme in [scheme::SHORT_CHARACTERISTICS, scheme::METRIC, scheme::PUBLISHED] {
            let (stage, elements) = rig.propagate([6, 4, 5], 9, scheme).unwrap();
            stage.validate().unwrap();
            assert_eq!(elements, 9 * 120);
            rig.run(&stage).unwrap();
        }
    }

    #[test]
    fn every_stage_runs_on_every_device() {
        let view = View::new(24, 16);
        assert!(view.samples() > 1000);
        let backends = airlight::devices();
        let listed = backends.iter().flat_map(|backend| backend.devices.iter().flatten());
        for info in listed.filter(|info| info.unusable.is_none()) {
            let mut rig = Rig::new(airlight::open(&info.id()).unwrap()).unwrap();
            for name in STAGES {
                let (stage, elements, _) = rig.stage(name, &view).unwrap();
                assert_eq!(stage.name(), name);
                assert!(elements > 0);
                rig.run(&stage).unwrap();
            }
        }
    }
}
