//! `march`: view rays through the medium. The one integrator of every estimator.
//!
//! Per pixel and sub-pixel position the ray is clipped to the box and to the surface in front, and takes
//! n = ceil(length / step), or `steps`, equal steps Δ. They are sampled at their middles, or, jittered, all at one place
//! ξ = fract(tile + offset of the sub-pixel position + `jitter_offset`), the tile repeated over the film. With
//! σt = ρ · `extinction` and e = exp(-σt Δ),
//!
//! L += T ⊙ (1-e) ⊙ (σs ⊙ J + j)/σt (the limit T ⊙ j Δ where σt is zero), T ⊙= e, until max T < `cut`.
//!
//! σs is ρs · `extinction` · `albedo` and j is ρe · `emission`; ρs and ρe are ρ, unless there are fields of their own.
//!
//! J is the sum of what the estimators prepared: `in_scatter`, a field over the record cells of one layer, or of
//! bands² layers that are weighed with Y_k(d) of the ray's direction; `scattered`, another such field, always trilinear; and `lights`, each with phase, falloff and the
//! medium's own shadow: exp(-`light_extinction` · column), the column marched, or trilinear from `light_depth`. Surfaces shadow them
//! by a ray through `mesh`, or by four comparisons with `shadow_map` that are interpolated. Space that `occupancy` shows empty is stepped over without moving a sample.
//!
//! With `phong`, ambient ka, diffuse kd, specular ks and shininess m, a light's phase function gives way to what a surface would
//! send on: ka/4π + max(n·l, 0) (kd/π + ks (m + 2)/2π max(r·v, 0)ᵐ), 1/sr, with l toward the light, r its mirror image, v toward the
//! eye, and n the unit vector against the density's gradient, from central differences over a voxel along each axis of the lattice. It
//! is zero where the density changes by no more than [`March::FLAT`] of itself.
//!
//! Behind the medium lie, each times T: the surface's radiance where there is one, else the visible environment.
//!
//! The film is two vectors a pixel: premultiplied RGB and alpha = 1 - mean T; transmittance RGB and the mean
//! distance of what the medium stops, infinite where it stops nothing. Both are means over the sub-pixel positions.
//!
//! Of the medium `alone` nothing behind it is added, and the surface's distance, at most [`FAR`](crate::stage::FAR), stands in alpha's
//! place. Such a film may be smaller than the picture, by `scale` along each side: the ray of pixel (x, y) is that of
//! pixel (min(x·`scale` + `scale`/2, `full_width` - 1), …) of the full picture, whose surface ends it.
//!
//! Of such a film only what lies near rims may be marched ([`alone::RIMS`]): pixels where, of the surfaces of five by
//! five pixels of the film around, the nearest is nearer than [`March::RIM`] of the farthest. All others are left black
//! and clear, with [`March::UNMARCHED`] in alpha's place.
//!
//! The work axis is the blocks of 8×8 pixels, row by row.
//!
//! In passes, the film holds sums until the last one: RGB and the distance's weight, transmittance and the weighted
//! distance. A pass takes some sub-pixel positions, or, with `paths`, some steps of one.

use std::ops::Range;

use crate::basis::SphericalHarmonics;
use crate::blue_noise;
use crate::device::{Binding, Buf, Field, FieldFormat, FieldSpec, ResourceId};
use crate::kernel_struct;
use crate::stage::grid::{covers, is_medium, most_steps};
use crate::stage::trace::holds;
use crate::stage::upsample::{is_sky, is_small};
use crate::stage::{Kernel, MeshRecord, PhaseParams, require, surface_shadow};

