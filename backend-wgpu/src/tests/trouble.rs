//! Faults: what was asked for wrongly, and what goes wrong by itself.

use airlight_core::device::{Device, DeviceError, DeviceKind, ResourceId, ResourceSpec, Usage};
use airlight_core::stage::Stage;

use super::{device, empty};
use crate::PROVIDER;
use crate::pipeline::compile;
use crate::source::Text;

#[test]
fn a_dispatch_that_wgpu_refuses_has_no_time() {
    let Some(mut device) = device() else { return };
    // Small workgroups, as an invocation takes four cells on software drivers.
    device.units = 16;
    let cells = 65_535 * 64 + 1;
    let stage = super::relight(&mut device, &vec![1.0; cells]);
    let good = Stage::Relight(stage);
    // A row of workgroups longer than the adapter takes: wgpu itself refuses it, after the clock has started.
    let most = std::mem::replace(&mut device.limits.max_compute_workgroups_per_dimension, u32::MAX);
    let error = device.dispatch(&good, 0..cells as u32).unwrap_err();
    assert!(matches!(&error, DeviceError::Backend(text) if text.contains(&most.to_string())), "{error}");
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
fn memory_is_told_where_the_driver_tells_it() {
    let Some(device) = device() else { return };
    let stated = crate::vulkan::of_device(&device.gpu.device);
    let software = device.info().kind == DeviceKind::SoftwareGpu;
    assert_eq!(device.info().memory_bytes, if software { airlight_core::host::memory() } else { stated.memory });
    if device.info().features.iter().any(|feature| feature == "vulkan") {
        // Vulkan has every device state both.
        assert!(stated.memory.is_some_and(|bytes| bytes > 1 << 28), "{stated:?}");
        assert!(stated.weight_bits.is_some_and(|bits| (4..=24).contains(&bits)), "{stated:?}");
    }
    if let (Some(free), Some(all)) = (device.free_memory(), device.info().memory_bytes) {
        assert!(free > 0 && free <= all, "{free} of {all}");
    }
}

#[test]
fn an_index_past_the_last_is_an_answer() {
    if device().is_some() {
        let error = (PROVIDER.open)(99).map(|device| device.info().name.clone()).unwrap_err();
        assert!(error.0.contains("wgpu:99"), "{error}");
    }
}
