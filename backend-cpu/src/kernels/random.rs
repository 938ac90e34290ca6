//! Random numbers, and what is made of them.

use std::f32::consts::{FRAC_PI_2, LN_2, SQRT_2};

use airlight_core::random::{hash, scatter, unit};

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
    scatter(x)
}

/// The draws of a sample of a pixel in a picture from number `next` on.
#[inline]
pub(crate) fn draws(pixel: u32, sample: u32, frame: u32, next: u32) -> Draws {
    let key = |half: u32| hash([sample, pixel, frame.wrapping_mul(2).wrapping_add(half)]);
    Draws { first: key(0), second: key(1), next }
}

/// A number in [0, 1).
#[inline]
pub(crate) fn draw(of: &mut Draws) -> f32 {
    let number = of.next;
    of.next = number.wrapping_add(1);
    unit(scattered_bits(of.second.wrapping_add(scattered_bits(of.first.wrapping_add(number)))))
}

/// The optical depth at which a draw ends a free flight: -ln(1 - u).
#[inline]
pub(crate) fn optical_depth(u: f32) -> f32 {
    // x = m 2ⁿ with m from 1 to 2, and halved where it is above √2.
    let bits = (1.0 - u).to_bits();
    let m = f32::from_bits(bits & 0x007f_ffff | 0x3f80_0000);
    let high = m > SQRT_2;
    let m = if high { 0.5 * m } else { m };
    let n = (bits >> 23) as i32 - 127 + i32::from(high);
    // The series of 2 artanh(s) to s⁹, |s| ≤ 0.172, ends below 1e-9.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = (((2.0 / 9.0 * z + 2.0 / 7.0) * z + 2.0 / 5.0) * z + 2.0 / 3.0) * z + 2.0;
    -(n as f32 * LN_2 + s * series)
}

/// Cosine and sine of `u` turns, `u` from 0 to 1.
#[inline]
pub(crate) fn circle(u: f32) -> [f32; 2] {
    let quarter = (4.0 * u).floor();
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
    use super::*;

    #[test]
    fn depths_and_circles_are_good_to_the_last_places() {
        for i in 0..100_000 {
            let u = unit(hash([i, 5, 9]));
            let exact = -(1.0 - f64::from(u)).ln();
            assert!((f64::from(optical_depth(u)) - exact).abs() <= 3e-7 * exact.max(1e-3), "{u}");
            let (sin, cos) = (f64::from(u) * std::f64::consts::TAU).sin_cos();
            let [c, s] = circle(u).map(f64::from);
            // Four times u is exact, its place within a quarter good to 2⁻²⁴, and some roundings follow.
            assert!((c - cos).abs() < 5e-7 && (s - sin).abs() < 5e-7, "{u}: {c} {cos} {s} {sin}");
        }
        assert_eq!(optical_depth(0.0), 0.0);
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
}
