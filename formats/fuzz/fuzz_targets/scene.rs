//! Any text as a scene, its last line as an override: an error with a place in the text, or a scene.
#![no_main]

use std::path::Path;

use airlight_formats::scene::parse_scene;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    // Relative files are looked for in a folder that is not there; absolute ones are not for a fuzzer to open.
    if text.contains('/') {
        return;
    }
    let (text, last) = text.rsplit_once('\n').unwrap_or((text, ""));
    let set = last.split_once('=').map(|(key, value)| (key.to_owned(), value.to_owned()));
    let sets: Vec<_> = set.into_iter().collect();
    if let Err(error) = parse_scene(text, Path::new("no-such-folder/scene.toml"), &sets) {
        assert!(!error.report().is_empty());
    }
});
