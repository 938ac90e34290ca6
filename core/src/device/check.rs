//! Checks of calls that say the same on every device.

use std::ops::Range;

use super::layout::{Layout, check_bricks};
use super::{BindingAccess, DeviceError, FieldFormat, FieldSpec, ResourceId, ResourceSpec};
use crate::stage::Stage;

fn invalid(text: String) -> Result<(), DeviceError> {
    Err(DeviceError::Invalid(text))
}

impl ResourceSpec {
    /// Whether [`Device::write`](super::Device::write) may write `data` from `offset` on.
    ///
    /// # Errors
    /// Parts of words, slices or bricks; an index and bricks at once; words of an index that name no brick; bytes past the
    /// end.
    pub fn check_write(&self, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        let Self::Field(field) = self else {
            self.check_words(offset, data.len())?;
            return self.check_span(offset, data.len());
        };
        self.check_span(offset, data.len())?;
        match field.layout {
            Layout::Dense => {
                let slice = field.slice_bytes();
                if !offset.is_multiple_of(slice) || !(data.len() as u64).is_multiple_of(slice) {
                    return invalid(format!("fields are written in whole slices of {slice} bytes"));
                }
                Ok(())
            }
            Layout::Bricks(layout) => {
                self.check_words(offset, data.len())?;
                check_bricks(field, layout, offset, data)
            }
        }
    }

    /// Whether [`Device::read`](super::Device::read) may read `len` bytes from `offset` on.
    ///
    /// # Errors
    /// A field; parts of words; bytes past the end.
    pub fn check_read(&self, offset: u64, len: usize) -> Result<(), DeviceError> {
        match self {
            Self::Field(_) => invalid("fields are not read back; stages write buffers".into()),
            Self::Buffer { .. } => {
                self.check_words(offset, len)?;
                self.check_span(offset, len)
            }
        }
    }

    fn check_words(&self, offset: u64, len: usize) -> Result<(), DeviceError> {
        if !offset.is_multiple_of(4) || !len.is_multiple_of(4) {
            return invalid(format!("{len} bytes from {offset} on are not whole words of 4 bytes"));
        }
        Ok(())
    }

    fn check_span(&self, offset: u64, len: usize) -> Result<(), DeviceError> {
        match offset.checked_add(len as u64) {
            Some(end) if end <= self.bytes() => Ok(()),
            _ => invalid(format!("{len} bytes from {offset} on leave a resource of {} bytes", self.bytes())),
        }
    }

    /// Whether [`Device::publish`](super::Device::publish) may make `to` of this resource. Gives the field's shape.
    ///
    /// # Errors
    /// Anything but a buffer and a dense field of 32-bit floats of its size.
    pub fn check_publish(&self, to: &Self) -> Result<FieldSpec, DeviceError> {
        let words =
            |field: &FieldSpec| !matches!(field.format, FieldFormat::Half { .. }) && field.layout == Layout::Dense;
        match (self, to) {
            (Self::Buffer { bytes, .. }, Self::Field(field)) if words(field) && *bytes == field.bytes() => Ok(*field),
            _ => Err(DeviceError::Invalid(format!(
                "a dense field of 32-bit floats is published from a buffer of its size, not {to:?} from {self:?}"
            ))),
        }
    }
}

