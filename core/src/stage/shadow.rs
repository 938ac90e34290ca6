//! `shadow`: maps of how far each light reaches before it meets a surface.
//!
//! A map is faces of `side`² texels. A point light has six, ±X, ±Y and ±Z of the world in this order, each a right angle wide; a
//! spot whose cone is narrow has one, as wide as its cone; a directional light has one, across the mesh. A texel holds how
//! far the ray through its middle goes to the nearest triangle, measured along the face's axis: from the light, or from the plane
//! at the mesh's extent before its origin; [`FAR`](super::FAR) where it meets none. Along the axis a plane that faces the light has
//! one distance all over.
//!
//! Lights are relative to the mesh's origin, so that the eye's motion leaves maps as they are; `power.w` is the number of the
//! light's first face, `cone.w` the half width of a spot's face at distance 1, or 0 for six faces.
//!
//! The work axis is the texels: face by face, row by row. A pass takes some boxes and keeps what the passes before found
//! where it is nearer.

use glam::{DVec3, Vec3};

use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::light::Light;
use crate::stage::trace::{holds, node_ranges};
use crate::stage::{Kernel, LightRecord, MeshRecord, require};

/// How surfaces shadow lights in `march`.
pub mod surface_shadow {
    /// Not at all.
    pub const NONE: u32 = 0;
    /// By a map.
    pub const MAP: u32 = 1;
    /// By a ray.
    pub const RAY: u32 = 2;
}

kernel_struct! {
    /// Parameters of `shadow`.
    pub struct ShadowParams {
        /// Lights.
        lights: U32,
        /// Faces of all lights.
        faces: U32,
        /// Texels along each side of a face.
        side: U32,
        /// Boxes of the mesh.
        nodes: U32,
        /// First box of this pass.
        node_begin: U32,
        /// One past the last box of this pass.
        node_end: U32,
        /// The mesh's extent, metres.
        extent: F32,
        /// Unused.
        unused: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Shadow {
    /// Parameters.
    pub params: ShadowParams,
    /// Lights.
    pub lights: Buf<LightRecord>,
    /// Boxes and triangles.
    pub mesh: Buf<MeshRecord>,
    /// Distances.
    pub out: Buf<f32>,
}

impl Shadow {
    /// Half angle of the widest cone that one face holds, radians: 60°.
    const WIDEST: f64 = std::f64::consts::FRAC_PI_3;

    /// Half width at distance 1 of a light's one face; 0 for a light with another map.
    pub fn half_width(light: &Light) -> f32 {
        match *light {
            Light::Spot { cutoff, .. } if cutoff <= Self::WIDEST => cutoff.tan() as f32,
            _ => 0.0,
        }
    }

    /// Faces of a light's map.
    pub fn faces(light: &Light) -> u32 {
        match light {
            Light::Directional { .. } => 1,
            _ if Self::half_width(light) > 0.0 => 1,
            _ => 6,
        }
    }
}

impl LightRecord {
    /// Of lights, relative to `origin`, subtracted in f64, so that scenes far from the world's origin keep their precision.
    /// Their maps follow each other.
    pub fn of(lights: &[Light], origin: DVec3) -> Vec<Self> {
        let mut face = 0;
        let record = |light: &Light| {
            let at = |p: DVec3| (p - origin).as_vec3().extend(1.0).to_array();
            let of = |power: Vec3| power.extend(face as f32).to_array();
            let half_width = Shadow::half_width(light);
            let plain = |position, power| Self { position, power, axis: [0.0; 4], cone: [0.0; 4] };
            let record = match *light {
                Light::Directional { to_light, irradiance } => {
                    plain(to_light.as_vec3().extend(0.0).to_array(), of(irradiance))
                }
                Light::Point { position, intensity } => plain(at(position), of(intensity)),
                Light::Spot { position, axis, intensity, beam, cutoff } => Self {
                    axis: axis.as_vec3().extend(0.0).to_array(),
                    cone: [beam as f32, cutoff as f32, 1.0, half_width],
                    ..plain(at(position), of(intensity))
                },
            };
            face += Shadow::faces(light);
            record
        };
        lights.iter().map(record).collect()
    }

    /// How many lights are spots.
    pub fn spots(lights: &[Light]) -> u32 {
        lights.iter().filter(|light| matches!(light, Light::Spot { .. })).count() as u32
    }
}

/// The texels of so many faces, where their number fits the work axis.
pub(super) fn texels(faces: u32, side: u32) -> Option<u32> {
    side.checked_mul(side)?.checked_mul(faces)
}

impl Kernel for Shadow {
    const NAME: &'static str = "shadow";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::read("lights", Some(self.lights)),
            Binding::read("mesh", Some(self.mesh)),
            Binding::write("shadow_map", Some(self.out)).in_parts::<f32>(1),
        ]
    }

    fn axis(&self) -> u32 {
        texels(self.params.faces, self.params.side).unwrap_or(0)
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let axis = texels(p.faces, p.side).unwrap_or(0);
        require!(axis > 0, "{} faces of {}² texels, none or too many", p.faces, p.side);
        require!(self.out.len >= axis.into(), "{} places for {axis} texels", self.out.len);
        require!(p.lights > 0 && self.lights.len >= p.lights.into(), "fewer than {} lights", p.lights);
        require!(p.extent.is_finite() && p.extent > 0.0, "a mesh of {} m", p.extent);
        let nodes = p.node_begin..p.node_end;
        require!(!nodes.is_empty() && nodes.end <= p.nodes, "boxes {nodes:?} of {}", p.nodes);
        holds(self.mesh, p.nodes)
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let pass = |(begin, end): (u32, u32)| {
            let mut pass = self.clone();
            (pass.params.node_begin, pass.params.node_end) = (begin, end);
            pass
        };
        // The loop that looks for a texel's light turns too.
        let left = turns.saturating_sub(self.params.lights.into());
        Ok(node_ranges(self.params.nodes, self.mesh.len, left)?.into_iter().map(pass).collect())
    }
}
