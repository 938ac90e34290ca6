//! Stages on a bare device, without an executor.

use std::ops::Range;

use airlight::device::{
    Binding, BindingAccess, Buf, Device, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec, Usage,
};
use airlight::stage::Stage;
use bytemuck::Pod;
use libtest_mimic::Failed;

use crate::{Axis, Record, Subject};

/// How the work of a stage is cut, which must change nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cut {
    /// Into one piece.
    Whole,
    /// Into uneven pieces that are run in disorder.
    Pieces,
}

/// Every [`Cut`].
pub(crate) fn cuts() -> Axis<Cut> {
    Axis::of("cut", [Cut::Whole, Cut::Pieces])
}

/// A device with the resources of a few stages.
pub(crate) struct Bench {
    pub(crate) device: Box<dyn Device>,
    next: u32,
}

impl Bench {
    pub(crate) fn new(subject: &Subject) -> Result<Self, Failed> {
        Ok(Self { device: subject.open()?, next: 0 })
    }

    pub(crate) fn id(&mut self) -> ResourceId {
        self.next += 1;
        ResourceId(self.next)
    }

    /// A new buffer that holds `data`.
    pub(crate) fn buf<T: Pod>(&mut self, data: &[T]) -> Result<Buf<T>, Failed> {
        let buf = self.room(data.len(), Usage::Input)?;
        self.device.write(buf.id, 0, bytemuck::cast_slice(data))?;
        Ok(buf)
    }

    /// A new buffer of `len` elements.
    pub(crate) fn room<T: Pod>(&mut self, len: usize, usage: Usage) -> Result<Buf<T>, Failed> {
        let id = self.id();
        self.device.create(id, &ResourceSpec::Buffer { bytes: (len * size_of::<T>()) as u64, usage })?;
        Ok(Buf::new(id, len as u64))
    }

    /// A new scalar field of one layer.
    pub(crate) fn scalars(&mut self, dims: [u32; 3], data: &[f32]) -> Result<Field, Failed> {
        let spec = FieldSpec { dims, layers: 1, format: FieldFormat::Scalar };
        let id = self.id();
        self.device.create(id, &ResourceSpec::Field(spec))?;
        self.device.write(id, 0, bytemuck::cast_slice(data))?;
        Ok(Field { id, spec })
    }

    /// A new RGBA field.
    pub(crate) fn colors(&mut self, dims: [u32; 3], layers: u32, data: &[[f32; 4]]) -> Result<Field, Failed> {
        let spec = FieldSpec { dims, layers, format: FieldFormat::Rgba };
        let id = self.id();
        self.device.create(id, &ResourceSpec::Field(spec))?;
        self.device.write(id, 0, bytemuck::cast_slice(data))?;
        Ok(Field { id, spec })
    }

    pub(crate) fn read<T: Pod>(&mut self, buf: Buf<T>) -> Result<Vec<T>, Failed> {
        let mut out = vec![T::zeroed(); buf.len as usize];
        self.device.read(buf.id, 0, bytemuck::cast_slice_mut(&mut out))?;
        Ok(out)
    }

    /// Runs a stage over outputs filled with values that are not numbers, so that what it does not write shows.
    /// Every variant of a case must give the same bits.
    pub(crate) fn run(&mut self, record: &mut Record, stage: &Stage, cut: Cut) -> Result<(), Failed> {
        stage.validate()?;
        let axis = stage.axis();
        let (first, second, third) = (axis / 5, axis / 2, axis - axis / 7);
        let written = match cut {
            Cut::Whole => self.pieces(stage, std::slice::from_ref(&(0..axis)))?,
            Cut::Pieces => self.pieces(stage, &[second..third, 0..first, third..axis, first..first, first..second])?,
        };
        for (i, values) in written.iter().enumerate() {
            record.steady(&format!("output {i} of {}", stage.name()), values);
        }
        Ok(())
    }

    fn pieces(&mut self, stage: &Stage, ranges: &[Range<u32>]) -> Result<Vec<Vec<f32>>, Failed> {
        let mut written = Vec::new();
        for binding in stage.bindings() {
            if let Binding { id: Some(id), access: BindingAccess::Write(bytes), .. } = binding {
                let buf = Buf::<f32>::new(id, bytes / 4);
                self.device.write(id, 0, bytemuck::cast_slice(&vec![f32::NAN; buf.len as usize]))?;
                written.push(buf);
            }
        }
        for range in ranges {
            self.device.dispatch(stage, range.clone())?;
        }
        let times = self.device.finish()?;
        if times.len() != ranges.len() {
            return Err(format!("{} times for {} dispatches of {}", times.len(), ranges.len(), stage.name()).into());
        }
        for (time, range) in times.iter().zip(ranges) {
            if time.stage != stage.name() || time.range != *range {
                return Err(format!("a time of {} {:?} for {} {range:?}", time.stage, time.range, stage.name()).into());
            }
        }
        written.into_iter().map(|buf| self.read(buf)).collect()
    }
}
