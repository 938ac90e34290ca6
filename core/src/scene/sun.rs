//! Whether the environment's sun is lit as a directional light.

use std::borrow::Cow;
use std::fmt;

use super::{Content, EnvironmentEstimate, ExtractSun, LightsEstimate, RecordBasis, Records, Scene, Scheme, Shadow};
use crate::basis::window::{Ringing, ringing};
use crate::basis::{SphericalHarmonics, Window};
use crate::light::{Cost, Environment, Light, Split, half_space};
use crate::media::Phase;

/// The sun of a scene's environment, and what becomes of it.
#[derive(Clone, Debug)]
pub struct Extraction {
    /// The environment in two parts.
    pub split: Split,
    /// Whether the sun is lit as a directional light, beside an environment without it.
    pub taken: bool,
    /// Why, or why not.
    pub reason: Reason,
}

/// Why a sun is lit as a directional light, or stays in the environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// `extract_sun` asks for it.
    Asked,
    /// `extract_sun` asks for the contrary.
    Refused,
    /// Records cut nothing off: they hold the whole light, and the phase function ends within their bands.
    Whole,
    /// Lights are left out, or shadowed by the medium less well than the environment is.
    Shadow,
    /// It brings the in-scattered light nearer to the truth by at least [`Extraction::GAIN`].
    Gain(Cost),
    /// It does not.
    NoGain(Cost),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |cost: &Cost| [cost.whole, cost.split].map(|c| format!("{:.1} %", 100.0 * c));
        match self {
            Self::Asked => f.write_str("extract_sun = true"),
            Self::Refused => f.write_str("extract_sun = false"),
            Self::Whole => f.write_str("records hold the whole light, and the phase function ends within their bands"),
            Self::Shadow => f.write_str("estimate.lights does not shadow lights in the medium as well as records do"),
            Self::Gain(cost) => {
                let [whole, split] = percent(cost);
                write!(
                    f,
                    "truncation costs {whole} of the in-scattered light with the sun in the environment, {split} apart"
                )
            }
            Self::NoGain(cost) => {
                let [whole, split] = percent(cost);
                write!(
                    f,
                    "truncation costs {whole} of the in-scattered light with the sun in the environment, {split} apart: \
                     too little gain"
                )
            }
        }
    }
}

/// How far the light that records make of an environment falls below zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Negative {
    /// Without a window.
    pub plain: Ringing,
    /// With the scene's window.
    pub windowed: Ringing,
}

impl Extraction {
    /// The least gain for which `auto` takes the sun out, as a share of the in-scattered light.
    pub const GAIN: f64 = 0.02;
}

impl Scene {
    /// The environment's sun, where records light the medium by the environment and it has one.
    ///
    /// `auto` takes it out where that lessens the error of what records cut off by at least [`Extraction::GAIN`], as
    /// [`Environment::cost`] knows it for the kernel that in-scattered light is made by: with `transmittance`, where
    /// the light is cut to `bands`, the shadow of a thick medium over half the sphere; with `radiance`, where the phase
    /// function is, the phase function; with `phase` whichever gains more. It does not depend on where the sun stands,
    /// so that it does not change while the environment turns.
    pub fn sun(&self) -> Option<Extraction> {
        let (records, environment) = (self.records()?, self.environment.as_ref()?);
        let split = environment.split()?;
        let (taken, reason) = match (self.leaves(records), records.extract_sun) {
            (Some(reason), _) => (false, reason),
            (None, ExtractSun::Always) => (true, Reason::Asked),
            (None, _) => {
                let cost = records.cost(environment, &self.optics.phase)?;
                let gain = cost.whole - cost.split >= Extraction::GAIN;
                (gain, if gain { Reason::Gain(cost) } else { Reason::NoGain(cost) })
            }
        };
        Some(Extraction { split, taken, reason })
    }

