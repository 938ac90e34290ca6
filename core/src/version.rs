//! Identity of immutable data, so that work on it is done once.

use std::sync::atomic::{AtomicU64, Ordering};

/// A number that no other piece of data in this process has. Data that carries a version never changes; a changed
/// copy takes a new one. Keys of derived resources are made from versions, so large arrays are never hashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Version(u64);

impl Version {
    /// A version that has not been handed out before.
    pub fn fresh() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }

    /// The number itself.
    pub fn get(self) -> u64 {
        self.0
    }
}
