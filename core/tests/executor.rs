//! The executor, on a device that keeps books.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use airlight_core::device::{
    Binding, BindingAccess, Buf, Device, DeviceError, DeviceInfo, DeviceKind, FieldFormat, FieldSpec, Limits,
    ResourceId, ResourceSpec, StageTime,
};
use airlight_core::exec::{ExecError, Executor, Hooks, Plan, Report};
use airlight_core::stage::{Relight, RelightParams, Stage};

/// What happened on the device, and what shall go wrong.
#[derive(Default)]
struct Books {
    created: Vec<u64>,
    destroyed: usize,
    dispatched: Vec<Range<u32>>,
    /// How often the device was waited for, and how often work was only sent on its way.
    waits: usize,
    flushes: usize,
    /// Time that a unit of work takes.
    pace: Duration,
    fail: Option<Fail>,
}

#[derive(Clone, Copy, PartialEq)]
enum Fail {
    Create,
    Write,
    /// After that many dispatches.
    Dispatch(usize),
    Finish,
}

/// Bytes that the bookkeeper takes for itself, once for all stages.
const SCRATCH: u64 = 1000;

/// Its one stage adds one to each value of `light`, which has as many as there are cells.
struct Bookkeeper {
    info: DeviceInfo,
    books: Arc<Mutex<Books>>,
    memory: HashMap<ResourceId, Vec<u8>>,
    times: Vec<StageTime>,
}

impl Bookkeeper {
    fn executor(memory_bytes: Option<u64>) -> (Executor, Arc<Mutex<Books>>) {
        let books = Arc::new(Mutex::new(Books::default()));
        let info = DeviceInfo {
            backend: "mock",
            index: 0,
            name: "bookkeeper".into(),
            kind: DeviceKind::Other,
            memory_bytes,
            limits: Limits { buffer_bytes: 1 << 30, binding_bytes: 1 << 30, field_side: 2048, loop_turns: None },
            features: Vec::new(),
            filter_bits: 24,
            contracts: false,
            unusable: None,
        };
        let device = Self { info, books: Arc::clone(&books), memory: HashMap::new(), times: Vec::new() };
        (Executor::new(Box::new(device)), books)
    }

    fn fails(&self, at: Fail) -> Result<(), DeviceError> {
        if self.books.lock().unwrap().fail == Some(at) {
            Err(DeviceError::Backend("told to fail".into()))
        } else {
            Ok(())
        }
    }
}

impl Device for Bookkeeper {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn scratch(&self, _: &Stage) -> u64 {
        SCRATCH
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        self.fails(Fail::Create)?;
        let earlier = self.memory.insert(id, vec![0; spec.bytes() as usize]);
        assert!(earlier.is_none(), "resource {} is made twice", id.0);
        self.books.lock().unwrap().created.push(spec.bytes());
        Ok(())
    }

    fn destroy(&mut self, id: ResourceId) {
        assert!(self.memory.remove(&id).is_some(), "resource {} does not exist", id.0);
        self.books.lock().unwrap().destroyed += 1;
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.fails(Fail::Write)?;
        self.memory.get_mut(&id).unwrap()[offset as usize..][..data.len()].copy_from_slice(data);
        Ok(())
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        out.copy_from_slice(&self.memory[&id][offset as usize..][..out.len()]);
        Ok(())
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        let bytes = self.memory[&from].clone();
        self.memory.insert(to, bytes);
        Ok(())
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        let done = self.books.lock().unwrap().dispatched.len();
        self.fails(Fail::Dispatch(done))?;
        let id = |write: bool, name: &str| {
            let found = stage
                .bindings()
                .into_iter()
                .find(|b: &Binding| b.name == name && matches!(b.access, BindingAccess::Write(_)) == write);
            found.and_then(|b| b.id).unwrap()
        };
        let bytes = self.memory[&id(false, "light")].chunks_exact(4);
        let from: Vec<f32> = bytes.map(bytemuck::pod_read_unaligned).collect();
        let to = self.memory.get_mut(&id(true, "in_scatter")).unwrap();
        for i in range.start as usize * 4..range.end as usize * 4 {
            to[i * 4..][..4].copy_from_slice(&(from[i] + 1.0).to_ne_bytes());
        }
        let mut books = self.books.lock().unwrap();
        let time = books.pace * (range.end - range.start);
        books.dispatched.push(range.clone());
        self.times.push(StageTime { stage: stage.name(), range, time });
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        let times = std::mem::take(&mut self.times);
        self.books.lock().unwrap().waits += 1;
        self.fails(Fail::Finish)?;
        Ok(times)
    }

