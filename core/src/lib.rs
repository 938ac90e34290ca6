//! Everything in airlight that is the same on every device.
//!
//! Data flows one way: a [`scene::Scene`] names media, lights and a camera; an estimator plans the stages that
//! prepare its in-scattered radiance; the executor runs what changed on a device; the march turns it into a film.
//! This crate knows no device, no file format and no terminal.
//!
//! Units are SI: metres, radiance in W m⁻² sr⁻¹, irradiance in W m⁻², intensity in W sr⁻¹. The world is
//! right-handed with +Y up. Directions ω point toward the source of light.

pub mod basis;
pub mod blue_noise;
pub mod device;
pub mod estimator;
pub mod exec;
pub mod host;
pub mod light;
pub mod media;
pub mod metric;
mod once;
pub mod random;
pub mod reference;
pub mod scene;
pub mod stage;
pub mod transfer;
pub mod version;

pub use glam;
pub use version::Version;
