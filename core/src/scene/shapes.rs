//! Shapes that need no file. Each fits the cube of one metre around the origin, from -½ to ½ along every axis, before it is
//! placed.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::{Material, Mesh, MeshError, Triangle};

/// A shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// The cube itself: six flat sides, 12 triangles.
    Box,
    /// A square of 1 m² in the plane y = 0 that faces +Y: 2 triangles.
    Plane,
    /// A ball of radius ½ m with smooth normals, [`Shape::AROUND`] × [`Shape::DOWN`] facets between meridians and
    /// parallels, poles on the y axis. Facets lie up to 0.25 % of the radius within the ball.
    Sphere,
    /// A room that is open toward +Z, with a short block at the front on the right and a tall one behind it on the left.
    /// Seen from the open side the left wall is red and the right wall green, whatever the material; all else has it.
    CornellBox,
}

impl Shape {
    /// Every shape and its name.
    pub const NAMES: [(&str, Self); 4] =
        [("box", Self::Box), ("plane", Self::Plane), ("sphere", Self::Sphere), ("cornell-box", Self::CornellBox)];
    /// Facets of a sphere around its axis.
    pub const AROUND: u32 = 64;
    /// Facets of a sphere from pole to pole.
    pub const DOWN: u32 = 32;
    /// Diffuse reflectance of the left wall of a Cornell box.
    pub const RED: Vec3 = Vec3::new(0.57, 0.043, 0.044);
    /// Diffuse reflectance of the right wall of a Cornell box.
    pub const GREEN: Vec3 = Vec3::new(0.105, 0.378, 0.076);

    /// The shape, of one material; a Cornell box adds those of its red and its green wall.
    ///
    /// # Errors
    /// A material out of range.
    pub fn mesh(self, material: Material) -> Result<Mesh, MeshError> {
        let mut facets = Facets::default();
        match self {
            Self::Sphere => sphere(material),
            Self::Plane => {
                let corner = |x: f64, z: f64| DVec3::new(x, 0.0, z);
                facets.quad([corner(-0.5, 0.5), corner(0.5, 0.5), corner(0.5, -0.5), corner(-0.5, -0.5)], 0);
                facets.mesh(vec![material])
            }
            Self::Box => {
                facets.block(DVec3::ZERO, DVec3::splat(0.5), 0.0, true);
                facets.mesh(vec![material])
            }
            Self::CornellBox => {
                facets.cornell_box();
                let wall = |diffuse| Material { diffuse, ..material };
                facets.mesh(vec![material, wall(Self::RED), wall(Self::GREEN)])
            }
        }
    }
}

/// Flat quadrilaterals that share no vertices.
#[derive(Default)]
struct Facets {
    positions: Vec<DVec3>,
    triangles: Vec<Triangle>,
}

