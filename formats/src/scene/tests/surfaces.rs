//! Surfaces of a scene.

use airlight_core::scene::{Material, Shape};

use super::*;

const TRIANGLES: &str = "v 0 0 0\nv 2 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\nf 1 1 2\n";

fn surfaces(rest: &str) -> LoadedScene {
    load(&format!("{BASE}{BOX}{rest}"), &[]).unwrap()
}

#[test]
fn shapes_are_placed_and_joined() {
    let loaded = surfaces(
        "[[surface]]\nshape = \"box\"\nposition = [1, 2, 3]\nscale = 2\n\
         [[surface]]\nshape = \"plane\"\nscale = [4, 1, 2]\nrotation = [0, 90, 0]\n\
         material = { diffuse = [0.1, 0.2, 0.3], specular = 0.04, shininess = 100 }\n",
    );
    let mesh = loaded.scene.surfaces.unwrap();
    assert_eq!(mesh.triangles().len(), 14);
    let own = Material { diffuse: Vec3::new(0.1, 0.2, 0.3), specular: Vec3::splat(0.04), shininess: 100.0 };
    assert_eq!(mesh.materials(), [Material::default(), own]);
    let [cube, plane] = &loaded.surfaces[..] else { panic!() };
    assert_eq!((&*cube.source, cube.triangles, &*plane.source, plane.triangles), ("box", 12, "plane", 2));
    assert_eq!(cube.bounds, (DVec3::new(0.0, 1.0, 2.0), DVec3::new(2.0, 3.0, 4.0)));
    assert!((plane.bounds.1 - DVec3::new(1.0, 0.0, 2.0)).length() < 1e-12, "{:?}", plane.bounds);
    assert_eq!(plane.materials, [(String::new(), own)]);
    assert!(surfaces("").scene.surfaces.is_none());
}

#[test]
fn a_cornell_box_keeps_the_colours_of_its_walls() {
    let mesh = surfaces("[[surface]]\nshape = \"cornell-box\"\nmaterial = { diffuse = 0.5, specular = 0.1 }").scene;
    let mesh = mesh.surfaces.unwrap();
    let diffuse: Vec<_> = mesh.materials().iter().map(|m| m.diffuse).collect();
    assert_eq!(diffuse, [Vec3::splat(0.5), Shape::RED, Shape::GREEN]);
    assert!(mesh.materials().iter().all(|m| m.specular == Vec3::splat(0.1)));
}

#[test]
fn files_bring_materials_that_a_scene_may_change() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let file = folder.path().join("a.obj");
    let load = |mtl: &str, rest: &str| {
        std::fs::write(folder.path().join("a.mtl"), mtl).unwrap();
        let text = format!("{BASE}{BOX}[environment]\nradiance = 1\n[[surface]]\nfile = \"a.obj\"\n{rest}");
        parse_scene(&text, &path, &[])
    };
    std::fs::write(&file, format!("mtllib a.mtl\n{TRIANGLES}")).unwrap();
    let loaded = load("newmtl x\nKd 0.5 0.25 0\nKs 0.2\nNs 9", "material = { shininess = 40 }").unwrap();
    let expected = Material { diffuse: Vec3::new(0.5, 0.25, 0.0), specular: Vec3::splat(0.2), shininess: 40.0 };
    assert_eq!(loaded.surfaces[0].materials, [("x".to_owned(), expected)]);
    assert_eq!(loaded.files, [file.clone(), folder.path().join("a.mtl")]);
    let lost = format!("{}: 1 of 2 triangles have no area and are left out", file.display());
    assert_eq!(loaded.warnings, std::slice::from_ref(&lost));
    // A material that is missing is told, unless the scene gives one.
    let bare = load("", "").unwrap().warnings;
    let missing = format!("{}: no .mtl file has 'x'; the default, grey of 0.7, is taken instead", file.display());
    assert_eq!(bare, [lost.clone(), missing]);
    assert_eq!(load("", "material = { diffuse = 0.3 }").unwrap().warnings, [lost]);

    let error = load("newmtl x\nKd a", "").unwrap_err();
    assert_eq!(error.place, Some((10, 8)));
    let place = folder.path().join("a.mtl");
    assert_eq!(error.message, format!("surface[0].file: {}: line 2: 'a' is not a number", place.display()));
    std::fs::write(&file, "v 0 0 0\nf 1 2 3\n").unwrap();
    let error = load("", "").unwrap_err();
    let expected = format!("surface[0].file: {}: line 2: f names vertex 2, and there are 1 before it", file.display());
    assert_eq!(error.message, expected);
}

