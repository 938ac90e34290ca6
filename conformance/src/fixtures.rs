//! Lattices, fields and scenes that the cases share. All are non-cubic and asymmetric, so that a swapped axis shows.

use std::sync::Arc;

use airlight::glam::{DAffine3, DMat3, DQuat, DVec3, UVec3, Vec3};
use airlight::light::{Environment, Image};
use airlight::media::{
    Classified, ControlPoint, Grid, GridMedium, Lattice, Optics, Phase, PhaseTable, TransferFunction,
};
use airlight::scene::{Camera, Estimate, Material, Mesh, Quality, Scene, Triangle};

/// The dimensions of most small fields.
pub(crate) const DIMS: UVec3 = UVec3::new(7, 5, 9);

/// Numbers in [0, 1) that look random: a counter's hash (Steele, Lea and Flood's SplitMix64).
pub(crate) fn noise(seed: u64, n: usize) -> Vec<f32> {
    let hash = |i: u64| {
        let mut z = (seed << 32).wrapping_add(i).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    };
    (0..n as u64).map(hash).collect()
}

/// A rough density with empty parts: noise within two slanted ellipsoids, zero outside.
pub(crate) fn density(dims: UVec3, seed: u64) -> Vec<f32> {
    let n = dims.element_product() as usize;
    let size = dims.as_dvec3();
    let inside = |p: DVec3| {
        let (a, b) = (p - DVec3::new(0.35, 0.55, 0.3), p - DVec3::new(0.8, 0.25, 0.75));
        let slanted = DVec3::new(a.x + 0.4 * a.y, a.y, a.z - 0.3 * a.x) / DVec3::new(0.33, 0.42, 0.28);
        slanted.length() < 1.0 || (b / DVec3::new(0.18, 0.25, 0.2)).length() < 1.0
    };
    noise(seed, n)
        .into_iter()
        .enumerate()
        .map(|(i, v)| {
            let i = i as u32;
            let at = UVec3::new(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y);
            if inside((at.as_dvec3() + 0.5) / size) { 0.3 + 0.7 * v } else { 0.0 }
        })
        .collect()
}

/// Ways to lay a lattice into the world. The boxes are about a metre wide and stand near the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Map {
    /// Along the axes, with edges that differ.
    Plain,
    /// Turned about a slanted axis.
    Rotated,
    /// Slanted.
    Sheared,
    /// One axis reversed.
    Mirrored,
}

impl Map {
    pub(crate) const ALL: [Self; 4] = [Self::Plain, Self::Rotated, Self::Sheared, Self::Mirrored];

    /// A lattice of `dims` samples laid into the world.
    pub(crate) fn lattice(self, dims: UVec3) -> Lattice {
        let edges = DVec3::new(0.9, 0.7, 1.1) / dims.as_dvec3();
        let scale = DMat3::from_diagonal(edges);
        let linear = match self {
            Self::Plain => scale,
            Self::Rotated => {
                DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.2, 0.9, -0.4).normalize(), 0.8)) * scale
            }
            Self::Sheared => {
                DMat3::from_cols(DVec3::X, DVec3::new(0.35, 1.0, 0.1), DVec3::new(-0.2, 0.25, 1.0)) * scale
            }
            Self::Mirrored => scale * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)),
        };
        let center = linear * (0.5 * (dims.as_dvec3() - 1.0));
        let map = DAffine3::from_mat3_translation(linear, DVec3::new(0.1, -0.05, 0.2) - center);
        Lattice::new(dims, map).expect("the maps above have inverses")
    }
}

/// A camera that sees the boxes of [`Map::lattice`] whole, in general position.
pub(crate) fn camera(width: u32, height: u32, samples: u32) -> Camera {
    Camera {
        origin: DVec3::new(1.31, 0.97, 1.73),
        target: DVec3::new(0.08, -0.03, 0.17),
        up: DVec3::new(0.1, 1.0, -0.05),
        fov: 36.0,
        width,
        height,
        samples,
    }
}

