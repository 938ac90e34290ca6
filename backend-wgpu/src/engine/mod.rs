//! For engines: rendering on a device of theirs, behind and in front of what they drew.
//!
//! An engine makes a [`WgpuDevice`] of its own `wgpu` device and queue ([`WgpuDevice::from_wgpu`]) and renders with
//! `Renderer::render_on_device`. What it drew goes in as textures of colour and depth ([`surface`]): the medium in front
//! is laid over them. The film comes out as textures ([`export_film`]). Nothing is read back, and after the first frames
//! nothing is waited for; all work is submitted to the engine's queue, in order with its own.
//!
//! ```no_run
//! use airlight_core::{Version, exec::{Hooks, RenderError, Renderer}, scene::Scene};
//! use airlight_wgpu::engine::{Depth, FrameTextures, export_film, surface};
//! use airlight_wgpu::{WgpuDevice, wgpu};
//!
//! # struct Engine { device: wgpu::Device, queue: wgpu::Queue, color: wgpu::Texture, depth: wgpu::Texture, out: wgpu::Texture }
//! # fn draw(_: &Engine) {}
//! # fn frames(engine: Engine, scene: Scene) -> Result<(), Box<dyn std::error::Error>> {
//! let device = WgpuDevice::from_wgpu(engine.device.clone(), engine.queue.clone())?;
//! let mut renderer = Renderer::new(Box::new(device));
//! loop {
//!     draw(&engine); // submits render passes that end in `color` and `depth`
//!     let drawn = FrameTextures {
//!         color: Some(&engine.color),
//!         // A z-buffer that is 0 at 0.1 m and 1 at 100 m from the eye.
//!         depth: Some((&engine.depth, Depth::Perspective { at_zero: 0.1, at_one: 100.0 })),
//!     };
//!     let behind = surface(Version::fresh(), &scene.camera, drawn);
//!     let frame = renderer.render_on_device(&scene, Some(behind), &mut Hooks::default())?;
//!     export_film(&mut renderer, &frame, &engine.out, None)?;
//!     // Passes of the engine's that read `out` follow.
//! }
//! # }
//! ```

mod text;
mod textures;

use std::collections::HashMap;
use std::sync::Arc;

use airlight_core::Version;
use airlight_core::device::{Binding, Buf, Device, DeviceError, Unavailable};
use airlight_core::exec::{OnDevice, Renderer, Surface};
use airlight_core::glam::{DMat4, DVec4};
use airlight_core::scene::Camera;
use wgpu::{Texture, TextureFormat, TextureView};

pub use crate::gpu::LossNotice;
pub use crate::{Filter, WgpuDevice};

use crate::adapter;
use crate::cut::Cut;
use crate::gpu::Gpu;
use crate::launch::{self, Launches, Shot};
use crate::pipeline::Pipeline;
use crate::source::Fetched;
use crate::store::Bound;
use crate::vulkan;
use text::depth_kind;
pub(crate) use text::{ExportParams, ImportParams};
use textures::{Kind, Role};

/// What the texels of a depth texture say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Depth {
    /// Metres from the eye along the view ray through the middle of the pixel. What is negative, infinite or not a
    /// number is no surface, and so is [`Background::FAR`](airlight_core::scene::Background::FAR) and beyond.
    Distance,
    /// Metres from the eye along the camera's axis, else as [`Depth::Distance`].
    Axis,
    /// The z-buffer of a perspective projection of the scene's camera: 1/z is linear in the value. What lies at the
    /// farther of both ends is no surface.
    Perspective {
        /// Metres along the camera's axis where the value is 0; may be infinite.
        at_zero: f64,
        /// Metres along the camera's axis where the value is 1; may be infinite. Less than `at_zero` for a reversed
        /// z-buffer.
        at_one: f64,
    },
    /// The z-buffer of any projection.
    Projected {
        /// Takes (x, y, value, 1), x and y from -1 to 1, to the right and upward, to the place in the camera's own space
        /// times its last coordinate; the eye is the origin there.
        inverse: DMat4,
        /// The value where there is no surface: what the buffer is cleared to.
        empty: f32,
    },
}

/// What an engine drew: textures of as many pixels as the scene's picture, row 0 at the top, of one sample, with
/// `TextureUsages::TEXTURE_BINDING`, of the same device. Of textures with several layers or levels the first is read.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameTextures<'a> {
    /// Radiance in linear RGB, W m⁻² sr⁻¹, in any format of floats or normalised numbers; sRGB formats are decoded as
    /// they are read. It is seen behind the medium in every pixel, in place of the environment. Without it surfaces are
    /// black, and the environment is seen between them if it is visible.
    pub color: Option<&'a Texture>,
    /// Where surfaces end the view rays, and what the texture says; a format of depth, or of floats whose first channel
    /// counts. Without it nothing stands in front of anything.
    pub depth: Option<(&'a Texture, Depth)>,
}

/// What an engine drew, as a surface for `Renderer::render_on_device`. `camera` is the scene's, and `content` the
/// identity of what the textures hold: a fresh one for every frame that was drawn anew.
pub fn surface<'a>(content: Version, camera: &'a Camera, drawn: FrameTextures<'a>) -> Surface<'a> {
    Surface::new(content, move |device, to| gpu(device)?.import_surface(to, camera, drawn))
}

