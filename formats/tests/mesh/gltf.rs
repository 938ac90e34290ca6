//! glTF 2.0.

use std::f64::consts::FRAC_1_SQRT_2;

use airlight_core::scene::Material;
use airlight_formats::mesh::{Format, MeshFile};
use base64::prelude::{BASE64_STANDARD, Engine};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use crate::common::{area, facing, read, triangles};

/// Four corners of a rectangle of 2 × 1 in the plane z = 0, then its normals, then indices of 8, 16 and 32 bits.
pub(crate) fn bin() -> Vec<u8> {
    let corners = [[0.0f32, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let normals = [[0.0f32, 0.6, 0.8]; 4];
    let mut bytes: Vec<u8> = corners.iter().chain(&normals).flatten().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0u8, 1, 2, 0, 2, 3, 0, 0]);
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    bytes.extend([0u32, 1, 3, 2].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// The rectangle as two triangles.
pub(crate) fn document() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "uri": "room%20a.bin", "byteLength": 132 }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 96 },
            { "buffer": 0, "byteOffset": 96, "byteLength": 8 },
            { "buffer": 0, "byteOffset": 104, "byteLength": 12 },
            { "buffer": 0, "byteOffset": 116, "byteLength": 16 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR" },
            { "bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR" },
            { "bufferView": 3, "componentType": 5125, "count": 4, "type": "SCALAR" },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 2 }] }],
        "nodes": [{ "mesh": 0 }],
        "scenes": [{ "nodes": [0] }],
    })
}

/// The binary form of a document, whose first buffer then needs no URI.
pub(crate) fn glb(document: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + bin.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    let parts: [&[u8]; 9] =
        [b"glTF", &word(2), &word(total), &word(json.len()), b"JSON", &json, &word(bin.len()), b"BIN\0", bin];
    parts.concat()
}

fn load(document: &Value) -> Result<MeshFile, String> {
    read(Format::Gltf, document.to_string().as_bytes(), &[("room a.bin", &bin())])
}

/// The document with the value at a JSON pointer replaced.
fn with(pointer: &str, value: Value) -> Value {
    let mut document = document();
    put(&mut document, pointer, value);
    document
}

fn put(document: &mut Value, pointer: &str, value: Value) {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match document.pointer_mut(parent).unwrap() {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        other => other[key] = value,
    }
}

#[test]
fn triangles_strips_and_fans_of_every_index_cover_the_rectangle() {
    let primitive = |indices: Option<u32>, mode: u32| {
        let mut primitive = json!({ "attributes": { "POSITION": 0 }, "mode": mode });
        if let Some(indices) = indices {
            primitive["indices"] = indices.into();
        }
        load(&with("/meshes/0/primitives/0", primitive)).unwrap()
    };
    // A strip runs 0 1 3 2; a fan runs around.
    for file in [primitive(Some(2), 4), primitive(Some(3), 4), primitive(Some(4), 5), primitive(None, 6)] {
        assert_eq!((triangles(&file).len(), area(&file), facing(&file)), (2, 2.0, DVec3::Z * 4.0));
        assert!(file.mesh.normals().is_empty() && file.warnings.is_empty());
        assert_eq!(file.mesh.positions().len(), 4);
    }
    let nothing = with("/meshes/0/primitives/0", json!({ "attributes": { "POSITION": 0 }, "mode": 1 }));
    let told = load(&nothing).unwrap_err();
    assert_eq!(told, "room: the file holds no triangles; primitives of lines or points, left out (1)");
}

#[test]
fn bytes_come_from_a_file_the_document_or_the_binary_chunk() {
    assert!(load(&document()).is_ok());
    let encoded = BASE64_STANDARD.encode(bin());
    let uri = format!("data:application/octet-stream;base64,{encoded}");
    let file = load(&with("/buffers/0/uri", uri.into())).unwrap();
    assert_eq!((area(&file), file.files.len()), (2.0, 0));
    let binary = with("/buffers/0", json!({ "byteLength": 132 }));
    let file = read(Format::Glb, &glb(&binary, &bin()), &[]).unwrap();
    assert_eq!((area(&file), file.format), (2.0, Format::Glb));
    assert_eq!(load(&document()).unwrap().files, [std::path::PathBuf::from("room a.bin")]);
}

