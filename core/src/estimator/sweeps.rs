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
use nalgebra::DMatrix;

use super::ordinates::{Carried, Ordinates};
use super::{Estimator, InScatter, MediumFields, Sources, Y0};
use crate::basis::{Basis, SphericalHarmonics, healpix, pixel_integrals, recurrence_table};
use crate::device::{Buf, FieldFormat, FieldSpec};
use crate::exec::{Part, Plan, RenderError, Solve};
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
        let mut setup = Setup::new(self, scene, medium);
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

/// What all parts of the plan share.
struct Setup<'a> {
    options: &'a Sweeps,
    ordinates: Ordinates<'a>,
    nside: u32,
    /// Bands that are carried: no more than the phase function reaches.
    bands: u32,
    /// The phase function's moments, and the share of scattered light that goes on.
    moments: Vec<f64>,
    forward: f32,
    /// Channels of moments: 1 where nothing has a colour.
    channels: u32,
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

impl<'a> Setup<'a> {
    fn new(options: &'a Sweeps, scene: &'a Scene, medium: &MediumFields) -> Self {
        let (phase, lattice) = (&scene.optics.phase, scene.medium.lattice());
        let bands = options.bands.min(phase.reach().unwrap_or(u32::MAX));
        let moments = phase.moments(bands + 1);
        // A phase function that goes below zero there scatters back, which nothing goes on from.
        let forward = moments[bands as usize].max(0.0);
        Self {
            options,
            nside: options.nside().expect("validated with the scene"),
            ordinates: Ordinates {
                scene,
                medium: *medium,
                cells: options.grid(lattice.edges() * lattice.dims().as_dvec3()),
                obstructed: None,
            },
            bands,
            moments,
            forward: forward as f32,
            channels: if colorless(scene, medium) { 1 } else { 3 },
        }
    }

    fn scene(&self) -> &'a Scene {
        self.ordinates.scene
    }

    fn coefficients(&self) -> u32 {
        self.bands * self.bands
    }

    fn harmonics(&self) -> SphericalHarmonics {
        SphericalHarmonics::new(self.bands).expect("validated with the scene")
    }

    fn values(&self) -> u64 {
        self.ordinates.count().saturating_mul(u64::from(self.coefficients() * self.channels))
    }

    /// Whether the extinction of one channel serves all where the share `forward` goes on.
    fn grey(&self, forward: f32) -> bool {
        let optics = &self.scene().optics;
        let albedo = optics.albedo;
        let alike = self.ordinates.medium.scattering.is_none() && albedo.x == albedo.y && albedo.y == albedo.z;
        optics.is_grey() && (forward == 0.0 || alike)
    }

    /// Unscattered light from all around and of the medium's own, where its first order is estimated, in the medium in which
    /// the share `forward` of scattered light goes on.
    fn unscattered(&self, own: &str, optics: Buf<f32>, forward: f32, plan: &mut Plan<'a>) -> Vec<Part> {
        let part = |light: Buf<f32>| Part { light, source: 1.0, out: 0.0 };
        let mut parts = Vec::new();
        parts.extend(self.environment(own, optics, forward, plan).map(part));
        parts.extend(self.emission(own, optics, forward, plan).map(part));
        parts
    }

    /// Extinction per unit of density of the similar medium.
    fn similar_extinction(&self) -> Vec3 {
        let optics = &self.scene().optics;
        optics.extinction * (1.0 - self.forward * optics.albedo)
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

    /// Light along the pixels' centres that nothing sends yet, and its moments.
    fn carried(&self, name: &str, optics: Buf<f32>, forward: f32, plan: &mut Plan<'a>) -> Carried {
        let (nside, harmonics) = (self.nside, self.harmonics());
        let directions = self.ordinates.directions(
            &format!("{name} directions"),
            self.options.directions,
            &nside,
            move || healpix::directions(nside),
            plan,
        );
        let count = self.options.directions * self.coefficients();
        let weights = plan.upload(&format!("{name} weights"), count.into(), &(nside, self.bands), move || {
            pixel_integrals(nside, &harmonics).iter().map(|&v| v as f32).collect()
        });
        Carried {
            optics,
            directions,
            channels: self.channels,
            grey: self.grey(forward),
            boundary: 0.0,
            emits: false,
            sources: None,
            weights: (weights, 1),
            coefficients: self.coefficients(),
            planar: true,
        }
    }

    fn swept(&self, name: &str, of: Carried, plan: &mut Plan<'a>) -> Buf<f32> {
        let moments = plan.output(&format!("{name} moments"), self.values());
        let sweep = self.ordinates.sweep(name, of, moments, plan);
        plan.stage(Stage::Sweep(sweep));
        moments
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
        (params.lights, params.light_end) = (lights, lights);
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

    fn solve(&self, optics: Buf<f32>, parts: Vec<Part>, plan: &mut Plan<'a>) -> Buf<f32> {
        let source = plan.input("scattered light", self.values());
        let (nside, harmonics) = (self.nside, self.harmonics());
        let f = f64::from(self.forward);
        let beta: Vec<f64> = self.moments.iter().map(|moment| (moment - f) / (1.0 - f)).collect();
        let content = (nside, self.bands, beta.iter().map(|b| b.to_bits()).collect::<Vec<_>>());
        let count = self.options.directions * self.coefficients();
        let source_weights =
            plan.upload("scattering sources", count.into(), &content, move || source_weights(nside, &harmonics, &beta));
        let of = Carried {
            sources: Some((source, source_weights, self.coefficients())),
            ..self.carried("scattering", optics, self.forward, plan)
        };
        let scattered = plan.output("scattering moments", self.values());
        let out = plan.input("scattered moments", self.values());
        let sweep = self.ordinates.sweep("scattering", of, scattered, plan);
        plan.solve(Solve { stage: Stage::Sweep(sweep), parts, source, scattered, out, orders: self.options.orders });
        out
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
        let spec = FieldSpec { dims: self.ordinates.cells, layers, format: FieldFormat::Rgba };
        plan.publish("scattered", out, spec)
    }
}

/// What moments weigh toward each pixel: β'_l times the dual of the basis under the pixels' weights, so that the moments of
/// what is scattered are exactly β' times those that were.
fn source_weights(nside: u32, harmonics: &SphericalHarmonics, beta: &[f64]) -> Vec<f32> {
    let (directions, count) = (healpix::directions(nside), harmonics.count());
    let mut values = vec![0.0; count];
    let basis = DMatrix::from_row_iterator(
        directions.len(),
        count,
        directions.iter().flat_map(|&d| {
            harmonics.eval(d, &mut values);
            values.clone()
        }),
    );
    let weights = DMatrix::from_row_slice(directions.len(), count, &pixel_integrals(nside, harmonics));
    let gram = weights.transpose() * &basis;
    // The directions resolve the bands: validated with the scene.
    let dual = basis * gram.try_inverse().unwrap_or_else(|| DMatrix::identity(count, count));
    dual.row_iter().flat_map(|row| (0..count).map(|k| (row[k] * beta[k.isqrt()]) as f32).collect::<Vec<_>>()).collect()
}
