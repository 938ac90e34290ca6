//! `evaluate` and `reconstruct` as benchmarks, at the sizes that Zhang, Dong and Ma 2013 recommend.

use airlight::basis::recurrence_table;
use airlight::device::{DeviceError, Usage};
use airlight::glam::{DVec3, UVec3};
use airlight::media::Lattice;
use airlight::stage::{Evaluate, EvaluateParams, GridParams, Reconstruct, ReconstructParams, Stage};
use bytemuck::Zeroable;

use super::{Rig, four};

/// Clusters of a channel.
const CLUSTERS: u32 = 128;
/// Components of a cluster, its mean not counted.
const COMPONENTS: u32 = 4;
/// Functions of the light.
const FUNCTIONS: u32 = 642;
/// Cells along each side.
const SIDE: u32 = 64;

impl Rig {
    /// `evaluate` of all clusters' matrices of bands² moments, summed where `folded`. Its elements are the products of a
    /// value of a matrix and light.
    ///
    /// # Errors
    /// A device fault.
    pub fn evaluate(&mut self, bands: u32, folded: bool) -> Result<(Stage, u64), DeviceError> {
        let packed = EvaluateParams::packed(FUNCTIONS);
        let params = EvaluateParams::new(CLUSTERS, COMPONENTS, bands * bands, packed, folded);
        let rows = u64::from(params.units * params.coefficients);
        let rough = |n: u64| -> Vec<f32> { (0..n).map(|i| (i % 37) as f32 / 37.0 - 0.4).collect() };
        // What fills the last pack of a row of functions is zero.
        let functions = |rows: u64| -> Vec<f32> {
            let mut all = rough(rows * u64::from(packed));
            for row in all.chunks_mut(packed as usize) {
                row[FUNCTIONS as usize..].fill(0.0);
            }
            all
        };
        let stage = Evaluate {
            params,
            matrices: self.fill(&functions(rows))?,
            light: self.fill(&functions(3))?,
            views: if folded { Some(self.fill(&rough((CLUSTERS * params.coefficients).into()))?) } else { None },
            out: self.make((params.units * params.outputs()).into(), Usage::Work)?,
        };
        Ok((Stage::Evaluate(stage), rows * u64::from(FUNCTIONS)))
    }

    /// `reconstruct` of bands² moments in all cells of a cube, from one channel or three, for the march to weigh or seen
    /// from an eye. Its elements are the cells.
    ///
    /// # Errors
    /// A device fault.
    pub fn reconstruct(&mut self, bands: u32, channels: u32, view: bool) -> Result<(Stage, u64), DeviceError> {
        let lattice = Lattice::of_cells(2 * SIDE, DVec3::ZERO, DVec3::ONE).expect("a unit cube");
        let rows = SIDE.pow(3);
        let mut params = ReconstructParams::zeroed();
        [params.world_x, params.world_y, params.world_z] = GridParams::new(&lattice).world;
        (params.cells, params.cell) = (UVec3::splat(SIDE).extend(0).to_array(), [2.0, 2.0, 2.0, 0.0]);
        params.eye = four(lattice.world_to_index().transform_point3(DVec3::new(2.6, 1.7, 2.9)));
        (params.rows, params.clusters, params.components) = (rows, CLUSTERS, COMPONENTS);
        (params.channels, params.bands, params.view) = (channels, bands, view.into());
        let moments = params.coefficients();
        let values = channels * CLUSTERS * (1 + COMPONENTS) * moments;
        let radiance: Vec<[f32; 4]> = (0..values).map(|n| [(n % 31) as f32 / 31.0; 4]).collect();
        // Neighbours are often of one cluster.
        let clusters: Vec<u32> = (0..channels * rows).map(|n| n / 48 % CLUSTERS).collect();
        let weights: Vec<f32> = (0..channels * rows * COMPONENTS).map(|n| (n % 29) as f32 / 29.0 - 0.5).collect();
        let tables: Vec<f32> = vec![1.0; moments as usize].into_iter().chain(recurrence_table(bands)).collect();
        let stage = Reconstruct {
            params,
            rows: self.fill(&(1..=rows).collect::<Vec<u32>>())?,
            clusters: self.fill(&clusters)?,
            weights: Some(self.fill(&weights)?),
            radiance: self.fill(&radiance)?,
            tables: self.fill(&tables)?,
            out: self.make(u64::from(rows) * u64::from(params.layers()), Usage::Work)?,
        };
        Ok((Stage::Reconstruct(stage), rows.into()))
    }
}
