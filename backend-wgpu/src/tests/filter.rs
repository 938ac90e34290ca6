//! Texture units in place of kernels.

use airlight_conformance::{Subject, cases};
use airlight_core::device::Device;

use super::device;
use crate::{Filter, WgpuDevice};

/// A device whose texture units filter, unless it has none that can.
fn filtering() -> Option<WgpuDevice> {
    let device = device()?;
    device
        .with_filter(Filter::Hardware)
        .inspect_err(|reason| eprintln!("SKIPPED: {reason}"))
        .ok()
        .inspect(|device| assert!((4..=24).contains(&device.info().filter_bits)))
}

#[test]
fn texture_units_are_as_near_as_their_bits_say() {
    if filtering().is_none() {
        return;
    }
    // Whole pictures, and layers in slabs that must not run into each other. Tolerances are those of the bits.
    let tried = ["frames::as_the_processor_renders_them", "frames::cut_at_small_limits", "limits::layers_in_slabs"];
    let open = || filtering().map(|device| Box::new(device) as _).ok_or_else(|| "no texture units".to_owned());
    let subject = Subject::new("texture units", open);
    let cases: Vec<_> = cases().into_iter().filter(|case| tried.contains(&case.name())).collect();
    assert_eq!(cases.len(), tried.len());
    for case in cases {
        let verdict = case.run(&subject).verdict();
        assert!(verdict.is_ok(), "{}: {verdict:?}", case.name());
    }
}

#[test]
fn a_device_without_the_feature_says_so() {
    let Some(device) = device() else { return };
    let exact = device.info().filter_bits;
    assert_eq!(exact, if device.sampler.is_some() { exact.max(Filter::EXACT_BITS) } else { 24 });
    let Ok(adapters) = crate::adapter::adapters() else { return };
    let request = wgpu::DeviceDescriptor { required_limits: WgpuDevice::required_limits(), ..Default::default() };
    let (raw, queue) = pollster::block_on(adapters[0].request_device(&request)).unwrap();
    let plain = WgpuDevice::from_wgpu(raw, queue).unwrap();
    assert_eq!(plain.info().filter_bits, 24);
    let error = plain.with_filter(Filter::Hardware).map(|_| ()).unwrap_err();
    assert!(error.0.contains("FLOAT32_FILTERABLE"), "{error}");
}
