//! `transfer`: light through matrices that were made before (Zhang, Dong and Ma 2013).
//!
//! A new light is projected on the basis, the clusters' matrices are multiplied with it ([`Evaluate`]), and each cell's
//! radiance is put together from those of its cluster ([`Reconstruct`]). Nothing of the transport is done again.

use std::iter;

use bytemuck::Zeroable;
use glam::{DVec3, UVec3};

use super::{InScatter, MediumFields, Sources, Y0};
use crate::basis::{Basis, BasisError, DiscreteSpherical, SphericalHarmonics, recurrence_table};
use crate::device::{Buf, DeviceError, FieldFormat, FieldSpec};
use crate::exec::Plan;
use crate::light::{Environment, Light, Prefilter};
use crate::scene::{LightBasis, Scene, ViewDependence};
use crate::stage::{Evaluate, EvaluateParams, Reconstruct, ReconstructParams, Stage};
use crate::transfer::{Channel, Transfer};

/// A transfer as one picture sees it.
pub(crate) struct Relit<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) transfer: &'a Transfer,
    pub(crate) view: ViewDependence,
    pub(crate) prefilter: Prefilter,
}

impl<'a> Relit<'a> {
    /// Plans J, and adds it to `sources`.
    pub(crate) fn plan(&self, medium: &MediumFields, plan: &mut Plan<'a>, sources: &mut Sources) {
        let (scene, transfer) = (self.scene, self.transfer);
        let shape = transfer.shape();
        let lit = scene.environment.is_some() || !scene.lights.is_empty();
        if shape.rows.is_empty() || !lit || scene.optics.albedo == glam::Vec3::ZERO {
            return;
        }
        let version = transfer.version();
        let (rows, channels) = (shape.rows.len() as u64, transfer.channels());
        let coefficients = shape.bands * shape.bands;
        // All channels' clusters are evaluated as if they were one channel's.
        let clusters = shape.clusters * channels.len() as u32;
        let folded = self.view == ViewDependence::Cluster && shape.bands > 1;
        let (functions, packed) = (shape.basis.count(), EvaluateParams::packed(shape.basis.count()));
        let params = EvaluateParams::new(clusters, shape.components, coefficients, packed, folded);
        let matrices = self.values(|c| &c.matrices) / u64::from(functions) * u64::from(packed);
        let evaluated = u64::from(params.units) * u64::from(params.outputs());
        let evaluate = Evaluate {
            params,
            matrices: plan.external("transfer matrices", matrices, &version, write_packed(channels, functions)),
            light: self.light(plan),
            views: folded.then(|| plan.table("cluster views", self.cluster_views())),
            out: plan.work("evaluated", evaluated),
        };
        let radiance = evaluate.out;
        plan.stage(Stage::Evaluate(evaluate));

        let view = self.view == ViewDependence::Cell && shape.bands > 1;
        let bands = if folded { 1 } else { shape.bands };
        let tables = if folded {
            vec![1.0]
        } else {
            let single = if bands == 1 { Y0 } else { 1.0 };
            let mut tables: Vec<f32> = self.beta().iter().map(|beta| (beta * single) as f32).collect();
            tables.extend(view.then(|| recurrence_table(bands)).into_iter().flatten());
            tables
        };
        let [x, y, z] = shape.cells;
        let mut params = ReconstructParams::zeroed();
        [params.world_x, params.world_y, params.world_z] = medium.grid.world;
        params.cells = [x, y, z, 0];
        params.cell =
            [0, 1, 2, 3].map(|a| if a < 3 { medium.grid.dims[a] as f32 / shape.cells[a] as f32 } else { 0.0 });
        if view {
            let eye = scene.medium.lattice().world_to_index().transform_point3(scene.camera.origin);
            params.eye = eye.as_vec3().extend(0.0).to_array();
        }
        (params.rows, params.clusters, params.components) = (rows as u32, shape.clusters, shape.components);
        (params.channels, params.bands, params.view) = (channels.len() as u32, bands, view.into());
        let cells = u64::from(x) * u64::from(y) * u64::from(z);
        let layers = params.layers();
        let out = plan.work("transfer radiance", cells * u64::from(layers));
        let weights = (shape.components > 0).then(|| {
            let fill = write_all(channels, |c| &c.weights);
            plan.external("transfer weights", self.values(|c| &c.weights), &version, fill)
        });
        let fill = write_all(channels, |c| &c.clusters);
        let reconstruct = Reconstruct {
            params,
            rows: plan.upload("transfer rows", cells, &version, move || shape.places()),
            clusters: plan.external("transfer clusters", self.values(|c| &c.clusters), &version, fill),
            weights,
            radiance,
            tables: plan.table("transfer tables", tables),
            out,
        };
        plan.stage(Stage::Reconstruct(reconstruct));
        let spec = FieldSpec::dense(shape.cells, layers, FieldFormat::Rgba);
        let field = plan.publish("transfer in-scatter", out, spec);
        let bands = if layers == 1 { 1 } else { bands };
        sources.field = Some(InScatter { field, cells: shape.cells, bands, trilinear: true });
    }

