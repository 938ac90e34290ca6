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
pub use crate::gpu::LossNotice;
