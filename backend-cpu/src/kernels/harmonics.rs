//! Spherical harmonics of a packet of directions.

use airlight_core::basis::SphericalHarmonics;

use crate::packet::F;
use crate::simd::Simd;

/// The most coefficients.
pub(crate) const MAX: usize = SphericalHarmonics::DEVICE_BANDS.pow(2) as usize;

/// Y_k(d) for all k below bands², by the recurrences of `airlight_core::basis::recurrence_table`.
#[inline(always)]
pub(crate) fn harmonics<S: Simd>(table: &[f32], bands: usize, d: [F<S>; 3], out: &mut [F<S>; MAX]) {
    let [x, y, z] = d;
    // Real and imaginary part of (z + i x)^m.
    let (mut re, mut im) = (F::ONE, F::ZERO);
    for m in 0..bands {
        let (mut below, mut this) = (F::ZERO, F::ZERO);
        for l in m..bands {
            let at = 2 * (l * (l + 1) / 2 + m);
            let (a, b) = (table[at], table[at + 1]);
            let next = if l == m { F::splat(a) } else { y * this * a - below * b };
            (below, this) = (this, next);
            let center = l * (l + 1);
            out[center + m] = this * re;
            if m > 0 {
                out[center - m] = this * im;
            }
        }
        (re, im) = (re * z - im * x, re * x + im * z);
    }
}
