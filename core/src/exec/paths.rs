//! The estimator `path`: tables of what a path chooses from, the stage, and the loop that goes on until there are enough
//! samples.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use super::error::{ExecError, RenderError};
use super::executor::{Hooks, Progress, Report};
use super::plan::Plan;
use super::renderer::{
    OnDevice, READ, Renderer, Surface, light_floor, plan_background, plan_occupancy, upload_medium, upload_sky,
};
use super::surfaces::{upload_lights, upload_mesh};
use crate::device::{Buf, DeviceError, ResourceId};
use crate::light::Light;
use crate::scene::{Mesh, Path as Options, Scene};
use crate::stage::{LightRecord, MaterialRecord, Path, PathParams, PathTables, PhaseParams, Stage};

/// How far paths were traced.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathsRun {
    /// Samples of each pixel.
    pub samples: u32,
    /// The standard error of the picture's mean over the channels, as relative L2 over the pixels; infinite for a single sample.
    pub noise: f64,
}

/// The time that a call of the stage shall take, about, between looks at how far it is.
const LOOK: Duration = Duration::from_millis(500);
/// The most samples between two looks.
const MOST: u32 = 64;
/// Calls in a row in which no path of any pixel ends, after which the device is taken not to compute.
const PATIENCE: u32 = 1000;

impl Renderer {
    /// Traces paths until there are as many as `options` asks for, or as few as it allows. Goes on from what an earlier call
    /// left of the same scene.
    pub(super) fn trace_paths(
        &mut self,
        scene: &Scene,
        options: &Options,
        surface: Option<Surface<'_>>,
        hooks: &mut Hooks<'_>,
    ) -> Result<OnDevice, RenderError> {
        let begin = Instant::now();
        let (width, height) = (scene.camera.width, scene.camera.height);
        let limit = options.time_limit.unwrap_or(f64::INFINITY);
        let mut report = Report::default();
        let (mut done, mut target, mut batch) = (0, 1, 1u32);
        let (mut idle, mut last) = (0, 0.0);
        let mut first = None;
        let (content, mut fill) = surface.map_or((None, None), |surface| (Some(surface.content()), Some(surface)));
        loop {
            let mut progress = |Progress { stage, done: part }: Progress| {
                if let Some(outer) = &mut hooks.progress {
                    let part = if stage == "path" { part } else { 0.0 };
                    let samples = done as f32 + part * (target - done) as f32;
                    outer(Progress { stage, done: samples / options.samples.max(target) as f32 });
                }
            };
            let mut inner = Hooks { progress: Some(&mut progress), cancel: hooks.cancel };
            let surface = fill.take().or_else(|| content.map(Surface::filled));
            let (Planned { film, sums }, run) = self
                .executor
                .run(&mut inner, |plan| Ok::<_, RenderError>(plan_paths(scene, surface, options, target, plan)))?;
            merge(&mut report, run);
            let (paths, ended) = self.survey(sums)?;
            report.paths = Some(paths);
            if paths.samples < target {
                (idle, last) = (if ended > last { 0 } else { idle + 1 }, ended);
                if idle > PATIENCE {
                    let device = self.executor.device().info().name.clone();
                    let error = DeviceError::Backend(format!("no path ended in {PATIENCE} calls"));
                    return Err(ExecError::Device { device, stage: "path".into(), error }.into());
                }
                continue;
            }
            (idle, last) = (0, ended);
            done = paths.samples;
            let elapsed = begin.elapsed().as_secs_f64();
            let quiet = options.noise.is_some_and(|noise| paths.noise <= f64::from(noise));
            if done >= options.samples || elapsed >= limit || quiet {
                return Ok(OnDevice { film, width, height, report });
            }
            // The first call builds kernels, and what an earlier one left costs no time.
            let (since, before) = *first.get_or_insert((elapsed, done));
            let pace = (elapsed - since) / f64::from((done - before).max(1));
            let room = LOOK.as_secs_f64().min(limit - elapsed) / pace.max(1e-9);
            // By twice at the most, so that the executor, which cuts work by the last time it took, keeps up.
            batch = (room as u32).clamp(1, MOST.min(2 * batch));
            target = done.saturating_add(batch).min(options.samples);
        }
    }

