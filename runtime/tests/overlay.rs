//! A medium over the frame of another renderer on the same device, held to the processor with the same frame handed
//! over by the host.

#[path = "../examples/overlay/raster.rs"]
mod raster;

use std::sync::Arc;

use airlight::engine::{Depth, FrameTextures, WgpuDevice, export_film, surface};
use airlight::exec::{Hooks, OnDevice, Renderer};
use airlight::glam::{DAffine3, DMat4, DQuat, DVec3, DVec4, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Grid, GridMedium, Optics};
use airlight::scene::{Background, Camera, Estimate, Film, Quality, Scene};
use airlight::{Version, wgpu};
use raster::{NEAR, Raster};

/// Neither is a multiple of a workgroup's side, nor of the alignment of rows.
const SIZE: [u32; 2] = [91, 61];
const SKY: [f64; 3] = [0.25, 0.5, 1.0];

/// A raster renderer, unless there is no adapter; then the test says so, or fails where `AIRLIGHT_REQUIRE` names wgpu.
fn engine() -> Option<Raster> {
    Raster::new(SIZE[0], SIZE[1])
        .inspect_err(|reason| {
            let required = std::env::var("AIRLIGHT_REQUIRE").unwrap_or_default();
            assert!(!required.split(',').any(|id| id.trim() == "wgpu"), "wgpu is required: {reason}");
            eprintln!("SKIPPED, because wgpu has no device: {reason}");
        })
        .ok()
}

/// A slanted block of fog that the balls stand before, in and behind.
fn scene() -> Scene {
    let dims = UVec3::new(13, 7, 11);
    let map = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.8, 0.9, 0.7),
        DQuat::from_rotation_y(0.3),
        DVec3::new(-4.5, 0.3, -3.0),
    );
    let values = (0..dims.element_product()).map(|i| ((i * 37) % 101) as f32 / 101.0).collect();
    Scene {
        camera: Camera {
            origin: DVec3::new(1.5, 4.2, 17.0),
            target: DVec3::new(0.2, 2.6, 0.0),
            up: DVec3::Y,
            fov: 36.0,
            width: SIZE[0],
            height: SIZE[1],
            samples: 3,
        },
        medium: Arc::new(GridMedium::new(Arc::new(Grid::dense(dims, map, values).unwrap()), None).unwrap()),
        optics: Optics::grey(0.6, 0.9),
        environment: None,
        background: None,
        surfaces: None,
        frame: 0,
        lights: vec![Light::directional(DVec3::new(0.5, 0.8, 0.35), Vec3::splat(3.0)).unwrap()],
        estimate: Estimate::single(),
        quality: Quality::default(),
    }
}

const DEPTH: Depth = Depth::Perspective { at_zero: f64::INFINITY, at_one: NEAR };

fn frame(renderer: &mut Renderer, engine: &Raster, scene: &Scene, content: Version, depth: Depth) -> OnDevice {
    let drawn = FrameTextures { color: Some(&engine.color), depth: Some((&engine.depth, depth)) };
    let behind = surface(content, &scene.camera, drawn);
    renderer.render_on_device(scene, Some(behind), &mut Hooks::default()).unwrap()
}

fn relative_l2(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(&a, &b)| f(a.into(), b.into())).sum()
    };
    (sum(&|a, b| (a - b).powi(2)) / sum(&|_, b| b * b)).sqrt()
}

/// The engine's frame as the host sees it: its colours and its z-buffer as distances.
fn background(engine: &Raster, camera: &Camera) -> Background {
    let halves = engine.read(&engine.color, 8).unwrap();
    let color = halves
        .chunks_exact(8)
        .map(|texel| [0, 2, 4].map(|i| half::f16::from_le_bytes([texel[i], texel[i + 1]]).to_f32()));
    let depth = engine.read(&engine.depth, 4).unwrap();
    let [forward, ..] = camera.axes();
    let distance = depth.chunks_exact(4).enumerate().map(|(i, bytes)| {
        let value = f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
        let (x, y) = (i as u32 % SIZE[0], i as u32 / SIZE[0]);
        let d = camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
        (NEAR / value / d.dot(forward)) as f32
    });
    Background::new(SIZE[0], SIZE[1], Some(color.collect()), Some(distance.collect())).unwrap()
}

