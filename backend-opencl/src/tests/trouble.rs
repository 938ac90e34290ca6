//! Faults: what was asked for wrongly, and what goes wrong by itself.

use std::time::{Duration, Instant};

use airlight_core::device::{Device, DeviceError, ResourceId, ResourceSpec, Usage};
use airlight_core::stage::Stage;
use ocl::core::Status;

use super::{content, device, empty};
use crate::PROVIDER;
use crate::cl::Fault;

#[test]
fn kernels_that_do_not_compile_name_their_file_and_line() {
    let Some(mut device) = device() else { return };
    let text = "#line 1 \"kernels/first.cl\"\n#define A 1u\n\n#line 1 \"kernels/second.cl\"\n\n\
                uint broken(void) {\n    return A + nothing;\n}\n__kernel void k(void) {}\n";
    let error = device.cl.build("k", text, device.options, 1).unwrap_err().to_string();
    assert!(error.starts_with("kernels/second.cl:3:") && error.contains("nothing"), "{error}");
    let error = device.cl.build("none", "__kernel void k(void) {}", device.options, 1).unwrap_err().to_string();
    assert!(error.contains("CL_INVALID_KERNEL_NAME"), "{error}");
    let error = device.cl.build("k", "__kernel void k(void) {}", "-no-such-option", 1).unwrap_err().to_string();
    assert!(error.contains("no-such-option"), "{error}");
    // The device goes on.
    device.finish().unwrap();
}

#[test]
fn a_lost_device_stays_lost_and_says_so() {
    let Some(mut device) = device() else { return };
    let buf = empty::<f32>(&mut device, 0, 4);
    let stage = Stage::Relight(super::relight_into(&mut device, 1, &[1.0; 4]));
    device.dispatch(&stage, 0..4).unwrap();
    // No device can be lost on purpose, so this one is told that it was.
    let gone = Fault::of(Status::CL_DEVICE_NOT_AVAILABLE, "clFinish");
    assert!(matches!(device.cl.fail(gone, 0), DeviceError::Lost(_)));
    let mut out = [0u8; 16];
    for _ in 0..2 {
        let spec = ResourceSpec::Buffer { bytes: 4, usage: Usage::Work };
        let results = [
            device.create(ResourceId(9), &spec),
            device.write(buf.id, 0, &[0; 4]),
            device.read(buf.id, 0, &mut out),
            device.dispatch(&stage, 0..4),
            device.publish(buf.id, ResourceId(1)),
            device.finish().map(|_| ()),
        ];
        for result in results {
            assert!(matches!(result, Err(DeviceError::Lost(_))), "{result:?}");
        }
    }
    device.destroy(buf.id);
    // Another one is not harmed.
    if let Some(mut other) = super::device() {
        let buf = empty::<f32>(&mut other, 0, 4);
        other.read(buf.id, 0, &mut out).unwrap();
    }
}

/// Says in which process a test is: one that finds the loader and drivers, or one that must find none.
const ALONE: &str = "AIRLIGHT_TEST_WITHOUT_OPENCL";

/// Runs the test of that name in a process of its own, with another environment.
fn alone(name: &str, environment: &[(&str, &str)]) {
    let child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", &format!("tests::trouble::{name}")])
        .env(ALONE, "1")
        .envs(environment.iter().copied())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success() && said.contains("1 passed"), "{said}");
}

/// Why there is no device. `reason` must be in it, and asking must take no time to speak of: what ocl would wait for
/// is ten seconds.
fn unavailable(reason: &str) {
    let begin = Instant::now();
    let enumerated = (PROVIDER.enumerate)().map(|found| found.len()).unwrap_err();
    let opened = (PROVIDER.open)(0).map(|device| device.info().name.clone()).unwrap_err();
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    assert!(enumerated.0.contains(reason) && opened.0.contains(reason), "{enumerated} {opened}");
}

#[test]
fn a_machine_without_the_library_is_an_answer() {
    if std::env::var_os(ALONE).is_some() {
        // The program itself has not loaded one.
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
        assert!(!maps.contains("libOpenCL"), "{maps}");
        return unavailable("/nonexistent/libOpenCL.so.1 not found");
    }
    let library = ("AIRLIGHT_OPENCL_LIBRARY", "/nonexistent/libOpenCL.so.1");
    alone("a_machine_without_the_library_is_an_answer", &[library]);
}

#[test]
fn a_library_that_is_none_is_an_answer() {
    let file = std::env::current_exe().unwrap().with_file_name("not-a-library.txt");
    if std::env::var_os(ALONE).is_some() {
        return unavailable("cannot be loaded");
    }
    std::fs::write(&file, "plain words").unwrap();
    alone("a_library_that_is_none_is_an_answer", &[("AIRLIGHT_OPENCL_LIBRARY", file.to_str().unwrap())]);
}

#[test]
fn a_machine_without_drivers_is_an_answer() {
    if std::env::var_os(ALONE).is_some() {
        // A machine may have no loader either.
        return unavailable("pocl-opencl-icd");
    }
    alone("a_machine_without_drivers_is_an_answer", &[("OCL_ICD_VENDORS", "/nonexistent")]);
}

#[test]
fn devices_open_and_run_from_several_threads_at_once() {
    const NAME: &str = "devices_open_and_run_from_several_threads_at_once";
    if std::env::var_os(ALONE).is_none() {
        // In a process of its own, so that these threads are the first to use the driver.
        if device().is_some() {
            alone(NAME, &[]);
        }
        return;
    }
    std::thread::scope(|scope| {
        for thread in 0..4u32 {
            scope.spawn(move || {
                assert!(!(PROVIDER.enumerate)().unwrap().is_empty());
                let mut device = device().unwrap();
                let records: Vec<f32> = (0..1000).map(|i| (i * (thread + 1)) as f32).collect();
                let stage = super::relight(&mut device, &records);
                for start in (0..1000).step_by(125) {
                    device.dispatch(&Stage::Relight(stage.clone()), start..start + 125).unwrap();
                }
                let got = content(&mut device, stage.out);
                let wrong = got.iter().zip(&records).position(|(got, r)| *got != [2.0 * r, 4.0 * r, 8.0 * r, 0.0]);
                assert_eq!((wrong, device.finish().unwrap().len()), (None, 8));
            });
        }
    });
}

#[test]
fn an_index_past_the_last_is_an_answer() {
    if device().is_some() {
        let error = (PROVIDER.open)(99).map(|device| device.info().name.clone()).unwrap_err();
        assert!(error.0.contains("opencl:99"), "{error}");
    }
}