impl Facets {
    /// Corners run counter-clockwise where the side is seen from that it faces.
    fn quad(&mut self, corners: [DVec3; 4], material: u32) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            self.triangles.push(Triangle { vertices: [first + a, first + b, first + c], material });
        }
    }

    /// A block around `center` with half its edges, turned by `turn` degrees about +Y, with or without its underside.
    fn block(&mut self, center: DVec3, half: DVec3, turn: f64, underside: bool) {
        let (sin, cos) = turn.to_radians().sin_cos();
        let place = |v: DVec3| {
            let v = v * half;
            center + DVec3::new(cos * v.x + sin * v.z, v.y, cos * v.z - sin * v.x)
        };
        // Each side has an axis that it faces and one to its right; up is what remains.
        for (out, right) in [
            (DVec3::X, DVec3::NEG_Z),
            (DVec3::NEG_X, DVec3::Z),
            (DVec3::Y, DVec3::X),
            (DVec3::NEG_Y, DVec3::X),
            (DVec3::Z, DVec3::X),
            (DVec3::NEG_Z, DVec3::NEG_X),
        ] {
            if out != DVec3::NEG_Y || underside {
                let up = out.cross(right);
                self.quad([out - right - up, out + right - up, out + right + up, out - right + up].map(place), 0);
            }
        }
    }

    /// The room and its blocks. The proportions follow the box of Goral and others (1984) as it is commonly built; the
    /// numbers are round ones of our own.
    fn cornell_box(&mut self) {
        let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) * 0.5;
        let floor = [at(-1.0, -1.0, 1.0), at(1.0, -1.0, 1.0), at(1.0, -1.0, -1.0), at(-1.0, -1.0, -1.0)];
        let ceiling = [at(-1.0, 1.0, -1.0), at(1.0, 1.0, -1.0), at(1.0, 1.0, 1.0), at(-1.0, 1.0, 1.0)];
        let back = [at(-1.0, -1.0, -1.0), at(1.0, -1.0, -1.0), at(1.0, 1.0, -1.0), at(-1.0, 1.0, -1.0)];
        let left = [at(-1.0, -1.0, 1.0), at(-1.0, -1.0, -1.0), at(-1.0, 1.0, -1.0), at(-1.0, 1.0, 1.0)];
        let right = [at(1.0, -1.0, -1.0), at(1.0, -1.0, 1.0), at(1.0, 1.0, 1.0), at(1.0, 1.0, -1.0)];
        for (corners, material) in [(floor, 0), (ceiling, 0), (back, 0), (left, 1), (right, 2)] {
            self.quad(corners, material);
        }
        self.block(DVec3::new(0.17, -0.35, 0.19), DVec3::new(0.15, 0.15, 0.15), -17.0, false);
        self.block(DVec3::new(-0.17, -0.2, -0.13), DVec3::new(0.15, 0.3, 0.15), 18.0, false);
    }

    fn mesh(self, materials: Vec<Material>) -> Result<Mesh, MeshError> {
        Mesh::new(self.positions, Vec::new(), self.triangles, materials)
    }
}

