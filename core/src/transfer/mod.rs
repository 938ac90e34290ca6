//! Precomputed radiance transfer (Zhang, Dong and Ma 2013): what a medium makes of any light from far away.
//!
//! Light is s_k, coefficients on a [`LightBasis`]. For each function of the basis, light is carried through the medium once
//! ([`Renderer::precompute`](crate::exec::Renderer::precompute)), and leaves at each cell x of a coarse grid the moments of
//! its incident radiance, all orders of scattering included:
//!
//! M_jk(x) = ∫ L_k(x, ω) Y_j(ω) dω, in-scattered radiance J(x, d) = Σ_j β_j Y_j(d) Σ_k M_jk(x) s_k.
//!
//! Cells that no sample with density reads have no matrix: the others are *rows*. A [`Transfer`] holds their matrices as they are
//! or compressed by clustered principal components ([`compress`]), for one channel where the medium is grey and for three
//! where it is coloured.

mod compress;
mod origin;

use std::fmt;

use glam::Vec3;

pub use compress::{Matrices, compress};
pub use origin::Origin;
pub(crate) use origin::identity;

use crate::Version;
use crate::basis::BasisError;
use crate::device::Bytes;
use crate::scene::LightBasis;

/// What a medium makes of light, ready to be lit.
#[derive(Clone)]
pub struct Transfer {
    shape: Shape,
    origin: Origin,
    channels: Vec<Channel>,
    version: Version,
}

/// The sizes of a transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Cells along x, y, z over the box of the medium.
    pub cells: [u32; 3],
    /// The cell of each row, rising; cells count x fastest.
    pub rows: Vec<u32>,
    /// What light is described by: K functions.
    pub basis: LightBasis,
    /// Bands of the moments: J = bands².
    pub bands: u32,
    /// Clusters: as many as rows where every row has a matrix of its own.
    pub clusters: u32,
    /// N, the matrices of a cluster beside its mean.
    pub components: u32,
}

impl Shape {
    /// Of each cell the number of its row plus 1; 0 for none.
    pub(crate) fn places(&self) -> Vec<u32> {
        places(self.cells, &self.rows)
    }
}

/// Of each cell the number of its row plus 1; 0 for none.
pub(crate) fn places(cells: [u32; 3], rows: &[u32]) -> Vec<u32> {
    let mut places = vec![0; cells.iter().map(|&n| n as usize).product()];
    rows.iter().zip(1..).for_each(|(&cell, row)| places[cell as usize] = row);
    places
}

/// The transfer of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Mean and components of each cluster, laid out \[cluster\]\[1 + N\]\[J\]\[K\].
    pub matrices: Vec<f32>,
    /// The cluster of each row.
    pub clusters: Vec<u32>,
    /// Weights of the components, laid out \[row\]\[N\].
    pub weights: Vec<f32>,
    /// Of each cluster, what compression loses: the relative L2 of its rows' matrices.
    pub errors: Vec<f32>,
    /// The same of all rows together.
    pub loss: f32,
}

/// Why values are no transfer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransferError {
    /// Sizes that do not fit each other.
    #[error("{0}")]
    Shape(String),
    /// A transfer that was made of something else.
    #[error("the transfer was made of another {0}; make it again")]
    Stale(&'static str),
    /// A basis that there is not.
    #[error(transparent)]
    Basis(#[from] BasisError),
    /// Photons left more light in a cell than its integers hold.
    #[error("photons leave too much light in a cell to be counted; fewer photons or solver = \"ordinates\" would do")]
    Overflow,
    /// Matrices that need more memory than there is; no light was carried.
    #[error(
        "the transfer of {rows} cells, {functions} functions, {bands} bands and {channels} channels needs {} of memory while \
         it is made, and {} may be used; fewer cells, functions or bands need less",
        Bytes(*needed),
        Bytes(*budget)
    )]
    Memory {
        /// Bytes that the host would take.
        needed: u64,
        /// Bytes that it may.
        budget: u64,
        /// Cells with a matrix.
        rows: u64,
        /// Functions of the basis.
        functions: u32,
        /// Bands of the moments.
        bands: u32,
        /// Channels that differ.
        channels: u32,
    },
}

