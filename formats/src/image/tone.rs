//! From radiance to a screen.

/// How radiance becomes a display's colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneMap {
    /// Photographic stops: radiance is multiplied by 2^`exposure` first.
    pub exposure: f32,
    /// The curve.
    pub curve: Curve,
    /// Whether an ordered pattern of less than one level of 255 hides the bands of smooth skies. Black and white stay.
    pub dither: bool,
}

/// The curve from scene-linear RGB to display-linear RGB. Both are followed by the sRGB encoding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Curve {
    /// The film-like curve of the Academy Color Encoding System (reference rendering transform and Rec. 709 output
    /// transform), in the rational fit of Stephen Hill: highlights roll off toward white and lose saturation.
    #[default]
    Filmic,
    /// Values above 1 are clipped.
    Linear,
}

impl Default for ToneMap {
    fn default() -> Self {
        Self { exposure: 0.0, curve: Curve::Filmic, dither: true }
    }
}

/// Linear Rec. 709 to the primaries that the fitted curve works in; rows sum to 1.
const IN: [[f32; 3]; 3] = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
/// And back.
const OUT: [[f32; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

fn times(m: [[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn filmic(rgb: [f32; 3]) -> [f32; 3] {
    let fitted = times(IN, rgb).map(|x| {
        // The curve has reached its end long before; the square must stay finite.
        let x = x.min(1e6);
        (x * (x + 0.024_578_6) - 0.000_090_537) / (x * (0.983_729 * x + 0.432_951) + 0.238_081)
    });
    times(OUT, fitted)
}

/// The sRGB encoding (IEC 61966-2-1) of a value from 0 to 1.
fn srgb(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

impl ToneMap {
    /// Exposed and clipped radiance without a curve or dithering, as comparisons want it.
    pub const LINEAR: Self = Self { exposure: 0.0, curve: Curve::Linear, dither: false };

    /// The display's colour, encoded as sRGB, 0 to 1. What is not a number shows as black.
    pub fn encode(&self, radiance: [f32; 3]) -> [f32; 3] {
        let gain = self.exposure.exp2();
        let exposed = radiance.map(|c| {
            let c = c * gain;
            if c > 0.0 { c.min(f32::MAX) } else { 0.0 }
        });
        let display = match self.curve {
            Curve::Filmic => filmic(exposed),
            Curve::Linear => exposed,
        };
        display.map(|c| srgb(c.clamp(0.0, 1.0)))
    }

    /// The display's colour of the pixel in column `x` and row `y`, in levels of 255.
    pub fn quantize(&self, radiance: [f32; 3], x: u32, y: u32) -> [u8; 3] {
        let threshold = if self.dither { bayer(x, y) } else { 0.5 };
        self.encode(radiance).map(|c| (c * 255.0 + threshold) as u8)
    }
}

/// The 8×8 threshold matrix of Bayer (1973): each of (n + ½)/64 once.
fn bayer(x: u32, y: u32) -> f32 {
    let (mut value, q) = (0, x ^ y);
    // Bits of x⊕y and y interleave, the lowest becoming the most significant.
    for bit in 0..3 {
        value = value << 2 | (q >> bit & 1) << 1 | (y >> bit & 1);
    }
    (value as f32 + 0.5) / 64.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_keep_black_rise_and_end_in_white() {
        for curve in [Curve::Filmic, Curve::Linear] {
            let map = ToneMap { exposure: 0.0, curve, dither: false };
            let grey = |x: f32| map.encode([x; 3])[1];
            assert_eq!(map.quantize([0.0; 3], 0, 0), [0; 3]);
            assert_eq!(map.quantize([1e30; 3], 0, 0), [255; 3]);
            assert_eq!(map.quantize([f32::INFINITY; 3], 0, 0), [255; 3]);
            assert_eq!(map.quantize([f32::NAN, -1.0, 0.0], 0, 0), [0; 3]);
            for i in 0..1000 {
                let x = 2e-3 * i as f32;
                assert!(grey(x + 2e-3) >= grey(x), "{curve:?} at {x}");
            }
        }
    }

    #[test]
    fn the_curve_is_the_published_one() {
        // 0.18 (mid grey) and 1 by hand from the rational function; greys pass the matrices unchanged to their five
        // decimals, so to 1e-4.
        for (x, y) in [(0.18f32, 0.105_59_f32), (1.0, 0.619_12)] {
            let got = filmic([x; 3]);
            let by_hand = (x * (x + 0.024_578_6) - 0.000_090_537) / (x * (0.983_729 * x + 0.432_951) + 0.238_081);
            assert!((by_hand - y).abs() < 1e-4, "{by_hand}");
            assert!(got.iter().all(|c| (c - y).abs() < 1e-4), "{got:?}");
        }
    }

    #[test]
    fn srgb_has_its_fixed_points() {
        // IEC 61966-2-1: linear 0.5 is level 187.5 of 255.
        let map = ToneMap::LINEAR;
        assert_eq!(map.quantize([0.5, 1.0, 0.0], 0, 0), [188, 255, 0]);
        assert_eq!(ToneMap { exposure: -1.0, ..map }.quantize([1.0; 3], 0, 0), [188; 3]);
    }

    #[test]
    fn dithering_keeps_the_mean_and_the_ends() {
        let map = ToneMap { dither: true, ..ToneMap::LINEAR };
        let value = [0.3f32; 3];
        let exact = map.encode(value)[0] * 255.0;
        let mean = (0..64).map(|i| f32::from(map.quantize(value, i % 8, i / 8)[0])).sum::<f32>() / 64.0;
        // 64 thresholds resolve a level to 1/64.
        assert!((mean - exact).abs() <= 1.0 / 64.0, "{mean} for {exact}");
        for i in 0..64 {
            assert_eq!(map.quantize([0.0; 3], i % 8, i / 8), [0; 3]);
            assert_eq!(map.quantize([1.0; 3], i % 8, i / 8), [255; 3]);
        }
        let mut thresholds: Vec<_> = (0..64).map(|i| (bayer(i % 8, i / 8) * 64.0) as u32).collect();
        thresholds.sort_unstable();
        assert_eq!(thresholds, (0..64).collect::<Vec<_>>());
    }
}
