//! What goes wrong, and that everything else goes on: errors are typed and name device and stage, and a device, its
//! process and the next picture are as good as before.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use airlight::Renderer;
use airlight::device::{
    Buf, Device, DeviceError, DeviceInfo, Fault, Faulty, FieldFormat, FieldSpec, Limits, ResourceId, ResourceSpec,
    StageTime, Usage,
};
use airlight::exec::{ExecError, Hooks, RenderError};
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Gaussian, Gaussians, Phase};
use airlight::scene::{
    AllEstimate, EnvironmentEstimate, Estimate, Film, LightsEstimate, Opacity, Orders, Path, Records,
    ScatteringEstimate, Scene, Solver, SurfaceShadow, Sweeps,
};
use airlight::stage::{Relight, RelightParams, Stage};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use crate::bench::Bench;
use crate::fixtures::{DIMS, Map, classified, cloud, grey, room, sky};
use crate::transfers::made_of_photons;
use crate::{Axis, Case, Record, Subject, check};

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "fault::calls_that_do_not_fit_are_invalid",
            "Calls that do not fit the device's resources are invalid, and harm nothing.",
            invalid,
        ),
        Case::new(
            "fault::failed_dispatches_have_no_time",
            "A dispatch that is refused has no time and does not stand in the way of the next.",
            untimed,
        ),
        Case::new(
            "fault::allocation_beyond_the_device",
            "Memory that no device has is refused with the numbers, and the device goes on.",
            beyond,
        ),
        Case::new(
            "fault::plans_beyond_the_budget",
            "A picture that does not fit the memory is refused with the numbers before anything is allocated, and one \
             that fits is rendered.",
            over_budget,
        ),
        Case::new(
            "fault::cancellation",
            "A picture that is cancelled ends with that error, and the next is that of a fresh device, bit for bit.",
            cancelled,
        )
        .permutes(&moments()),
        Case::new(
            "fault::failing_stages_are_named",
            "A picture whose stage fails ends with an error that names device and stage.",
            failing,
        )
        .permutes(&stages()),
        Case::new(
            "fault::slow_stages_are_named",
            "A stage that takes longer than it is given ends with an error that names device and stage.",
            slow,
        )
        .permutes(&stages()),
        Case::new(
            "fault::impatience",
            "A device that is given no time ends with an error that names device and stage. From then on it is lost, or \
             renders as before; another one is not harmed.",
            impatience,
        ),
        Case::new(
            "fault::long_work_is_given_up",
            "A device does not let its caller wait for long work that it was given no time for; where it gives up, it is \
             lost, and another one is not harmed.",
            given_up,
        ),
        Case::new("fault::two_devices_in_turn", "Two devices in one process render as each alone.", in_turn),
        Case::new(
            "fault::devices_on_several_threads",
            "Devices that are opened and render on several threads at once render as each alone.",
            at_once,
        ),
        Case::new(
            "fault::renderers_move_between_threads",
            "A renderer goes on on another thread, with all that it holds.",
            moved,
        ),
    ]
}

/// A small picture that runs every stage but `path` and those of a transfer, which bring all light by themselves.
fn scene() -> Scene {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::Isotropic));
    scene.environment = Some(sky());
    let records = Records { cells: 5, bands: 2, directions: 48, solver: Solver::March, ..Records::default() };
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    let blob = |x, y, z| Gaussian { center: DVec3::new(x, y, z), a: 4.0, c: 1.5 };
    let blobs = vec![blob(0.1, 0.0, 0.2), blob(-0.2, 0.1, 0.0), blob(0.2, -0.2, 0.3)];
    scene.medium = Arc::new(Gaussians::new(blobs, Map::Plain.lattice(DIMS)).expect("Gaussians"));
    scene.lights = vec![Light::directional(DVec3::new(-0.4, 0.8, 0.3), Vec3::ONE).expect("a light")];
    let surface_shadow = SurfaceShadow::Map(9);
    scene.estimate.lights = Some(LightsEstimate::Opacity(Opacity { cells: 6, surface_shadow, ..Opacity::default() }));
    scene.surfaces = Some(Arc::new(room()));
    let orders = Orders::Count(3);
    scene.estimate.scattering =
        Some(ScatteringEstimate::Sweeps(Sweeps { cells: 5, bands: 1, orders, ..Sweeps::default() }));
    scene.quality.temporal = true;
    scene
}

