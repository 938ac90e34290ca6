//! The stages and the frames on every device that can be opened.

use std::time::Duration;

use airlight::Renderer;
use airlight::device::{Device, DeviceError};
use airlight::stage::Stage;
use airlight::stage::propagate::scheme;
use airlight_benches::{Frame, Lookups, Rig, STAGES, View, density, gaussians, lattice, scene, trilinear_sum};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};

/// The ids of the devices that can be opened. Those that cannot are told of.
fn devices() -> Vec<String> {
    let mut ids = Vec::new();
    for backend in airlight::devices() {
        match backend.devices {
            Ok(devices) => ids.extend(devices.iter().map(|info| info.id())),
            Err(reason) => eprintln!("SKIPPED: {}: {reason}", backend.name),
        }
    }
    ids.retain(|id| match airlight::open(id) {
        Ok(_) => true,
        Err(reason) => {
            eprintln!("SKIPPED: {reason}");
            false
        }
    });
    ids
}

fn open(id: &str) -> Box<dyn Device> {
    airlight::open(id).expect("it was opened before")
}

fn group<'c>(criterion: &'c mut Criterion, name: &str) -> BenchmarkGroup<'c, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    group
}

fn stages(criterion: &mut Criterion) {
    let view = View::new(256, 192);
    for name in STAGES {
        let mut group = group(criterion, &format!("stage/{name}"));
        for id in devices() {
            let mut rig = Rig::new(open(&id)).expect("the density fits");
            let (stage, elements, _) = rig.stage(name, &view).expect("its resources fit");
            group.throughput(Throughput::Elements(elements));
            group.bench_function(id, |b| b.iter(|| rig.run(&stage).expect("the stage runs")));
        }
    }
}

/// Sums of many Gaussians: the lists that the host makes after they moved, and the stage (Giroud and Biri 2011, table 3).
fn injections(criterion: &mut Criterion) {
    for cells in [20, 64, 128] {
        for count in [1, 125, 1000, 8000, 27_000] {
            let mut group = group(criterion, &format!("inject/{count}-in-{cells}"));
            group.throughput(Throughput::Elements(u64::from(cells).pow(3)));
            let medium = gaussians(count, cells);
            let moved = || medium.with(medium.blobs().to_vec()).expect("the same Gaussians");
            group.bench_function("lists", |b| b.iter(|| moved().bins().list.len()));
            for id in devices() {
                let mut rig = Rig::new(open(&id)).expect("the density fits");
                let (stage, _) = rig.inject(&medium).expect("its resources fit");
                group.bench_function(id, |b| b.iter(|| rig.run(&stage).expect("the stage runs")));
            }
        }
    }
}

/// Columns toward lights: by cells along the longest side, lights and scheme (Giroud and Biri 2011, table 2).
fn propagations(criterion: &mut Criterion) {
    for cells in [18, 36, 72] {
        let sides = [cells, cells * 2 / 3, cells * 7 / 9];
        for lights in [1, 4, 8] {
            for (name, scheme) in [("ours", scheme::SHORT_CHARACTERISTICS), ("published", scheme::PUBLISHED)] {
                let mut group = group(criterion, &format!("propagate/{lights}-in-{cells}-{name}"));
                for id in devices() {
                    let mut rig = Rig::new(open(&id)).expect("the density fits");
                    let (stage, elements) = rig.propagate(sides, lights, scheme).expect("its resources fit");
                    group.throughput(Throughput::Elements(elements));
                    group.bench_function(id, |b| b.iter(|| rig.run(&stage).expect("the stage runs")));
                }
            }
        }
    }
}

/// A stage on resources of a rig's, and the number of its elements.
type Made = Result<(Stage, u64), DeviceError>;

/// Transfer matrices of one moment and of four bands: what light makes of the clusters, and what the cells make of it.
fn matrices(criterion: &mut Criterion) {
    let mut bench = |name: String, made: &dyn Fn(&mut Rig) -> Made| {
        let mut group = group(criterion, &name);
        for id in devices() {
            let mut rig = Rig::new(open(&id)).expect("the density fits");
            let (stage, elements) = made(&mut rig).expect("its resources fit");
            group.throughput(Throughput::Elements(elements));
            group.bench_function(id, |b| b.iter(|| rig.run(&stage).expect("the stage runs")));
        }
    };
    for (name, bands, folded) in [("one-moment", 1, false), ("four-bands", 4, false), ("four-bands-folded", 4, true)] {
        bench(format!("matrices/evaluate-{name}"), &|rig| rig.evaluate(bands, folded));
    }
    for channels in [1, 3] {
        for (name, bands, view) in [("one-moment", 1, false), ("four-bands", 4, false), ("four-bands-seen", 4, true)] {
            bench(format!("matrices/reconstruct-{channels}-{name}"), &|rig| rig.reconstruct(bands, channels, view));
        }
    }
}

fn frames(criterion: &mut Criterion) {
    for frame in Frame::ALL {
        let mut group = group(criterion, &format!("frame/{}", frame.name()));
        let camera = scene(frame).camera;
        group.throughput(Throughput::Elements(u64::from(camera.width) * u64::from(camera.height)));
        for id in devices() {
            // Reading the film back is part of a frame, and waits for the device.
            let mut next = frame.start(open(&id)).expect("the first frame is rendered");
            group.bench_function(id, |b| b.iter(|| next().expect("the frame is rendered")));
        }
    }
}

/// What comes before the first frame, each part by itself.
fn prepare(criterion: &mut Criterion) {
    let mut opening = group(criterion, "prepare/open");
    for id in devices() {
        opening.bench_function(&id, |b| b.iter_with_large_drop(|| open(&id)));
    }
    opening.finish();

    let mut uploading = group(criterion, "prepare/upload");
    let values = density();
    uploading.throughput(Throughput::Elements(lattice().voxels()));
    for id in devices() {
        let mut rig = Rig::new(open(&id)).expect("the density fits");
        uploading.bench_function(id, |b| b.iter(|| rig.upload(&values).expect("the density is written")));
    }
    uploading.finish();

    let mut dispatching = group(criterion, "prepare/dispatch");
    for id in devices() {
        let mut rig = Rig::new(open(&id)).expect("the density fits");
        let (stage, _) = rig.relight([1; 3]).expect("its resources fit");
        dispatching.bench_function(id, |b| b.iter(|| rig.run(&stage).expect("the stage runs")));
    }
    dispatching.finish();

    // Allocation, compilation, upload, records and march on a device just opened. `frame/records-dynamic-medium` is
    // the same without allocation and compilation.
    let mut first = group(criterion, "prepare/first-frame");
    let scene = scene(Frame::RecordsStatic);
    for id in devices() {
        let fresh = || Renderer::new(open(&id));
        let render = |mut renderer: Renderer| {
            renderer.render(&scene).expect("the frame is rendered");
            renderer
        };
        first.bench_function(&id, |b| b.iter_batched(fresh, render, criterion::BatchSize::PerIteration));
    }
    first.finish();
}

fn baseline(criterion: &mut Criterion) {
    let mut group = group(criterion, "baseline/trilinear");
    let (view, values) = (View::new(256, 192), density());
    group.throughput(Throughput::Elements(view.samples()));
    group.bench_function("safe-rust", |b| b.iter(|| trilinear_sum(&values, &view)));
    let lookups = Lookups::new(&view);
    group.bench_function("packets", |b| b.iter(|| lookups.sum()));
}

criterion_group!(benches, baseline, stages, injections, propagations, matrices, frames, prepare);
criterion_main!(benches);
