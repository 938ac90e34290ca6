//! Files that airlight reads and writes: images, scenes, surfaces and volumes.

pub mod error;
pub mod image;
pub mod mesh;
pub mod output;
pub mod scene;
pub mod sequence;
pub mod transfer;
pub mod volume;

pub use error::FormatError;
