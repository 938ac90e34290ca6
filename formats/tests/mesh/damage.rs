//! Files that were cut short or changed at random: an error or a mesh, and nothing else.

use std::path::Path;

use airlight_formats::mesh::{Format, detect, read as read_path};
use proptest::prelude::*;

use crate::common::read;
use crate::gltf::{bin, document, glb};

const OBJ: &[u8] =
    b"mtllib a.mtl\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 1 0.5 0\nvn 0 0 1\nusemtl x\nf 1//1 2//1 3//1 4//1\n\
                     f -5/1/1 -4 -1 \\\n -2\n";
const MTL: &[u8] = b"newmtl x\nKd 0.5 0.5 0.5\nKs 0.1\nNs 10\nillum 2\nmap_Kd a.png\nd 1\n";

fn try_all(bytes: &[u8]) {
    for format in [Format::Obj, Format::Gltf, Format::Glb] {
        // Files beside the file hold the same bytes.
        for beside in [&[("a.mtl", bytes), ("room a.bin", bytes)][..], &[("a.mtl", MTL), ("room a.bin", &bin())]] {
            if let Ok(file) = read(format, bytes, beside) {
                assert!(!file.mesh.triangles().is_empty() && file.names.len() == file.mesh.materials().len());
            }
        }
    }
}

#[test]
fn files_cut_short_are_no_harm() {
    let text = document().to_string();
    for whole in [OBJ, text.as_bytes()] {
        for cut in 0..whole.len() {
            try_all(&whole[..cut]);
        }
    }
    let whole = text.as_bytes();
    assert!((0..whole.len()).all(|cut| read(Format::Gltf, &whole[..cut], &[("room a.bin", &bin())]).is_err()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn changed_bytes_are_no_harm(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let text = document().to_string().into_bytes();
        for mut bytes in [OBJ.to_vec(), text, glb(&document(), &bin())] {
            for (at, value) in &changes {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            try_all(&bytes);
        }
    }

    #[test]
    fn other_numbers_are_no_harm(at in any::<prop::sample::Index>(), value in prop::sample::select(vec![
        "-1", "0", "1", "7", "255", "4294967295", "18446744073709551615", "1e300", "0.5", "[]", "{}", "null", "\"\"",
    ])) {
        let text = document().to_string();
        let starts: Vec<_> = text.match_indices(|c: char| c.is_ascii_digit()).map(|(i, _)| i).collect();
        let start = starts[at.index(starts.len())];
        let end = text[start..].find(|c: char| !c.is_ascii_digit()).map_or(text.len(), |n| start + n);
        try_all(format!("{}{value}{}", &text[..start], &text[end..]).as_bytes());
    }
}

#[test]
fn formats_are_known_by_content_then_by_ending() {
    let of = |name: &str, bytes: &[u8]| detect(Path::new(name), bytes).map_err(|e| e.to_string());
    assert_eq!(of("a.glb", b"glTF\x02\0\0\0"), Ok(Format::Glb));
    assert_eq!(of("a.gltf", b"glTF\x02\0\0\0"), Ok(Format::Glb));
    assert_eq!(of("a.glb", b"\xef\xbb\xbf {}"), Ok(Format::Gltf));
    assert_eq!(of("a.OBJ", b"v 0 0 0"), Ok(Format::Obj));
    for (name, bytes, expected) in [
        ("a.obj", &b""[..], "a.obj: the file is empty"),
        ("a.gltf", b"v 0 0 0", "a.gltf: not a glTF file: such a file is a JSON object, '{ \u{2026} }'"),
        ("a.glb", b"v 0 0 0", "a.glb: not a binary glTF file: such a file begins with 'glTF'"),
        ("a.ply", b"ply", "a.ply: not a surface that airlight reads: .obj, .gltf or .glb"),
        (
            "a.obj",
            b"version https://git-lfs.github.com/spec/v1\n",
            "a.obj: this is a Git LFS pointer; fetch the file itself: git lfs pull",
        ),
    ] {
        assert_eq!(of(name, bytes), Err(expected.to_owned()));
    }
    let folder = tempfile::tempdir().unwrap();
    assert!(read_path(folder.path()).unwrap_err().to_string().ends_with("a folder; give the name of a file"));
    assert!(read_path(folder.path().join("none.obj")).is_err());
}
