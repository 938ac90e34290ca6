//! The density on the device: uploaded slice by slice, or made there.

use super::classify::plan_classified;
use super::plan::Plan;
use crate::device::{Buf, Field, FieldFormat, FieldSpec};
use crate::media::{DensitySource, FractalNoise, Gaussians, Medium};
use crate::stage::{BlobRecord, Inject, InjectParams, Stage, inject_kind};

/// Plans the field of a medium's density.
pub(super) fn plan_density<'a>(medium: &'a dyn Medium, plan: &mut Plan<'a>) -> Field {
    let lattice = medium.lattice();
    let spec = FieldSpec { dims: lattice.dims().to_array(), layers: 1, format: FieldFormat::Scalar };
    let version = medium.version();
    let noise = |noise: &FractalNoise, kind| {
        InjectParams::new(kind, lattice, InjectParams::in_cells(lattice, noise)).with_noise(noise)
    };
    let mut made = Made::default();
    let params = match medium.source() {
        DensitySource::Slices => {
            return plan.upload_field("density", spec, &version, |k, out| medium.density_slice(k, out));
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