/// One that runs a stage.
fn running(stage: &str) -> Scene {
    let mut scene = scene();
    if stage == "path" {
        let path = Path { samples: 2, ..Path::default() };
        scene.estimate = Estimate { all: Some(AllEstimate::Path(path)), ..Estimate::none() };
        scene.quality.temporal = false;
    }
    if ["photons", "evaluate", "reconstruct"].contains(&stage) {
        return made_of_photons();
    }
    if stage == "classify" {
        scene.medium = Arc::new(classified(Map::Plain, DIMS));
    }
    scene
}

/// Runs a stage among others.
fn run(renderer: &mut Renderer, stage: &str) -> Result<(), RenderError> {
    renderer.render(&running(stage)).map(|_| ())
}

/// Another one.
fn other() -> Scene {
    let mut scene = cloud(Map::Sheared, DIMS, grey(Phase::HenyeyGreenstein { g: 0.4 }));
    scene.lights = vec![Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::ONE).expect("a light")];
    (scene.camera.width, scene.camera.height) = (31, 17);
    scene
}

/// The film of a device that has seen nothing else.
fn undisturbed(subject: &Subject, scene: &Scene) -> Result<Film, Failed> {
    Ok(subject.fresh()?.render(scene)?.film)
}

fn same(record: &mut Record, name: &str, found: &Film, expected: &Film) {
    record.same(name, found.beauty.as_flattened(), expected.beauty.as_flattened());
}

fn buffer(bytes: u64) -> ResourceSpec {
    ResourceSpec::Buffer { bytes, usage: Usage::Work }
}

fn field(dims: [u32; 3]) -> ResourceSpec {
    ResourceSpec::Field(FieldSpec::dense(dims, 1, FieldFormat::Scalar))
}

fn invalid(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut device = subject.device()?;
    let (buf, volume, none) = (ResourceId(0), ResourceId(1), ResourceId(9));
    device.create(buf, &buffer(40))?;
    device.create(volume, &field([3, 2, 4]))?;
    let mut out = [0u8; 8];
    let calls = [
        ("a second resource of an id", device.create(buf, &buffer(4))),
        ("writing to nothing", device.write(none, 0, &[0; 4])),
        ("writing past the end", device.write(buf, 36, &[0; 8])),
        ("writing far past the end", device.write(buf, u64::MAX - 3, &[0; 8])),
        ("writing half a word", device.write(buf, 2, &[0; 4])),
        ("writing half a slice", device.write(volume, 0, &[0; 12])),
        ("writing a slice past the end", device.write(volume, 96, &[0; 24])),
        ("reading nothing", device.read(none, 0, &mut out)),
        ("reading past the end", device.read(buf, 36, &mut out)),
        ("reading a field", device.read(volume, 0, &mut out)),
        ("publishing what is of another size", device.publish(buf, volume)),
        ("publishing a field", device.publish(volume, volume)),
        ("publishing nothing", device.publish(none, volume)),
    ];
    for (what, result) in calls {
        check!(matches!(result, Err(DeviceError::Invalid(_))), "{what}: {result:?}");
    }
    let empty = device.create(none, &field([0, 1, 1]));
    check!(matches!(empty, Err(DeviceError::Invalid(_) | DeviceError::Limit { .. })), "an empty field: {empty:?}");
    device.write(buf, 32, &[1; 8])?;
    device.read(buf, 32, &mut out)?;
    check!(out == [1; 8], "after refusals the device reads {out:?}");
    Ok(())
}

/// `relight` of so many cells.
fn relight(bench: &mut Bench, cells: usize) -> Result<Relight, Failed> {
    let params =
        RelightParams { cells: cells as u32, coefficients: 1, channels: 1, layers: 1, ..RelightParams::zeroed() };
    Ok(Relight {
        params,
        records: bench.buf(&vec![1.0f32; cells])?,
        emission_records: None,
        light: bench.buf(&[[2.0f32, 4.0, 8.0, 0.0]])?,
        out: bench.room(cells, Usage::Work)?,
    })
}

