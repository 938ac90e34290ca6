//! Options of `records`.

use std::sync::OnceLock;

use super::estimate::{EstimateError, nside, range, resolved, resolving};
use crate::basis::{DiscreteSpherical, GRAM_TOLERANCE, SphericalHarmonics, Window, healpix};
use crate::media::Phase;

/// Options of `records`.
#[derive(Clone, Debug, PartialEq)]
pub struct Records {
    /// Cells along the longest side of the box; the others in proportion.
    pub cells: u32,
    /// Bands of spherical harmonics.
    pub bands: u32,
    /// In which functions the light is kept, where it is.
    pub basis: RecordBasis,
    /// Directions per record: 12·n² for a whole n.
    pub directions: u32,
    /// What a record holds.
    pub content: Content,
    /// How the march reads between records.
    pub interpolation: Interpolation,
    /// Which cells are left out because they are empty.
    pub elimination: Elimination,
    /// How the light of each direction reaches the cells.
    pub solver: Solver,
    /// Whether the environment's sun is lit as a directional light.
    pub extract_sun: ExtractSun,
    /// What fades the last bands: of the light where that is truncated, else of the phase function.
    pub window: Window,
}

impl Default for Records {
    fn default() -> Self {
        Self {
            cells: 50,
            bands: 3,
            basis: RecordBasis::Harmonics,
            directions: 48,
            content: Content::Radiance,
            interpolation: Interpolation::Trilinear,
            elimination: Elimination::Exact,
            solver: Solver::Sweep,
            extract_sun: ExtractSun::Auto,
            window: Window::None,
        }
    }
}

/// In which functions light is kept ([`Content::Transmittance`], [`Content::Phase`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum RecordBasis {
    /// In [`Records::bands`] bands of spherical harmonics.
    #[default]
    Harmonics,
    /// In so many [discrete spherical functions](crate::basis::DiscreteSpherical).
    Discrete(u32),
}

impl RecordBasis {
    /// Numbers of discrete functions that records take.
    pub const FUNCTIONS: [u32; 4] = [12, 42, 162, 642];
    /// Discrete functions unless another number is asked for.
    pub const DISCRETE: u32 = 42;
}

/// How the light of each direction reaches the cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// From the cells before, plane by plane: one step a cell and direction ([`stage::Sweep`](crate::stage::Sweep)). All cells
    /// are filled, so that [`Records::elimination`] has no say.
    Sweep,
    /// By a march from every cell that matters, as published ([`stage::Project`](crate::stage::Project)).
    March,
}

/// Whether the environment's sun is taken out of it and lit as a directional light
/// ([`Environment::split`](crate::light::Environment::split)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExtractSun {
    /// Where that brings the light in the medium nearer to the truth ([`Scene::sun`](crate::scene::Scene::sun)).
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// What a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Moments of attenuated radiance; the whole light, and `bands` limits the reach of the phase function.
    Radiance,
    /// Moments of transmittance: a new light needs no new records; light truncated to `bands`, isotropic media only.
    Transmittance,
    /// Moments of transmittance times the phase function toward the eye; light truncated to `bands`.
    Phase,
}

/// How the march reads between records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Between the eight nearest records.
    Trilinear,
    /// The record of the cell.
    Nearest,
}

/// Which cells are left out because they are empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elimination {
    /// Cells that no sample with density can read: the picture is the same to the last bit.
    Exact,
    /// Cells where n³ evenly spread probes find no density, as published; may lose light.
    Probes(u32),
    /// None.
    None,
}

impl Records {
    /// The most cells along a side.
    pub const MAX_CELLS: u32 = 1024;
    /// The most bands of spherical harmonics.
    pub const MAX_BANDS: u32 = SphericalHarmonics::DEVICE_BANDS;
    /// The most probes along a side of a cell.
    pub const MAX_PROBES: u32 = 64;
    /// The largest n of 12·n² directions.
    pub const MAX_NSIDE: u32 = healpix::MAX_NSIDE;

    /// The n of 12·n² directions, where there is one.
    pub fn nside(&self) -> Option<u32> {
        nside(self.directions)
    }

    pub(super) fn validate(&self, phase: &Phase) -> Result<(), EstimateError> {
        range("cells", self.cells, Self::MAX_CELLS)?;
        range("bands", self.bands, Self::MAX_BANDS)?;
        if let Elimination::Probes(n) = self.elimination {
            range("probes", n, Self::MAX_PROBES)?;
        }
        let bands = match self.content {
            Content::Radiance => self.bands.min(phase.reach().unwrap_or(u32::MAX)),
            Content::Transmittance | Content::Phase => self.bands,
        };
        match self.basis {
            RecordBasis::Harmonics => resolved(self.directions, bands)?,
            RecordBasis::Discrete(functions) => self.discrete(functions)?,
        }
        if matches!(self.elimination, Elimination::Probes(_)) && self.solver == Solver::Sweep {
            return Err(EstimateError::Conflict(
                "sweeps fill every cell, and probes would leave some out; take solver = \"march\" or elimination = \"exact\""
                    .into(),
            ));
        }
        if self.content == Content::Phase && self.solver == Solver::Sweep {
            return Err(EstimateError::Conflict(
                "content = \"phase\" weighs every direction toward the eye at each cell, which sweeps do not; take solver = \
                 \"march\""
                    .into(),
            ));
        }
        if self.content == Content::Transmittance && !phase.is_isotropic() {
            return Err(EstimateError::Conflict(
                "content = \"transmittance\" holds for an isotropic phase function only; \
                 take \"radiance\" or \"phase\", or set anisotropy = 0"
                    .into(),
            ));
        }
        Ok(())
    }