/// Optics with a colour of their own in every coefficient.
pub(crate) fn chromatic(phase: Phase) -> Optics {
    Optics { extinction: Vec3::new(6.0, 4.0, 2.5), albedo: Vec3::new(0.95, 0.8, 0.6), emission: Vec3::ZERO, phase }
}

/// The same with grey extinction.
pub(crate) fn grey(phase: Phase) -> Optics {
    Optics { extinction: Vec3::splat(4.0), ..chromatic(phase) }
}

/// One phase function of each kind, with its name.
pub(crate) fn phases() -> Vec<(&'static str, Phase)> {
    let degrees = [0.0, 10.0, 40.0, 90.0, 135.0, 180.0];
    let table = PhaseTable::new(&degrees, &[9.0, 4.0, 1.0, 0.3, 0.5, 1.2]).expect("a phase table");
    vec![
        ("isotropic", Phase::Isotropic),
        ("hg", Phase::HenyeyGreenstein { g: 0.7 }),
        ("backward_hg", Phase::HenyeyGreenstein { g: -0.4 }),
        ("rayleigh", Phase::Rayleigh),
        ("double_hg", Phase::DoubleHenyeyGreenstein { forward: 0.8, backward: -0.3, weight: 0.7 }),
        ("table", Phase::Table(Arc::new(table))),
    ]
}

/// A coarse coloured sky, bright in one place.
pub(crate) fn sky() -> Environment {
    let (width, height) = (16u32, 8u32);
    let base = noise(77, (width * height * 3) as usize);
    let mut texels: Vec<[f32; 3]> =
        base.chunks_exact(3).map(|t| [0.4 + 0.4 * t[0], 0.3 + 0.5 * t[1], 0.6 * t[2]]).collect();
    // A bright corner, three texels wide.
    for (x, y) in [(11, 2), (12, 2), (11, 3), (12, 3), (13, 2)] {
        texels[(y * width + x) as usize] = [4.0, 3.5, 2.5];
    }
    let mut sky = Environment::new(Image { width, height, texels }).expect("texels are radiance");
    sky.visible = false;
    sky
}

/// The medium of [`cloud`], in which albedo, absorption and what shines vary from voxel to voxel.
pub(crate) fn varied(map: Map, dims: UVec3) -> GridMedium {
    let to_world = map.lattice(dims).index_to_world();
    let n = dims.element_product() as usize;
    let grid = |values: Vec<f32>| Arc::new(Grid::dense(dims, to_world, values).expect("as many values as voxels"));
    let rough = |seed: u64, value: fn(f32) -> f32| grid(noise(seed, n).into_iter().map(value).collect());
    // It absorbs where nothing scatters too, and shines where nothing does either.
    let absorption = rough(11, |v| (v - 0.6).max(0.0));
    let shining = rough(12, |v| (v - 0.7).max(0.0));
    let albedo = [13, 14, 15].map(|seed| rough(seed, |v| 0.2 + 0.8 * v));
    GridMedium::new(grid(density(dims, 5)), Some(shining))
        .and_then(|medium| medium.with_absorption(absorption))
        .and_then(|medium| medium.with_albedo(albedo))
        .and_then(|medium| medium.with_temperature(rough(16, |v| 1.2 + 0.8 * v), 1000.0, 1500.0))
        .expect("values in range")
}

/// The medium of [`cloud`] by values of -1000 to 1000 that are classified, with colours of their own and a tint.
pub(crate) fn classified(map: Map, dims: UVec3) -> Classified {
    let values = density(dims, 5).into_iter().map(|v| 2000.0 * v - 1000.0).collect();
    let grid = Grid::dense(dims, map.lattice(dims).index_to_world(), values).expect("as many values as voxels");
    let point = |value, density, albedo: [f32; 3], emission: [f32; 3], tint: [f32; 3]| ControlPoint {
        albedo: Vec3::from(albedo),
        emission: Vec3::from(emission),
        tint: Vec3::from(tint),
        ..ControlPoint::new(value, density)
    };
    let points = vec![
        point(-1000.0, 0.0, [1.0; 3], [0.0; 3], [1.0; 3]),
        point(-400.0, 0.2, [0.9, 0.5, 0.3], [0.0, 0.1, 0.2], [1.0, 0.6, 0.5]),
        point(100.0, 0.5, [0.6, 0.7, 0.9], [0.0; 3], [0.8, 0.9, 0.3]),
        point(800.0, 1.2, [0.95; 3], [0.3, 0.1, 0.0], [1.0, 0.9, 0.8]),
    ];
    let function = TransferFunction::new(points).expect("points in range");
    Classified::new(Arc::new(grid), function).expect("finite values")
}

