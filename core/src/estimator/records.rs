//! `records`: image-based volume lighting (Delalandre, Gautron and Marvie 2013).
//!
//! Light and medium are two factors, and the in-scattered radiance is their product at the cells of a coarse grid.
//! What varies between the paper's three forms is only which factor holds the light and which the phase function:
//!
//! | content | record D | light | J |
//! | --- | --- | --- | --- |
//! | `transmittance` (4.2) | ∫ T b_k dω | F_k = ∫ L b_k dω | Σ F_k D_k / 4π |
//! | `phase` (4.4, dynamic) | ∫ p T b_k dω toward the eye | F_k | Σ F_k D_k |
//! | `radiance` (4.4, static) | ∫ T L Y_k dω | β_l | Σ β_l D_k Y_k(d) |
//!
//! Where the light is a factor of its own, b_k may be discrete spherical functions as well as spherical harmonics.
//!
//! All weights are integrals over the directions' pixels, not values at their centres, so that in a thin medium the
//! sum over directions is exact; with `radiance`, each pixel is marched along the mean direction of the light in it.

use std::f64::consts::PI;

use glam::DVec3;

use super::ordinates::{Carried, Ordinates};
use super::{Estimator, InScatter, MediumFields, MeshBuffers, Sources, Y0};
use crate::basis::{Basis, DiscreteSpherical, SphericalHarmonics, healpix, pixel_integrals};
use crate::device::{Buf, FieldFormat, FieldSpec};
use crate::exec::{Plan, RenderError};
use crate::light::Environment;
use crate::scene::{Content, Elimination, Interpolation, RecordBasis, Records, Scene, Solver};
use crate::stage::{PhaseParams, Project, ProjectParams, Reduce, ReduceParams, Relight, RelightParams, Stage};

impl Estimator for Records {
    fn name(&self) -> &'static str {
        "records"
    }

    fn plan<'a>(
        &'a self,
        scene: &'a Scene,
        medium: &MediumFields,
        plan: &mut Plan<'a>,
        sources: &mut Sources,
    ) -> Result<(), RenderError> {
        let lit = scene.environment.is_some() || medium.emission.is_on();
        if !lit || scene.optics.albedo == glam::Vec3::ZERO {
            return Ok(());
        }
        let setup = Setup::new(self, scene, medium);
        let (records, emission_records) = match self.solver {
            Solver::Sweep => setup.sweep(medium, sources.mesh, plan),
            Solver::March => {
                let occupancy = setup.eliminate(medium, plan);
                setup.project(medium, occupancy, plan)
            }
        };
        let out = setup.relight(records, emission_records, plan);
        let spec = FieldSpec::dense(setup.cells, setup.layers, FieldFormat::Rgba);
        let field = plan.publish("in-scatter", out, spec);
        let trilinear = self.interpolation == Interpolation::Trilinear;
        sources.field = Some(InScatter { field, cells: setup.cells, bands: setup.bands, trilinear });
        Ok(())
    }
}

impl Records {
    /// Cells along each axis of a box of `lengths` (metres): `cells` along the longest.
    pub fn grid(&self, lengths: DVec3) -> [u32; 3] {
        super::grid(self.cells, lengths)
    }
}

/// Sizes that all stages of one record grid share.
struct Setup<'a> {
    options: &'a Records,
    scene: &'a Scene,
    nside: u32,
    cells: [u32; 3],
    /// Bands that are computed: of the light, or as far as the phase function reaches. One with discrete functions,
    /// which the march knows nothing of.
    bands: u32,
    /// How many discrete functions hold the light in place of the bands.
    discrete: Option<u32>,
    layers: u32,
    channels: u32,
    weight_channels: u32,
    emission_coefficients: u32,
}

