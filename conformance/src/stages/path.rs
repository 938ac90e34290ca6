//! `path` against its twin, path by path.

use airlight::device::{Buf, Usage};
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Phase, PhaseTable};
use airlight::reference::{self, PathInputs};
use airlight::scene::Camera;
use airlight::stage::{
    GridParams, LightRecord, MaterialRecord, Path, PathParams, PathTables, Reduce, ReduceParams, Stage,
};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, camera, chromatic, density, noise, room, sky};
use crate::{Case, Record, Subject, check, tolerance};

/// One set of parameters.
#[derive(Clone)]
struct Set {
    name: &'static str,
    map: Map,
    phase: Phase,
    lights: Vec<Light>,
    /// Whether light comes from all around, and is seen.
    environment: bool,
    /// Whether what scatters and what shines are fields of their own.
    fields: bool,
    /// Whether there are surfaces, and a background.
    surfaces: bool,
    max_depth: u32,
}

/// Samples of a pixel.
const SAMPLES: u32 = 2;
/// Voxels of a side of the majorant's cells.
const CELL: u32 = 2;

pub(crate) fn cases() -> Vec<Case> {
    let sun = Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.6, 2.0)).expect("a light");
    let lamp = Light::point(DVec3::new(-0.2, 0.9, 0.6), Vec3::new(0.6, 0.7, 1.0)).expect("a light");
    let spot = Light::spot(DVec3::new(-0.9, 1.1, 0.6), DVec3::new(0.2, -0.1, 0.1), Vec3::ONE, 8.0, 27.0);
    let spot = spot.expect("a light");
    let plain = Set {
        name: "lights",
        map: Map::Plain,
        phase: Phase::Isotropic,
        lights: vec![sun, lamp, spot],
        environment: false,
        fields: false,
        surfaces: false,
        max_depth: 2,
    };
    let degrees: Vec<f64> = (0..=36).map(|i| 5.0 * f64::from(i)).collect();
    let values: Vec<f64> = degrees.iter().map(|d| 0.2 + (-d / 25.0).exp()).collect();
    let table = Phase::Table(PhaseTable::new(&degrees, &values).expect("a table").into());
    let lobes = Phase::DoubleHenyeyGreenstein { forward: 0.6, backward: -0.4, weight: 0.7 };
    let sets = [
        plain.clone(),
        Set {
            name: "environment",
            map: Map::Sheared,
            phase: lobes,
            lights: vec![],
            environment: true,
            ..plain.clone()
        },
        Set { name: "rayleigh_once", map: Map::Mirrored, phase: Phase::Rayleigh, max_depth: 1, ..plain.clone() },
        Set {
            name: "table_and_fields",
            map: Map::Rotated,
            phase: table,
            environment: true,
            fields: true,
            ..plain.clone()
        },
        Set { name: "surfaces", phase: Phase::HenyeyGreenstein { g: 0.5 }, environment: true, surfaces: true, ..plain },
    ];
    let made = |set: Set| {
        case("path", set.name, "paths", &tolerance::PATHS, move |subject, record| one(subject, record, &set))
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let (mesh, lattice, camera): (_, _, Camera) = (room(), set.map.lattice(DIMS), camera(21, 13, 1));
    let hierarchy = mesh.hierarchy().ok_or("a mesh without triangles")?;
    let sky = sky();
    let rgb0 = |v: Vec3| v.extend(0.0).to_array();
    let (grid, optics, eye) = (GridParams::new(&lattice), chromatic(set.phase.clone()), camera.origin);
    let mut p = PathParams::zeroed();
    p.dims = grid.dims;
    [p.index_x, p.index_y, p.index_z] = grid.index;
    p.eye = rgb0(lattice.world_to_index().transform_point3(eye).as_vec3());
    [p.forward, p.right, p.up] = camera.axes().map(|a: DVec3| rgb0(a.as_vec3()));
    (p.extinction, p.albedo, p.densest) =
        (rgb0(optics.extinction), rgb0(optics.albedo), optics.extinction.max_element());
    p.majorant_cells = [0, 1, 2, 3].map(|a| if a < 3 { DIMS[a].div_ceil(CELL) } else { CELL });
    (p.width, p.height, p.samples, p.turns) = (camera.width, camera.height, SAMPLES, 4000);
    (p.max_depth, p.frame, p.fresh, p.light_floor) = (set.max_depth, 3, 1, 1e-4);
    if set.fields {
        (p.emission, p.least) = ([0.5, 0.8, 2.0, 0.0], 2.0);
    }
    if set.surfaces {
        p.mesh_eye = (eye - hierarchy.origin()).as_vec3().extend(hierarchy.extent()).to_array();
        p.nodes = hierarchy.nodes();
    }
    let image = sky.image();
    let texels: Vec<[f32; 4]> = image.texels.iter().map(|&[r, g, b]| [r, g, b, 0.0]).collect();
    if set.environment {
        (p.visible, p.environment_dims) = (1, [image.width, image.height, 1, 0]);
        (p.environment_width, p.environment_height) = (image.width, image.height);
        p.environment = sky.scale.extend((sky.rotation / 360.0).rem_euclid(1.0) as f32).to_array();
    }
    let lights = LightRecord::of(&set.lights, eye);
    (p.lights, p.spots) = (lights.len() as u32, LightRecord::spots(&set.lights));
    let known = lights.len() + usize::from(set.environment);
    // Uneven.
    let chances: Vec<f64> = (0..known).map(|i| (i + 1) as f64 / (known * (known + 1) / 2) as f64).collect();
    let tables = PathTables {
        phase: &optics.phase,
        chances,
        materials: mesh.materials().iter().map(MaterialRecord::new).collect(),
        environment: set.environment.then_some(&sky),
    };
    tables.place(&mut p);
    let tables = tables.values();
    let voxels = DIMS.element_product() as usize;
    let rho = density(DIMS, 48);
    // What scatters is a part of what stops light; what shines lies elsewhere too.
    let scattering: Vec<[f32; 4]> = noise(49, 3 * voxels)
        .chunks_exact(3)
        .zip(&rho)
        .map(|(v, rho)| [v[0] * rho, v[1] * rho, v[2] * rho, 0.0])
        .collect();
    // A part of that is what the eye sees.
    let seen: Vec<[f32; 4]> = noise(54, 3 * voxels)
        .chunks_exact(3)
        .zip(&scattering)
        .map(|(v, s)| [v[0] * s[0], v[1] * s[1], v[2] * s[2], 0.0])
        .collect();
    let shining: Vec<f32> = noise(50, voxels).into_iter().map(|v| (v - 0.6).max(0.0)).collect();
    let colors: Vec<[f32; 4]> = shining.iter().map(|&v| [v, 0.5 * v, 0.2 * v, 0.0]).collect();
    let pixels = (p.width * p.height) as usize;
    let far = |i: usize| [0.4, 2.1, 2.4, 9.0, f32::INFINITY][i % 5];
    let behind: Vec<[f32; 4]> =
        noise(51, 3 * pixels).chunks_exact(3).enumerate().map(|(i, c)| [c[0], c[1], c[2], far(i)]).collect();

    let mut bench = Bench::new(subject)?;
    let [x, y, z, side] = p.majorant_cells;
    let dims = DIMS.to_array();
    let majorant = bench.room::<[f32; 2]>((x * y * z) as usize, Usage::Work)?;
    let film: Buf<[f32; 4]> = bench.room(2 * pixels, Usage::Output)?;
    let sums: Buf<[f32; 4]> = bench.room(3 * pixels, Usage::Output)?;
    let field = bench.scalars(dims, &rho)?;
    let emission = if set.fields { Some(bench.scalars(dims, &shining)?) } else { None };
    let params = ReduceParams::new(p.dims, [x, y, z, 0], [side as f32, side as f32, side as f32, 0.0]);
    bench
        .device
        .dispatch(&Stage::Reduce(Reduce { params, density: field, other: emission, out: majorant }), 0..x * y * z)?;
    bench.device.finish()?;
    let cells = bench.read(majorant)?;
    let expected = reference::path(
        &p,
        &PathInputs {
            density: &rho,
            scattering: set.fields.then_some(&scattering[..]),
            seen: set.fields.then_some(&seen[..]),
            emission: None,
            emission_color: set.fields.then_some(&colors[..]),
            environment: set.environment.then_some(&texels[..]),
            majorant: &cells,
            lights: &lights,
            tables: &tables,
            mesh: if set.surfaces { hierarchy.records() } else { &[] },
            background: set.surfaces.then_some(&behind[..]),
        },
    );
    let lit = expected.2.chunks_exact(8).filter(|v| v[0] > 0.0).count();
    check!(lit > 40, "only {lit} pixels are lit: the case tries nothing");
    let stage = Path {
        params: p,
        density: field,
        scattering: if set.fields { Some(bench.colors(dims, 1, &scattering)?) } else { None },
        seen: if set.fields { Some(bench.colors(dims, 1, &seen)?) } else { None },
        emission: None,
        emission_color: if set.fields { Some(bench.colors(dims, 1, &colors)?) } else { None },
        environment: if set.environment {
            Some(bench.colors([image.width, image.height, 1], 1, &texels)?)
        } else {
            None
        },
        majorant,
        lights: if lights.is_empty() { None } else { Some(bench.buf(&lights)?) },
        tables: bench.buf(&tables)?,
        mesh: if set.surfaces { Some(bench.buf(hierarchy.records())?) } else { None },
        background: if set.surfaces { Some(bench.buf(&behind)?) } else { None },
        sums,
        paths: bench.room(pixels, Usage::Work)?,
        film,
    };
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &Stage::Path(stage.clone()), cut)?;
        let (found, counts) = (bench.read(film)?, bench.read(sums)?);
        let done = counts.chunks_exact(3).all(|sums| sums[0][3] == SAMPLES as f32);
        check!(done, "pixels without all of their samples");
        // A path that parts from its twin at a decision within a rounding is another path, as good as the twin's.
        let same =
            |f: &[f32], e: &[f64]| f.iter().zip(e).all(|(&f, &e)| (f64::from(f) - e).abs() <= 5e-4 * (0.02 + e.abs()));
        let seen = |f: &[[f32; 4]], e: &[f64]| same(&f[0], &e[..4]) && same(&f[1][..3], &e[4..7]);
        let pairs = || found.chunks_exact(2).zip(expected.2.chunks_exact(8));
        let parted = pairs().filter(|(f, e)| !seen(f, e)).count();
        record.score("paths", "part of the pixels whose paths part", parted as f64 / pixels as f64, 0.03);
        let kept: Vec<_> = pairs().filter(|(f, e)| seen(f, e)).collect();
        record.hold(
            "radiance",
            kept.iter().flat_map(|(f, _)| [f[0][0], f[0][1], f[0][2]]),
            kept.iter().flat_map(|(_, e)| [e[0], e[1], e[2]]),
        );
        let depth = |v: f64| 1.0 / v;
        record.hold("depth", kept.iter().map(|(f, _)| depth(f[1][3].into())), kept.iter().map(|(_, e)| depth(e[7])));
        Ok(())
    })
}