    /// The scene as estimators light it: where the sun is taken out, with the rest of the environment and one more
    /// light.
    pub fn lit(&self) -> Cow<'_, Self> {
        let taken = || {
            // Most scenes are spared the search.
            let none = self.leaves(self.records()?).is_some();
            let Extraction { split: Split { sun, rest }, taken: true, .. } = (!none).then(|| self.sun())?? else {
                return None;
            };
            let light = Light::directional(sun.to_light, sun.irradiance.as_vec3()).ok()?;
            let mut scene = self.clone();
            scene.environment = Some(rest);
            scene.lights.push(light);
            Some(scene)
        };
        taken().map_or(Cow::Borrowed(self), Cow::Owned)
    }

    fn records(&self) -> Option<&Records> {
        self.estimate.environment.as_ref().map(|EnvironmentEstimate::Records(records)| records)
    }

    /// Why the sun stays in the environment, whatever it is.
    fn leaves(&self, records: &Records) -> Option<Reason> {
        let shadows = self.estimate.lights.as_ref().is_some_and(LightsEstimate::shadows);
        match records.extract_sun {
            ExtractSun::Never => Some(Reason::Refused),
            ExtractSun::Auto if !shadows => Some(Reason::Shadow),
            ExtractSun::Auto if records.cuts_nothing(&self.optics.phase) => Some(Reason::Whole),
            ExtractSun::Auto | ExtractSun::Always => None,
        }
    }

    /// How far the light that records make of the environment (without its sun where that is taken out) falls below
    /// zero; none without records or environment.
    ///
    /// With `transmittance` and `phase` it is the truncated environment, which in discrete functions never does; with
    /// `radiance` what an unshadowed point scatters, for all directions of view.
    pub fn negative(&self) -> Option<Negative> {
        let scene = self.lit();
        let records = scene.records().filter(|records| records.basis == RecordBasis::Harmonics)?;
        let basis = SphericalHarmonics::new(records.bands_of(&scene.optics.phase)).ok()?;
        let beta = match records.content {
            Content::Radiance => scene.optics.phase.moments(basis.bands()),
            Content::Transmittance | Content::Phase => vec![1.0; basis.bands() as usize],
        };
        let light: Vec<[f64; 3]> = scene.environment.as_ref()?.project_sh(&basis);
        let light: Vec<_> = light.iter().enumerate().map(|(k, c)| c.map(|v| v * beta[k.isqrt()])).collect();
        let windowed = light.iter().zip(records.window_factors(&scene.optics.phase)).map(|(c, f)| c.map(|v| v * f));
        Some(Negative { plain: ringing(&basis, &light), windowed: ringing(&basis, &windowed.collect::<Vec<_>>()) })
    }
}

impl Records {
    /// Bands that are computed: of the light, or as far as the phase function reaches.
    pub fn bands_of(&self, phase: &Phase) -> u32 {
        match self.content {
            Content::Radiance => self.bands.min(phase.reach().unwrap_or(u32::MAX)),
            Content::Transmittance | Content::Phase => self.bands,
        }
    }

    /// The window's factors of those bands' functions. Where the phase function ends within the bands nothing is cut
    /// off, and there is nothing to fade.
    pub fn window_factors(&self, phase: &Phase) -> impl Iterator<Item = f64> + use<> {
        let window = if self.cuts_nothing(phase) { Window::None } else { self.window };
        window.factors(self.bands_of(phase))
    }

    /// Whether neither light nor phase function is cut off.
    fn cuts_nothing(&self, phase: &Phase) -> bool {
        self.content == Content::Radiance && phase.reach().is_some_and(|reach| reach <= self.bands)
    }

    fn cost(&self, environment: &Environment, phase: &Phase) -> Option<Cost> {
        let (shadow, phase) = (half_space(SphericalHarmonics::MAX_BANDS), phase.moments(SphericalHarmonics::MAX_BANDS));
        // Discrete functions blur as much as about as many spherical harmonics leave out.
        let bands = match self.basis {
            RecordBasis::Harmonics => self.bands,
            RecordBasis::Discrete(functions) => functions.isqrt(),
        };
        let cost = |kernel: &[f64]| environment.cost(kernel, bands);
        match self.content {
            Content::Transmittance => cost(&shadow),
            Content::Radiance => cost(&phase),
            Content::Phase => {
                let gain = |c: &Cost| c.whole - c.split;
                [cost(&shadow)?, cost(&phase)?].into_iter().max_by(|a, b| gain(a).total_cmp(&gain(b)))
            }
        }
    }
}

