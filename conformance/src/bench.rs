//! Stages on a bare device, without an executor.

use std::ops::Range;

use airlight::device::{
    Binding, BindingAccess, Buf, Device, Field, FieldFormat, FieldSpec, KernelElement, ResourceId, ResourceSpec, Usage,
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
    /// Into uneven pieces that are run in disorder, or in order where the stage is sequential.
    Pieces,
    /// Into passes of so many turns of loops, each in uneven pieces.
    Passes(u64),
}

/// Every [`Cut`].
pub(crate) fn cuts() -> Axis<Cut> {
    let passes = TURNS.map(|turns| (format!("passes of {turns} turns"), Cut::Passes(turns)));
    let all = [("whole".to_owned(), Cut::Whole), ("pieces".to_owned(), Cut::Pieces)];
    Axis::new("cut", all.into_iter().chain(passes))
}

/// Turns of loops that a stage is held to: enough for whole rays of some sets, for single steps of others.
const TURNS: [u64; 3] = [4000, 600, 100];

/// Runs after which backends have built what kernels they build for a stage that stays the same.
const SETTLING: usize = 40;

/// A device with the resources of a few stages.
pub(crate) struct Bench {
    pub(crate) device: Box<dyn Device>,
    next: u32,
    settled: bool,
}

impl Bench {
    pub(crate) fn new(subject: &Subject) -> Result<Self, Failed> {
        Ok(Self { device: subject.device()?, next: 0, settled: subject.settled })
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
        let spec = FieldSpec::dense(dims, 1, FieldFormat::Scalar);
        let id = self.id();
        self.device.create(id, &ResourceSpec::Field(spec))?;
        self.device.write(id, 0, bytemuck::cast_slice(data))?;
        Ok(Field { id, spec })
    }

    /// A new RGBA field.
    pub(crate) fn colors(&mut self, dims: [u32; 3], layers: u32, data: &[[f32; 4]]) -> Result<Field, Failed> {
        let spec = FieldSpec::dense(dims, layers, FieldFormat::Rgba);
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

    /// Runs a stage over outputs filled with values that are not numbers, so that what it does not write shows, and over zeros
    /// where it adds.
    /// Every variant of a case must give the same bits, and so must a device that has settled.
    pub(crate) fn run(&mut self, record: &mut Record, stage: &Stage, cut: Cut) -> Result<(), Failed> {
        stage.validate()?;
        let axis = stage.axis();
        let (first, second, third) = (axis / 5, axis / 2, axis - axis / 7);
        let mut ranges = [second..third, 0..first, third..axis, first..first, first..second];
        if stage.sequential().is_some() {
            ranges.sort_by_key(|range| (range.start, range.end));
        }
        let whole = std::slice::from_ref(stage);
        let hold = |record: &mut Record, written: &[Vec<f32>]| {
            for (i, values) in written.iter().enumerate() {
                record.steady(&format!("output {i} of {}", stage.name()), values);
            }
        };
        if self.settled && cut == Cut::Whole {
            hold(record, &self.pieces(whole, std::slice::from_ref(&(0..axis)))?);
            for _ in 0..SETTLING {
                self.device.dispatch(stage, 0..axis)?;
                self.device.finish()?;
            }
        }
        let written = match cut {
            Cut::Whole => self.pieces(whole, std::slice::from_ref(&(0..axis)))?,
            Cut::Pieces => self.pieces(whole, &ranges)?,
            Cut::Passes(turns) => match stage.passes(turns) {
                Ok(passes) => self.pieces(&passes, &ranges)?,
                // What cannot be cut so far need not be.
                Err(_) => self.pieces(whole, &ranges)?,
            },
        };
        hold(record, &written);
        Ok(())
    }

    /// Runs the passes of a stage, each in ranges, and reads what they leave.
    fn pieces(&mut self, passes: &[Stage], ranges: &[Range<u32>]) -> Result<Vec<Vec<f32>>, Failed> {
        let mut written = Vec::new();
        let name = passes[0].name();
        for binding in passes[0].bindings() {
            if let Binding { id: Some(id), access: BindingAccess::Write(bytes), .. } = binding {
                let buf = Buf::<f32>::new(id, bytes / 4);
                let fill = if binding.element == KernelElement::Atomic { 0.0 } else { f32::NAN };
                self.device.write(id, 0, bytemuck::cast_slice(&vec![fill; buf.len as usize]))?;
                // What passes leave to each other is no result.
                if binding.name != "paths" {
                    written.push(buf);
                }
            }
        }
        for stage in passes {
            for range in ranges {
                self.device.dispatch(stage, range.clone())?;
            }
        }
        let times = self.device.finish()?;
        let dispatched: Vec<_> = passes.iter().flat_map(|_| ranges).collect();
        if times.len() != dispatched.len() {
            return Err(format!("{} times for {} dispatches of {name}", times.len(), dispatched.len()).into());
        }
        for (time, range) in times.iter().zip(dispatched) {
            if time.stage != name || time.range != *range {
                return Err(format!("a time of {} {:?} for {name} {range:?}", time.stage, time.range).into());
            }
        }
        written.into_iter().map(|buf| self.read(buf)).collect()
    }
}
