//! Transfers whose numbers do not matter, for what is timed once one is there.

use airlight::glam::DVec3;
use airlight::random::{hash, unit};
use airlight::scene::{LightBasis, Scene};
use airlight::transfer::{Channel, Origin, Shape, Transfer};

/// Matrices of a cluster beside its mean.
pub(crate) const COMPONENTS: u32 = 4;
/// Clusters of cells, of which there may be fewer.
pub(crate) const CLUSTERS: u32 = 128;

/// A transfer of the scene's medium as a grey, isotropic one has it, with a row of arbitrary numbers in every one of
/// `cells` cells along the longest side.
pub(crate) fn arbitrary(scene: &Scene, cells: u32, functions: u32) -> Transfer {
    let sides = scene.medium.lattice().dims().as_dvec3();
    let cells = (sides / sides.max_element() * f64::from(cells)).round().max(DVec3::ONE).as_uvec3().to_array();
    let rows: u32 = cells.iter().product();
    let clusters = CLUSTERS.min(rows);
    let values = |count: u32, seed: u32| (0..count).map(|n| unit(hash([n, seed, 0]))).collect();
    let channel = Channel {
        matrices: values(clusters * (1 + COMPONENTS) * functions, 0),
        clusters: (0..rows).map(|row| hash([row, 1, 1]) % clusters).collect(),
        weights: values(rows * COMPONENTS, 2),
        errors: vec![0.0; clusters as usize],
        loss: 0.0,
    };
    let shape = Shape {
        cells,
        rows: (0..rows).collect(),
        basis: LightBasis::Discrete { functions },
        bands: 1,
        clusters,
        components: COMPONENTS,
    };
    Transfer::new(shape, Origin::of(scene), vec![channel]).expect("its sizes fit")
}