    fn flush(&mut self) -> Result<(), DeviceError> {
        self.times.clear();
        self.books.lock().unwrap().flushes += 1;
        Ok(())
    }
}

const CELLS: u64 = 1000;

fn add_one(light: Buf<[f32; 4]>, out: Buf<[f32; 4]>, records: Buf<f32>) -> Stage {
    let params = RelightParams {
        cells: out.len as u32,
        coefficients: 1,
        channels: 1,
        layers: 1,
        emission_coefficients: 0,
        emission_weight: 0.0,
        planar: 0,
        unused: 0,
    };
    Stage::Relight(Relight { params, records, emission_records: None, light, out })
}

/// Uploads `value` everywhere, and adds one to it twice, by two stages in a row.
fn chain<'a>(plan: &mut Plan<'a>, value: f32, tag: f32) -> Result<Buf<[f32; 4]>, ExecError> {
    let light = plan.upload("light", CELLS, &value.to_bits(), move || vec![[value; 4]; CELLS as usize]);
    let records = plan.upload("records", CELLS, &0, || vec![0.0f32; CELLS as usize]);
    let first = plan.work("first", CELLS);
    plan.stage(add_one(light, first, records));
    // The second stage also depends on a table of its own.
    let tagged = plan.table("tag", vec![tag; CELLS as usize]);
    let second = plan.output("second", CELLS);
    plan.stage(add_one(first, second, tagged));
    Ok(second)
}

fn run(executor: &mut Executor, value: f32, tag: f32) -> Result<(Vec<[f32; 4]>, Report), ExecError> {
    let (out, report) = executor.run(&mut Hooks::default(), |plan| chain(plan, value, tag))?;
    Ok((executor.read(out)?, report))
}

fn ran(report: &Report) -> Vec<bool> {
    report.stages.iter().map(|s| s.ran).collect()
}

#[test]
fn what_stands_is_not_run_again() {
    let (mut executor, books) = Bookkeeper::executor(None);
    let (out, report) = run(&mut executor, 3.0, 0.0).unwrap();
    assert!(out.iter().flatten().all(|v| *v == 5.0));
    assert_eq!((ran(&report), report.uploads.len()), (vec![true, true], 3));
    let (out, report) = run(&mut executor, 3.0, 0.0).unwrap();
    assert!(out.iter().flatten().all(|v| *v == 5.0));
    assert_eq!((ran(&report), report.uploads.len()), (vec![false, false], 0));
    // What only the second depends on does not redo the first.
    let (_, report) = run(&mut executor, 3.0, 1.0).unwrap();
    assert_eq!((ran(&report), report.uploads), (vec![false, true], vec!["tag".to_owned()]));
    // What the first depends on redoes both.
    let (out, report) = run(&mut executor, 8.0, 1.0).unwrap();
    assert!(out.iter().flatten().all(|v| *v == 10.0));
    assert_eq!((ran(&report), report.uploads), (vec![true, true], vec!["light".to_owned()]));
    assert_eq!(books.lock().unwrap().created.len(), 5, "no resource is made twice");
}

#[test]
fn resources_that_a_plan_does_not_name_are_freed() {
    let (mut executor, books) = Bookkeeper::executor(None);
    run(&mut executor, 3.0, 0.0).unwrap();
    let small = |plan: &mut Plan<'_>| -> Result<(), ExecError> {
        plan.upload::<[f32; 4]>("light", CELLS, &3.0f32.to_bits(), || panic!("the light stands"));
        Ok(())
    };
    executor.run(&mut Hooks::default(), small).unwrap();
    assert_eq!(books.lock().unwrap().destroyed, 4);
    let (_, report) = run(&mut executor, 3.0, 0.0).unwrap();
    assert_eq!((ran(&report), report.uploads.len()), (vec![true, true], 2), "only the light was kept");
}

#[test]
fn a_resource_of_another_size_is_made_anew() {
    let (mut executor, books) = Bookkeeper::executor(None);
    for (len, created) in [(10u64, 1), (20, 2), (20, 2), (10, 3)] {
        let upload = |plan: &mut Plan<'_>| -> Result<Buf<f32>, ExecError> {
            Ok(plan.upload("data", len, &0, move || vec![1.0f32; len as usize]))
        };
        let (buf, report) = executor.run(&mut Hooks::default(), upload).unwrap();
        assert_eq!(report.bytes, 4 * len);
        assert_eq!(executor.read(buf).unwrap(), vec![1.0; len as usize]);
        assert_eq!(books.lock().unwrap().created.len(), created);
    }
}

