//! One set of parameters of `march`, on a device and by its twin.

use airlight::basis::recurrence_table;
use airlight::blue_noise;
use airlight::device::{Buf, Usage};
use airlight::glam::{UVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Optics, Phase};
use airlight::reference::{self, MarchInputs};
use airlight::scene::Camera;
use airlight::stage::{
    GridParams, LightRecord, March, MarchParams, MeshRecord, PhaseParams, Reduce, ReduceParams, Stage, alone,
    shadow_kind, surface_shadow,
};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::upsample::distance;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, camera, density, grey, noise, room, sky};
use crate::{Axis, Record, Subject, check};

/// One set of parameters.
#[derive(Clone)]
pub(super) struct Set {
    pub(super) name: String,
    pub(super) dims: UVec3,
    pub(super) map: Map,
    pub(super) camera: Camera,
    pub(super) optics: Optics,
    /// What scatters follows a field of its own.
    pub(super) own_scattering: bool,
    /// Emission by a field of its own.
    pub(super) own_emission: bool,
    /// The same with colours.
    pub(super) colored_emission: bool,
    pub(super) in_scatter: Option<InScatter>,
    /// Bands of light that was scattered before.
    pub(super) scattered: Option<u32>,
    pub(super) lights: Vec<Light>,
    pub(super) shadow: u32,
    /// Ambient, diffuse and specular reflectance, and shininess; of none where that is zero.
    pub(super) phong: [f32; 4],
    /// Rotation of a visible environment, degrees.
    pub(super) environment: Option<f32>,
    pub(super) surface: bool,
    /// Surfaces of a vector a sub-pixel position, not a pixel.
    pub(super) fine: bool,
    /// How surfaces shadow lights.
    pub(super) surface_shadow: u32,
    /// Longest step, metres.
    pub(super) step: f32,
    /// Voxels of an occupancy cell's side.
    pub(super) block: u32,
    /// Steps of every ray; 0 for as many as `step` asks for.
    pub(super) steps: u32,
    /// Number of the picture, where samples are jittered.
    pub(super) jitter: Option<u32>,
    /// Pixels of the picture along each side of one of the film.
    pub(super) scale: u32,
    /// Whether the film is of the medium alone: a constant of [`alone`].
    pub(super) alone: u32,
}

#[derive(Clone, Copy)]
pub(super) struct InScatter {
    /// More than one makes bands² layers.
    pub(super) bands: u32,
    pub(super) trilinear: bool,
}

pub(super) const CELLS: [u32; 3] = [4, 3, 6];

/// Cells of light that was scattered before.
const SCATTERED_CELLS: [u32; 3] = [3, 5, 2];

/// Cells of the lights' field.
const LIGHT_CELLS: [u32; 3] = [5, 7, 4];

/// A picture of 21 × 13 pixels, so that blocks are cut at both edges.
pub(super) fn plain(name: &str) -> Set {
    Set {
        name: name.to_owned(),
        dims: DIMS,
        map: Map::Plain,
        camera: camera(21, 13, 1),
        optics: Optics { albedo: Vec3::ZERO, ..grey(Phase::Isotropic) },
        own_scattering: false,
        own_emission: false,
        colored_emission: false,
        in_scatter: None,
        scattered: None,
        lights: Vec::new(),
        shadow: shadow_kind::NONE,
        phong: [0.0; 4],
        environment: None,
        surface: false,
        fine: false,
        surface_shadow: surface_shadow::NONE,
        step: 0.05,
        block: 2,
        steps: 0,
        jitter: None,
        scale: 1,
        alone: alone::NO,
    }
}

/// Everything that the stage reads, on the host.
struct Host {
    params: MarchParams,
    density: Vec<f32>,
    scattering: Vec<[f32; 4]>,
    emission: Vec<f32>,
    emission_color: Vec<[f32; 4]>,
    in_scatter: Vec<[f32; 4]>,
    scattered: Vec<[f32; 4]>,
    light_depth: Vec<[f32; 4]>,
    lights: Vec<LightRecord>,
    tables: Vec<f32>,
    environment: Vec<[f32; 4]>,
    surface: Vec<[f32; 4]>,
    mesh: Vec<MeshRecord>,
    shadow_map: Vec<f32>,
}

fn rgb(v: Vec3) -> [f32; 4] {
    v.extend(0.0).to_array()
}

