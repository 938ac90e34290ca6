//! `march`: view rays through the medium. The one integrator of every estimator.
//!
//! Per pixel and sub-pixel position the ray is clipped to the box and to the surface in front, and takes
//! n = ceil(length / step) equal steps Δ, sampled at their middles. With σt = ρ · `extinction` and e = exp(-σt Δ),
//!
//! L += T ⊙ (1-e) ⊙ (albedo ⊙ J + j/σt) (the limit T ⊙ j Δ where σt is zero), T ⊙= e, until max T < `cut`.
//!
//! J is the sum of what the estimators prepared: `in_scatter`, a field over the record cells of one layer, or of
//! bands² layers that are weighed with Y_k(d) of the ray's direction; and `lights`, each with phase, falloff and the
//! medium's own shadow. Space that `occupancy` shows empty is stepped over without moving a sample.
//!
//! Behind the medium lie, each times T: the surface's radiance where there is one, else the visible environment.
//!
//! The film is two vectors a pixel: premultiplied RGB and alpha = 1 - mean T; transmittance RGB and the mean
//! distance of what the medium stops, infinite where it stops nothing. Both are means over the sub-pixel positions.
//!
//! The work axis is the blocks of 8×8 pixels, row by row.

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::is_scalar;
use crate::stage::{Kernel, PhaseParams, require};

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
        /// Albedo, RGB; unused.
        albedo: F32x4,
        /// Emission per unit of emission density, W m⁻³ sr⁻¹, RGB; unused.
        emission: F32x4,
        /// Parameters of the phase function.
        phase: F32x4,
        /// Multiplies the environment, RGB; its rotation in turns.
        environment: F32x4,
        /// Occupancy cells along x, y, z; voxels of a cell's side.
        occupancy_cells: U32x4,
        /// Record cells along x, y, z; layers.
        cells: U32x4,
        /// Record cells per voxel along x, y, z; unused.
        cells_per_voxel: F32x4,
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
        /// Bands of the layered in-scatter.
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
    }
}

/// How a light in `march` is shadowed by the medium.
pub mod shadow_kind {
    /// Not at all.
    pub const NONE: u32 = 0;
    /// By a march toward the light.
    pub const MARCH: u32 = 1;
}

kernel_struct! {
    /// A light as kernels see it.
    pub struct LightRecord {
        /// Toward the light (`position.w` = 0), or from the eye to it in metres (`position.w` = 1).
        position: F32x4,
        /// Irradiance, or intensity, RGB; unused.
        power: F32x4,
        /// Axis of a spot; unused.
        axis: F32x4,
        /// Half angles of full and of no intensity, radians; 1 for a spot, else 0; unused.
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
    /// Emission density ρe, where it is not ρ.
    pub emission: Option<Field>,
    /// In-scattered radiance at the record cells.
    pub in_scatter: Option<Field>,
    /// Mean and maximum of each occupancy cell, from `reduce`.
    pub occupancy: Option<Buf<[f32; 2]>>,
    /// Lights.
    pub lights: Option<Buf<LightRecord>>,
    /// Sub-pixel positions (two values each), then constants of spherical harmonics, then the phase function's table.
    pub tables: Buf<f32>,
    /// Texels of the environment, RGB; unused; none where it is not seen.
    pub environment: Option<Buf<[f32; 4]>>,
    /// Radiance of the surface behind each pixel, RGB, and its distance along the ray in metres (infinite for none).
    pub surface: Option<Buf<[f32; 4]>>,
    /// Two vectors a pixel.
    pub film: Buf<[f32; 4]>,
}

impl March {
    /// Pixels along each side of a block of the work axis.
    pub const BLOCK: u32 = 8;
    /// Transmittance below which a ray ends.
    pub const CUT: f32 = 1e-4;

    /// Blocks along x and y.
    pub fn blocks(&self) -> [u32; 2] {
        [self.params.width.div_ceil(Self::BLOCK), self.params.height.div_ceil(Self::BLOCK)]
    }
}

impl Kernel for March {
    const NAME: &'static str = "march";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let row = u64::from(Self::BLOCK) * u64::from(self.params.width);
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::sample("emission_density", FieldFormat::Scalar, self.emission),
            Binding::sample("in_scatter", FieldFormat::Rgba, self.in_scatter),
            Binding::read("occupancy", self.occupancy),
            Binding::read("lights", self.lights),
            Binding::read("tables", Some(self.tables)),
            Binding::read("environment", self.environment),
            Binding::read("surface", self.surface).in_parts::<[f32; 4]>(row),
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
        require!(
            is_scalar(&self.density, p.dims),
            "density is {:?}, not a scalar field of {:?}",
            self.density.spec,
            p.dims
        );
        require!(self.emission.is_none_or(|f| is_scalar(&f, p.dims)), "the emission density differs from the density");
        require!(p.step.is_finite() && p.step > 0.0, "a step of {} m", p.step);
        let pixels = u64::from(p.width) * u64::from(p.height);
        require!(pixels > 0 && u32::try_from(pixels).is_ok(), "a picture of {} × {}", p.width, p.height);
        require!(self.film.len >= 2 * pixels, "a film of {} vectors for {pixels} pixels", self.film.len);
        require!(self.surface.is_none_or(|b| b.len >= pixels), "surfaces of fewer than {pixels} pixels");
        if let Some(occupancy) = self.occupancy {
            let [x, y, z, side] = p.occupancy_cells;
            require!(side > 0, "occupancy cells without size");
            let fits = (0..3).all(|a| p.occupancy_cells[a] == p.dims[a].div_ceil(side));
            require!(fits, "{:?} occupancy cells over {:?} voxels", p.occupancy_cells, p.dims);
            require!(occupancy.len >= u64::from(x) * u64::from(y) * u64::from(z), "occupancy of too few cells");
        }
        let mut table = 2 * u64::from(p.samples);
        require!(p.samples > 0, "no samples");
        if let Some(field) = self.in_scatter {
            let [cells @ .., layers] = p.cells;
            let spec = field.spec;
            require!(spec.dims == cells && spec.layers == layers, "in-scatter of {spec:?} for {:?}", p.cells);
            require!(spec.format == FieldFormat::Rgba && layers > 0, "in-scatter of {spec:?}");
            if layers > 1 {
                require!(p.bands * p.bands == layers, "{} bands for {layers} layers", p.bands);
                let triangle = u64::from(p.bands) * u64::from(p.bands + 1) / 2;
                table = table.max(u64::from(p.harmonics_at) + 2 * triangle);
            }
        }
        require!(
            p.lights == 0 || self.lights.is_some_and(|b| b.len >= p.lights.into()),
            "fewer than {} lights",
            p.lights
        );
        require!(p.shadow <= shadow_kind::MARCH, "shadow kind {}", p.shadow);
        if p.phase_kind == PhaseParams::TABLE {
            require!(p.phase_size >= 2, "a phase table of {} entries", p.phase_size);
            table = table.max(u64::from(p.phase_at) + u64::from(p.phase_size));
        }
        require!(self.tables.len >= table, "tables of {} values for {table}", self.tables.len);
        if let Some(environment) = self.environment {
            let texels = u64::from(p.environment_width) * u64::from(p.environment_height);
            require!(
                texels > 0 && environment.len >= texels,
                "an environment of {} texels for {texels}",
                environment.len
            );
        }
        Ok(())
    }
}