/// A cloud of `dims` rough voxels, not lit.
pub(crate) fn cloud(map: Map, dims: UVec3, optics: Optics) -> Scene {
    let lattice = map.lattice(dims);
    let grid = Grid::dense(dims, lattice.index_to_world(), density(dims, 5)).expect("as many values as voxels");
    Scene {
        camera: camera(24, 18, 1),
        medium: Arc::new(GridMedium::new(Arc::new(grid), None).expect("a density")),
        optics,
        environment: None,
        background: None,
        surfaces: None,
        frame: 0,
        lights: Vec::new(),
        estimate: Estimate::single(),
        quality: Quality::default(),
    }
}

/// A surface of two facets: a parallelogram with this corner and these edges.
pub(crate) fn wall(corner: DVec3, right: DVec3, up: DVec3, material: Material) -> Mesh {
    let positions = vec![corner, corner + right, corner + up, corner + right + up];
    let triangles = [[0, 1, 2], [1, 3, 2]].map(|vertices| Triangle { vertices, material: 0 });
    Mesh::new(positions, vec![], triangles.to_vec(), vec![material]).expect("two triangles")
}

/// A ball of 8·n² facets that looks smooth.
pub(crate) fn ball(center: DVec3, radius: f64, n: u32, material: Material) -> Mesh {
    let (mut normals, mut triangles) = (Vec::new(), Vec::new());
    for octant in 0..8 {
        let sign = |a: u32| if octant >> a & 1 == 1 { -1.0 } else { 1.0 };
        let at = |i: u32, j: u32| DVec3::new(f64::from(i), f64::from(j), f64::from(n - i - j));
        let mut corner = |i: u32, j: u32| {
            normals.push((at(i, j) * DVec3::new(sign(0), sign(1), sign(2))).normalize());
            normals.len() as u32 - 1
        };
        for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
            triangles.push([corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
            if i + j + 2 <= n {
                triangles.push([corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]);
            }
        }
    }
    let positions = normals.iter().map(|&n| center + radius * n).collect();
    let normals = normals.iter().map(|n| n.as_vec3()).collect();
    let triangles = triangles.into_iter().map(|vertices| Triangle { vertices, material: 0 }).collect();
    Mesh::new(positions, normals, triangles, vec![material]).expect("a ball")
}

/// Walls and a ball in and around the boxes of [`Map::lattice`], of materials that differ.
pub(crate) fn room() -> Mesh {
    let material = |diffuse: [f32; 3], specular: f32, shininess: f32| Material {
        diffuse: Vec3::from(diffuse),
        specular: Vec3::splat(specular),
        shininess,
    };
    let v = DVec3::new;
    let floor = material([0.6, 0.7, 0.5], 0.0, 1.0);
    let slanted = material([0.8, 0.2, 0.1], 0.1, 3.0);
    let glossy = material([0.1, 0.3, 0.7], 0.5, 20.0);
    Mesh::joined(&[
        wall(v(-1.3, -0.52, -1.1), v(0.1, 0.03, 2.9), v(3.2, -0.05, 0.2), floor),
        wall(v(-0.4, -0.3, 0.1), v(0.5, 0.1, -0.3), v(0.1, 0.6, 0.2), slanted),
        ball(v(0.25, -0.15, 0.6), 0.22, 3, glossy),
    ])
    .expect("some triangles")
}
