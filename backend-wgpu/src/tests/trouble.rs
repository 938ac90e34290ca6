//! Faults: what was asked for wrongly, and what goes wrong by itself.

use airlight_core::device::{Device, DeviceError, ResourceId, ResourceSpec, Usage};
use airlight_core::stage::Stage;

use super::{device, empty, scalar};
use crate::PROVIDER;
use crate::pipeline::compile;
use crate::source::Text;

#[test]
fn calls_that_do_not_fit_the_resources_are_invalid() {
    let Some(mut device) = device() else { return };
    let buf = empty::<f32>(&mut device, 0, 10);
    let field = ResourceId(1);
    device.create(field, &ResourceSpec::Field(scalar([3, 2, 4]))).unwrap();
    let none = ResourceId(9);
    let mut out = [0u8; 8];
    let buffer = ResourceSpec::Buffer { bytes: 4, usage: Usage::Work };
    let calls = [
        ("a second of its id", device.create(buf.id, &buffer)),
        ("an empty field", device.create(none, &ResourceSpec::Field(scalar([0, 1, 1])))),
        ("no such resource", device.write(none, 0, &[0; 4])),
        ("past the end", device.write(buf.id, 36, &[0; 8])),
        ("far past the end", device.write(buf.id, u64::MAX - 3, &[0; 8])),
        ("half a word", device.write(buf.id, 2, &[0; 4])),
        ("half a slice", device.write(field, 0, &[0; 12])),
        ("a slice past the end", device.write(field, 96, &[0; 24])),
        ("reading past the end", device.read(buf.id, 36, &mut out)),
        ("reading a field", device.read(field, 0, &mut out)),
        ("publishing what is of another size", device.publish(buf.id, field)),
        ("publishing a field", device.publish(field, field)),
        ("publishing nothing", device.publish(none, field)),
    ];
    for (what, result) in calls {
        assert!(matches!(result, Err(DeviceError::Invalid(_))), "{what}: {result:?}");
    }
    // None of it harmed the device.
    device.write(buf.id, 32, &[1; 8]).unwrap();
    device.read(buf.id, 32, &mut out).unwrap();
    assert_eq!(out, [1; 8]);
}

#[test]
fn a_dispatch_that_fails_has_no_time() {
    let Some(mut device) = device() else { return };
    let cells = 65_535 * 64 + 1;
    let stage = super::relight(&mut device, &vec![1.0; cells]);
    let good = Stage::Relight(stage.clone());
    let mut gone = stage;
    gone.out.id = ResourceId(7);
    assert!(matches!(device.dispatch(&Stage::Relight(gone), 0..3), Err(DeviceError::Invalid(_))));
    assert!(matches!(device.dispatch(&good, 0..u32::MAX), Err(DeviceError::Invalid(_))));
    // A row of workgroups longer than the adapter takes: wgpu itself refuses it, after the clock has started.
    let most = std::mem::replace(&mut device.limits.max_compute_workgroups_per_dimension, u32::MAX);
    let error = device.dispatch(&good, 0..cells as u32).unwrap_err();
    assert!(matches!(&error, DeviceError::Backend(text) if text.contains("65536")), "{error}");
    device.limits.max_compute_workgroups_per_dimension = most;
    device.dispatch(&good, 0..cells as u32).unwrap();
    assert_eq!(device.finish().unwrap().len(), 1);
}

#[test]
fn kernels_that_do_not_compile_name_their_file_and_line() {
    let Some(device) = device() else { return };
    let mut text = Text::default();
    text.push("kernels/first.wgsl", "const A: u32 = 1u;\n\n");
    text.push("kernels/second.wgsl", "\nfn broken() -> u32 {\n    return A + nothing;\n}\n");
    let error = compile(&device.gpu, "broken", &text).unwrap_err().to_string();
    assert!(error.starts_with("kernels/second.wgsl:3: "), "{error}");
    // The device goes on.
    device.gpu.check().unwrap();
}

#[test]
fn a_lost_device_stays_lost_and_says_so() {
    let Some(mut device) = device() else { return };
    let buf = empty::<f32>(&mut device, 0, 4);
    device.gpu.device.destroy();
    let mut out = [0u8; 16];
    // The loss may be noticed by the first call or by waiting for it.
    let _ = device.read(buf.id, 0, &mut out);
    for _ in 0..2 {
        let spec = ResourceSpec::Buffer { bytes: 4, usage: Usage::Work };
        let results = [
            device.create(ResourceId(1), &spec),
            device.write(buf.id, 0, &[0; 4]),
            device.read(buf.id, 0, &mut out),
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

/// Set in the process that must find no driver.
const ALONE: &str = "AIRLIGHT_TEST_WITHOUT_VULKAN";

#[test]
fn a_machine_without_drivers_is_an_answer() {
    if std::env::var_os(ALONE).is_some() {
        let reason = (PROVIDER.enumerate)().map(|found| found.len()).unwrap_err();
        assert!(reason.0.contains("Vulkan"), "{reason}");
        assert!((PROVIDER.open)(0).map(|device| device.info().name.clone()).is_err());
        return;
    }
    let name = "tests::trouble::a_machine_without_drivers_is_an_answer";
    let child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name])
        .env(ALONE, "1")
        // Both names of the loader's list of drivers.
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env("VK_ICD_FILENAMES", "/nonexistent.json")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success() && said.contains("1 passed"), "{said}");
}

#[test]
fn an_index_past_the_last_is_an_answer() {
    if device().is_some() {
        let error = (PROVIDER.open)(99).map(|device| device.info().name.clone()).unwrap_err();
        assert!(error.0.contains("wgpu:99"), "{error}");
    }
}
