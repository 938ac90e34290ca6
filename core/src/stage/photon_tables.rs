//! Tables of the stage [`Photons`](super::Photons): the directions that photons come from with what each light makes of them,
//! and what their paths choose from.

use std::f64::consts::PI;

use glam::DVec3;

use super::path_tables::bends;
use super::{PhaseParams, PhotonDirection, PhotonParams};
use crate::basis::recurrence_table;
use crate::media::{Lattice, Phase};

/// Directions of one set that some of the lights come from.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotonTable {
    /// The directions that any light has a weight for.
    pub directions: Vec<PhotonDirection>,
    /// Their weights, a direction's one behind the other: the number of a light, and b_k(ω).
    pub weights: Vec<[f32; 2]>,
    /// Directions of the whole set.
    all: u32,
    /// The most weights of a direction.
    most: u32,
}

impl PhotonTable {
    /// Of a set of unit directions ω toward the source, of equal solid angles, around the box of `lattice`. `weights` gives, for the
    /// number of a direction and ω, the numbers of the lights below `lights` and b_k(ω), where that is not 0: each light once at the most.
    ///
    /// A wall lets in what it sees of the light: in proportion to its area times the cosine. Photons are shared among the
    /// three walls that ω sees by that, and lie evenly on each, so that none leaves at once; this has the mean of photons that are spread over
    /// all walls and directions and count with area and cosine (eq. 11 and 12 of Zhang, Dong, Ma 2013), and less noise.
    ///
    /// # Panics
    /// Where `weights` gives the number of a light that is not below `lights`.
    pub fn new(
        lattice: &Lattice,
        set: &[DVec3],
        lights: u32,
        mut weights: impl FnMut(usize, DVec3, &mut Vec<(u32, f64)>),
    ) -> Self {
        let volume = lattice.index_to_world().matrix3.determinant().abs() * lattice.dims().as_dvec3().element_product();
        let mut table = Self { directions: Vec::new(), weights: Vec::new(), all: set.len() as u32, most: 0 };
        let mut found = Vec::new();
        for (number, &toward) in set.iter().enumerate() {
            found.clear();
            weights(number, toward, &mut found);
            found.retain(|&(_, value)| value != 0.0);
            if found.is_empty() {
                continue;
            }
            // In edges of the box: a wall's area times the cosine is the box's volume times that across the wall.
            let across = lattice.world_to_index().transform_vector3(toward) / lattice.dims().as_dvec3();
            let areas = volume * across.abs();
            let seen = areas.element_sum();
            let power = 4.0 * PI * seen;
            table.directions.push(PhotonDirection {
                toward: toward.as_vec3().extend(power as f32).to_array(),
                first: (areas.x / seen) as f32,
                second: ((areas.x + areas.y) / seen) as f32,
                number: number as u32,
                weights: table.weights.len() as u32,
                count: found.len() as u32,
                unused_0: 0,
                unused_1: 0,
                unused_2: 0,
            });
            table.most = table.most.max(found.len() as u32);
            for &(light, value) in &found {
                assert!(light < lights, "light {light} of {lights}");
                table.weights.push([light as f32, value as f32]);
            }
        }
        table
    }

    /// Says in the parameters how many directions there are, and how many weights at the most.
    pub fn place(&self, params: &mut PhotonParams) {
        (params.directions, params.listed, params.weights) = (self.all, self.directions.len() as u32, self.most);
    }
}

/// What [`Photons::tables`](super::Photons::tables) hold for so many bands and a phase function; says in the parameters where.
pub fn photon_tables(bands: u32, phase: &Phase, params: &mut PhotonParams) -> Vec<f32> {
    let mut values = recurrence_table(bands);
    let of = PhaseParams::new(phase);
    (params.bands, params.phase_kind, params.phase) = (bands, of.kind, of.lobes);
    (params.phase_at, params.phase_size) = (values.len() as u32, of.table.len() as u32);
    params.bends_at = params.phase_at + params.phase_size;
    values.extend(of.table);
    if let Phase::Table(table) = phase {
        values.extend(bends(table.values()));
    }
    values
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DMat3, UVec3};

    use super::*;
    use crate::basis::healpix;

    #[test]
    fn walls_share_what_enters_by_their_areas() {
        let edges = DMat3::from_cols(DVec3::new(0.5, 0.1, 0.0), DVec3::new(0.0, 0.3, 0.2), DVec3::new(-0.1, 0.0, 0.4));
        let lattice = Lattice::new(UVec3::new(3, 4, 2), DAffine3::from_mat3(edges)).unwrap();
        let set = healpix::directions(4);
        let table = PhotonTable::new(&lattice, &set, 1, |i, _, out| {
            if i % 3 > 0 {
                out.push((0, 0.5));
            }
        });
        assert_eq!(table.directions.len(), 128);
        let [a, b, c] = [3.0 * edges.x_axis, 4.0 * edges.y_axis, 2.0 * edges.z_axis];
        for of in &table.directions {
            let toward = set[of.number as usize];
            let areas = [b.cross(c), c.cross(a), a.cross(b)].map(|wall| wall.dot(toward).abs());
            let seen: f64 = areas.iter().sum();
            assert!((f64::from(of.toward[3]) / (4.0 * PI * seen) - 1.0).abs() < 1e-6);
            assert!((f64::from(of.first) - areas[0] / seen).abs() < 1e-6);
            assert!((f64::from(of.second) - (areas[0] + areas[1]) / seen).abs() < 1e-6);
            assert_eq!((of.count, table.weights[of.weights as usize]), (1, [0.0, 0.5]));
        }
        // All of it: the mean area that a convex body shows is a quarter of its surface.
        let all = PhotonTable::new(&lattice, &set, 1, |_, _, out| out.push((0, 1.0)));
        let mean = all.directions.iter().map(|of| f64::from(of.toward[3])).sum::<f64>() / 192.0;
        let surface = 2.0 * (b.cross(c).length() + c.cross(a).length() + a.cross(b).length());
        assert!((mean / (PI * surface) - 1.0).abs() < 0.01, "{mean} {surface}");
    }
}