impl<'a> Setup<'a> {
    fn new(options: &'a Records, scene: &'a Scene, medium: &MediumFields) -> Self {
        let optics = &scene.optics;
        let lattice = scene.medium.lattice();
        let radiance = options.content == Content::Radiance;
        // Bands past the phase function's reach are multiplied by zero; without light there is only emission.
        let lit = radiance || scene.environment.is_some();
        let (bands, discrete) = match options.basis {
            RecordBasis::Discrete(functions) if lit => (1, Some(functions)),
            RecordBasis::Harmonics if lit => (options.bands_of(&optics.phase), None),
            _ => (1, None),
        };
        let layers = if radiance { bands * bands } else { 1 };
        Self {
            options,
            scene,
            nside: options.nside().expect("validated with the scene"),
            cells: options.grid(lattice.edges() * lattice.dims().as_dvec3()),
            bands,
            discrete,
            layers,
            channels: if optics.is_grey() { 1 } else { 3 },
            weight_channels: if radiance { 3 } else { 1 },
            emission_coefficients: if medium.emission.is_on() { layers } else { 0 },
        }
    }

    fn cell_count(&self) -> u64 {
        self.cells.iter().map(|&c| u64::from(c)).product()
    }

    fn coefficients(&self) -> u32 {
        self.discrete.unwrap_or(self.bands * self.bands)
    }

    fn harmonics(&self) -> SphericalHarmonics {
        SphericalHarmonics::new(self.bands).expect("validated with the scene")
    }

    /// The functions b_k.
    fn basis(&self) -> Box<dyn Basis> {
        match self.discrete {
            Some(functions) => Box::new(DiscreteSpherical::new(functions).expect("validated with the scene")),
            None => Box::new(self.harmonics()),
        }
    }

    /// Voxels of a cell along x, y and z, and a fourth value.
    fn cell(&self, medium: &MediumFields, w: f32) -> [f32; 4] {
        let side = |a: usize| medium.grid.dims[a] as f32 / self.cells[a] as f32;
        [side(0), side(1), side(2), w]
    }

    /// Which cells can matter to a sample with density.
    fn eliminate(&self, medium: &MediumFields, plan: &mut Plan<'a>) -> Option<Buf<[f32; 2]>> {
        let (probes, margin) = match (self.options.elimination, self.options.interpolation) {
            (Elimination::None, _) => return None,
            (Elimination::Probes(n), _) => (n, 0.0),
            // A trilinear lookup reads the records of all cells whose centre is less than one cell away.
            (Elimination::Exact, Interpolation::Trilinear) => (0, 0.5),
            (Elimination::Exact, Interpolation::Nearest) => (0, 0.0),
        };
        let out = plan.work("record occupancy", self.cell_count());
        plan.stage(Stage::Reduce(Reduce {
            params: ReduceParams::new(
                medium.grid.dims,
                [self.cells[0], self.cells[1], self.cells[2], probes],
                self.cell(medium, margin),
            ),
            density: medium.density,
            other: None,
            out,
        }));
        Some(out)
    }

    /// Everything the light's share of the tables depends on, for their keys.
    fn light_key(&self) -> impl std::hash::Hash + use<> {
        let light = self.scene.environment.as_ref();
        let light = light.map(|e| (e.version(), e.scale.to_array().map(f32::to_bits), e.rotation.to_bits()));
        (light, self.nside, self.bands, self.discrete, self.options.content as u32)
    }

