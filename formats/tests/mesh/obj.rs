//! Wavefront OBJ.

use airlight_core::scene::Material;
use airlight_formats::mesh::{Format, MeshFile};
use glam::{DVec3, Vec3};

use crate::common::{area, facing, read, triangles};

const CORNERS: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\n";

fn obj(text: &str, mtl: &str) -> Result<MeshFile, String> {
    read(Format::Obj, text.as_bytes(), &[("a.mtl", mtl.as_bytes()), ("two words.mtl", mtl.as_bytes())])
}

fn told(rest: &str) -> String {
    obj(&format!("{CORNERS}{rest}"), "").map(|_| ()).expect_err(rest)
}

#[test]
fn polygons_become_triangles_that_face_the_same_way() {
    for (face, expected, count) in [
        ("f 1 2 3 4", 2.0, 2),
        ("f -4 -3 -2 -1", 2.0, 2),
        ("f 1/7/1 2//1 3/5 4", 2.0, 2),
        ("f 1 2 \\\n3 4", 2.0, 2),
        ("f 1 2 3 # 4", 1.0, 1),
    ] {
        let file = obj(&format!("\u{feff}# a\n{CORNERS}vn 0 0 1\nvt 0 0\n{face}\n"), "").unwrap();
        assert_eq!((area(&file), triangles(&file).len()), (expected, count), "{face}");
        assert_eq!(facing(&file), DVec3::Z * 2.0 * expected, "{face}");
    }
    // Concave, and with a corner on an edge: what a fan from the first corner would get wrong.
    let arrow = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 2 0 1\nv 2 0 3\nv 0 0 3\n";
    let file = obj(&format!("{arrow}f 4 1 2 3\nf 1 2 3 4\n"), "").unwrap();
    assert_eq!((area(&file), facing(&file)), (2.0, DVec3::Z * 4.0));
    let file = obj(&format!("{arrow}f 5 6 7 8 9\n"), "").unwrap();
    assert_eq!((area(&file), facing(&file), file.mesh.degenerate()), (4.0, DVec3::NEG_Y * 8.0, 0));
}

