//! Directions by subdivision of an icosahedron, and the triangles between them.
//!
//! Each level cuts every triangle in four at the middles of its edges, which are moved onto the sphere: 10·4ˡ + 2
//! vertices and 20·4ˡ triangles at level l. The vertices of a level are the first ones of the next. Edges are great
//! circles, so that the four triangles fill theirs exactly and the triangle that holds a direction is found by a
//! descent.

use std::collections::HashMap;

use glam::DVec3;

/// A triangle.
#[derive(Clone, Copy, Debug)]
struct Triangle {
    /// Its vertices, counterclockwise from outside.
    corners: [u32; 3],
    /// |a + b| of the two corners a and b other than the i-th: what their middle is divided by.
    lengths: [f64; 3],
}

/// The vertices of a level, and the triangles of all levels up to it.
#[derive(Clone, Debug)]
pub(super) struct Icosphere {
    pub(super) vertices: Vec<DVec3>,
    /// Of the icosahedron's faces: the sum of the corners, and for each corner a multiple of what tells its coordinate.
    faces: Vec<(DVec3, [DVec3; 3])>,
    /// \[level\]\[triangle\]; those that triangle i is cut in are 4i to 4i+3: at its corners, and in the middle.
    levels: Vec<Vec<Triangle>>,
}

/// Where a direction lies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The triangle.
    pub(super) triangle: usize,
    /// Barycentric coordinates of the point where the direction meets the plane of the triangle: at least 0, sum 1.
    pub(super) weights: [f64; 3],
}

/// Number of vertices of a level.
pub(super) const fn count(level: u32) -> usize {
    10 * 4usize.pow(level) + 2
}

impl Icosphere {
    pub(super) fn new(level: u32) -> Self {
        let mut vertices = icosahedron();
        let mut levels = vec![triangles(&vertices)];
        let face = |t: &Triangle| {
            let [a, b, c] = t.corners.map(|v| vertices[v as usize]);
            // The determinant would divide all three coordinates alike.
            (a + b + c, [b.cross(c), c.cross(a), a.cross(b)])
        };
        let faces = levels[0].iter().map(face).collect();
        for _ in 0..level {
            let mut middles = HashMap::new();
            let mut finer = Vec::new();
            for triangle in levels.last().expect("there is the icosahedron") {
                let [a, b, c] = triangle.corners;
                // Opposite each corner.
                let [x, y, z] = [[b, c], [c, a], [a, b]].map(|[i, j]| {
                    *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                        vertices.push((vertices[i as usize] + vertices[j as usize]).normalize());
                        vertices.len() as u32 - 1
                    })
                });
                finer.extend([[a, z, y], [b, x, z], [c, y, x], [x, y, z]].map(|t| triangle_of(t, &vertices)));
            }
            levels.push(finer);
        }
        Self { vertices, faces, levels }
    }

    fn last(&self) -> &[Triangle] {
        self.levels.last().expect("there is the icosahedron")
    }

    /// The corners of each triangle.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.last().iter().map(|t| t.corners)
    }

    /// The corners of each triangle, and after them, for each corner, the vertex beyond the edge that lies opposite.
    pub(super) fn neighbourhoods(&self) -> Vec<[u32; 6]> {
        let edges = |[a, b, c]: [u32; 3]| [([b, c], a), ([c, a], b), ([a, b], c)];
        // Neighbours run along their common edge in opposite senses.
        let beyond: HashMap<[u32; 2], u32> = self.triangles().flat_map(edges).collect();
        let neighbourhood = |corners: [u32; 3]| {
            let [x, y, z] = edges(corners).map(|([i, j], _)| beyond[&[j, i]]);
            [corners[0], corners[1], corners[2], x, y, z]
        };
        self.triangles().map(neighbourhood).collect()
    }

    /// The triangle that holds the unit direction `d`; one of its neighbours where it lies on an edge.
    ///
    /// With d = Σ c_i v_i over the corners v_i, d lies beyond the line between the middles of the edges at corner i
    /// where c_i is larger than the sum of the others. The coordinates in a smaller triangle follow from those in the
    /// larger one.
    pub(super) fn locate(&self, d: DVec3) -> Place {
        let (mut triangle, mut nearest) = (0, f64::NEG_INFINITY);
        // A face holds what is nearest to its middle.
        for (i, (middle, _)) in self.faces.iter().enumerate() {
            let near = middle.dot(d);
            (triangle, nearest) = if near > nearest { (i, near) } else { (triangle, nearest) };
        }
        let mut at = self.faces[triangle].1.map(|normal| normal.dot(d));
        for level in &self.levels[..self.levels.len() - 1] {
            let lengths = level[triangle].lengths;
            let part = (0..3).find(|&i| at[i] > at[(i + 1) % 3] + at[(i + 2) % 3]);
            at = match part {
                Some(i) => {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    [at[i] - at[j] - at[k], at[j] * lengths[k], at[k] * lengths[j]]
                }
                None => [0, 1, 2].map(|i| 0.5 * (at[(i + 1) % 3] + at[(i + 2) % 3] - at[i]) * lengths[i]),
            };
            triangle = 4 * triangle + part.unwrap_or(3);
        }
        let at = at.map(|c| c.max(0.0));
        let sum: f64 = at.iter().sum();
        Place { triangle, weights: at.map(|c| c / sum) }
    }
}

