//! Fractal gradient noise.

use crate::packet::{F, I, LANES, lanes, lerp, triple};

/// Sixteen hashes.
#[derive(Clone, Copy)]
struct H([u32; LANES]);

/// Scatters bits, as `random::mix` of core does.
#[inline(always)]
fn mix(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// The hash of a corner's index along one more axis.
#[inline(always)]
fn along(index: I, h: H) -> H {
    H(lanes!(i => mix((index.0[i] as u32).wrapping_add(h.0[i]))))
}

/// The scalar product of the gradient that a hash chooses with `t`.
#[inline(always)]
fn slope(h: H, t: [F; 3]) -> F {
    F(lanes!(i => {
        let (x, y, z) = (t[0].0[i], t[1].0[i], t[2].0[i]);
        let kind = h.0[i] & 15;
        let u = if kind < 8 { x } else { y };
        let v = if kind < 4 { y } else if kind & 13 == 12 { x } else { z };
        f32::from_bits(u.to_bits() ^ (kind & 1) << 31) + f32::from_bits(v.to_bits() ^ (kind & 2) << 30)
    }))
}

/// One octave at `p`, whose components are not negative and repeat after `mask` + 1.
#[inline(always)]
fn octave(p: [F; 3], mask: i32, seed: u32) -> F {
    let low = triple!(a => p[a].floor());
    let near = triple!(a => p[a] - low[a]);
    let far = triple!(a => near[a] - F::ONE);
    let fade = triple!(a => near[a] * near[a] * near[a] * (near[a] * (near[a] * 6.0 - F::splat(15.0)) + 10.0));
    let index = triple!(a => low[a].to_int());
    let first = triple!(a => I(lanes!(i => index[a].0[i] & mask)));
    let second = triple!(a => I(lanes!(i => (index[a].0[i] + 1) & mask)));
    let seed = H([mix(seed); LANES]);
    let (z0, z1) = (along(first[2], seed), along(second[2], seed));
    let row = |h: H, y: F, z: F| {
        let left = slope(along(first[0], h), [near[0], y, z]);
        let right = slope(along(second[0], h), [far[0], y, z]);
        lerp(left, right, fade[0])
    };
    let plane = |h: H, z: F| {
        let below = row(along(first[1], h), near[1], z);
        let above = row(along(second[1], h), far[1], z);
        lerp(below, above, fade[1])
    };
    lerp(plane(z0, near[2]), plane(z1, far[2]), fade[2])
}

/// A noise as kernels see it.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    pub(crate) octaves: u32,
    pub(crate) seed: u32,
    pub(crate) contrast: f32,
}

impl Noise {
    /// Cells of the first octave after which noise repeats.
    const PERIOD: u32 = airlight_core::media::FractalNoise::PERIOD;

    /// max(0, 1 + contrast · n) at `p` in cells of the first octave.
    #[inline(always)]
    pub(crate) fn factor(&self, p: [F; 3]) -> F {
        const PERIOD: f32 = Noise::PERIOD as f32;
        let p = triple!(a => p[a] - (p[a] / PERIOD).floor() * PERIOD);
        let (mut sum, mut fineness) = (F::ZERO, 1.0);
        for o in 0..self.octaves {
            let mask = ((Self::PERIOD << o) - 1) as i32;
            let seed = mix(self.seed.wrapping_add((o + 1).wrapping_mul(0x9e37_79b9)));
            sum = sum + octave(triple!(a => p[a] * fineness), mask, seed) / fineness;
            fineness *= 2.0;
        }
        (sum * self.contrast + 1.0).max(F::ZERO)
    }
}
