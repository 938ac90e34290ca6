//! Volumes, images, environments and scenes for airlight.

pub mod error;
pub mod volume;