/// Whether the device still computes.
fn goes_on(record: &mut Record, bench: &mut Bench) -> Result<(), Failed> {
    let stage = relight(bench, 100)?;
    let out = stage.out;
    bench.device.dispatch(&Stage::Relight(stage), 0..100)?;
    record.same("relit", bench.read(out)?.as_flattened(), [[2.0f32, 4.0, 8.0, 0.0]; 100].as_flattened());
    Ok(())
}

fn untimed(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let good = relight(&mut bench, 100)?;
    let gone = Relight { out: Buf::new(ResourceId(99), 100), ..good.clone() };
    // Longer than the resource behind it.
    let long = Relight { records: Buf::new(good.light.id, 1000), ..good.clone() };
    for (what, stage, range) in
        [("no output", gone, 0..3), ("too long an input", long, 0..3), ("past the axis", good.clone(), 0..101)]
    {
        let result = bench.device.dispatch(&Stage::Relight(stage), range);
        check!(matches!(result, Err(DeviceError::Invalid(_))), "{what}: {result:?}");
    }
    bench.device.dispatch(&Stage::Relight(good), 0..100)?;
    let times = bench.device.finish()?;
    check!(times.len() == 1, "{} times for one dispatch", times.len());
    Ok(())
}

fn beyond(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let cube = FieldSpec::dense([1 << 20; 3], 1, FieldFormat::Rgba);
    let layers = FieldSpec::dense([64; 3], u32::MAX, FieldFormat::Rgba);
    for spec in [buffer(1 << 60), buffer(u64::MAX - 3), ResourceSpec::Field(cube), ResourceSpec::Field(layers)] {
        let id = bench.id();
        let error = bench.device.create(id, &spec).err();
        let told = match error {
            Some(DeviceError::Limit { requested, limit, .. }) => requested > limit,
            Some(DeviceError::OutOfMemory { requested, available }) => {
                requested == spec.bytes() && available.is_none_or(|a| a < requested)
            }
            _ => false,
        };
        check!(told, "{spec:?}: {error:?}");
    }
    goes_on(record, &mut bench)
}

/// A device whose resources are counted.
struct Watched {
    inner: Box<dyn Device>,
    held: Arc<Mutex<HashMap<ResourceId, u64>>>,
}

impl Device for Watched {
    fn info(&self) -> &DeviceInfo {
        self.inner.info()
    }

    fn free_memory(&self) -> Option<u64> {
        self.inner.free_memory()
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        self.inner.create(id, spec)?;
        self.held.lock().unwrap_or_else(PoisonError::into_inner).insert(id, spec.bytes());
        Ok(())
    }

    fn destroy(&mut self, id: ResourceId) {
        self.inner.destroy(id);
        self.held.lock().unwrap_or_else(PoisonError::into_inner).remove(&id);
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.inner.write(id, offset, data)
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        self.inner.read(id, offset, out)
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        self.inner.publish(from, to)
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        self.inner.dispatch(stage, range)
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        self.inner.finish()
    }

    fn narrow(&mut self, limits: &Limits) -> bool {
        self.inner.narrow(limits)
    }
}

fn over_budget(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let held = Arc::new(Mutex::new(HashMap::new()));
    let total = || held.lock().unwrap_or_else(PoisonError::into_inner).values().sum::<u64>();
    let mut renderer = Renderer::new(Box::new(Watched { inner: subject.device()?, held: Arc::clone(&held) }));
    const BUDGET: u64 = 10_000;
    renderer.executor().set_budget(BUDGET);
    for _ in 0..2 {
        let error = renderer.render(&scene()).map(|_| ()).err();
        let Some(RenderError::Exec(ExecError::Memory { device, needed, budget, largest })) = &error else {
            return Err(format!("a picture past the budget: {error:?}").into());
        };
        check!(*device == record.info().name && *needed > BUDGET && *budget <= BUDGET, "{error:?}");
        check!(!largest.is_empty(), "what takes the most is not said");
        check!(total() == 0, "{} bytes were allocated all the same", total());
    }
    renderer.executor().set_budget(1 << 30);
    let rendered = renderer.render(&scene())?;
    check!(rendered.report.bytes == total(), "{} bytes are told and {} held", rendered.report.bytes, total());
    same(record, "after refusals", &rendered.film, &undisturbed(subject, &scene())?);
    // What the next picture does not need is freed.
    let rendered = renderer.render(&other())?;
    check!(rendered.report.bytes == total(), "{} bytes are told and {} held", rendered.report.bytes, total());
    drop(renderer);
    Ok(())
}