/// Writes a film that is on the device into textures of as many pixels, in the formats `Rgba16Float` or `Rgba32Float`,
/// with `TextureUsages::STORAGE_BINDING`: premultiplied RGB and alpha = 1 - mean transmittance into `beauty`, and
/// transmittance RGB and the mean distance of what the medium stops into `transmittance`. Behind the medium is what
/// [`surface`] gave, so that `beauty` is the whole picture; alpha is the medium's alone.
///
/// # Errors
/// A renderer on another kind of device; textures that do not fit; a device fault.
pub fn export_film(
    renderer: &mut Renderer,
    frame: &OnDevice,
    beauty: &Texture,
    transmittance: Option<&Texture>,
) -> Result<(), DeviceError> {
    gpu(renderer.device_mut())?.export_film(frame, beauty, transmittance)
}

fn gpu(device: &mut dyn Device) -> Result<&mut WgpuDevice, DeviceError> {
    let name = device.info().id();
    device.downcast_mut().ok_or_else(|| DeviceError::Invalid(format!("{name} is not a device of wgpu")))
}

/// Kernels for engines, by what their text depends on.
#[derive(Debug, Default)]
pub(crate) struct Engine {
    import: HashMap<[Option<Kind>; 2], Arc<Pipeline>>,
    export: HashMap<[Option<TextureFormat>; 2], Arc<Pipeline>>,
}

/// Textures by the number of their binding.
type Views = Vec<(u32, TextureView)>;

impl WgpuDevice {
    /// A device of ours on one of an engine's. Its limits must be at least [`WgpuDevice::required_limits`], which
    /// wgpu's defaults are; no feature is required. With `Features::TIMESTAMP_QUERY` stages are timed on the device.
    ///
    /// The device's handlers of uncaptured errors and of its loss stay the engine's: errors of ours are caught in
    /// scopes, and the loss is told by [`WgpuDevice::loss_notice`]. Where we wait (the first frames, uploads that are some
    /// 32 MiB ahead of the device, reading back), we wait for all work of the queue, and callbacks of the engine's that are due are called.
    ///
    /// # Errors
    /// Limits that do not do, with the numbers.
    pub fn from_wgpu(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, Unavailable> {
        let (info, limits, features) = (device.adapter_info(), device.limits(), device.features());
        if let Some(reason) = adapter::shortfall(&limits) {
            return Err(Unavailable(format!("{}: {reason}", info.name)));
        }
        let info = adapter::describe(0, info, &limits, features, vulkan::of_device(&device));
        let name = info.name.clone();
        Self::new(info, Gpu::shared(device, queue)).map_err(|error| Unavailable(format!("{name}: {error}")))
    }

    /// The least limits that an engine must ask of its device; what else it needs goes on top, and larger storage
    /// buffers and textures let larger scenes through.
    pub fn required_limits() -> wgpu::Limits {
        adapter::required_limits()
    }

    /// What tells this device that the engine's device was lost: to be called where the engine hears of it.
    pub fn loss_notice(&self) -> LossNotice {
        self.gpu.loss_notice()
    }

    /// Writes what an engine drew into a buffer of a vector a pixel, as the stage `march` reads it.
    ///
    /// # Errors
    /// Textures that do not fit the picture; a device fault.
    pub fn import_surface(
        &mut self,
        to: Buf<[f32; 4]>,
        camera: &Camera,
        drawn: FrameTextures<'_>,
    ) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        let size = [camera.width, camera.height];
        let pixels = pixels(size, to.len, 1)?;
        let sampled = [(drawn.color, Role::Color), (drawn.depth.map(|(texture, _)| texture), Role::Depth)];
        let (mut kinds, mut views) = ([None, None], Views::new());
        for (kind, (texture, role)) in kinds.iter_mut().zip(sampled) {
            if let Some(texture) = texture {
                let found = textures::sampled(texture, role, size)?;
                views.push((views.len() as u32, self.gpu.guarded(0, || textures::view(texture))?));
                *kind = Some(found);
            }
        }
        let pipeline = match self.engine.import.get(&kinds) {
            Some(pipeline) => Arc::clone(pipeline),
            None => {
                let text = text::import(kinds);
                let bindings: Vec<_> = kinds.iter().flatten().map(|kind| kind.binding()).collect();
                let built = Arc::new(Pipeline::of_engine(&self.gpu, "import_surface", &text, false, &bindings)?);
                Arc::clone(self.engine.import.entry(kinds).or_insert(built))
            }
        };
        let params = import_params(camera, drawn.depth.map(|(_, depth)| depth));
        let binding = Binding::write("surface", Some(to)).in_parts::<[f32; 4]>(1);
        self.run_engine(&pipeline, bytemuck::bytes_of(&params), pixels, binding, &views)
    }

