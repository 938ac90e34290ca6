//! Runs plans on a device and keeps what they made.

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::error::ExecError;
use super::key::Key;
use super::paths::PathsRun;
use super::plan::{Declared, Node, Plan, Slots, Work};
use super::solve::{Iteration, Solve, Solved};
use super::vectors;
use crate::device::{Buf, Bytes, Device, DeviceError, FieldSpec, ResourceId, ResourceSpec};
use crate::stage::Stage;

/// How far a plan has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Stage that is running.
    pub stage: &'static str,
    /// Share of that stage that is done, 0 to 1.
    pub done: f32,
}

/// What the caller wants to hear and say while a plan runs.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called between pieces of work.
    pub progress: Option<&'a mut dyn FnMut(Progress)>,
    /// Set to stop at the next piece.
    pub cancel: Option<&'a AtomicBool>,
}

/// One stage of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct StageRun {
    /// Name of the stage.
    pub stage: &'static str,
    /// Whether it ran, or its results stood.
    pub ran: bool,
    /// Time on the device.
    pub time: Duration,
}

/// What a plan did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The stages in order.
    pub stages: Vec<StageRun>,
    /// Resources that were written by the host.
    pub uploads: Vec<String>,
    /// Time spent in uploads.
    pub upload_time: Duration,
    /// Bytes that the plan's resources take on the device, and what the device takes for itself to run its stages.
    pub bytes: u64,
    /// How equations were solved; empty where their solutions stood.
    pub solved: Vec<Solved>,
    /// How far paths were traced, where the estimator is `path`.
    pub paths: Option<PathsRun>,
}

impl Report {
    /// The names of the stages that ran, in order.
    pub fn ran(&self) -> Vec<&'static str> {
        self.stages.iter().filter(|s| s.ran).map(|s| s.stage).collect()
    }
}

struct Held {
    spec: ResourceSpec,
    key: Option<Key>,
    reset: Option<Key>,
}

/// Runs plans on one device.
pub struct Executor {
    device: Box<dyn Device>,
    slots: Slots,
    held: HashMap<ResourceId, Held>,
    /// Seconds a unit of a stage's work axis took the last time.
    pace: HashMap<&'static str, f64>,
    budget: Option<u64>,
    /// The most that the device has taken for itself, which it may keep.
    scratch: u64,
    patience: Option<Duration>,
    frame: u64,
    /// What was written since the device was last waited for: a fault may still surface.
    unproven: HashSet<ResourceId>,
}

/// Whether a run waits for the device.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Wait,
    /// Where the pace of every stage is known.
    Leave,
}

/// A dispatch is cut so that its pieces take about this long: well under any GPU's watchdog.
const PIECE: Duration = Duration::from_millis(50);
/// The share of a stage that is run first to learn its pace.
const FIRST_PIECES: u32 = 64;
/// What is longer than this is worth another wait.
const LONG: Duration = Duration::from_millis(100);

impl Executor {
    /// An executor of plans on `device`.
    pub fn new(device: Box<dyn Device>) -> Self {
        let budget = device.info().memory_bytes.map(most_of);
        Self {
            device,
            slots: Slots::default(),
            held: HashMap::new(),
            pace: HashMap::new(),
            budget,
            scratch: 0,
            patience: None,
            frame: 0,
            unproven: HashSet::new(),
        }
    }

    /// The device.
    pub fn device(&self) -> &dyn Device {
        self.device.as_ref()
    }

    /// The device, for what it offers beyond the trait. Resources of plans are the executor's own: what is made or
    /// destroyed beside them must bear other ids.
    pub fn device_mut(&mut self) -> &mut dyn Device {
        self.device.as_mut()
    }

    /// Sets how many bytes a plan's resources may take; by default nine tenths of the device's memory. What the device
    /// has free at the time bounds it further.
    pub fn set_budget(&mut self, bytes: u64) {
        self.budget = Some(bytes);
    }

    /// Sets how long a piece of a stage may take; by default there is no limit. What takes longer fails with
    /// [`DeviceError::Timeout`], and the device is lost where it could not stop the work. A stage is cut into pieces of
    /// about 50 ms, or of a quarter of this where that is less, but the first piece that a device ever runs of it is a
    /// 64th. A device that works while it is called (the processor) is not interrupted within a piece.
    pub fn set_patience(&mut self, patience: Option<Duration>) {
        self.patience = patience;
        self.device.set_patience(patience);
    }

