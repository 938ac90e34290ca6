//! Cutting a dispatch so that the buffers it sees fit the device's bindings.

use std::ops::Range;

use airlight_core::device::{Binding, BindingAccess, DeviceError, Slabs};

/// What a binding may hold.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BindingLimits {
    /// The most bytes.
    pub(crate) bytes: u64,
    /// What its offset must be a multiple of.
    pub(crate) align: u64,
}

/// Groups of a stage's work axis cut so that each slab's part of every buffer fits a binding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cut {
    slabs: Slabs,
    axis: u32,
    group: u32,
}

/// A part of a dispatch whose buffers fit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    /// Units of the work axis.
    pub(crate) range: Range<u32>,
    /// Groups whose part of the buffers is bound.
    pub(crate) groups: Range<u32>,
}

fn bytes(binding: &Binding) -> Option<u64> {
    match binding.access {
        BindingAccess::Read(bytes) | BindingAccess::Write(bytes) => binding.id.map(|_| bytes),
        BindingAccess::Sample(_) => None,
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

impl Cut {
    /// Of a work axis of `axis` units in groups of `group`.
    ///
    /// # Errors
    /// A buffer that is bound whole, or one group's part of another, exceeds the limit.
    pub(crate) fn new(axis: u32, group: u32, bindings: &[Binding], limits: BindingLimits) -> Result<Self, DeviceError> {
        let groups = axis.div_ceil(group.max(1));
        let mut slabs = Slabs { len: groups, per_slab: groups.max(1) };
        // Slabs begin where every buffer's part begins at an offset that a binding may have.
        let mut align = 1;
        for binding in bindings {
            let Some(bytes) = bytes(binding).filter(|&bytes| bytes > 0) else { continue };
            let Some(part) = binding.part else {
                if bytes > limits.bytes {
                    let what = "a buffer that a stage reads as a whole";
                    return Err(DeviceError::Limit { what, requested: bytes, limit: limits.bytes });
                }
                continue;
            };
            align = align.max(limits.align / gcd(limits.align, part));
            if bytes > limits.bytes {
                let fits = Slabs::new(groups, part, limits.bytes, slabs.per_slab);
                slabs.per_slab = fits.map_or(0, |fits| fits.per_slab);
            }
        }
        if slabs.per_slab < groups {
            slabs.per_slab -= slabs.per_slab % align as u32;
        }
        if slabs.per_slab == 0 {
            let most = bindings.iter().filter_map(|b| b.part).max().unwrap_or(0);
            let what = "the part of a buffer that a stage must see at a time";
            return Err(DeviceError::Limit { what, requested: most * align, limit: limits.bytes });
        }
        Ok(Self { slabs, axis, group: group.max(1) })
    }

    /// Whether a piece sees the whole of every buffer.
    pub(crate) fn whole(self) -> bool {
        self.slabs.count() <= 1
    }

    /// The pieces of `range`, in order.
    pub(crate) fn pieces(self, range: Range<u32>) -> impl Iterator<Item = Piece> {
        let group_of = |unit: u32| unit / self.group;
        let slabs = if range.is_empty() {
            0..0
        } else {
            self.slabs.locate(group_of(range.start)).0..self.slabs.locate(group_of(range.end - 1)).0 + 1
        };
        slabs.map(move |slab| {
            let groups = self.slabs.range(slab);
            let start = range.start.max(groups.start * self.group);
            // The last group may reach past the axis, and past what 32 bits hold.
            let end = range.end.min(groups.end.saturating_mul(self.group)).min(self.axis);
            Piece { range: start..end, groups }
        })
    }
}

impl Piece {
    /// Offset and bytes of a buffer that the piece sees.
    pub(crate) fn window(&self, binding: &Binding) -> (u64, u64) {
        let all = bytes(binding).unwrap_or(0);
        binding.part.map_or((0, all), |part| {
            let start = (u64::from(self.groups.start) * part).min(all);
            let end = (u64::from(self.groups.end) * part).min(all);
            // A buffer may be longer than its parts, and the last piece sees the rest where it fits.
            (start, end - start)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use airlight_core::device::{Buf, ResourceId};

    const LIMITS: BindingLimits = BindingLimits { bytes: 30_000, align: 256 };

    fn buffer(id: u32, floats: u64) -> Binding {
        Binding::write("out", Some(Buf::<f32>::new(ResourceId(id), floats)))
    }

    #[test]
    fn what_fits_is_one_piece() {
        let cut = Cut::new(100, 1, &[buffer(0, 2400).in_parts::<f32>(24)], LIMITS).unwrap();
        let pieces: Vec<_> = cut.pieces(7..93).collect();
        assert_eq!(pieces, [Piece { range: 7..93, groups: 0..100 }]);
        assert_eq!(cut.pieces(5..5).count(), 0);
    }

    #[test]
    fn pieces_cover_the_range_once_and_their_windows_fit_and_are_aligned() {
        for (units, group, floats) in [(1000u32, 1u32, 27u64), (997, 1, 75), (600, 8, 256), (601, 7, 13)] {
            let groups = u64::from(units.div_ceil(group));
            let bindings = [buffer(0, groups * floats).in_parts::<f32>(floats), buffer(1, 9), buffer(2, 0)];
            let cut = Cut::new(units, group, &bindings, LIMITS).unwrap();
            for range in [0..units, 3..units - 2, 500..501] {
                let mut next = range.start;
                for piece in cut.pieces(range.clone()) {
                    assert_eq!(piece.range.start, next);
                    assert!(piece.groups.start * group <= piece.range.start);
                    assert!(piece.range.end <= piece.groups.end * group);
                    let (offset, size) = piece.window(&bindings[0]);
                    assert!(offset % LIMITS.align == 0 && size <= LIMITS.bytes, "{offset} {size}");
                    assert_eq!(piece.window(&bindings[1]), (0, 36));
                    next = piece.range.end;
                }
                assert_eq!(next, range.end);
            }
        }
    }

    #[test]
    fn what_cannot_be_cut_is_refused_with_the_numbers() {
        let whole = Cut::new(10, 1, &[buffer(0, 9000)], LIMITS).unwrap_err();
        assert!(matches!(whole, DeviceError::Limit { requested: 36_000, limit: 30_000, .. }), "{whole}");
        let part = Cut::new(10, 1, &[buffer(0, 90_000).in_parts::<f32>(9000)], LIMITS).unwrap_err();
        assert!(matches!(part, DeviceError::Limit { limit: 30_000, .. }), "{part}");
    }
}