#[test]
fn publications_follow_what_they_are_made_of() {
    let (mut executor, _) = Bookkeeper::executor(None);
    let spec = FieldSpec::dense([10, 10, 10], 1, FieldFormat::Rgba);
    for (value, expected) in [(1.0, vec![true, true]), (1.0, vec![false, false]), (2.0, vec![true, true])] {
        let build = |plan: &mut Plan<'_>| -> Result<(), ExecError> {
            let out = chain(plan, value, 0.0)?;
            plan.publish("field", out, spec);
            Ok(())
        };
        assert_eq!(ran(&executor.run(&mut Hooks::default(), build).unwrap().1), expected);
    }
}

/// One frame of a state that counts the frames.
fn count(executor: &mut Executor, reset: u32) -> Result<f32, ExecError> {
    let build = |plan: &mut Plan<'_>| -> Result<Buf<[f32; 4]>, ExecError> {
        let records = plan.upload("records", CELLS, &0, || vec![0.0f32; CELLS as usize]);
        let state = plan.state("count", CELLS, &reset);
        plan.stage(add_one(state.previous, state.next, records));
        Ok(state.next)
    };
    let (out, report) = executor.run(&mut Hooks::default(), build)?;
    assert_eq!(ran(&report), [true], "a state is never skipped");
    let values = executor.read(out)?;
    assert!(values.iter().flatten().all(|v| *v == values[0][0]));
    Ok(values[0][0])
}

#[test]
fn states_go_on_until_they_are_reset() {
    let (mut executor, books) = Bookkeeper::executor(None);
    for expected in [1.0, 2.0, 3.0, 4.0] {
        assert_eq!(count(&mut executor, 0).unwrap(), expected);
    }
    assert_eq!(count(&mut executor, 1).unwrap(), 1.0, "a new reset key makes zeros of it");
    assert_eq!(count(&mut executor, 1).unwrap(), 2.0);
    // A frame that fails does not count, and does not lose the others.
    let done = books.lock().unwrap().dispatched.len();
    for fail in [Fail::Dispatch(done), Fail::Finish] {
        books.lock().unwrap().fail = Some(fail);
        assert!(count(&mut executor, 1).is_err());
        books.lock().unwrap().fail = None;
    }
    assert_eq!(count(&mut executor, 1).unwrap(), 3.0);
}

#[test]
fn long_stages_are_cut_and_covered_once() {
    let (mut executor, books) = Bookkeeper::executor(None);
    books.lock().unwrap().pace = Duration::from_millis(2);
    let (_, report) = run(&mut executor, 3.0, 0.0).unwrap();
    let dispatched = books.lock().unwrap().dispatched.clone();
    // The first piece is waited for to learn the pace; then 25 units make 50 ms.
    assert_eq!(dispatched[0], 0..16);
    assert!(dispatched[1..].iter().all(|r| r.len() <= 25), "{dispatched:?}");
    assert_eq!(dispatched.len(), 1 + (1000 - 16usize).div_ceil(25) + 40);
    let mut next = 0;
    for range in &dispatched {
        assert_eq!(range.start, next % 1000);
        next = range.end;
    }
    assert_eq!(next, 1000);
    assert_eq!(report.stages.iter().map(|s| s.time).collect::<Vec<_>>(), [Duration::from_secs(2); 2]);
    // A short stage is one piece, once its pace is known.
    books.lock().unwrap().pace = Duration::from_micros(1);
    run(&mut executor, 4.0, 0.0).unwrap();
    books.lock().unwrap().dispatched.clear();
    run(&mut executor, 5.0, 0.0).unwrap();
    assert_eq!(books.lock().unwrap().dispatched, [0..1000, 0..1000]);
}

#[test]
fn progress_rises_to_the_end_of_each_stage() {
    let (mut executor, books) = Bookkeeper::executor(None);
    books.lock().unwrap().pace = Duration::from_millis(2);
    let mut heard: Vec<(&str, f32)> = Vec::new();
    let mut listen = |p: airlight_core::exec::Progress| heard.push((p.stage, p.done));
    let mut hooks = Hooks { progress: Some(&mut listen), cancel: None };
    executor.run::<_, ExecError>(&mut hooks, |plan| chain(plan, 3.0, 0.0)).unwrap();
    assert!(heard.iter().all(|(stage, done)| *stage == "relight" && (0.0..=1.0).contains(done)));
    assert_eq!(heard.iter().filter(|h| h.1 == 0.0).count(), 2);
    assert_eq!(heard.iter().filter(|h| h.1 == 1.0).count(), 2);
    let falls = heard.windows(2).filter(|w| w[1].1 < w[0].1).count();
    assert_eq!(falls, 1, "it falls only where the second stage begins");
}