fn on_the_processor(scene: &Scene) -> Film {
    Renderer::new(airlight::open("cpu").unwrap()).render(scene).unwrap().film
}

#[test]
fn a_frame_that_stays_on_the_device_is_the_frame_handed_over_by_the_host() {
    let Some(engine) = engine() else { return };
    let device = WgpuDevice::from_wgpu(engine.device.clone(), engine.queue.clone()).unwrap();
    let mut renderer = Renderer::new(Box::new(device));
    let mut scene = scene();
    engine.draw(&scene.camera, SKY);
    let content = Version::fresh();
    let left = frame(&mut renderer, &engine, &scene, content, DEPTH);
    let film = renderer.read(&left).unwrap();

    let host = background(&engine, &scene.camera);
    let near = host.depth().unwrap().iter().filter(|d| **d < 14.0).count();
    let far = host.depth().unwrap().iter().filter(|d| !d.is_finite()).count();
    assert!(near > 100 && far > 100, "{near} pixels near, {far} without a surface: the case tries nothing");
    scene.background = Some(host);
    let expected = on_the_processor(&scene);
    // Distances are rounded to f32 on both ways: some 10⁻⁷ of a ray, which may move its samples' number by one where
    // its length is a whole number of steps.
    let error = relative_l2(&film.beauty, &expected.beauty);
    assert!(error < 1e-4, "{error:e}");
    // And it matters: without the z-buffer the balls are not in front of anything.
    let flat = Background::new(SIZE[0], SIZE[1], scene.background.unwrap().color().map(<[_]>::to_vec), None).unwrap();
    scene.background = Some(flat);
    let without = relative_l2(&on_the_processor(&scene).beauty, &expected.beauty);
    assert!(without > 0.05, "{without}");
    scene.background = None;

    // The film as textures is the film.
    let (beauty, transmittance) =
        (engine.target(wgpu::TextureFormat::Rgba32Float), engine.target(wgpu::TextureFormat::Rgba32Float));
    export_film(&mut renderer, &left, &beauty, Some(&transmittance)).unwrap();
    let texels = |texture| bytemuck::pod_collect_to_vec::<u8, [f32; 4]>(&engine.read(texture, 16).unwrap());
    assert_eq!(texels(&beauty), film.beauty);
    let behind: Vec<[f32; 4]> =
        film.transmittance.iter().zip(&film.depth).map(|([r, g, b], depth)| [*r, *g, *b, *depth]).collect();
    assert_eq!(texels(&transmittance), behind);
    let half = engine.target(wgpu::TextureFormat::Rgba16Float);
    export_film(&mut renderer, &left, &half, None).unwrap();
    for (bytes, exact) in engine.read(&half, 8).unwrap().chunks_exact(8).zip(&film.beauty) {
        let found = [0, 2, 4, 6].map(|i| half::f16::from_le_bytes([bytes[i], bytes[i + 1]]).to_f32());
        // An ulp of eleven bits: devices may round toward zero.
        let close = found.iter().zip(exact).all(|(f, e)| (f - e).abs() <= e.abs() * 2f32.powi(-10) + 1e-7);
        assert!(close, "{found:?} {exact:?}");
    }

    // The same content again: nothing has changed, so nothing runs.
    let again = frame(&mut renderer, &engine, &scene, content, DEPTH);
    assert!(again.report.ran().is_empty() && again.report.uploads.is_empty(), "{:?}", again.report);
    // A frame drawn anew: the march runs again, and only it.
    let next = frame(&mut renderer, &engine, &scene, Version::fresh(), DEPTH);
    assert_eq!((next.report.ran(), next.report.uploads), (vec!["march"], vec!["background".to_owned()]));
}

