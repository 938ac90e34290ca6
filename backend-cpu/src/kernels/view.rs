//! View rays.

use crate::packet::{F, LANES, dot, lanes, triple};
use crate::simd::Simd;

/// The camera's axes and the picture, as parameters of stages hold them.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) axes: [[f32; 4]; 3],
    pub(crate) size: [u32; 2],
    pub(crate) samples: u32,
    pub(crate) positions: &'a [f32],
}

/// Directions of the view rays of sixteen sub-pixel positions from `first` on, those past `last` again `last`'s.
#[inline(always)]
pub(crate) fn view<S: Simd>(of: &View<'_>, first: usize, last: usize) -> [F<S>; 3] {
    let [width, height] = of.size;
    let samples = of.samples as usize;
    let unit: [usize; LANES] = lanes!(i => (first + i).min(last));
    let x = F::of(lanes!(i => (unit[i] / samples % width as usize) as f32 + of.positions[2 * (unit[i] % samples)]));
    let y = F::of(lanes!(i => (unit[i] / samples / width as usize) as f32 + of.positions[2 * (unit[i] % samples) + 1]));
    let a = x * (2.0 / width as f32) - 1.0;
    let b = -(y * (2.0 / height as f32) - 1.0);
    let [forward, right, up] = of.axes;
    let d = triple!(c => a * right[c] + b * up[c] + forward[c]);
    let length = dot(d, d).sqrt();
    triple!(c => d[c] / length)
}
