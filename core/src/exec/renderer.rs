//! From a scene to its film, on one device.

use glam::DVec3;
use rayon::iter::{IndexedParallelIterator, ParallelIterator};
use rayon::slice::{ParallelSlice, ParallelSliceMut};

use super::apart::{Medium, plan_accumulate, plan_rims, plan_upsample};
use super::classify::{Fields, plan_classified};
use super::density::{plan_density, plan_scalars};
use super::error::RenderError;
use super::executor::{Executor, Hooks, Report};
use super::plan::Plan;
use super::precompute::Transfers;
use super::surfaces::{Frame, SurfaceShadowing, plan_shade, plan_shadow, plan_trace, upload_lights, upload_mesh};
use crate::Version;
use crate::blue_noise;
use crate::device::{Buf, Device, DeviceError, Field, FieldFormat, FieldSpec, fold};
use crate::estimator::{
    EmissionSource, Estimator, InScatter, LightDepth, LightShadow, Lights, MediumFields, MeshBuffers, Occupancy, Relit,
    Sources,
};
use crate::light::Environment;
use crate::media::{DensitySource, OpticsField, OpticsFields};
use crate::scene::{AllEstimate, EnvironmentEstimate, Film, Jitter, LightsEstimate, ScatteringEstimate, Scene};
use crate::stage::{
    GridParams, LightRecord, March, MarchParams, PhaseParams, Reduce, ReduceParams, Stage, shadow_kind,
};
use crate::transfer::Transfer;

/// A film and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// The picture.
    pub film: Film,
    /// Which stages ran, and how long.
    pub report: Report,
}

/// A film that stays on the device.
#[derive(Clone, Debug, PartialEq)]
pub struct OnDevice {
    /// Two vectors a pixel, as the stages [`March`] and [`Upsample`](crate::stage::Upsample) write them: premultiplied RGB and alpha; transmittance and depth.
    /// It holds until the next call of the renderer.
    pub film: Buf<[f32; 4]>,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Which stages ran.
    pub report: Report,
}

type FillSurface<'a> = Box<dyn FnOnce(&mut dyn Device, Buf<[f32; 4]>) -> Result<(), DeviceError> + 'a>;

/// What stands behind the medium where it lies on the device already, in place of [`Scene::background`].
pub struct Surface<'a> {
    content: Version,
    fill: FillSurface<'a>,
}

impl<'a> Surface<'a> {
    /// A background that `fill` writes into a buffer of a vector a pixel ([`March::surface`]). It is called when the
    /// content is another than in the picture before: `content` is its identity, a fresh one where it changed.
    pub fn new(
        content: Version,
        fill: impl FnOnce(&mut dyn Device, Buf<[f32; 4]>) -> Result<(), DeviceError> + 'a,
    ) -> Self {
        Self { content, fill: Box::new(fill) }
    }

    /// Its identity.
    pub(super) fn content(&self) -> Version {
        self.content
    }

    /// One that an earlier plan has filled.
    pub(super) fn filled(content: Version) -> Self {
        Self::new(content, |_, _| {
            Err(DeviceError::Invalid("a background that is filled once is asked for again".into()))
        })
    }
}

/// Renders scenes on one device, and keeps between pictures what does not change.
pub struct Renderer {
    pub(super) executor: Executor,
    pub(super) transfers: Transfers,
    /// Memory for the next film.
    spare: Film,
}

/// Voxels along each side of a cell of the march's occupancy.
const OCCUPANCY: u32 = 8;

/// Pixels that are read back or written at a time: 8 MiB of a film.
pub(super) const READ: u64 = 1 << 18;

/// Texels along a row, and rows of a slice, of the field that holds the environment. Every device holds fields of that
/// side, and at most a mebibyte is left empty.
const SKY_SIDE: u32 = 256;

/// 1/r² is floored at the distance of this part of [`Medium::voxel`](crate::media::Medium::voxel), where a point light
/// would shine infinitely.
const LIGHT_FLOOR: f64 = 0.01;

impl Renderer {
    /// A renderer on `device`.
    pub fn new(device: Box<dyn Device>) -> Self {
        Self { executor: Executor::new(device), transfers: Transfers::default(), spare: Film::default() }
    }

