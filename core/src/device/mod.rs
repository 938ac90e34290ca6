//! What a backend implements.
//!
//! A [`Device`] holds resources under ids that the executor chooses, moves bytes in and out of them, and runs pieces
//! of [`Stage`]s in order. It knows nothing of scenes, estimators or caching. A backend exports a [`Provider`].

mod bytes;
mod check;
mod decorate;
mod kernel;
mod layout;
mod resource;
mod slabs;
mod text;

use std::any::Any;
use std::ops::Range;
use std::time::Duration;

pub use bytes::Bytes;
pub use decorate::{Fault, Faulty, Traced};
pub use kernel::{
    BufferElement, KernelElement, KernelField, KernelScalar, KernelStruct, check_layout as kernel_check_layout,
};
pub use layout::{BrickLayout, FieldKinds, Layout};
pub use resource::{Binding, BindingAccess, Buf, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec, Usage};
pub use slabs::{Slabs, fold};
pub use text::{Helper, KernelFile, KernelLanguage, KernelText, Recipe, Shape, ShapeKind};

use crate::stage::Stage;

/// A device that runs stages.
///
/// Calls are in order: a stage sees all that was written and dispatched before it. `dispatch` may return before the
/// work is done; `read` and `finish` wait. After [`DeviceError::Lost`] every call fails with it.
pub trait Device: Any + Send {
    /// What the device is and can do.
    fn info(&self) -> &DeviceInfo;

    /// Bytes that could be had now, beside those that are already held; none where the device cannot tell.
    fn free_memory(&self) -> Option<u64> {
        None
    }

    /// Bytes that the device takes for itself to run a stage, beside the resources, and may keep for the next one.
    fn scratch(&self, stage: &Stage) -> u64 {
        let _ = stage;
        0
    }

    /// What fields the device holds beside dense ones of 32-bit floats. By default none: it is asked for no others, but
    /// [`Device::create`] must refuse them ([`ResourceSpec::check_kind`]).
    fn field_kinds(&self) -> FieldKinds {
        FieldKinds::default()
    }

    /// Makes the resource `id`, filled with zeros.
    ///
    /// # Errors
    /// Not enough memory, limits exceeded, an id that exists.
    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError>;

    /// Frees the resource `id`, if it exists.
    fn destroy(&mut self, id: ResourceId);

    /// Writes bytes from `offset` on. Buffers take whole 4-byte words; dense fields whole z-slices: layer fastest, then
    /// x, y and z; fields in bricks words of their index, or whole bricks ([`BrickLayout`]).
    ///
    /// # Errors
    /// No such resource; bytes past its end; parts of words, slices or bricks; an index that names no brick.
    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError>;

    /// Reads bytes of a buffer from `offset` on, both in whole 4-byte words, after all work so far.
    ///
    /// # Errors
    /// No such resource; bytes past its end; parts of words; a fault of the work so far; a field (stages write buffers).
    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError>;

    /// What [`Device::read`] would give of a whole buffer, where it lies in memory that the host sees and all work is done: then
    /// large results need no copy. None by default.
    fn view(&self, id: ResourceId) -> Option<&[u8]> {
        let _ = id;
        None
    }

    /// Makes a field of what stages wrote into a buffer: layer fastest, then x, y and z, as 32-bit floats.
    ///
    /// # Errors
    /// No such resources, or sizes that differ.
    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError>;

    /// Runs `range` of the stage's work axis ([`Stage::axis`]). Ranges of one stage do not depend on each other; those of
    /// a sequential one ([`Stage::sequential`]) come in order, and the device runs their units in order.
    ///
    /// # Errors
    /// A stage that does not fit its resources; a kernel that does not build or run.
    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError>;

    /// Waits for all work, and gives the time of each dispatch since the last call, in order. Late faults surface here.
    ///
    /// # Errors
    /// A fault of the work so far.
    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError>;

    /// Sends all work on its way without waiting for it, and forgets the times of the dispatches since the last call of
    /// this or of [`Device::finish`]. Faults may surface in a later call. By default it waits.
    ///
    /// # Errors
    /// A fault of the work so far.
    fn flush(&mut self) -> Result<(), DeviceError> {
        self.finish().map(drop)
    }

    /// How long the device may let its caller wait for one dispatch; none for as long as it takes. When a call has
    /// waited longer, it fails with [`DeviceError::Timeout`], and where the work could not be stopped, the device is
    /// lost: its queue cannot be trusted any more. A device that works within `dispatch` cannot give up, has no use for
    /// this and need not implement it: its caller sees the time.
    fn set_patience(&mut self, patience: Option<Duration>) {
        let _ = patience;
    }

    /// Keeps from now on to limits no larger than these, where it cuts what exceeds them, so that its cuts can be tried
    /// on small data. To be called before anything is created. Gives whether it does; a device that cuts nothing has
    /// nothing to try.
    fn narrow(&mut self, limits: &Limits) -> bool {
        let _ = limits;
        false
    }
}

impl dyn Device {
    /// The device itself, where it is a `D`: what a backend offers beyond this trait.
    pub fn downcast_mut<D: Device>(&mut self) -> Option<&mut D> {
        (self as &mut dyn Any).downcast_mut()
    }
}

