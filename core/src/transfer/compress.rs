//! Clustered principal component analysis of transfer matrices (Sloan, Hall, Hart and Snyder 2003; Zhang, Dong and Ma
//! 2013, 6.4).
//!
//! A cluster is a mean matrix and an orthonormal set of N matrices, and a row of it the mean plus a weighted sum of those.
//! Clusters are found among coordinates of few dimensions: of the space that most of the rows' squares lie in, found by a
//! random projection and one power iteration (Halko, Martinsson and Tropp 2011). There k-means begins, and each row then
//! goes to the cluster whose mean and components leave least of it, until hardly one moves. Means and components of what is
//! found are those of the matrices themselves, by subspace iteration from the coordinates' own.

use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

use super::Channel;
use crate::random::hash;

/// Dimensions of the coordinates that clusters are found among.
const DIMENSIONS: usize = 48;
/// The most rounds of k-means, and of the clusters' own components after it.
const ROUNDS: usize = 12;
/// Rounds end when less than this share of the rows moves.
const SETTLED: f64 = 1e-3;
/// Subspace iterations of a cluster's matrices.
const ITERATIONS: usize = 2;
/// Rows that one task takes.
const TASK: usize = 256;

/// Transfer matrices of one channel, as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrices {
    /// Values of a matrix: J·K.
    pub width: usize,
    /// Laid out \[row\]\[J\]\[K\].
    pub values: Vec<f32>,
}

impl Matrices {
    fn rows(&self) -> usize {
        self.values.len() / self.width
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.width..][..self.width]
    }

    /// Bytes that [`compress`] takes beside the matrices of `rows` rows and its result.
    pub fn workspace(rows: u64) -> u64 {
        rows.saturating_mul(4 * (DIMENSIONS as u64 + 8))
    }

    /// A transfer in which every row has its own matrix.
    pub fn whole(self) -> Channel {
        let rows = self.rows();
        Channel {
            clusters: (0..rows as u32).collect(),
            matrices: self.values,
            weights: Vec::new(),
            errors: vec![0.0; rows],
            loss: 0.0,
        }
    }
}

/// Compresses matrices to `clusters` clusters, at most as many as rows, of a mean and `components` matrices each. The same
/// matrices give the same result, but for the rounding of sums on several threads.
pub fn compress(matrices: &Matrices, clusters: usize, components: usize) -> Channel {
    let clusters = clusters.min(matrices.rows());
    let space = Space::of(matrices);
    let coordinates = space.coordinates(matrices);
    let of = cluster(&coordinates, space.dimensions, clusters, components);
    let mut members = vec![Vec::new(); clusters];
    for (row, &cluster) in of.iter().enumerate() {
        members[cluster as usize].push(row);
    }
    let parts: Vec<Part> =
        members.par_iter().map(|rows| Part::of(matrices, rows, &space, &coordinates, components)).collect();
    let mut channel = Channel {
        matrices: Vec::with_capacity(clusters * (1 + components) * matrices.width),
        weights: vec![0.0; of.len() * components],
        clusters: of,
        errors: Vec::with_capacity(clusters),
        loss: 0.0,
    };
    let relative = |lost: f64, whole: f64| if whole > 0.0 { (lost / whole).sqrt() as f32 } else { 0.0 };
    let (mut lost, mut whole) = (0.0, 0.0);
    for (part, rows) in parts.iter().zip(&members) {
        channel.matrices.extend(&part.matrices);
        channel.errors.push(relative(part.lost, part.whole));
        (lost, whole) = (lost + part.lost, whole + part.whole);
        for (&row, weights) in rows.iter().zip(part.weights.chunks(components.max(1))) {
            channel.weights[row * components..][..components].copy_from_slice(&weights[..components]);
        }
    }
    channel.loss = relative(lost, whole);
    channel
}

/// The few dimensions that most of the rows' squares lie in: orthonormal vectors, laid out \[value\]\[dimension\].
struct Space {
    dimensions: usize,
    vectors: Vec<f32>,
}

