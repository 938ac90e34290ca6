//! The sun of an environment: its brightest compact part as a directional light, and the environment without it.
//!
//! Which texels are the sun's: those that are connected to the brightest one through texels brighter than a threshold,
//! the lowest for which none of them is more than [`REACH`] from it, but at least [`FAINT`] of the brightest. So a disc
//! in an even sky is taken whole with its rim, and of a glow that fades slowly the middle. They are lowered, in each
//! channel, to the mean of the texels around them. What the integrals of the picture lose by that is the sun's: both
//! parts together are the whole. All of this belongs to the picture, before scale and rotation, and is worked out once
//! for it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::PI;
use std::sync::{Arc, OnceLock};

use glam::{DMat3, DVec3, Vec3};

use super::projection::LUMINANCE;
use super::{Beams, Environment, Image};
use crate::Version;
use crate::basis::SphericalHarmonics;
use crate::once::once;

/// The farthest that a texel of the sun may be from the brightest, radians: a disc of half of it is taken whole
/// wherever in it the brightest texel is.
const REACH: f64 = 15.0 * PI / 180.0;

/// The least luminance of a texel of the sun, as a share of the brightest.
const FAINT: f64 = 0.01;

/// The largest angular radius of what counts as compact, radians.
const COMPACT: f64 = 10.0 * PI / 180.0;

/// Bands by which [`Environment::cost`] knows the light: what is beyond, a shadow's edge barely sees.
const BANDS: u32 = SphericalHarmonics::MAX_BANDS;

/// A picture, and what is known about it once it was asked for.
#[derive(Debug)]
pub(super) struct Content {
    pub(super) image: Image,
    pub(super) version: Version,
    parts: OnceLock<Option<Parts>>,
    spectrum: OnceLock<Vec<[f64; 3]>>,
    pub(super) beams: OnceLock<Beams>,
}

/// A picture in two.
#[derive(Debug)]
struct Parts {
    rest: Arc<Content>,
    /// ∫ L dω of the whole.
    whole: DVec3,
    /// ∫ L dω of what was taken out, and ∫ L ω dω.
    flux: DVec3,
    moments: [DVec3; 3],
}

/// The brightest compact part of an environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector toward it: the mean direction of its light, weighed by luminance.
    pub to_light: DVec3,
    /// Integral of its radiance over solid angle, RGB, W m⁻².
    pub irradiance: DVec3,
    /// Half angle of the even disc whose light is as concentrated, radians.
    pub angular_radius: f64,
    /// Its share of the luminance that the environment sends from all around, 0 to 1.
    pub share: f64,
}

/// An environment in two parts, whose integrals add up to its own.
#[derive(Clone, Debug)]
pub struct Split {
    /// What was taken out.
    pub sun: Sun,
    /// What remains: the picture with the sun's texels lowered to what is around them, with a version of its own.
    pub rest: Environment,
}

/// Relative errors of in-scattered light, root mean squares over all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Of light that is cut to the first bands.
    pub whole: f64,
    /// Of light whose sun is a directional light, and whose rest is cut to the first bands.
    pub split: f64,
}

impl Content {
    pub(super) fn new(image: Image) -> Self {
        Self {
            image,
            version: Version::fresh(),
            parts: OnceLock::new(),
            spectrum: OnceLock::new(),
            beams: OnceLock::new(),
        }
    }
}

impl Environment {
    /// The environment without its sun, and the sun; none where nothing compact stands out. Worked out once for a
    /// picture, whatever scale and rotation.
    pub fn split(&self) -> Option<Split> {
        let parts = once(&self.content.parts, || parts(&self.content)).as_ref()?;
        let scale = self.scale.as_dvec3();
        let luminance = |rgb: DVec3| (rgb * scale).dot(LUMINANCE);
        let moment = DVec3::from(parts.moments.map(luminance));
        let (flux, whole) = (luminance(parts.flux), luminance(parts.whole));
        let to_light = DMat3::from_rotation_y(self.rotation.to_radians()) * moment.try_normalize()?;
        let sun = Sun {
            to_light,
            irradiance: parts.flux * scale,
            angular_radius: angular_radius(moment.length() / flux),
            share: flux / whole,
        };
        Some(Split { sun, rest: Self { content: parts.rest.clone(), ..self.clone() } })
    }

