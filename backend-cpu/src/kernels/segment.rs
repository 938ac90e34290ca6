//! Light along a short piece of a ray.

use crate::packet::{F, M, curvature, decay_parts, each, lost};
use crate::simd::Simd;

/// e^-τ, and the mean of e^-s over s from 0 to τ: (1 - e^-τ)/τ, which nears 1 where τ is small. Where no lane is deep there is no
/// quotient; other lanes find the same beside deep ones.
#[inline(always)]
pub(crate) fn segment<S: Simd>(tau: F<S>) -> (F<S>, F<S>) {
    let shallow = tau.lt(F::splat(SHALLOW));
    if shallow.bits() == M::<S>::ALL.bits() {
        let [bent] = curvature([tau]);
        return (F::ONE - (tau - tau * tau * bent), F::ONE - tau * bent);
    }
    let [(power, rest)] = decay_parts([tau.min(F::splat(87.0))]);
    let [bent] = curvature([rest]);
    let part = power * (rest - rest * rest * bent);
    (power - part, shallow.select(F::ONE - rest * bent, (F::ONE - power + part) / tau))
}

/// Optical depths below it need no power of two: they round to none of ln 2.
const SHALLOW: f32 = 0.34;

/// e^-τ and 1 - e^-τ for τ ≥ 0, both to a few units in the last place, of several packets. Where none is deep the sums are the same
/// without the power of two, which is 1.
#[inline(always)]
pub(crate) fn decays<S: Simd, const N: usize>(tau: [F<S>; N]) -> [(F<S>, F<S>); N] {
    let mut deepest = tau[0];
    for tau in &tau[1..] {
        deepest = deepest.max(*tau);
    }
    if deepest.lt(F::splat(SHALLOW)).bits() == M::<S>::ALL.bits() {
        let lost = lost(tau);
        return each!(n in N, (F::ZERO, F::ZERO) => (F::ONE - lost[n], lost[n]));
    }
    // e^-τ is 2ⁿ (1 - q): without the difference of 1 and q nothing of a small τ is lost.
    let parts = decay_parts(each!(n in N, F::ZERO => tau[n].min(F::splat(87.0))));
    let rests = lost(each!(n in N, F::ZERO => parts[n].1));
    let q = each!(n in N, F::ZERO => parts[n].0 * rests[n]);
    each!(n in N, (F::ZERO, F::ZERO) => (parts[n].0 - q[n], F::ONE - parts[n].0 + q[n]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Portable;

    #[test]
    fn both_parts_are_within_units_in_the_last_place_at_any_depth() {
        let mut worst = [0.0f64; 3];
        for i in 0..200_000 {
            let tau = 87.0 * (i as f32 / 200_000.0).powi(6);
            let exact = f64::from(tau);
            let [(e, lost)] = decays::<Portable, 1>([F::splat(tau)]);
            let mean = segment::<Portable>(F::splat(tau)).1;
            let expected =
                [(-exact).exp(), -(-exact).exp_m1(), if tau > 0.0 { -(-exact).exp_m1() / exact } else { 1.0 }];
            for ((worst, got), expected) in worst.iter_mut().zip([e, lost, mean]).zip(expected) {
                if expected > 1e-37 {
                    *worst = worst.max((f64::from(got.0[7]) / expected - 1.0).abs());
                }
            }
        }
        // Four units in the last place of f32.
        assert!(worst.iter().all(|w| *w < 4.8e-7), "{worst:?}");
        assert_eq!(segment::<Portable>(F::ZERO).1.0[0], 1.0);
    }

    #[test]
    fn lanes_are_the_same_whatever_lies_beside_them() {
        for i in 0..20_000 {
            let tau = i as f32 * (SHALLOW / 20_000.0);
            let mut beside = [tau; 16];
            beside[5] = 40.0;
            let bits = |x: F<Portable>| x.0[7].to_bits();
            let [alone] = decays::<Portable, 1>([F::splat(tau)]);
            let [together, other] = decays::<Portable, 2>([F::splat(tau), F::of(beside)]);
            for found in [together, other] {
                assert_eq!([bits(alone.0), bits(alone.1)], [bits(found.0), bits(found.1)], "{tau}");
            }
            let [alone, beside] = [F::splat(tau), F::of(beside)].map(segment::<Portable>);
            assert_eq!([bits(alone.0), bits(alone.1)], [bits(beside.0), bits(beside.1)], "{tau}");
        }
    }
}