impl Space {
    fn of(matrices: &Matrices) -> Self {
        let (rows, width) = (matrices.rows(), matrices.width);
        let dimensions = DIMENSIONS.min(width).min(rows);
        let sign = |at: usize| if hash([at as u32, 0, 0]) & 1 == 0 { 1.0 } else { -1.0 };
        let random = Self { dimensions, vectors: (0..width * dimensions).map(sign).collect() };
        let projected = random.coordinates(matrices);
        let mut vectors = combine(matrices, &(0..rows).collect::<Vec<_>>(), None, &projected, dimensions);
        orthonormalize(&mut vectors, dimensions);
        Self { dimensions, vectors }
    }

    /// Of every row, laid out \[row\]\[dimension\].
    fn coordinates(&self, matrices: &Matrices) -> Vec<f32> {
        let mut out = vec![0.0; matrices.rows() * self.dimensions];
        if out.is_empty() {
            return out;
        }
        out.par_chunks_mut(self.dimensions).enumerate().for_each(|(row, out)| {
            project(matrices.row(row), None, &self.vectors, out);
        });
        out
    }
}

/// Products of (`row` - `mean`) with vectors laid out \[value\]\[vector\].
fn project(row: &[f32], mean: Option<&[f32]>, vectors: &[f32], out: &mut [f32]) {
    out.fill(0.0);
    for (at, (&value, vectors)) in row.iter().zip(vectors.chunks_exact(out.len())).enumerate() {
        let value = value - mean.map_or(0.0, |mean| mean[at]);
        if value != 0.0 {
            out.iter_mut().zip(vectors).for_each(|(sum, v)| *sum += value * v);
        }
    }
}

/// Σ over rows of (row - mean) times its `count` weights, laid out \[value\]\[weight\].
fn combine(matrices: &Matrices, rows: &[usize], mean: Option<&[f32]>, weights: &[f32], count: usize) -> Vec<f32> {
    let width = matrices.width;
    // By columns, so that no thread needs a sum of its own.
    let mut out = vec![0.0; width * count];
    let columns = width.div_ceil(2 * rayon::current_num_threads()).max(64);
    out.par_chunks_mut((columns * count).max(1)).enumerate().for_each(|(part, out)| {
        let first = part * columns;
        for (place, &row) in rows.iter().enumerate() {
            let weights = &weights[place * count..][..count];
            let row = &matrices.row(row)[first..];
            for (at, (out, &value)) in out.chunks_exact_mut(count).zip(row).enumerate() {
                let value = value - mean.map_or(0.0, |mean| mean[first + at]);
                out.iter_mut().zip(weights).for_each(|(sum, w)| *sum += value * w);
            }
        }
    });
    out
}

/// Makes vectors laid out \[value\]\[vector\] orthonormal; those that depend on the ones before become zero.
fn orthonormalize(vectors: &mut [f32], count: usize) {
    for k in 0..count {
        let norm = |vectors: &[f32], a: usize, b: usize| -> f64 {
            vectors.chunks_exact(count).map(|v| f64::from(v[a]) * f64::from(v[b])).sum()
        };
        let before = norm(vectors, k, k);
        // Twice, for what rounding leaves.
        for _ in 0..2 {
            for other in 0..k {
                let share = norm(vectors, k, other) as f32;
                vectors.chunks_exact_mut(count).for_each(|v| v[k] -= share * v[other]);
            }
        }
        let left = norm(vectors, k, k);
        let scale = if left > before * 1e-10 && left > 0.0 { 1.0 / left.sqrt() } else { 0.0 } as f32;
        vectors.chunks_exact_mut(count).for_each(|v| v[k] *= scale);
    }
}

/// A cluster among the coordinates: its mean, and components laid out \[component\]\[dimension\].
#[derive(Clone)]
struct Center {
    mean: Vec<f32>,
    components: Vec<f32>,
}