#[test]
fn cancellation_stops_at_the_next_piece_and_leaves_nothing_valid() {
    let (mut executor, books) = Bookkeeper::executor(None);
    books.lock().unwrap().pace = Duration::from_millis(2);
    let cancel = AtomicBool::new(false);
    let mut pieces = 0;
    let mut listen = |_: airlight_core::exec::Progress| {
        pieces += 1;
        cancel.store(pieces == 5, Ordering::Relaxed);
    };
    let mut hooks = Hooks { progress: Some(&mut listen), cancel: Some(&cancel) };
    let stopped = executor.run(&mut hooks, |plan| chain(plan, 3.0, 0.0));
    assert_eq!(stopped.unwrap_err(), ExecError::Cancelled);
    assert_eq!(books.lock().unwrap().dispatched.len(), 5);
    let (out, report) = run(&mut executor, 3.0, 0.0).unwrap();
    assert!(out.iter().flatten().all(|v| *v == 5.0));
    assert_eq!(ran(&report), [true, true]);
}

#[test]
fn pieces_that_take_too_long_are_faults_and_teach_the_pace() {
    let (mut executor, books) = Bookkeeper::executor(None);
    books.lock().unwrap().pace = Duration::from_millis(2);
    // The first piece, 16 units, takes 32 ms; later ones are cut to a quarter of what they are given.
    let patience = Duration::from_millis(31);
    executor.set_patience(Some(patience));
    let error = run(&mut executor, 3.0, 0.0).map(|_| ()).unwrap_err();
    let expected = DeviceError::Timeout { stage: "relight", patience };
    let expected = ExecError::Device { device: "bookkeeper".into(), stage: "relight".into(), error: expected };
    assert_eq!(error, expected);
    assert_eq!(error.to_string(), "bookkeeper: relight: relight took longer than the 31ms that it was given");
    let (out, _) = run(&mut executor, 3.0, 0.0).unwrap();
    assert!(out.iter().flatten().all(|v| *v == 5.0));
    assert!(books.lock().unwrap().dispatched[1..].iter().all(|range| range.len() <= 3));
    // Without a limit the first piece of a new pace is as long as it is.
    executor.set_patience(None);
    books.lock().unwrap().pace = Duration::from_secs(1);
    run(&mut executor, 4.0, 0.0).unwrap();
}

#[test]
fn faults_carry_device_and_stage_and_leave_nothing_valid() {
    for (fail, stage) in [
        (Fail::Create, "allocating light"),
        (Fail::Write, "uploading light"),
        (Fail::Dispatch(0), "relight"),
        (Fail::Dispatch(2), "relight"),
        (Fail::Finish, "relight"),
    ] {
        let (mut executor, books) = Bookkeeper::executor(None);
        books.lock().unwrap().fail = Some(fail);
        let error = run(&mut executor, 3.0, 0.0).map(|_| ()).unwrap_err();
        let expected = ExecError::Device {
            device: "bookkeeper".into(),
            stage: stage.into(),
            error: DeviceError::Backend("told to fail".into()),
        };
        assert_eq!(error, expected);
        assert_eq!(error.to_string(), format!("bookkeeper: {stage}: told to fail"));
        books.lock().unwrap().fail = None;
        let (out, report) = run(&mut executor, 3.0, 0.0).unwrap();
        assert!(out.iter().flatten().all(|v| *v == 5.0));
        assert_eq!(ran(&report), [true, true], "after a fault nothing that was written counts");
    }
}

fn submit(executor: &mut Executor, value: f32) -> Result<(Buf<[f32; 4]>, Report), ExecError> {
    executor.submit(&mut Hooks::default(), |plan| chain(plan, value, 0.0))
}

#[test]
fn what_is_submitted_is_waited_for_until_its_pace_is_known() {
    let (mut executor, books) = Bookkeeper::executor(None);
    submit(&mut executor, 3.0).unwrap();
    let waits = books.lock().unwrap().waits;
    assert!(waits >= 2, "the first piece and the end of the first run are waited for: {waits}");
    assert_eq!(books.lock().unwrap().flushes, 0);
    for (value, expected) in [(3.0, false), (4.0, true), (5.0, true), (5.0, false)] {
        let (out, report) = submit(&mut executor, value).unwrap();
        assert_eq!(ran(&report), [expected; 2]);
        assert!(report.stages.iter().all(|stage| stage.time == Duration::ZERO));
        assert!(executor.read(out).unwrap().iter().flatten().all(|v| *v == value + 2.0));
    }
    let books = books.lock().unwrap();
    assert_eq!((books.waits, books.flushes), (waits, 4));
}

