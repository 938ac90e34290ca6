//! An environment as some thirty thousand directional lights.
//!
//! What a picture of a million texels sends is summed over the pixels of [`healpix`] into one beam each, from the
//! luminance-weighted mean direction of the light in it; a pixel that is far brighter than the mean is divided in nine.
//! No light is lost, a small sun stays where it stands, and moments on any basis, turned by any angle, are a short sum. So
//! a light that turns costs no look at its picture.

use glam::{DMat3, DVec3};

use super::Environment;
use super::projection::LUMINANCE;
use crate::basis::{Basis, healpix};

/// n of the 12·n² pixels, 1.2° a side.
const NSIDE: u32 = 48;

/// Parts of a bright pixel along each of its sides.
const PARTS: u32 = 3;

/// A pixel is bright that sends so many times the mean luminance: no more than one in sixteen can be.
const BRIGHT: f64 = 16.0;

/// Directional lights that stand for an environment, before its scale and rotation.
#[derive(Clone, Debug, PartialEq)]
pub struct Beams {
    beams: Vec<(DVec3, DVec3)>,
}

/// Light that is gathered into a beam.
#[derive(Clone, Copy, Default)]
struct Sum {
    /// Directions times luminance.
    toward: DVec3,
    flux: DVec3,
}

impl Sum {
    fn add(&mut self, other: Self) {
        self.toward += other.toward;
        self.flux += other.flux;
    }

    /// None where it is dark, or so faint that it has no direction in f64.
    fn beam(&self) -> Option<(DVec3, DVec3)> {
        Some((self.toward.try_normalize()?, self.flux))
    }
}

impl Environment {
    /// The beams of the picture, before scale and rotation. Worked out once for a picture.
    pub fn beams(&self) -> &Beams {
        self.content.beams.get_or_init(|| Beams::new(self))
    }

    /// The coefficients of the light in a basis, scale and rotation included, RGB, from the moments of its
    /// [`beams`](Self::beams).
    pub fn coefficients(&self, basis: &dyn Basis) -> Vec<[f64; 3]> {
        let moments = self.beams().moments(basis, self.rotation);
        let scale = self.scale.as_dvec3();
        let coefficients = basis.coefficients(&moments).expect("a moment a function");
        coefficients.into_iter().map(|c| (DVec3::from(c) * scale).to_array()).collect()
    }
}

impl Beams {
    /// The beams of the environment's picture. Dark pixels have none.
    pub fn new(environment: &Environment) -> Self {
        let plain = Environment { scale: glam::Vec3::ONE, rotation: 0.0, ..environment.clone() };
        let fine = NSIDE * PARTS;
        let mut parts = vec![Sum::default(); healpix::count(fine)];
        // A cell that lies on an edge goes to one side of it, and moves the beam there with it.
        plain.for_each_flux(healpix::side(fine), |direction, flux| {
            parts[healpix::pixel(fine, direction)].add(Sum { toward: direction * flux.dot(LUMINANCE), flux });
        });
        let mut pixels = vec![Sum::default(); healpix::count(NSIDE)];
        let homes: Vec<usize> = healpix::directions(fine).into_iter().map(|d| healpix::pixel(NSIDE, d)).collect();
        parts.iter().zip(&homes).for_each(|(part, &home)| pixels[home].add(*part));
        let luminance = |sum: &Sum| sum.flux.dot(LUMINANCE);
        let bright = BRIGHT * pixels.iter().map(luminance).sum::<f64>() / pixels.len() as f64;
        let divided = parts.iter().zip(&homes).filter(|&(_, &home)| luminance(&pixels[home]) > bright);
        let whole = pixels.iter().filter(|pixel| luminance(pixel) <= bright);
        Self { beams: whole.chain(divided.map(|(part, _)| part)).filter_map(Sum::beam).collect() }
    }

    /// Of each beam the unit vector toward its source, and its irradiance on a plane that faces it, RGB, W m⁻².
    pub fn iter(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        self.beams.iter().copied()
    }