#[test]
fn other_ways_to_say_the_depth_agree() {
    let Some(engine) = engine() else { return };
    let device = WgpuDevice::from_wgpu(engine.device.clone(), engine.queue.clone()).unwrap();
    let mut renderer = Renderer::new(Box::new(device));
    let scene = scene();
    engine.draw(&scene.camera, SKY);
    let film = |renderer: &mut Renderer, drawn: FrameTextures<'_>| {
        let behind = surface(Version::fresh(), &scene.camera, drawn);
        let left = renderer.render_on_device(&scene, Some(behind), &mut Hooks::default()).unwrap();
        renderer.read(&left).unwrap().beauty
    };
    let color = Some(&engine.color);
    let expected = film(&mut renderer, FrameTextures { color, depth: Some((&engine.depth, DEPTH)) });

    // The inverse of the raster's own projection, where a camera looks along -z.
    let tan = (0.5 * scene.camera.fov.to_radians()).tan();
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let projection = DMat4::from_rows(
        DVec4::new((tan * aspect).recip(), 0.0, 0.0, 0.0),
        DVec4::new(0.0, tan.recip(), 0.0, 0.0),
        DVec4::new(0.0, 0.0, 0.0, NEAR),
        DVec4::new(0.0, 0.0, -1.0, 0.0),
    );
    let projected = Depth::Projected { inverse: projection.inverse(), empty: 0.0 };
    let found = film(&mut renderer, FrameTextures { color, depth: Some((&engine.depth, projected)) });
    // Rounding of the two matrices, which are equal but for that.
    assert!(relative_l2(&found, &expected) < 1e-5);

    // Distances that the host computed, in a texture of floats.
    let host = background(&engine, &scene.camera);
    let floats = |values: Vec<f32>| {
        let texture = engine.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: engine.color.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * SIZE[0]), rows_per_image: None };
        let bytes = bytemuck::cast_slice(&values);
        engine.queue.write_texture(texture.as_image_copy(), bytes, layout, texture.size());
        texture
    };
    let distance = floats(host.depth().unwrap().to_vec());
    let found = film(&mut renderer, FrameTextures { color, depth: Some((&distance, Depth::Distance)) });
    assert!(relative_l2(&found, &expected) < 1e-4);
    let [forward, ..] = scene.camera.axes();
    let along = host.depth().unwrap().iter().enumerate().map(|(i, d)| {
        let (x, y) = (i as u32 % SIZE[0], i as u32 / SIZE[0]);
        let ray = scene.camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
        (f64::from(*d) * ray.dot(forward)) as f32
    });
    let axis = floats(along.collect());
    let found = film(&mut renderer, FrameTextures { color, depth: Some((&axis, Depth::Axis)) });
    assert!(relative_l2(&found, &expected) < 1e-4);
}

#[test]
fn textures_that_do_not_fit_are_refused_with_their_part() {
    let Some(engine) = engine() else { return };
    let device = WgpuDevice::from_wgpu(engine.device.clone(), engine.queue.clone()).unwrap();
    let mut renderer = Renderer::new(Box::new(device));
    let scene = scene();
    let mut told = |drawn: FrameTextures<'_>| {
        let behind = surface(Version::fresh(), &scene.camera, drawn);
        renderer.render_on_device(&scene, Some(behind), &mut Hooks::default()).unwrap_err().to_string()
    };
    let other = Raster::new(SIZE[0], SIZE[1] + 1).unwrap();
    let text = told(FrameTextures { color: Some(&other.color), depth: None });
    assert!(text.contains("colour has 91 × 62 texels for a picture of 91 × 61"), "{text}");
    let text = told(FrameTextures { color: Some(&engine.depth), depth: None });
    assert!(text.contains("colour is of the format Depth32Float"), "{text}");
    let out = engine.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: engine.color.size(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let text = told(FrameTextures { color: None, depth: Some((&out, Depth::Distance)) });
    assert!(text.contains("depth was made for") && text.contains("TEXTURE_BINDING"), "{text}");
    // The renderer goes on.
    engine.draw(&scene.camera, SKY);
    let left = frame(&mut renderer, &engine, &scene, Version::fresh(), DEPTH);
    let text = export_film(&mut renderer, &left, &out, None).unwrap_err().to_string();
    assert!(text.contains("beauty was made for") && text.contains("STORAGE_BINDING"), "{text}");
    let text = export_film(&mut renderer, &left, &engine.target(wgpu::TextureFormat::Rgba8Unorm), None);
    assert!(text.unwrap_err().to_string().contains("Rgba16Float and Rgba32Float do"));
}