    /// The environment whose light the directions follow, where they do.
    fn followed(&self) -> Option<&'a Environment> {
        self.scene.environment.as_ref().filter(|_| self.options.content == Content::Radiance)
    }

    /// What the directions depend on.
    fn directions_key(&self) -> impl std::hash::Hash + use<> {
        (self.nside, self.followed().map(|_| self.light_key()))
    }

    fn directions(&self, plan: &mut Plan<'a>) -> Buf<[f32; 4]> {
        let (nside, followed) = (self.nside, self.followed());
        plan.upload("directions", self.options.directions.into(), &self.directions_key(), move || {
            directions(nside, followed).iter().map(|d| d.as_vec3().extend(0.0).to_array()).collect()
        })
    }

    /// Records by sweeps: the same moments, and the emission's by a second sweep.
    fn sweep(
        &self,
        medium: &MediumFields,
        mesh: Option<MeshBuffers>,
        plan: &mut Plan<'a>,
    ) -> (Buf<f32>, Option<Buf<f32>>) {
        let (scene, cells) = (self.scene, self.cells);
        let mut ordinates = Ordinates { scene, medium: *medium, cells, obstructed: None };
        ordinates.obstruct("record obstructions", mesh, plan);
        let optics = ordinates.coarsen("record cells", 0.0, plan);
        let (nside, followed) = (self.nside, self.followed());
        let ways = ordinates.directions(
            "record ways",
            self.options.directions,
            &self.directions_key(),
            move || directions(nside, followed),
            plan,
        );
        let grey = self.scene.optics.is_grey();
        let of = Carried {
            optics,
            directions: ways,
            channels: self.channels,
            grey,
            boundary: 1.0,
            emits: false,
            sources: None,
            weights: (self.weights(plan), self.weight_channels),
            coefficients: self.coefficients(),
            planar: false,
        };
        let values = u64::from(self.coefficients() * self.channels.max(self.weight_channels));
        let records = plan.work("records", self.cell_count().saturating_mul(values));
        let stage = ordinates.sweep("records", of, records, plan);
        plan.stage(Stage::Sweep(stage));
        let emitted = self.emission_weights(plan).map(|weights| {
            let (coefficients, channels) = (self.emission_coefficients, 3);
            let of = Carried { channels, boundary: 0.0, emits: true, weights: (weights, 1), coefficients, ..of };
            let records = plan.work("emission records", self.cell_count().saturating_mul((coefficients * 3).into()));
            let stage = ordinates.sweep("emission records", of, records, plan);
            plan.stage(Stage::Sweep(stage));
            records
        });
        (records, emitted)
    }

    fn weights(&self, plan: &mut Plan<'a>) -> Buf<f32> {
        let (nside, basis, scene) = (self.nside, self.basis(), self.scene);
        let len = u64::from(self.options.directions) * u64::from(self.coefficients() * self.weight_channels);
        if self.options.content == Content::Radiance {
            plan.upload("direction weights", len, &self.light_key(), move || match &scene.environment {
                Some(e) => e.pixel_moments(nside, &*basis).iter().flatten().map(|&v| v as f32).collect(),
                None => vec![0.0; len as usize],
            })
        } else {
            plan.upload("direction weights", len, &(nside, self.bands, self.discrete), move || {
                pixel_integrals(nside, &*basis).iter().map(|&v| v as f32).collect()
            })
        }
    }

    /// Over each direction's pixel: its solid angle, or the integrals of the spherical harmonics.
    fn emission_weights(&self, plan: &mut Plan<'a>) -> Option<Buf<f32>> {
        let (nside, harmonics, directions) = (self.nside, self.harmonics(), self.options.directions);
        let len = u64::from(directions * self.emission_coefficients);
        let moments = self.options.content == Content::Radiance;
        (self.emission_coefficients > 0).then(|| {
            plan.upload("emission weights", len, &(nside, self.bands, moments), move || {
                if moments {
                    pixel_integrals(nside, &harmonics).iter().map(|&v| v as f32).collect()
                } else {
                    vec![(4.0 * PI / f64::from(directions)) as f32; len as usize]
                }
            })
        })
    }

    fn project(
        &self,
        medium: &MediumFields,
        occupancy: Option<Buf<[f32; 2]>>,
        plan: &mut Plan<'a>,
    ) -> (Buf<f32>, Option<Buf<f32>>) {
        let optics = &self.scene.optics;
        let toward_eye = self.options.content == Content::Phase;
        let mut params: ProjectParams = bytemuck::Zeroable::zeroed();
        params.dims = medium.grid.dims;
        [params.index_x, params.index_y, params.index_z] = medium.grid.index;
        [params.world_x, params.world_y, params.world_z] = medium.grid.world;
        params.cells = [self.cells[0], self.cells[1], self.cells[2], 0];
        params.cell = self.cell(medium, medium.step);
        params.extinction = optics.extinction.extend(0.0).to_array();
        params.emission = optics.emission.extend(0.0).to_array();
        params.direction_end = self.options.directions;
        params.coefficients = self.coefficients();
        (params.channels, params.weight_channels) = (self.channels, self.weight_channels);
        params.emission_coefficients = self.emission_coefficients;
        let mut phase_table = None;
        // Only records that look at the eye may change with it.
        if toward_eye {
            let eye = self.scene.medium.lattice().world_to_index().transform_point3(self.scene.camera.origin);
            params.eye = eye.as_vec3().extend(0.0).to_array();
            let phase = PhaseParams::new(&optics.phase);
            (params.toward_eye, params.phase_kind, params.phase) = (1, phase.kind, phase.lobes);
            phase_table = (!phase.table.is_empty()).then(|| plan.table("phase table", phase.table));
        }
        let records = self.cell_count() * u64::from(self.coefficients() * params.record_channels());
        let emission = self.cell_count() * u64::from(self.emission_coefficients) * 3;
        let project = Project {
            params,
            density: medium.density,
            emission: medium.emission.density(),
            emission_color: medium.emission.color(),
            occupancy,
            directions: self.directions(plan),
            weights: self.weights(plan),
            emission_weights: self.emission_weights(plan),
            phase_table,
            records: plan.work("records", records),
            emission_records: (emission > 0).then(|| plan.work("emission records", emission)),
        };
        let out = (project.records, project.emission_records);
        plan.stage(Stage::Project(project));
        out
    }

    fn relight(&self, records: Buf<f32>, emission_records: Option<Buf<f32>>, plan: &mut Plan<'a>) -> Buf<[f32; 4]> {
        let (content, scene, bands, discrete) = (self.options.content, self.scene, self.bands, self.discrete);
        let (harmonics, basis) = (self.harmonics(), self.basis());
        let window = self.options.window_factors(&scene.optics.phase);
        let (light, emission_weight) = if content == Content::Radiance {
            let moments = scene.optics.phase.moments(bands);
            let single = if self.layers == 1 { Y0 } else { 1.0 };
            let beta = moments.iter().enumerate().flat_map(|(l, &beta)| vec![beta * single; 2 * l + 1]);
            (plan.table("light", beta.zip(window).map(|(beta, f)| [(beta * f) as f32; 4]).collect()), Y0)
        } else {
            let norm = if content == Content::Transmittance { 1.0 / (4.0 * PI) } else { 1.0 };
            let key = (self.light_key(), self.options.window);
            let light = plan.upload("light", self.coefficients().into(), &key, move || {
                let light: Vec<[f64; 3]> = match &scene.environment {
                    Some(e) if discrete.is_some() => e.coefficients(&*basis),
                    Some(e) => e.project_sh(&harmonics).iter().zip(window).map(|(c, f)| c.map(|v| v * f)).collect(),
                    None => vec![[0.0; 3]; basis.count()],
                };
                light.iter().map(|c| c.map(|v| (v * norm) as f32)).map(|[r, g, b]| [r, g, b, 0.0]).collect()
            });
            (light, norm)
        };
        let out = plan.work("relit", self.cell_count() * u64::from(self.layers));
        plan.stage(Stage::Relight(Relight {
            params: RelightParams {
                cells: self.cell_count() as u32,
                coefficients: self.coefficients(),
                channels: self.channels.max(self.weight_channels),
                layers: self.layers,
                emission_coefficients: self.emission_coefficients,
                emission_weight: emission_weight as f32,
                planar: 0,
                unused: 0,
            },
            records,
            emission_records,
            light,
            out,
        }));
        out
    }
}

/// The pixels' centres, or the mean directions of an environment's light in them.
fn directions(nside: u32, followed: Option<&Environment>) -> Vec<DVec3> {
    followed.map_or_else(|| healpix::directions(nside), |environment| environment.pixel_centroids(nside))
}
