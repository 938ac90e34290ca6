//! Surfaces from files: what is right arrives, and what is not is told with its place.

mod common;
mod damage;
mod gltf;
mod obj;
