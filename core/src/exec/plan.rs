//! What one frame needs, in order.

use std::any::Any;
use std::collections::HashMap;
use std::hash::Hash;

use bytemuck::Pod;
use rayon::prelude::*;

use super::key::Key;
use super::solve::Solve;
use crate::device::{
    Binding, BindingAccess, BrickLayout, Buf, Device, DeviceError, Field, FieldFormat, FieldKinds, FieldSpec, Limits,
    ResourceId, ResourceSpec, Usage,
};
use crate::media::Bricks;
use crate::stage::Stage;

/// Fills a resource: called once, when its content is needed.
pub(super) type Fill<'a> = Box<dyn FnOnce(&mut dyn Device, ResourceId) -> Result<(), DeviceError> + 'a>;

/// Bricks that are made and written at a time.
const BRICKS: u32 = 1024;

pub(super) enum Work<'a> {
    Upload { id: ResourceId, fill: Fill<'a> },
    Stage(Box<Stage>),
    Publish { from: ResourceId, to: ResourceId },
    Solve(Box<Solve>),
}

pub(super) struct Node<'a> {
    pub(super) work: Work<'a>,
    /// What it writes, and the keys of that once written.
    pub(super) writes: Vec<(ResourceId, Key)>,
    /// Whether it runs even where the keys stand.
    pub(super) always: bool,
}

pub(super) struct Declared {
    pub(super) spec: ResourceSpec,
    pub(super) reset: Option<Key>,
}

/// A state: what the last frame left, and where this frame writes. They change places after a frame that ran.
#[derive(Clone, Copy, Debug)]
pub struct State<T> {
    /// As the last frame left it; zeros after a reset.
    pub previous: Buf<T>,
    /// What this frame writes.
    pub next: Buf<T>,
}

/// Names of resources, kept between frames.
#[derive(Debug, Default)]
pub(super) struct Slots {
    ids: HashMap<String, ResourceId>,
    pub(super) names: Vec<String>,
    /// States whose two buffers have changed places.
    pub(super) swapped: HashMap<String, bool>,
    /// What the last frame that ran handed on.
    pub(super) handed: HashMap<String, Box<dyn Any + Send>>,
}

impl Slots {
    fn id(&mut self, name: &str) -> ResourceId {
        if let Some(&id) = self.ids.get(name) {
            return id;
        }
        let id = ResourceId(self.names.len() as u32);
        self.names.push(name.to_owned());
        self.ids.insert(name.to_owned(), id);
        id
    }
}

/// What one frame needs, in order. Resources are named; the same name in the next frame's plan means the same
/// resource, whose content stays where its key does.
pub struct Plan<'a> {
    pub(super) slots: &'a mut Slots,
    pub(super) nodes: Vec<Node<'a>>,
    pub(super) declared: HashMap<ResourceId, Declared>,
    pub(super) states: Vec<String>,
    /// What it hands on to the next one.
    pub(super) handed: HashMap<String, Box<dyn Any + Send>>,
    /// Bytes that the host takes for itself while the plan runs and after.
    pub(super) host: u64,
    limits: Limits,
    kinds: FieldKinds,
    keys: HashMap<ResourceId, Key>,
    frame: u64,
}

impl<'a> Plan<'a> {
    pub(super) fn new(slots: &'a mut Slots, frame: u64, limits: Limits, kinds: FieldKinds) -> Self {
        Self {
            slots,
            nodes: Vec::new(),
            declared: HashMap::new(),
            states: Vec::new(),
            handed: HashMap::new(),
            host: 0,
            limits,
            kinds,
            keys: HashMap::new(),
            frame,
        }
    }

    fn declare(&mut self, slot: &str, spec: ResourceSpec, reset: Option<Key>) -> ResourceId {
        let id = self.slots.id(slot);
        let earlier = self.declared.insert(id, Declared { spec, reset });
        assert!(earlier.is_none(), "two resources of one plan are named {slot}");
        id
    }