/// At which report of progress a picture is cancelled.
fn moments() -> Axis<usize> {
    Axis::of("report", [1, 4, 9])
}

fn cancelled(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let expected = undisturbed(subject, &scene())?;
    record.each(&moments(), |record, &moment| {
        let mut renderer = subject.renderer()?;
        // Once the pace of its stages is known, a picture is not waited for: what was dispatched is still under way.
        for (what, warm) in [("the first picture", false), ("a later one", true)] {
            if warm {
                renderer.render(&other())?;
            }
            let (cancel, mut reports) = (AtomicBool::new(false), 0);
            let mut progress = |_| {
                reports += 1;
                cancel.store(reports == moment, Ordering::Relaxed);
            };
            let mut hooks = Hooks { progress: Some(&mut progress), cancel: Some(&cancel) };
            let ended = renderer.render_with(&scene(), &mut hooks).map(|_| ()).err();
            check!(ended == Some(RenderError::Exec(ExecError::Cancelled)), "{what}: {ended:?}");
            same(record, what, &renderer.render(&scene())?.film, &expected);
        }
        Ok(())
    })
}

/// Every stage.
fn stages() -> Axis<&'static str> {
    Axis::new("stage", Stage::NAMES.map(|name| (name, name)))
}

/// The fault of a picture that a device did not render; an error where it is none of a stage of this device.
fn fault(record: &Record, result: Result<(), RenderError>) -> Result<(String, DeviceError), Failed> {
    match result.err() {
        Some(RenderError::Exec(ExecError::Device { device, stage, error })) if device == record.info().name => {
            Ok((stage, error))
        }
        ended => Err(format!("not a fault of {}: {ended:?}", record.info().name).into()),
    }
}

fn failing(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&stages(), |record, &broken| {
        let mut renderer = Renderer::new(Box::new(Faulty::new(subject.device()?, broken, Fault::Fail)));
        for _ in 0..2 {
            let (stage, error) = fault(record, run(&mut renderer, broken))?;
            check!(stage == broken && matches!(error, DeviceError::Backend(_)), "{stage}: {error:?}");
        }
        Ok(())
    })
}

fn slow(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    // Far more than any piece of these stages takes; where other work held up another stage for so long, again.
    const TRIES: usize = 5;
    let (by, patience) = (Duration::from_millis(1200), Duration::from_secs(1));
    record.each(&stages(), |record, &broken| {
        let mut found = None;
        for _ in 0..TRIES {
            let mut renderer = Renderer::new(Box::new(Faulty::new(subject.device()?, broken, Fault::Slow(by))));
            renderer.executor().set_patience(Some(patience));
            let (stage, error) = fault(record, run(&mut renderer, broken))?;
            let held_up = stage != broken && matches!(error, DeviceError::Timeout { .. });
            found = Some((stage, error));
            if !held_up {
                break;
            }
        }
        let expected = (broken.to_owned(), DeviceError::Timeout { stage: broken, patience });
        check!(found.as_ref() == Some(&expected), "{found:?}");
        Ok(())
    })
}

fn impatience(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    // One scene: a medium made anew is another one, and its mean another.
    let scene = scene();
    let expected = undisturbed(subject, &scene)?;
    let mut renderer = subject.renderer()?;
    let patience = Duration::from_nanos(1);
    renderer.executor().set_patience(Some(patience));
    let (stage, error) = fault(record, renderer.render(&scene).map(|_| ()))?;
    check!(Stage::NAMES.contains(&&*stage), "no stage is named {stage}");
    check!(matches!(error, DeviceError::Timeout { patience: given, .. } if given == patience), "{stage}: {error:?}");
    renderer.executor().set_patience(None);
    for _ in 0..2 {
        match renderer.render(&scene) {
            Ok(rendered) => same(record, "given time again", &rendered.film, &expected),
            lost => {
                let (stage, error) = fault(record, lost.map(|_| ()))?;
                check!(matches!(error, DeviceError::Lost(_)), "{stage}: {error:?}");
            }
        }
    }
    same(record, "another device", &undisturbed(subject, &scene)?, &expected);
    drop(renderer);
    same(record, "another device after it", &undisturbed(subject, &scene)?, &expected);
    Ok(())
}