/// The time one dispatch took on the device.
#[derive(Clone, Debug, PartialEq)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: &'static str,
    /// The part of its work axis.
    pub range: Range<u32>,
    /// How long it ran.
    pub time: Duration,
}

/// What kind of machine a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// Processor cores.
    Cpu,
    /// A graphics processor of its own.
    DiscreteGpu,
    /// A graphics processor that shares the processor's memory.
    IntegratedGpu,
    /// A graphics interface on processor cores.
    SoftwareGpu,
    /// Anything else.
    Other,
}

impl DeviceKind {
    /// Whether what the device holds lies in the same memory as what the host holds.
    pub fn shares_host_memory(self) -> bool {
        matches!(self, Self::Cpu | Self::IntegratedGpu | Self::SoftwareGpu)
    }

    /// The kind in words, for lists and `--json`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::DiscreteGpu => "discrete-gpu",
            Self::IntegratedGpu => "integrated-gpu",
            Self::SoftwareGpu => "software-gpu",
            Self::Other => "other",
        }
    }
}

/// Sizes that a device does not exceed, in bytes or texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The largest buffer.
    pub buffer_bytes: u64,
    /// The largest part of a buffer that one stage sees at a time.
    pub binding_bytes: u64,
    /// The longest side of a field held in one piece.
    pub field_side: u32,
    /// How often all loops of one invocation of a kernel may turn together, where the driver bounds that.
    pub loop_turns: Option<u32>,
}

impl Limits {
    /// The smaller of each.
    pub fn min(&self, other: &Self) -> Self {
        Self {
            buffer_bytes: self.buffer_bytes.min(other.buffer_bytes),
            binding_bytes: self.binding_bytes.min(other.binding_bytes),
            field_side: self.field_side.min(other.field_side),
            loop_turns: self.loop_turns.into_iter().chain(other.loop_turns).min(),
        }
    }
}

/// What a device is and can do.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceInfo {
    /// Name of the backend: `cpu`, `wgpu`, `opencl`.
    pub backend: &'static str,
    /// Index among the backend's devices.
    pub index: usize,
    /// The device's own name.
    pub name: String,
    /// What kind of machine it is.
    pub kind: DeviceKind,
    /// Memory in bytes, where it is known.
    pub memory_bytes: Option<u64>,
    /// Sizes it does not exceed.
    pub limits: Limits,
    /// What it offers, in the backend's words: instruction sets, extensions, driver.
    pub features: Vec<String>,
    /// Bits of a filter weight between two texels of a field; 24 is a filter in 32-bit floats.
    pub filter_bits: u32,
    /// Whether its compilers may round a product and a sum as one, which kernels cannot forbid everywhere: then kernels of a
    /// stage that are built for other layouts may differ in their last bits.
    pub contracts: bool,
    /// Why it is there and cannot be opened.
    pub unusable: Option<String>,
}

impl DeviceInfo {
    /// `backend:index`, as the command line takes it.
    pub fn id(&self) -> String {
        format!("{}:{}", self.backend, self.index)
    }
}

/// Why a device call failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// The memory is not there.
    #[error(
        "{} could not be had{}",
        Bytes(*requested),
        available.map(|a| format!(" ({} available)", Bytes(a))).unwrap_or_default()
    )]
    OutOfMemory {
        /// Bytes asked for.
        requested: u64,
        /// Bytes that were left, where that is known.
        available: Option<u64>,
    },
    /// A size past the device's limits.
    #[error("{what} of {requested} exceeds the device's limit of {limit}")]
    Limit {
        /// What was too large.
        what: &'static str,
        /// Its size.
        requested: u64,
        /// The largest that would do.
        limit: u64,
    },
    /// A call that does not fit the resources: a bug in the caller.
    #[error("invalid use of the device: {0}")]
    Invalid(String),
    /// A dispatch that took too long ([`Device::set_patience`]).
    #[error("{stage} took longer than the {patience:?} that it was given")]
    Timeout {
        /// Name of the stage, or what else was waited for.
        stage: &'static str,
        /// How long it was waited for.
        patience: Duration,
    },
    /// The backend's own fault, in its words.
    #[error("{0}")]
    Backend(String),
    /// The device is gone; open it anew.
    #[error("the device was lost: {0}")]
    Lost(String),
}

/// Why a backend has no devices, or a device cannot be opened: a missing loader, driver or platform.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Unavailable(pub String);

/// What a backend exports.
#[derive(Clone, Copy)]
pub struct Provider {
    /// Name of the backend, as the command line takes it.
    pub name: &'static str,
    /// The backend's devices, or why it has none. Never panics, and loads the backend's runtime only here.
    pub enumerate: fn() -> Result<Vec<DeviceInfo>, Unavailable>,
    /// Opens the device of an index that `enumerate` gave. May be called on several threads at once, as `enumerate`.
    pub open: fn(usize) -> Result<Box<dyn Device>, Unavailable>,
}

impl std::fmt::Debug for Provider {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Provider").field("name", &self.name).finish_non_exhaustive()
    }
}
