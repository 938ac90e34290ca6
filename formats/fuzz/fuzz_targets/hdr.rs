//! Any bytes as a Radiance file: an error or a picture of the size it says.
#![no_main]

use std::io::Write;

use airlight_formats::image::read_image;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut file) = tempfile::NamedTempFile::new() else { return };
    if file.write_all(b"#?").and_then(|()| file.write_all(bytes)).is_err() {
        return;
    }
    if let Ok(loaded) = read_image(file.path()) {
        let image = loaded.image;
        assert_eq!(image.texels.len(), image.width as usize * image.height as usize);
    }
});
