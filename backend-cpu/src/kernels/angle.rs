//! Angles, by the same series on every device.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use crate::packet::F;
use crate::simd::Simd;

/// The angle of (x, y) from +x toward +y, in (-π, π], to three units in the last place.
#[inline(always)]
pub(crate) fn angle<S: Simd>(y: F<S>, x: F<S>) -> F<S> {
    let (ax, ay) = (x.abs(), y.abs());
    let long = ax.max(ay);
    let t = ax.min(ay) / long;
    // Above tan π/8 the angle is taken from the diagonal.
    let steep = t.gt(F::splat(0.414_213_56));
    let t = steep.select((t - 1.0) / (t + 1.0), t);
    let turned = steep.select(F::splat(FRAC_PI_4), F::ZERO);
    let z = t * t;
    // Chebyshev's interpolation of atan t / t in t² up to tan² π/8 ends below 1e-9.
    let mut series = F::splat(-0.060_239_63);
    for c in [0.105_689_21, -0.142_394_11, 0.199_981_76, -0.333_333_07, 1.0] {
        series = series * z + c;
    }
    let a = turned + t * series;
    let a = ay.gt(ax).select(F::splat(FRAC_PI_2) - a, a);
    let a = x.lt(F::ZERO).select(F::splat(PI) - a, a);
    let a = y.lt(F::ZERO).select(-a, a);
    long.gt(F::ZERO).select(a, F::ZERO)
}

/// The angle of a cosine.
#[inline(always)]
pub(crate) fn angle_of_cosine<S: Simd>(c: F<S>) -> F<S> {
    let x = c.max(F::splat(-1.0)).min(F::ONE);
    angle(((F::ONE - x) * (x + 1.0)).sqrt(), x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Portable;

    type F = crate::packet::F<Portable>;

    #[test]
    fn angles_are_within_three_units_in_the_last_place() {
        let mut worst = 0.0f64;
        for i in 0..100_000 {
            let turn = f64::from(i) * 1e-5 * std::f64::consts::TAU;
            let (y, x) = (turn.sin() as f32 * 3.0, turn.cos() as f32 * 3.0);
            let exact = f64::from(y).atan2(f64::from(x));
            worst =
                worst.max(((f64::from(angle(F::splat(y), F::splat(x)).0[5]) - exact) / exact.abs().max(1e-30)).abs());
        }
        // Three units in the last place of f32.
        assert!(worst < 3.6e-7, "{worst:e}");
        for (c, expected) in [(1.0, 0.0), (-1.0, PI), (0.0, FRAC_PI_2), (2.0, 0.0)] {
            assert_eq!(angle_of_cosine(F::splat(c)).0[0], expected);
        }
        assert_eq!(angle(F::ZERO, F::ZERO).0[0], 0.0);
    }
}
