//! Light along a short piece of a ray.

use crate::packet::F;
use crate::simd::Simd;

/// e^-τ, and the mean of e^-s over s from 0 to τ: (1 - e^-τ)/τ, by its series where τ is small.
#[inline(always)]
pub(crate) fn segment<S: Simd>(tau: F<S>) -> (F<S>, F<S>) {
    let e = (-tau).exp_negative();
    let series = (((tau * (-1.0 / 120.0) + 1.0 / 24.0) * tau - 1.0 / 6.0) * tau + 0.5) * tau * -1.0 + 1.0;
    let small = tau.lt(F::splat(0.05));
    let mean = small.select(series, (F::ONE - e) / tau.max(F::splat(0.05)));
    (small.select(F::ONE - tau * mean, e), mean)
}