    /// The executor, for limits and for stages of one's own.
    pub fn executor(&mut self) -> &mut Executor {
        &mut self.executor
    }

    /// The device.
    pub fn device(&self) -> &dyn Device {
        self.executor.device()
    }

    /// The device, for what it offers beyond the trait (`downcast_mut`).
    pub fn device_mut(&mut self) -> &mut dyn Device {
        self.executor.device_mut()
    }

    /// Renders a scene.
    ///
    /// # Errors
    /// A scene that is out of range; too little memory; a device fault.
    pub fn render(&mut self, scene: &Scene) -> Result<Rendered, RenderError> {
        self.render_with(scene, &mut Hooks::default())
    }

    /// As [`Renderer::render`], with progress and cancellation.
    ///
    /// # Errors
    /// As [`Renderer::render`]; cancellation.
    pub fn render_with(&mut self, scene: &Scene, hooks: &mut Hooks<'_>) -> Result<Rendered, RenderError> {
        scene.validate()?;
        if let Some(AllEstimate::Path(path)) = &scene.estimate.all {
            let left = self.trace_paths(scene, path, None, hooks)?;
            return Ok(Rendered { film: self.read(&left)?, report: left.report });
        }
        let transfer = self.transfer(scene, hooks)?;
        let lit = scene.lit();
        // The plan borrows the executor for as long as the scene: both end with this call.
        let (film, report) = self.executor.run(hooks, |plan| {
            let film = plan_frame(&lit, scene.environment.as_ref(), None, transfer.as_deref(), plan)?;
            // The film as the caller gets it.
            plan.host(film.bytes());
            Ok::<_, RenderError>(film)
        })?;
        let (width, height) = (scene.camera.width, scene.camera.height);
        let left = OnDevice { film, width, height, report };
        Ok(Rendered { film: self.read(&left)?, report: left.report })
    }

    /// Renders a scene and leaves the film on the device. Nothing is read back, and once every stage has run, nothing
    /// is waited for ([`Executor::submit`]): for engines that go on with the film on the same device.
    ///
    /// # Errors
    /// As [`Renderer::render_with`]; what `surface` says; faults of work that an earlier call left on its way.
    pub fn render_on_device(
        &mut self,
        scene: &Scene,
        surface: Option<Surface<'_>>,
        hooks: &mut Hooks<'_>,
    ) -> Result<OnDevice, RenderError> {
        scene.validate()?;
        if let Some(AllEstimate::Path(path)) = &scene.estimate.all {
            return self.trace_paths(scene, path, surface, hooks);
        }
        let transfer = self.transfer(scene, hooks)?;
        let lit = scene.lit();
        let (sky, transfer) = (scene.environment.as_ref(), transfer.as_deref());
        let (film, report) = self.executor.submit(hooks, |plan| plan_frame(&lit, sky, surface, transfer, plan))?;
        Ok(OnDevice { film, width: scene.camera.width, height: scene.camera.height, report })
    }

    /// Reads a film back that [`Renderer::render_on_device`] left as the last.
    ///
    /// # Errors
    /// A device fault.
    pub fn read(&mut self, left: &OnDevice) -> Result<Film, RenderError> {
        let &OnDevice { film: from, width, height, .. } = left;
        let pixels = u64::from(width) * u64::from(height);
        let mut film = std::mem::take(&mut self.spare);
        (film.width, film.height) = (width, height);
        self.executor.fit(&mut film.beauty, pixels)?;
        self.executor.fit(&mut film.transmittance, pixels)?;
        self.executor.fit(&mut film.depth, pixels)?;
        if let Some(all) = self.executor.view(from) {
            fill(&mut film, 0, all);
            return Ok(film);
        }
        // Some rows at a time: a second copy of a large picture may be more than there is room for.
        let mut part = vec![[0.0; 4]; 2 * READ.min(pixels) as usize];
        for at in (0..pixels).step_by(READ as usize) {
            let part = &mut part[..2 * READ.min(pixels - at) as usize];
            self.executor.read_into(from, 2 * at, part)?;
            fill(&mut film, at as usize, part);
        }
        Ok(film)
    }

