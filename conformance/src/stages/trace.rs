//! `trace` against its twin.

use airlight::device::Usage;
use airlight::glam::DVec3;
use airlight::reference::{self, TraceInputs};
use airlight::scene::{Camera, Mesh};
use airlight::stage::{Stage, Trace, TraceParams};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{ball, camera, room};
use crate::{Case, Record, Subject, check, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    let glossy = airlight::scene::Material::default();
    let center = DVec3::new(0.1, -0.05, 0.2);
    let near = Camera { origin: center + DVec3::new(0.03, 0.1, -0.07), fov: 100.0, ..camera(18, 14, 1) };
    let far = Camera { origin: DVec3::new(900.0, 700.0, 1100.0), fov: 0.08, ..camera(15, 11, 2) };
    let sets = [
        ("room", room(), camera(21, 13, 1)),
        ("five_samples", room(), camera(11, 9, 5)),
        ("many_triangles", ball(center, 0.4, 9, glossy), camera(23, 17, 1)),
        ("eye_inside", ball(center, 0.4, 4, glossy), near),
        ("eye_far_away", room(), far),
    ];
    let made = |(name, mesh, camera): (&str, Mesh, Camera)| {
        let run = move |subject: &Subject, record: &mut Record| one(subject, record, &mesh, &camera);
        let tolerance = if name == "eye_far_away" { &tolerance::HITS_FAR } else { &tolerance::HITS };
        case("trace", name, "hits", tolerance, run)
    };
    sets.into_iter().map(made).collect()
}

/// The parameters of a camera before a mesh, with the sub-pixel positions.
pub(super) fn params(mesh: &Mesh, camera: &Camera) -> Result<(TraceParams, Vec<f32>), Failed> {
    let hierarchy = mesh.hierarchy().ok_or("a mesh without triangles")?;
    let mut p = TraceParams::zeroed();
    p.eye = (camera.origin - hierarchy.origin()).as_vec3().extend(0.0).to_array();
    [p.forward, p.right, p.up] = camera.axes().map(|a| a.as_vec3().extend(0.0).to_array());
    (p.width, p.height, p.samples) = (camera.width, camera.height, camera.samples);
    (p.nodes, p.node_end) = (hierarchy.nodes(), hierarchy.nodes());
    Ok((p, camera.subpixels().iter().flat_map(|p| p.as_vec2().to_array()).collect()))
}

fn one(subject: &Subject, record: &mut Record, mesh: &Mesh, camera: &Camera) -> Result<(), Failed> {
    let (params, tables) = params(mesh, camera)?;
    let records = mesh.hierarchy().ok_or("a mesh without triangles")?.records();
    let expected = reference::trace(&params, &TraceInputs { tables: &tables, mesh: records });
    let met = expected.chunks_exact(8).filter(|hit| hit[3].is_finite()).count();
    check!(met > 20, "only {met} rays meet the mesh: the case tries nothing");
    let mut bench = Bench::new(subject)?;
    let hits = bench.room::<[f32; 4]>(expected.len() / 4, Usage::Output)?;
    let stage = Stage::Trace(Trace { params, tables: bench.buf(&tables)?, mesh: bench.buf(records)?, hits });
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        let found = bench.read(hits)?;
        let found = found.as_flattened();
        let places = |keep: fn(usize) -> bool| move |n: &usize| keep(n % 8);
        let part = |name: &str, keep: fn(usize) -> bool, record: &mut Record| {
            let chosen: Vec<_> = (0..found.len()).filter(places(keep)).collect();
            record.hold(name, chosen.iter().map(|&n| found[n]), chosen.iter().map(|&n| expected[n]));
        };
        part("normals", |k| ![3, 7].contains(&k), record);
        part("distances", |k| k == 3, record);
        part("materials", |k| k == 7, record);
        Ok(())
    })
}
