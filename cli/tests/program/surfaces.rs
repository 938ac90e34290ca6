//! Surfaces: files that are broken, need what is not read, or hold nothing are told with their place.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::workbench::{FOG, Workbench};

const CORNERS: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\n";

/// The fog with a surface of these keys.
fn scene(bench: &Workbench, keys: &str) -> PathBuf {
    bench.write("surface.toml", format!("{FOG}\n[[surface]]\n{keys}\n"))
}

/// A file that must be refused with `words`, by itself and in a scene, where its key is named.
#[track_caller]
fn refused(bench: &Workbench, name: &str, content: impl AsRef<[u8]>, words: &[&str]) {
    let file = bench.write(name, content);
    bench.refused(["info".as_ref(), file.as_os_str()], 2, words);
    let scene = scene(bench, &format!("file = '{name}'"));
    let place = ["surface.toml:26:8: surface[0].file: "];
    for command in ["info", "render"] {
        bench.refused([command.as_ref(), scene.as_os_str()], 2, &[words, &place].concat());
    }
}

#[test]
fn obj_files_are_told_with_their_line() {
    let bench = Workbench::new();
    let obj = |rest: &str, words: &[&str]| refused(&bench, "a.obj", format!("{CORNERS}{rest}\n"), words);
    obj("v 0 nan 0", &["a.obj: line 5: ", "nan", "finite"]);
    obj("v 0 0 1e300", &["a.obj: line 5: ", "within 1e15 m"]);
    obj("f 1 2 7", &["a.obj: line 5: ", "vertex 7", "there are 4"]);
    obj("f 1 2 -7", &["a.obj: line 5: ", "vertex -7", "there are 4"]);
    obj("f 1 2 0", &["a.obj: line 5: ", "vertex 0", "from 1"]);
    obj("f 1 2", &["a.obj: line 5: ", "three corners"]);
    obj("f 1 1 2\nf 3 3 3", &["a.obj: none of its 2 triangles has an area"]);
    obj("", &["a.obj: the file holds no triangles"]);
    refused(&bench, "empty.obj", "", &["empty.obj: the file is empty"]);
    refused(&bench, "zeros.obj", [0; 4096], &["zeros.obj: line 1: "]);
    refused(&bench, "noise.obj", (0..=255).cycle().take(70_000).collect::<Vec<u8>>(), &["noise.obj: line "]);
    bench.write("bad.mtl", "newmtl x\nKd 1 2\n");
    obj("mtllib bad.mtl\nusemtl x\nf 1 2 3", &["bad.mtl: line 2: Kd needs one number or three"]);
}

#[test]
fn obj_files_without_materials_are_read_with_a_warning() {
    let bench = Workbench::new();
    bench.write("a.obj", format!("mtllib none.mtl\n{CORNERS}usemtl x\nf 1 2 3\nf 1 1 2\n"));
    let path = scene(&bench, "file = 'a.obj'");
    let told = bench.json(["info".as_ref(), path.as_os_str(), "--json".as_ref()]);
    let warnings = told["warnings"].to_string();
    assert!(warnings.contains("none.mtl: No such file") && warnings.contains("grey of 0.7"), "{warnings}");
    assert!(warnings.contains("1 of 2 triangles have no area"), "{warnings}");
    assert_eq!(told["surface"][0]["triangles"], 1);
    assert_eq!(
        told["surface"][0]["material"][0],
        json!({
            "name": "x", "diffuse": [0.7, 0.7, 0.7], "specular": [0.0, 0.0, 0.0], "shininess": 32.0
        })
    );
    assert_eq!(told["surface"][0]["bounds"], json!([[0.0, 0.0, 0.0], [2.0, 1.0, 0.0]]));
    let own = scene(&bench, "file = 'a.obj'\nmaterial = { diffuse = 0.5 }");
    let told = bench.json(["info".as_ref(), own.as_os_str(), "--json".as_ref()]);
    assert!(!told["warnings"].to_string().contains("grey"), "{told}");
}

/// A triangle of glTF whose bytes lie in the binary chunk.
fn document() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": 36 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "nodes": [{ "mesh": 0 }],
    })
}

