//! How a precomputed transfer is made and rendered from.

use std::sync::Arc;

use super::estimate::{EstimateError, Orders, coarsest_nside, range, resolved};
use super::records::Records;
use crate::basis::{Basis, BasisError, DiscreteSpherical, RadialFunctions, SphericalHarmonics};
use crate::light::Prefilter;
use crate::media::Phase;
use crate::stage::Photons;
use crate::transfer::Transfer;

/// The functions on the sphere that light is described by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LightBasis {
    /// Discrete spherical functions at so many directions.
    Discrete {
        /// 12, 42, 162, 642 or 2562.
        functions: u32,
    },
    /// Spherical harmonics.
    Harmonics {
        /// Bands: bands² functions.
        bands: u32,
    },
    /// Spherical radial basis functions at so many directions.
    Radial {
        /// 12, 42, 162, 642 or 2562.
        functions: u32,
    },
}

impl LightBasis {
    /// Number of functions.
    pub fn count(self) -> u32 {
        match self {
            Self::Discrete { functions } | Self::Radial { functions } => functions,
            Self::Harmonics { bands } => bands * bands,
        }
    }

    /// The functions.
    ///
    /// # Errors
    /// A number that the basis does not come in.
    pub fn functions(self) -> Result<Box<dyn Basis>, BasisError> {
        Ok(match self {
            Self::Discrete { functions } => Box::new(DiscreteSpherical::new(functions)?),
            Self::Harmonics { bands } => Box::new(SphericalHarmonics::new(bands)?),
            Self::Radial { functions } => Box::new(RadialFunctions::new(functions)?),
        })
    }

    /// The least n of 12·n² directions among which each function has four of its own.
    pub(crate) fn nside(self) -> u32 {
        (f64::from(self.count()) / 3.0).sqrt().ceil() as u32
    }
}

/// How light that was scattered reaches the cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TransferSolver {
    /// By photons ([`stage::Photons`](crate::stage::Photons)).
    Photons {
        /// Photons for each cell of the box's faces and each function of the basis.
        count: f64,
        /// Where they leave light.
        deposit: Deposit,
        /// Cells around a collision that get something of it, unless light is left along tracks.
        radius: f32,
    },
    /// By discrete ordinates ([`stage::Sweep`](crate::stage::Sweep)): without noise.
    Ordinates {
        /// Directions of scattered light: 12·n² for a whole n. None for as many as the bands that count need, and at least
        /// [`Precompute::DIRECTIONS`].
        directions: Option<u32>,
    },
}

/// Where photons leave light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Deposit {
    /// In every cell that they cross.
    Track,
    /// Around every collision.
    Collision,
    /// Around where they are absorbed, as published.
    Absorption,
}

/// Options of a transfer that is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precompute {
    /// Cells along the longest side of the box; the others in proportion.
    pub cells: u32,
    /// What light is described by.
    pub basis: LightBasis,
    /// Bands of spherical harmonics that the radiance at a cell keeps; no more than the phase function reaches count.
    pub bands: u32,
    /// How scattered light reaches the cells.
    pub solver: TransferSolver,
    /// Which orders of scattering.
    pub orders: Orders,
    /// Clusters of cells; none leaves every cell its own matrix.
    pub clusters: Option<u32>,
    /// Matrices of a cluster beside its mean.
    pub components: u32,
    /// Bytes that the host may take for matrices; by default three quarters of what is free.
    pub memory: Option<u64>,
}

impl Default for Precompute {
    fn default() -> Self {
        let basis = LightBasis::Discrete { functions: 642 };
        Self {
            cells: 64,
            basis,
            bands: 4,
            solver: TransferSolver::Photons {
                count: Self::photons(basis),
                deposit: Deposit::Track,
                radius: Photons::RADIUS,
            },
            orders: Orders::default(),
            clusters: Some(128),
            components: 4,
            memory: None,
        }
    }
}

