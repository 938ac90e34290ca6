//! The suite every airlight device must pass.