fn host(set: &Set) -> Host {
    let lattice = set.map.lattice(set.dims);
    let grid = GridParams::new(&lattice);
    let (camera, optics) = (&set.camera, &set.optics);
    let mut p = MarchParams::zeroed();
    p.dims = grid.dims;
    [p.index_x, p.index_y, p.index_z] = grid.index;
    p.eye = rgb(lattice.world_to_index().transform_point3(camera.origin).as_vec3());
    [p.forward, p.right, p.up] = camera.axes().map(|a| rgb(a.as_vec3()));
    // Of a similar medium.
    p.light_extinction = rgb(optics.extinction * Vec3::new(0.7, 0.8, 0.9));
    (p.extinction, p.albedo, p.emission) = (rgb(optics.extinction), rgb(optics.albedo), rgb(optics.emission));
    (p.full_width, p.full_height, p.samples) = (camera.width, camera.height, camera.samples);
    (p.width, p.height) = (camera.width.div_ceil(set.scale), camera.height.div_ceil(set.scale));
    (p.scale, p.alone, p.steps) = (set.scale, set.alone, set.steps);
    (p.sample_end, p.step_end) = (p.samples, March::ALL_STEPS);
    (p.step, p.cut, p.light_floor) = (set.step, March::CUT, 1e-4);
    p.occupancy_cells = [0, 1, 2, 3].map(|a| if a < 3 { set.dims[a].div_ceil(set.block) } else { set.block });
    (p.lights, p.spots) = (set.lights.len() as u32, LightRecord::spots(&set.lights));
    (p.shadow, p.phong) = (set.shadow, set.phong);
    let mut tables: Vec<f32> = camera.subpixels().iter().flat_map(|p| p.as_vec2().to_array()).collect();
    let mut in_scatter = Vec::new();
    if let Some(InScatter { bands, trilinear }) = set.in_scatter {
        let layers = bands * bands;
        p.cells = [CELLS[0], CELLS[1], CELLS[2], layers];
        p.cells_per_voxel = [0, 1, 2, 3].map(|a| if a < 3 { CELLS[a] as f32 / set.dims[a] as f32 } else { 0.0 });
        (p.bands, p.trilinear) = (bands, trilinear.into());
        let values = noise(41, (CELLS.iter().product::<u32>() * layers * 3) as usize);
        in_scatter = values.chunks_exact(3).map(|v| [v[0] - 0.3, v[1] - 0.2, v[2], 0.0]).collect();
    }
    let mut scattered = Vec::new();
    if let Some(bands) = set.scattered {
        let (layers, [x, y, z]) = (bands * bands, SCATTERED_CELLS);
        p.scattered_cells = [x, y, z, layers];
        p.scattered_cells_per_voxel =
            [0, 1, 2, 3].map(|a| if a < 3 { SCATTERED_CELLS[a] as f32 / set.dims[a] as f32 } else { 0.0 });
        p.bands = p.bands.max(bands);
        let values = noise(49, (x * y * z * layers * 3) as usize);
        scattered = values.chunks_exact(3).map(|v| [v[0] - 0.2, v[1], v[2] - 0.3, 0.0]).collect();
    }
    if p.cells[3].max(p.scattered_cells[3]) > 1 {
        p.harmonics_at = tables.len() as u32;
        tables.extend(recurrence_table(p.bands));
    }
    let mut light_depth = Vec::new();
    if set.shadow >= shadow_kind::COLUMN {
        let layers = p.lights.div_ceil(4);
        p.light_cells = [LIGHT_CELLS[0], LIGHT_CELLS[1], LIGHT_CELLS[2], layers];
        p.light_cells_per_voxel =
            [0, 1, 2, 3].map(|a| if a < 3 { LIGHT_CELLS[a] as f32 / set.dims[a] as f32 } else { 0.0 });
        let values = noise(45, (LIGHT_CELLS.iter().product::<u32>() * layers * 4) as usize);
        light_depth = values.chunks_exact(4).map(|v| [v[0], v[1], v[2], v[3]]).collect();
    }
    let phase = PhaseParams::new(&optics.phase);
    (p.phase_kind, p.phase) = (phase.kind, phase.lobes);
    (p.phase_at, p.phase_size) = (tables.len() as u32, phase.table.len() as u32);
    tables.extend(phase.table);
    if let Some(frame) = set.jitter {
        (p.jittered, p.jitter_at) = (1, tables.len() as u32);
        p.jitter_offset = blue_noise::offset(u64::from(frame) * u64::from(p.samples));
        tables.extend((0..p.samples).map(|s| blue_noise::offset(s.into())));
        tables.extend(blue_noise::tile());
    }
    let mut environment = Vec::new();
    if let Some(rotation) = set.environment {
        let sky = sky();
        (p.environment_width, p.environment_height) = (sky.image().width, sky.image().height);
        p.environment = [1.5, 1.0, 0.5, (rotation / 360.0).rem_euclid(1.0)];
        environment = sky.image().texels.iter().map(|t| [t[0], t[1], t[2], 0.0]).collect();
        // Sides that the picture's have nothing in common with.
        p.environment_dims = [5, 7, 4, 0];
    }
    let pixels = (camera.width * camera.height) as usize;
    // Before, within and behind the medium, and nowhere.
    let far = |i: usize| match (set.alone, i as u32 % camera.width, i as u32 / camera.width) {
        // Wide stripes, so that rims are between some pixels and others are far from any.
        (alone::RIMS, x, y) => distance(x / 3, y / 3),
        _ => [0.4, 2.1, 2.4, 2.7, 9.0, f32::INFINITY][i % 6],
    };
    p.surface_samples = if set.fine { p.samples } else { 1 };
    let count = pixels * p.surface_samples as usize;
    let surface = noise(42, 3 * count).chunks_exact(3).enumerate().map(|(i, c)| [c[0], c[1], c[2], far(i)]).collect();
    let density = density(set.dims, 43);
    let emission: Vec<f32> = noise(44, density.len()).iter().map(|v| (v - 0.5).max(0.0)).collect();
    // A share of the density in each channel, and what must not be read.
    let colors = |seed: u64, of: &[f32]| -> Vec<[f32; 4]> {
        let shares = noise(seed, 3 * of.len());
        of.iter().zip(shares.chunks_exact(3)).map(|(v, s)| [v * s[0], v * s[1], v * s[2], 7.0]).collect()
    };
    let (scattering, emission_color) = (colors(48, &density), colors(47, &emission));
    let lights = LightRecord::of(&set.lights, camera.origin);
    let (mut mesh, mut shadow_map) = (Vec::new(), Vec::new());
    p.surface_shadow = set.surface_shadow;
    if set.surface_shadow != surface_shadow::NONE {
        let room = room();
        let hierarchy = room.hierarchy().expect("the room has triangles");
        p.mesh_eye = (camera.origin - hierarchy.origin()).as_vec3().extend(hierarchy.extent()).to_array();
        (p.nodes, p.map_side) = (hierarchy.nodes(), 6);
        mesh = hierarchy.records().to_vec();
        let faces: u32 = set.lights.iter().map(airlight::stage::Shadow::faces).sum();
        // Nearer and farther than what looks it up.
        shadow_map = noise(46, (36 * faces) as usize).iter().map(|v| 0.3 + 3.0 * v).collect();
    }
    Host {
        params: p,
        density,
        scattering: if set.own_scattering { scattering } else { Vec::new() },
        emission: if set.own_emission || set.colored_emission { emission } else { Vec::new() },
        emission_color: if set.colored_emission { emission_color } else { Vec::new() },
        in_scatter,
        scattered,
        light_depth,
        lights,
        tables,
        environment,
        surface: if set.surface { surface } else { Vec::new() },
        mesh: if set.surface_shadow == surface_shadow::RAY { mesh } else { Vec::new() },
        shadow_map: if set.surface_shadow == surface_shadow::MAP { shadow_map } else { Vec::new() },
    }
}

