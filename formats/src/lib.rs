//! Volumes, images, environments and scenes for airlight.
