//! `sweeps`: light that was scattered before, by discrete ordinates.
//!
//! Light is known at the cells of a coarse grid by its moments on spherical harmonics. With b the moments of unscattered
//! light (the environment's and the emission's by sweeps, the lights' one by one), and K the scattering of moments into every
//! direction and their sweep to every cell, the moments of scattered light are x = K(b + x): all orders, without
//! precomputation. The march adds J = Σ β_l x_lm Y_lm(d) to the first order that other estimators give, so that nothing
//! counts twice.
//!
//! A phase function that reaches further than the bands is made similar (δ-scaling; Joseph, Wiscombe and Weinman 1976): the
//! share f = β_L of its first moment beyond them goes on as if it had not been scattered, and β'_l = (β_l - f)/(1 - f). What
//! the similar medium holds, b' + x', stands for all light; without the first order that the march adds with the medium's own
//! extinction, b, it is b' + x' - b. Of analytic lights, b' still comes from one direction each, where three bands of β_l would
//! ring: the march takes their first order through the similar medium instead, with the whole phase function (as the TMS
//! method of Nakajima and Tanaka 1988 does), and no more than x' is added.

use std::f64::consts::PI;

use bytemuck::Zeroable;
use glam::{DMat3, DVec3, Vec3};

use super::ordinates::Carried;
use super::scatter::Scattering;
use super::{Estimator, InScatter, MediumFields, Sources, Y0};
use crate::basis::recurrence_table;
use crate::device::{Buf, FieldFormat, FieldSpec};
use crate::exec::{Part, Plan, RenderError};
use crate::scene::{Orders, Scene, SurfaceShadow, Sweeps};
use crate::stage::{Illuminate, IlluminateParams, LightRecord, Relight, RelightParams, Stage};

impl Estimator for Sweeps {
    fn name(&self) -> &'static str {
        "sweeps"
    }

    fn plan<'a>(
        &'a self,
        scene: &'a Scene,
        medium: &MediumFields,
        plan: &mut Plan<'a>,
        sources: &mut Sources,
    ) -> Result<(), RenderError> {
        let estimate = &scene.estimate;
        let around = scene.environment.is_some() || medium.emission.is_on();
        let lit = estimate.environment.is_some() && around || estimate.lights.is_some() && !scene.lights.is_empty();
        if !lit || scene.optics.albedo == Vec3::ZERO || self.orders == Orders::Count(1) {
            return Ok(());
        }
        let channels = if colorless(scene, medium) { 1 } else { 3 };
        let mut setup = Scattering::new(*self, scene, medium, channels);
        setup.ordinates.obstruct("obstructions", sources.mesh, plan);
        let optics = setup.ordinates.coarsen("cells", setup.forward, plan);
        let mut parts = setup.unscattered("", optics, setup.forward, plan);
        if setup.forward > 0.0 && !parts.is_empty() {
            parts.iter_mut().for_each(|part| part.out = 1.0);
            let optics = setup.ordinates.coarsen("own cells", 0.0, plan);
            let own = setup.unscattered("own ", optics, 0.0, plan);
            parts.extend(own.into_iter().map(|part| Part { source: 0.0, out: -1.0, ..part }));
        }
        parts.extend(setup.lights(sources, plan).map(|light| Part { light, source: 1.0, out: 0.0 }));
        if setup.forward > 0.0 {
            sources.light_extinction = Some(setup.similar_extinction());
        }
        let out = setup.solve(optics, parts, plan);
        let field = setup.relight(out, plan);
        sources.scattered =
            Some(InScatter { field, cells: setup.ordinates.cells, bands: setup.bands, trilinear: true });
        Ok(())
    }
}

impl Sweeps {
    /// Cells along each axis of a box of `lengths` (metres): `cells` along the longest.
    pub fn grid(&self, lengths: DVec3) -> [u32; 3] {
        super::grid(self.cells, lengths)
    }
}

/// Whether nothing in a scene tells the channels apart.
fn colorless(scene: &Scene, medium: &MediumFields) -> bool {
    let grey = |v: Vec3| v.x == v.y && v.y == v.z;
    let optics = &scene.optics;
    // A picture is looked through only where that is less work than a channel saves.
    let sky = scene.environment.as_ref().is_none_or(|e| {
        let texels = &e.image().texels;
        grey(e.scale) && texels.len() <= 4096 && texels.iter().all(|&t| grey(t.into()))
    });
    grey(optics.extinction)
        && grey(optics.albedo)
        && medium.scattering.is_none()
        && (!medium.emission.is_on() || (grey(optics.emission) && medium.emission.color().is_none()))
        && sky
        && scene.lights.iter().all(|light| grey(light.power()))
}

impl<'a> Scattering<'a> {
    /// Unscattered light from all around and of the medium's own, where its first order is estimated, in the medium in which
    /// the share `forward` of scattered light goes on.
    fn unscattered(&self, own: &str, optics: Buf<f32>, forward: f32, plan: &mut Plan<'a>) -> Vec<Part> {
        let part = |light: Buf<f32>| Part { light, source: 1.0, out: 0.0 };
        let mut parts = Vec::new();
        parts.extend(self.environment(own, optics, forward, plan).map(part));
        parts.extend(self.emission(own, optics, forward, plan).map(part));
        parts
    }