    /// What it costs in-scattered light to know only the first `bands` bands of this environment, and what it costs to
    /// know only those of the rest but the whole sun, as a directional light; none where there is no sun.
    ///
    /// In-scattered light is ∫ K(ω·a) L(ω) dω in luminance, for a kernel K given by its Legendre moments `kernel`, as
    /// many as there are (32 at most count), and the error is the root mean square over all axes a, relative to the
    /// light's own. By Funk–Hecke and Parseval it is a sum over bands, and turning the environment does not change it.
    /// Light that is moved from the sun's disc to its middle counts as an error too.
    pub fn cost(&self, kernel: &[f64], bands: u32) -> Option<Cost> {
        let parts = once(&self.content.parts, || parts(&self.content)).as_ref()?;
        let scale = self.scale.as_dvec3();
        let luminance = |rgb: &[f64; 3]| (DVec3::from(*rgb) * scale).dot(LUMINANCE);
        let plain = Self { rotation: 0.0, ..self.clone() };
        let Split { sun, .. } = plain.split()?;
        let mut toward = vec![0.0; (BANDS * BANDS) as usize];
        let basis = harmonics(BANDS);
        crate::basis::Basis::eval(&basis, sun.to_light, &mut toward);
        let flux = sun.irradiance.dot(LUMINANCE);
        let (mut light, mut whole, mut split) = (0.0, 0.0, 0.0);
        let spectra = self.content.spectrum().iter().zip(parts.rest.spectrum());
        for (k, ((all, rest), y)) in spectra.map(|(a, b)| (luminance(a), luminance(b))).zip(&toward).enumerate() {
            let l = k.isqrt();
            let square = |v: f64| kernel.get(l).map_or(0.0, |beta| (beta * v).powi(2));
            light += square(all);
            if l >= bands as usize {
                whole += square(all);
                split += square(all - flux * y);
            } else {
                split += square(all - rest - flux * y);
            }
        }
        Some(Cost { whole: (whole / light).sqrt(), split: (split / light).sqrt() })
    }
}

impl Content {
    /// Coefficients of the first [`BANDS`] bands, neither scaled nor turned.
    fn spectrum(self: &Arc<Self>) -> &[[f64; 3]] {
        once(&self.spectrum, || plain(self).project_sh(&harmonics(BANDS))).as_slice()
    }
}

/// Legendre moments of a half-space's shadow, as a share of the first: the transmittance beside a thick medium, one
/// over half the sphere and zero over the other. ∫ P_l from 0 to 1.
pub fn half_space(bands: u32) -> Vec<f64> {
    let mut moments = vec![1.0, 0.5];
    for l in 2..bands as usize {
        moments.push(moments[l - 2] * (2.0 - l as f64) / (l as f64 + 1.0));
    }
    moments.truncate(bands as usize);
    moments
}

fn harmonics(bands: u32) -> SphericalHarmonics {
    SphericalHarmonics::new(bands).expect("from 1 to the most")
}

/// A picture as an environment, neither scaled nor turned.
fn plain(content: &Arc<Content>) -> Environment {
    Environment { content: content.clone(), scale: Vec3::ONE, rotation: 0.0, visible: true }
}

/// Half angle of an even disc whose mean direction has the length `r`, which is (1 + cos α)/2.
fn angular_radius(r: f64) -> f64 {
    (2.0 * r - 1.0).clamp(-1.0, 1.0).acos()
}

/// Takes the sun out of a picture.
fn parts(content: &Arc<Content>) -> Option<Parts> {
    let image = &content.image;
    let texels = brightest(image)?;
    let around = level(image, &texels)?;
    let mut rest = image.clone();
    for &i in &texels {
        let texel = &mut rest.texels[i];
        *texel = [0, 1, 2].map(|c| texel[c].min(around[c]));
    }
    let rest = Arc::new(Content::new(rest));
    let basis = harmonics(2);
    let [all, left] = [content, &rest].map(|part| plain(part).project_sh(&basis));
    // Y_00 is 1/√4π; Y_1,-1, Y_10 and Y_11 are √(3/4π) times x, y and z.
    let taken = |k: usize| DVec3::from(all[k]) - DVec3::from(left[k]);
    let flux = (taken(0) * (4.0 * PI).sqrt()).max(DVec3::ZERO);
    let moments = [1, 2, 3].map(|k| taken(k) * (4.0 * PI / 3.0).sqrt());
    let concentration = DVec3::from(moments.map(|m| m.dot(LUMINANCE))).length() / flux.dot(LUMINANCE);
    // What has no luminance to speak of is not compact either.
    let compact = angular_radius(concentration) <= COMPACT;
    compact.then(|| Parts { rest, whole: DVec3::from(all[0]) * (4.0 * PI).sqrt(), flux, moments })
}