    /// How many samples each pixel has, how noisy they are, and how many there are in all.
    fn survey(&mut self, sums: Buf<[f32; 4]>) -> Result<(PathsRun, f64), RenderError> {
        let pixels = sums.len / 3;
        let (mut least, mut errors, mut squares, mut ended) = (u32::MAX, 0.0, 0.0, 0.0);
        let mut part = vec![[0.0; 4]; 3 * READ.min(pixels) as usize];
        let mut at = 0;
        while at < pixels {
            let count = READ.min(pixels - at);
            let part = &mut part[..3 * count as usize];
            self.executor.read_into(sums, 3 * at, part)?;
            for pixel in part.chunks_exact(3) {
                let [r, g, b, n] = pixel[0].map(f64::from);
                least = least.min(n as u32);
                ended += n;
                let mean = (r + g + b) / (3.0 * n.max(1.0));
                let square = f64::from(pixel[1][3]) / n.max(1.0);
                // Of the mean; infinite for a single sample.
                errors += (square - mean * mean).max(0.0) / (n - 1.0).max(0.0);
                squares += mean * mean;
            }
            at += count;
        }
        let noise = if least < 2 {
            f64::INFINITY
        } else if squares > 0.0 {
            (errors / squares).sqrt()
        } else {
            0.0
        };
        Ok((PathsRun { samples: least, noise }, ended))
    }
}

/// Adds what a run of the same plan did.
fn merge(report: &mut Report, run: Report) {
    if report.stages.len() == run.stages.len() {
        for (sum, stage) in report.stages.iter_mut().zip(run.stages) {
            sum.ran |= stage.ran;
            sum.time += stage.time;
        }
    } else {
        report.stages = run.stages;
    }
    report.uploads.extend(run.uploads);
    report.upload_time += run.upload_time;
    report.bytes = run.bytes;
}

/// What a plan of paths leaves.
struct Planned {
    film: Buf<[f32; 4]>,
    sums: Buf<[f32; 4]>,
}

/// Plans everything up to `samples` samples a pixel, or as many as the turns of one call allow.
fn plan_paths<'a>(
    scene: &'a Scene,
    surface: Option<Surface<'a>>,
    options: &Options,
    samples: u32,
    plan: &mut Plan<'a>,
) -> Planned {
    let medium = upload_medium(scene, plan);
    let mesh = upload_mesh(scene, plan);
    let lights = upload_lights(scene, mesh.is_some(), plan);
    let background = plan_background(scene, surface, plan);
    let majorant = plan_occupancy(&medium, plan);
    let (camera, optics, grid) = (&scene.camera, &scene.optics, &medium.grid);
    let rgb0 = |v: Vec3| v.extend(0.0).to_array();
    let mut params = PathParams::zeroed();
    params.dims = grid.dims;
    [params.index_x, params.index_y, params.index_z] = grid.index;
    let eye = scene.medium.lattice().world_to_index().transform_point3(camera.origin);
    params.eye = rgb0(eye.as_vec3());
    [params.forward, params.right, params.up] = camera.axes().map(|a: DVec3| rgb0(a.as_vec3()));
    (params.extinction, params.albedo) = (rgb0(optics.extinction), rgb0(optics.albedo));
    params.emission = rgb0(if medium.emission.is_on() { optics.emission } else { Vec3::ZERO });
    (params.majorant_cells, params.densest) = (majorant.cells, optics.extinction.max_element());
    if medium.emission.is_on() {
        // About a collision in each cell, so that thin fire is not missed.
        params.least = (1.0 / (f64::from(majorant.cells[3]) * scene.medium.lattice().shortest_edge())) as f32;
    }
    (params.width, params.height, params.frame) = (camera.width, camera.height, scene.frame);
    params.max_depth = options.max_depth.unwrap_or(u32::MAX);
    params.light_floor = light_floor(scene);
    if let Some(mesh) = &mesh {
        (params.mesh_eye, params.nodes) = (mesh.from_origin(camera.origin), mesh.nodes);
    }
    let environment = scene.environment.as_ref().map(|environment| {
        let sky = upload_sky(environment, plan);
        [params.environment_width, params.environment_height] = sky.size;
        (params.environment, params.environment_dims) = (sky.tint, sky.dims);
        params.visible = environment.visible.into();
        sky.field
    });
    params.lights = lights.map_or(0, |lights| lights.len as u32);
    params.spots = LightRecord::spots(&scene.lights);
    let tables = plan_tables(scene, &mut params, plan);
    let pixels = u64::from(camera.width) * u64::from(camera.height);
    let mut path = Path {
        params,
        density: medium.density,
        scattering: medium.scattering,
        seen: medium.seen,
        emission: medium.emission.density(),
        emission_color: medium.emission.color(),
        environment,
        majorant: majorant.buffer,
        lights,
        tables,
        mesh: mesh.as_ref().map(|mesh| mesh.records),
        background,
        sums: Buf::new(ResourceId(0), 3 * pixels),
        paths: Buf::new(ResourceId(0), pixels),
        film: Buf::new(ResourceId(0), 2 * pixels),
    };
    // All but how long the paths are followed.
    let key = plan.key(&Stage::Path(path.clone()));
    path.sums = plan.kept("path sums", 3 * pixels, &key);
    path.paths = plan.kept("paths under way", pixels, &key);
    path.film = plan.output("film", 2 * pixels);
    (path.params.samples, path.params.turns) = (samples, Path::TURNS);
    let planned = Planned { film: path.film, sums: path.sums };
    plan.host(planned.film.bytes());
    plan.stage(Stage::Path(path));
    planned
}

