//! `shade`: light that surfaces send to the eye (Giroud and Biri 2011, equation 10).
//!
//! For each hit of [`Trace`](super::Trace), the sum over the lights of E f cos θ T V. E is what the light's falloff and cone
//! bring to a plane that faces it. f = kd/π + ks (n + 2)/(2π) cosⁿα, with α the angle between the mirrored direction of the
//! light and the direction to the eye, and zero beyond a right angle. θ is the angle between the normal and the light; nothing
//! comes from behind the triangle, whatever its interpolated normal. T = exp(-`extinction` · column) is the medium's, its column
//! marched from the surface to the light. V is 0 where a triangle stands between, if `visibility` is 1. Surfaces emit
//! nothing, and neither the environment nor other surfaces light them.
//!
//! The output is a vector a sub-pixel position: radiance, and the distance from the eye, as the march takes it
//! ([`March::surface`](super::March::surface)). Where `background` has something nearer in the pixel, or there is no hit, it
//! is the background's.
//!
//! The work axis is that of `trace`. A pass takes some lights and adds to what the ones before left.

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::{covers, is_density, most_steps};
use crate::stage::trace::{holds, positions};
use crate::stage::{Kernel, LightRecord, MeshRecord, require};

kernel_struct! {
    /// Parameters of `shade`.
    pub struct ShadeParams {
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
        /// The eye from the mesh's origin; the mesh's extent: metres.
        mesh_eye: F32x4,
        /// Axis f of the camera, as [`March`](super::March)'s.
        forward: F32x4,
        /// Axis r, times the half width of the picture at distance 1.
        right: F32x4,
        /// Axis u, times the half height.
        up: F32x4,
        /// Extinction per unit of density, 1/m, RGB; unused.
        extinction: F32x4,
        /// Occupancy cells along x, y, z; voxels of a cell's side.
        occupancy_cells: U32x4,
        /// Columns of the picture.
        width: U32,
        /// Rows of the picture.
        height: U32,
        /// Sub-pixel positions.
        samples: U32,
        /// Lights.
        lights: U32,
        /// First light of this pass.
        light_begin: U32,
        /// One past the last light of this pass.
        light_end: U32,
        /// Boxes of the mesh.
        nodes: U32,
        /// Materials.
        materials: U32,
        /// 1 where triangles stand in the way of light.
        visibility: U32,
        /// The longest step, metres.
        step: F32,
        /// Floor of r² in 1/r², m².
        light_floor: F32,
        /// Lights that are spots: kernels that run both sides of conditions leave cones out where there is none.
        spots: U32,
    }
}

kernel_struct! {
    /// A material as kernels see it.
    pub struct MaterialRecord {
        /// Diffuse reflectance, RGB; the exponent.
        diffuse: F32x4,
        /// Specular reflectance, RGB; unused.
        specular: F32x4,
    }
}

impl MaterialRecord {
    /// Of a material.
    pub fn new(material: &crate::scene::Material) -> Self {
        Self {
            diffuse: material.diffuse.extend(material.shininess).to_array(),
            specular: material.specular.extend(0.0).to_array(),
        }
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Shade {
    /// Parameters.
    pub params: ShadeParams,
    /// Density ρ.
    pub density: Field,
    /// Mean and maximum of each occupancy cell, from `reduce`.
    pub occupancy: Option<Buf<[f32; 2]>>,
    /// Lights.
    pub lights: Option<Buf<LightRecord>>,
    /// Sub-pixel positions, two values each.
    pub tables: Buf<f32>,
    /// Boxes and triangles.
    pub mesh: Buf<MeshRecord>,
    /// Materials.
    pub materials: Buf<MaterialRecord>,
    /// What `trace` found.
    pub hits: Buf<[f32; 4]>,
    /// What stands behind each pixel, as [`March::surface`](super::March::surface) of one sample.
    pub background: Option<Buf<[f32; 4]>>,
    /// A vector a sub-pixel position.
    pub out: Buf<[f32; 4]>,
}

impl Shade {
    /// The most turns of all loops for a light.
    fn turns(&self) -> u64 {
        let p = &self.params;
        let column = most_steps(p.dims, [p.index_x, p.index_y, p.index_z], p.step);
        let way = if p.visibility == 1 { MeshRecord::turns(p.nodes.into(), p.nodes, self.mesh.len) } else { 0 };
        column.saturating_add(way).saturating_add(1)
    }
}

impl Kernel for Shade {
    const NAME: &'static str = "shade";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let samples = u64::from(self.params.samples);
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::read("occupancy", self.occupancy),
            Binding::read("lights", self.lights),
            Binding::read("tables", Some(self.tables)),
            Binding::read("mesh", Some(self.mesh)),
            Binding::read("materials", Some(self.materials)),
            Binding::read("hits", Some(self.hits)).in_parts::<[f32; 4]>(2 * samples),
            Binding::read("background", self.background).in_parts::<[f32; 4]>(1),
            Binding::write("surface", Some(self.out)).in_parts::<[f32; 4]>(samples),
        ]
    }

    fn axis(&self) -> u32 {
        let p = &self.params;
        positions(p.width, p.height, p.samples).unwrap_or(0)
    }

    fn group(&self) -> u32 {
        self.params.samples
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_density(&self.density, p.dims)?;
        let axis = u64::from(positions(p.width, p.height, p.samples).unwrap_or(0));
        require!(axis > 0, "{} × {} pixels of {} positions, none or too many", p.width, p.height, p.samples);
        require!(p.step.is_finite() && p.step > 0.0, "a step of {} m", p.step);
        require!(self.tables.len >= 2 * u64::from(p.samples), "tables of {} values", self.tables.len);
        require!(
            self.hits.len >= 2 * axis && self.out.len >= axis,
            "hits or output of too few vectors for {axis} rays"
        );
        let pixels = axis / u64::from(p.samples);
        require!(self.background.is_none_or(|b| b.len >= pixels), "a background of fewer than {pixels} pixels");
        if let Some(occupancy) = self.occupancy {
            covers("occupancy", occupancy, p.occupancy_cells, p.dims)?;
        }
        let lights = p.light_begin..p.light_end;
        require!(lights.start <= lights.end && lights.end <= p.lights, "lights {lights:?} of {}", p.lights);
        require!(
            p.lights == 0 || self.lights.is_some_and(|b| b.len >= p.lights.into()),
            "fewer than {} lights",
            p.lights
        );
        require!(p.materials > 0 && self.materials.len >= p.materials.into(), "fewer than {} materials", p.materials);
        holds(self.mesh, p.nodes)
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let (each, lights) = (self.turns(), self.params.lights);
        if u64::from(lights).saturating_mul(each) <= turns {
            return Ok(vec![self.clone()]);
        }
        let some = turns / each;
        require!(
            some > 0,
            "a light on a surface takes up to {each} turns of loops, and {turns} are allowed: fewer triangles, a longer \
             step or a smaller medium need less"
        );
        let pass = |begin: u32| {
            let mut pass = self.clone();
            let end = u64::from(begin).saturating_add(some).min(lights.into());
            (pass.params.light_begin, pass.params.light_end) = (begin, end as u32);
            pass
        };
        Ok((0..lights).step_by(some.min(lights.into()) as usize).map(pass).collect())
    }
}
