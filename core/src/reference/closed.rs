//! Closed forms, in f64 and for one channel.
//!
//! Lengths in metres, coefficients per metre, directions of unit length.

use std::f64::consts::PI;

use glam::DVec3;
use libm::{erf, erfc};

use crate::basis::quadrature::gauss_legendre;
use crate::media::Gaussian;

/// Transmittance through the optical depth τ: exp(-τ) (Beer–Lambert).
pub fn transmittance(optical_depth: f64) -> f64 {
    (-optical_depth).exp()
}

/// (1 - exp(-x))/x, the mean of exp(-xs) over s in \[0, 1\]; 1 at x = 0. Negative x is allowed.
pub fn mean_transmittance(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

/// ∫ c exp(-a²|x-b|²) dx along the segment from `start` to `end`: the column of one Gaussian of a sum (Giroud and Biri
/// 2011; there the words for a and c are exchanged). `a` is in 1/m and greater than 0.
///
/// With q the distance of b from the line and t its foot, measured from `start`:
/// c exp(-a²q²) √π/(2a) \[erf(a(s-t)) - erf(-at)\].
pub fn gaussian_column(c: f64, a: f64, b: DVec3, start: DVec3, end: DVec3) -> f64 {
    let length = start.distance(end);
    if length == 0.0 {
        return 0.0;
    }
    let direction = (end - start) / length;
    let to_center = b - start;
    let foot = to_center.dot(direction);
    let distance = to_center.cross(direction).length();
    let (from, to) = (a * -foot, a * (length - foot));
    let across = (-(a * distance).powi(2)).exp();
    if a * length < SHORT {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let bell = |x: f64| (-(middle + half * x).powi(2)).exp();
        return c * across * 0.5 * length * gauss_legendre(8).iter().map(|(x, w)| w * bell(*x)).sum::<f64>();
    }
    // Far out on one side erf is ±1 to the last digit: the complements still differ.
    let difference = if from > 0.0 {
        erfc(from) - erfc(to)
    } else if to < 0.0 {
        erfc(-to) - erfc(-from)
    } else {
        erf(to) - erf(from)
    };
    c * across * PI.sqrt() / (2.0 * a) * difference
}

/// Widths 1/a below which a difference of two erf loses digits, and eight Gauss points are exact to the last one: the
/// Gaussian changes by a factor of e^2.7 along the segment at the most before it leaves f64.
const SHORT: f64 = 0.05;

/// The column of a sum of Gaussians along the segment from `start` to `end`: [`gaussian_column`] of each. With
/// `extinction` per unit of density the optical depth is τ = extinction · column.
pub fn gaussians_column(blobs: &[Gaussian], start: DVec3, end: DVec3) -> f64 {
    blobs.iter().map(|b| gaussian_column(b.c, b.a, b.center, start, end)).sum()
}

/// Radiance of a homogeneous segment that emits `emission` (W m⁻³ sr⁻¹) and attenuates by `extinction`:
/// j/σt · (1 - exp(-σt ℓ)), with its limit jℓ.
pub fn emission_absorption(emission: f64, extinction: f64, length: f64) -> f64 {
    emission * length * mean_transmittance(extinction * length)
}

/// Radiance that a medium of albedo 1 in an environment of uniform `radiance` sends to the eye, all orders, where the
/// environment itself is hidden: radiance · (1 - T). With the environment visible behind it the eye sees exactly
/// `radiance`. True for any density and any normalised phase function: the white furnace.
pub fn white_furnace(radiance: f64, transmittance: f64) -> f64 {
    radiance * (1.0 - transmittance)
}

/// A homogeneous medium in a box, lit by one directional light. A slab is a box that is infinite along two axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LitBox {
    /// Lower corner; components may be -∞.
    pub min: DVec3,
    /// Upper corner; components may be +∞.
    pub max: DVec3,
    /// σs.
    pub scattering: f64,
    /// σt.
    pub extinction: f64,
    /// Direction toward the light.
    pub to_light: DVec3,
    /// Irradiance on a plane that faces the light, W m⁻².
    pub irradiance: f64,
}