    /// Takes a film back that is not needed any more. The next picture is read into its memory: from frame to frame, nothing
    /// of a picture's size is allocated.
    pub fn recycle(&mut self, film: Film) {
        self.spare = film;
    }
}

/// Fills the pixels of a film from `at` on with what a device made of them, two vectors a pixel, on all cores.
fn fill(film: &mut Film, at: usize, from: &[[f32; 4]]) {
    /// Pixels that a thread takes at a time.
    const TASK: usize = 1 << 13;
    let count = from.len() / 2;
    let rows =
        film.beauty[at..][..count].par_chunks_mut(TASK).zip(film.transmittance[at..][..count].par_chunks_mut(TASK));
    let rows = rows.zip(film.depth[at..][..count].par_chunks_mut(TASK)).zip(from.par_chunks(2 * TASK));
    rows.for_each(|(((beauty, transmittance), depth), from)| {
        for (n, pixel) in from.chunks_exact(2).enumerate() {
            let [r, g, b, distance] = pixel[1];
            (beauty[n], transmittance[n], depth[n]) = (pixel[0], [r, g, b], distance);
        }
    });
}

/// Plans everything from the medium's upload to the film. `sky` is the environment as it is seen.
fn plan_frame<'a>(
    scene: &'a Scene,
    sky: Option<&'a Environment>,
    surface: Option<Surface<'a>>,
    transfer: Option<&'a Transfer>,
    plan: &mut Plan<'a>,
) -> Result<Buf<[f32; 4]>, RenderError> {
    let medium = upload_medium(scene, plan);
    let mesh = upload_mesh(scene, plan);
    let mut sources = Sources { records: upload_lights(scene, mesh.is_some(), plan), mesh, ..Sources::default() };
    if let Some(EnvironmentEstimate::Records(records)) = &scene.estimate.environment {
        records.plan(scene, &medium, plan, &mut sources)?;
    }
    match &scene.estimate.lights {
        Some(LightsEstimate::Opacity(opacity)) => opacity.plan(scene, &medium, plan, &mut sources)?,
        Some(LightsEstimate::Direct(direct)) => direct.plan(scene, &medium, plan, &mut sources)?,
        Some(LightsEstimate::Local(local)) => local.plan(scene, &medium, plan, &mut sources)?,
        None => (),
    }
    if let (Some(transfer), Some(AllEstimate::Transfer(options))) = (transfer, &scene.estimate.all) {
        let (view, prefilter) = (options.view, options.prefilter);
        Relit { scene, transfer, view, prefilter }.plan(&medium, plan, &mut sources);
    }
    let background = plan_background(scene, surface, plan);
    let shadow = mesh.as_ref().and_then(|mesh| plan_shadow(scene, mesh, &sources, plan));
    let hits = mesh.as_ref().map(|mesh| plan_trace(scene, mesh, plan));
    let occupancy = plan_occupancy(&medium, plan);
    sources.occupancy = Some(occupancy);
    if let Some(ScatteringEstimate::Sweeps(sweeps)) = &scene.estimate.scattering {
        sweeps.plan(scene, &medium, plan, &mut sources)?;
    }
    let seen = match (&mesh, hits) {
        (Some(mesh), Some(hits)) => {
            let frame = Frame { scene, medium: &medium, occupancy, lights: sources.records, floor: light_floor(scene) };
            Some(Seen { surface: plan_shade(&frame, mesh, hits, background, plan), samples: scene.camera.samples })
        }
        _ => background.map(|surface| Seen { surface, samples: 1 }),
    };
    let normals = hits.map(|hits| hits.hits);
    let behind = Behind { seen, normals, mesh: mesh.as_ref(), shadow, sky: sky.filter(|sky| sky.visible) };
    Ok(plan_march(scene, &medium, occupancy, &sources, behind, plan))
}

