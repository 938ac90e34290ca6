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

use device::{Device, DeviceInfo, DeviceKind, Provider, Unavailable};

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

/// No device answers to a choice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoDevice {
    /// What was asked for.
    pub choice: String,
    /// Why, and what there is.
    pub reason: String,
}

impl std::fmt::Display for NoDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "no device \"{}\": {}", self.choice, self.reason)
    }
}

impl std::error::Error for NoDevice {}

/// Opens a device: `auto`, a backend (`cpu`), an index (`cpu:0`) or part of a device's name.
///
/// `auto` takes a hardware GPU where there is one, else the processor's cores. A software GPU is taken only when its
/// backend or name is given.
///
/// # Errors
/// No device answers to the choice, or it cannot be opened; the text lists what there is.
pub fn open(choice: &str) -> Result<Box<dyn Device>, NoDevice> {
    open_among(&providers(), choice)
}

/// [`open`] among backends of one's own choosing.
///
/// # Errors
/// As [`open`].
pub fn open_among(providers: &[Provider], choice: &str) -> Result<Box<dyn Device>, NoDevice> {
    let fail = |reason: String| NoDevice { choice: choice.to_owned(), reason };
    let wanted = choice.trim().to_lowercase();
    // A choice that names its backend asks no other: opening the processor loads no graphics library.
    let names = |p: &Provider| wanted.strip_prefix(p.name).is_some_and(|rest| rest.is_empty() || rest.starts_with(':'));
    let named = providers.iter().any(names);
    let listed: Vec<(&Provider, Result<Vec<DeviceInfo>, Unavailable>)> =
        providers.iter().filter(|p| !named || names(p)).map(|p| (p, (p.enumerate)())).collect();
    if let (true, Some((_, Err(reason)))) = (named, listed.first()) {
        return Err(fail(reason.to_string()));
    }
    let all = || listed.iter().flat_map(|(p, found)| found.iter().flatten().map(move |info| (*p, info)));
    let usable = || all().filter(|(_, info)| info.unusable.is_none());
    let found = if wanted == "auto" {
        let rank = |kind: DeviceKind| match kind {
            DeviceKind::DiscreteGpu => 0,
            DeviceKind::IntegratedGpu => 1,
            DeviceKind::Cpu => 2,
            DeviceKind::Other => 3,
            DeviceKind::SoftwareGpu => 4,
        };
        usable().filter(|(_, info)| info.kind != DeviceKind::SoftwareGpu).min_by_key(|(_, info)| rank(info.kind))
    } else if listed.iter().any(|(p, _)| wanted == p.name) {
        usable().next().or_else(|| all().next())
    } else {
        all()
            .find(|(_, info)| info.id() == wanted)
            .or_else(|| all().find(|(_, info)| !wanted.is_empty() && info.name.to_lowercase().contains(&wanted)))
    };
    let Some((provider, info)) = found else {
        let there: Vec<_> = all().map(|(_, info)| format!("{} ({})", info.id(), info.name)).collect();
        return Err(fail(format!("there are {}", there.join(", "))));
    };
    (provider.open)(info.index).map_err(|reason| fail(reason.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cpu_answers_to_its_names() {
        for choice in ["cpu", "cpu:0", "CPU"] {
            assert_eq!(open(choice).map(|d| d.info().backend).ok(), Some("cpu"), "{choice}");
        }
    }

    #[test]
    fn auto_takes_no_software_gpu() {
        let kind = open("auto").map(|device| device.info().kind);
        assert!(kind.is_ok_and(|kind| kind != DeviceKind::SoftwareGpu));
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
}