    fn values<T: 'a>(&self, of: impl Fn(&'a Channel) -> &'a Vec<T>) -> u64 {
        self.transfer.channels().iter().map(|channel| of(channel).len() as u64).sum()
    }

    /// β of each moment.
    fn beta(&self) -> Vec<f64> {
        let bands = self.transfer.shape().bands;
        let moments = self.scene.optics.phase.moments(bands);
        (0..(bands * bands) as usize).map(|j| moments[j.isqrt()]).collect()
    }

    /// The scene's light in the basis: three planes.
    fn light(&self, plan: &mut Plan<'a>) -> Buf<f32> {
        let (scene, basis, prefilter) = (self.scene, self.transfer.shape().basis, self.prefilter);
        let environment = scene.environment.as_ref();
        let sky = environment.map(|e| (e.version(), e.rotation.to_bits(), e.scale.to_array().map(f32::to_bits)));
        let direct = scene.lights.iter().filter_map(|light| match light {
            Light::Directional { to_light, irradiance } => {
                Some((to_light.to_array().map(f64::to_bits), irradiance.to_array().map(f32::to_bits)))
            }
            _ => None,
        });
        let lights: Vec<_> = direct.collect();
        let key = (sky, lights, basis, format!("{prefilter:?}"));
        let packed = EvaluateParams::packed(basis.count());
        plan.external("basis light", 3 * u64::from(packed), &key, move |device, buf| {
            let light = light_of(scene, basis, prefilter).map_err(|error| DeviceError::Invalid(error.to_string()))?;
            let plane = |c| light.iter().map(move |s| s[c] as f32).chain(iter::repeat(0.0)).take(packed as usize);
            let planes: Vec<f32> = [0, 1, 2].into_iter().flat_map(plane).collect();
            device.write(buf.id, 0, bytemuck::cast_slice(&planes))
        })
    }

    /// β_j Y_j of the direction from the eye to the middle of each cluster.
    fn cluster_views(&self) -> Vec<f32> {
        let (scene, shape) = (self.scene, self.transfer.shape());
        let lattice = scene.medium.lattice();
        let cell = lattice.dims().as_dvec3() / UVec3::from(shape.cells).as_dvec3();
        let [x, y, _] = shape.cells;
        let center = |at: u32| {
            let place = DVec3::new((at % x).into(), (at / x % y).into(), (at / x / y).into());
            (place + 0.5) * cell - 0.5
        };
        let harmonics = SphericalHarmonics::new(shape.bands).expect("checked with the transfer");
        let (beta, mut values) = (self.beta(), vec![0.0; harmonics.count()]);
        let mut views = Vec::new();
        for channel in self.transfer.channels() {
            let mut sums = vec![(DVec3::ZERO, 0.0); shape.clusters as usize];
            for (&cluster, &cell) in channel.clusters.iter().zip(&shape.rows) {
                let (sum, count) = &mut sums[cluster as usize];
                (*sum, *count) = (*sum + center(cell), *count + 1.0);
            }
            for (sum, count) in sums {
                let middle = lattice.index_to_world().transform_point3(sum / f64::max(count, 1.0));
                harmonics.eval((middle - scene.camera.origin).normalize_or(DVec3::Z), &mut values);
                views.extend(values.iter().zip(&beta).map(|(y, beta)| (y * beta) as f32));
            }
        }
        views
    }
}

