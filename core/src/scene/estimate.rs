//! Which estimators light the medium, and their options.

use std::sync::OnceLock;

use super::TransferEstimate;
use super::records::{ExtractSun, Records};
use crate::basis::{GRAM_TOLERANCE, SphericalHarmonics, gram_error, healpix};
use crate::media::Phase;
use crate::scene::Material;

/// One estimator for each source of first-order light, and one for all further orders; without one, that light is left
/// out. Or one for all light and all orders.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// How light from the environment (and from the medium's own emission) is in-scattered.
    pub environment: Option<EnvironmentEstimate>,
    /// How light from analytic lights is in-scattered.
    pub lights: Option<LightsEstimate>,
    /// How light of all sources that was scattered before is in-scattered.
    pub scattering: Option<ScatteringEstimate>,
    /// What brings all light and all orders by itself, in place of the others, which are none then.
    pub all: Option<AllEstimate>,
}

impl Default for Estimate {
    fn default() -> Self {
        Self {
            environment: Some(EnvironmentEstimate::Records(Records::default())),
            lights: Some(LightsEstimate::Opacity(Opacity::default())),
            scattering: Some(ScatteringEstimate::Sweeps(Sweeps::default())),
            all: None,
        }
    }
}

impl Estimate {
    /// No light in the medium but its own.
    pub fn none() -> Self {
        Self { environment: None, lights: None, scattering: None, all: None }
    }

    /// The defaults without further orders.
    pub fn single() -> Self {
        Self { scattering: None, ..Self::default() }
    }
}

/// Estimators of all light.
#[derive(Clone, Debug, PartialEq)]
pub enum AllEstimate {
    /// Unbiased path tracing.
    Path(Path),
    /// Precomputed transfer (Zhang, Dong and Ma 2013).
    Transfer(TransferEstimate),
}

impl AllEstimate {
    /// Its name, as scenes give it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Path(_) => "path",
            Self::Transfer(_) => "transfer",
        }
    }
}

/// Options of `path`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Paths a pixel, at the most.
    pub samples: u32,
    /// Scatterings of a path, those of surfaces included, at the most: 1 is single scattering. None for all.
    pub max_depth: Option<u32>,
    /// Seconds after which no more samples are begun.
    pub time_limit: Option<f64>,
    /// Remaining noise, as relative L2 over the picture, at which no more samples are begun.
    pub noise: Option<f32>,
}

impl Default for Path {
    fn default() -> Self {
        Self { samples: 256, max_depth: None, time_limit: None, noise: None }
    }
}

impl Path {
    /// The most samples: sums of more would lose their last bits in f32.
    pub const MAX_SAMPLES: u32 = 1 << 20;

    fn validate(&self) -> Result<(), EstimateError> {
        range("samples", self.samples, Self::MAX_SAMPLES)?;
        if let Some(depth) = self.max_depth {
            range("max_depth", depth, u32::MAX)?;
        }
        let above = |key, value: Option<f64>| match value {
            Some(v) if !(v.is_finite() && v > 0.0) => {
                Err(EstimateError::Conflict(format!("{key} = {v}; it must be a finite number above 0")))
            }
            _ => Ok(()),
        };
        above("time_limit", self.time_limit)?;
        above("noise", self.noise.map(f64::from))
    }
}

/// Estimators of an environment's light.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentEstimate {
    /// Records of directional light at the cells of a coarse grid (Delalandre, Gautron and Marvie 2013).
    Records(Records),
}

/// Estimators of analytic lights.
#[derive(Clone, Debug, PartialEq)]
pub enum LightsEstimate {
    /// Every light at every view sample, shadowed by a field of the way's density that spreads from cell to cell
    /// (Giroud and Biri 2011).
    Opacity(Opacity),
    /// Every light at every view sample.
    Direct(Direct),
    /// Every light at every view sample, as a surface across the density's gradient sends it on.
    Local(Local),
}