    /// What records in discrete functions ask for.
    fn discrete(&self, functions: u32) -> Result<(), EstimateError> {
        let wrong = |range: String| Err(EstimateError::Range { key: "basis.functions", value: functions, range });
        if !RecordBasis::FUNCTIONS.contains(&functions) {
            return wrong(format!("{:?} can be had", RecordBasis::FUNCTIONS));
        }
        let conflict = |text: &str| Err(EstimateError::Conflict(text.into()));
        if self.content == Content::Radiance {
            return conflict(
                "content = \"radiance\" is moments of spherical harmonics, band by band of the phase function; basis = \"dsf\" \
                 holds the light of content = \"transmittance\" and \"phase\"",
            );
        }
        if self.window != Window::None {
            return conflict("window fades bands, and basis = \"dsf\" has none; leave one of them out");
        }
        let most = SphericalHarmonics::DEVICE_BANDS.pow(2);
        if self.solver == Solver::March && functions > most {
            return wrong(format!(
                "solver = \"march\" holds {most} functions; take 42, or solver = \"sweep\" where content is \"transmittance\""
            ));
        }
        resolving(self.directions, &format!("{functions} discrete spherical functions"), || coarsest_for(functions))
    }
}

/// The smallest n for which 12·n² HEALPix directions keep so many discrete functions apart, by the same measure.
fn coarsest_for(functions: u32) -> u32 {
    static FOUND: [OnceLock<u32>; RecordBasis::FUNCTIONS.len()] = [const { OnceLock::new() }; 4];
    let fits = |n: &u32| {
        let directions = healpix::directions(*n);
        let weights = vec![healpix::weight(*n); directions.len()];
        DiscreteSpherical::new(functions).is_ok_and(|basis| basis.gram_error(&directions, &weights) <= GRAM_TOLERANCE)
    };
    let index = RecordBasis::FUNCTIONS.iter().position(|&n| n == functions).unwrap_or(0);
    *FOUND[index].get_or_init(|| (1..=Records::MAX_NSIDE).find(fits).unwrap_or(Records::MAX_NSIDE))
}

#[cfg(test)]
mod tests {
    use super::super::estimate::coarsest_nside;
    use super::*;

    #[test]
    fn directions_must_resolve_the_bands() {
        assert_eq!([1, 3, 6, 10].map(coarsest_nside), [1, 2, 3, 5]);
        let options = |bands, directions, content| Records {
            bands,
            directions,
            content,
            solver: Solver::March,
            ..Records::default()
        };
        let hg = Phase::HenyeyGreenstein { g: 0.5 };
        assert!(options(3, 12, Content::Phase).validate(&hg).is_err());
        assert!(options(3, 48, Content::Phase).validate(&hg).is_ok());
        assert!(options(10, 192, Content::Radiance).validate(&hg).is_err());
        // An isotropic medium asks for one band, whatever the option says.
        assert!(options(10, 12, Content::Radiance).validate(&Phase::Isotropic).is_ok());
        assert!(options(3, 100, Content::Phase).validate(&hg).is_err(), "not 12·n²");
    }

    #[test]
    fn discrete_functions_hold_light_and_nothing_else() {
        assert_eq!(RecordBasis::FUNCTIONS.map(coarsest_for), [2, 4, 8, 15]);
        let options = |functions, directions| Records {
            basis: RecordBasis::Discrete(functions),
            directions,
            content: Content::Transmittance,
            ..Records::default()
        };
        let told = |records: Records| match records.validate(&Phase::Isotropic) {
            Ok(()) => String::new(),
            Err(error) => error.to_string(),
        };
        assert_eq!(told(options(42, 192)), "");
        assert_eq!(told(Records { solver: Solver::March, ..options(42, 192) }), "");
        assert!(told(options(100, 192)).starts_with("basis.functions = 100; [12, 42, 162, 642] can be had"));
        assert!(told(options(162, 48)).contains("162 discrete spherical functions need at least"));
        assert!(told(Records { solver: Solver::March, ..options(162, 768) }).contains("holds 100 functions"));
        assert!(told(Records { content: Content::Radiance, ..options(42, 192) }).contains("\"transmittance\""));
        assert!(told(Records { window: Window::Lanczos, ..options(42, 192) }).contains("window fades bands"));
    }
}