fn glb(document: &Value, corners: [f32; 9]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let bin: Vec<u8> = corners.iter().flat_map(|v| v.to_le_bytes()).collect();
    let word = |n: usize| (n as u32).to_le_bytes();
    let total = 28 + json.len() + bin.len();
    let parts: [&[u8]; 9] =
        [b"glTF", &word(2), &word(total), &word(json.len()), b"JSON", &json, &word(bin.len()), b"BIN\0", &bin];
    parts.concat()
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

#[test]
fn gltf_files_are_told_with_their_place() {
    let bench = Workbench::new();
    let whole = glb(&document(), TRIANGLE);
    let told = bench.json(["info".as_ref(), bench.write("a.glb", &whole).as_os_str(), "--json".as_ref()]);
    assert_eq!((&told["format"], &told["triangles"]), (&json!("glTF 2.0 binary"), &json!(1)));
    for cut in [5, 15, 60, whole.len() - 20, whole.len() - 1] {
        refused(&bench, "cut.glb", &whole[..cut], &["cut.glb: "]);
    }
    refused(&bench, "cut.glb", &whole[..whole.len() - 20], &["the file has", "cut short"]);
    let mut nan = TRIANGLE;
    nan[4] = f32::NAN;
    refused(&bench, "nan.glb", glb(&document(), nan), &["meshes[0].primitives[0]: POSITION 1", "finite"]);
    refused(&bench, "flat.glb", glb(&document(), [0.5; 9]), &["none of its 1 triangles has an area"]);

    let changed = |pointer: &str, value: Value, words: &[&str]| {
        let mut document = document();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        document.pointer_mut(parent).unwrap()[key] = value;
        refused(&bench, "b.glb", glb(&document, TRIANGLE), words);
    };
    changed(
        "/extensionsRequired",
        json!(["KHR_draco_mesh_compression"]),
        &["'KHR_draco_mesh_compression'", "not read"],
    );
    changed("/extensionsRequired", json!(["EXT_meshopt_compression"]), &["'EXT_meshopt_compression'", "not read"]);
    changed("/buffers", json!([{}]), &["b.glb: line 1, column ", "byteLength"]);
    changed("/nodes", json!([{ "children": [1] }, { "mesh": 0, "children": [1] }]), &["nodes[1]: it is reached twice"]);
    changed("/scenes", json!([{ "nodes": [7] }]), &["nodes[7]", "the file has 1"]);
    changed("/accessors", json!([]), &["meshes[0].primitives[0]", "accessor 0"]);
    changed("/asset", json!({ "version": "3.0" }), &["version 3.0", "version 2.0"]);

    let mut beside = document();
    beside["buffers"][0]["uri"] = "none.bin".into();
    refused(&bench, "c.gltf", beside.to_string(), &["none.bin: No such file"]);
    bench.write("short.bin", [0; 12]);
    beside["buffers"][0]["uri"] = "short.bin".into();
    refused(&bench, "c.gltf", beside.to_string(), &["c.gltf: buffers[0]: byteLength is 36", "12 bytes"]);
    refused(&bench, "c.gltf", "{ \"asset\": ", &["c.gltf: line 1, column "]);
    refused(&bench, "c.gltf", "solid", &["c.gltf: not a glTF file"]);
}

#[test]
fn surfaces_are_placed_and_files_that_are_not_there_are_told() {
    let bench = Workbench::new();
    let path = scene(&bench, "shape = 'sphere'\nposition = [0, 0.5, 0]\nscale = [2, 1, 2]");
    let told = bench.json(["info".as_ref(), path.as_os_str(), "--json".as_ref()]);
    assert_eq!(told["surface"][0]["source"], "sphere");
    assert_eq!(told["surface"][0]["bounds"], json!([[-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]]));
    for (keys, words) in [
        ("file = 'none.obj'", &["surface.toml:26:8: ", "none.obj: No such file"][..]),
        ("file = 'fog.toml'", &["not a surface that airlight reads: .obj, .gltf or .glb"]),
        ("file = 'out'", &["a folder"]),
        ("shape = 'cone'", &["surface.toml:26:9: ", "\"cornell-box\""]),
        ("shape = 'box'\nscale = 0", &["surface.toml:27:9: ", "1e-9"]),
    ] {
        bench.refused(["render".as_ref(), scene(&bench, keys).as_os_str()], 2, words);
    }
    let none = Path::new("none.glb");
    bench.refused(["info".as_ref(), none.as_os_str()], 2, &["none.glb: No such file"]);
}
