//! The estimator `path`: tables of what a path chooses from, the stage, and the loop that goes on until there are enough
//! samples.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use super::error::RenderError;
use super::executor::{Hooks, Progress, Report};
use super::plan::Plan;
use super::renderer::{
    OnDevice, READ, Renderer, Surface, light_floor, plan_background, plan_occupancy, upload_medium, upload_sky,
};
use super::surfaces::{upload_lights, upload_mesh};
use crate::device::{Buf, ResourceId};
use crate::light::{Environment, Light};
use crate::media::Phase;
use crate::scene::{Path as Options, Scene};
use crate::stage::{MaterialRecord, Path, PathParams, PhaseParams, Stage};

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
        let (mut done, mut target) = (0, 1);
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
            let paths = self.survey(sums)?;
            report.paths = Some(paths);
            if paths.samples < target {
                continue;
            }
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
            target = done.saturating_add((room as u32).clamp(1, MOST.min(done.max(1)))).min(options.samples);
        }
    }

    /// How many samples each pixel has, and how noisy they are.
    fn survey(&mut self, sums: Buf<[f32; 4]>) -> Result<PathsRun, RenderError> {
        let pixels = sums.len / 3;
        let (mut least, mut errors, mut squares) = (u32::MAX, 0.0, 0.0);
        let mut part = vec![[0.0; 4]; 3 * READ.min(pixels) as usize];
        let mut at = 0;
        while at < pixels {
            let count = READ.min(pixels - at);
            let part = &mut part[..3 * count as usize];
            self.executor.read_into(sums, 3 * at, part)?;
            for pixel in part.chunks_exact(3) {
                let [r, g, b, n] = pixel[0].map(f64::from);
                least = least.min(n as u32);
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
        Ok(PathsRun { samples: least, noise })
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
        (params.mesh_eye, params.nodes) = (mesh.eye(camera), mesh.nodes);
    }
    let environment = scene.environment.as_ref().map(|environment| {
        let sky = upload_sky(environment, plan);
        [params.environment_width, params.environment_height] = sky.size;
        (params.environment, params.environment_dims) = (sky.tint, sky.dims);
        params.visible = environment.visible.into();
        sky.field
    });
    params.lights = lights.map_or(0, |lights| lights.len as u32);
    let tables = plan_tables(scene, &mut params, plan);
    let pixels = u64::from(camera.width) * u64::from(camera.height);
    let mut path = Path {
        params,
        density: medium.density,
        scattering: medium.scattering,
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
    let phase = PhaseParams::new(&scene.optics.phase);
    (params.phase_kind, params.phase, params.phase_size) = (phase.kind, phase.lobes, phase.table.len() as u32);
    let environment = scene.environment.as_ref();
    let weights = chances(scene, params.lights as usize);
    params.choices = weights.len() as u32;
    let materials: Vec<MaterialRecord> =
        scene.surfaces.iter().flat_map(|mesh| mesh.materials().iter().map(MaterialRecord::new)).collect();
    let cells = environment.map_or([0, 0], |e| [e.image().width, e.image().height].map(sky_side));
    [params.sky_columns, params.sky_rows] = cells;
    let choice = |items: usize| Path::CHOICE * items as u32;
    let pieces = phase.table.len().saturating_sub(1);
    params.bends_at = params.phase_size;
    params.choices_at = params.bends_at + choice(pieces);
    params.materials_at = params.choices_at + choice(weights.len());
    params.edges_at = params.materials_at + 8 * materials.len() as u32;
    params.sky_at = params.edges_at + cells[1] + 1;
    let length = params.sky_at + choice((cells[0] * cells[1]) as usize);
    let mut key: Vec<u8> = bytemuck::cast_slice(&weights).to_vec();
    key.extend(bytemuck::cast_slice::<_, u8>(&materials));
    key.extend(bytemuck::cast_slice::<_, u8>(&phase.table));
    let tint = environment.map(|e| (e.version(), e.scale.to_array().map(f32::to_bits)));
    // A buffer holds at least one element.
    plan.upload("path tables", length.max(1).into(), &(key, tint), move || {
        let mut tables = phase.table.clone();
        if let Phase::Table(table) = &scene.optics.phase {
            tables.extend(bends(table.values()));
        }
        tables.extend(choose(&weights, |_, chance| chance));
        tables.extend(bytemuck::cast_slice::<_, f32>(&materials));
        let rows = cells[1];
        tables.extend((0..=rows).map(|row| (PI * f64::from(row) / f64::from(rows.max(1))).cos() as f32));
        if let Some(environment) = environment {
            tables.extend(sky_choice(environment, cells));
        }
        tables
    })
}

/// Items to be chosen with these weights, and for each what its choice goes by, from its number and probability: the alias
/// method, as [`Path::tables`] says it.
fn choose(weights: &[f64], by: impl Fn(usize, f64) -> f64) -> Vec<f32> {
    let sum: f64 = weights.iter().sum();
    let n = weights.len();
    let mut items: Vec<[f64; 3]> = (0..n).map(|i| [1.0, i as f64, by(i, weights[i] / sum)]).collect();
    // What each place holds of its own item, in parts of a place; those above one give to those below.
    let mut parts: Vec<f64> = weights.iter().map(|w| w / sum * n as f64).collect();
    let (mut small, mut large): (Vec<_>, Vec<_>) = (0..n).partition(|&i| parts[i] < 1.0);
    while let (Some(&giver), Some(taker)) = (large.last(), small.pop()) {
        (items[taker][0], items[taker][1]) = (parts[taker], giver as f64);
        parts[giver] -= 1.0 - parts[taker];
        if parts[giver] < 1.0 {
            large.pop();
            small.push(giver);
        }
    }
    items.into_iter().flatten().map(|v| v as f32).collect()
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

/// The choice among the pieces of a phase function's table, by 1/sr: each piece is drawn evenly in solid angle.
fn bends(values: &[f64]) -> Vec<f32> {
    let last = (values.len() - 1) as f64;
    let angle = |i: f64| PI * i / last;
    let band = |i: usize| 2.0 * PI * (angle(i as f64).cos() - angle(i as f64 + 1.0).cos());
    // Simpson's rule over the piece, whose value is linear in the angle.
    let piece = |i: usize| {
        let at = |t: f64| (values[i] + t * (values[i + 1] - values[i])) * angle(i as f64 + t).sin();
        2.0 * PI * angle(1.0) * (at(0.0) + 4.0 * at(0.5) + at(1.0)) / 6.0
    };
    let weights: Vec<f64> = (0..values.len() - 1).map(piece).collect();
    choose(&weights, |i, chance| chance / band(i))
}

/// Cells along a side of an environment of so many texels: a power of two, so that every cell is drawn by as many numbers.
fn sky_side(texels: u32) -> u32 {
    /// Cells along the longer side at the most.
    const MOST: u32 = 1024;
    1 << texels.clamp(1, MOST).ilog2()
}

/// The choice among the cells of an environment, by 1/sr, in proportion to their light (mean of the channels).
fn sky_choice(environment: &Environment, [columns, rows]: [u32; 2]) -> Vec<f32> {
    let image = environment.image();
    let (width, height) = (i64::from(image.width), i64::from(image.height));
    let scale = environment.scale.as_dvec3();
    let grey = |i: i64, j: i64| {
        let [r, g, b] = image.texels[(j.clamp(0, height - 1) * width + i.rem_euclid(width)) as usize];
        (DVec3::new(r.into(), g.into(), b.into()) * scale).element_sum() / 3.0
    };
    let count = (columns * rows) as usize;
    let (mut sums, mut points) = (vec![0.0; count], vec![0u32; count]);
    // The bilinear function at four points of each texel: whatever shines in a cell, some of them see.
    for (y, x) in (0..2 * height).flat_map(|y| (0..2 * width).map(move |x| (y, x))) {
        let (i, j) = (x / 2, y / 2);
        let (across, down) = (i + 2 * (x % 2) - 1, j + 2 * (y % 2) - 1);
        let value = (9.0 * grey(i, j) + 3.0 * (grey(across, j) + grey(i, down)) + grey(across, down)) / 16.0;
        let cell = |at: i64, of: i64, cells: u32| (2 * at + 1) * i64::from(cells) / (4 * of);
        let place = (cell(y, height, rows) * i64::from(columns) + cell(x, width, columns)) as usize;
        sums[place] += value;
        points[place] += 1;
    }
    let edge = |row: u32| (PI * f64::from(row) / f64::from(rows)).cos();
    let angle = |cell: usize| {
        let row = cell as u32 / columns;
        2.0 * PI / f64::from(columns) * (edge(row) - edge(row + 1))
    };
    let mut weights: Vec<f64> =
        (0..count).map(|cell| sums[cell] / f64::from(points[cell].max(1)) * angle(cell)).collect();
    if weights.iter().sum::<f64>() == 0.0 {
        weights = (0..count).map(angle).collect();
    }
    choose(&weights, |cell, chance| chance / angle(cell))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Image;
    use crate::media::PhaseTable;

    /// How often each item is chosen, over all places and the whole of the second number.
    fn frequencies(choice: &[f32]) -> Vec<f64> {
        let n = choice.len() / 3;
        let mut found = vec![0.0; n];
        for (place, item) in choice.chunks_exact(3).enumerate() {
            found[place] += f64::from(item[0]) / n as f64;
            found[item[1] as usize] += (1.0 - f64::from(item[0])) / n as f64;
        }
        found
    }

    #[test]
    fn items_are_chosen_by_their_weights() {
        for weights in [vec![1.0], vec![3.0, 0.0, 1.0, 0.5, 7.0], vec![1.0; 6], vec![1e-9, 1.0, 1e-3]] {
            let sum: f64 = weights.iter().sum();
            let choice = choose(&weights, |_, chance| chance);
            for (i, frequency) in frequencies(&choice).into_iter().enumerate() {
                // Parts of places are rounded to f32.
                assert!((frequency - weights[i] / sum).abs() < 1e-7, "{weights:?} {i}: {frequency}");
                assert!((f64::from(choice[3 * i + 2]) - weights[i] / sum).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn densities_of_cells_and_pieces_are_those_of_the_choice() {
        let texels =
            (0..40u8).map(|i| [f32::from(i % 7), f32::from(i % 3), if i == 29 { 90.0 } else { 0.0 }]).collect();
        let sky = Environment::new(Image { width: 8, height: 5, texels }).unwrap();
        let cells = [sky_side(8), sky_side(5)];
        assert_eq!(cells, [8, 4]);
        let choice = sky_choice(&sky, cells);
        let band = |row: u32| (PI * f64::from(row) / 4.0).cos() - (PI * f64::from(row + 1) / 4.0).cos();
        for (cell, chance) in frequencies(&choice).into_iter().enumerate() {
            let angle = 2.0 * PI / 8.0 * band(cell as u32 / 8);
            assert!((f64::from(choice[3 * cell + 2]) * angle - chance).abs() < 1e-6, "{cell}");
        }
        let degrees: Vec<f64> = (0..=180).map(f64::from).collect();
        let values: Vec<f64> = degrees.iter().map(|d| 1.0 + (d / 20.0).cos()).collect();
        let table = PhaseTable::new(&degrees, &values).unwrap();
        let found = bends(table.values());
        let last = table.values().len() - 1;
        for (i, chance) in frequencies(&found).into_iter().enumerate() {
            let at = |i: usize| PI * i as f64 / last as f64;
            let band = 2.0 * PI * (at(i).cos() - at(i + 1).cos());
            let (stated, mean) = (f64::from(found[3 * i + 2]), 0.5 * (table.values()[i] + table.values()[i + 1]));
            assert!((stated * band - chance).abs() < 1e-7, "{i}");
            // Within a piece the function is nearly even.
            assert!((stated / mean.max(1e-3) - 1.0).abs() < 0.1 || mean < 1e-3, "{i}: {stated} {mean}");
        }
    }
}
