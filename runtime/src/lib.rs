//! Light and render participating media on any device.