    /// How often all loops of one invocation may turn together on the device, where its driver bounds that. A stage
    /// that would exceed it runs in passes, for which it may need buffers of its own.
    pub fn loop_turns(&self) -> Option<u32> {
        self.limits.loop_turns
    }

    /// How much of a buffer a stage binds at the most.
    pub fn binding_bytes(&self) -> u64 {
        self.limits.binding_bytes
    }

    /// The longest side of a field that the device holds in one piece.
    pub fn field_side(&self) -> u32 {
        self.limits.field_side
    }

    /// What fields the device holds beside dense ones of 32-bit floats.
    pub fn field_kinds(&self) -> FieldKinds {
        self.kinds
    }

    /// Counts bytes that the host needs beside the plan's resources, so that they are known to be there where host
    /// and device share their memory.
    pub fn host(&mut self, bytes: u64) {
        self.host = self.host.saturating_add(bytes);
    }

    /// A buffer that a stage writes.
    pub fn work<T: Pod>(&mut self, slot: &str, len: u64) -> Buf<T> {
        self.buffer(slot, len, Usage::Work)
    }

    /// A buffer that the host writes while the plan runs.
    pub fn input<T: Pod>(&mut self, slot: &str, len: u64) -> Buf<T> {
        self.buffer(slot, len, Usage::Input)
    }

    /// A buffer that a stage writes and the host reads.
    pub fn output<T: Pod>(&mut self, slot: &str, len: u64) -> Buf<T> {
        self.buffer(slot, len, Usage::Output)
    }

    fn buffer<T: Pod>(&mut self, slot: &str, len: u64, usage: Usage) -> Buf<T> {
        let bytes = len.saturating_mul(size_of::<T>() as u64);
        Buf::new(self.declare(slot, ResourceSpec::Buffer { bytes, usage }, None), len)
    }

    /// A buffer of `len` elements whose content depends on `content` alone and is made only when needed.
    pub fn upload<T: Pod>(
        &mut self,
        slot: &str,
        len: u64,
        content: &impl Hash,
        make: impl FnOnce() -> Vec<T> + 'a,
    ) -> Buf<T> {
        self.external(slot, len, content, move |device, buf| {
            let data = make();
            if data.len() as u64 != len {
                return Err(DeviceError::Invalid(format!("{} elements were made for {len}", data.len())));
            }
            device.write(buf.id, 0, bytemuck::cast_slice(&data))
        })
    }

    /// A buffer of `len` elements that `fill` fills on the device by means of its own: by parts, or with what lies on
    /// the device already. It is called when the content is needed, which depends on `content` alone.
    pub fn external<T: Pod>(
        &mut self,
        slot: &str,
        len: u64,
        content: &impl Hash,
        fill: impl FnOnce(&mut dyn Device, Buf<T>) -> Result<(), DeviceError> + 'a,
    ) -> Buf<T> {
        let buf = self.buffer(slot, len, Usage::Input);
        let fill: Fill<'a> = Box::new(move |device, _| fill(device, buf));
        self.push_upload(buf.id, Key::of("upload", &(len, content)), fill);
        buf
    }

    /// A small buffer; its content is its key.
    pub fn table<T: Pod>(&mut self, slot: &str, data: Vec<T>) -> Buf<T> {
        let bytes: Vec<u8> = bytemuck::cast_slice(&data).to_vec();
        self.upload(slot, data.len() as u64, &bytes, move || data)
    }

