//! Keys of derived resources.

use std::hash::{DefaultHasher, Hash, Hasher};

/// Identity of a resource's content: 128 bits made of everything the content depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key(u64, u64);

impl Key {
    /// The key of anything hashable under a name.
    pub fn of(name: &str, content: &impl Hash) -> Self {
        let half = |seed: u64| {
            let mut hasher = DefaultHasher::new();
            seed.hash(&mut hasher);
            name.hash(&mut hasher);
            content.hash(&mut hasher);
            hasher.finish()
        };
        Self(half(0x61_6972), half(0x6c_6967_6874))
    }
}