impl Center {
    /// What it leaves of a row: squares.
    fn leaves(&self, row: &[f32]) -> f32 {
        let distance: f32 = row.iter().zip(&self.mean).map(|(a, b)| (a - b) * (a - b)).sum();
        let within: f32 = self
            .components
            .chunks_exact(row.len())
            .map(|u| u.iter().zip(row).zip(&self.mean).map(|((u, a), b)| u * (a - b)).sum::<f32>().powi(2))
            .sum();
        distance - within
    }

    /// That of the rows of one cluster.
    fn of(rows: &[&[f32]], dimensions: usize, components: usize) -> Self {
        let (mean, vectors) = principal(rows, dimensions, components);
        Self { mean, components: vectors }
    }
}

/// The mean of rows, and the first vectors of their covariance, laid out \[vector\]\[dimension\].
fn principal(rows: &[&[f32]], dimensions: usize, count: usize) -> (Vec<f32>, Vec<f32>) {
    let mut mean = vec![0.0f64; dimensions];
    for row in rows {
        mean.iter_mut().zip(*row).for_each(|(m, &v)| *m += f64::from(v));
    }
    mean.iter_mut().for_each(|m| *m /= rows.len().max(1) as f64);
    let mut vectors = vec![0.0; count * dimensions];
    if count > 0 && rows.len() > 1 {
        let mut covariance = DMatrix::<f64>::zeros(dimensions, dimensions);
        let mut delta = vec![0.0; dimensions];
        for row in rows {
            delta.iter_mut().zip(*row).zip(&mean).for_each(|((d, &v), m)| *d = f64::from(v) - m);
            for a in 0..dimensions {
                for b in 0..=a {
                    covariance[(a, b)] += delta[a] * delta[b];
                }
            }
        }
        covariance.fill_upper_triangle_with_lower_triangle();
        let eigen = SymmetricEigen::new(covariance);
        let mut order: Vec<usize> = (0..dimensions).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        for (vector, &column) in vectors.chunks_exact_mut(dimensions).zip(&order) {
            vector.iter_mut().zip(eigen.eigenvectors.column(column).iter()).for_each(|(v, &e)| *v = e as f32);
        }
    }
    (mean.iter().map(|&m| m as f32).collect(), vectors)
}

/// The cluster of each row, of `clusters` of which none is empty unless rows are alike.
fn cluster(coordinates: &[f32], dimensions: usize, clusters: usize, components: usize) -> Vec<u32> {
    let rows: Vec<&[f32]> = coordinates.chunks_exact(dimensions.max(1)).collect();
    let mut centers = seeds(&rows, clusters);
    let mut of = vec![u32::MAX; rows.len()];
    for own in [0, components] {
        for _ in 0..ROUNDS {
            let nearest = assign(&rows, &centers);
            let moved = of.iter().zip(&nearest).filter(|(was, (is, _))| *was != is).count();
            of = nearest.iter().map(|&(cluster, _)| cluster).collect();
            fill(&mut of, &nearest, clusters);
            let mut members = vec![Vec::new(); clusters];
            for (&row, &cluster) in rows.iter().zip(&of) {
                members[cluster as usize].push(row);
            }
            centers = members.par_iter().map(|rows| Center::of(rows, dimensions, own)).collect();
            if moved as f64 <= SETTLED * rows.len() as f64 {
                break;
            }
        }
    }
    of
}

/// Rows to begin from, each drawn by its distance to those before (k-means++; Arthur and Vassilvitskii 2007).
fn seeds(rows: &[&[f32]], clusters: usize) -> Vec<Center> {
    let center = |row: &[f32]| Center { mean: row.to_vec(), components: Vec::new() };
    let mut centers: Vec<Center> = rows.first().into_iter().map(|row| center(row)).collect();
    let mut distances = vec![f32::INFINITY; rows.len()];
    while centers.len() < clusters {
        let last = &centers[centers.len() - 1];
        distances.par_iter_mut().zip(rows).for_each(|(d, row)| *d = d.min(last.leaves(row)));
        let sum: f64 = distances.iter().map(|&d| f64::from(d)).sum();
        let drawn = f64::from(hash([centers.len() as u32, 1, 0])) / f64::from(u32::MAX) * sum;
        let mut before = 0.0;
        let at = distances.iter().position(|&d| {
            before += f64::from(d);
            before >= drawn && d > 0.0
        });
        // Where all rows are alike, or rounding left none, the next one.
        centers.push(center(rows[at.unwrap_or(centers.len() % rows.len())]));
    }
    centers
}