impl LitBox {
    /// Where the ray is inside, in metres from its origin and not behind it; none where it misses.
    pub fn clip(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let (mut near, mut far) = (0f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, d, min, max) = (origin[axis], direction[axis], self.min[axis], self.max[axis]);
            if d == 0.0 {
                if o < min || o > max {
                    return None;
                }
                continue;
            }
            let (a, b) = ((min - o) / d, (max - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near < far).then_some((near, far))
    }

    /// Radiance scattered exactly once toward `origin` along the view ray:
    /// L = σs p E ∫ exp(-σt (t + s(t))) dt, where s(t) is the way to the light.
    ///
    /// `phase` is the phase function's value (1/sr) at the one angle that occurs. In a convex box s is the least of
    /// three linear functions of t, one for each axis; between their crossings the integral is closed.
    /// Zero where the light's way, or the view ray's, never ends.
    pub fn single_scattering(&self, phase: f64, origin: DVec3, direction: DVec3) -> f64 {
        let Some((near, far)) = self.clip(origin, direction) else { return 0.0 };
        if far.is_infinite() {
            return 0.0;
        }
        let start = origin + near * direction;
        let length = far - near;
        // s(t) = a + b t, for the axes along which the light leaves the box.
        let exits: Vec<(f64, f64)> = (0..3)
            .filter_map(|axis| {
                let l = self.to_light[axis];
                let face = if l > 0.0 { self.max[axis] } else { self.min[axis] };
                (l != 0.0 && face.is_finite()).then(|| ((face - start[axis]) / l, -direction[axis] / l))
            })
            .collect();
        let mut cuts = vec![0.0, length];
        for (i, first) in exits.iter().enumerate() {
            for second in &exits[..i] {
                let crossing = (second.0 - first.0) / (first.1 - second.1);
                if crossing > 0.0 && crossing < length {
                    cuts.push(crossing);
                }
            }
        }
        cuts.sort_by(f64::total_cmp);
        let mut sum = 0.0;
        for piece in cuts.windows(2) {
            let (t, span) = (piece[0], piece[1] - piece[0]);
            let middle = t + 0.5 * span;
            let least = exits.iter().min_by(|p, q| (p.0 + p.1 * middle).total_cmp(&(q.0 + q.1 * middle)));
            let Some(&(a, b)) = least else { return 0.0 };
            let depth = self.extinction * (t + (a + b * t).max(0.0));
            sum += transmittance(depth) * span * mean_transmittance(self.extinction * (1.0 + b) * span);
        }
        self.scattering * phase * self.irradiance * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Composite Gauss–Legendre, fine enough for the integrands below to be exact to rounding where they are smooth.
    fn integrate(from: f64, to: f64, pieces: usize, f: impl Fn(f64) -> f64) -> f64 {
        let rule = gauss_legendre(8);
        let h = (to - from) / pieces as f64;
        (0..pieces)
            .map(|i| {
                let middle = from + (i as f64 + 0.5) * h;
                rule.iter().map(|(x, w)| 0.5 * h * w * f(middle + 0.5 * h * x)).sum::<f64>()
            })
            .sum()
    }

    /// Closed form and quadrature of smooth integrands differ by rounding alone.
    const ROUNDING: f64 = 1e-12;

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance * expected.abs(), "{found:e} {expected:e}");
    }

    #[test]
    fn transmittance_solves_its_equation() {
        // dT = -σt T dt, stepped by the midpoint rule.
        let (extinction, steps) = (2.5, 20_000);
        let h = 1.3 / f64::from(steps);
        let mut stepped = 1.0;
        for _ in 0..steps {
            stepped -= extinction * h * (stepped - 0.5 * h * extinction * stepped);
        }
        // The rule's second order: (σt h)²/6 · σt ℓ.
        close(stepped, transmittance(1.3 * extinction), 3e-8);
        for x in [-3.0, -1e-9, 1e-300, 1e-9, 0.4, 7.0] {
            close(mean_transmittance(x), integrate(0.0, 1.0, 20, |s| (-x * s).exp()), ROUNDING);
        }
        assert_eq!(mean_transmittance(0.0), 1.0);
        assert_eq!(mean_transmittance(f64::INFINITY), 0.0);
    }

    #[test]
    fn column_of_a_gaussian() {
        let b = DVec3::new(0.2, -0.1, 0.4);
        let (c, a) = (1.7, 9.0);
        for (start, end) in [
            (DVec3::new(-1.0, -0.4, 0.1), DVec3::new(1.2, 0.3, 0.9)),
            (DVec3::new(0.2, -0.1, 0.4), DVec3::new(0.25, -0.1, 0.4)),
            (DVec3::new(0.3, 0.1, 0.5), DVec3::new(0.9, 0.2, 0.5)),
            (DVec3::new(0.9, 0.2, 0.5), DVec3::new(0.3, 0.1, 0.5)),
            (DVec3::new(0.8, -0.1, 0.4), DVec3::new(1.4, -0.1, 0.4)),
            (DVec3::new(-0.2, 0.2, 0.3), DVec3::new(-0.2, 0.2001, 0.3)),
            (DVec3::new(-2.5, 0.2, 0.3), DVec3::new(-2.505, 0.2, 0.3)),
        ] {
            let length = start.distance(end);
            let density = |t: f64| c * (-(a * a) * (start.lerp(end, t / length) - b).length_squared()).exp();
            let expected = integrate(0.0, length, 200, density);
            close(gaussian_column(c, a, b, start, end), expected, ROUNDING);
        }
        assert_eq!(gaussian_column(c, a, b, b, b), 0.0);
        let through = gaussian_column(c, a, b, b - DVec3::X * 50.0, b + DVec3::X * 50.0);
        close(through, c * PI.sqrt() / a, ROUNDING);
    }