/// Tables of the phase function and of what a path chooses from.
fn plan_tables<'a>(scene: &'a Scene, params: &mut PathParams, plan: &mut Plan<'a>) -> Buf<f32> {
    let materials = |mesh: &'a Mesh| mesh.materials().iter().map(MaterialRecord::new);
    let tables = PathTables {
        phase: &scene.optics.phase,
        chances: chances(scene, params.lights as usize),
        materials: scene.surfaces.as_deref().map(materials).into_iter().flatten().collect(),
        environment: scene.environment.as_ref(),
    };
    let length = tables.place(params);
    let mut key: Vec<u8> = bytemuck::cast_slice(&tables.chances).to_vec();
    key.extend(bytemuck::cast_slice::<_, u8>(&tables.materials));
    key.extend(bytemuck::cast_slice::<_, u8>(&PhaseParams::new(tables.phase).table));
    let tint = tables.environment.map(|e| (e.version(), e.scale.to_array().map(f32::to_bits)));
    plan.upload("path tables", length.into(), &(key, tint), move || tables.values())
}

/// Probabilities with which lights, and the environment behind them, are chosen: three quarters in proportion to the light that
/// each sends through the middle of the medium (∫ L dω, mean of the channels), the rest evenly.
fn chances(scene: &Scene, lights: usize) -> Vec<f64> {
    let lattice = scene.medium.lattice();
    let (min, max) = lattice.world_bounds();
    let (middle, radius) = (lattice.center(), 0.5 * (max - min).length());
    let mean = |v: DVec3| (v.x + v.y + v.z) / 3.0;
    let from = |position: DVec3, intensity: Vec3| {
        mean(intensity.as_dvec3()) / (position - middle).length_squared().max(radius * radius)
    };
    let sent = |light: &Light| match *light {
        Light::Directional { irradiance, .. } => mean(irradiance.as_dvec3()),
        Light::Point { position, intensity } | Light::Spot { position, intensity, .. } => from(position, intensity),
    };
    let mut weights: Vec<f64> = scene.lights.iter().take(lights).map(sent).collect();
    weights.extend(scene.environment.as_ref().map(|e| 4.0 * PI * mean(e.mean_radiance())));
    let (sum, n) = (weights.iter().sum::<f64>(), weights.len() as f64);
    weights.iter().map(|w| if sum > 0.0 { 0.75 * w / sum + 0.25 / n } else { 1.0 / n }).collect()
}