/// Of each row the cluster that leaves least of it, and how much that is.
fn assign(rows: &[&[f32]], centers: &[Center]) -> Vec<(u32, f32)> {
    rows.par_iter()
        .with_min_len(TASK)
        .map(|row| {
            let mut best = (0, f32::INFINITY);
            for (at, center) in centers.iter().enumerate() {
                let leaves = center.leaves(row);
                if leaves < best.1 {
                    best = (at as u32, leaves);
                }
            }
            best
        })
        .collect()
}

/// Gives each empty cluster the row of which most is left.
fn fill(of: &mut [u32], nearest: &[(u32, f32)], clusters: usize) {
    let mut counts = vec![0usize; clusters];
    of.iter().for_each(|&cluster| counts[cluster as usize] += 1);
    let empty: Vec<usize> = (0..clusters).filter(|&cluster| counts[cluster] == 0).collect();
    if empty.is_empty() {
        return;
    }
    let mut worst: Vec<usize> = (0..of.len()).collect();
    worst.sort_by(|&a, &b| nearest[b].1.total_cmp(&nearest[a].1));
    let mut worst = worst.into_iter();
    for cluster in empty {
        if let Some(row) = worst.find(|&row| counts[of[row] as usize] > 1) {
            counts[of[row] as usize] -= 1;
            of[row] = cluster as u32;
            counts[cluster] = 1;
        }
    }
}

/// What becomes of the rows of one cluster.
struct Part {
    /// Mean and components, laid out \[1 + N\]\[value\].
    matrices: Vec<f32>,
    /// Laid out \[row\]\[N\].
    weights: Vec<f32>,
    /// Squares of what is lost, and of all.
    lost: f64,
    whole: f64,
}