    #[test]
    fn emission_and_its_limit() {
        for (extinction, length) in [(4.0, 0.7), (1e-9, 0.7), (30.0, 2.0)] {
            let expected = integrate(0.0, length, 60, |t| 2.0 * (-extinction * t).exp());
            close(emission_absorption(2.0, extinction, length), expected, ROUNDING);
        }
        assert_eq!(emission_absorption(2.0, 0.0, 0.5), 1.0);
    }

    #[test]
    fn white_furnace_is_its_own_source() {
        // Albedo 1 and J = 1 everywhere: the source along the ray is σt · 1.
        let (extinction, length, radiance) = (3.0, 0.8, 1.5);
        let scattered = integrate(0.0, length, 20, |t| extinction * radiance * (-extinction * t).exp());
        let behind = transmittance(extinction * length);
        close(white_furnace(radiance, behind), scattered, ROUNDING);
        close(white_furnace(radiance, behind) + radiance * behind, radiance, ROUNDING);
    }

    fn lit_box() -> LitBox {
        LitBox {
            min: DVec3::new(-0.6, 0.0, -0.5),
            max: DVec3::new(0.6, 0.8, 0.5),
            scattering: 3.0,
            extinction: 4.0,
            to_light: DVec3::new(0.5, 0.8, -0.35).normalize(),
            irradiance: 2.6,
        }
    }

    fn by_quadrature(lit: &LitBox, phase: f64, origin: DVec3, direction: DVec3, pieces: usize) -> f64 {
        let (near, far) = lit.clip(origin, direction).unwrap();
        let sum = integrate(near, far, pieces, |t| {
            let (_, to_light) = lit.clip(origin + t * direction, lit.to_light).unwrap();
            (-lit.extinction * (t - near + to_light)).exp()
        });
        lit.scattering * phase * lit.irradiance * sum
    }

    #[test]
    fn single_scattering_in_a_box() {
        let lit = lit_box();
        let phase = 1.0 / (4.0 * PI);
        let mut seen = 0;
        for i in 0..200 {
            let i = f64::from(i);
            let origin = DVec3::new(1.7 * (0.9 * i).sin(), 0.4 + 1.2 * (1.7 * i).cos(), 1.9 * (2.3 * i).sin());
            let target = DVec3::new(0.5 * (3.1 * i).cos(), 0.4 + 0.3 * (0.3 * i).sin(), 0.4 * (1.1 * i).sin());
            let direction = (target - origin).normalize();
            let expected = by_quadrature(&lit, phase, origin, direction, 2000);
            // The way to the light has kinks; a piece of 1/2000 of the ray that holds one is off by its square.
            close(lit.single_scattering(phase, origin, direction), expected, 1e-6);
            seen += usize::from(lit.clip(origin, direction).unwrap().0 > 0.0);
        }
        assert!((50..200).contains(&seen), "eyes outside and inside: {seen}");
        assert_eq!(lit.single_scattering(phase, DVec3::splat(2.0), DVec3::X), 0.0);
    }

    #[test]
    fn single_scattering_in_a_slab() {
        let mut slab = lit_box();
        for axis in [0, 2] {
            (slab.min[axis], slab.max[axis]) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        let origin = DVec3::new(3.0, 2.0, 1.0);
        for direction in [DVec3::NEG_Y, DVec3::new(0.3, -0.5, -0.8).normalize()] {
            let expected = by_quadrature(&slab, 0.08, origin, direction, 50);
            close(slab.single_scattering(0.08, origin, direction), expected, ROUNDING);
        }
        // The textbook's slab seen and lit from straight above: σs p E (1 - exp(-2τ))/(2σt).
        slab.to_light = DVec3::Y;
        let expected = 3.0 * 0.08 * 2.6 * (1.0 - (-2.0 * 4.0 * 0.8f64).exp()) / 8.0;
        close(slab.single_scattering(0.08, origin, DVec3::NEG_Y), expected, ROUNDING);
        // Seen from below the depth is the same for every point.
        let expected = 3.0 * 0.08 * 2.6 * 0.8 * (-4.0 * 0.8f64).exp();
        close(slab.single_scattering(0.08, DVec3::NEG_Y, DVec3::Y), expected, ROUNDING);
        // Level light never gets in, a level ray never gets out.
        assert_eq!(slab.single_scattering(0.08, DVec3::Y * 0.5, DVec3::X), 0.0);
        slab.to_light = DVec3::X;
        assert_eq!(slab.single_scattering(0.08, origin, DVec3::NEG_Y), 0.0);
    }
}
