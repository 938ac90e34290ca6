//! The environment as it is seen behind the medium.

use std::f32::consts::PI;

use airlight_core::device::{DeviceError, Field};

use super::angle::{angle, angle_of_cosine};
use crate::device::Readable;
use crate::packet::{F, LANES, lanes, lerp, triple};
use crate::simd::Simd;

/// An environment's texels, and what turns and tints them.
#[derive(Clone, Copy)]
pub(crate) struct Sky<'a> {
    /// Row by row; more may follow.
    pub(crate) texels: &'a [[f32; 4]],
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Multiplies the radiance, RGB; rotation in turns.
    pub(crate) tint: [f32; 4],
}

impl<'a> Sky<'a> {
    /// The environment of a field, where there is one, of so many texels along each side.
    pub(crate) fn of(
        read: Readable<'a>,
        field: Option<Field>,
        [width, height]: [u32; 2],
        tint: [f32; 4],
    ) -> Result<Option<Self>, DeviceError> {
        let Some(field) = field else { return Ok(None) };
        Ok(Some(Self { texels: bytemuck::cast_slice(read.field(field)?), width, height, tint }))
    }
}

/// The environment's radiance from `d`.
#[inline(always)]
pub(crate) fn sky<S: Simd>(of: &Sky<'_>, d: [F<S>; 3]) -> [F<S>; 3] {
    let u = angle(d[0], -d[2]) / (2.0 * PI) + of.tint[3];
    let x = (u - u.floor()) * of.width as f32 - 0.5;
    let y = angle_of_cosine(d[1]) / PI * of.height as f32 - 0.5;
    let (i, j) = (x.floor(), y.floor());
    let above = sky_row(of, i, j, x - i);
    let below = sky_row(of, i, j + 1.0, x - i);
    triple!(c => lerp(above[c], below[c], y - j) * of.tint[c])
}

#[inline(always)]
fn sky_row<S: Simd>(of: &Sky<'_>, i: F<S>, j: F<S>, f: F<S>) -> [F<S>; 3] {
    let (width, last) = (of.width as usize, of.height as usize - 1);
    // Casting saturates: row -1 is row 0.
    let start: [usize; LANES] = lanes!(l => (j.0[l] as usize).min(last) * width);
    // Column -1 is the last one.
    let column: [usize; LANES] = lanes!(l => (i.0[l] + 1.0) as usize + width - 1);
    let a: [usize; LANES] = lanes!(l => start[l] + column[l] % width);
    let b: [usize; LANES] = lanes!(l => start[l] + (column[l] + 1) % width);
    let (a, b) = (sky_texel(of, a), sky_texel(of, b));
    triple!(c => lerp(a[c], b[c], f))
}

/// Texels of the environment, counted row by row. Folded into a field they lie as they are counted.
#[inline(always)]
fn sky_texel<S: Simd>(of: &Sky<'_>, n: [usize; LANES]) -> [F<S>; 3] {
    triple!(c => F::of(lanes!(l => of.texels[n[l]][c])))
}