fn given_up(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    const CELLS: u32 = 1 << 22;
    let mut bench = Bench::new(subject)?;
    let stage = relight(&mut bench, CELLS as usize)?;
    let out = stage.out;
    let stage = Stage::Relight(stage);
    // Its kernel is built, and all that was written has arrived.
    bench.device.dispatch(&stage, 0..1)?;
    bench.device.finish()?;
    let patience = Duration::from_micros(1);
    bench.device.set_patience(Some(patience));
    for _ in 0..4 {
        bench.device.dispatch(&stage, 0..CELLS)?;
    }
    let begin = Instant::now();
    let finished = bench.device.finish().map(|times| times.len());
    let waited = begin.elapsed();
    bench.device.set_patience(None);
    let none = bench.device.finish().map(|_| ());
    match finished {
        // A device that works within `dispatch`, or one that was so fast.
        Ok(times) => {
            check!(times == 4 && none.is_ok(), "{times} times for four dispatches, then {none:?}");
            check!(waited < Duration::from_millis(200), "waited for {waited:?}");
        }
        Err(error) => {
            check!(error == DeviceError::Timeout { stage: "relight", patience }, "{error:?}");
            check!(waited < Duration::from_secs(1), "gave up after {waited:?}");
            let read = bench.device.read(out.id, 0, &mut [0; 4]);
            for result in [none, read] {
                check!(matches!(result, Err(DeviceError::Lost(_))), "after giving up: {result:?}");
            }
        }
    }
    goes_on(record, &mut Bench::new(subject)?)?;
    drop(bench);
    goes_on(record, &mut Bench::new(subject)?)
}

fn in_turn(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let scenes = [scene(), other()];
    let expected = [undisturbed(subject, &scenes[0])?, undisturbed(subject, &scenes[1])?];
    let mut renderers = [subject.renderer()?, subject.renderer()?];
    for turn in 0..4usize {
        // Each device has both scenes, at different times.
        let which = [turn % 2, turn.div_ceil(2) % 2];
        for (renderer, which) in renderers.iter_mut().zip(which) {
            same(record, "in turn", &renderer.render(&scenes[which])?.film, &expected[which]);
        }
    }
    Ok(())
}

fn at_once(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let scenes = [scene(), other()];
    let render = |first: usize| -> Result<Vec<Film>, Failed> {
        let mut renderer = subject.renderer()?;
        (0..4).map(|turn| Ok(renderer.render(&scenes[(first + turn) % 2])?.film)).collect()
    };
    let films: Vec<Result<Vec<Film>, Failed>> = thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|first| scope.spawn(move || render(first))).collect();
        let ended =
            |thread: thread::ScopedJoinHandle<'_, _>| thread.join().unwrap_or_else(|_| Err("a thread panicked".into()));
        threads.into_iter().map(ended).collect()
    });
    let expected = [undisturbed(subject, &scenes[0])?, undisturbed(subject, &scenes[1])?];
    for (first, films) in films.into_iter().enumerate() {
        for (turn, film) in films?.iter().enumerate() {
            same(record, "at once", film, &expected[(first + turn) % 2]);
        }
    }
    Ok(())
}

fn moved(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    let mut seen = scene();
    // A mean of several pictures is never that of one.
    seen.quality.temporal = false;
    renderer.render(&seen)?;
    seen.camera.origin += DVec3::new(0.1, 0.2, -0.1);
    let rendered =
        thread::scope(|scope| scope.spawn(|| -> Result<_, Failed> { Ok((renderer.render(&seen)?, renderer)) }).join());
    let (rendered, mut renderer) = rendered.unwrap_or_else(|_| Err("the other thread panicked".into()))?;
    let ran = rendered.report.ran();
    check!(ran == ["trace", "shade", "march"], "on another thread {ran:?} ran again");
    same(record, "on another thread", &rendered.film, &undisturbed(subject, &seen)?);
    let again = renderer.render(&seen)?;
    check!(again.report.ran().is_empty(), "back again {:?} ran", again.report.ran());
    Ok(())
}