#[test]
fn what_is_wrong_is_told_at_its_key() {
    for (rest, expected) in [
        ("", "7:1: surface[0].shape is missing, as in shape = \"plane\", or file = \"room.obj\""),
        (
            "file = \"a.obj\"\nshape = \"plane\"",
            "9:9: surface[0].file and surface[0].shape exclude each other; give one",
        ),
        (
            "shape = \"cube\"",
            "8:9: surface[0].shape = \"cube\"; it must be \"box\", \"plane\", \"sphere\" or \"cornell-box\"",
        ),
        ("file = \"none.obj\"", "8:8: surface[0].file: scenes/none.obj: No such file or directory (os error 2)"),
        ("shape = \"box\"\nscales = 2", "9:1: unknown key `scales` in surface[0]; did you mean `scale`?"),
        (
            "shape = \"box\"\nscale = 0",
            "9:9: surface[0].scale = 0; each factor must be from 1e-9 to 1e9 in size; a negative one mirrors",
        ),
        (
            "shape = \"box\"\nscale = [1, 1e-10, 1]",
            "9:9: surface[0].scale = [1, 1e-10, 1]; each factor must be from 1e-9 to 1e9 in size; a negative one mirrors",
        ),
        ("shape = \"box\"\nscale = [1, 2]", "9:9: surface[0].scale must be a number or [x, y, z]; it is a list of 2"),
        (
            "shape = \"box\"\nrotation = 90",
            "9:12: surface[0].rotation must be three numbers, [x, y, z]; it is a whole number, 90",
        ),
        ("shape = \"box\"\nposition = [0, nan, 0]", "9:16: surface[0].position[1] = nan; it must be finite"),
        (
            "shape = \"box\"\nposition = [0, 1e16, 0]",
            "7:1: surface[0]: vertex 0 at [0.5, 10000000000000000, 0.5]: each coordinate must be finite and within 1e15 m",
        ),
        (
            "shape = \"box\"\nmaterial = { diffuse = 1.5 }",
            "9:24: surface[0].material.diffuse = 1.5; it must be from 0 to 1",
        ),
        (
            "shape = \"box\"\nmaterial = { specular = [0, -0.1, 0] }",
            "9:25: surface[0].material.specular = [0, -0.1, 0]; it must be from 0 to 1",
        ),
        (
            "shape = \"box\"\nmaterial = { shininess = 1e6 }",
            "9:26: surface[0].material.shininess = 1000000.0; it must be from 0 to 100000",
        ),
        (
            "shape = \"box\"\nmaterial = { colour = 1 }",
            "9:14: unknown key `colour` in surface[0].material; the keys are `diffuse`, `specular` and `shininess`",
        ),
        ("shape = \"box\"\nmaterial = 0.5", "9:12: surface[0].material must be a table; it is a number, 0.5"),
    ] {
        assert_eq!(told(&format!("[[surface]]\n{rest}")), expected);
    }
    assert_eq!(told("[surface]\nshape = \"box\""), "7:1: surface is a list of tables: write [[surface]]");
}

#[test]
fn overrides_reach_surfaces() {
    let text = format!("{BASE}{BOX}[[surface]]\nshape = \"box\"\n");
    let sets = [("surface.0.position", "[0, 5, 0]"), ("surface.0.scale", "0.5"), ("surface.0.material.diffuse", "0.2")];
    let loaded = load(&text, &sets).unwrap();
    assert_eq!(loaded.surfaces[0].bounds, (DVec3::new(-0.25, 4.75, -0.25), DVec3::new(0.25, 5.25, 0.25)));
    assert_eq!(loaded.surfaces[0].materials[0].1.diffuse, Vec3::splat(0.2));
    let error = load(&text, &[("surface.1.scale", "2")]).unwrap_err().to_string();
    assert_eq!(error, "--set surface.1.scale=2: there is 1 surface, surface.0");
    let error = load(&text, &[("surface.0.scale", "0")]).unwrap_err().to_string();
    assert!(error.starts_with("--set surface.0.scale=0: surface[0].scale = 0; each factor must be"), "{error}");
}