/// Something of a slice, or none where it is empty.
fn some<T, R>(data: &[T], make: impl FnOnce(&[T]) -> Result<R, Failed>) -> Result<Option<R>, Failed> {
    if data.is_empty() { Ok(None) } else { make(data).map(Some) }
}

/// Whether rays may pass over empty blocks, which must change nothing.
pub(super) fn occupancies() -> Axis<bool> {
    Axis::new("occupancy", [("without", false), ("with", true)])
}

/// Runs the set and holds the film to the twin's.
pub(super) fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let host = host(set);
    let mut bench = Bench::new(subject)?;
    let dims = set.dims.to_array();
    let film: Buf<[f32; 4]> = bench.room(2 * (host.params.width * host.params.height) as usize, Usage::Output)?;
    let march = March {
        params: host.params,
        density: bench.scalars(dims, &host.density)?,
        scattering: some(&host.scattering, |v| bench.colors(dims, 1, v))?,
        emission: some(&host.emission, |v| bench.scalars(dims, v))?,
        emission_color: some(&host.emission_color, |v| bench.colors(dims, 1, v))?,
        in_scatter: some(&host.in_scatter, |v| bench.colors(CELLS, host.params.cells[3], v))?,
        scattered: some(&host.scattered, |v| bench.colors(SCATTERED_CELLS, host.params.scattered_cells[3], v))?,
        light_depth: some(&host.light_depth, |v| bench.colors(LIGHT_CELLS, host.params.light_cells[3], v))?,
        occupancy: None,
        lights: some(&host.lights, |v| bench.buf(v))?,
        tables: bench.buf(&host.tables)?,
        environment: some(&host.environment, |v| {
            let [x, y, z, _] = host.params.environment_dims;
            let mut texels = v.to_vec();
            // What is past the end must not be seen.
            texels.resize((x * y * z) as usize, [1e9; 4]);
            bench.colors([x, y, z], 1, &texels)
        })?,
        surface: some(&host.surface, |v| bench.buf(v))?,
        mesh: some(&host.mesh, |v| bench.buf(v))?,
        shadow_map: some(&host.shadow_map, |v| bench.buf(v))?,
        paths: Some(bench.room(2 * (host.params.width * host.params.height) as usize, Usage::Work)?),
        film,
    };
    let [x, y, z, side] = host.params.occupancy_cells;
    let side = side as f32;
    let occupancy = bench.room::<[f32; 2]>((x * y * z) as usize, Usage::Work)?;
    let reduce = Stage::Reduce(Reduce {
        params: ReduceParams::new(host.params.dims, [x, y, z, 0], [side, side, side, 0.0]),
        density: march.density,
        other: march.emission,
        out: occupancy,
    });
    let skipping = March { occupancy: Some(occupancy), ..march.clone() };

    let inputs = MarchInputs {
        density: &host.density,
        scattering: (!host.scattering.is_empty()).then_some(&host.scattering[..]),
        emission: (!host.emission.is_empty()).then_some(&host.emission[..]),
        emission_color: (!host.emission_color.is_empty()).then_some(&host.emission_color[..]),
        in_scatter: (!host.in_scatter.is_empty()).then_some(&host.in_scatter[..]),
        scattered: (!host.scattered.is_empty()).then_some(&host.scattered[..]),
        light_depth: (!host.light_depth.is_empty()).then_some(&host.light_depth[..]),
        lights: &host.lights,
        tables: &host.tables,
        environment: (!host.environment.is_empty()).then_some(&host.environment[..]),
        surface: (!host.surface.is_empty()).then_some(&host.surface[..]),
        mesh: &host.mesh,
        shadow_map: &host.shadow_map,
    };
    let expected = reference::march(&host.params, &inputs);
    let seen = expected.chunks_exact(8).filter(|p| p[4] < 0.999 || p[0] > 1e-3).count();
    let passed = expected.chunks_exact(8).filter(|p| p[3] == f64::from(March::UNMARCHED)).count();
    check!(set.alone != alone::RIMS || passed > 20, "only {passed} pixels are passed over: the case tries nothing");
    check!(seen > 20, "only {seen} pixels show the medium: the case tries nothing");

    record.each(&occupancies(), |record, &skips| {
        record.each(&cuts(), |record, &cut| {
            let stage = if skips {
                bench.run(record, &reduce, cut)?;
                if set.block < 8 && set.dims.max_element() > 16 {
                    let empty = bench.read(occupancy)?.iter().filter(|c| c[1] == 0.0).count();
                    check!(empty > 20, "only {empty} empty blocks: the case tries nothing");
                }
                skipping.clone()
            } else {
                march.clone()
            };
            bench.run(record, &Stage::March(stage), cut)?;
            let found: Vec<[f32; 4]> = bench.read(film)?;
            hold(record, set, &host.params, found.as_flattened(), &expected);
            record.steady_but_contracted("film", found.as_flattened());
            Ok(())
        })
    })
}

