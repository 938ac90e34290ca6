//! `reconstruct`: in-scattered radiance from what clusters of transfer matrices make of light (Zhang, Dong and Ma 2013,
//! equations 19 and 20).
//!
//! A cell's row r tells its cluster and what it weighs each of the cluster's components. With the output I of
//! [`Evaluate`](super::Evaluate), i = 0 the mean of a cluster, the moments of the radiance that arrives at the cell are
//!
//! I_j\[c\] = I\[cluster\]\[0\]\[j\]\[c\] + Σ_i `weights`\[r\]\[i\] · I\[cluster\]\[i\]\[j\]\[c\].
//!
//! With one channel, clusters, weights and I serve all of RGB; with three, component c is from those of channel c. β_j are
//! the phase function's moments. Without `view` the output has as many layers as moments, β_j I_j, for the march to weigh
//! with the direction of its ray. With `view` it has one, Σ_j β_j Y_j(d) I_j, for the direction d from the eye to the
//! cell's centre; a cell at the eye takes +Z for d.
//!
//! Cells of row 0 are zero, and those of row r > 0 have place r - 1 among the rows. What points past the last row or
//! cluster is taken for the last.
//!
//! The output is laid out \[cell\]\[layer\] as RGBA (A zero), ready to be published as a field. The work axis is the
//! cells, x fastest.