/// Estimators of light that was scattered before.
#[derive(Clone, Debug, PartialEq)]
pub enum ScatteringEstimate {
    /// Discrete ordinates by sweeps over a coarse grid.
    Sweeps(Sweeps),
}

/// Options of `sweeps`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweeps {
    /// Cells along the longest side of the box; the others in proportion.
    pub cells: u32,
    /// Bands of spherical harmonics that scattered light keeps.
    pub bands: u32,
    /// Directions: 12·n² for a whole n.
    pub directions: u32,
    /// Which orders of scattering.
    pub orders: Orders,
}

impl Default for Sweeps {
    fn default() -> Self {
        Self { cells: 40, bands: 3, directions: 48, orders: Orders::default() }
    }
}

/// Orders of scattering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orders {
    /// All, until what a further sweep changes is at or below this share of the light, in the mean square.
    Converged {
        /// The share.
        tolerance: f32,
    },
    /// So many, the first included.
    Count(u32),
}

impl Default for Orders {
    fn default() -> Self {
        Self::Converged { tolerance: Self::TOLERANCE }
    }
}

impl Orders {
    /// Tolerance unless another is asked for.
    pub const TOLERANCE: f32 = 1e-3;
    /// The most orders.
    pub const MAX: u32 = 10_000;

    pub(super) fn validate(self) -> Result<(), EstimateError> {
        match self {
            Self::Count(orders) => range("orders", orders, Self::MAX),
            Self::Converged { tolerance } if tolerance > 0.0 && tolerance < 1.0 => Ok(()),
            Self::Converged { tolerance } => {
                Err(EstimateError::Conflict(format!("tolerance = {tolerance}; it must be above 0 and below 1")))
            }
        }
    }
}

/// Options of `opacity`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Opacity {
    /// Cells along the longest side of the box; the others in proportion.
    pub cells: u32,
    /// How the way's density spreads.
    pub scheme: Scheme,
    /// The shadow of surfaces.
    pub surface_shadow: SurfaceShadow,
}

impl Default for Opacity {
    fn default() -> Self {
        Self { cells: 64, scheme: Scheme::ShortCharacteristics, surface_shadow: SurfaceShadow::default() }
    }
}

/// How the way's density spreads from cell to cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// From one plane nearer to the light, interpolated, with exact ways between.
    ShortCharacteristics,
    /// From the neighbours toward the light; a hop is as long as its share of the way.
    Metric,
    /// From the neighbours toward the light; a hop is a whole cell, as published, which overestimates.
    Published,
}

/// Options of `direct`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Direct {
    /// The medium's own shadow.
    pub shadow: Shadow,
    /// The shadow of surfaces.
    pub surface_shadow: SurfaceShadow,
}

/// Options of `local`: of light of irradiance E, J = E (ka/4π + max(n·l, 0) (kd/π + ks (m + 2)/2π cosᵐα)), with n against the
/// density's gradient, as surfaces reflect it, and no shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local {
    /// ka, 0 to [`Local::MOST`]: 1 is an isotropic phase function, and all there is where the density is level.
    pub ambient: f32,
    /// kd, 0 to [`Local::MOST`].
    pub diffuse: f32,
    /// ks, 0 to [`Local::MOST`].
    pub specular: f32,
    /// m, 1 to [`Material::MAX_SHININESS`].
    pub shininess: f32,
}

impl Default for Local {
    fn default() -> Self {
        Self { ambient: 1.0, diffuse: 0.8, specular: 0.04, shininess: 32.0 }
    }
}

impl Local {
    /// The largest reflectance: it stands for no surface, and 1 is no limit.
    pub const MOST: f32 = 100.0;

    fn validate(&self) -> Result<(), EstimateError> {
        let within = |key, value: f32, low: f32, high: f32| {
            let text = || format!("{key} = {value}; it must be from {low} to {high}");
            if (low..=high).contains(&value) { Ok(()) } else { Err(EstimateError::Conflict(text())) }
        };
        within("ambient", self.ambient, 0.0, Self::MOST)?;
        within("diffuse", self.diffuse, 0.0, Self::MOST)?;
        within("specular", self.specular, 0.0, Self::MOST)?;
        within("shininess", self.shininess, 1.0, Material::MAX_SHININESS)
    }
}