/// The medium's fields on the device.
pub(super) fn upload_medium<'a>(scene: &'a Scene, plan: &mut Plan<'a>) -> MediumFields {
    let medium = &scene.medium;
    let lattice = medium.lattice();
    let dims = lattice.dims().to_array();
    let (scatters, emits) = (scene.optics.albedo != glam::Vec3::ZERO, scene.optics.emits());
    let fields = if let DensitySource::Classified(classified) = medium.source() {
        plan_classified(classified, [scatters, emits], plan)
    } else {
        let density = plan_density(scene, plan);
        let OpticsFields { scattering, emission, emission_color, seen } = medium.optics_fields();
        let emission = emission.filter(|_| emits).map(|field| {
            let bricks = plan.field_kinds().bricks.then(|| field.bricks()).flatten();
            let (version, bound) = (field.version(), field.bound());
            let slice = move |k: u32, out: &mut [f32]| field.slice(k, out);
            plan_scalars("emission density", scene, version, bound, bricks, slice, plan)
        });
        let mut upload = |slot, field: Option<OpticsField<'a>>| {
            let (field, spec) = (field?, FieldSpec::dense(dims, 1, FieldFormat::Rgba));
            // What the medium needs to make a slice of it.
            plan.host(spec.slice_bytes());
            let version = field.version();
            Some(plan.upload_field(slot, spec, &version, move |k, out| field.slice(k, out)))
        };
        Fields {
            density,
            scattering: upload("scattering", scattering.filter(|_| scatters)),
            emission,
            emission_color: upload("emission color", emission_color.filter(|_| emits)),
            seen: upload("seen", seen.filter(|_| scatters)),
        }
    };
    let emission = EmissionSource::On { density: fields.emission, color: fields.emission_color };
    MediumFields {
        density: fields.density,
        scattering: fields.scattering,
        seen: fields.seen,
        emission: if emits { emission } else { EmissionSource::Off },
        grid: GridParams::new(lattice),
        step: (scene.quality.step * medium.voxel()) as f32,
    }
}

/// What ends view rays, and what shadows lights.
struct Behind<'m, 'a> {
    seen: Option<Seen>,
    /// Of the meshes, as `trace` leaves them.
    normals: Option<Buf<[f32; 4]>>,
    mesh: Option<&'m MeshBuffers>,
    shadow: Option<SurfaceShadowing>,
    /// The environment, where it is visible.
    sky: Option<&'a Environment>,
}

/// What ends view rays: so many vectors a pixel.
struct Seen {
    surface: Buf<[f32; 4]>,
    samples: u32,
}

/// Floor of r² in 1/r², m².
pub(super) fn light_floor(scene: &Scene) -> f32 {
    (LIGHT_FLOOR * scene.medium.voxel()).powi(2) as f32
}

/// Occupancy cells along x, y, z; voxels of a cell's side.
fn occupancy_cells(medium: &MediumFields) -> [u32; 4] {
    [0, 1, 2, 3].map(|a| if a < 3 { medium.grid.dims[a].div_ceil(OCCUPANCY) } else { OCCUPANCY })
}

/// Space without density or emission is stepped over.
pub(super) fn plan_occupancy(medium: &MediumFields, plan: &mut Plan<'_>) -> Occupancy {
    let cells = occupancy_cells(medium);
    let side = OCCUPANCY as f32;
    let count = cells[..3].iter().fold(1, |n: u64, &c| n.saturating_mul(c.into()));
    let out = plan.work("occupancy", count);
    plan.stage(Stage::Reduce(Reduce {
        params: ReduceParams::new(medium.grid.dims, [cells[0], cells[1], cells[2], 0], [side, side, side, 0.0]),
        density: medium.density,
        other: medium.emission.reach(),
        out,
    }));
    Occupancy { cells, buffer: out }
}

/// What stands behind the medium and its surfaces.
pub(super) fn plan_background<'a>(
    scene: &'a Scene,
    surface: Option<Surface<'a>>,
    plan: &mut Plan<'a>,
) -> Option<Buf<[f32; 4]>> {
    let pixels = u64::from(scene.camera.width) * u64::from(scene.camera.height);
    if let Some(Surface { content, fill }) = surface {
        return Some(plan.external("background", pixels, &content, fill));
    }
    let background = scene.background.as_ref()?;
    let fill = move |device: &mut dyn Device, buf: Buf<[f32; 4]>| {
        let mut surfaces = background.surfaces();
        let mut at = 0;
        while at < pixels {
            let part: Vec<_> = surfaces.by_ref().take(READ as usize).collect();
            device.write(buf.id, at * size_of::<[f32; 4]>() as u64, bytemuck::cast_slice(&part))?;
            at += part.len() as u64;
        }
        Ok(())
    };
    Some(plan.external("background", pixels, &background.version(), fill))
}