/// Holds a film of eight values a pixel (radiance, alpha, transmittance, depth) to the twin's.
fn hold(record: &mut Record, set: &Set, params: &MarchParams, found: &[f32], expected: &[f64]) {
    let (found, expected) = (found.as_chunks::<8>().0, expected.as_chunks::<8>().0);
    let size = [params.width, params.height];
    record.picture(
        "radiance",
        size,
        found.iter().map(|p| [p[0], p[1], p[2]]),
        expected.iter().map(|p| [p[0], p[1], p[2]]),
    );
    if set.alone != alone::NO {
        record.hold("inverse surface", found.iter().map(|p| 1.0 / p[3]), expected.iter().map(|p| 1.0 / p[3]));
    } else {
        record.hold("alpha", found.iter().map(|p| p[3]), expected.iter().map(|p| p[3]));
    }
    record.hold(
        "transmittance",
        found.iter().flat_map(|p| [p[4], p[5], p[6]]),
        expected.iter().flat_map(|p| [p[4], p[5], p[6]]),
    );
    // Where next to nothing is stopped, one sample at the rim decides, and its density may be a rounding error.
    let solid = || found.iter().zip(expected).filter(|(_, e)| e[4] + e[5] + e[6] < 2.997);
    record.hold("depth", solid().map(|(f, _)| f[7]), solid().map(|(_, e)| e[7]));
}