/// How surfaces shadow analytic lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceShadow {
    /// In the medium by maps of the lights, whose faces have so many texels along each side
    /// ([`stage::Shadow`](crate::stage::Shadow)); on surfaces by rays.
    Map(u32),
    /// By a ray from every view sample and surface.
    Ray,
    /// Not at all.
    None,
}

impl Default for SurfaceShadow {
    fn default() -> Self {
        Self::Map(Self::TEXELS)
    }
}

impl SurfaceShadow {
    /// Texels along each side of a face, unless others are asked for.
    pub const TEXELS: u32 = 512;
    /// The most of them.
    pub const MAX_TEXELS: u32 = 8192;

    fn validate(self) -> Result<(), EstimateError> {
        match self {
            Self::Map(texels) => range("surface_shadow.texels", texels, Self::MAX_TEXELS),
            Self::Ray | Self::None => Ok(()),
        }
    }
}

impl LightsEstimate {
    /// The shadow of surfaces.
    pub fn surface_shadow(&self) -> SurfaceShadow {
        match self {
            Self::Opacity(opacity) => opacity.surface_shadow,
            Self::Direct(direct) => direct.surface_shadow,
            Self::Local(_) => SurfaceShadow::None,
        }
    }

    fn validate(&self) -> Result<(), EstimateError> {
        match self {
            Self::Opacity(opacity) => range("cells", opacity.cells, Opacity::MAX_CELLS)?,
            Self::Local(local) => local.validate()?,
            Self::Direct(_) => (),
        }
        self.surface_shadow().validate()
    }
}

/// The medium's own shadow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Shadow {
    /// A march toward the light from every view sample.
    #[default]
    March,
    /// The field of [`Opacity`] with its default options.
    Propagated,
    /// No shadow.
    None,
}

/// Options out of range, or that do not fit the scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimateError {
    /// A number out of range.
    #[error("{key} = {value}; {range}")]
    Range {
        /// Name of the option.
        key: &'static str,
        /// Its value.
        value: u32,
        /// What would be right.
        range: String,
    },
    /// Options that exclude each other.
    #[error("{0}")]
    Conflict(String),
    /// A sun that cannot be taken out.
    #[error("extract_sun = true {0}")]
    Sun(&'static str),
    /// What is wrong with the estimator of one light.
    #[error("{what}")]
    Part {
        /// The field of [`Estimate`].
        part: &'static str,
        /// What is wrong with it.
        what: Box<EstimateError>,
    },
}

impl EstimateError {
    /// The same, of the field of [`Estimate`] that it is about.
    fn of(part: &'static str) -> impl Fn(Self) -> Self {
        move |what| Self::Part { part, what: Box::new(what) }
    }
}

impl Sweeps {
    /// The most cells along a side.
    pub const MAX_CELLS: u32 = Records::MAX_CELLS;

    /// The n of 12·n² directions, where there is one.
    pub fn nside(&self) -> Option<u32> {
        nside(self.directions)
    }

    fn validate(&self, phase: &Phase) -> Result<(), EstimateError> {
        range("cells", self.cells, Self::MAX_CELLS)?;
        range("bands", self.bands, Records::MAX_BANDS)?;
        self.orders.validate()?;
        resolved(self.directions, self.bands.min(phase.reach().unwrap_or(u32::MAX)))
    }
}

/// The n of 12·n² directions, where there is one.
pub(super) fn nside(directions: u32) -> Option<u32> {
    let n = (f64::from(directions) / 12.0).sqrt().round() as u32;
    ((1..=Records::MAX_NSIDE).contains(&n) && 12 * n * n == directions).then_some(n)
}