fn plan_march<'a>(
    scene: &'a Scene,
    medium: &MediumFields,
    occupancy: Occupancy,
    sources: &Sources,
    behind: Behind<'_, 'a>,
    plan: &mut Plan<'a>,
) -> Buf<[f32; 4]> {
    let (camera, optics, grid) = (&scene.camera, &scene.optics, &medium.grid);
    let rgb0 = |v: glam::Vec3| v.extend(0.0).to_array();
    let mut params: MarchParams = bytemuck::Zeroable::zeroed();
    params.dims = grid.dims;
    [params.index_x, params.index_y, params.index_z] = grid.index;
    let eye = scene.medium.lattice().world_to_index().transform_point3(camera.origin);
    params.eye = eye.as_vec3().extend(0.0).to_array();
    [params.forward, params.right, params.up] = camera.axes().map(|a: DVec3| rgb0(a.as_vec3()));
    let (quality, apart) = (&scene.quality, scene.quality.marches_apart());
    (params.full_width, params.full_height, params.samples) = (camera.width, camera.height, camera.samples);
    (params.scale, params.alone, params.steps) = (quality.scale, apart.into(), quality.steps.unwrap_or(0));
    (params.width, params.height) = (camera.width.div_ceil(params.scale), camera.height.div_ceil(params.scale));
    (params.extinction, params.albedo) = (rgb0(optics.extinction), rgb0(optics.albedo));
    params.light_extinction = rgb0(sources.light_extinction.unwrap_or(optics.extinction));
    params.emission = rgb0(optics.emission);
    (params.step, params.cut) = (medium.step, March::CUT);
    params.light_floor = light_floor(scene);
    params.occupancy_cells = occupancy.cells;
    let per_voxel =
        |cells: [u32; 3]| [0, 1, 2, 3].map(|a| if a < 3 { cells[a] as f32 / grid.dims[a] as f32 } else { 0.0 });
    let mut tables: Vec<f32> = camera.subpixels().iter().flat_map(|p| p.as_vec2().to_array()).collect();
    if let Some(InScatter { field, cells, bands, trilinear }) = sources.field {
        params.cells = [cells[0], cells[1], cells[2], field.spec.layers];
        params.cells_per_voxel = per_voxel(cells);
        (params.bands, params.trilinear) = (bands, trilinear.into());
    }
    if let Some(InScatter { field, cells, bands, .. }) = sources.scattered {
        params.scattered_cells = [cells[0], cells[1], cells[2], field.spec.layers];
        params.scattered_cells_per_voxel = per_voxel(cells);
        // The constants of some bands begin with those of fewer.
        params.bands = params.bands.max(bands);
    }
    if params.cells[3].max(params.scattered_cells[3]) > 1 {
        params.harmonics_at = tables.len() as u32;
        tables.extend(crate::basis::recurrence_table(params.bands));
    }
    let (mut lights, mut light_depth) = (None, None);
    if let Some(Lights { records, shadow }) = sources.lights {
        (params.lights, params.spots) = (records.len as u32, LightRecord::spots(&scene.lights));
        lights = Some(records);
        params.shadow = match shadow {
            LightShadow::Off => shadow_kind::NONE,
            LightShadow::March => shadow_kind::MARCH,
            LightShadow::Field(LightDepth { field, mean }) => {
                let FieldSpec { dims, layers, .. } = field.spec;
                params.light_cells = [dims[0], dims[1], dims[2], layers];
                params.light_cells_per_voxel = per_voxel(dims);
                light_depth = Some(field);
                if mean { shadow_kind::MEAN } else { shadow_kind::COLUMN }
            }
        };
    }
    params.phong = sources.phong.map_or([0.0; 4], |l| [l.ambient, l.diffuse, l.specular, l.shininess]);
    let phase = PhaseParams::new(&optics.phase);
    (params.phase_kind, params.phase) = (phase.kind, phase.lobes);
    (params.phase_at, params.phase_size) = (tables.len() as u32, phase.table.len() as u32);
    tables.extend(phase.table);
    if quality.jitter == Jitter::BlueNoise {
        (params.jittered, params.jitter_at) = (1, tables.len() as u32);
        params.jitter_offset = blue_noise::offset(u64::from(scene.frame) * u64::from(camera.samples));
        tables.extend((0..camera.samples).map(|s| blue_noise::offset(s.into())));
        tables.extend(blue_noise::tile());
    }
    let environment = behind.sky.map(|sky| {
        let sky = upload_sky(sky, plan);
        [params.environment_width, params.environment_height] = sky.size;
        (params.environment, params.environment_dims) = (sky.tint, sky.dims);
        sky.field
    });
    let pixels = u64::from(params.width) * u64::from(params.height);
    (params.sample_end, params.step_end) = (params.samples, March::ALL_STEPS);
    params.surface_samples = behind.seen.as_ref().map_or(1, |seen| seen.samples);
    let shadowing = behind.shadow;
    if let (Some(mesh), Some(shadow)) = (behind.mesh, shadowing) {
        (params.mesh_eye, params.nodes) = (mesh.from_origin(camera.origin), mesh.nodes);
        (params.surface_shadow, params.map_side) = (shadow.kind, shadow.side);
    }
    let mut march = March {
        params,
        density: medium.density,
        scattering: medium.seen.or(medium.scattering),
        emission: medium.emission.density(),
        emission_color: medium.emission.color(),
        in_scatter: sources.field.map(|source| source.field),
        scattered: sources.scattered.map(|source| source.field),
        light_depth,
        occupancy: Some(occupancy.buffer),
        lights,
        tables: plan.table("march tables", tables),
        environment,
        surface: behind.seen.as_ref().map(|seen| seen.surface),
        mesh: shadowing.and_then(|shadow| shadow.rays),
        shadow_map: shadowing.and_then(|shadow| shadow.map),
        paths: None,
        film: if apart { plan.work("medium", 2 * pixels) } else { plan.output("film", 2 * pixels) },
    };
    if plan.loop_turns().is_some_and(|turns| march.keeps_paths(turns.into())) {
        march.paths = Some(plan.work("paths", 2 * pixels));
    }
    plan.stage(Stage::March(march.clone()));
    if !apart {
        return march.film;
    }
    let rims = plan_rims(&march, plan);
    let mut medium = Medium { whole: march.film, rims: rims.as_ref().map(|rims| rims.film) };
    if quality.temporal {
        medium = plan_accumulate(scene, &march, rims.as_ref(), plan);
    }
    plan_upsample(scene, &march, medium, behind.normals, plan)
}

