//! FLIP, the difference that a person sees when flipping between two pictures (Andersson, Nilsson, Akenine-Möller,
//! Oskarsson, Åström and Fairchild 2020, "FLIP: A Difference Evaluator for Alternating Images"). Constants are the
//! paper's.

use std::f64::consts::PI;

/// Pixels per degree of visual angle: a 0.7 m wide screen of 3840 pixels seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Exponent of the colour difference.
const COLOR_POWER: f64 = 0.7;
/// Where the remapping of colour differences bends: at this part of the largest, to this value.
const BEND: (f64, f64) = (0.4, 0.95);
/// Width of a feature in degrees.
const FEATURE: f64 = 0.082;

/// FLIP per pixel, 0 to 1, of two display-referred sRGB pictures with components in [0, 1], row by row.
///
/// # Panics
/// Where a picture does not hold `width · height` pixels.
pub fn flip(a: &[[f32; 3]], b: &[[f32; 3]], width: usize, height: usize) -> Vec<f32> {
    assert!(a.len() == width * height && b.len() == a.len(), "pictures of {width} × {height}");
    let size = (width, height);
    let opponent = [a, b].map(|p| p.iter().map(|&c| to_opponent(c.map(f64::from).map(linear))).collect::<Vec<_>>());
    let seen = opponent.each_ref().map(|p| contrast_filter(p, size));
    let largest = hyab(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0])).powf(COLOR_POWER);
    let features = opponent.each_ref().map(|p| {
        let luminance: Vec<f64> = p.iter().map(|c| (c[0] + 16.0) / 116.0).collect();
        (feature(&luminance, size, false), feature(&luminance, size, true))
    });
    (0..a.len())
        .map(|i| {
            let color = remap(hyab(seen[0][i], seen[1][i]).powf(COLOR_POWER), largest);
            let edge = (features[0].0[i] - features[1].0[i]).abs();
            let point = (features[0].1[i] - features[1].1[i]).abs();
            let feature = (edge.max(point) / std::f64::consts::SQRT_2).sqrt();
            color.powf(1.0 - feature) as f32
        })
        .collect()
}

fn linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Rows of linear sRGB to XYZ, and the white of (1, 1, 1).
const XYZ: [[f64; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];

fn relative_xyz(rgb: [f64; 3]) -> [f64; 3] {
    XYZ.map(|row| (row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]) / (row[0] + row[1] + row[2]))
}

