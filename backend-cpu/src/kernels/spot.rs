//! Where a path scatters, and how.

use std::f32::consts::PI;

use airlight_core::glam::Vec3;

use super::bend::bend_density;
use super::mesh::Mesh;
use super::phase::{Phase, phase};
use crate::packet::F;
use crate::simd::Portable;

/// Where a path scatters: within the medium, or on a surface with its normals and material.
#[derive(Clone, Copy)]
pub(crate) struct Spot {
    pub(crate) surface: bool,
    pub(crate) normal: Vec3,
    pub(crate) facet: Vec3,
    diffuse: Vec3,
    specular: Vec3,
    pub(crate) exponent: f32,
}

/// What a path along `direction` scatters at, `place` from the mesh's origin: the triangle of a mesh, and without one the medium.
pub(crate) fn spot(mesh: Option<Mesh<'_>>, materials: &[f32], place: Vec3, direction: Vec3, triangle: u32) -> Spot {
    let none = Spot {
        surface: false,
        normal: Vec3::ZERO,
        facet: Vec3::ZERO,
        diffuse: Vec3::ZERO,
        specular: Vec3::ZERO,
        exponent: 0.0,
    };
    let Some(mesh) = mesh else { return none };
    let (at, material) = mesh.triangle(triangle);
    let record = |n: usize| Vec3::from(mesh.place(at + n));
    let (a, b, c) = (record(0), record(1), record(2));
    let across = (b - a).cross(c - a);
    let own = across / across.dot(across).sqrt().max(f32::MIN_POSITIVE);
    let facet = if own.dot(direction) > 0.0 { -own } else { own };
    // Shares of the corners: twice the areas across from them.
    let area = |p: Vec3, q: Vec3| (p - place).cross(q - place).dot(own);
    let normal = area(b, c) * record(3) + area(c, a) * record(4) + area(a, b) * record(5);
    let size = normal.dot(normal).sqrt();
    let normal = if size > 0.0 { normal / size } else { facet };
    let normal = if normal.dot(facet) < 0.0 { -normal } else { normal };
    let of = &materials[8 * material as usize..][..8];
    Spot {
        surface: true,
        normal,
        facet,
        diffuse: Vec3::new(of[0], of[1], of[2]),
        specular: Vec3::new(of[4], of[5], of[6]),
        exponent: of[3],
    }
}

/// The share of light from `toward` that is scattered back along `from`, per steradian: on a surface times the cosine.
pub(crate) fn scattered(of: &Phase<'_>, spot: &Spot, from: Vec3, toward: Vec3) -> Vec3 {
    if !spot.surface {
        return Vec3::splat(phase(of, F::<Portable>::splat(toward.dot(from))).0[0]);
    }
    let facing = spot.normal.dot(toward);
    if facing <= 0.0 || spot.facet.dot(toward) <= 0.0 {
        return Vec3::ZERO;
    }
    let cosine = from.dot(toward - 2.0 * facing * spot.normal);
    let lobe =
        if cosine > 0.0 { (spot.exponent + 2.0) / (2.0 * PI) * cosine.min(1.0).powf(spot.exponent) } else { 0.0 };
    facing * (spot.diffuse / PI + lobe * spot.specular)
}

/// The part of a surface's directions that are drawn from its diffuse term.
pub(crate) fn dull(spot: &Spot) -> f32 {
    let (d, s) = (spot.diffuse, spot.specular);
    let (diffuse, specular) = (d.x + d.y + d.z, s.x + s.y + s.z);
    if specular > 0.0 { diffuse / (diffuse + specular) } else { 1.0 }
}

/// The probability that a path from `from` goes on toward `toward`, per steradian.
pub(crate) fn scattered_density(of: &Phase<'_>, bends: &[f32], spot: &Spot, from: Vec3, toward: Vec3) -> f32 {
    if !spot.surface {
        return bend_density(of, bends, toward.dot(from));
    }
    let facing = spot.normal.dot(toward);
    let cosine = from.dot(toward - 2.0 * facing * spot.normal);
    let lobe =
        if cosine > 0.0 { (spot.exponent + 1.0) / (2.0 * PI) * cosine.min(1.0).powf(spot.exponent) } else { 0.0 };
    let part = dull(spot);
    part * facing.max(0.0) / PI + (1.0 - part) * lobe
}