/// An environment on the device, and what kernels are told of it.
pub(super) struct SkyField {
    pub(super) field: Field,
    /// Texels of the field along x, y, z; unused.
    pub(super) dims: [u32; 4],
    /// Columns and rows.
    pub(super) size: [u32; 2],
    /// Multiplies the radiance, RGB; rotation in turns.
    pub(super) tint: [f32; 4],
}

/// The environment as it is seen.
pub(super) fn upload_sky<'a>(environment: &'a Environment, plan: &mut Plan<'a>) -> SkyField {
    let image = environment.image();
    let turns = (environment.rotation / 360.0).rem_euclid(1.0) as f32;
    let tint = environment.scale.extend(turns).to_array();
    let texels = &image.texels;
    let dims = fold(texels.len() as u64, SKY_SIDE.min(plan.field_side()));
    let spec = FieldSpec::dense(dims, 1, FieldFormat::Rgba);
    let field = plan.upload_field("environment", spec, &environment.version(), |k, out| {
        let first = k as usize * (out.len() / 4);
        for (place, to) in out.chunks_exact_mut(4).enumerate() {
            // Past the last texel lies what is never looked up.
            let [r, g, b] = texels.get(first + place).copied().unwrap_or_default();
            to.copy_from_slice(&[r, g, b, 0.0]);
        }
    });
    SkyField { field, dims: [dims[0], dims[1], dims[2], 0], size: [image.width, image.height], tint }
}