impl Part {
    fn of(matrices: &Matrices, rows: &[usize], space: &Space, coordinates: &[f32], components: usize) -> Self {
        let (width, dimensions) = (matrices.width, space.dimensions);
        let mut mean = vec![0.0f64; width];
        for &row in rows {
            mean.iter_mut().zip(matrices.row(row)).for_each(|(m, &v)| *m += f64::from(v));
        }
        let mean: Vec<f32> = mean.iter().map(|m| (m / rows.len().max(1) as f64) as f32).collect();
        let mut vectors = vec![0.0; width * components];
        let mut weights = vec![0.0; rows.len() * components];
        if components > 0 {
            let of = |&row: &usize| &coordinates[row * dimensions..][..dimensions];
            let (_, axes) = principal(&rows.iter().map(of).collect::<Vec<_>>(), dimensions, components);
            for (out, value) in vectors.chunks_exact_mut(components).zip(space.vectors.chunks_exact(dimensions)) {
                for (out, axis) in out.iter_mut().zip(axes.chunks_exact(dimensions)) {
                    *out = value.iter().zip(axis).map(|(v, a)| v * a).sum();
                }
            }
            let project_all = |vectors: &[f32], weights: &mut [f32]| {
                weights
                    .chunks_exact_mut(components)
                    .zip(rows)
                    .for_each(|(out, &row)| project(matrices.row(row), Some(&mean), vectors, out));
            };
            orthonormalize(&mut vectors, components);
            for _ in 0..ITERATIONS {
                project_all(&vectors, &mut weights);
                vectors = combine(matrices, rows, Some(&mean), &weights, components);
                orthonormalize(&mut vectors, components);
            }
            project_all(&vectors, &mut weights);
        }
        let (mut lost, mut whole) = (0.0, 0.0);
        for (place, &row) in rows.iter().enumerate() {
            let weights = &weights[place * components..][..components];
            for (at, &value) in matrices.row(row).iter().enumerate() {
                let vectors = &vectors[at * components..][..components];
                let about: f32 = mean[at] + vectors.iter().zip(weights).map(|(v, w)| v * w).sum::<f32>();
                lost += f64::from(value - about).powi(2);
                whole += f64::from(value).powi(2);
            }
        }
        let mut out = mean;
        out.extend((0..components).flat_map(|k| vectors.iter().skip(k).step_by(components)));
        Self { matrices: out, weights, lost, whole }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows on `clusters` planes of two dimensions each, in a space of 40 values.
    fn planes(rows: usize, clusters: usize) -> Matrices {
        let random = |a: usize, b: usize| f64::from(hash([a as u32, b as u32, 7])) / f64::from(u32::MAX) - 0.5;
        let width = 40;
        let values = (0..rows).flat_map(|row| {
            let of = 3 * (row % clusters);
            let [u, v] = [1, 2].map(|axis| random(row, axis + 100_000));
            (0..width)
                .map(move |at| (10.0 * random(of, at) + u * random(of + 1, at) + 0.5 * v * random(of + 2, at)) as f32)
        });
        Matrices { width, values: values.collect() }
    }

    fn row_of(channel: &Channel, width: usize, components: usize, row: usize) -> Vec<f32> {
        let of = channel.clusters[row] as usize * (1 + components) * width;
        let matrix = |k: usize, at: usize| channel.matrices[of + k * width + at];
        let weights = &channel.weights[row * components..][..components];
        (0..width)
            .map(|at| matrix(0, at) + weights.iter().enumerate().map(|(k, w)| w * matrix(1 + k, at)).sum::<f32>())
            .collect()
    }

    #[test]
    fn planes_are_found_exactly() {
        let matrices = planes(600, 5);
        let channel = compress(&matrices, 5, 2);
        assert!(channel.loss < 1e-5, "{}", channel.loss);
        for row in 0..600 {
            let about = row_of(&channel, 40, 2, row);
            for (a, b) in about.iter().zip(matrices.row(row)) {
                assert!((a - b).abs() < 1e-4, "row {row}: {a} {b}");
            }
        }
        // One plane fewer, or one dimension fewer, does not do.
        assert!(compress(&matrices, 4, 2).loss > 0.01);
        assert!(compress(&matrices, 5, 1).loss > 1e-3);
    }

    #[test]
    fn more_clusters_and_more_components_lose_less_and_what_is_lost_is_told() {
        let matrices = planes(900, 30);
        let loss = |clusters, components| {
            let channel = compress(&matrices, clusters, components);
            let (mut lost, mut whole) = (0.0, 0.0);
            for row in 0..900 {
                let about = row_of(&channel, 40, components, row);
                for (a, b) in about.iter().zip(matrices.row(row)) {
                    lost += f64::from(a - b).powi(2);
                    whole += f64::from(*b).powi(2);
                }
            }
            let measured = (lost / whole).sqrt();
            assert!((measured - f64::from(channel.loss)).abs() < 1e-3 * measured + 1e-6, "{measured} {}", channel.loss);
            measured
        };
        let [few, more, many] = [4, 10, 30].map(|clusters| loss(clusters, 2));
        assert!(few > more && more > many, "{few} {more} {many}");
        assert!(loss(4, 4) < few);
    }

    #[test]
    fn few_or_no_rows_are_taken_as_they_are() {
        for rows in [0, 1, 3] {
            let matrices = planes(rows, 1);
            let channel = compress(&matrices, 128, 4);
            assert_eq!(channel.errors.len(), rows);
            assert!(channel.loss < 1e-6);
            assert!(channel.matrices.iter().all(|v| v.is_finite()));
        }
        let alike = Matrices { width: 3, values: [1.0, -2.0, 0.5].repeat(20) };
        let channel = compress(&alike, 4, 2);
        assert!(channel.loss < 1e-6 && channel.clusters.iter().all(|&cluster| cluster < 4));
        assert_eq!(planes(6, 2).whole().clusters, [0, 1, 2, 3, 4, 5]);
    }
}
