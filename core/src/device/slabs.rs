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

#[cfg(test)]
mod tests {
    use super::*;

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
