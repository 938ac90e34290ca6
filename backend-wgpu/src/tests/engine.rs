//! On a device of an engine's.

use std::sync::{Arc, Mutex};

use airlight_core::Version;
use airlight_core::device::{Buf, Device, DeviceError, ResourceId, ResourceSpec, Usage};
use airlight_core::exec::{Hooks, OnDevice, Renderer};
use airlight_core::glam::{DVec3, Vec3};
use airlight_core::light::{Environment, Light};
use airlight_core::media::{Homogeneous, Optics};
use airlight_core::scene::{Camera, Estimate, Quality, Scene};
use airlight_cpu::CpuDevice;
use wgpu::{Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages};

use super::{content, empty};
use crate::adapter;
use crate::engine::{Depth, FrameTextures, WgpuDevice, surface};

const FORMATS: [TextureFormat; 2] = [TextureFormat::Rgba16Float, TextureFormat::Rgba32Float];

/// A box of fog in a sky and the light of a lamp.
fn scene() -> Scene {
    let light = Light::point(DVec3::new(0.7, 0.9, 1.1), Vec3::new(0.2, 0.4, 0.3)).unwrap();
    Scene {
        camera: Camera {
            origin: DVec3::new(1.9, 1.3, 2.2),
            target: DVec3::new(0.55, 0.45, 0.7),
            up: DVec3::Y,
            fov: 38.0,
            width: 45,
            height: 31,
            samples: 2,
        },
        medium: Arc::new(Homogeneous::new(1.0, DVec3::new(0.1, 0.0, 0.2), DVec3::new(1.0, 0.8, 1.3)).unwrap()),
        optics: Optics::grey(3.0, 0.9),
        environment: Some(Environment::uniform(Vec3::new(0.5, 1.0, 2.0)).unwrap()),
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![light],
        estimate: Estimate::single(),
        quality: Quality::default(),
    }
}

/// ‖a - b‖ / ‖b‖.
fn relative_l2(a: &[f32], b: &[f32]) -> f64 {
    let square = |v: f64| v * v;
    let difference: f64 = a.iter().zip(b).map(|(&a, &b)| square(f64::from(a) - f64::from(b))).sum();
    (difference / b.iter().map(|&b| square(b.into())).sum::<f64>()).sqrt()
}

/// Devices of an engine's, of the least limits that do.
fn engines<const N: usize>() -> Option<[(wgpu::Device, wgpu::Queue); N]> {
    let adapter = adapter::adapters().ok()?.into_iter().next()?;
    let open = |_| {
        let required_limits = WgpuDevice::required_limits();
        let request = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
        pollster::block_on(adapter.request_device(&request)).unwrap()
    };
    Some([(); N].map(open))
}

#[test]
fn the_required_limits_do_and_less_is_refused_with_the_numbers() {
    let Some([(device, queue)]) = engines() else { return };
    let mut ours = WgpuDevice::from_wgpu(device, queue).unwrap();
    let mut cpu = Renderer::new(Box::new(CpuDevice::new()));
    let scene = scene();
    let expected = cpu.render(&scene).unwrap().film;
    assert_eq!(ours.info().backend, "wgpu");
    ours.info.index = 0;
    let found = Renderer::new(Box::new(ours)).render(&scene).unwrap().film;
    let flat = |film: &airlight_core::scene::Film| film.beauty.iter().flatten().copied().collect::<Vec<f32>>();
    assert!(relative_l2(&flat(&found), &flat(&expected)) < 1e-5);

    let needed = WgpuDevice::required_limits();
    assert_eq!(adapter::shortfall(&needed), None);
    assert_eq!(adapter::shortfall(&wgpu::Limits::default()), None, "an engine's usual device does");
    let less = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..needed };
    let text = adapter::shortfall(&less).unwrap();
    assert_eq!(text, "max_storage_buffers_per_shader_stage is 4 and must be at least 8");
}