impl fmt::Debug for Transfer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Shape { cells, basis, bands, clusters, components, .. } = &self.shape;
        let mut said = f.debug_struct("Transfer");
        said.field("cells", cells).field("basis", basis).field("bands", bands).field("clusters", clusters);
        said.field("components", components).field("channels", &self.channels.len()).finish_non_exhaustive()
    }
}

impl PartialEq for Transfer {
    fn eq(&self, other: &Self) -> bool {
        self.version == other.version
    }
}

impl Transfer {
    /// A transfer of one channel, or of three.
    ///
    /// # Errors
    /// [`TransferError::Shape`] where sizes do not fit each other, an index leads nowhere, or a value is not finite.
    pub fn new(shape: Shape, origin: Origin, channels: Vec<Channel>) -> Result<Self, TransferError> {
        let wrong = |text: String| Err(TransferError::Shape(text));
        let cells: u64 = shape.cells.iter().map(|&n| u64::from(n)).product();
        let rows = shape.rows.len() as u64;
        if cells == 0 || cells > u64::from(u32::MAX) {
            return wrong(format!("{:?} cells", shape.cells));
        }
        if !shape.rows.is_sorted_by(|a, b| a < b) || shape.rows.last().is_some_and(|&last| u64::from(last) >= cells) {
            return wrong(format!("rows that do not rise, or lead beyond {cells} cells"));
        }
        shape.basis.functions()?;
        let functions = shape.basis.count();
        let (clusters, components) = (u64::from(shape.clusters), u64::from(shape.components));
        if clusters > rows || (rows > 0 && clusters == 0) {
            return wrong(format!("{clusters} clusters of {rows} rows"));
        }
        if ![1, 3].contains(&channels.len()) {
            return wrong(format!("{} channels; it must be 1 or 3", channels.len()));
        }
        if !(1..=crate::basis::SphericalHarmonics::DEVICE_BANDS).contains(&shape.bands) {
            return wrong(format!("{} bands", shape.bands));
        }
        let matrix = u64::from(shape.bands * shape.bands) * u64::from(functions);
        for channel in &channels {
            let lengths = [
                ("matrix values", channel.matrices.len(), clusters * (1 + components) * matrix),
                ("cluster numbers", channel.clusters.len(), rows),
                ("weights", channel.weights.len(), rows * components),
                ("errors", channel.errors.len(), clusters),
            ];
            for (what, found, expected) in lengths {
                if found as u64 != expected {
                    return wrong(format!("{found} {what} for {expected}"));
                }
            }
            if channel.clusters.iter().any(|&cluster| u64::from(cluster) >= clusters) {
                return wrong(format!("a row of a cluster beyond {clusters}"));
            }
            let mut values =
                channel.matrices.iter().chain(&channel.weights).chain(&channel.errors).chain([&channel.loss]);
            if values.any(|value| !value.is_finite()) {
                return wrong("a value that is not finite".into());
            }
        }
        Ok(Self { shape, origin, channels, version: Version::fresh() })
    }

    /// The sizes.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// What it was made of.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// One channel for all of RGB, or each of them.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Identity of the values.
    pub fn version(&self) -> Version {
        self.version
    }

    /// Bytes of all values.
    pub fn bytes(&self) -> u64 {
        let of = |channel: &Channel| {
            channel.matrices.len() + channel.clusters.len() + channel.weights.len() + channel.errors.len()
        };
        4 * (self.shape.rows.len() + self.channels.iter().map(of).sum::<usize>()) as u64
    }
}

/// Whether one channel serves all of a medium's.
pub(crate) fn is_grey(optics: &crate::media::Optics, scatters_alike: bool) -> bool {
    let grey = |v: Vec3| v.x == v.y && v.y == v.z;
    grey(optics.extinction) && grey(optics.albedo) && scatters_alike
}