impl LightsEstimate {
    /// Whether lights are shadowed by the medium about as well as records are.
    fn shadows(&self) -> bool {
        match self {
            Self::Opacity(opacity) => opacity.scheme == Scheme::ShortCharacteristics,
            Self::Direct(direct) => direct.shadow != Shadow::None,
            Self::Local(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Image;
    use crate::scene::{Direct, EstimateError, Opacity, SceneError};

    /// A sun of some degrees in a dim sky, over fog.
    fn scene(content: Content, phase: Phase) -> Scene {
        let (width, height) = (72u32, 36u32);
        let mut texels = vec![[0.1f32, 0.15, 0.2]; (width * height) as usize];
        for (x, y) in [(20, 9), (21, 9), (20, 10), (21, 10)] {
            texels[(y * width + x) as usize] = [90.0, 80.0, 60.0];
        }
        let environment = Environment::new(Image { width, height, texels }).unwrap();
        let mut scene = crate::scene::tests::fog(glam::DVec3::new(1.0, 2.0, 3.0));
        scene.environment = Some(environment);
        scene.optics.phase = phase;
        scene.estimate.environment = Some(EnvironmentEstimate::Records(Records { content, ..Records::default() }));
        scene
    }

    fn records(scene: &mut Scene) -> &mut Records {
        let Some(EnvironmentEstimate::Records(records)) = &mut scene.estimate.environment else { unreachable!() };
        records
    }

    #[test]
    fn auto_takes_the_sun_where_something_is_cut_off() {
        let hg = Phase::HenyeyGreenstein { g: 0.5 };
        let reason = |scene: &Scene| scene.sun().map(|sun| (sun.taken, sun.reason));
        assert_eq!(reason(&scene(Content::Radiance, Phase::Isotropic)), Some((false, Reason::Whole)));
        assert_eq!(reason(&scene(Content::Radiance, Phase::Rayleigh)), Some((false, Reason::Whole)));
        for (content, phase) in [
            (Content::Transmittance, Phase::Isotropic),
            (Content::Phase, Phase::Isotropic),
            (Content::Phase, hg.clone()),
            (Content::Radiance, hg.clone()),
        ] {
            let found = reason(&scene(content, phase.clone()));
            assert!(matches!(found, Some((true, Reason::Gain(_)))), "{content:?} {phase:?}: {found:?}");
        }
        // Ten bands hold all but 0.1 % of the lobe.
        let mut fine = scene(Content::Radiance, hg.clone());
        (records(&mut fine).bands, records(&mut fine).directions) = (10, 768);
        assert!(matches!(reason(&fine), Some((false, Reason::NoGain(_)))));
        let mut turned = scene(Content::Phase, hg.clone());
        let before = reason(&turned);
        turned.environment.as_mut().unwrap().rotation = 123.0;
        assert_eq!(reason(&turned), before, "a moving sky keeps its mind");

        let mut scene = scene(Content::Phase, hg);
        for lights in [
            None,
            Some(LightsEstimate::Direct(Direct { shadow: Shadow::None, ..Direct::default() })),
            Some(LightsEstimate::Opacity(Opacity { scheme: Scheme::Published, ..Opacity::default() })),
        ] {
            scene.estimate.lights = lights;
            assert_eq!(reason(&scene), Some((false, Reason::Shadow)));
            assert!(matches!(scene.lit(), Cow::Borrowed(_)));
        }
        scene.estimate.environment = None;
        assert_eq!(reason(&scene), None);
    }

    #[test]
    fn options_ask_and_refuse_and_what_cannot_be_is_told() {
        let mut scene = scene(Content::Radiance, Phase::Isotropic);
        records(&mut scene).extract_sun = ExtractSun::Always;
        assert_eq!(scene.validate(), Ok(()));
        let lit = scene.lit();
        assert_eq!((lit.lights.len(), scene.lights.len()), (1, 0));
        assert_ne!(
            lit.environment.as_ref().map(Environment::version),
            scene.environment.as_ref().map(Environment::version)
        );
        let (mut dark, mut even) = (scene.clone(), scene.clone());
        dark.estimate.lights = None;
        even.environment = Some(Environment::uniform(glam::Vec3::ONE).unwrap());
        for scene in [dark, even] {
            assert!(matches!(scene.validate(), Err(SceneError::Estimate(EstimateError::Sun(_)))));
        }
        // A sky that fades out is no mistake.
        let mut night = scene.clone();
        night.environment.as_mut().unwrap().scale = glam::Vec3::ZERO;
        assert_eq!((night.validate(), night.lit().lights.len()), (Ok(()), 0));
        records(&mut scene).extract_sun = ExtractSun::Never;
        assert_eq!(scene.sun().map(|sun| (sun.taken, sun.reason)), Some((false, Reason::Refused)));
        assert!(matches!(scene.lit(), Cow::Borrowed(_)));
    }

    #[test]
    fn windows_and_a_sun_taken_out_leave_less_below_zero() {
        let negative = |extract_sun: ExtractSun, window: Window| {
            let mut scene = scene(Content::Transmittance, Phase::Isotropic);
            (records(&mut scene).extract_sun, records(&mut scene).window) = (extract_sun, window);
            scene.negative().unwrap()
        };
        let plain = negative(ExtractSun::Never, Window::None);
        assert!(plain.plain == plain.windowed && plain.plain.negative > 0, "{plain:?}");
        for window in [Window::Hanning, Window::Lanczos] {
            let faded = negative(ExtractSun::Never, window);
            assert!(faded.plain == plain.plain && faded.windowed.depth < 0.5 * plain.plain.depth, "{faded:?}");
        }
        assert_eq!(negative(ExtractSun::Always, Window::None).plain.negative, 0, "an even sky does not ring");
        let mut isotropic = scene(Content::Radiance, Phase::Isotropic);
        records(&mut isotropic).window = Window::Hanning;
        assert!(records(&mut isotropic).window_factors(&Phase::Isotropic).eq([1.0]), "nothing is cut off");
        let forward = Phase::HenyeyGreenstein { g: 0.6 };
        let factors: Vec<f64> = records(&mut isotropic).window_factors(&forward).collect();
        assert_eq!((factors.len(), factors[0]), (9, 1.0));
        assert!(factors[1..].iter().all(|f| *f < 1.0));
    }
}