#[test]
fn what_an_engine_listens_to_stays_the_engines() {
    let Some([(device, queue), (other, _)]) = engines() else { return };
    let heard = Arc::new(Mutex::new(Vec::new()));
    let listener = Arc::clone(&heard);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| listener.lock().unwrap().push(error.to_string())));
    let lost = Arc::new(Mutex::new(None));
    let mut ours = WgpuDevice::from_wgpu(device.clone(), queue.clone()).unwrap();
    let (listener, notice) = (Arc::clone(&lost), ours.loss_notice());
    device.set_device_lost_callback(move |_, text| {
        notice.tell("the engine lost it");
        *listener.lock().unwrap() = Some(text);
    });

    // A fault of ours is ours: a texture of another device.
    let foreign = other.create_texture(&TextureDescriptor {
        label: None,
        size: Extent3d { width: 3, height: 2, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: FORMATS[1],
        usage: TextureUsages::STORAGE_BINDING,
        view_formats: &[],
    });
    let film: Buf<[f32; 4]> = empty(&mut ours, 0, 12);
    let frame = OnDevice { film, width: 3, height: 2, report: Default::default() };
    assert!(matches!(ours.export_film(&frame, &foreign, None), Err(DeviceError::Backend(_))));
    assert!(heard.lock().unwrap().is_empty(), "{heard:?}");
    // A fault of the engine's is the engine's, also where we are asked next.
    let impossible = wgpu::BufferDescriptor {
        label: None,
        size: 16,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::MAP_WRITE,
        mapped_at_creation: false,
    };
    let _ = device.create_buffer(&impossible);
    assert_eq!(heard.lock().unwrap().len(), 1);
    assert_eq!(content(&mut ours, film), [[0.0; 4]; 12]);
    // A scope of the engine's around our calls hears nothing of them.
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    assert!(ours.export_film(&frame, &foreign, None).is_err());
    assert!(pollster::block_on(scope.pop()).is_none());

    device.destroy();
    let _ = device.poll(wgpu::PollType::Poll);
    assert!(lost.lock().unwrap().is_some(), "the engine hears of the loss");
    let mut out = [0; 16];
    assert_eq!(ours.read(film.id, 0, &mut out), Err(DeviceError::Lost("the engine lost it".into())));
}

#[test]
fn pictures_past_a_binding_are_taken_in_pieces() {
    let Some([(device, queue)]) = engines() else { return };
    let (width, height) = (37u32, 23u32);
    let texture = |format, usage| {
        device.create_texture(&TextureDescriptor {
            label: None,
            size: Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    };
    let mut ours = WgpuDevice::from_wgpu(device.clone(), queue.clone()).unwrap();
    // A few hundred of the 851 pixels at a time.
    ours.info.limits.binding_bytes = 8192;
    let depth = texture(TextureFormat::R32Float, TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST);
    let values: Vec<f32> = (0..width * height).map(|i| if i % 5 == 0 { -1.0 } else { i as f32 }).collect();
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: None };
    queue.write_texture(depth.as_image_copy(), bytemuck::cast_slice(&values), layout, depth.size());
    let surfaces: Buf<[f32; 4]> = empty(&mut ours, 0, values.len());
    let camera = Camera { width, height, ..scene().camera };
    let drawn = FrameTextures { color: None, depth: Some((&depth, Depth::Distance)) };
    ours.import_surface(surfaces, &camera, drawn).unwrap();
    let expected: Vec<_> = values.iter().map(|v| [0.0, 0.0, 0.0, if *v < 0.0 { f32::INFINITY } else { *v }]).collect();
    assert_eq!(content(&mut ours, surfaces), expected);

    let film: Buf<[f32; 4]> = Buf::new(ResourceId(1), 2 * values.len() as u64);
    let spec = ResourceSpec::Buffer { bytes: film.bytes(), usage: Usage::Output };
    ours.create(film.id, &spec).unwrap();
    let vectors: Vec<[f32; 4]> = (0..film.len).map(|i| [i as f32, 0.25, 1e9, f32::INFINITY]).collect();
    ours.write(film.id, 0, bytemuck::cast_slice(&vectors)).unwrap();
    let usage = TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
    let [beauty, behind] = FORMATS.map(|format| texture(format, usage));
    let frame = OnDevice { film, width, height, report: Default::default() };
    ours.export_film(&frame, &beauty, Some(&behind)).unwrap();
    let back = |texture: &Texture, texel: u32| {
        let padded = (width * texel).next_multiple_of(256);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(padded * height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
        queue.submit([encoder.finish()]);
        buffer.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let view = buffer.slice(..).get_mapped_range().unwrap();
        let rows = view.chunks_exact(padded as usize).flat_map(|row| &row[..(width * texel) as usize]);
        rows.copied().collect::<Vec<u8>>()
    };
    let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&back(&behind, 16));
    assert!(texels.iter().zip(vectors.iter().skip(1).step_by(2)).all(|(a, b)| a == b));
    // Half floats: whole numbers to 2048 are exact, what is too large is the largest, and infinity stays.
    let halves: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&back(&beauty, 8));
    assert_eq!(halves[3], [0x4600, 0x3400, 0x7bff, 0x7c00]);
    assert_eq!(halves[width as usize * height as usize - 1][1..], [0x3400, 0x7bff, 0x7c00]);
}

#[test]
fn a_renderer_on_another_device_says_so() {
    let mut renderer = Renderer::new(Box::new(CpuDevice::new()));
    let scene = scene();
    let behind = surface(Version::fresh(), &scene.camera, FrameTextures::default());
    let error = renderer.render_on_device(&scene, Some(behind), &mut Hooks::default()).unwrap_err().to_string();
    assert!(error.contains("cpu:0 is not a device of wgpu"), "{error}");
}
