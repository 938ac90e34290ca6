//! Files that airlight reads and writes: images, scenes and volumes.

pub mod error;
pub mod image;
pub mod output;
pub mod scene;
pub mod sequence;
pub mod volume;

pub use error::FormatError;