/// Corners of three golden rectangles at right angles.
fn icosahedron() -> Vec<DVec3> {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let rectangle = [(-1.0, -golden), (-1.0, golden), (1.0, -golden), (1.0, golden)];
    let corner = |(a, b)| [DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)];
    rectangle.into_iter().flat_map(corner).map(DVec3::normalize).collect()
}

/// The triples of vertices that are neighbours of each other.
fn triangles(vertices: &[DVec3]) -> Vec<Triangle> {
    let n = vertices.len() as u32;
    let near = |i: u32, j: u32| vertices[i as usize].dot(vertices[j as usize]) > 0.4;
    let outward =
        |[a, b, c]: [u32; 3]| vertices[a as usize].cross(vertices[b as usize]).dot(vertices[c as usize]) > 0.0;
    (0..n)
        .flat_map(|a| (a + 1..n).flat_map(move |b| (b + 1..n).map(move |c| [a, b, c])))
        .filter(|&[a, b, c]| near(a, b) && near(b, c) && near(c, a))
        .map(|[a, b, c]| triangle_of(if outward([a, b, c]) { [a, b, c] } else { [a, c, b] }, vertices))
        .collect()
}

fn triangle_of(corners: [u32; 3], vertices: &[DVec3]) -> Triangle {
    let at = corners.map(|v| vertices[v as usize]);
    Triangle { corners, lengths: [0, 1, 2].map(|i| (at[(i + 1) % 3] + at[(i + 2) % 3]).length()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Solid angle of a triangle (Van Oosterom and Strackee 1983).
    fn area([a, b, c]: [DVec3; 3]) -> f64 {
        2.0 * a.cross(b).dot(c).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    }

    #[test]
    fn triangles_cover_the_sphere_once() {
        for level in 0..5 {
            let sphere = Icosphere::new(level);
            assert_eq!(sphere.vertices.len(), count(level));
            assert_eq!(sphere.triangles().count(), 20 << (2 * level));
            let mut total = 0.0;
            for corners in sphere.triangles() {
                let found = area(corners.map(|v| sphere.vertices[v as usize]));
                assert!(found > 0.0, "{corners:?} runs clockwise");
                total += found;
            }
            // Roundings of 5120 terms.
            assert!((total - 4.0 * PI).abs() < 1e-11, "level {level}: {total}");
            let sum: DVec3 = sphere.vertices.iter().sum();
            assert!(sum.length() < 1e-11, "{sum}");
        }
    }

    #[test]
    fn a_direction_lies_in_its_triangle() {
        let sphere = Icosphere::new(3);
        let triangles: Vec<_> = sphere.triangles().collect();
        let check = |d: DVec3| {
            let Place { triangle, weights } = sphere.locate(d);
            let corners = triangles[triangle].map(|v| sphere.vertices[v as usize]);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14 && weights.iter().all(|&w| w >= 0.0));
            let point: DVec3 = corners.iter().zip(weights).map(|(&v, w)| v * w).sum();
            // Coordinates are good to a few roundings.
            assert!(point.normalize().distance(d) < 1e-13, "{d}: {point}");
        };
        for i in 0..5000 {
            let i = f64::from(i);
            check(DVec3::new((1.3 * i).sin(), (2.1 * i + 0.4).sin(), (0.7 * i - 1.0).cos()).normalize());
        }
        for (k, &v) in sphere.vertices.iter().enumerate() {
            check(v);
            let Place { triangle, weights } = sphere.locate(v);
            let held = triangles[triangle].iter().zip(weights).any(|(&c, w)| c as usize == k && w > 1.0 - 1e-13);
            assert!(held, "vertex {k} is a corner of its triangle");
        }
        assert!(sphere.locate(DVec3::NAN).triangle < triangles.len());
    }
}
