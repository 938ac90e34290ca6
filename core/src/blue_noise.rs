//! Where a view ray's samples lie within their steps, from pixel to pixel and from picture to picture.
//!
//! Within a picture the places are blue noise: neighbours differ as much as they can, so that what a coarse step misses
//! becomes fine grain instead of bands. From one picture of a sequence to the next a pixel's place advances by the golden
//! ratio (the additive recurrence R1 of M. Roberts), so that few of them already fill the step evenly.

/// Pixels along each side of the tile.
pub const SIDE: u32 = 128;

/// 128 × 128 bytes; `data/README.md` says where they are from.
const BYTES: &[u8; (SIDE * SIDE) as usize] = include_bytes!("../data/blue-noise-128.u8");

/// The tile, row by row: (b + ½)/256 of each byte b.
pub fn tile() -> impl Iterator<Item = f32> {
    BYTES.iter().map(|&b| (f32::from(b) + 0.5) / 256.0)
}

/// Place `n` of the recurrence in [0, 1): n times the golden ratio's fraction, its upper 20 bits, so that sums with the
/// tile's values are exact in f32.
pub fn offset(n: u64) -> f32 {
    const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
    (n.wrapping_mul(GOLDEN) >> 44) as f32 / (1u32 << 20) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_the_tile_differ_more_than_chance() {
        let values: Vec<f32> = tile().collect();
        let side = SIDE as usize;
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        assert!((mean - 0.5).abs() < 1e-6, "{mean}");
        // Independent values differ by a third; wrapped, so that the tile's edges are tried too.
        let pairs = (0..side).flat_map(|y| (0..side).map(move |x| (y * side + x, y * side + (x + 1) % side)));
        let apart = pairs.map(|(a, b)| (values[a] - values[b]).abs()).sum::<f32>() / values.len() as f32;
        assert!(apart > 0.38, "{apart}");
    }

    #[test]
    fn places_fill_the_step_evenly_and_in_exact_parts() {
        for count in [4u64, 16, 64, 233] {
            let mut places: Vec<f32> = (0..count).map(offset).collect();
            assert!(places.iter().all(|v| (0.0..1.0).contains(v) && (v * 1_048_576.0).fract() == 0.0));
            places.sort_by(f32::total_cmp);
            let gaps = places.windows(2).map(|w| w[1] - w[0]).chain([1.0 - places[places.len() - 1] + places[0]]);
            // Three gaps, the widest at most the golden ratio's square of the mean.
            assert!(gaps.fold(0.0, f32::max) < 2.62 / count as f32, "{count}");
        }
        // The recurrence goes on where f32 could not count any more.
        assert!(offset(u64::from(u32::MAX) * 4096) != offset(u64::from(u32::MAX) * 4096 + 1));
    }
}
