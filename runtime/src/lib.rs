//! Light and render participating media (clouds, smoke, fog, CT volumes) on any device.
//!
//! ```
//! use std::sync::Arc;
//!
//! use airlight::glam::{DVec3, Vec3};
//! use airlight::light::{Environment, Light};
//! use airlight::media::{Homogeneous, Optics};
//! use airlight::scene::{Camera, Estimate, Quality, Scene};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A box of fog, one metre wide, that a grey sky and a sun light.
//! let scene = Scene {
//!     camera: Camera {
//!         origin: DVec3::new(1.9, 1.3, 2.2),
//!         target: DVec3::splat(0.5),
//!         up: DVec3::Y,
//!         fov: 40.0,
//!         width: 64,
//!         height: 48,
//!         samples: 1,
//!     },
//!     medium: Arc::new(Homogeneous::new(1.0, DVec3::ZERO, DVec3::ONE)?),
//!     optics: Optics::grey(3.0, 0.9), // extinction in 1/m, albedo
//!     environment: Some(Environment::uniform(Vec3::splat(0.5))?),
//!     background: None,
//!     surfaces: None,
//!     frame: 0,
//!     lights: vec![Light::directional(DVec3::new(0.3, 1.0, 0.2), Vec3::splat(2.0))?],
//!     estimate: Estimate::default(),
//!     quality: Quality::default(),
//! };
//!
//! // Any device will do; "auto" takes the best one there is.
//! let mut renderer = airlight::Renderer::new(airlight::open("auto")?);
//! let rendered = renderer.render(&scene)?;
//!
//! let [red, green, blue, alpha] = rendered.film.beauty[24 * 64 + 32];
//! assert!(red > 0.0 && green > 0.0 && blue > 0.0);
//! assert!(alpha > 0.5, "the middle of the picture looks through a metre of fog");
//! // The same scene again: nothing has changed, so no stage runs.
//! assert!(renderer.render(&scene)?.report.ran().is_empty());
//! # Ok(())
//! # }
//! ```
//!
//! With the feature `wgpu`, an engine lays a medium over what it drew on its own device, without a copy to the host: see
//! `airlight::engine` and `examples/overlay`.
//!
//! Files are read and written by `airlight-formats`; the program `airlight` puts both together.

#[cfg(feature = "wgpu")]
pub use airlight_wgpu::{engine, wgpu};

pub use airlight_core::*;
pub use exec::Renderer;

mod choice;

pub use choice::{Chosen, NoDevice, choose, choose_among, open, open_among};

use device::{DeviceInfo, Provider, Unavailable};

/// The backends that were compiled in, in the order that `auto` prefers among equals.
pub fn providers() -> Vec<Provider> {
    vec![
        #[cfg(feature = "wgpu")]
        airlight_wgpu::PROVIDER,
        #[cfg(feature = "opencl")]
        airlight_opencl::PROVIDER,
        airlight_cpu::PROVIDER,
    ]
}

/// One backend and its devices, or why it has none.
#[derive(Clone, Debug)]
pub struct Backend {
    /// Name of the backend.
    pub name: &'static str,
    /// Its devices.
    pub devices: Result<Vec<DeviceInfo>, Unavailable>,
}

/// Every backend with its devices.
pub fn devices() -> Vec<Backend> {
    providers().into_iter().map(|p| Backend { name: p.name, devices: (p.enumerate)() }).collect()
}
