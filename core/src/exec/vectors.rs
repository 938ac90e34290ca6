//! Long vectors on the host, on all its threads. What comes of them does not depend on how many those are.

use std::ops::Range;

use rayon::prelude::*;

/// Values that a thread takes at once; shorter vectors are not worth waking another.
const CHUNK: usize = 1 << 14;

/// Lanes of a sum, which processors add side by side.
const LANES: usize = 16;

/// Values of a lane that are summed in 32 bits.
const SHORT: usize = 16;

/// Hands `of` parts of a vector, with where they begin.
pub(super) fn each(vector: &mut [f32], of: impl Fn(usize, &mut [f32]) + Sync) {
    if vector.len() <= CHUNK {
        return of(0, vector);
    }
    vector.par_chunks_mut(CHUNK).enumerate().for_each(|(n, part)| of(n * CHUNK, part));
}

/// Makes `out` what `of` makes of the values of two vectors as long.
pub(super) fn map(out: &mut Vec<f32>, a: &[f32], b: &[f32], of: impl Fn(f32, f32) -> f32 + Sync) {
    out.resize(a.len(), 0.0);
    each(out, |first, out| {
        let pairs = a[first..].iter().zip(&b[first..]);
        out.iter_mut().zip(pairs).for_each(|(out, (&a, &b))| *out = of(a, b));
    });
}

/// Adds `factor` times a vector.
pub(super) fn add(sum: &mut [f32], factor: f32, vector: &[f32]) {
    each(sum, |first, sum| sum.iter_mut().zip(&vector[first..]).for_each(|(sum, v)| *sum += factor * v));
}

/// Σ a b.
pub(super) fn product(a: &[f32], b: &[f32]) -> f64 {
    sum(a, b, |a, b| a * b)
}

/// Σ `of`(a, b), in parts so that sums in 32 bits stay short.
pub(super) fn sum(a: &[f32], b: &[f32], of: impl Fn(f32, f32) -> f32 + Sync) -> f64 {
    let len = a.len().min(b.len());
    let part = |range: Range<usize>| part(&a[range.clone()], &b[range], &of);
    if len <= CHUNK {
        return part(0..len);
    }
    let ranges = (0..len.div_ceil(CHUNK)).into_par_iter().map(|n| n * CHUNK..((n + 1) * CHUNK).min(len));
    let parts: Vec<f64> = ranges.map(part).collect();
    parts.iter().sum()
}

fn part(a: &[f32], b: &[f32], of: impl Fn(f32, f32) -> f32) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sum: f64 = a_rest.iter().zip(b_rest).map(|(&a, &b)| f64::from(of(a, b))).sum();
    for (a, b) in a.chunks(SHORT).zip(b.chunks(SHORT)) {
        let mut lanes = [0.0f32; LANES];
        for (a, b) in a.iter().zip(b) {
            for (lane, (&a, &b)) in lanes.iter_mut().zip(a.iter().zip(b)) {
                *lane += of(a, b);
            }
        }
        sum += lanes.iter().map(|&lane| f64::from(lane)).sum::<f64>();
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vector(len: usize, seed: f32) -> Vec<f32> {
        (0..len).map(|i| (i as f32 * 0.37 + seed).sin()).collect()
    }

    #[test]
    fn products_are_sums_of_all_values() {
        for len in [0, 1, 15, 16, 17, 255, 257, CHUNK, CHUNK + 1, 5 * CHUNK + 300] {
            let (a, b) = (vector(len, 0.1), vector(len, 2.0));
            let expected: f64 = a.iter().zip(&b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
            let error = (product(&a, &b) - expected).abs();
            // A lane's sum of 16 products is good to a few 2⁻²⁴ of them.
            assert!(error <= 1e-6 * len as f64, "{len} values: {error}");
        }
    }

    #[test]
    fn vectors_are_whole_and_threads_make_no_difference() {
        let (a, b) = (vector(5 * CHUNK + 300, 0.1), vector(5 * CHUNK + 300, 2.0));
        let expected: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let mut sum = a.clone();
        add(&mut sum, 0.5, &b);
        assert!(sum.iter().zip(a.iter().zip(&b)).all(|(sum, (a, b))| *sum == a + 0.5 * b));
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut found = vec![7.0; 3];
                map(&mut found, &a, &b, |a, b| a - b);
                assert_eq!(found, expected);
                assert_eq!(product(&a, &b), parts_in_order(&a, &b));
            });
        }
    }

    fn parts_in_order(a: &[f32], b: &[f32]) -> f64 {
        a.chunks(CHUNK).zip(b.chunks(CHUNK)).map(|(a, b)| part(a, b, |a, b| a * b)).sum()
    }
}