#[test]
fn normals_are_a_corners_own() {
    let smooth = format!("{CORNERS}vn 0 1 1\nvn 0 0 2\nvn 0 0 0\nf 1//1 2//1 3//2 4//2\n");
    let file = obj(&smooth, "").unwrap();
    let normals = file.mesh.normals();
    assert_eq!((normals.len(), file.mesh.positions().len()), (4, 4));
    assert!((normals[0] - Vec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-6 && normals[2] == Vec3::Z);
    // Without any normal there are facets; a corner without one, or with one of no length, takes the facet's.
    assert!(obj(&format!("{CORNERS}f 1 2 3"), "").unwrap().mesh.normals().is_empty());
    for odd in ["f 1//1 2//1 3", "f 1//1 2//1 3//3"] {
        let file = obj(&format!("{CORNERS}vn 0 1 1\nvn 0 0 2\nvn 0 0 0\n{odd}\n"), "").unwrap();
        let corners = file.mesh.triangles()[0].vertices.map(|v| file.mesh.normals()[v as usize]);
        assert_eq!(corners, [Vec3::Z; 3], "{odd}");
    }
}

#[test]
fn materials_come_from_the_library() {
    let mtl = "# plain\nnewmtl red wall\nKd 0.5 0.1 0.2\nKs 0.25\nNs 50\nnewmtl matt\nillum 1\nKd 0.4 0.4 0.4\nKs 1 1 1\n\
               newmtl unused\nKd 1 1 1\n";
    let faces = "usemtl matt\nf 1 2 3\nusemtl red wall\nf 1 3 4\nusemtl matt\nf 2 3 4\n";
    for library in ["a.mtl", "two words.mtl", "a.mtl a.mtl"] {
        let file = obj(&format!("mtllib {library}\n{CORNERS}{faces}"), mtl).unwrap();
        assert_eq!(file.names, ["matt", "red wall"]);
        let grey = Material { diffuse: Vec3::splat(0.4), specular: Vec3::ZERO, shininess: 32.0 };
        let red = Material { diffuse: Vec3::new(0.5, 0.1, 0.2), specular: Vec3::splat(0.25), shininess: 50.0 };
        assert_eq!(file.mesh.materials(), [grey, red]);
        assert_eq!(triangles(&file).iter().map(|t| t.1).collect::<Vec<_>>(), [0, 1, 0]);
        assert!(file.warnings.is_empty() && file.missing.is_empty(), "{:?}", file.warnings);
        assert!(!file.files.is_empty());
    }
}

#[test]
fn materials_that_are_missing_are_the_default_and_told() {
    let of = |text: &str, mtl: &str| {
        let file = obj(&format!("{CORNERS}{text}"), mtl).unwrap();
        assert!(file.mesh.materials().contains(&Material::default()), "{text}");
        file.missing
    };
    assert_eq!(of("f 1 2 3", ""), ["1 of 1 triangles have no material; they take the default, grey of 0.7"]);
    let bare = of("mtllib a.mtl\nf 1 2 3\nusemtl x\nf 1 3 4", "newmtl x\nKd 0 0 0");
    assert_eq!(bare, ["1 of 2 triangles have no material; they take the default, grey of 0.7"]);
    let none = of("mtllib none.mtl\nusemtl x\nf 1 2 3", "");
    assert_eq!(none, ["none.mtl: entity not found; its materials are taken as the default, grey of 0.7"]);
    let other = of("mtllib a.mtl\nusemtl x\nf 1 2 3", "newmtl y");
    assert_eq!(other, ["no .mtl file has 'x'; the default, grey of 0.7, is taken instead"]);
    let nowhere = of("usemtl x\nf 1 2 3", "");
    assert_eq!(nowhere, ["no mtllib says what 'x' is; the default, grey of 0.7, is taken instead"]);
}

#[test]
fn what_is_left_out_is_told() {
    let mtl = "newmtl x\nKd 2 0.5 0\nNs 1e9\nmap_Kd -s 1 1 1 wood.png\nd 0.5\n";
    let text = format!("mtllib a.mtl\n{CORNERS}usemtl x\nf 1 2 3\nf 1 1 2\nl 1 2\np 1\ncurv 0 1 1 2\n");
    let file = obj(&text, mtl).unwrap();
    assert_eq!(
        file.warnings,
        [
            "a.mtl: 'Kd of x', 'Ns of x': taken as 1, or as 100000 for Ns, the largest that can be",
            "a.mtl: pictures on surfaces are not read: 'wood.png'",
            "a.mtl: surfaces are opaque; transparency is left out: 'x'",
            "lines and points, left out (2)",
            "free-form curves and surfaces, left out; export polygons (1)",
            "1 of 2 triangles have no area and are left out",
        ]
    );
    assert_eq!(file.mesh.materials()[0].diffuse, Vec3::new(1.0, 0.5, 0.0));
}

#[test]
fn faults_are_told_with_their_line() {
    for (rest, expected) in [
        ("v 0 0", "room: line 5: v needs three numbers; it has 2"),
        ("v 0 nan 0", "room: line 5: v: nan; numbers must be finite"),
        ("v 0 1e999 0", "room: line 5: v: 1e999; numbers must be finite"),
        ("v 0 1e16 0", "room: line 5: v [0, 10000000000000000, 0]; coordinates must be within 1e15 m"),
        ("v 0 x 0", "room: line 5: v: 'x' is not a number"),
        ("vn 0 inf 0", "room: line 5: vn: inf; numbers must be finite"),
        ("\n\nf 1 2", "room: line 7: f needs three corners or more; it has 2"),
        ("f 1 2 0", "room: line 5: f names vertex 0; they are counted from 1, or backward from -1"),
        ("f 1 2 5", "room: line 5: f names vertex 5, and there are 4 before it"),
        ("f 1 2 -5", "room: line 5: f names vertex -5, and there are 4 before it"),
        ("f 1 2 99999999999999999999", "room: line 5: f: '99999999999999999999' is not a whole number"),
        ("f 1 2 -9223372036854775808", "room: line 5: f names vertex -9223372036854775808, and there are 4 before it"),
        ("f 1//1 2 3", "room: line 5: f names normal 1, and there is none before it"),
        ("f 1/x 2 3", "room: line 5: f: 'x' is not a whole number"),
        ("f 1/1/1/1 2 3", "room: line 5: f names normal 1, and there is none before it"),
        ("f a b c", "room: line 5: f: 'a' is not a whole number"),
        ("f 1.5 2 3", "room: line 5: f: '1.5' is not a whole number"),
        ("mtllib", "room: line 5: mtllib needs the name of a file"),
        (
            "solid cube",
            "room: line 5: 'solid' is no statement of an OBJ file; such a file has v, vn, vt, f, o, g, s, mtllib and usemtl",
        ),
        ("", "room: the file holds no triangles"),
        ("f 1 1 1", "room: none of its 1 triangles has an area"),
    ] {
        assert_eq!(told(rest), expected);
    }
    for (mtl, expected) in [
        ("Kd 1 1 1", "a.mtl: line 1: Kd before the first newmtl"),
        ("newmtl", "a.mtl: line 1: newmtl needs the name of a material"),
        ("newmtl x\nKd 1 1", "a.mtl: line 2: Kd needs one number or three, r g b; it has 2"),
        ("newmtl x\nKd 1 -1 1", "a.mtl: line 2: Kd -1; it must be at least 0"),
        ("newmtl x\nKs nan", "a.mtl: line 2: nan; numbers must be finite"),
        ("newmtl x\nKd spectral a.rfl", "a.mtl: line 2: Kd spectral a.rfl; it must be given as r g b"),
        ("newmtl x\nNs", "a.mtl: line 2: Ns needs a number"),
        ("newmtl x\nNs -3", "a.mtl: line 2: Ns -3; it must be at least 0"),
    ] {
        assert_eq!(obj(&format!("mtllib a.mtl\n{CORNERS}f 1 2 3"), mtl).map(|_| ()).expect_err(mtl), expected);
    }
    let many = format!("f{}", " 1".repeat(70_000));
    assert_eq!(told(&many), "room: line 5: f has more than the 65536 corners that a face may have");
    assert!(told(&"x".repeat(1 << 20)).len() < 200);
}