/// Rings of vertices from the north pole to the south pole; each pole is one vertex.
fn sphere(material: Material) -> Result<Mesh, MeshError> {
    let (around, down) = (Shape::AROUND, Shape::DOWN);
    let mut directions = vec![DVec3::Y];
    for ring in 1..down {
        let (sin, cos) = (PI * f64::from(ring) / f64::from(down)).sin_cos();
        directions.extend((0..around).map(|i| {
            let (x, z) = (TAU * f64::from(i) / f64::from(around)).sin_cos();
            DVec3::new(sin * x, cos, sin * z)
        }));
    }
    directions.push(DVec3::NEG_Y);
    let last = directions.len() as u32 - 1;
    let vertex = |ring: u32, i: u32| match ring {
        0 => 0,
        _ if ring == down => last,
        _ => 1 + (ring - 1) * around + i % around,
    };
    let mut triangles = Vec::new();
    for ring in 0..down {
        for i in 0..around {
            let corners = [vertex(ring, i), vertex(ring + 1, i), vertex(ring + 1, i + 1), vertex(ring, i + 1)];
            let halves = [(ring + 1 < down, [0, 1, 2]), (ring > 0, [0, 2, 3])];
            for (_, half) in halves.into_iter().filter(|(whole, _)| *whole) {
                triangles.push(Triangle { vertices: half.map(|c: usize| corners[c]), material: 0 });
            }
        }
    }
    let normals = directions.iter().map(|d| d.as_vec3()).collect();
    let positions = directions.into_iter().map(|d| 0.5 * d).collect();
    Mesh::new(positions, normals, triangles, vec![material])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(shape: Shape) -> Mesh {
        shape.mesh(Material::default()).unwrap()
    }

    fn corners(mesh: &Mesh) -> impl Iterator<Item = ([DVec3; 3], u32)> {
        mesh.triangles().iter().map(|t| (t.vertices.map(|v| mesh.positions()[v as usize]), t.material))
    }

    fn area(mesh: &Mesh) -> f64 {
        corners(mesh).map(|([a, b, c], _)| 0.5 * (b - a).cross(c - a).length()).sum()
    }

    /// The volume that the triangles enclose, positive where they face outward.
    fn volume(mesh: &Mesh) -> f64 {
        corners(mesh).map(|([a, b, c], _)| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn shapes_fit_the_cube_and_lose_no_triangle() {
        for (name, shape) in Shape::NAMES {
            let mesh = mesh(shape);
            let (low, high) = mesh.bounds().unwrap();
            let half = if shape == Shape::Plane { DVec3::new(0.5, 0.0, 0.5) } else { DVec3::splat(0.5) };
            assert!((low + half).length() < 1e-15 && (high - half).length() < 1e-15, "{name}: {low} {high}");
            assert_eq!(mesh.degenerate(), 0, "{name}");
        }
    }

    #[test]
    fn a_box_is_a_cube_that_faces_outward() {
        let mesh = mesh(Shape::Box);
        assert_eq!((mesh.triangles().len(), area(&mesh), volume(&mesh)), (12, 6.0, 1.0));
    }

    #[test]
    fn a_plane_faces_up() {
        let mesh = mesh(Shape::Plane);
        assert_eq!((mesh.triangles().len(), area(&mesh)), (2, 1.0));
        assert!(corners(&mesh).all(|([a, b, c], _)| (b - a).cross(c - a).normalize() == DVec3::Y));
    }

    #[test]
    fn a_sphere_is_as_round_as_it_says() {
        let mesh = mesh(Shape::Sphere);
        assert_eq!(mesh.triangles().len() as u32, 2 * Shape::AROUND * (Shape::DOWN - 1));
        for (p, n) in mesh.positions().iter().zip(mesh.normals()) {
            assert!((p.length() - 0.5).abs() < 1e-15 && (p.normalize().as_vec3() - *n).length() < 1e-6);
        }
        let inside = corners(&mesh).map(|([a, b, c], _)| (a + b + c).length() / 3.0).fold(0.5, f64::min);
        // Of a facet the middle of its diagonal lies deepest: cos² of half a facet's 180°/32, both ways.
        assert!(1.0 - inside / 0.5 < 1.0 - (PI / 64.0).cos().powi(2));
        // The inscribed body is smaller by the order of the facets' depth.
        assert!((volume(&mesh) / (PI / 6.0) - 1.0).abs() < 0.005 && (area(&mesh) / PI - 1.0).abs() < 0.005);
    }

    #[test]
    fn a_cornell_box_is_open_to_the_front_and_red_on_the_left() {
        let mesh = mesh(Shape::CornellBox);
        assert_eq!((mesh.triangles().len(), mesh.materials().len()), (2 * (5 + 5 + 5), 3));
        let front = corners(&mesh).filter(|(c, _)| c.iter().all(|p| p.z == 0.5)).count();
        assert_eq!(front, 0);
        let (mut red, mut green) = (0, 0);
        for ([a, b, c], material) in corners(&mesh) {
            let normal = (b - a).cross(c - a).normalize();
            if material > 0 {
                let side = if material == 1 { -0.5 } else { 0.5 };
                assert!([a, b, c].iter().all(|p| p.x == side) && normal.x == -2.0 * side);
                *(if material == 1 { &mut red } else { &mut green }) += 1;
            }
            // Walls face inward.
            if [a, b, c].iter().all(|p| p.abs().max_element() == 0.5) && a.y + b.y + c.y != -1.5 {
                assert!(normal.dot(a + b + c) < 0.0, "{a} {b} {c}");
            }
        }
        assert_eq!((red, green), (2, 2));
        assert_eq!(mesh.materials()[1].diffuse, Shape::RED);
    }

    #[test]
    fn materials_out_of_range_are_refused() {
        let bright = Material { diffuse: Vec3::splat(1.5), ..Material::default() };
        assert!(matches!(Shape::Plane.mesh(bright), Err(MeshError::Material { .. })));
    }
}