/// An error unless HEALPix has so many directions and they keep the bands apart.
pub(super) fn resolved(directions: u32, bands: u32) -> Result<(), EstimateError> {
    resolving(directions, &format!("{bands} bands of spherical harmonics"), || coarsest_nside(bands))
}

/// An error unless HEALPix has so many directions, and at least those of the `coarsest` n that `what` needs.
pub(super) fn resolving(directions: u32, what: &str, coarsest: impl FnOnce() -> u32) -> Result<(), EstimateError> {
    let wrong = |range: String| Err(EstimateError::Range { key: "directions", value: directions, range });
    if nside(directions).is_none() {
        let n = (f64::from(directions) / 12.0).sqrt().ceil().clamp(1.0, Records::MAX_NSIDE.into()) as u32;
        return wrong(format!("HEALPix takes 12·n² directions with n from 1 to 64; the next is {}", 12 * n * n));
    }
    let coarsest = 12 * coarsest().pow(2);
    if directions < coarsest {
        return wrong(format!("{what} need at least {coarsest} directions"));
    }
    Ok(())
}

/// An error unless the option is from 1 to `max`.
pub(super) fn range(key: &'static str, value: u32, max: u32) -> Result<(), EstimateError> {
    if (1..=max).contains(&value) {
        Ok(())
    } else {
        Err(EstimateError::Range { key, value, range: format!("it must be from 1 to {max}") })
    }
}

impl Opacity {
    /// The most cells along a side.
    pub const MAX_CELLS: u32 = 1024;
}

/// The smallest n for which 12·n² HEALPix directions keep the first `bands` of spherical harmonics apart: their Gram
/// matrix is off by at most [`GRAM_TOLERANCE`].
pub(super) fn coarsest_nside(bands: u32) -> u32 {
    static FOUND: [OnceLock<u32>; Records::MAX_BANDS as usize] =
        [const { OnceLock::new() }; Records::MAX_BANDS as usize];
    let fits = |n: &u32| {
        let directions = healpix::directions(*n);
        let weights = vec![healpix::weight(*n); directions.len()];
        SphericalHarmonics::new(bands).is_ok_and(|basis| gram_error(&basis, &directions, &weights) <= GRAM_TOLERANCE)
    };
    let index = (bands as usize).clamp(1, FOUND.len()) - 1;
    *FOUND[index].get_or_init(|| (1..=Records::MAX_NSIDE).find(fits).unwrap_or(Records::MAX_NSIDE))
}

impl Estimate {
    /// Checks every option against its range and the medium's phase function.
    ///
    /// # Errors
    /// The first option that is out of range or does not fit.
    pub fn validate(&self, phase: &Phase) -> Result<(), EstimateError> {
        if let Some(all) = &self.all {
            if self.environment.is_some() || self.lights.is_some() || self.scattering.is_some() {
                let text = format!("`{}` brings all light, and no other estimator beside it", all.name());
                return Err(EstimateError::Conflict(text));
            }
            match all {
                AllEstimate::Path(path) => path.validate(),
                AllEstimate::Transfer(transfer) => transfer.validate(phase),
            }
            .map_err(EstimateError::of("all"))?;
        }
        match &self.environment {
            Some(EnvironmentEstimate::Records(records)) => {
                records.validate(phase).map_err(EstimateError::of("environment"))?;
                if records.extract_sun == ExtractSun::Always && self.lights.is_none() {
                    return Err(EstimateError::Sun(
                        "lights the sun by estimate.lights, which is \"none\"; give it \"opacity\" or \"direct\", or leave \
                         extract_sun out",
                    ));
                }
            }
            None => (),
        }
        if let Some(lights) = &self.lights {
            lights.validate().map_err(EstimateError::of("lights"))?;
        }
        if let Some(ScatteringEstimate::Sweeps(sweeps)) = &self.scattering {
            sweeps.validate(phase).map_err(EstimateError::of("scattering"))?;
        }
        Ok(())
    }
}