    /// Lets `build` make a plan and runs it. What `build` returns comes back with the report.
    ///
    /// # Errors
    /// What `build` says; too little memory; a device fault; cancellation. A failed plan leaves nothing that a later
    /// one would take for valid.
    pub fn run<'a, R, E: From<ExecError>>(
        &'a mut self,
        hooks: &mut Hooks<'_>,
        build: impl FnOnce(&mut Plan<'a>) -> Result<R, E>,
    ) -> Result<(R, Report), E> {
        self.run_until(End::Wait, hooks, build)
    }

    /// As [`Executor::run`], without waiting for the device: the work is on its way when this returns, no time is known,
    /// and a fault may surface in a later call, which then trusts nothing that was written in between. A run in which a
    /// stage runs for the first time waits all the same, to learn how long it takes.
    ///
    /// # Errors
    /// As [`Executor::run`].
    pub fn submit<'a, R, E: From<ExecError>>(
        &'a mut self,
        hooks: &mut Hooks<'_>,
        build: impl FnOnce(&mut Plan<'a>) -> Result<R, E>,
    ) -> Result<(R, Report), E> {
        self.run_until(End::Leave, hooks, build)
    }

    fn run_until<'a, R, E: From<ExecError>>(
        &'a mut self,
        end: End,
        hooks: &mut Hooks<'_>,
        build: impl FnOnce(&mut Plan<'a>) -> Result<R, E>,
    ) -> Result<(R, Report), E> {
        let Self { device, slots, held, pace, budget, scratch, patience, frame, unproven } = self;
        *frame += 1;
        let mut plan = Plan::new(slots, *frame, device.info().limits, device.field_kinds());
        let result = build(&mut plan)?;
        let (device, report, pending) = (device.as_mut(), Report::default(), Vec::new());
        let mut run = Run { device, held, pace, patience: *patience, report, pending, learns: false };
        run.allocate(&plan, *budget, scratch)?;
        let Plan { slots, nodes, states, handed, .. } = plan;
        let done = run.nodes(nodes, &slots.names, hooks, unproven).and_then(|()| run.end(end));
        match done {
            Ok(waited) if waited => unproven.clear(),
            Ok(_) => {}
            Err(error) => {
                // What was dispatched before the fault still ends, and its times are not the next run's.
                let _ = run.device.finish();
                distrust(run.held, unproven);
                return Err(error.into());
            }
        }
        slots.handed = handed;
        for state in states {
            let swapped = slots.swapped.entry(state).or_default();
            *swapped = !*swapped;
        }
        Ok((result, run.report))
    }

    /// Reads a part of a buffer of the last plan, from element `first` on.
    ///
    /// # Errors
    /// A device fault.
    pub fn read_into<T: bytemuck::Pod>(&mut self, buf: Buf<T>, first: u64, out: &mut [T]) -> Result<(), ExecError> {
        let offset = first.saturating_mul(size_of::<T>() as u64);
        let read = self.device.read(buf.id, offset, bytemuck::cast_slice_mut(out));
        read.map_err(|error| {
            distrust(&mut self.held, &mut self.unproven);
            self.reading(error)
        })
    }

    /// What a buffer holds, where the host sees it in place ([`Device::view`]).
    pub(super) fn view<T: bytemuck::Pod>(&self, buf: Buf<T>) -> Option<&[T]> {
        bytemuck::try_cast_slice(self.device.view(buf.id)?).ok()?.get(..buf.len as usize)
    }

    fn reading(&self, error: DeviceError) -> ExecError {
        ExecError::Device { device: self.device.info().name.clone(), stage: "reading back".into(), error }
    }

    /// Reads a buffer of the last plan.
    ///
    /// # Errors
    /// A device fault.
    pub fn read<T: bytemuck::Pod>(&mut self, buf: Buf<T>) -> Result<Vec<T>, ExecError> {
        let mut out = Vec::new();
        self.fit(&mut out, buf.len)?;
        self.read_into(buf, 0, &mut out)?;
        Ok(out)
    }

    /// Makes a vector on the host as long as what will be read back into it.
    pub(super) fn fit<T: bytemuck::Pod>(&self, out: &mut Vec<T>, len: u64) -> Result<(), ExecError> {
        let requested = len.saturating_mul(size_of::<T>() as u64);
        let more = usize::try_from(len).map(|len| len.saturating_sub(out.len()));
        if !more.is_ok_and(|more| out.try_reserve_exact(more).is_ok()) {
            return Err(self.reading(DeviceError::OutOfMemory { requested, available: None }));
        }
        out.resize(len as usize, T::zeroed());
        Ok(())
    }
}

