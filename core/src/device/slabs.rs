//! Cutting what is larger than a device's limits.

use std::ops::Range;

/// An axis of `len` slices cut into slabs of at most `per_slab`, so that each fits a limit. Every device cuts by this,
/// so that the seams fall in the same places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slabs {
    /// Slices in all.
    pub len: u32,
    /// Slices of a slab; the last may hold fewer.
    pub per_slab: u32,
}

impl Slabs {
    /// Slabs of `len` slices of `slice_bytes`, each of at most `limit_bytes` and `limit_len` slices. None where a
    /// single slice exceeds the limit.
    pub fn new(len: u32, slice_bytes: u64, limit_bytes: u64, limit_len: u32) -> Option<Self> {
        let fit = limit_bytes.checked_div(slice_bytes).unwrap_or(u64::MAX);
        let per_slab = fit.min(limit_len.into()).min(len.into()) as u32;
        (per_slab > 0).then_some(Self { len, per_slab })
    }

    /// How many slabs there are.
    pub fn count(&self) -> u32 {
        self.len.div_ceil(self.per_slab)
    }

    /// The slices of slab `slab`.
    pub fn range(&self, slab: u32) -> Range<u32> {
        let start = slab * self.per_slab;
        start..(start + self.per_slab).min(self.len)
    }

    /// The slab that holds slice `slice`, and the slice's place in it.
    pub fn locate(&self, slice: u32) -> (u32, u32) {
        (slice / self.per_slab, slice % self.per_slab)
    }
}

/// Texels along x, y and z of a field that holds `len` texels of a list one after the other, x fastest, then y, then z:
/// for a list that may be longer than a binding, because fields are cut and buffers that are read as a whole are not.
/// Rows and slices are of `side` texels and rows, or fewer where the list is shorter; the last slice may be longer than
/// what is left.
pub fn fold(len: u64, side: u32) -> [u32; 3] {
    let side = u64::from(side.max(1));
    let rows = len.div_ceil(side);
    let up = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
    [up(len.min(side)), up(rows.min(side)), up(rows.div_ceil(side))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folded_list_fits_and_wastes_less_than_a_slice() {
        assert_eq!(fold(1, 256), [1, 1, 1]);
        assert_eq!(fold(200, 256), [200, 1, 1]);
        assert_eq!(fold(256 * 3 + 1, 256), [256, 4, 1]);
        assert_eq!(fold(8192 * 4096, 256), [256, 256, 512]);
        for len in [1u64, 7, 63, 64, 65, 511, 512, 513, 4095] {
            for side in [1, 3, 8] {
                let [x, y, z] = fold(len, side).map(u64::from);
                assert!(x * y * z >= len && x * y * (z - 1) < len, "{len} {side}");
                assert!(x <= side.into() && y <= side.into());
                // The place of a texel is found by the sides alone.
                let last = len - 1;
                assert!(last / (x * y) < z && last / x % y < y);
            }
        }
    }

    #[test]
    fn every_slice_lies_in_one_slab() {
        let slabs = Slabs::new(1000, 1 << 20, 128 << 20, 2048).unwrap();
        assert_eq!((slabs.per_slab, slabs.count()), (128, 8));
        let mut next = 0;
        for slab in 0..slabs.count() {
            for (place, slice) in slabs.range(slab).enumerate() {
                assert_eq!(slice, next);
                assert_eq!(slabs.locate(slice), (slab, place as u32));
                next += 1;
            }
        }
        assert_eq!(next, 1000);
    }

    #[test]
    fn a_slice_past_the_limit_is_refused() {
        assert_eq!(Slabs::new(4, 200, 100, 2048), None);
        assert_eq!(Slabs::new(4096, 1, 1 << 20, 2048).unwrap().count(), 2);
    }
}