    /// As [`export_film`], of a film that lies on this device.
    ///
    /// # Errors
    /// As [`export_film`].
    pub fn export_film(
        &mut self,
        frame: &OnDevice,
        beauty: &Texture,
        transmittance: Option<&Texture>,
    ) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        let size = [frame.width, frame.height];
        let pixels = pixels(size, frame.film.len, 2)?;
        let (mut formats, mut views) = ([None, None], Views::new());
        let targets = [(Some(beauty), "beauty"), (transmittance, "transmittance")];
        for (format, (texture, role)) in formats.iter_mut().zip(targets) {
            if let Some(texture) = texture {
                *format = Some(textures::stored(texture, role, size)?);
                views.push((views.len() as u32, self.gpu.guarded(0, || textures::view(texture))?));
            }
        }
        let pipeline = match self.engine.export.get(&formats) {
            Some(pipeline) => Arc::clone(pipeline),
            None => {
                let text = text::export(formats);
                let bindings: Vec<_> = formats.iter().flatten().map(|format| textures::storage(*format)).collect();
                let built = Arc::new(Pipeline::of_engine(&self.gpu, "export_film", &text, true, &bindings)?);
                Arc::clone(self.engine.export.entry(formats).or_insert(built))
            }
        };
        let params = ExportParams { width: size[0], ..bytemuck::Zeroable::zeroed() };
        let binding = Binding::read("film", Some(frame.film)).in_parts::<[f32; 4]>(2);
        self.run_engine(&pipeline, bytemuck::bytes_of(&params), pixels, binding, &views)
    }

    /// Runs a kernel over the pixels, in pieces whose part of the buffer fits a binding.
    fn run_engine(
        &mut self,
        pipeline: &Pipeline,
        params: &[u8],
        pixels: u32,
        binding: Binding,
        views: &Views,
    ) -> Result<(), DeviceError> {
        let bindings = [binding];
        let cut = Cut::new(pixels, 1, &bindings, self.binding_limits())?;
        let shots = cut.pieces(0..pixels).map(|piece| {
            let bound = self.store.bound(&bindings, Fetched::default(), |binding| piece.window(binding))?;
            let bound = Bound { textures: views.iter().map(|(number, view)| (*number, view)).collect(), ..bound };
            Ok(Shot { range: piece.range, first: piece.groups.start, past: piece.groups.end, bound })
        });
        let shots = shots.collect::<Result<Vec<_>, DeviceError>>()?;
        self.store.wrote(&bindings);
        let (units, copies) = (text::UNITS, Vec::new());
        let written = Vec::new();
        let launches = Launches { pipeline, params, units, aligned: 1, sequential: None, copies, written, shots };
        let what = "an engine's frame";
        let recorded = launch::record(&mut self.gpu, &mut self.groups, &self.limits, what, &[launches], None);
        // Its textures may be gone with its next frame.
        views.iter().for_each(|(_, view)| self.groups.forget_texture(view));
        recorded?;
        self.gpu.send()
    }
}

/// The pixels of a picture, where a buffer of `len` vectors has `vectors` for each.
fn pixels([width, height]: [u32; 2], len: u64, vectors: u64) -> Result<u32, DeviceError> {
    let pixels = u64::from(width) * u64::from(height);
    match u32::try_from(pixels) {
        Ok(count) if count > 0 && len >= vectors * pixels => Ok(count),
        _ => Err(DeviceError::Invalid(format!("{len} vectors for a picture of {width} × {height}"))),
    }
}

fn import_params(camera: &Camera, depth: Option<Depth>) -> ImportParams {
    let mut params: ImportParams = bytemuck::Zeroable::zeroed();
    [params.forward, params.right, params.up] = camera.axes().map(|axis| axis.as_vec3().extend(0.0).to_array());
    (params.width, params.height) = (camera.width, camera.height);
    let projected = match depth {
        None | Some(Depth::Distance) => {
            params.kind = depth_kind::DISTANCE;
            None
        }
        Some(Depth::Axis) => {
            params.kind = depth_kind::AXIS;
            None
        }
        Some(Depth::Perspective { at_zero, at_one }) => {
            Some((perspective(camera, at_zero, at_one), f32::from(at_one > at_zero)))
        }
        Some(Depth::Projected { inverse, empty }) => Some((inverse, empty)),
    };
    if let Some((inverse, empty)) = projected {
        (params.kind, params.empty) = (depth_kind::PROJECTED, empty);
        let column = |c: DVec4| c.as_vec4().to_array();
        [params.inverse_x, params.inverse_y] = [column(inverse.x_axis), column(inverse.y_axis)];
        [params.inverse_z, params.inverse_w] = [column(inverse.z_axis), column(inverse.w_axis)];
    }
    params
}

/// The inverse of a perspective projection: the place is z · (a t W/H, b t, -1), and 1/z is linear in the value.
fn perspective(camera: &Camera, at_zero: f64, at_one: f64) -> DMat4 {
    let [_, right, up] = camera.axes().map(|axis| axis.length());
    let (zero, one) = (at_zero.recip(), at_one.recip());
    DMat4::from_cols(
        DVec4::new(right, 0.0, 0.0, 0.0),
        DVec4::new(0.0, up, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 0.0, one - zero),
        DVec4::new(0.0, 0.0, -1.0, zero),
    )
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::kernels;
