//! `docs/new-device.md` shows the toy's own text: the blocks of a file, one after another with an empty line between,
//! are the file.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

#[test]
fn the_document_shows_the_toy_as_it_is() {
    let toy = Path::new(env!("CARGO_MANIFEST_DIR"));
    let document = fs::read_to_string(toy.join("../../docs/new-device.md")).expect("the document");
    let mut shown: BTreeMap<&str, String> = BTreeMap::new();
    let mut lines = document.lines();
    while let Some(line) = lines.next() {
        // A block of a file is marked "```rust src/lib.rs".
        let Some((_, file)) = line.strip_prefix("```").and_then(|mark| mark.split_once(' ')) else { continue };
        let block: String = lines.by_ref().take_while(|line| *line != "```").map(|line| format!("{line}\n")).collect();
        let text = shown.entry(file).or_default();
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&block);
    }
    let files = shown.keys().copied().collect::<Vec<_>>();
    assert_eq!(files, ["Cargo.toml", "examples/picture.rs", "src/lib.rs", "tests/suite.rs"]);
    for (file, text) in &shown {
        let written = fs::read_to_string(toy.join(file)).expect("a file of the toy");
        let differ = text.lines().zip(written.lines()).position(|(a, b)| a != b);
        let at = differ.unwrap_or(text.lines().count().min(written.lines().count()));
        let line = |text: &str| text.lines().nth(at).unwrap_or("its end").to_owned();
        assert!(
            *text == written,
            "docs/new-device.md is not {file} from line {} on:\n  document: {}\n  file:     {}",
            at + 1,
            line(text),
            line(&written)
        );
    }
    // The document says how long the toy is.
    let length = fs::read_to_string(toy.join("src/lib.rs")).expect("the toy").lines().count();
    assert!(
        document.contains(&format!("{length} lines")),
        "the toy has {length} lines, which the document does not say"
    );
}
