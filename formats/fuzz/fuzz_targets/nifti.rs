#![no_main]

use std::path::Path;

use airlight_formats::volume::{Format, parse};
use libfuzzer_sys::fuzz_target;

// A data file beside the header holds the same bytes.
fuzz_target!(|bytes: &[u8]| {
    let _ = parse(Format::Nifti, Path::new("fuzz"), bytes, None, &|_| Ok(bytes.to_vec()));
});
