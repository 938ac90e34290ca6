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
