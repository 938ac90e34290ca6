#![no_main]

use std::path::Path;

use airlight_formats::mesh::{Format, parse};
use libfuzzer_sys::fuzz_target;

// Files beside the file hold the same bytes.
fuzz_target!(|bytes: &[u8]| {
    if let Ok(file) = parse(Format::Glb, Path::new("fuzz"), bytes, &|_| Ok(bytes.to_vec())) {
        assert!(!file.mesh.triangles().is_empty());
    }
});
