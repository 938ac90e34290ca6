//! Random numbers that every device draws alike: a hash of integers, in arithmetic modulo 2³².

/// Scatters the bits of `x`: multiplications and shifts with the constants of C. Wellons' `lowbias32`. A bijection, and
/// 0 stays 0.
pub fn scatter(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// The hash of a sequence of keys: h = scatter(key + h) from the last key to the first, from h = 0.
pub fn hash<const N: usize>(keys: [u32; N]) -> u32 {
    keys.iter().rev().fold(0, |h, &key| scatter(key.wrapping_add(h)))
}

/// The upper 24 bits of `h` as a number in [0, 1), which f32 holds exactly.
pub fn unit(h: u32) -> f32 {
    (h >> 8) as f32 / (1u32 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_kernels_must_give() {
        // Worked out apart from this code, in Python's unbounded integers.
        assert_eq!([scatter(0), scatter(1), scatter(0xffff_ffff)], [0, 0x6889_90c0, 0x6768_824a]);
        assert_eq!(hash([1, 2, 3]), 0xacfd_7e59);
        assert_eq!(unit(u32::MAX), 1.0 - 1.0 / 16_777_216.0);
    }

    #[test]
    fn bits_of_neighbouring_keys_are_independent() {
        // Each bit of the hash flips for half of the neighbours, within four standard deviations.
        for bit in 0..32 {
            let n = 16_384u32;
            let flips = (0..n).filter(|&i| (hash([i, 7, 9]) ^ hash([i + 1, 7, 9])) >> bit & 1 == 1).count() as f64;
            let deviation = (f64::from(n) / 4.0).sqrt();
            assert!((flips - f64::from(n) / 2.0).abs() < 4.0 * deviation, "bit {bit}: {flips}");
        }
    }
}