    /// ∫ L b_k dω for every function, RGB, with the picture turned by `rotation` degrees about +Y, from +Z toward +X;
    /// of the picture before scale.
    ///
    /// Σ_k over functions that sum to 1 is the exact flux of the whole. What a beam misses is the curvature of a function
    /// over its pixel: nothing where light is a point. Under even light moments of 642 [discrete spherical
    /// functions](crate::basis::DiscreteSpherical) are good to 0.4 % each, and those of 2562 to 1 %.
    pub fn moments(&self, basis: &dyn Basis, rotation: f64) -> Vec<[f64; 3]> {
        let turn = DMat3::from_rotation_y(rotation.to_radians());
        let mut moments = vec![[0.0; 3]; basis.count()];
        for &(direction, flux) in &self.beams {
            basis.each(turn * direction, &mut |k, v| (0..3).for_each(|c| moments[k][c] += flux[c] * v));
        }
        moments
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::{DiscreteSpherical, SphericalHarmonics};
    use crate::light::Image;
    use glam::Vec3;

    /// Asymmetric, smooth from texel to texel, with a sun of two texels.
    fn picture(width: u32, height: u32) -> Environment {
        let texel = |i: u32| {
            let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
            [1.0 + (9.0 * x).sin() * y, 0.3 + y * y, 1.0 - 0.5 * (14.0 * y + 6.0 * x).cos()]
        };
        let mut texels: Vec<_> = (0..width * height).map(texel).collect();
        let sun = (height / 3 * width + width / 5) as usize;
        (texels[sun], texels[sun + 1]) = ([900.0, 700.0, 500.0], [300.0, 250.0, 200.0]);
        let mut environment = Environment::new(Image { width, height, texels }).unwrap();
        environment.scale = Vec3::new(2.0, 1.0, 0.5);
        environment.rotation = 37.0;
        environment
    }

    /// The largest difference and, for its measure, the largest moment of the channel.
    fn error(beams: &Beams, basis: &dyn Basis, environment: &Environment, exact: &[[f64; 3]]) -> f64 {
        let found = beams.moments(basis, environment.rotation);
        let scale = environment.scale.as_dvec3();
        let channel = |c: usize| {
            let largest = exact.iter().map(|m| m[c].abs()).fold(0.0, f64::max);
            let off = found.iter().zip(exact).map(|(f, e)| (f[c] * scale[c] - e[c]).abs()).fold(0.0, f64::max);
            off / largest
        };
        (0..3).map(channel).fold(0.0, f64::max)
    }

    #[test]
    fn no_light_is_lost() {
        for (width, height) in [(1, 1), (7, 5), (300, 141)] {
            let environment = picture(width.max(2), height);
            let beams = Beams::new(&environment);
            let sum: DVec3 = beams.iter().map(|(_, flux)| flux).sum();
            let expected = environment.mean_radiance() * 4.0 * std::f64::consts::PI / environment.scale.as_dvec3();
            // Rounding.
            assert!((sum - expected).length() < 1e-11 * expected.length(), "{sum} {expected}");
            let basis = DiscreteSpherical::new(162).unwrap();
            let turned: DVec3 = beams.moments(&basis, 12.0).into_iter().map(DVec3::from).sum();
            assert!((turned - expected).length() < 1e-11 * expected.length());
        }
    }

    #[test]
    fn moments_are_those_of_the_picture_however_it_is_turned() {
        let mut environment = picture(256, 128);
        let beams = Beams::new(&environment);
        let harmonics = SphericalHarmonics::new(6).unwrap();
        for rotation in [37.0, -151.3] {
            environment.rotation = rotation;
            let exact = environment.project_sh(&harmonics);
            // Band 5 over pixels of 1/48 rad: 5²/48²/24, and the sun's in nine parts.
            let found = error(&beams, &harmonics, &environment, &exact);
            assert!(found < 1e-3, "harmonics at {rotation}: {found}");
            for functions in DiscreteSpherical::FUNCTIONS {
                let basis = DiscreteSpherical::new(functions).unwrap();
                let found = error(&beams, &basis, &environment, &environment.moments(&basis));
                // Second derivatives of up to 6/h² over the sun's parts of 1/144 rad, and what `moments` itself leaves:
                // 6/0.069² / 144² / 12 for the narrowest.
                assert!(found < 5e-3, "{functions} at {rotation}: {found}");
            }
        }
    }

    #[test]
    fn a_small_sun_stays_where_it_stands() {
        let (width, height) = (256, 128);
        let mut texels = vec![[0f32; 3]; (width * height) as usize];
        texels[(33 * width + 75) as usize] = [1000.0, 900.0, 700.0];
        let environment = Environment::new(Image { width, height, texels }).unwrap();
        let beams = Beams::new(&environment);
        let sun = environment.split().unwrap().sun;
        let mean: DVec3 = beams.iter().map(|(d, flux)| d * flux.dot(LUMINANCE)).sum();
        // A texel of 1.4° is cut into cells of 0.46°.
        assert!(mean.normalize().angle_between(sun.to_light) < 1e-3);
        // Parts of 0.41° that its bilinear texel of 2.8° touches.
        assert!((20..=64).contains(&beams.iter().count()), "{}", beams.iter().count());
    }
}
