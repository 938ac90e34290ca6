//! `inject` against its twin.

use airlight::device::Usage;
use airlight::glam::{DVec3, UVec3};
use airlight::media::{Bins, FractalNoise, Gaussian, Gaussians, Lattice};
use airlight::reference::{self, InjectInputs};
use airlight::stage::{BlobRecord, Inject, InjectParams, Stage, inject_kind};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{Map, density, noise};
use crate::{Case, Record, Subject, Tolerance, tolerance};

const GIVES: &str = "density";

/// Bricks of which the last along each axis reach past the lattice.
const SAMPLES: UVec3 = UVec3::new(21, 9, 26);

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (map, name) in Map::ALL.into_iter().zip(["plain", "rotated", "sheared", "mirrored"]) {
        let lattice = move || map.lattice(SAMPLES);
        cases.push(gaussians(&format!("gaussians_{name}"), lattice, || blobs(40, 1.0), Bins::ENTRIES));
        cases.push(described(&format!("height_fog_{name}"), &tolerance::INJECT, inject_kind::HEIGHT_FOG, move || {
            // The base lies within the box.
            let params =
                InjectParams::new(inject_kind::HEIGHT_FOG, &lattice(), InjectParams::above(&lattice(), 0.1, 7.0));
            InjectParams { density: 2.5, ..params }
        }));
        for (kind, what, octaves, contrast) in
            [(inject_kind::NOISE, "noise", 5, 3.0), (inject_kind::DETAIL, "detail", 3, 1.0)]
        {
            cases.push(described(&format!("{what}_{name}"), &tolerance::INJECT_NOISE, kind, move || {
                let noise = FractalNoise::new(0.21, octaves, 0xdead_beef, contrast).expect("in range");
                let place = InjectParams::in_cells(&lattice(), &noise);
                InjectParams { density: 0.8, ..InjectParams::new(kind, &lattice(), place).with_noise(&noise) }
            }));
        }
    }
    let plain = || Map::Plain.lattice(SAMPLES);
    cases.push(gaussians("gaussians_none", plain, Vec::new, Bins::ENTRIES));
    cases.push(gaussians("gaussians_outside", plain, || blobs(20, 5.0), Bins::ENTRIES));
    cases.push(gaussians("gaussians_1000", plain, || blobs(1000, 1.0), Bins::ENTRIES));
    // Lists that must be shared by several bricks.
    cases.push(gaussians("gaussians_in_wide_bins", plain, || blobs(200, 1.0), 400));
    cases.push(gaussians("gaussians_in_one_list", || Map::Sheared.lattice(SAMPLES), || blobs(60, 1.0), 1));
    // Narrower than a voxel: seen by the one sample that it stands on, and by none.
    let narrow = move || {
        let at = |i: DVec3| plain().index_to_world().transform_point3(i);
        let blob = |i| Gaussian { center: at(i), a: 1e4, c: 3.0 };
        vec![blob(DVec3::new(4.0, 5.0, 6.0)), blob(DVec3::new(10.5, 2.5, 20.5))]
    };
    cases.push(gaussians("gaussians_on_a_sample", plain, narrow, Bins::ENTRIES));
    cases
}

/// Gaussians of many widths and heights, spread over the box and as far around as `spread` boxes.
fn blobs(n: usize, spread: f64) -> Vec<Gaussian> {
    let random: Vec<f64> = noise(31, 5 * n).into_iter().map(f64::from).collect();
    let blob = |r: &[f64]| Gaussian {
        center: DVec3::new(0.1, -0.05, 0.2) + (DVec3::new(r[0], r[1], r[2]) - 0.5) * spread * DVec3::new(1.0, 0.8, 1.2),
        a: 2.0 * 20f64.powf(r[3]),
        c: r[4],
    };
    random.chunks_exact(5).map(blob).collect()
}

/// A sum of Gaussians whose lists keep to so many entries.
fn gaussians(
    name: &str,
    lattice: impl Fn() -> Lattice + Send + Sync + 'static,
    blobs: impl Fn() -> Vec<Gaussian> + Send + Sync + 'static,
    entries: u64,
) -> Case {
    case("inject", name, GIVES, &tolerance::INJECT, move |subject, record| {
        let lattice = lattice();
        let medium = Gaussians::new(blobs(), lattice.clone())?;
        let bins = Bins::within(&lattice, medium.blobs(), &medium.radii(Gaussians::CUT), entries);
        let records = BlobRecord::of(&medium);
        let place = InjectParams::centered(&lattice);
        let params = InjectParams::new(inject_kind::GAUSSIANS, &lattice, place).with_bins(&bins);
        let inputs = InjectInputs { base: None, blobs: &records, starts: &bins.starts, list: &bins.list };
        let found = one(subject, record, params, &inputs)?;
        // The stage's lists against the sum without any: what is cut off, and the rounding of the twin's tolerance.
        let map = lattice.index_to_world();
        let dims = lattice.dims();
        let allowed = Gaussians::CUT + tolerance::INJECT.peak * medium.blobs().len().max(1) as f64;
        for (n, found) in found.into_iter().enumerate() {
            let n = n as u32;
            let index = UVec3::new(n % dims.x, n / dims.x % dims.y, n / dims.x / dims.y);
            let whole = medium.at(map.transform_point3(index.as_dvec3()));
            if (f64::from(found) - whole).abs() > allowed * medium.largest().max(f64::MIN_POSITIVE) {
                return Err(format!("sample {index}: {found} of the list, {whole} of all Gaussians").into());
            }
        }
        Ok(())
    })
}

/// What needs no lists.
fn described(
    name: &str,
    tolerance: &'static Tolerance,
    kind: u32,
    params: impl Fn() -> InjectParams + Send + Sync + 'static,
) -> Case {
    case("inject", name, GIVES, tolerance, move |subject, record| {
        let base = density(SAMPLES, 21);
        let base = (kind == inject_kind::DETAIL).then_some(&base[..]);
        one(subject, record, params(), &InjectInputs { base, ..InjectInputs::default() }).map(drop)
    })
}

/// Holds a stage to its twin, and gives what it found.
fn one(
    subject: &Subject,
    record: &mut Record,
    params: InjectParams,
    inputs: &InjectInputs<'_>,
) -> Result<Vec<f32>, Failed> {
    let mut bench = Bench::new(subject)?;
    let dims = [params.dims[0], params.dims[1], params.dims[2]];
    let base = inputs.base.map(|base| bench.scalars(dims, base)).transpose()?;
    // No list names what stands for an empty one.
    let blobs = if inputs.blobs.is_empty() { &[bytemuck::Zeroable::zeroed()][..] } else { inputs.blobs };
    let list = if inputs.list.is_empty() { &[0][..] } else { inputs.list };
    let lists = params.dims[3] == inject_kind::GAUSSIANS;
    let stage = Inject {
        params,
        base,
        blobs: if lists { Some(bench.buf(blobs)?) } else { None },
        starts: if lists { Some(bench.buf(inputs.starts)?) } else { None },
        list: if lists { Some(bench.buf(list)?) } else { None },
        out: bench.room(dims.iter().product::<u32>() as usize, Usage::Work)?,
    };
    let out = stage.out;
    let stage = Stage::Inject(stage);
    let expected = reference::inject(&params, inputs);
    let mut all = Vec::new();
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        all = bench.read(out)?;
        record.hold(GIVES, all.iter().map(|&v| f64::from(v)), expected.iter().copied());
        Ok(())
    })?;
    Ok(all)
}