#[test]
fn after_a_late_fault_nothing_counts_that_was_not_waited_for() {
    let (mut executor, books) = Bookkeeper::executor(None);
    run(&mut executor, 3.0, 0.0).unwrap();
    submit(&mut executor, 4.0).unwrap();
    // Nothing is left to do but to wait, and the fault of what was submitted shows.
    books.lock().unwrap().fail = Some(Fail::Finish);
    assert!(run(&mut executor, 4.0, 0.0).is_err());
    books.lock().unwrap().fail = None;
    let (out, report) = run(&mut executor, 4.0, 0.0).unwrap();
    assert!(out.iter().flatten().all(|v| *v == 6.0));
    assert_eq!((ran(&report), report.uploads), (vec![true, true], vec!["light".to_owned()]));
    // What was waited for stands.
    submit(&mut executor, 4.0).unwrap();
    assert!(run(&mut executor, 4.0, 0.0).unwrap().1.ran().is_empty());
}

#[test]
fn what_lies_on_the_device_is_asked_for_when_its_content_changes() {
    let (mut executor, _) = Bookkeeper::executor(None);
    for (content, asked) in [(1, true), (1, false), (2, true)] {
        let build = |plan: &mut Plan<'_>| -> Result<Buf<f32>, ExecError> {
            Ok(plan.external("elsewhere", 3, &content, move |device, buf| {
                device.write(buf.id, 4, bytemuck::cast_slice(&[content as f32]))
            }))
        };
        let (buf, report) = executor.run(&mut Hooks::default(), build).unwrap();
        assert_eq!(report.uploads.len(), usize::from(asked));
        assert_eq!(executor.read(buf).unwrap(), [0.0, content as f32, 0.0]);
    }
}

#[test]
fn a_fault_keeps_what_stood_before() {
    let (mut executor, books) = Bookkeeper::executor(None);
    run(&mut executor, 3.0, 0.0).unwrap();
    let done = books.lock().unwrap().dispatched.len();
    books.lock().unwrap().fail = Some(Fail::Dispatch(done));
    assert!(run(&mut executor, 3.0, 1.0).is_err());
    books.lock().unwrap().fail = None;
    let (_, report) = run(&mut executor, 3.0, 1.0).unwrap();
    assert_eq!(ran(&report), [false, true], "the first stage had not been touched");
}

#[test]
fn too_little_memory_is_refused_with_the_numbers() {
    // Light, first and second take 16 bytes a cell, records and tag 4.
    let needed = CELLS * (3 * 16 + 2 * 4) + SCRATCH;
    let (mut executor, books) = Bookkeeper::executor(Some(50_000));
    let error = run(&mut executor, 3.0, 0.0).map(|_| ()).unwrap_err();
    let largest = "light 15.6 KiB, first 15.6 KiB, second 15.6 KiB";
    let expected = ExecError::Memory { device: "bookkeeper".into(), needed, budget: 45_000, largest: largest.into() };
    assert_eq!(error, expected);
    assert!(books.lock().unwrap().created.is_empty(), "nothing was allocated");
    assert!(error.to_string().contains("55.7 KiB") && error.to_string().contains("43.9 KiB"), "{error}");
    executor.set_budget(needed);
    assert_eq!(run(&mut executor, 3.0, 0.0).unwrap().1.bytes, needed);
}

#[test]
fn a_stage_that_does_not_fit_is_not_dispatched() {
    let (mut executor, books) = Bookkeeper::executor(None);
    let build = |plan: &mut Plan<'_>| -> Result<(), ExecError> {
        let light = plan.table("light", vec![[0.0f32; 4]]);
        let records = plan.table("records", vec![0.0f32; 3]);
        let out = plan.work("out", 4);
        plan.stage(add_one(light, out, records));
        Ok(())
    };
    let error = executor.run(&mut Hooks::default(), build).unwrap_err();
    let ExecError::Invalid { device, stage, what } = error else { panic!("{error}") };
    assert_eq!((device.as_str(), stage.as_str(), what.as_str()), ("bookkeeper", "relight", "3 record values"));
    assert!(books.lock().unwrap().dispatched.is_empty());
}
