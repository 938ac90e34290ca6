//! How an environment becomes coefficients of discrete spherical functions.

use std::f64::consts::PI;

use super::Environment;
use crate::basis::quadrature::gauss_legendre;
use crate::basis::{Basis, DiscreteSpherical};

/// How light is smoothed before it is sampled in the directions of [`DiscreteSpherical`] (Zhang, Dong and Ma 2013,
/// section 8.1).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Prefilter {
    /// The mean that each function itself weighs, ∫ L w̄_k dω / A_k: keeps the energy of the light.
    #[default]
    Energy,
    /// The mean under a Gaussian of the angle, as published, whose standard deviation is `width` times the least angle
    /// between directions; 1 there.
    Gaussian {
        /// Standard deviations for each h.
        width: f64,
    },
    /// None: the radiance in that direction alone. What lies between directions is not seen.
    None,
}

impl Prefilter {
    /// The coefficients s_k of the environment's light, scale and rotation included, RGB.
    ///
    /// Over the [`beams`](Environment::beams) of its picture. The Gaussian is divided by its integral over the sphere.
    pub fn coefficients(self, environment: &Environment, basis: &DiscreteSpherical) -> Vec<[f64; 3]> {
        match self {
            Self::Energy => environment.coefficients(basis),
            Self::Gaussian { width } => gaussian(environment, basis, width * basis.radius()),
            Self::None => basis.directions().iter().map(|&d| environment.radiance(d).to_array()).collect(),
        }
    }
}

fn gaussian(environment: &Environment, basis: &DiscreteSpherical, deviation: f64) -> Vec<[f64; 3]> {
    let value = |angle: f64| (-0.5 * (angle / deviation).powi(2)).exp();
    // Where it has fallen to 10⁻¹⁶.
    let reach = (8.6 * deviation).min(PI);
    let node = |(x, w): (f64, f64)| {
        let angle = 0.5 * reach * (1.0 + x);
        0.5 * reach * w * 2.0 * PI * angle.sin() * value(angle)
    };
    let integral: f64 = gauss_legendre(64).into_iter().map(node).sum();
    let turn = glam::DMat3::from_rotation_y(environment.rotation.to_radians());
    let mut sums = vec![glam::DVec3::ZERO; basis.count()];
    let cos_reach = reach.cos();
    for (direction, flux) in environment.beams().iter() {
        let direction = turn * direction;
        for (sum, d) in sums.iter_mut().zip(basis.directions()) {
            let cos = d.dot(direction);
            if cos >= cos_reach {
                *sum += flux * value(cos.clamp(-1.0, 1.0).acos());
            }
        }
    }
    sums.into_iter().map(|s| (s * environment.scale.as_dvec3() / integral).to_array()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Image;
    use glam::{DVec3, Vec3};

    fn all() -> [Prefilter; 4] {
        [Prefilter::Energy, Prefilter::Gaussian { width: 1.0 }, Prefilter::Gaussian { width: 0.25 }, Prefilter::None]
    }

    #[test]
    fn even_light_stays_even() {
        let mut environment = Environment::uniform(Vec3::new(2.0, 1.0, 0.5)).unwrap();
        environment.scale = Vec3::new(1.0, 1.0, 4.0);
        for functions in [12, 42, 642] {
            let basis = DiscreteSpherical::new(functions).unwrap();
            for prefilter in all() {
                // Sums over beams 1.2° apart for integrals: of functions that reach 8°, of Gaussians as narrow as 2°.
                let tolerance = match prefilter {
                    Prefilter::Gaussian { width } if width < 1.0 && functions == 642 => 3e-2,
                    Prefilter::Energy | Prefilter::Gaussian { .. } => 4e-3,
                    Prefilter::None => 1e-12,
                };
                for s in prefilter.coefficients(&environment, &basis) {
                    let error = (DVec3::from(s) / DVec3::new(2.0, 1.0, 2.0) - 1.0).abs().max_element();
                    assert!(error < tolerance, "{functions}, {prefilter:?}: {s:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_smaller_than_a_function_is_kept_blurred_or_missed() {
        let (width, height) = (128, 64);
        let mut texels = vec![[0f32; 3]; (width * height) as usize];
        let (column, row) = (40, 21);
        texels[(row * width + column) as usize] = [100.0, 50.0, 10.0];
        let mut environment = Environment::new(Image { width, height, texels }).unwrap();
        environment.rotation = 64.0;
        let basis = DiscreteSpherical::new(162).unwrap();
        let flux = environment.mean_radiance() * 4.0 * PI;
        let theta = PI * (f64::from(row) + 0.5) / f64::from(height);
        let phi = PI + 64f64.to_radians() - 2.0 * PI * (f64::from(column) + 0.5) / f64::from(width);
        let sun = DVec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
        let total = |s: &[[f64; 3]]| s.iter().zip(basis.integrals()).map(|(s, a)| DVec3::from(*s) * a).sum::<DVec3>();
        let energy = Prefilter::Energy.coefficients(&environment, &basis);
        assert!((total(&energy) - flux).length() < 1e-12 * flux.length());
        let wide = Prefilter::Gaussian { width: 1.0 }.coefficients(&environment, &basis);
        // A Gaussian's samples sum to its integral, and areas differ by 16 %.
        assert!((total(&wide) / flux - 1.0).abs().max_element() < 0.08, "{} {flux}", total(&wide));
        let normal = 2.0 * PI * basis.radius().powi(2);
        for (s, d) in wide.iter().zip(basis.directions()) {
            // On a plane; a texel of 2.8° under a Gaussian of 16°, and the sphere's curvature.
            let expected = flux * (-0.5 * (d.angle_between(sun) / basis.radius()).powi(2)).exp() / normal;
            assert!((DVec3::from(*s) - expected).length() < 0.03 * flux.length() / normal, "{s:?} {expected}");
        }
        assert_eq!(total(&Prefilter::None.coefficients(&environment, &basis)), DVec3::ZERO);
    }
}
