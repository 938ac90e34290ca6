//! The density on the device: uploaded slice by slice, or made there.

use super::classify::plan_classified;
use super::plan::Plan;
use crate::Version;
use crate::device::{Buf, Field, FieldFormat, FieldSpec};
use crate::media::{Bricks, DensitySource, FractalNoise, Gaussians, Medium};
use crate::scene::{Precision, Scene};
use crate::stage::{BlobRecord, Inject, InjectParams, Stage, inject_kind};

/// Plans a field of densities of a medium that the host writes: in halves where that is asked for and `bound` known, and in
/// bricks where the medium holds it sparse and they take less than half of what it takes laid out.
pub(super) fn plan_scalars<'a>(
    slot: &str,
    scene: &Scene,
    version: Version,
    bound: Option<f32>,
    bricks: Option<&'a Bricks>,
    slice: impl FnMut(u32, &mut [f32]) + 'a,
    plan: &mut Plan<'a>,
) -> Field {
    let format = match (scene.quality.density, bound) {
        (Precision::F16, Some(bound)) => FieldFormat::half(bound),
        _ => FieldFormat::Scalar,
    };
    let spec = FieldSpec::dense(scene.medium.lattice().dims().to_array(), 1, format);
    if let Some(bricks) = bricks
        && spec.in_bricks(bricks.layout()).bytes() < spec.bytes() / 2
    {
        return plan.upload_bricks(slot, spec, &version, bricks);
    }
    plan.upload_field(slot, spec, &version, slice)
}

/// Plans the field of a medium's density.
pub(super) fn plan_density<'a>(scene: &'a Scene, plan: &mut Plan<'a>) -> Field {
    let medium = scene.medium.as_ref();
    let lattice = medium.lattice();
    let spec = FieldSpec::dense(lattice.dims().to_array(), 1, FieldFormat::Scalar);
    let version = medium.version();
    let noise = |noise: &FractalNoise, kind| {
        InjectParams::new(kind, lattice, InjectParams::in_cells(lattice, noise)).with_noise(noise)
    };
    let mut made = Made::default();
    let params = match medium.source() {
        DensitySource::Slices => {
            let bricks = plan.field_kinds().bricks.then(|| medium.density_bricks()).flatten();
            let bound = medium.density_bound();
            return plan_scalars("density", scene, version, bound, bricks, |k, out| medium.density_slice(k, out), plan);
        }
        DensitySource::Gaussians(gaussians) => {
            made.gaussians(gaussians, plan);
            let place = InjectParams::centered(lattice);
            InjectParams::new(inject_kind::GAUSSIANS, lattice, place).with_bins(gaussians.bins())
        }
        DensitySource::HeightFog(fog) => {
            let place = InjectParams::above(lattice, fog.base(), fog.falloff());
            let params = InjectParams::new(inject_kind::HEIGHT_FOG, lattice, place);
            InjectParams { density: fog.density() as f32, ..params }
        }
        DensitySource::Noise(medium) => {
            InjectParams { density: medium.density() as f32, ..noise(medium.noise(), inject_kind::NOISE) }
        }
        DensitySource::Detailed(detailed) => {
            let grid = detailed.grid();
            let slice = |k: u32, out: &mut [f32]| grid.density_slice(k, out);
            made.base = Some(plan.upload_field("base density", spec, &grid.version(), slice));
            noise(detailed.noise(), inject_kind::DETAIL)
        }
        // What is classified is planned with the fields of its optics.
        DensitySource::Classified(classified) => return plan_classified(classified, [false; 2], plan).density,
    };
    let out = plan.work("injected density", lattice.voxels());
    let Made { base, blobs, starts, list } = made;
    plan.stage(Stage::Inject(Inject { params, base, blobs, starts, list, out }));
    plan.publish("density", out, spec)
}

/// What the stage reads.
#[derive(Default)]
struct Made {
    base: Option<Field>,
    blobs: Option<Buf<BlobRecord>>,
    starts: Option<Buf<u32>>,
    list: Option<Buf<u32>>,
}

impl Made {
    fn gaussians<'a>(&mut self, medium: &'a Gaussians, plan: &mut Plan<'a>) {
        let (bins, version) = (medium.bins(), medium.version());
        // A buffer holds at least one element. No list names the one that stands for none.
        let filled = |list: &[u32]| if list.is_empty() { vec![0] } else { list.to_vec() };
        let blobs = || {
            let records = BlobRecord::of(medium);
            if records.is_empty() { vec![bytemuck::Zeroable::zeroed()] } else { records }
        };
        let least = |n: usize| n.max(1) as u64;
        self.blobs = Some(plan.upload("blobs", least(medium.blobs().len()), &version, blobs));
        self.starts = Some(plan.upload("blob list starts", bins.starts.len() as u64, &version, || bins.starts.clone()));
        self.list = Some(plan.upload("blob lists", least(bins.list.len()), &version, move || filled(&bins.list)));
    }
}
