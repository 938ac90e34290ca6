//! Texture units in place of kernels.

use airlight_core::device::{Device, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec};
use airlight_core::exec::Renderer;
use airlight_core::stage::Stage;
use airlight_cpu::CpuDevice;

use super::scenes::{self, Case};
use super::{content, device, relative_l2};
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
    let Some(device) = filtering() else { return };
    // A weight is off by half a step at the most, and values between two texels by that share of their difference.
    let bits = device.info().filter_bits;
    let tolerance = 1e-5 + 0.5f64.powi(bits as i32);
    let mut renderer = Renderer::new(Box::new(device));
    for Case { name, scene } in scenes::all() {
        let found = renderer.render(&scene).unwrap().film;
        let expected = Renderer::new(Box::new(CpuDevice::new())).render(&scene).unwrap().film;
        let flat = |film: &airlight_core::scene::Film| film.beauty.iter().flatten().copied().collect::<Vec<f32>>();
        let error = relative_l2(&flat(&found), &flat(&expected));
        assert!(error < tolerance, "{name}: {error:e}, of {bits} bits");
    }
}

#[test]
fn layers_and_slabs_do_not_run_into_each_other() {
    let spec = FieldSpec { dims: [4, 3, 7], layers: 4, format: FieldFormat::Rgba };
    let values: Vec<f32> = (0..spec.texels() * 4).map(|i| ((i * 29) % 53) as f32).collect();
    let film = |device: &mut dyn Device| {
        let field = Field { id: ResourceId(0), spec };
        device.create(field.id, &ResourceSpec::Field(spec)).unwrap();
        device.write(field.id, 0, bytemuck::cast_slice(&values)).unwrap();
        let march = scenes::layered_march(device, field);
        let out = march.film;
        let stage = Stage::March(march);
        device.dispatch(&stage, 0..stage.axis()).unwrap();
        let vectors: Vec<[f32; 4]> = content(device, out);
        vectors.iter().step_by(2).flatten().copied().collect::<Vec<f32>>()
    };
    let expected = film(&mut CpuDevice::new());
    for side in [4096, 10] {
        let Some(mut device) = filtering() else { return };
        device.info.limits.field_side = side.min(device.info.limits.field_side);
        let error = relative_l2(&film(&mut device), &expected);
        assert!(error < 1e-5 + 0.5f64.powi(device.info.filter_bits as i32), "{side}: {error:e}");
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