/// Faults may surface late: what was written and not yet waited for is not taken for valid.
fn distrust(held: &mut HashMap<ResourceId, Held>, unproven: &mut HashSet<ResourceId>) {
    for id in unproven.drain() {
        // A state becomes zeros.
        held.entry(id).and_modify(|h| (h.key, h.reset) = (None, None));
    }
}

/// Memory of which a tenth is left to the system and to the device's own needs.
fn most_of(bytes: u64) -> u64 {
    bytes / 10 * 9
}

struct Run<'r> {
    device: &'r mut dyn Device,
    held: &'r mut HashMap<ResourceId, Held>,
    pace: &'r mut HashMap<&'static str, f64>,
    patience: Option<Duration>,
    report: Report,
    /// Dispatches whose times are not known yet: place in the report, stage, units of its axis.
    pending: Vec<(usize, &'static str, u32)>,
    /// Whether a stage ran whose pace was not known.
    learns: bool,
}

impl Run<'_> {
    fn fault(&self, stage: &str, error: DeviceError) -> ExecError {
        // Of several stages that were waited for, the device knows which it was.
        let stage = if let DeviceError::Timeout { stage, .. } = error { stage } else { stage };
        ExecError::Device { device: self.device.info().name.clone(), stage: stage.to_owned(), error }
    }

    /// Frees what the plan does not name, and creates what it does, after checking that all of it fits.
    fn allocate(&mut self, plan: &Plan<'_>, budget: Option<u64>, kept: &mut u64) -> Result<(), ExecError> {
        let resources = plan.declared.values().map(|d| d.spec.bytes()).fold(0, u64::saturating_add);
        let stages = plan.nodes.iter().filter_map(|node| match &node.work {
            Work::Stage(stage) => Some(&**stage),
            Work::Solve(solve) => Some(&solve.stage),
            Work::Upload { .. } | Work::Publish { .. } => None,
        });
        // What one stage takes, the next one may use.
        let scratch = stages.map(|stage| self.device.scratch(stage)).max().unwrap_or(0);
        let resources = resources.saturating_add(scratch);
        let host = if self.device.info().kind.shares_host_memory() { plan.host } else { 0 };
        let needed = resources.saturating_add(host);
        let held = self.held.values().map(|h| h.spec.bytes()).fold(*kept, u64::saturating_add);
        // A steady frame takes nothing new and need not ask.
        let grows = plan.declared.iter().any(|(id, d)| self.held.get(id).is_none_or(|h| h.spec != d.spec));
        let free = if grows { self.device.free_memory() } else { None };
        let room = free.map(|free| most_of(free).saturating_add(held));
        if let Some(budget) = budget.into_iter().chain(room).min().filter(|b| needed > *b) {
            let mut sizes: Vec<_> = plan.declared.iter().map(|(id, d)| (d.spec.bytes(), *id)).collect();
            sizes.sort_unstable_by_key(|&(bytes, id)| (std::cmp::Reverse(bytes), id));
            let largest: Vec<_> = sizes
                .iter()
                .take(3)
                .map(|&(bytes, id)| {
                    let shape = match plan.declared[&id].spec {
                        ResourceSpec::Field(FieldSpec { dims: [x, y, z], .. }) => format!(" of {x} × {y} × {z}"),
                        ResourceSpec::Buffer { .. } => String::new(),
                    };
                    format!("{}{shape} {}", plan.slots.names[id.0 as usize], Bytes(bytes))
                })
                .collect();
            let device = self.device.info().name.clone();
            return Err(ExecError::Memory { device, needed, budget, largest: largest.join(", ") });
        }
        self.report.bytes = resources;
        *kept = scratch.max(*kept);
        let keeps = |id: &ResourceId, held: &Held| plan.declared.get(id).is_some_and(|d| d.spec == held.spec);
        let dropped: Vec<_> = self.held.iter().filter(|(id, h)| !keeps(id, h)).map(|(id, _)| *id).collect();
        for id in dropped {
            self.device.destroy(id);
            self.held.remove(&id);
        }
        let mut declared: Vec<_> = plan.declared.iter().collect();
        declared.sort_unstable_by_key(|(id, _)| **id);
        for (&id, &Declared { spec, reset }) in declared {
            // A state whose reset key changed is made anew: created resources are zeros.
            if self.held.get(&id).is_some_and(|h| h.reset != reset) {
                self.device.destroy(id);
                self.held.remove(&id);
            }
            if !self.held.contains_key(&id) {
                let name = &plan.slots.names[id.0 as usize];
                self.device.create(id, &spec).map_err(|e| self.fault(&format!("allocating {name}"), e))?;
                self.held.insert(id, Held { spec, key: None, reset });
            }
        }
        Ok(())
    }

    /// Runs the nodes whose keys do not stand; `written` collects what they write.
    fn nodes(
        &mut self,
        nodes: Vec<Node<'_>>,
        names: &[String],
        hooks: &mut Hooks<'_>,
        written: &mut HashSet<ResourceId>,
    ) -> Result<(), ExecError> {
        for node in nodes {
            let stands = |(id, key): &(ResourceId, Key)| self.held.get(id).is_some_and(|held| held.key == Some(*key));
            if !node.always && node.writes.iter().all(stands) {
                let stage = match &node.work {
                    Work::Stage(stage) => Some(stage.as_ref()),
                    Work::Solve(solve) => Some(&solve.stage),
                    Work::Upload { .. } | Work::Publish { .. } => None,
                };
                if let Some(stage) = stage {
                    self.report.stages.push(StageRun { stage: stage.name(), ran: false, time: Duration::ZERO });
                }
                continue;
            }
            written.extend(node.writes.iter().map(|(id, _)| *id));
            self.work(node.work, names, hooks)?;
            for (id, key) in node.writes {
                self.held.entry(id).and_modify(|held| held.key = Some(key));
            }
        }
        Ok(())
    }

    fn work(&mut self, work: Work<'_>, names: &[String], hooks: &mut Hooks<'_>) -> Result<(), ExecError> {
        match work {
            Work::Upload { id, fill } => {
                let name = &names[id.0 as usize];
                let begin = Instant::now();
                fill(self.device, id).map_err(|e| self.fault(&format!("uploading {name}"), e))?;
                self.report.upload_time += begin.elapsed();
                self.report.uploads.push(name.clone());
            }
            Work::Publish { from, to } => {
                let name = &names[to.0 as usize];
                self.device.publish(from, to).map_err(|e| self.fault(&format!("publishing {name}"), e))?;
            }
            Work::Stage(stage) => {
                let passes = self.passes(*stage)?;
                self.report.stages.push(StageRun { stage: passes[0].name(), ran: true, time: Duration::ZERO });
                self.dispatch(&passes, hooks)?;
            }
            Work::Solve(solve) => self.solve(*solve, hooks)?,
        }
        Ok(())
    }

    /// A stage in passes that keep to the device's limits.
    fn passes(&self, stage: Stage) -> Result<Vec<Stage>, ExecError> {
        let invalid =
            |what| ExecError::Invalid { device: self.device.info().name.clone(), stage: stage.name().to_owned(), what };
        stage.validate().map_err(invalid)?;
        match self.device.info().limits.loop_turns {
            Some(turns) => stage.passes(turns.into()).map_err(invalid),
            None => Ok(vec![stage]),
        }
    }

    fn dispatch(&mut self, passes: &[Stage], hooks: &mut Hooks<'_>) -> Result<(), ExecError> {
        for (number, pass) in passes.iter().enumerate() {
            self.pass(pass, [number, passes.len()], hooks)?;
        }
        Ok(())
    }

    /// Repeats a stage until its equation is solved.
    fn solve(&mut self, solve: Solve, hooks: &mut Hooks<'_>) -> Result<(), ExecError> {
        let Solve { stage, parts, source, scattered, out, orders } = solve;
        let name = stage.name();
        let passes = self.passes(stage)?;
        self.report.stages.push(StageRun { stage: name, ran: true, time: Duration::ZERO });
        let (mut unscattered, mut share) = (vec![0.0; source.len as usize], vec![0.0; source.len as usize]);
        let mut values = vec![0.0f32; source.len as usize];
        for part in parts {
            self.fetch(name, part.light, &mut values)?;
            vectors::add(&mut unscattered, part.source, &values);
            vectors::add(&mut share, part.out, &values);
        }
        let mut iteration = Iteration::new(orders, unscattered);
        let solved: Solved = loop {
            self.put(name, source, iteration.source())?;
            self.dispatch(&passes, hooks)?;
            self.fetch(name, scattered, &mut values)?;
            if let Some(solved) = iteration.take(&values) {
                break solved;
            }
        };
        vectors::add(&mut values, 1.0, &share);
        self.report.solved.push(solved);
        self.put(name, out, &values)
    }

    fn fetch(&mut self, stage: &str, from: Buf<f32>, out: &mut [f32]) -> Result<(), ExecError> {
        self.device.read(from.id, 0, bytemuck::cast_slice_mut(out)).map_err(|e| self.fault(stage, e))
    }

    fn put(&mut self, stage: &str, to: Buf<f32>, values: &[f32]) -> Result<(), ExecError> {
        self.device.write(to.id, 0, bytemuck::cast_slice(values)).map_err(|e| self.fault(stage, e))
    }

    /// Dispatches one of so many passes of a stage, in pieces where it is long. The first time, a small piece is waited
    /// for to learn the pace; and where the rest seems long, another one, for drivers may have compiled the kernel in the first.
    fn pass(&mut self, stage: &Stage, [number, of]: [usize; 2], hooks: &mut Hooks<'_>) -> Result<(), ExecError> {
        let (name, axis) = (stage.name(), stage.axis());
        let mut say = |done: u32| -> Result<(), ExecError> {
            if hooks.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
                return Err(ExecError::Cancelled);
            }
            if let Some(progress) = &mut hooks.progress {
                let done = (number as f32 + done as f32 / axis.max(1) as f32) / of as f32;
                progress(Progress { stage: name, done });
            }
            Ok(())
        };
        let mut at = 0;
        self.learns |= !self.pace.contains_key(name);
        if !self.pace.contains_key(name) && axis > 1 {
            for _ in 0..2 {
                say(at)?;
                let end = at.saturating_add(axis.div_ceil(FIRST_PIECES)).min(axis);
                self.piece(stage, at..end)?;
                self.finish()?;
                at = end;
                if f64::from(axis - at) * self.pace(name) <= LONG.as_secs_f64() {
                    break;
                }
            }
        }
        let pace = self.pace(name);
        let piece = self.patience.map_or(PIECE, |patience| PIECE.min(patience / 4));
        let per_piece = (piece.as_secs_f64() / pace.max(1e-12)).clamp(1.0, f64::from(axis.max(1))) as u32;
        while at < axis {
            say(at)?;
            let end = at.saturating_add(per_piece).min(axis);
            self.piece(stage, at..end)?;
            at = end;
        }
        say(axis)
    }

    /// Seconds that a unit of a stage takes, as far as that is known.
    fn pace(&self, stage: &str) -> f64 {
        self.pace.get(stage).copied().unwrap_or(0.0)
    }

    fn piece(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), ExecError> {
        let (units, begin) = (range.end - range.start, Instant::now());
        self.device.dispatch(stage, range).map_err(|e| self.fault(stage.name(), e))?;
        self.pending.push((self.report.stages.len() - 1, stage.name(), units));
        // The device may have built a kernel meanwhile; only its times tell how long the stage took.
        if self.patience.is_some_and(|patience| begin.elapsed() > patience) { self.finish() } else { Ok(()) }
    }

    /// Waits, or leaves the work on its way; whether it waited.
    fn end(&mut self, end: End) -> Result<bool, ExecError> {
        if end == End::Wait || self.learns {
            return self.finish().map(|()| true);
        }
        let last = self.pending.last().map_or("waiting", |(_, stage, _)| stage);
        self.pending.clear();
        self.device.flush().map_err(|e| self.fault(last, e))?;
        Ok(false)
    }

    /// Waits, and books the time of every dispatch since the last wait.
    fn finish(&mut self) -> Result<(), ExecError> {
        let last = self.pending.last().map_or("waiting", |(_, stage, _)| stage);
        let times = self.device.finish().map_err(|e| self.fault(last, e))?;
        if times.len() != self.pending.len() {
            let what = format!("{} times for {} dispatches", times.len(), self.pending.len());
            return Err(self.fault(last, DeviceError::Invalid(what)));
        }
        let mut spent: HashMap<&'static str, (f64, f64)> = HashMap::new();
        for (time, (place, stage, units)) in times.iter().zip(self.pending.drain(..)) {
            self.report.stages[place].time += time.time;
            let (seconds, done) = spent.entry(stage).or_default();
            *seconds += time.time.as_secs_f64();
            *done += f64::from(units);
        }
        self.pace.extend(spent.into_iter().map(|(stage, (seconds, units))| (stage, seconds / units.max(1.0))));
        if let Some(patience) = self.patience
            && let Some(time) = times.iter().find(|time| time.time > patience)
        {
            return Err(self.fault(time.stage, DeviceError::Timeout { stage: time.stage, patience }));
        }
        Ok(())
    }
}