/// Fills a buffer with a part of each channel, one behind the other.
fn write_all<'a, T: bytemuck::Pod>(
    channels: &'a [Channel],
    of: impl Fn(&'a Channel) -> &'a Vec<T> + 'a,
) -> impl FnOnce(&mut dyn crate::device::Device, Buf<T>) -> Result<(), DeviceError> + 'a {
    move |device, buf| {
        let mut at = 0;
        for channel in channels {
            let bytes: &[u8] = bytemuck::cast_slice(of(channel));
            if !bytes.is_empty() {
                device.write(buf.id, at, bytes)?;
            }
            at += bytes.len() as u64;
        }
        Ok(())
    }
}

/// Writes all channels' matrices, whose rows of so many functions are filled up to whole packs.
fn write_packed(
    channels: &[Channel],
    functions: u32,
) -> impl FnOnce(&mut dyn crate::device::Device, Buf<f32>) -> Result<(), DeviceError> {
    let (functions, packed) = (functions as usize, EvaluateParams::packed(functions) as usize);
    move |device, buf| {
        let (mut at, mut some) = (0, Vec::new());
        for rows in channels.iter().flat_map(|channel| channel.matrices.chunks(WRITTEN_ROWS * functions)) {
            some.clear();
            for row in rows.chunks(functions) {
                some.extend_from_slice(row);
                some.resize(some.len() + packed - functions, 0.0_f32);
            }
            device.write(buf.id, at, bytemuck::cast_slice(&some))?;
            at += 4 * some.len() as u64;
        }
        Ok(())
    }
}

/// Rows of matrices that are copied before they are written: a few MiB.
const WRITTEN_ROWS: usize = 1024;

/// The coefficients of an environment on a basis.
fn of_environment(
    environment: &Environment,
    basis: LightBasis,
    functions: &dyn Basis,
    prefilter: Prefilter,
) -> Result<Vec<[f64; 3]>, BasisError> {
    match basis {
        LightBasis::Harmonics { bands } => Ok(environment.project_sh(&SphericalHarmonics::new(bands)?)),
        LightBasis::Discrete { functions } if prefilter != Prefilter::Energy => {
            Ok(prefilter.coefficients(environment, &DiscreteSpherical::new(functions)?))
        }
        LightBasis::Discrete { .. } | LightBasis::Radial { .. } => Ok(environment.coefficients(functions)),
    }
}

/// The coefficients of a scene's environment and directional lights on a basis.
fn light_of(scene: &Scene, basis: LightBasis, prefilter: Prefilter) -> Result<Vec<[f64; 3]>, BasisError> {
    let functions = basis.functions()?;
    let mut light = match &scene.environment {
        Some(environment) => of_environment(environment, basis, functions.as_ref(), prefilter)?,
        None => vec![[0.0; 3]; functions.count()],
    };
    for of in &scene.lights {
        if let Light::Directional { to_light, irradiance } = of {
            for (sum, share) in light.iter_mut().zip(functions.directional(*to_light)) {
                let irradiance = irradiance.as_dvec3().to_array();
                sum.iter_mut().zip(irradiance).for_each(|(sum, e)| *sum += share * e);
            }
        }
    }
    Ok(light)
}
