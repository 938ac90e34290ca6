//! Checks of calls that say the same on every device.

use std::ops::Range;

use super::{BindingAccess, DeviceError, FieldSpec, ResourceId, ResourceSpec};
use crate::stage::Stage;

fn invalid(text: String) -> Result<(), DeviceError> {
    Err(DeviceError::Invalid(text))
}

impl ResourceSpec {
    /// Whether [`Device::write`](super::Device::write) may write `len` bytes from `offset` on.
    ///
    /// # Errors
    /// Parts of words or slices; bytes past the end.
    pub fn check_write(&self, offset: u64, len: usize) -> Result<(), DeviceError> {
        if let Self::Field(field) = self {
            let slice = field.slice_bytes();
            if !offset.is_multiple_of(slice) || !(len as u64).is_multiple_of(slice) {
                return invalid(format!("fields are written in whole slices of {slice} bytes"));
            }
        }
        self.check_span(offset, len)
    }

    /// Whether [`Device::read`](super::Device::read) may read `len` bytes from `offset` on.
    ///
    /// # Errors
    /// A field; parts of words; bytes past the end.
    pub fn check_read(&self, offset: u64, len: usize) -> Result<(), DeviceError> {
        match self {
            Self::Field(_) => invalid("fields are not read back; stages write buffers".into()),
            Self::Buffer { .. } => self.check_span(offset, len),
        }
    }

    fn check_span(&self, offset: u64, len: usize) -> Result<(), DeviceError> {
        if !offset.is_multiple_of(4) || !len.is_multiple_of(4) {
            return invalid(format!("{len} bytes from {offset} on are not whole words of 4 bytes"));
        }
        match offset.checked_add(len as u64) {
            Some(end) if end <= self.bytes() => Ok(()),
            _ => invalid(format!("{len} bytes from {offset} on leave a resource of {} bytes", self.bytes())),
        }
    }

    /// Whether [`Device::publish`](super::Device::publish) may make `to` of this resource. Gives the field's shape.
    ///
    /// # Errors
    /// Anything but a buffer and a field of its size.
    pub fn check_publish(&self, to: &Self) -> Result<FieldSpec, DeviceError> {
        match (self, to) {
            (Self::Buffer { bytes, .. }, Self::Field(field)) if *bytes == field.bytes() => Ok(*field),
            _ => Err(DeviceError::Invalid(format!(
                "a field is published from a buffer of its size, not {to:?} from {self:?}"
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
    use crate::device::{Buf, Field, FieldFormat, Usage};
    use crate::stage::{Reduce, ReduceParams};

    const FIELD: FieldSpec = FieldSpec { dims: [3, 2, 4], layers: 1, format: FieldFormat::Scalar };
    const BUFFER: ResourceSpec = ResourceSpec::Buffer { bytes: 96, usage: Usage::Work };

    #[test]
    fn whole_words_and_slices_within_the_resource() {
        let field = ResourceSpec::Field(FIELD);
        for (offset, len) in [(0, 96), (24, 48), (96, 0), (72, 24)] {
            assert_eq!((BUFFER.check_write(offset, len), field.check_write(offset, len)), (Ok(()), Ok(())));
        }
        for (offset, len) in [(0, 100), (96, 4), (u64::MAX - 3, 4), (2, 4), (4, 3)] {
            assert!(
                BUFFER.check_write(offset, len).is_err() && BUFFER.check_read(offset, len).is_err(),
                "{offset} {len}"
            );
        }
        for (offset, len) in [(0, 12), (4, 24), (96, 24)] {
            assert!(field.check_write(offset, len).is_err(), "{offset} {len}");
        }
        assert!(field.check_read(0, 24).is_err());
        assert_eq!(BUFFER.check_publish(&field), Ok(FIELD));
        let short = ResourceSpec::Buffer { bytes: 92, usage: Usage::Work };
        for (from, to) in [(short, field), (field, field), (BUFFER, BUFFER)] {
            assert!(from.check_publish(&to).is_err(), "{from:?} {to:?}");
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