kernel_struct! {
    /// Parameters of `march`.
    pub struct MarchParams {
        /// Samples of the density along x, y, z; unused.
        dims: U32x4,
        /// Row of the linear map from metres to voxels.
        index_x: F32x4,
        /// See `index_x`.
        index_y: F32x4,
        /// See `index_x`.
        index_z: F32x4,
        /// The eye in index space; unused.
        eye: F32x4,
        /// Axis f of the camera: the ray through (a, b) ∈ \[-1, 1\]² goes along f + a r + b u.
        forward: F32x4,
        /// Axis r, times the half width of the picture at distance 1.
        right: F32x4,
        /// Axis u, times the half height.
        up: F32x4,
        /// Extinction per unit of density, 1/m, RGB; unused.
        extinction: F32x4,
        /// The same on the way to lights, which may be that of a similar medium.
        light_extinction: F32x4,
        /// Albedo, RGB; unused.
        albedo: F32x4,
        /// Emission per unit of emission density, W m⁻³ sr⁻¹, RGB; unused.
        emission: F32x4,
        /// Parameters of the phase function.
        phase: F32x4,
        /// Light from lights as a surface sends it on, in place of the phase function: ambient, diffuse and specular reflectance,
        /// and shininess, which is 0 where the phase function stands.
        phong: F32x4,
        /// Multiplies the environment, RGB; its rotation in turns.
        environment: F32x4,
        /// Texels of the environment's field along x, y, z; unused.
        environment_dims: U32x4,
        /// Occupancy cells along x, y, z; voxels of a cell's side.
        occupancy_cells: U32x4,
        /// Record cells along x, y, z; layers.
        cells: U32x4,
        /// Record cells per voxel along x, y, z; unused.
        cells_per_voxel: F32x4,
        /// Cells of the lights' field along x, y, z; layers, each of four lights.
        light_cells: U32x4,
        /// The same cells per voxel along x, y, z; unused.
        light_cells_per_voxel: F32x4,
        /// The eye from the mesh's origin; the mesh's extent: metres.
        mesh_eye: F32x4,
        /// Cells of the light that was scattered before along x, y, z; layers.
        scattered_cells: U32x4,
        /// The same cells per voxel along x, y, z; unused.
        scattered_cells_per_voxel: F32x4,
        /// Columns of the picture.
        width: U32,
        /// Rows of the picture.
        height: U32,
        /// Sub-pixel positions.
        samples: U32,
        /// Lights.
        lights: U32,
        /// The longest step, metres.
        step: F32,
        /// Transmittance below which a ray ends.
        cut: F32,
        /// Floor of r² in 1/r², m².
        light_floor: F32,
        /// Kind of the phase function.
        phase_kind: U32,
        /// The most bands of layered in-scatter.
        bands: U32,
        /// 1 for trilinear records, 0 for the nearest.
        trilinear: U32,
        /// The medium's own shadow: a constant of [`shadow_kind`].
        shadow: U32,
        /// Columns of the environment.
        environment_width: U32,
        /// Rows of the environment.
        environment_height: U32,
        /// Where the spherical harmonics' constants begin in `tables`.
        harmonics_at: U32,
        /// Where the phase function's table begins in `tables`.
        phase_at: U32,
        /// Entries of the phase function's table.
        phase_size: U32,
        /// First sub-pixel position of this pass.
        sample_begin: U32,
        /// One past the last sub-pixel position of this pass.
        sample_end: U32,
        /// First step of this pass.
        step_begin: U32,
        /// One past the last step of this pass; [`March::ALL_STEPS`] where rays end in it.
        step_end: U32,
        /// Vectors of `surface` a pixel: 1, or one for each sub-pixel position.
        surface_samples: U32,
        /// How surfaces shadow lights: a constant of [`surface_shadow`].
        surface_shadow: U32,
        /// Boxes of the mesh.
        nodes: U32,
        /// Texels along each side of a face of the lights' maps.
        map_side: U32,
        /// Steps of every view ray; 0 where `step` bounds their length.
        steps: U32,
        /// 1 where samples lie at places of their own within their steps, 0 where they lie in the middle.
        jittered: U32,
        /// Where those places begin in `tables`.
        jitter_at: U32,
        /// What this picture adds to them.
        jitter_offset: F32,
        /// Pixels of the full picture along each side of a pixel of the film.
        scale: U32,
        /// Columns of the full picture.
        full_width: U32,
        /// Rows of the full picture.
        full_height: U32,
        /// What the film holds: a constant of [`alone`].
        alone: U32,
        /// Lights that are spots: kernels that run both sides of conditions leave cones out where there is none.
        spots: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

/// Whether the film of `march` is of the medium alone.
pub mod alone {
    /// It is the picture.
    pub const NO: u32 = 0;
    /// It is of the medium alone, as `upsample` takes it.
    pub const ALL: u32 = 1;
    /// The same, marched near rims alone.
    pub const RIMS: u32 = 2;
}

/// How a light in `march` is shadowed by the medium.
pub mod shadow_kind {
    /// Not at all.
    pub const NONE: u32 = 0;
    /// By a march toward the light.
    pub const MARCH: u32 = 1;
    /// By a field of columns, as [`propagate`](crate::stage::propagate) leaves them.
    pub const COLUMN: u32 = 2;
    /// By a field of mean densities along the way, times the way's length within the box.
    pub const MEAN: u32 = 3;
}

kernel_struct! {
    /// A light as kernels see it.
    pub struct LightRecord {
        /// Toward the light (`position.w` = 0), or from the eye to it in metres (`position.w` = 1).
        position: F32x4,
        /// Irradiance, or intensity, RGB; number of the first face of its map.
        power: F32x4,
        /// Axis of a spot; unused.
        axis: F32x4,
        /// Half angles of full and of no intensity, radians; 1 for a spot, else 0; half width at distance 1 of the one face
        /// of its map, or 0 where it has another.
        cone: F32x4,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct March {
    /// Parameters.
    pub params: MarchParams,
    /// Density ρ.
    pub density: Field,
    /// The density that scatters, ρs, RGB; unused; where it is not ρ.
    pub scattering: Option<Field>,
    /// Emission density ρe, where it is not ρ.
    pub emission: Option<Field>,
    /// Emission density with a colour, RGB; unused; in place of ρe.
    pub emission_color: Option<Field>,
    /// In-scattered radiance at the record cells.
    pub in_scatter: Option<Field>,
    /// In-scattered radiance of light that was scattered before, at cells of its own.
    pub scattered: Option<Field>,
    /// Columns or mean densities toward the lights, four to a layer.
    pub light_depth: Option<Field>,
    /// Mean and maximum of each occupancy cell, from `reduce`.
    pub occupancy: Option<Buf<[f32; 2]>>,
    /// Lights.
    pub lights: Option<Buf<LightRecord>>,
    /// Sub-pixel positions (two values each), then constants of spherical harmonics, the phase function's table, and of
    /// jittered samples the offset of each sub-pixel position and the tile of [`blue_noise`](crate::blue_noise).
    pub tables: Buf<f32>,
    /// Texels of the environment, RGB; unused; row by row, folded into a field ([`fold`](crate::device::fold)). None
    /// where it is not seen.
    pub environment: Option<Field>,
    /// Radiance of the surface behind each pixel of the full picture, or each of its sub-pixel positions, RGB, and its
    /// distance along the ray in metres (infinite for none).
    pub surface: Option<Buf<[f32; 4]>>,
    /// Boxes and triangles that shadow lights.
    pub mesh: Option<Buf<MeshRecord>>,
    /// How far lights reach, from `shadow`.
    pub shadow_map: Option<Buf<f32>>,
    /// Where rays are kept between passes, two vectors a pixel, whose last parts are the device's own: radiance and light
    /// stopped so far, transmittance and the same weighed with where it is. Needed only where a pass is a part of a ray.
    pub paths: Option<Buf<[f32; 4]>>,
    /// Two vectors a pixel.
    pub film: Buf<[f32; 4]>,
}

impl March {
    /// Pixels along each side of a block of the work axis.
    pub const BLOCK: u32 = 8;
    /// Transmittance below which a ray ends.
    pub const CUT: f32 = 1e-4;
    /// Of two surfaces with a rim between them, the nearer is nearer than this part of the farther: where
    /// [`Upsample`](crate::stage::Upsample) begins to tell them apart.
    pub const RIM: f32 = 0.95;
    /// The part of the density around a point by which it must change over two voxels to have a normal: what f32 loses is far
    /// less.
    pub const FLAT: f32 = 1e-5;
    /// What stands in place of a surface's distance where nothing was marched.
    pub const UNMARCHED: f32 = -1.0;

    /// `step_end` of a pass in which rays end.
    pub const ALL_STEPS: u32 = u32::MAX;

    /// Whether keeping to `turns` turns of all loops takes passes that are parts of rays, and so [`March::paths`].
    pub fn keeps_paths(&self, turns: u64) -> bool {
        self.turns().ray() >= turns
    }

    fn turns(&self) -> Turns {
        let p = &self.params;
        let longest = most_steps(p.dims, [p.index_x, p.index_y, p.index_z], p.step);
        let steps = if p.steps > 0 { p.steps.into() } else { longest };
        let of = |cells: [u32; 4]| if cells[3] > 1 { u64::from(cells[3]) } else { 0 };
        let layers = of(p.cells) + of(p.scattered_cells);
        let column = if p.shadow == shadow_kind::MARCH { longest } else { 0 };
        let way = match (p.surface_shadow, self.mesh) {
            (surface_shadow::RAY, Some(mesh)) => MeshRecord::turns(p.nodes.into(), p.nodes, mesh.len),
            (surface_shadow::MAP, _) => 4,
            _ => 0,
        };
        // Of a step: itself, the channels, the layers, the lights with their ways and columns.
        let light = column.saturating_add(way).saturating_add(1);
        let step = (layers + 4).saturating_add(u64::from(p.lights).saturating_mul(light));
        // Of a ray: itself, the surfaces around it and the harmonics of its direction, one turn a coefficient and two a
        // band at the most.
        let coefficients = if layers > 0 { u64::from(p.bands) * u64::from(p.bands) } else { 0 };
        let around = if p.alone == alone::RIMS { 25 } else { 0 };
        Turns { steps, step, ray: 1 + around + coefficients + 2 * u64::from(p.bands) }
    }

    /// Blocks along x and y.
    pub fn blocks(&self) -> [u32; 2] {
        [self.params.width.div_ceil(Self::BLOCK), self.params.height.div_ceil(Self::BLOCK)]
    }
}

/// How often loops turn, at the most.
#[derive(Clone, Copy, Debug)]
struct Turns {
    /// Steps of a ray.
    steps: u64,
    /// Turns a step.
    step: u64,
    /// Turns a ray beside its steps.
    ray: u64,
}

impl Turns {
    /// Of a whole ray.
    fn ray(self) -> u64 {
        self.steps.saturating_mul(self.step).saturating_add(self.ray)
    }
}

impl Kernel for March {
    const NAME: &'static str = "march";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let p = &self.params;
        let row = u64::from(Self::BLOCK) * u64::from(p.width);
        let full_row = u64::from(Self::BLOCK) * u64::from(p.scale) * u64::from(p.full_width);
        let mut surface = Binding::read("surface", self.surface);
        // Near rims those of the pixels around are read too.
        if p.alone != alone::RIMS {
            surface = surface.in_parts::<[f32; 4]>(full_row * u64::from(p.surface_samples));
        }
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::sample("scattering", FieldFormat::Rgba, self.scattering),
            Binding::sample("emission_density", FieldFormat::Scalar, self.emission),
            Binding::sample("emission_color", FieldFormat::Rgba, self.emission_color),
            Binding::sample("in_scatter", FieldFormat::Rgba, self.in_scatter),
            Binding::sample("scattered", FieldFormat::Rgba, self.scattered),
            Binding::sample("light_depth", FieldFormat::Rgba, self.light_depth),
            Binding::read("occupancy", self.occupancy),
            Binding::read("lights", self.lights),
            Binding::read("tables", Some(self.tables)),
            Binding::sample("environment", FieldFormat::Rgba, self.environment),
            surface,
            Binding::read("mesh", self.mesh),
            Binding::read("shadow_map", self.shadow_map),
            Binding::write("paths", self.paths).in_parts::<[f32; 4]>(2 * row),
            Binding::write("film", Some(self.film)).in_parts::<[f32; 4]>(2 * row),
        ]
    }

    fn axis(&self) -> u32 {
        let [x, y] = self.blocks();
        x * y
    }

    fn group(&self) -> u32 {
        self.blocks()[0]
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_medium(&self.density, self.scattering, self.emission, self.emission_color, p.dims)?;
        require!(p.step.is_finite() && p.step > 0.0, "a step of {} m", p.step);
        let pixels = u64::from(p.width) * u64::from(p.height);
        require!(pixels > 0 && u32::try_from(pixels).is_ok(), "a picture of {} × {}", p.width, p.height);
        require!(self.film.len >= 2 * pixels, "a film of {} vectors for {pixels} pixels", self.film.len);
        let full = u64::from(p.full_width) * u64::from(p.full_height);
        is_small([p.width, p.height], [p.full_width, p.full_height], p.scale)?;
        require!(p.alone <= alone::RIMS, "a film of kind {}", p.alone);
        let near = p.alone != alone::RIMS || (p.samples == 1 && self.surface.is_some());
        require!(near, "rims of {} samples, or without surfaces", p.samples);
        if let Some(surface) = self.surface {
            let each = p.surface_samples;
            require!(each == 1 || each == p.samples, "surfaces of {each} positions for {} samples", p.samples);
            require!(surface.len >= full.saturating_mul(each.into()), "surfaces of fewer than {full} pixels");
        }
        if let Some(occupancy) = self.occupancy {
            covers("occupancy", occupancy, p.occupancy_cells, p.dims)?;
        }
        let mut table = 2 * u64::from(p.samples);
        require!(p.samples > 0, "no samples");
        let (samples, steps) = (p.sample_begin..p.sample_end, p.step_begin..p.step_end);
        require!(!samples.is_empty() && samples.end <= p.samples, "samples {samples:?} of {}", p.samples);
        require!(!steps.is_empty(), "steps {steps:?}");
        require!(self.paths.is_none_or(|b| b.len >= 2 * pixels), "paths of fewer than {pixels} pixels");
        let whole = steps == (0..Self::ALL_STEPS);
        require!(
            whole || (samples.len() == 1 && self.paths.is_some()),
            "a part of {} rays without paths",
            samples.len()
        );
        for (field, of) in [(self.in_scatter, p.cells), (self.scattered, p.scattered_cells)] {
            let Some(Field { spec, .. }) = field else { continue };
            let [cells @ .., layers] = of;
            require!(spec.dims == cells && spec.layers == layers, "in-scatter of {spec:?} for {of:?}");
            require!(spec.format == FieldFormat::Rgba && layers > 0, "in-scatter of {spec:?}");
            if layers > 1 {
                let most = SphericalHarmonics::DEVICE_BANDS;
                require!(p.bands <= most, "{} bands; kernels hold {most}", p.bands);
                require!(p.bands * p.bands >= layers, "{} bands for {layers} layers", p.bands);
                let triangle = u64::from(p.bands) * u64::from(p.bands + 1) / 2;
                table = table.max(u64::from(p.harmonics_at) + 2 * triangle);
            }
        }
        require!(
            p.lights == 0 || self.lights.is_some_and(|b| b.len >= p.lights.into()),
            "fewer than {} lights",
            p.lights
        );
        require!(p.shadow <= shadow_kind::MEAN, "shadow kind {}", p.shadow);
        if p.lights > 0 && p.shadow >= shadow_kind::COLUMN {
            let [cells @ .., layers] = p.light_cells;
            let spec = FieldSpec::dense(cells, layers, FieldFormat::Rgba);
            let found = self.light_depth.map(|field| field.spec);
            require!(found == Some(spec), "depths of lights in {found:?} for {:?}", p.light_cells);
            require!(u64::from(layers) * 4 >= p.lights.into(), "{layers} layers of depths for {} lights", p.lights);
        }
        require!(p.surface_shadow <= surface_shadow::RAY, "shadows of surfaces of kind {}", p.surface_shadow);
        if p.lights > 0 && p.surface_shadow == surface_shadow::MAP {
            // Lights say themselves where their faces are: the plan that made both sees to it.
            let face = u64::from(p.map_side).pow(2);
            let held = self.shadow_map.map_or(0, |map| map.len);
            require!(face > 0 && held >= face, "a map of {held} texels for faces of {face}");
        }
        if p.lights > 0 && p.surface_shadow == surface_shadow::RAY {
            holds(self.mesh.unwrap_or(Buf::new(ResourceId(0), 0)), p.nodes)?;
        }
        require!(p.phong.iter().all(|k| k.is_finite() && *k >= 0.0), "reflectances and shininess {:?}", p.phong);
        if p.phase_kind == PhaseParams::TABLE {
            require!(p.phase_size >= 2, "a phase table of {} entries", p.phase_size);
            table = table.max(u64::from(p.phase_at) + u64::from(p.phase_size));
        }
        if p.jittered == 1 {
            let tile = u64::from(blue_noise::SIDE).pow(2);
            table = table.max(u64::from(p.jitter_at) + u64::from(p.samples) + tile);
            require!((0.0..1.0).contains(&p.jitter_offset), "a jitter offset of {}", p.jitter_offset);
        }
        require!(self.tables.len >= table, "tables of {} values for {table}", self.tables.len);
        if let Some(environment) = self.environment {
            is_sky(&environment, p.environment_dims, [p.environment_width, p.environment_height])?;
        }
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let (each, samples) = (self.turns(), self.params.samples);
        let pass = |samples: Range<u32>, steps: Range<u32>| {
            let mut pass = self.clone();
            (pass.params.sample_begin, pass.params.sample_end) = (samples.start, samples.end);
            (pass.params.step_begin, pass.params.step_end) = (steps.start, steps.end);
            pass
        };
        // The loop over the samples turns too.
        let rays = turns / each.ray().saturating_add(1);
        if rays > 0 {
            let rays = rays.min(samples.into()) as u32;
            let begins = (0..samples).step_by(rays as usize);
            return Ok(begins.map(|s| pass(s..(s + rays).min(samples), 0..Self::ALL_STEPS)).collect());
        }
        let steps = turns.saturating_sub(each.ray + 1) / each.step;
        require!(
            steps > 0,
            "one view step takes up to {} turns of loops, and {turns} are allowed: fewer lights, a longer step or a \
             smaller medium need less",
            each.step
        );
        require!(self.paths.is_some(), "rays of up to {} turns of loops, without paths", each.ray());
        require!(each.steps < u64::from(Self::ALL_STEPS), "rays of up to {} steps", each.steps);
        let begins = || (0..each.steps).step_by(steps as usize).map(|k| k as u32);
        let end = |k: u32| if u64::from(k) + steps >= each.steps { Self::ALL_STEPS } else { k + steps as u32 };
        Ok((0..samples).flat_map(|s| begins().map(move |k| (s, k))).map(|(s, k)| pass(s..s + 1, k..end(k))).collect())
    }
}

#[cfg(test)]
mod tests;