    fn environment(&self, own: &str, optics: Buf<f32>, forward: f32, plan: &mut Plan<'a>) -> Option<Buf<f32>> {
        self.scene().estimate.environment.as_ref()?;
        let environment = self.scene().environment.as_ref()?;
        let (nside, harmonics) = (self.nside, self.harmonics());
        let place = (environment.version(), environment.rotation.to_bits(), nside);
        let content = (place, environment.scale.to_array().map(f32::to_bits), self.bands, self.channels);
        let name = format!("{own}sky");
        let directions = self.ordinates.directions(
            &format!("{name} directions"),
            self.options.directions,
            &content,
            move || environment.pixel_centroids(nside),
            plan,
        );
        let (channels, count) = (self.channels, self.options.directions * self.coefficients() * self.channels);
        let weights = plan.upload(&format!("{name} weights"), count.into(), &content, move || {
            let moments = environment.pixel_moments(nside, &harmonics);
            moments.iter().flat_map(|rgb| &rgb[..channels as usize]).map(|&v| v as f32).collect()
        });
        let grey = self.grey(forward);
        let of = Carried {
            optics,
            directions,
            channels: if grey { 1 } else { self.channels },
            grey,
            boundary: 1.0,
            emits: false,
            sources: None,
            weights: (weights, self.channels),
            coefficients: self.coefficients(),
            planar: true,
        };
        Some(self.swept(&name, of, plan))
    }

    fn emission(&self, own: &str, optics: Buf<f32>, forward: f32, plan: &mut Plan<'a>) -> Option<Buf<f32>> {
        self.scene().estimate.environment.as_ref().filter(|_| self.ordinates.medium.emission.is_on())?;
        let name = format!("{own}glow");
        let of = Carried { emits: true, ..self.carried(&name, optics, forward, plan) };
        Some(self.swept(&name, of, plan))
    }

    /// Unscattered light of the lights, where their first order is estimated, in the similar medium.
    fn lights(&self, sources: &Sources, plan: &mut Plan<'a>) -> Option<Buf<f32>> {
        let (scene, medium) = (self.scene(), &self.ordinates.medium);
        let estimate = scene.estimate.lights.as_ref().filter(|_| !scene.lights.is_empty())?;
        let (lattice, grid) = (scene.medium.lattice(), &medium.grid);
        let center = lattice.center();
        let [x, y, z] = self.ordinates.cells;
        let mut params = IlluminateParams::zeroed();
        params.dims = grid.dims;
        [params.index_x, params.index_y, params.index_z] = grid.index;
        [params.world_x, params.world_y, params.world_z] = grid.world;
        params.cells = [x, y, z, 0];
        params.cell = self.ordinates.cell(medium.step);
        params.extinction = self.similar_extinction().extend(0.0).to_array();
        let lights = scene.lights.len() as u32;
        (params.lights, params.light_end, params.spots) = (lights, lights, LightRecord::spots(&scene.lights));
        (params.bands, params.channels) = (self.bands, self.channels);
        // The ball of a cell's volume: over it, 1/r² is 3/R² in the mean.
        let map = lattice.index_to_world().matrix3;
        let sides = DMat3::from_diagonal(DVec3::from([0, 1, 2].map(|a| f64::from(params.cell[a]))));
        let volume = (map * sides).determinant().abs();
        params.light_floor = ((0.75 * volume / PI).cbrt().powi(2) / 3.0) as f32;
        let mesh = sources.mesh.filter(|_| estimate.surface_shadow() != SurfaceShadow::None);
        if let Some(mesh) = mesh {
            params.mesh_eye = mesh.from_origin(center);
            (params.nodes, params.visibility) = (mesh.nodes, 1);
        }
        if let Some(occupancy) = sources.occupancy {
            params.occupancy_cells = occupancy.cells;
        }
        let out = plan.output("light moments", self.values());
        let illuminate = Illuminate {
            params,
            density: medium.density,
            occupancy: sources.occupancy.map(|occupancy| occupancy.buffer),
            lights: plan.table("cell lights", LightRecord::of(&scene.lights, center)),
            tables: plan.table("cell harmonics", recurrence_table(self.bands)),
            mesh: mesh.map(|mesh| mesh.records),
            out,
        };
        plan.stage(Stage::Illuminate(illuminate));
        Some(out)
    }

    fn relight(&self, records: Buf<f32>, plan: &mut Plan<'a>) -> crate::device::Field {
        let layers = self.coefficients();
        let single = if layers == 1 { Y0 } else { 1.0 };
        let light = (0..layers as usize).map(|k| [(self.moments[k.isqrt()] * single) as f32; 4]).collect();
        let light = plan.table("scattering moments of the phase function", light);
        let cells = self.ordinates.count();
        let out = plan.work("scattered radiance", cells * u64::from(layers));
        plan.stage(Stage::Relight(Relight {
            params: RelightParams {
                cells: cells as u32,
                coefficients: layers,
                channels: self.channels,
                layers,
                emission_coefficients: 0,
                emission_weight: 0.0,
                planar: 1,
                unused: 0,
            },
            records,
            emission_records: None,
            light,
            out,
        }));
        let spec = FieldSpec::dense(self.ordinates.cells, layers, FieldFormat::Rgba);
        plan.publish("scattered", out, spec)
    }
}