impl Stage {
    /// Whether [`Device::dispatch`](super::Device::dispatch) may run `range` of this stage on a device whose
    /// resources `spec` tells: [`Stage::validate`], the range, and every binding. What passes indexes nothing out of
    /// bounds.
    ///
    /// # Errors
    /// The first thing that does not fit.
    pub fn check(
        &self,
        range: &Range<u32>,
        spec: impl Fn(ResourceId) -> Option<ResourceSpec>,
    ) -> Result<(), DeviceError> {
        self.validate().map_err(DeviceError::Invalid)?;
        if range.start > range.end || range.end > self.axis() {
            return invalid(format!("{range:?} is not a part of {}", self.axis()));
        }
        for binding in self.bindings() {
            let Some(id) = binding.id else { continue };
            let held = spec(id).ok_or_else(|| DeviceError::Invalid(format!("resource {} does not exist", id.0)))?;
            let fits = match (binding.access, held) {
                (BindingAccess::Sample(wanted), ResourceSpec::Field(field)) => wanted == field,
                (BindingAccess::Read(wanted) | BindingAccess::Write(wanted), ResourceSpec::Buffer { bytes, .. }) => {
                    wanted <= bytes
                }
                _ => false,
            };
            if !fits {
                return invalid(format!("{} is {held:?}, and {:?} is wanted", binding.name, binding.access));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::device::{BrickLayout, Buf, Field, FieldKinds, Usage};
    use crate::stage::{Reduce, ReduceParams};

    const FIELD: FieldSpec = FieldSpec::dense([3, 2, 4], 1, FieldFormat::Scalar);
    const BUFFER: ResourceSpec = ResourceSpec::Buffer { bytes: 96, usage: Usage::Work };

    #[test]
    fn whole_words_and_slices_within_the_resource() {
        let field = ResourceSpec::Field(FIELD);
        for (offset, len) in [(0, 96), (24, 48), (96, 0), (72, 24)] {
            assert_eq!(
                (BUFFER.check_write(offset, &vec![0; len]), field.check_write(offset, &vec![0; len])),
                (Ok(()), Ok(()))
            );
        }
        for (offset, len) in [(0, 100), (96, 4), (u64::MAX - 3, 4), (2, 4), (4, 3)] {
            assert!(
                BUFFER.check_write(offset, &vec![0; len]).is_err() && BUFFER.check_read(offset, len).is_err(),
                "{offset} {len}"
            );
        }
        for (offset, len) in [(0, 12), (4, 24), (96, 24)] {
            assert!(field.check_write(offset, &vec![0; len]).is_err(), "{offset} {len}");
        }
        assert!(field.check_read(0, 24).is_err());
        assert_eq!(BUFFER.check_publish(&field), Ok(FIELD));
        let short = ResourceSpec::Buffer { bytes: 92, usage: Usage::Work };
        for (from, to) in [(short, field), (field, field), (BUFFER, BUFFER)] {
            assert!(from.check_publish(&to).is_err(), "{from:?} {to:?}");
        }
    }

    #[test]
    fn bricks_take_an_index_that_names_them_or_whole_bricks() {
        let layout = Layout::Bricks(BrickLayout { bricks: 3, constants: 1 });
        let dims = [17, 8, 9];
        for (format, brick) in [(FieldFormat::Scalar, 2916u64), (FieldFormat::Half { exponent: 8 }, 1460)] {
            let field = FieldSpec { layout, ..FieldSpec::dense(dims, 1, format) };
            let spec = ResourceSpec::Field(field);
            // 3 × 1 × 2 blocks.
            assert_eq!(spec.bytes(), 24 + 3 * brick);
            assert_eq!(spec.check_kind(FieldKinds::ALL), Ok(()));
            let words = |words: &[u32]| bytemuck::cast_slice::<u32, u8>(words).to_vec();
            for (offset, data) in [
                (0, words(&[0, 1, 2, 2, 1, 0])),
                (20, words(&[2])),
                (24, vec![0xff; brick as usize]),
                (24 + brick, vec![0; 2 * brick as usize]),
                (24 + 3 * brick, vec![]),
            ] {
                assert_eq!(spec.check_write(offset, &data), Ok(()), "{offset}");
            }
            for (offset, data, told) in [
                (4, words(&[0, 3]), "block 2 names brick 3 of 3"),
                (2, words(&[0]), "whole words"),
                (20, words(&[0, 0]), "by itself"),
                (0, vec![0; 24 + brick as usize], "by itself"),
                (28, vec![0; brick as usize], "whole"),
                (24, vec![0; 4], "whole"),
                (24 + 2 * brick, vec![0; 2 * brick as usize], "leave a resource"),
            ] {
                let error = spec.check_write(offset, &data).unwrap_err().to_string();
                assert!(error.contains(told), "{offset}: {error}");
            }
            let bytes = spec.bytes();
            assert!(ResourceSpec::Buffer { bytes, usage: Usage::Work }.check_publish(&spec).is_err());
        }
    }

    #[test]
    fn kinds_of_fields_are_refused_where_they_are_not_held() {
        let half = FieldSpec::dense([3, 2, 4], 1, FieldFormat::Half { exponent: 0 });
        let bricks = |bricks, constants| Layout::Bricks(BrickLayout { bricks, constants });
        let all = FieldKinds::ALL;
        let plain = FieldKinds::default();
        let check = |field, kinds| ResourceSpec::Field(field).check_kind(kinds);
        assert_eq!((check(FIELD, plain), check(half, all)), (Ok(()), Ok(())));
        for (field, kinds, told) in [
            (half, FieldKinds { bricks: true, ..plain }, "16-bit"),
            (FieldSpec { layout: bricks(2, 1), ..FIELD }, FieldKinds { halves: true, ..plain }, "bricks"),
            (FieldSpec { layers: 2, ..half }, all, "one layer"),
            (FieldSpec { layout: bricks(2, 1), ..FieldSpec::dense([3; 3], 1, FieldFormat::Rgba) }, all, "one layer"),
            (FieldSpec { layout: bricks(0, 0), ..FIELD }, all, "0 bricks"),
            (FieldSpec { layout: bricks(1, 2), ..FIELD }, all, "1 bricks"),
            (FieldSpec::dense([3; 3], 1, FieldFormat::Half { exponent: 100 }), all, "2^100"),
        ] {
            let error = check(field, kinds).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }

    #[test]
    fn stages_fit_their_range_and_resources() {
        let params = ReduceParams::new([3, 2, 4, 0], [3, 2, 2, 0], [1.0, 1.0, 2.0, 0.0]);
        let density = Field { id: ResourceId(1), spec: FIELD };
        let stage = Stage::Reduce(Reduce { params, density, other: None, out: Buf::new(ResourceId(2), 12) });
        let holds = |field: ResourceSpec, out: ResourceSpec| {
            move |id: ResourceId| match id.0 {
                1 => Some(field),
                2 => Some(out),
                _ => None,
            }
        };
        let (field, other) = (ResourceSpec::Field(FIELD), ResourceSpec::Field(FieldSpec { layers: 2, ..FIELD }));
        for range in [0..12, 3..5, 12..12] {
            assert_eq!(stage.check(&range, holds(field, BUFFER)), Ok(()));
        }
        assert!(stage.check(&(0..13), holds(field, BUFFER)).is_err());
        #[expect(clippy::reversed_empty_ranges)]
        let backwards = 5..3;
        assert!(stage.check(&backwards, holds(field, BUFFER)).is_err());
        let short = ResourceSpec::Buffer { bytes: 92, usage: Usage::Work };
        for (field, out) in [(other, BUFFER), (BUFFER, BUFFER), (field, field), (field, short)] {
            assert!(stage.check(&(0..1), holds(field, out)).is_err(), "{field:?} {out:?}");
        }
        assert!(stage.check(&(0..1), |_| None).is_err());
    }
}
