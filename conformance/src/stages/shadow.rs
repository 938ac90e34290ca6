//! `shadow` against its twin.

use airlight::device::Usage;
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::reference::{self, ShadowInputs};
use airlight::stage::{FAR, LightRecord, Shadow, ShadowParams, Stage};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::room;
use crate::{Case, Record, Subject, check, tolerance};

/// Texels along a side of a face.
const SIDE: u32 = 11;

pub(crate) fn cases() -> Vec<Case> {
    let sun = || Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::ONE).expect("a light");
    let lamp = || Light::point(DVec3::new(-0.2, 0.4, 0.6), Vec3::ONE).expect("a light");
    let spot = |cutoff: f64| {
        let (from, to) = (DVec3::new(-0.9, 1.1, 0.6), DVec3::new(0.2, -0.1, 0.1));
        Light::spot(from, to, Vec3::ONE, 8.0, cutoff).expect("a light")
    };
    let within = Light::point(DVec3::new(0.25, -0.15, 0.6), Vec3::ONE).expect("a light");
    let outside = Light::point(DVec3::new(3.0, 5.0, 2.0), Vec3::ONE).expect("a light");
    let sets = [
        ("directional", vec![sun()]),
        ("point", vec![lamp()]),
        ("narrow_spot", vec![spot(17.0)]),
        ("wide_spot", vec![spot(100.0)]),
        ("point_in_a_ball", vec![within]),
        ("point_outside", vec![outside]),
        ("several", vec![spot(30.0), lamp(), sun(), spot(90.0), sun()]),
    ];
    let made = |(name, lights): (&str, Vec<Light>)| {
        let run = move |subject: &Subject, record: &mut Record| one(subject, record, &lights);
        case("shadow", name, "distances", &tolerance::HITS, run)
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, lights: &[Light]) -> Result<(), Failed> {
    let mesh = room();
    let hierarchy = mesh.hierarchy().ok_or("a mesh without triangles")?;
    let faces = lights.iter().map(Shadow::faces).sum();
    let nodes = hierarchy.nodes();
    let params = ShadowParams {
        lights: lights.len() as u32,
        faces,
        side: SIDE,
        nodes,
        node_begin: 0,
        node_end: nodes,
        extent: hierarchy.extent(),
        unused: 0,
    };
    let lights = LightRecord::of(lights, hierarchy.origin());
    let expected = reference::shadow(&params, &ShadowInputs { lights: &lights, mesh: hierarchy.records() });
    let met = |v: &f64| *v < f64::from(FAR);
    let stopped = expected.iter().filter(|v| met(v)).count();
    check!(stopped > 5, "only {stopped} rays of light meet the mesh: the case tries nothing");
    let mut bench = Bench::new(subject)?;
    let out = bench.room::<f32>(expected.len(), Usage::Work)?;
    let (lights, mesh) = (bench.buf(&lights)?, bench.buf(hierarchy.records())?);
    let stage = Stage::Shadow(Shadow { params, lights, mesh, out });
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        // What meets nothing is infinite to the tolerance.
        let found = bench.read(out)?.into_iter().map(|v| if v < FAR { v } else { f32::INFINITY });
        record.hold("distances", found, expected.iter().map(|v| if met(v) { *v } else { f64::INFINITY }));
        Ok(())
    })
}
