//! Any bytes as an OpenEXR file: an error or a picture of the size it says.
#![no_main]

use std::io::Write;

use airlight_formats::image::read_exr_channels;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut file) = tempfile::NamedTempFile::new() else { return };
    // The four bytes that every file begins with are not for the fuzzer to find.
    if file.write_all(&[0x76, 0x2f, 0x31, 0x01]).and_then(|()| file.write_all(bytes)).is_err() {
        return;
    }
    if let Ok(exr) = read_exr_channels(file.path()) {
        let pixels = exr.width as usize * exr.height as usize;
        assert!(exr.channels.iter().all(|(_, values)| values.len() == pixels));
    }
});