/// The texels of the sun; none where the brightest texel is no brighter than a way out of its surroundings, or all is
/// dark.
fn brightest(image: &Image) -> Option<Vec<usize>> {
    let luminance = |i: usize| DVec3::from(image.texels[i].map(f64::from)).dot(LUMINANCE);
    let most = (0..image.texels.len()).max_by(|&a, &b| luminance(a).total_cmp(&luminance(b)).then(b.cmp(&a)))?;
    let (middle, least) = (direction(image, most), FAINT * luminance(most));
    // From the brightest on, always the brightest texel that touches those so far: `lowest` falls whenever the way
    // leads through darker ones, and the texels taken before are connected through brighter ones.
    let mut seen = vec![false; image.texels.len()];
    seen[most] = true;
    // Luminance is at least 0, where the order of floats is that of their bits.
    let entry = |i: usize| (luminance(i).to_bits(), Reverse(i));
    let mut next = BinaryHeap::from([entry(most)]);
    let (mut taken, mut lowest) = (Vec::new(), f64::INFINITY);
    while let Some((bits, Reverse(i))) = next.pop() {
        let here = f64::from_bits(bits);
        if here <= least {
            break;
        }
        lowest = lowest.min(here);
        if direction(image, i).angle_between(middle) > REACH {
            taken.retain(|&(_, threshold)| threshold > lowest);
            break;
        }
        taken.push((i, lowest));
        for n in neighbours(image, i) {
            if !std::mem::replace(&mut seen[n], true) {
                next.push(entry(n));
            }
        }
    }
    (!taken.is_empty()).then(|| taken.into_iter().map(|(i, _)| i).collect())
}

/// Mean of the texels that touch those of the sun, weighed by their solid angles; none where there are none.
fn level(image: &Image, texels: &[usize]) -> Option<[f32; 3]> {
    let mut seen: std::collections::HashSet<usize> = texels.iter().copied().collect();
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    for n in texels.iter().flat_map(|&i| neighbours(image, i)) {
        if seen.insert(n) {
            let row = (n / image.width as usize) as f64 + 0.5;
            let solid_angle = (PI * row / f64::from(image.height)).sin();
            sum += solid_angle * DVec3::from(image.texels[n].map(f64::from));
            weight += solid_angle;
        }
    }
    (weight > 0.0).then(|| (sum / weight).as_vec3().to_array())
}

/// The texels around one: the row wraps, and ends are ends.
fn neighbours(image: &Image, i: usize) -> impl Iterator<Item = usize> + use<> {
    let (w, h) = (image.width as usize, image.height as usize);
    let (x, y) = (i % w, i / w);
    let rows = y.saturating_sub(1)..=(y + 1).min(h - 1);
    rows.flat_map(move |row| [w - 1, 0, 1].map(|step| row * w + (x + step) % w)).filter(move |&n| n != i)
}

