//! Fractal gradient noise.

use airlight_core::media::FractalNoise;

use crate::packet::{F, I, LANES, lanes, lerp, triple};
use crate::simd::Simd;

/// Sixteen hashes.
#[derive(Clone, Copy)]
struct H([u32; LANES]);

/// Scatters bits, as `random::scatter` of core does.
#[inline(always)]
fn scatter(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// The hash of a corner's index along one more axis.
#[inline(always)]
fn along<S: Simd>(index: I<S>, h: H) -> H {
    H(lanes!(i => scatter((index.0[i] as u32).wrapping_add(h.0[i]))))
}

/// The scalar product of the gradient that a hash chooses with `t`.
#[inline(always)]
fn slope<S: Simd>(h: H, t: [F<S>; 3]) -> F<S> {
    F::of(lanes!(i => {
        let (x, y, z) = (t[0].0[i], t[1].0[i], t[2].0[i]);
        let kind = h.0[i] & 15;
        let u = if kind < 8 { x } else { y };
        let v = if kind < 4 { y } else if kind & 13 == 12 { x } else { z };
        f32::from_bits(u.to_bits() ^ (kind & 1) << 31) + f32::from_bits(v.to_bits() ^ (kind & 2) << 30)
    }))
}

/// The noise on an edge along x: between its corners of index `x[0]` and `x[1]`, at `t` from the first.
#[inline(always)]
fn edge<S: Simd>(h: H, x: [I<S>; 2], t: [F<S>; 3], fade: F<S>) -> F<S> {
    let left = slope(along(x[0], h), t);
    let right = slope(along(x[1], h), [t[0] - F::ONE, t[1], t[2]]);
    lerp(left, right, fade)
}

/// One octave at `p`, whose components are not negative and repeat after `mask` + 1.
#[inline(always)]
fn octave<S: Simd>(p: [F<S>; 3], mask: i32, seed: u32) -> F<S> {
    let low = triple!(a => p[a].floor());
    let t = triple!(a => p[a] - low[a]);
    let far = triple!(a => t[a] - F::ONE);
    let fade = triple!(a => t[a] * t[a] * t[a] * (t[a] * (t[a] * 6.0 - F::splat(15.0)) + 10.0));
    let index = triple!(a => low[a].to_int());
    let first = triple!(a => I::of(lanes!(i => index[a].0[i] & mask)));
    let second = triple!(a => I::of(lanes!(i => (index[a].0[i] + 1) & mask)));
    let x = [first[0], second[0]];
    let seed = H([scatter(seed); LANES]);
    let (z0, z1) = (along(first[2], seed), along(second[2], seed));
    let a = edge(along(first[1], z0), x, t, fade[0]);
    let b = edge(along(second[1], z0), x, [t[0], far[1], t[2]], fade[0]);
    let c = edge(along(first[1], z1), x, [t[0], t[1], far[2]], fade[0]);
    let d = edge(along(second[1], z1), x, [t[0], far[1], far[2]], fade[0]);
    lerp(lerp(a, b, fade[1]), lerp(c, d, fade[1]), fade[2])
}

/// Cells of the first octave after which noise repeats.
const PERIOD: u32 = FractalNoise::PERIOD;

/// max(0, 1 + contrast · n) at `p` in cells of the first octave.
#[inline(always)]
pub(crate) fn noise_factor<S: Simd>(p: [F<S>; 3], octaves: u32, seed: u32, contrast: f32) -> F<S> {
    let period = PERIOD as f32;
    let within = triple!(a => p[a] - (p[a] / period).floor() * period);
    let (mut sum, mut fineness) = (F::ZERO, 1.0);
    for o in 0..octaves {
        let mask = ((PERIOD << o) - 1) as i32;
        let seed = scatter(seed.wrapping_add((o + 1).wrapping_mul(0x9e37_79b9)));
        sum = sum + octave(triple!(a => within[a] * fineness), mask, seed) / fineness;
        fineness *= 2.0;
    }
    (sum * contrast + 1.0).max(F::ZERO)
}