impl Precompute {
    /// The fewest directions of ordinates unless others are asked for.
    pub const DIRECTIONS: u32 = 48;
    /// The most cells along a side.
    pub const MAX_CELLS: u32 = 512;
    /// The most clusters.
    pub const MAX_CLUSTERS: u32 = 65_536;
    /// The most components.
    pub const MAX_COMPONENTS: u32 = 64;
    /// The most photons for each cell of the box's faces and function.
    pub const MAX_PHOTONS: f64 = 1e6;

    /// Photons for each cell of the box's faces and each function, unless others are asked for: as published.
    pub fn photons(basis: LightBasis) -> f64 {
        match basis {
            LightBasis::Harmonics { .. } => 100.0,
            LightBasis::Discrete { .. } | LightBasis::Radial { .. } => 10.0,
        }
    }

    /// Bands that count.
    pub(crate) fn bands_of(&self, phase: &Phase) -> u32 {
        self.bands.min(phase.reach().unwrap_or(u32::MAX))
    }

    /// Directions of ordinates unless others are asked for.
    pub(crate) fn directions(&self, phase: &Phase) -> u32 {
        Self::DIRECTIONS.max(12 * coarsest_nside(self.bands_of(phase)).pow(2))
    }

    /// Checks every option against its range and the medium's phase function.
    ///
    /// # Errors
    /// The first option that is out of range or does not fit.
    pub fn validate(&self, phase: &Phase) -> Result<(), EstimateError> {
        range("cells", self.cells, Self::MAX_CELLS)?;
        range("bands", self.bands, Records::MAX_BANDS)?;
        if let Some(clusters) = self.clusters {
            range("clusters", clusters, Self::MAX_CLUSTERS)?;
        }
        if self.components > Self::MAX_COMPONENTS {
            range("components", self.components, Self::MAX_COMPONENTS)?;
        }
        self.basis.functions().map_err(|error| EstimateError::Conflict(error.to_string()))?;
        self.orders.validate()?;
        match self.solver {
            TransferSolver::Ordinates { directions } => {
                resolved(directions.unwrap_or_else(|| self.directions(phase)), self.bands_of(phase))
            }
            TransferSolver::Photons { radius, .. } if !(1.0..=Photons::FARTHEST).contains(&radius) => {
                let range = Photons::FARTHEST;
                Err(EstimateError::Conflict(format!("radius = {radius}; it must be from 1 to {range} cells")))
            }
            TransferSolver::Photons { count, .. } if count > 0.0 && count <= Self::MAX_PHOTONS => Ok(()),
            TransferSolver::Photons { count, .. } => Err(EstimateError::Conflict(format!(
                "photons = {count}; it must be above 0 and at most {}",
                Self::MAX_PHOTONS
            ))),
        }
    }
}

/// How light that leaves a cell depends on the direction of view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewDependence {
    /// Toward the eye from each cell's centre: one value a cell.
    Cell,
    /// Along each view ray, at every sample.
    Sample,
    /// Toward the eye from the middle of each cluster, as published.
    Cluster,
}

/// Where a transfer comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum TransferSource {
    /// It was made before.
    Made(Arc<Transfer>),
    /// It is made before the first picture.
    Making(Precompute),
}

/// Options of `transfer`.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferEstimate {
    /// The transfer.
    pub source: TransferSource,
    /// How it is seen.
    pub view: ViewDependence,
    /// How the environment becomes coefficients of discrete spherical functions.
    pub prefilter: Prefilter,
}

impl Default for TransferEstimate {
    fn default() -> Self {
        Self {
            source: TransferSource::Making(Precompute::default()),
            view: ViewDependence::Cell,
            prefilter: Prefilter::Energy,
        }
    }
}

impl TransferEstimate {
    pub(super) fn validate(&self, phase: &Phase) -> Result<(), EstimateError> {
        match self.source {
            TransferSource::Made(_) => Ok(()),
            TransferSource::Making(options) => options.validate(phase),
        }
    }
}