#[test]
fn nodes_place_their_meshes() {
    let mut placed = document();
    placed["nodes"] = json!([
        { "children": [1, 2], "translation": [10, 0, 0] },
        { "mesh": 0, "scale": [1, 3, 1], "rotation": [0, 0, FRAC_1_SQRT_2, FRAC_1_SQRT_2] },
        { "mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1] },
    ]);
    let file = load(&placed).unwrap();
    assert_eq!(triangles(&file).len(), 4);
    assert!((area(&file) - 8.0).abs() < 1e-12);
    // A mirrored mesh faces as the matrix says, not as its corners run.
    assert!((facing(&file) - DVec3::Z * 16.0).length() < 1e-12);
    let (low, high) = file.mesh.bounds().unwrap();
    assert!((low - DVec3::new(7.0, 0.0, 0.0)).length() < 1e-12 && (high - DVec3::new(10.0, 6.0, 0.0)).length() < 1e-12);
    // Without scenes, all that is no other's child; with several, the one that is named.
    placed.as_object_mut().unwrap().remove("scenes");
    assert_eq!(triangles(&load(&placed).unwrap()).len(), 4);
    placed["scenes"] = json!([{ "nodes": [0] }, { "nodes": [2] }]);
    placed["scene"] = 1.into();
    assert_eq!(triangles(&load(&placed).unwrap()).len(), 2);
}

#[test]
fn normals_and_quantized_attributes_arrive() {
    let file = load(&with("/meshes/0/primitives/0/attributes/NORMAL", 1.into())).unwrap();
    assert!(file.mesh.normals().iter().all(|n| (*n - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-6));
    // Beside a primitive without normals, its triangles stay facets.
    let mut both = with("/meshes/0/primitives/0/attributes/NORMAL", 1.into());
    let bare = document()["meshes"][0]["primitives"][0].clone();
    both["meshes"][0]["primitives"].as_array_mut().unwrap().push(bare);
    let file = load(&both).unwrap();
    let last = file.mesh.triangles().last().unwrap().vertices;
    assert_eq!(last.map(|v| file.mesh.normals()[v as usize]), [Vec3::Z; 3]);

    // Corners as normalized bytes, four apart.
    let mut small = document();
    small["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    small["buffers"] = json!([{ "uri": "data:;base64,AAAAAP8AAAD//wAAAP8AAA==", "byteLength": 16 }]);
    small["bufferViews"] = json!([{ "buffer": 0, "byteLength": 16, "byteStride": 4 }]);
    small["accessors"] =
        json!([{ "bufferView": 0, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC3" }]);
    small["meshes"] = json!([{ "primitives": [{ "attributes": { "POSITION": 0 }, "mode": 6 }] }]);
    let file = load(&small).unwrap();
    assert_eq!((area(&file), file.mesh.bounds().unwrap().1), (1.0, DVec3::new(1.0, 1.0, 0.0)));
}

#[test]
fn sparse_accessors_change_some_elements() {
    // Element 2 is moved to element 0 of the normals, (0, 0.6, 0.8); the bytes at 98 hold the index 2.
    let sparse = json!({
        "count": 1,
        "indices": { "bufferView": 1, "byteOffset": 2, "componentType": 5121 },
        "values": { "bufferView": 0, "byteOffset": 48 },
    });
    let file = load(&with("/accessors/0/sparse", sparse.clone())).unwrap();
    let moved = file.mesh.positions()[2];
    assert!((moved - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-6, "{moved}");
    // Without a buffer view the others are zero.
    let mut zeros = with("/accessors/0/sparse", sparse);
    zeros["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(load(&zeros).unwrap_err(), "room: none of its 2 triangles has an area");
    put(&mut zeros, "/accessors/0/count", 1_000_000_000_000u64.into());
    let told = load(&zeros).unwrap_err();
    assert!(told.contains("1000000000000 elements without a bufferView"), "{told}");
    let outside = with(
        "/accessors/0/sparse",
        json!({ "count": 1, "indices": { "bufferView": 0, "byteOffset": 15, "componentType": 5121 },
                "values": { "bufferView": 0 } }),
    );
    assert!(load(&outside).unwrap_err().ends_with("accessors[0]: sparse.indices names element 64 of 4"));
}

#[test]
fn materials_are_mapped_and_what_is_not_read_is_told() {
    let mut shaded = with("/meshes/0/primitives/0/material", 1.into());
    shaded["materials"] = json!([
        { "name": "unused" },
        {
            "name": "Bark",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0, "roughnessFactor": 1,
                "baseColorTexture": { "index": 0 }
            },
            "normalTexture": { "index": 1 },
            "emissiveFactor": [0, 1, 0],
            "alphaMode": "BLEND"
        },
    ]);
    shaded["textures"] = json!([{ "source": 0 }, { "source": 9 }]);
    shaded["images"] = json!([{ "uri": "bark.png" }]);
    shaded["animations"] = json!([{ "channels": [] }]);
    shaded["nodes"][0]["skin"] = 3.into();
    shaded["extensionsUsed"] = json!(["KHR_materials_sheen", "KHR_texture_transform"]);
    let file = load(&shaded).unwrap();
    let bark = Material { diffuse: Vec3::new(0.5, 0.25, 0.125), specular: Vec3::splat(0.04), shininess: 0.0 };
    assert_eq!((file.mesh.materials(), file.names), (&[bark][..], vec!["Bark".to_owned()]));
    assert_eq!(
        file.warnings,
        [
            "extensions that are not read: 'KHR_materials_sheen'",
            "pictures on surfaces are not read, their factors are taken: 'bark.png', 'texture 1'",
            "surfaces are opaque; transparency is left out: 'Bark'",
            "surfaces do not shine; emission is left out: 'Bark'",
            "nodes with skins, which are left out: the mesh stands in its bind pose (1)",
            "animations, left out (1)",
        ]
    );
    let bare = load(&document()).unwrap();
    assert_eq!(bare.missing, ["2 of 2 triangles have no material; they take the default, grey of 0.7"]);
    assert_eq!(bare.mesh.materials(), [Material::default()]);
}

#[test]
fn faults_are_told_with_their_place() {
    for (pointer, value, expected) in [
        ("/asset/version", json!("1.0"), "room: glTF of version 1.0; airlight reads version 2.0"),
        (
            "/extensionsRequired",
            json!(["KHR_draco_mesh_compression"]),
            "room: it requires 'KHR_draco_mesh_compression', which is not read; export without it (and without compression)",
        ),
        ("/buffers/0/uri", json!("none.bin"), "none.bin: entity not found"),
        (
            "/buffers/0/uri",
            json!("https://a.org/b.bin"),
            "room: buffers[0]: its uri has the scheme 'https:'; files beside and data: are read",
        ),
        (
            "/buffers/0/uri",
            json!("data:text/plain,abc"),
            "room: buffers[0]: a data: URI of type 'text/plain'; it must be base64",
        ),
        (
            "/buffers/0/uri",
            json!("data:;base64,a*c="),
            "room: buffers[0]: its data: URI is not base64: Invalid symbol 42, offset 1.",
        ),
        (
            "/buffers/0/uri",
            json!(null),
            "room: buffers[0]: it has no uri and is not the first of a .glb with a BIN chunk; its bytes are nowhere",
        ),
        (
            "/buffers/0/byteLength",
            json!(133),
            "room: buffers[0]: byteLength is 133, and it has 132 bytes; the data is cut short",
        ),
        (
            "/bufferViews/0/byteLength",
            json!(133),
            "room: meshes[0].primitives[0]: accessors[0]: bufferView 0 is 133 bytes from byte 0 of a buffer that has 132",
        ),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "accessors[0]: bufferView 0 is 96 bytes from byte"),
        ("/bufferViews/0/byteStride", json!(8), "bufferView 0 has byteStride 8 for elements of 12 bytes"),
        ("/bufferViews/0/buffer", json!(7), "accessors[0]: bufferView 0 names buffer 7; the file has 1"),
        (
            "/accessors/0/count",
            json!(9),
            "accessors[0]: 9 elements of 12 bytes, 12 apart, from byte 0 do not fit bufferView 0, which has 96 bytes",
        ),
        ("/accessors/0/count", json!(u64::MAX), "do not fit bufferView 0"),
        ("/accessors/0/bufferView", json!(9), "accessors[0]: there is no bufferView 9; the file has 4"),
        (
            "/accessors/0/bufferView",
            json!(null),
            "it has neither bufferView nor sparse; compressed meshes are not read",
        ),
        ("/accessors/0/type", json!("VEC2"), "VEC2 of componentType 5126; vectors are VEC3 of 5120 to 5123 or 5126"),
        ("/accessors/0/componentType", json!(5124), "componentType 5124; it must be 5120 to 5123, 5125 or 5126"),
        (
            "/accessors/2/componentType",
            json!(5120),
            "accessors[2]: SCALAR of componentType 5120; indices are SCALAR of 5121, 5123 or 5125, and not normalized",
        ),
        ("/accessors/2/count", json!(5), "room: meshes[0].primitives[0]: 5 indices; triangles have three each"),
        ("/accessors/0/count", json!(3), "room: meshes[0].primitives[0]: index 5 names vertex 3 of 3"),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(99),
            "room: meshes[0].primitives[0]: there is no accessor 99; the file has 5",
        ),
        ("/meshes/0/primitives/0/attributes", json!({}), "room: meshes[0].primitives[0]: it has no attribute POSITION"),
        ("/meshes/0/primitives/0/attributes/NORMAL", json!(2), "accessors[2]: SCALAR of componentType 5121"),
        ("/meshes/0/primitives/0/mode", json!(7), "room: meshes[0].primitives[0]: mode 7; it must be from 0 to 6"),
        (
            "/meshes/0/primitives/0/material",
            json!(0),
            "room: meshes[0].primitives[0]: there is no material 0; the file has 0",
        ),
        ("/nodes/0/mesh", json!(3), "room: nodes[0]: there is no mesh 3; the file has 1"),
        ("/nodes/0/children", json!([0]), "room: nodes[0]: it is reached twice; nodes must form trees, without cycles"),
        ("/nodes/0/children", json!([4]), "room: nodes[4]: there is no such node; the file has 1"),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "is no quaternion; its length must be 1"),
        (
            "/nodes/0/matrix",
            json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "room: nodes[0]: its matrix is not affine; the last row must be 0 0 0 1",
        ),
        ("/nodes/0/scale", json!([1e300, 1, 1]), "room: nodes[0]: it takes a vertex to"),
        ("/nodes/0/scale", json!([0, 1, 1]), "room: none of its 2 triangles has an area"),
        ("/scene", json!(1), "room: scene: there is no scene 1; the file has 1"),
        ("/scenes/0/nodes", json!([0, 0]), "room: nodes[0]: it is reached twice"),
        (
            "/materials",
            json!([{ "pbrMetallicRoughness": { "metallicFactor": 1.5 } }]),
            "room: materials[0]: a factor of pbrMetallicRoughness is 1.5; each must be from 0 to 1",
        ),
        ("/accessors/0/count", json!(-1), "room: line 1, column"),
        ("/nodes", json!({}), "room: line 1, column"),
    ] {
        let told = load(&with(pointer, value)).map(|_| ()).expect_err(pointer);
        assert!(told.contains(expected), "{pointer}: {told:?} instead of {expected:?}");
    }
    let compressed = json!({
        "attributes": { "POSITION": 0 }, "extensions": { "KHR_draco_mesh_compression": { "bufferView": 0 } }
    });
    let mut draco = with("/meshes/0/primitives/0", compressed);
    draco["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(load(&draco).unwrap_err().contains("compressed with KHR_draco_mesh_compression"));
    // Not a number among the corners.
    let mut bytes = bin();
    bytes[16..20].copy_from_slice(&f32::NAN.to_le_bytes());
    let told = read(Format::Gltf, document().to_string().as_bytes(), &[("room a.bin", &bytes)]).unwrap_err();
    assert_eq!(told, "room: meshes[0].primitives[0]: POSITION 1 is [2, NaN, 0]; coordinates must be finite");
}

#[test]
fn instances_are_counted_before_they_are_made() {
    // 30,000 nodes that each show 30,000 primitives of the same two triangles.
    let mut many = document();
    let primitive = many["meshes"][0]["primitives"][0].clone();
    many["meshes"][0]["primitives"] = vec![primitive; 30_000].into();
    many["nodes"] = vec![json!({ "mesh": 0 }); 30_000].into();
    many["scenes"] = json!([{ "nodes": (0..30_000).collect::<Vec<_>>() }]);
    let told = load(&many).unwrap_err();
    assert_eq!(told, "room: its 30000 nodes show 1800000000 triangles; at most 67108864 are taken");
}

#[test]
fn binary_files_are_whole_or_refused() {
    let whole = glb(&with("/buffers/0", json!({ "byteLength": 132 })), &bin());
    let told = |bytes: &[u8]| read(Format::Glb, bytes, &[]).unwrap_err();
    for cut in 0..whole.len() {
        told(&whole[..cut]);
    }
    let all = whole.len();
    let cut = told(&whole[..all - 40]);
    assert_eq!(cut, format!("room: its header says {all} bytes, and the file has {}; it is cut short", all - 40));
    let change = |at: usize, value: u32| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    assert_eq!(told(&change(4, 1)), "room: binary glTF of version 1; airlight reads version 2");
    assert!(told(&change(12, u32::MAX)).starts_with("room: byte 12: a chunk of 4294967295 bytes, of which"));
    assert_eq!(told(&change(16, 7)), "room: byte 12: the first chunk must be JSON");
    // A header that says too little is no reason to refuse what is there.
    assert!(read(Format::Glb, &change(8, 3), &[]).is_ok());
}