/// Linear sRGB to YCxCz.
fn to_opponent(rgb: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = relative_xyz(rgb);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// YCxCz to linear sRGB, clamped to what a screen shows.
fn from_opponent([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) / 116.0;
    let white = XYZ.map(|row| row.iter().sum::<f64>());
    let xyz = [(cx / 500.0 + y) * white[0], y * white[1], (y - cz / 200.0) * white[2]];
    let inverse = glam::DMat3::from_cols_array_2d(&XYZ).transpose().inverse();
    (inverse * glam::DVec3::from_array(xyz)).to_array().map(|v| v.clamp(0.0, 1.0))
}

/// Linear sRGB to L*a*b*, with the chroma scaled by lightness (the Hunt effect).
fn hunt(rgb: [f64; 3]) -> [f64; 3] {
    let f = |t: f64| {
        let delta = 6.0f64 / 29.0;
        if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 }
    };
    let [x, y, z] = relative_xyz(rgb).map(f);
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

fn remap(difference: f64, largest: f64) -> f64 {
    let (at, value) = (BEND.0 * largest, BEND.1);
    if difference < at { value / at * difference } else { value + (difference - at) / (largest - at) * (1.0 - value) }
}

/// A picture convolved with `across` along rows and `down` along columns, clamped at the edge.
fn convolve(picture: &[f64], (width, height): (usize, usize), across: &[f64], down: &[f64]) -> Vec<f64> {
    let clamp = |at: usize, k: usize, half: usize, n: usize| (at + k).saturating_sub(half).min(n - 1);
    let mut rows = vec![0.0; picture.len()];
    for (y, line) in rows.chunks_exact_mut(width).enumerate() {
        let from = &picture[y * width..][..width];
        for (x, place) in line.iter_mut().enumerate() {
            *place = across.iter().enumerate().map(|(k, w)| w * from[clamp(x, k, across.len() / 2, width)]).sum();
        }
    }
    let mut out = vec![0.0; picture.len()];
    for (y, line) in out.chunks_exact_mut(width).enumerate() {
        for (k, w) in down.iter().enumerate() {
            let from = &rows[clamp(y, k, down.len() / 2, height) * width..][..width];
            line.iter_mut().zip(from).for_each(|(place, v)| *place += w * v);
        }
    }
    out
}

/// What the eye's contrast sensitivity leaves of a YCxCz picture, as Hunt-adjusted L*a*b*.
fn contrast_filter(picture: &[[f64; 3]], size: (usize, usize)) -> Vec<[f64; 3]> {
    // Sums of two Gaussians a √(π/b) exp(-π² x²/b), x in degrees, for luminance, red-green and blue-yellow.
    const LOBES: [[(f64, f64); 2]; 3] =
        [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let channels: Vec<Vec<f64>> = (0..3)
        .map(|c| {
            let plane: Vec<f64> = picture.iter().map(|p| p[c]).collect();
            let (mut sum, mut weight) = (vec![0.0; plane.len()], 0.0);
            for (a, b) in LOBES[c] {
                if a == 0.0 {
                    continue;
                }
                let line: Vec<f64> =
                    (-radius..=radius).map(|i| (-(PI * f64::from(i) / PIXELS_PER_DEGREE).powi(2) / b).exp()).collect();
                let scale = a * (PI / b).sqrt();
                weight += scale * line.iter().sum::<f64>().powi(2);
                let part = convolve(&plane, size, &line, &line);
                sum.iter_mut().zip(part).for_each(|(s, p)| *s += scale * p);
            }
            sum.into_iter().map(|s| s / weight).collect()
        })
        .collect();
    (0..picture.len()).map(|i| hunt(from_opponent([channels[0][i], channels[1][i], channels[2][i]]))).collect()
}

/// Strength of edges, or of points, in luminance: the length of the first or second derivatives of a Gaussian.
fn feature(luminance: &[f64], size: (usize, usize), points: bool) -> Vec<f64> {
    let sigma = 0.5 * FEATURE * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as i32;
    let gauss = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let xs = || (-radius..=radius).map(f64::from);
    let smooth: Vec<f64> = xs().map(gauss).collect();
    let derivative: Vec<f64> =
        xs().map(|x| if points { (x * x / (sigma * sigma) - 1.0) * gauss(x) } else { -x * gauss(x) }).collect();
    // Positive weights of the two-dimensional kernel sum to 1, negative ones to -1.
    let across: f64 = smooth.iter().sum();
    let positive: f64 = derivative.iter().filter(|w| **w > 0.0).sum::<f64>() * across;
    let negative: f64 = -derivative.iter().filter(|w| **w < 0.0).sum::<f64>() * across;
    let balanced: Vec<f64> = derivative.iter().map(|&w| w / if w > 0.0 { positive } else { negative }).collect();
    let dx = convolve(luminance, size, &balanced, &smooth);
    let dy = convolve(luminance, size, &smooth, &balanced);
    dx.into_iter().zip(dy).map(|(x, y)| x.hypot(y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: usize, height: usize, shift: f32) -> Vec<[f32; 3]> {
        (0..width * height).map(|i| [((i % width) as f32 / width as f32 + shift).min(1.0), 0.4, 0.3]).collect()
    }

    #[test]
    fn equal_pictures_do_not_differ_and_more_is_more() {
        let (w, h) = (24, 17);
        let mean = |shift| flip(&ramp(w, h, shift), &ramp(w, h, 0.0), w, h).iter().sum::<f32>() / (w * h) as f32;
        assert_eq!(mean(0.0), 0.0);
        let (little, much) = (mean(0.02), mean(0.3));
        assert!(0.0 < little && little < much && much < 1.0, "{little} {much}");
    }

    #[test]
    fn flat_pictures_give_the_color_term_alone() {
        // Without features the exponent is 1; black against white is |ΔL| = 100 raised to 0.7 and remapped.
        let black = vec![[0.0f32; 3]; 20 * 10];
        let white = vec![[1.0f32; 3]; 20 * 10];
        let largest = hyab(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0])).powf(0.7);
        let expected = remap(100f64.powf(0.7), largest);
        for v in flip(&black, &white, 20, 10) {
            // Rounding of f32 and of the colour matrices' round trip.
            assert!((f64::from(v) - expected).abs() < 1e-6, "{v} {expected}");
        }
    }

    #[test]
    fn colors_go_there_and_back() {
        for rgb in [[0.2, 0.5, 0.7], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]] {
            let back = from_opponent(to_opponent(rgb));
            assert!((0..3).all(|c| (back[c] - rgb[c]).abs() < 1e-9), "{rgb:?} {back:?}");
        }
    }
}