/// Direction of a texel's centre, unit.
fn direction(image: &Image, i: usize) -> DVec3 {
    let (w, h) = (f64::from(image.width), f64::from(image.height));
    let (column, row) = ((i as u32 % image.width) as f64 + 0.5, (i as u32 / image.width) as f64 + 0.5);
    let (sin, cos) = (PI - 2.0 * PI * column / w).sin_cos();
    let (planar, y) = (PI * row / h).sin_cos();
    DVec3::new(planar * sin, y, planar * cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::healpix;
    use crate::basis::quadrature::gauss_legendre;

    /// Sub-texels along a texel's side in the sums below.
    const FINE: u32 = 6;

    /// A rough sky with a disc of `radius` radians around `toward`, which is cut in texels.
    fn sky(width: u32, height: u32, toward: DVec3, radius: f64, disc: [f32; 3]) -> Environment {
        let mut image = Image { width, height, texels: vec![[0.0; 3]; (width * height) as usize] };
        for i in 0..image.texels.len() {
            let rough = 0.5 + 0.5 * (i as f32 * 1.7).sin();
            let inside = direction(&image, i).angle_between(toward) <= radius;
            image.texels[i] = if inside { disc } else { [0.2 * rough, 0.3, 0.5 - 0.3 * rough] };
        }
        Environment::new(image).unwrap()
    }

    fn toward() -> DVec3 {
        DVec3::new(0.4, 0.6, -0.7).normalize()
    }

    /// ∫ L dω and ∫ L ω dω of a difference of two environments, by a plain sum over what [`Environment::radiance`]
    /// says.
    fn sums(a: &Environment, b: &Environment) -> (DVec3, DVec3) {
        let (w, h) = (FINE * a.image().width, FINE * a.image().height);
        let (mut flux, mut moment) = (DVec3::ZERO, DVec3::ZERO);
        for j in 0..h {
            let theta = PI * (f64::from(j) + 0.5) / f64::from(h);
            for i in 0..w {
                let (sin, cos) = (2.0 * PI * (f64::from(i) + 0.5) / f64::from(w)).sin_cos();
                let d = DVec3::new(theta.sin() * sin, theta.cos(), theta.sin() * cos);
                let part =
                    (a.radiance(d) - b.radiance(d)) * (theta.sin() * 2.0 * PI * PI / f64::from(w) / f64::from(h));
                flux += part;
                moment += part.dot(LUMINANCE) * d;
            }
        }
        (flux, moment)
    }

    #[test]
    fn both_parts_are_the_whole() {
        for (width, height) in [(90, 45), (64, 47)] {
            let mut whole = sky(width, height, toward(), 0.09, [400.0, 300.0, 150.0]);
            (whole.scale, whole.rotation) = (Vec3::new(1.5, 1.0, 0.25), 37.0);
            let Split { sun, rest } = whole.split().unwrap();
            let left = rest.mean_radiance() * 4.0 * PI;
            let all = whole.mean_radiance() * 4.0 * PI;
            assert!((left + sun.irradiance - all).abs().max_element() < 1e-13 * all.max_element(), "nothing is lost");
            let (flux, moment) = sums(&whole, &rest);
            // The midpoint sum in a sixth of a texel, over hats with kinks at the texels' centres.
            assert!((flux - sun.irradiance).length() < 5e-3 * flux.length(), "{flux} {}", sun.irradiance);
            assert!(moment.angle_between(sun.to_light) < 1e-3, "{moment} {}", sun.to_light);
            let share = sun.irradiance.dot(LUMINANCE) / all.dot(LUMINANCE);
            assert!((sun.share - share).abs() < 1e-12 && share > 0.5);
            // The disc's middle, turned with the environment, to half a texel.
            let turned = DMat3::from_rotation_y(37f64.to_radians()) * toward();
            assert!(turned.angle_between(sun.to_light) < 0.5 * PI / f64::from(height));
            // Nowhere brighter than before, and the same away from the sun.
            for (i, (a, b)) in rest.image().texels.iter().zip(&whole.image().texels).enumerate() {
                assert!((0..3).all(|c| a[c] <= b[c]), "{a:?} {b:?}");
                let near = direction(whole.image(), i).angle_between(toward()) < 0.3;
                assert!(near || a == b, "texel {i}");
            }
            assert!(rest.max_radiance().max_element() < 1.0, "the disc is gone");
        }
    }

    #[test]
    fn a_picture_is_split_once() {
        let whole = sky(80, 40, toward(), 0.1, [90.0; 3]);
        let mut turned = whole.clone();
        (turned.rotation, turned.scale, turned.visible) = (90.0, Vec3::splat(2.0), false);
        let (a, b) = (whole.split().unwrap(), turned.split().unwrap());
        assert_eq!(a.rest.version(), b.rest.version());
        assert_ne!(a.rest.version(), whole.version());
        let expected = DMat3::from_rotation_y(PI / 2.0) * a.sun.to_light;
        assert!(
            (b.sun.to_light - expected).length() < 1e-12
                && (b.sun.irradiance - 2.0 * a.sun.irradiance).length() < 1e-12
        );
        assert_eq!((b.rest.rotation, b.rest.visible), (90.0, false));
    }

    #[test]
    fn the_angular_radius_is_a_discs() {
        for radius in [0.03, 0.06, 0.11] {
            let sun = sky(720, 360, toward(), radius, [50.0; 3]).split().unwrap().sun;
            // Texels of half a degree and half of one on every side.
            assert!((sun.angular_radius - radius).abs() < 0.006, "{radius}: {}", sun.angular_radius);
        }
    }

    #[test]
    fn what_does_not_stand_out_is_no_sun() {
        assert!(Environment::uniform(Vec3::ONE).unwrap().split().is_none());
        assert!(Environment::uniform(Vec3::ZERO).unwrap().split().is_none());
        let picture = |width: u32, height: u32, value: &dyn Fn(DVec3) -> f32| {
            let mut image = Image { width, height, texels: vec![[0.0; 3]; (width * height) as usize] };
            for i in 0..image.texels.len() {
                image.texels[i] = [value(direction(&image, i)); 3];
            }
            Environment::new(image).unwrap()
        };
        // A slope, a band along the horizon, a wide glow, a disc of 12°, one of four texels of the whole sphere.
        assert!(picture(60, 30, &|d| d.y as f32 + 2.0).split().is_none());
        assert!(picture(60, 30, &|d| if d.y.abs() < 0.1 { 9.0 } else { 0.1 }).split().is_none());
        assert!(picture(120, 60, &|d| (8.0 * (d.dot(toward()) - 1.0)).exp() as f32).split().is_none());
        assert!(picture(120, 60, &|d| if d.angle_between(toward()) < 0.21 { 9.0 } else { 0.1 }).split().is_none());
        assert!(picture(2, 2, &|d| if d.y > 0.0 && d.x > 0.0 { 9.0 } else { 0.1 }).split().is_none());
        // A small sun in a wide glow is taken without most of the glow.
        let glow = |d: DVec3| 1.0 / (0.02 + d.angle_between(toward())) as f32;
        let sun = |d: DVec3| glow(d) + if d.angle_between(toward()) < 0.05 { 3000.0 } else { 0.0 };
        let found = picture(240, 120, &sun).split().unwrap().sun;
        assert!(found.angular_radius < 0.07 && found.to_light.angle_between(toward()) < 0.02, "{found:?}");
    }

    #[test]
    fn suns_at_the_seam_and_the_poles_are_whole() {
        for toward in [DVec3::NEG_Z, DVec3::new(0.02, 0.1, -1.0).normalize(), DVec3::Y, DVec3::new(0.01, -1.0, 0.03)] {
            let whole = sky(96, 48, toward.normalize(), 0.1, [70.0; 3]);
            let Split { sun, rest } = whole.split().unwrap();
            assert!(rest.max_radiance().max_element() < 1.0, "{toward}: {}", rest.max_radiance());
            assert!(sun.to_light.angle_between(toward) < 0.04, "{toward}: {}", sun.to_light);
        }
    }

    #[test]
    fn half_space_moments_are_the_integrals_of_legendre_polynomials() {
        let rule = gauss_legendre(40);
        for (l, moment) in half_space(32).into_iter().enumerate() {
            let value = |x: f64| crate::media::legendre(x).nth(l).unwrap();
            let integral: f64 = rule.iter().map(|&(x, w)| 0.5 * w * value(0.5 * (x + 1.0))).sum();
            assert!((moment - integral).abs() < 1e-14, "{l}: {moment} {integral}");
        }
        assert_eq!(half_space(1), [1.0]);
    }

    /// A sun alone, small enough to count as one direction, behind half-spaces of all orientations: its light is seen
    /// whole or not at all, and three bands of it are Σ (2l+1) h_l P_l of the angle.
    #[test]
    fn the_cost_is_what_half_spaces_lose() {
        let mut image = sky(360, 180, toward(), 0.02, [1e6; 3]).image().clone();
        image.texels.iter_mut().for_each(|t| *t = if t[0] > 1.0 { *t } else { [0.0; 3] });
        let sun = Environment::new(image).unwrap();
        let moments = half_space(32);
        for bands in [2u32, 3, 6] {
            let (mut error, mut light) = (0.0, 0.0);
            for axis in healpix::directions(32) {
                let c = axis.dot(toward());
                let seen = if c > 0.0 { 2.0 } else { 0.0 };
                let series = crate::media::legendre(c).zip(&moments).take(bands as usize).enumerate();
                let cut: f64 = series.map(|(l, (p, h))| (2.0 * l as f64 + 1.0) * h * p).sum();
                error += (seen - cut).powi(2);
                light += seen * seen;
            }
            let expected = (error / light).sqrt();
            let cost = sun.cost(&moments, bands).unwrap();
            // What is beyond 32 bands is 1 % of the light's square.
            assert!((cost.whole.powi(2) - expected.powi(2)).abs() < 0.015, "{bands} bands: {} {expected}", cost.whole);
            assert!(cost.split < 0.06, "{bands} bands: {}", cost.split);
        }
        assert!(Environment::uniform(Vec3::ONE).unwrap().cost(&moments, 3).is_none());
    }
}
