//! How far two pictures are apart.

mod flip;

pub use flip::{PIXELS_PER_DEGREE, flip};

/// Differences of two pictures of linear values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// ‖a - b‖₂ / ‖b‖₂ over all values; infinite where only b is zero.
    pub relative_l2: f64,
    /// The largest |a - b|.
    pub max_abs: f64,
    /// Mean of a over mean of b, per channel; not a number where b's mean is zero.
    pub mean_ratio: [f64; 3],
}

/// The difference of `a` from `b`, the truth, over RGB. Values that are not finite make the figures not finite.
///
/// # Panics
/// Where the pictures differ in length.
pub fn difference<const N: usize>(a: &[[f32; N]], b: &[[f32; N]]) -> Difference {
    assert_eq!(a.len(), b.len(), "pictures of one size");
    let (mut square, mut truth, mut max_abs) = (0.0, 0.0, 0.0f64);
    let (mut sum_a, mut sum_b) = ([0.0; 3], [0.0; 3]);
    for (a, b) in a.iter().zip(b) {
        for c in 0..3 {
            let (a, b) = (f64::from(a[c]), f64::from(b[c]));
            let d = (a - b).abs();
            square += d * d;
            truth += b * b;
            // `max` would pass over what is not a number.
            max_abs = if d > max_abs || d.is_nan() { d } else { max_abs };
            sum_a[c] += a;
            sum_b[c] += b;
        }
    }
    let relative_l2 = if square == 0.0 { 0.0 } else { (square / truth).sqrt() };
    Difference { relative_l2, max_abs, mean_ratio: [0, 1, 2].map(|c| sum_a[c] / sum_b[c]) }
}

/// Means over blocks of `side` × `side` pixels; blocks at the right and lower edge may be smaller.
pub fn block_means<const N: usize>(picture: &[[f32; N]], width: usize, side: usize) -> Vec<[f32; N]> {
    let height = picture.len() / width.max(1);
    let mut out = Vec::with_capacity(width.div_ceil(side) * height.div_ceil(side));
    for y in (0..height).step_by(side) {
        for x in (0..width).step_by(side) {
            let (mut sum, mut count) = ([0.0f64; N], 0.0);
            for line in picture[y * width..].chunks(width).take(side.min(height - y)) {
                for pixel in &line[x..(x + side).min(width)] {
                    (0..N).for_each(|c| sum[c] += f64::from(pixel[c]));
                    count += 1.0;
                }
            }
            out.push(sum.map(|s| (s / count) as f32));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_to_the_second() {
        let a = [[1.0f32, 2.0, 3.0], [0.0, 0.0, 0.0]];
        let b = [[1.0f32, 2.0, 2.0], [0.0, 0.0, 1.0]];
        let d = difference(&a, &b);
        assert!((d.relative_l2 - (2.0f64 / 10.0).sqrt()).abs() < 1e-12);
        assert_eq!(d.max_abs, 1.0);
        assert_eq!(d.mean_ratio, [1.0, 1.0, 1.0]);
        assert!(difference(&[[f32::NAN; 3]], &[[1.0; 3]]).max_abs.is_nan());
        assert_eq!(difference(&[[0.0; 3]], &[[0.0; 3]]).relative_l2, 0.0);
    }

    #[test]
    fn blocks_at_the_edge_are_means_of_what_there_is() {
        let picture: Vec<[f32; 1]> = (0..15).map(|i| [i as f32]).collect();
        let means = block_means(&picture, 5, 2);
        assert_eq!(means, [[3.0], [5.0], [6.5], [10.5], [12.5], [14.0]]);
    }
}