use crate::basis::SphericalHarmonics;
use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// Parameters of `reconstruct`.
    pub struct ReconstructParams {
        /// Row of the linear map from voxels to metres.
        world_x: F32x4,
        /// See `world_x`.
        world_y: F32x4,
        /// See `world_x`.
        world_z: F32x4,
        /// Cells along x, y, z; unused.
        cells: U32x4,
        /// Voxels of a cell along x, y, z; unused.
        cell: F32x4,
        /// The eye in index space; unused.
        eye: F32x4,
        /// Rows of a channel.
        rows: U32,
        /// Clusters of a channel.
        clusters: U32,
        /// Components of a cluster, its mean not counted.
        components: U32,
        /// Channels: 1 or 3.
        channels: U32,
        /// Bands of the moments, which are bands².
        bands: U32,
        /// 1 to sum the moments for the direction from the eye.
        view: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruct {
    /// Parameters.
    pub params: ReconstructParams,
    /// Row of each cell, counted from 1; 0 for none.
    pub rows: Buf<u32>,
    /// Cluster of each row, laid out \[channel\]\[row\].
    pub clusters: Buf<u32>,
    /// What a row weighs each component, laid out \[channel\]\[row\]\[component\].
    pub weights: Option<Buf<f32>>,
    /// I, laid out \[channel\]\[cluster\]\[mean, components\]\[moment\]: RGB; unused.
    pub radiance: Buf<[f32; 4]>,
    /// β_j of each moment; with `view`, then constants of spherical harmonics.
    pub tables: Buf<f32>,
    /// J, laid out \[cell\]\[layer\]: RGB; zero.
    pub out: Buf<[f32; 4]>,
}

impl ReconstructParams {
    /// Moments of a row.
    pub fn coefficients(&self) -> u32 {
        self.bands.saturating_mul(self.bands)
    }

    /// Layers of the output.
    pub fn layers(&self) -> u32 {
        if self.view == 1 { 1 } else { self.coefficients() }
    }
}

impl Reconstruct {
    /// The most turns of all loops for a cell.
    fn turns(&self) -> u64 {
        let p = &self.params;
        let (bands, moments) = (u64::from(p.bands), u64::from(p.coefficients()));
        bands + moments + moments * (1 + u64::from(p.channels) * u64::from(p.components))
    }
}

impl Kernel for Reconstruct {
    const NAME: &'static str = "reconstruct";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::read("rows", Some(self.rows)).in_parts::<u32>(1),
            Binding::read("clusters", Some(self.clusters)),
            Binding::read("weights", self.weights),
            Binding::read("radiance", Some(self.radiance)),
            Binding::read("tables", Some(self.tables)),
            Binding::write("in_scatter", Some(self.out)).in_parts::<[f32; 4]>(self.params.layers().into()),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.cells[..3].iter().product()
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let count = p.cells[..3].iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(count.is_some_and(|n| n > 0), "{:?} cells", p.cells);
        require!(p.cell[..3].iter().all(|c| c.is_finite() && *c > 0.0), "cells of {:?} voxels", p.cell);
        require!((1..=SphericalHarmonics::DEVICE_BANDS).contains(&p.bands), "{} bands", p.bands);
        require!([1, 3].contains(&p.channels), "{} channels", p.channels);
        require!(p.rows > 0 && p.clusters > 0, "{} rows in {} clusters", p.rows, p.clusters);
        let (cells, moments) = (u64::from(self.axis()), u64::from(p.coefficients()));
        let (channels, components) = (u64::from(p.channels), u64::from(p.components));
        let rows = channels * u64::from(p.rows);
        let (weights, layers) = (rows.saturating_mul(components), cells * u64::from(p.layers()));
        let radiance = (channels * u64::from(p.clusters)).saturating_mul((1 + components) * moments);
        // Kernels count values in 32 bits.
        let values = [rows, weights, radiance, layers];
        require!(values.iter().all(|v| u32::try_from(*v).is_ok()), "{values:?} values, more than 32 bits count");
        require!(self.rows.len >= cells, "rows of {} cells for {cells}", self.rows.len);
        require!(self.clusters.len >= rows, "clusters of {} rows for {rows}", self.clusters.len);
        require!(weights == 0 || self.weights.is_some_and(|b| b.len >= weights), "weights are missing or too few");
        require!(self.radiance.len >= radiance, "{} values of radiance for {radiance}", self.radiance.len);
        let constants = if p.view == 1 { u64::from(p.bands * (p.bands + 1)) } else { 0 };
        require!(self.tables.len >= moments + constants, "tables of {} values", self.tables.len);
        require!(self.out.len >= layers, "{} places for {layers}", self.out.len);
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let own = self.turns();
        require!(
            own <= turns,
            "a cell takes up to {own} turns of loops, and {turns} are allowed: fewer bands or components need less"
        );
        Ok(vec![self.clone()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::ResourceId;
    use bytemuck::Zeroable;

    /// 24 cells, 7 rows in 3 clusters of a mean and 2 components, 4 moments in three channels.
    fn reconstruct() -> Reconstruct {
        let mut params = ReconstructParams::zeroed();
        (params.cells, params.cell) = ([2, 3, 4, 0], [1.0, 2.0, 0.5, 0.0]);
        (params.rows, params.clusters, params.components) = (7, 3, 2);
        (params.channels, params.bands, params.view) = (3, 2, 1);
        Reconstruct {
            params,
            rows: Buf::new(ResourceId(0), 24),
            clusters: Buf::new(ResourceId(1), 21),
            weights: Some(Buf::new(ResourceId(2), 42)),
            radiance: Buf::new(ResourceId(3), 108),
            tables: Buf::new(ResourceId(4), 10),
            out: Buf::new(ResourceId(5), 24),
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert_eq!(reconstruct().validate(), Ok(()));
        let refused = |change: &dyn Fn(&mut Reconstruct), what: &str| {
            let mut stage = reconstruct();
            change(&mut stage);
            let error = stage.validate().unwrap_err();
            assert!(error.contains(what), "{error}");
        };
        refused(&|s| s.params.cells[1] = 0, "cells");
        refused(&|s| s.params.cell[2] = f32::NAN, "voxels");
        refused(&|s| s.params.bands = 11, "11 bands");
        refused(&|s| s.params.channels = 2, "2 channels");
        refused(&|s| s.params.rows = 0, "0 rows");
        refused(&|s| s.params.components = u32::MAX, "32 bits");
        refused(&|s| s.rows.len = 23, "rows of 23 cells");
        refused(&|s| s.clusters.len = 20, "clusters of 20 rows");
        refused(&|s| s.weights = None, "weights");
        refused(&|s| s.radiance.len = 107, "107 values of radiance");
        refused(&|s| s.tables.len = 9, "tables of 9 values");
        refused(&|s| s.params.view = 0, "24 places for 96");
        let mut plain = reconstruct();
        (plain.params.components, plain.weights) = (0, None);
        assert_eq!(plain.validate(), Ok(()));
    }

    #[test]
    fn cells_are_not_cut_into_passes() {
        assert_eq!(reconstruct().turns(), 2 + 4 + 4 * 7);
        assert_eq!(reconstruct().passes(34).unwrap(), [reconstruct()]);
        assert!(reconstruct().passes(33).unwrap_err().contains("34 turns"));
    }
}
