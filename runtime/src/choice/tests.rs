//! Choices among machines that are made up here, and the real processor.

use std::ops::Range;

use super::*;
use crate::device::{DeviceError, Limits, ResourceId, ResourceSpec, StageTime};
use crate::stage::Stage;

/// A device that does nothing.
struct Idle(DeviceInfo);

impl Device for Idle {
    fn info(&self) -> &DeviceInfo {
        &self.0
    }

    fn create(&mut self, _: ResourceId, _: &ResourceSpec) -> Result<(), DeviceError> {
        Ok(())
    }

    fn destroy(&mut self, _: ResourceId) {}

    fn write(&mut self, _: ResourceId, _: u64, _: &[u8]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn read(&mut self, _: ResourceId, _: u64, _: &mut [u8]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn publish(&mut self, _: ResourceId, _: ResourceId) -> Result<(), DeviceError> {
        Ok(())
    }

    fn dispatch(&mut self, _: &Stage, _: Range<u32>) -> Result<(), DeviceError> {
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        Ok(Vec::new())
    }
}

fn info(backend: &'static str, index: usize, kind: DeviceKind, name: &str) -> DeviceInfo {
    DeviceInfo {
        backend,
        index,
        name: name.into(),
        kind,
        memory_bytes: None,
        limits: Limits { buffer_bytes: 1 << 30, binding_bytes: 1 << 30, field_side: 2048, loop_turns: None },
        features: Vec::new(),
        filter_bits: 24,
        contracts: false,
        unusable: None,
    }
}

/// A backend of the devices listed. Those marked `broken` cannot be opened.
macro_rules! backend {
    ($name:literal: $($kind:ident $device:literal $($broken:ident)?),+) => {
        Provider {
            name: $name,
            enumerate: || {
                let devices = [$((DeviceKind::$kind, $device)),+];
                Ok(devices.iter().enumerate().map(|(i, (kind, name))| info($name, i, *kind, name)).collect())
            },
            open: |index| {
                let (kind, name, broken) = [$((DeviceKind::$kind, $device, backend!(@ $($broken)?))),+][index];
                if broken {
                    return Err(Unavailable(format!("{name} cannot be opened: the driver is too old")));
                }
                Ok(Box::new(Idle(info($name, index, kind, name))))
            },
        }
    };
    (@ broken) => { true };
    (@) => { false };
}

const CPU: Provider = backend!("cpu": Cpu "Eight cores");
const LAVAPIPE: Provider = backend!("wgpu": SoftwareGpu "llvmpipe");
/// As the OpenCL backend reports it.
const POCL: Provider = backend!("opencl": Other "pthread-eight-cores");
const NO_VULKAN: Provider = Provider {
    name: "wgpu",
    enumerate: || Err(Unavailable("no Vulkan driver answers".into())),
    open: |_| Err(Unavailable("was opened".into())),
};
const NO_OPENCL: Provider = Provider {
    name: "opencl",
    enumerate: || Err(Unavailable("libOpenCL.so.1 not found".into())),
    open: |_| Err(Unavailable("was opened".into())),
};

fn chosen(providers: &[Provider], choice: &str) -> (String, Vec<String>) {
    let chosen = choose_among(providers, choice).unwrap_or_else(|error| panic!("{error}"));
    (chosen.device.info().id(), chosen.passed_over)
}

/// `auto` takes `id` and passes over nothing.
#[track_caller]
fn auto_takes(id: &str, providers: &[Provider]) {
    assert_eq!(chosen(providers, "auto"), (id.to_owned(), Vec::new()));
}

#[test]
fn auto_takes_hardware_by_whichever_backend_lists_it() {
    const DISCRETE: Provider = backend!("wgpu": SoftwareGpu "llvmpipe", IntegratedGpu "Iris", DiscreteGpu "GeForce");
    const INTEGRATED: Provider = backend!("wgpu": SoftwareGpu "llvmpipe", IntegratedGpu "Iris");
    const BY_OPENCL: Provider = backend!("opencl": Other "pthread-eight-cores", DiscreteGpu "GeForce");
    auto_takes("wgpu:2", &[DISCRETE, POCL, CPU]);
    auto_takes("wgpu:1", &[INTEGRATED, POCL, CPU]);
    auto_takes("opencl:1", &[LAVAPIPE, BY_OPENCL, CPU]);
    auto_takes("opencl:1", &[NO_VULKAN, BY_OPENCL, CPU]);
    // The better kind comes before the first backend, and among equals the first backend's.
    auto_takes("opencl:1", &[INTEGRATED, BY_OPENCL, CPU]);
    auto_takes("wgpu:2", &[DISCRETE, BY_OPENCL, CPU]);
}

#[test]
fn auto_takes_the_processor_rather_than_an_imitation() {
    auto_takes("cpu:0", &[LAVAPIPE, POCL, CPU]);
    auto_takes("cpu:0", &[LAVAPIPE, NO_OPENCL, CPU]);
    auto_takes("cpu:0", &[NO_VULKAN, POCL, CPU]);
    auto_takes("cpu:0", &[NO_VULKAN, NO_OPENCL, CPU]);
    auto_takes("cpu:0", &[CPU]);
    // Nor where there is nothing else.
    let error = choose_among(&[LAVAPIPE, POCL], "auto").map(|_| ()).unwrap_err();
    assert_eq!(error.reason, "there are wgpu:0 (llvmpipe), opencl:0 (pthread-eight-cores)");
    let error = choose_among(&[NO_VULKAN, NO_OPENCL], "auto").map(|_| ()).unwrap_err();
    assert_eq!(error.reason, "wgpu has none: no Vulkan driver answers; opencl has none: libOpenCL.so.1 not found");
}

#[test]
fn auto_says_which_gpus_cannot_be_opened_and_takes_the_next() {
    const BROKEN: Provider = backend!("wgpu": DiscreteGpu "GeForce" broken, SoftwareGpu "llvmpipe");
    const SECOND: Provider = backend!("opencl": DiscreteGpu "GeForce");
    const BOTH: Provider = backend!("opencl": DiscreteGpu "GeForce" broken, IntegratedGpu "Iris" broken);
    let passed = |id: &str, name: &str| format!("{id} is passed over: {name} cannot be opened: the driver is too old");
    assert_eq!(chosen(&[BROKEN, SECOND, CPU], "auto"), ("opencl:0".into(), vec![passed("wgpu:0", "GeForce")]));
    let all = [("wgpu:0", "GeForce"), ("opencl:0", "GeForce"), ("opencl:1", "Iris")].map(|(id, name)| passed(id, name));
    assert_eq!(chosen(&[BROKEN, BOTH, CPU], "auto"), ("cpu:0".into(), all.to_vec()));
    // Where nothing is left, all of it is in the error.
    let error = choose_among(&[BOTH], "auto").map(|_| ()).unwrap_err();
    assert!(error.reason.starts_with(&passed("opencl:0", "GeForce")), "{error}");
    assert!(error.reason.ends_with("there are opencl:0 (GeForce), opencl:1 (Iris)"), "{error}");
    // Who names a device gets that one or an error.
    for choice in ["wgpu", "wgpu:0", "geforce"] {
        let error = choose_among(&[BROKEN, CPU], choice).map(|_| ()).unwrap_err();
        assert_eq!(error.reason, "GeForce cannot be opened: the driver is too old", "{choice}");
    }
}

#[test]
fn imitations_are_taken_when_they_are_named() {
    let all = [LAVAPIPE, POCL, CPU];
    for (choice, id) in [("wgpu", "wgpu:0"), ("llvm", "wgpu:0"), ("opencl", "opencl:0"), ("PTHREAD", "opencl:0")] {
        assert_eq!(chosen(&all, choice).0, id, "{choice}");
    }
}

#[test]
fn the_name_of_a_backend_is_its_best_device() {
    const MIXED: Provider = backend!("wgpu": SoftwareGpu "llvmpipe", IntegratedGpu "Iris", DiscreteGpu "GeForce");
    assert_eq!(chosen(&[MIXED, CPU], "wgpu").0, "wgpu:2");
    assert_eq!(chosen(&[MIXED, CPU], "wgpu:0").0, "wgpu:0");
}

#[test]
fn the_cpu_answers_to_its_names() {
    for choice in ["cpu", "cpu:0", "CPU"] {
        assert_eq!(open(choice).map(|d| d.info().backend).ok(), Some("cpu"), "{choice}");
    }
}

#[test]
fn auto_takes_no_imitation_on_this_machine() {
    let kind = open("auto").map(|device| device.info().kind);
    assert!(kind.is_ok_and(unasked));
    // What the processor runs in OpenCL's place is none of the kinds that `auto` takes.
    for info in crate::devices().iter().flat_map(|backend| backend.devices.iter().flatten()) {
        let imitation = ["llvmpipe", "pthread", "SwiftShader"].iter().any(|name| info.name.contains(name));
        assert!(!(imitation && unasked(info.kind)), "{info:?}");
    }
}

#[test]
fn a_choice_that_names_its_backend_asks_no_other() {
    let untouched = Provider {
        name: "other",
        enumerate: || panic!("was asked for its devices"),
        open: |_| Err(Unavailable("was opened".into())),
    };
    for choice in ["cpu", "cpu:0"] {
        assert!(open_among(&[untouched, airlight_cpu::PROVIDER], choice).is_ok(), "{choice}");
    }
    let none = Provider { enumerate: || Err(Unavailable("no loader".into())), ..untouched };
    for choice in ["other", "other:0"] {
        let error = open_among(&[none, airlight_cpu::PROVIDER], choice).map(|_| ()).unwrap_err();
        assert_eq!(error.reason, "no loader", "{choice}");
    }
}

#[test]
fn what_is_not_there_is_said_with_what_is() {
    for choice in ["cpu:1", "", "no such device"] {
        let error = open(choice).map(|d| d.info().name.clone()).unwrap_err().to_string();
        assert!(error.contains("cpu:0"), "{error}");
    }
}

#[test]
fn what_is_listed_as_unusable_comes_last_and_its_reason_is_heard() {
    const ONE: Provider = Provider {
        name: "wgpu",
        enumerate: || {
            let unusable = Some("max_storage_buffers_per_shader_stage is 4 and must be at least 7".to_owned());
            let old = DeviceInfo { unusable, ..info("wgpu", 0, DeviceKind::DiscreteGpu, "Old") };
            Ok(vec![old, info("wgpu", 1, DeviceKind::SoftwareGpu, "llvmpipe")])
        },
        open: |index| match index {
            0 => Err(Unavailable("Old cannot be opened: too few storage buffers".into())),
            _ => Ok(Box::new(Idle(info("wgpu", index, DeviceKind::SoftwareGpu, "llvmpipe")))),
        },
    };
    assert_eq!(chosen(&[ONE], "wgpu"), ("wgpu:1".to_owned(), Vec::new()));
    let told = "wgpu:0 is passed over: Old cannot be opened: too few storage buffers".to_owned();
    assert_eq!(chosen(&[ONE, CPU], "auto"), ("cpu:0".to_owned(), vec![told]));
    assert!(choose_among(&[ONE], "old").unwrap_err().reason.contains("too few storage buffers"));
}
