//! Random numbers, and what is made of them.

use std::f32::consts::{FRAC_PI_2, LN_2, SQRT_2};

use crate::packet::{F, I, M};
use crate::simd::Simd;

/// The draws of a path: keys, and the number of the next.
#[derive(Clone, Copy)]
pub(crate) struct Draws {
    first: u32,
    second: u32,
    pub(crate) next: u32,
}

/// Scatters bits.
#[inline]
fn scattered_bits(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// The draws of a sample of a pixel in a picture from number `next` on.
#[inline]
pub(crate) fn draws(pixel: u32, sample: u32, frame: u32, next: u32) -> Draws {
    let twice = frame.wrapping_mul(2);
    let key =
        |number: u32| scattered_bits(sample.wrapping_add(scattered_bits(pixel.wrapping_add(scattered_bits(number)))));
    Draws { first: key(twice), second: key(twice.wrapping_add(1)), next }
}

/// A number in [0, 1).
#[inline]
pub(crate) fn draw(of: &mut Draws) -> f32 {
    let number = of.next;
    of.next = number.wrapping_add(1);
    let bits = scattered_bits(of.second.wrapping_add(scattered_bits(of.first.wrapping_add(number))));
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// The draws of the lanes of a packet.
#[derive(Clone, Copy)]
pub(crate) struct Series<S> {
    first: I<S>,
    second: I<S>,
    next: I<S>,
}

impl<S: Simd> Series<S> {
    /// Draws of nothing.
    #[inline(always)]
    pub(crate) fn idle() -> Self {
        Self { first: I::ZERO, second: I::ZERO, next: I::ZERO }
    }

    /// Those of a lane.
    #[inline(always)]
    pub(crate) fn get(&self, i: usize) -> Draws {
        Draws { first: self.first.0[i] as u32, second: self.second.0[i] as u32, next: self.next.0[i] as u32 }
    }

    /// Gives a lane others.
    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, of: &Draws) {
        (self.first.0[i], self.second.0[i], self.next.0[i]) = (of.first as i32, of.second as i32, of.next as i32);
    }

    #[inline(always)]
    fn scattered_bits(x: I<S>) -> I<S> {
        let x = x.xor(x.lower::<16>()).times(0x7feb_352d);
        let x = x.xor(x.lower::<15>()).times(0x846c_a68b_u32 as i32);
        x.xor(x.lower::<16>())
    }

    /// A number in [0, 1) for each lane; of those that are not `active` it is not the lane's next.
    #[inline(always)]
    pub(crate) fn draw(&mut self, active: M<S>) -> F<S> {
        let number = self.next;
        self.next = number.plus(active.choose(1));
        let bits = Self::scattered_bits(self.second.plus(Self::scattered_bits(self.first.plus(number))));
        bits.lower::<8>().to_float() * (1.0 / (1 << 24) as f32)
    }
}

/// The optical depth at which a draw ends a free flight: -ln(1 - u).
#[inline(always)]
pub(crate) fn optical_depth<S: Simd>(u: F<S>) -> F<S> {
    // x = m 2ⁿ with m from 1 to 2, and halved where it is above √2.
    let bits = (F::ONE - u).bits();
    let power = bits.lower::<23>();
    let m = bits.plus(power.times(-(1 << 23))).plus(I::splat(127 << 23)).as_bits();
    let high = m.gt(F::splat(SQRT_2));
    let m = high.select(m * 0.5, m);
    let n = power.plus(I::splat(-127)).plus(high.choose(1));
    // The series of 2 artanh(s) to s⁹, |s| ≤ 0.172, ends below 1e-9.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = (((z * (2.0 / 9.0) + 2.0 / 7.0) * z + 2.0 / 5.0) * z + 2.0 / 3.0) * z + 2.0;
    -(n.to_float() * LN_2 + s * series)
}

/// Cosine and sine of `u` turns, `u` from 0 to 1.
#[inline]
pub(crate) fn circle(u: f32) -> [f32; 2] {
    // A conversion rounds down what is not negative.
    let quarter = (4.0 * u) as i32 as f32;
    let a = (4.0 * u - quarter - 0.5) * FRAC_PI_2;
    let z = a * a;
    // Taylor's series to a⁸ and a⁹ within an eighth of a turn end below 1e-8.
    let c = (((z / 40320.0 - 1.0 / 720.0) * z + 1.0 / 24.0) * z - 0.5) * z + 1.0;
    let s = ((((z / 362_880.0 - 1.0 / 5040.0) * z + 1.0 / 120.0) * z - 1.0 / 6.0) * z + 1.0) * a;
    // From an eighth of a turn on, then by quarters.
    let (c, s) = ((c - s) * (0.5 * SQRT_2), (c + s) * (0.5 * SQRT_2));
    match quarter as u32 & 3 {
        0 => [c, s],
        1 => [-s, c],
        2 => [-c, -s],
        _ => [s, -c],
    }
}

#[cfg(test)]
mod tests {
    use airlight_core::random::{hash, unit};

    use super::*;
    use crate::packet::{LANES, lanes};
    use crate::simd::Portable;

    #[test]
    fn depths_and_circles_are_good_to_the_last_places() {
        for i in 0..100_000 {
            let u = unit(hash([i, 5, 9]));
            let exact = -(1.0 - f64::from(u)).ln();
            assert!(
                (f64::from(optical_depth(F::<Portable>::splat(u)).0[3]) - exact).abs() <= 3e-7 * exact.max(1e-3),
                "{u}"
            );
            let (sin, cos) = (f64::from(u) * std::f64::consts::TAU).sin_cos();
            let [c, s] = circle(u).map(f64::from);
            // Four times u is exact, its place within a quarter good to 2⁻²⁴, and some roundings follow.
            assert!((c - cos).abs() < 5e-7 && (s - sin).abs() < 5e-7, "{u}: {c} {cos} {s} {sin}");
        }
        assert_eq!(optical_depth(F::<Portable>::ZERO).0[0], 0.0);
    }

    #[test]
    fn draws_are_even_and_those_of_neighbours_are_independent() {
        // Sums of products of two draws each, less their means: of variance 1/144 each.
        let n = 40_000u32;
        let of =
            |pixel: u32, sample: u32, dimension: u32| f64::from(draw(&mut draws(pixel, sample, 0, dimension))) - 0.5;
        let even = (0..n).map(|i| of(i, 3, 7)).sum::<f64>() / (f64::from(n) / 12.0).sqrt();
        assert!(even.abs() < 4.0, "{even}");
        for (what, other) in [("pixel", [1, 0, 0]), ("sample", [0, 1, 0]), ("dimension", [0, 0, 1])] {
            let together = (0..n).map(|i| of(i, i, i) * of(i + other[0], i + other[1], i + other[2])).sum::<f64>();
            let deviations = together / (f64::from(n).sqrt() / 12.0);
            assert!(deviations.abs() < 4.0, "{what}: {deviations}");
        }
    }
    #[test]
    fn lanes_draw_as_each_does_alone() {
        let mut series = Series::<Portable>::idle();
        let mut alone: [Draws; LANES] = std::array::from_fn(|i| draws(7 * i as u32, 3, 1, i as u32));
        alone.iter().enumerate().for_each(|(i, of)| series.set(i, of));
        for turn in 0..100 {
            let active = M::of(lanes!(i => if (turn + i) % 3 == 0 { u32::MAX } else { 0 }));
            let drawn = series.draw(active);
            for (i, of) in alone.iter_mut().enumerate().filter(|(i, _)| active.lane(*i)) {
                assert_eq!(drawn.0[i], draw(of));
                assert_eq!(series.get(i).next, of.next);
            }
        }
    }
}