    /// A dense field filled slice by slice: `slice` gets the number of the z-slice and where its texels go, layer fastest,
    /// then x and y. Its content depends on `content` alone.
    pub fn upload_field(
        &mut self,
        slot: &str,
        spec: FieldSpec,
        content: &impl Hash,
        mut slice: impl FnMut(u32, &mut [f32]) + 'a,
    ) -> Field {
        let id = self.declare(slot, ResourceSpec::Field(spec), None);
        let bytes = spec.slice_bytes();
        let converts = matches!(spec.format, FieldFormat::Half { .. });
        // What is converted lies there in both formats.
        self.host(if converts { 3 * bytes } else { bytes });
        let fill: Fill<'a> = Box::new(move |device, id| {
            let mut texels = vec![0.0f32; (bytes * if converts { 2 } else { 1 } / 4) as usize];
            let mut encoded = vec![0u8; if converts { bytes as usize } else { 0 }];
            for z in 0..spec.dims[2] {
                slice(z, &mut texels);
                let data: &[u8] = if converts {
                    spec.format.encode(&texels, &mut encoded);
                    &encoded
                } else {
                    bytemuck::cast_slice(&texels)
                };
                device.write(id, u64::from(z) * bytes, data)?;
            }
            Ok(())
        });
        self.push_upload(id, Key::of("field", &(spec, content)), fill);
        Field { id, spec }
    }

    /// The field of scalars `dense`, but in bricks, which are made a few at a time. Its content depends on `content` alone.
    pub fn upload_bricks(&mut self, slot: &str, dense: FieldSpec, content: &impl Hash, bricks: &'a Bricks) -> Field {
        let (layout, format) = (bricks.layout(), dense.format);
        let spec = dense.in_bricks(layout);
        let id = self.declare(slot, ResourceSpec::Field(spec), None);
        let bytes = BrickLayout::brick_bytes(format);
        self.host(u64::from(BRICKS) * (bytes + BrickLayout::brick_bytes(FieldFormat::Scalar)));
        let fill: Fill<'a> = Box::new(move |device, id| {
            let index: &[u8] = bytemuck::cast_slice(bricks.index());
            device.write(id, 0, index)?;
            for first in (0..layout.bricks).step_by(BRICKS as usize) {
                let count = BRICKS.min(layout.bricks - first);
                let mut data = vec![0u8; (u64::from(count) * bytes) as usize];
                data.par_chunks_exact_mut(bytes as usize).zip(first..first + count).for_each(|(out, number)| {
                    let mut texels = [0.0; BrickLayout::TEXELS];
                    bricks.fill(number, &mut texels);
                    format.encode(&texels, out);
                });
                device.write(id, index.len() as u64 + u64::from(first) * bytes, &data)?;
            }
            Ok(())
        });
        self.push_upload(id, Key::of("bricks", &(spec, content)), fill);
        Field { id, spec }
    }

    fn push_upload(&mut self, id: ResourceId, key: Key, fill: Fill<'a>) {
        self.keys.insert(id, key);
        self.nodes.push(Node { work: Work::Upload { id, fill }, writes: vec![(id, key)], always: false });
    }

    /// A state of `len` elements that frames hand on. It becomes zeros when `reset` changes or the size does.
    pub fn state<T: Pod>(&mut self, slot: &str, len: u64, reset: &impl Hash) -> State<T> {
        let bytes = len.saturating_mul(size_of::<T>() as u64);
        let key = Key::of("reset", &(len, reset));
        let swapped = *self.slots.swapped.entry(slot.to_owned()).or_default();
        let spec = ResourceSpec::Buffer { bytes, usage: Usage::Work };
        let [a, b] = [0, 1].map(|half| self.declare(&format!("{slot}#{half}"), spec, Some(key)));
        let (previous, next) = if swapped { (b, a) } else { (a, b) };
        // Its content differs in every frame, and so does whatever is made from it.
        self.keys.insert(previous, Key::of("state", &(slot, self.frame)));
        self.states.push(slot.to_owned());
        State { previous: Buf::new(previous, len), next: Buf::new(next, len) }
    }

    /// A buffer of `len` elements that a stage changes in place from frame to frame, and the host may read. It becomes
    /// zeros when `reset` changes or the size does, and after a fault.
    pub fn kept<T: Pod>(&mut self, slot: &str, len: u64, reset: &impl Hash) -> Buf<T> {
        let bytes = len.saturating_mul(size_of::<T>() as u64);
        let spec = ResourceSpec::Buffer { bytes, usage: Usage::Output };
        Buf::new(self.declare(slot, spec, Some(Key::of("reset", &(len, reset)))), len)
    }

    /// What the last frame that ran handed on under a name; none where it handed on nothing, or something of another type.
    /// The next frame finds `value` there, if this one runs.
    pub fn hand_on<T: Copy + Send + 'static>(&mut self, slot: &str, value: T) -> Option<T> {
        self.handed.insert(slot.to_owned(), Box::new(value));
        self.slots.handed.get(slot).and_then(|handed| handed.downcast_ref().copied())
    }

    /// The key that a stage's outputs would have if it were planned now: made of its name, its parameters, and the keys of
    /// what it reads. Of two stages that differ in what shall not matter, equal keys say that nothing else does.
    pub fn key(&self, stage: &Stage) -> Key {
        let mut reads = Vec::new();
        for Binding { name, id, access, .. } in stage.bindings() {
            if let (Some(id), BindingAccess::Sample(_) | BindingAccess::Read(_)) = (id, access) {
                let key = self.keys.get(&id);
                let key = *key.unwrap_or_else(|| panic!("{} reads {name} before it is written", stage.name()));
                reads.push((name, id.0, key));
            }
        }
        Key::of(stage.name(), &(stage.params(), reads))
    }

    /// A stage. It runs unless its parameters and what it reads are as they were.
    pub fn stage(&mut self, stage: Stage) {
        let base = self.key(&stage);
        let mut writes = Vec::new();
        let mut always = false;
        for binding in stage.bindings() {
            if let (Some(id), BindingAccess::Write(_)) = (binding.id, binding.access) {
                always |= self.declared.get(&id).is_some_and(|d| d.reset.is_some());
                writes.push((binding.name, id));
            }
        }
        let writes: Vec<_> = writes.into_iter().map(|(name, id)| (id, Key::of(name, &base))).collect();
        self.keys.extend(writes.iter().copied());
        self.nodes.push(Node { work: Work::Stage(Box::new(stage)), writes, always });
    }

    /// An equation that a stage is repeated for. What it reads beside `source` must be planned already.
    pub fn solve(&mut self, solve: Solve) {
        self.host(solve.host_bytes());
        let known = |keys: &HashMap<ResourceId, Key>, id: ResourceId| keys.get(&id).copied();
        let parts: Vec<_> = solve
            .parts
            .iter()
            .map(|part| (known(&self.keys, part.light.id), part.source.to_bits(), part.out.to_bits()))
            .collect();
        self.keys.insert(solve.source.id, Key::of("solve", &(parts, format!("{:?}", solve.orders))));
        let base = self.key(&solve.stage);
        let stage = solve.stage.bindings();
        let written = stage.iter().filter_map(|b| matches!(b.access, BindingAccess::Write(_)).then_some(b.id?));
        let writes: Vec<_> =
            written.chain([solve.source.id, solve.out.id]).map(|id| (id, Key::of("solved", &(base, id.0)))).collect();
        self.keys.extend(writes.iter().copied());
        self.nodes.push(Node { work: Work::Solve(Box::new(solve)), writes, always: false });
    }

    /// The field of what stages wrote into `from`.
    pub fn publish<T: Pod>(&mut self, slot: &str, from: Buf<T>, spec: FieldSpec) -> Field {
        assert_eq!(from.bytes(), spec.bytes(), "{slot} differs in size from what it is made of");
        let id = self.declare(slot, ResourceSpec::Field(spec), None);
        let key = Key::of("publish", &(spec, self.keys.get(&from.id)));
        self.keys.insert(id, key);
        self.nodes.push(Node { work: Work::Publish { from: from.id, to: id }, writes: vec![(id, key)], always: false });
        Field { id, spec }
    }
}
