//! `sweep`: light along many directions at the cells of a coarse grid, each from its neighbours upwind, and its moments.
//!
//! Directions ω point toward the source. For each, the planes of cells across its longest component (in cells) follow each
//! other from the source on. The ray from a cell's centre X meets the plane before at Y, one cell on along that axis and
//! fractions of a cell along the other two. With the extinction σ halfway between that of X and that of Y, the way's length
//! ℓ, τ = σ ℓ, and the source functions S of X and Y,
//!
//! L(X) = e^-τ L(Y) + ∫ S e^-s ds + ℓ (1 - e^-τ)/τ · j,
//!
//! with S linear in s from S(X) at 0 to S(Y) at τ and j halfway between the emissions (short characteristics; Kunasz and
//! Auer 1988). Extinction, radiance, source and emission at Y are bilinear between the four cells around it. Beyond the box
//! nothing is extinct or shines and the radiance is `boundary`; a cell's source stands for its neighbours beyond the plane's
//! edge, and X's for a whole plane beyond the box: constant sources then leave 1 - e^-τ, at walls too.
//!
//! A neighbour behind a surface, as `obstructed` says (see [`Obstruct`](super::Obstruct)), sends nothing: its radiance is 0, and
//! X's own extinction, source and emission stand for its.
//!
//! S(x)\[c\] = albedo\[c\] · Σ_k `source_weights`\[i\]\[k\] · `sources`\[k\]\[c\] of the cell, for direction i: the weights hold
//! the phase function's moments and the basis. Without `sources` nothing scatters, and with `boundary` = 1 and no emission L is
//! the transmittance to the wall. The output is
//!
//! M\[k\]\[c\] = Σ_i L_i\[c\] · W\[i\]\[k\]\[c\].
//!
//! Directions are taken in batches, for whose radiance there is a buffer. The work axis is the steps of all batches, in order: for
//! each batch the planes, of all of its directions at a time, and one step that adds its moments. Directions with fewer
//! planes rest at the end.

use glam::DVec3;

use super::{Coarsen, Kernel, require};
use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::media::Lattice;

kernel_struct! {
    /// Parameters of `sweep`.
    pub struct SweepParams {
        /// Cells along x, y, z; the longest of them, which is the steps of a batch but one.
        cells: U32x4,
        /// Directions.
        directions: U32,
        /// Directions of a batch.
        batch: U32,
        /// Cells of the largest plane.
        plane: U32,
        /// Channels of the radiance: 1 or 3.
        channels: U32,
        /// 1 where the extinction of the first channel serves all.
        grey: U32,
        /// 1 where the medium shines.
        emits: U32,
        /// Coefficients of `sources`; 0 for none.
        source_coefficients: U32,
        /// Coefficients of the output.
        coefficients: U32,
        /// Channels of W: 1 or 3.
        weight_channels: U32,
        /// 1 for planes of a value a cell, as `sources`; 0 for records, as [`Project`](super::Project)'s.
        planar: U32,
        /// Radiance that enters the box.
        boundary: F32,
        /// Unused.
        unused: U32,
    }
}

kernel_struct! {
    /// The way from a cell's centre to the plane of cells before.
    pub struct SweepDirection {
        /// The axis that the planes are normal to.
        axis: U32,
        /// Bit a is set where the way leads to lower cells along axis a.
        down: U32,
        /// Metres.
        length: F32,
        /// Cells that it leads along the first of the other two axes, 0 to 1.
        first: F32,
        /// The same along the second of them.
        second: F32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Parameters.
    pub params: SweepParams,
    /// What the cells do to light, from `coarsen`.
    pub optics: Buf<f32>,
    /// The directions.
    pub directions: Buf<SweepDirection>,
    /// Moments of the radiance that is scattered, laid out \[coefficient\]\[channel\]\[cell\].
    pub sources: Option<Buf<f32>>,
    /// What they weigh toward each direction, laid out \[direction\]\[coefficient\].
    pub source_weights: Option<Buf<f32>>,
    /// W, laid out \[direction\]\[coefficient\]\[channel\].
    pub weights: Buf<f32>,
    /// Which neighbours of a cell lie behind surfaces, from `obstruct`.
    pub obstructed: Option<Buf<u32>>,
    /// Room for L of a batch, laid out \[direction\]\[channel\]\[cell\] where a device keeps it there: nobody else may read it.
    pub radiance: Buf<f32>,
    /// M, laid out \[coefficient\]\[channel\]\[cell\], or \[cell\]\[coefficient\]\[channel\].
    pub moments: Buf<f32>,
}

impl SweepDirection {
    /// Toward ω, over `cells` cells of the box of `lattice`.
    pub fn new(toward: DVec3, lattice: &Lattice, cells: [u32; 3]) -> Self {
        let u = lattice.world_to_index().transform_vector3(toward) * DVec3::from(cells.map(f64::from))
            / lattice.dims().as_dvec3();
        let way = u.abs();
        let axis = (0..3).fold(0, |best, a| if way[a] > way[best] { a } else { best });
        let [b, c] = Self::others(axis);
        let down = (0..3).map(|a| u32::from(u[a] < 0.0) << a).sum();
        Self {
            axis: axis as u32,
            down,
            length: (1.0 / way[axis]) as f32,
            first: (way[b] / way[axis]) as f32,
            second: (way[c] / way[axis]) as f32,
            unused_0: 0,
            unused_1: 0,
            unused_2: 0,
        }
    }

    /// The other two axes, in order.
    pub const fn others(axis: usize) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][axis]
    }

    /// The bit of [`Obstruct`](super::Obstruct) of the neighbour one plane before, and so many cells on along the first and the second
    /// of the other two axes.
    pub fn bit(&self, first: u32, second: u32) -> u32 {
        let [b, c] = Self::others(self.axis as usize);
        let mut on = [0; 3];
        (on[self.axis as usize], on[b], on[c]) = (1, first, second);
        let [x, y, z] = [0, 1, 2].map(|a| if self.down >> a & 1 == 1 { 1 - on[a] } else { 1 + on[a] });
        z * 9 + y * 3 + x
    }

    /// The plane of so many that step `step` of a batch finishes; none where the direction rests.
    pub fn plane(&self, cells: [u32; 3], step: u32) -> Option<u32> {
        let planes = cells[self.axis as usize];
        // The source stands on the side that the way leads to.
        (step < planes).then(|| if self.down >> self.axis & 1 == 1 { step } else { planes - 1 - step })
    }
}

impl SweepParams {
    /// Cells.
    pub fn count(&self) -> u32 {
        self.cells[..3].iter().product()
    }

    /// Channels of the output.
    pub fn moment_channels(&self) -> u32 {
        self.channels.max(self.weight_channels)
    }

    /// Steps of a batch: its planes, and the one that adds its moments.
    pub fn batch_steps(&self) -> u32 {
        self.cells[3] + 1
    }
}

impl Sweep {
    /// The most turns of all loops of an item.
    fn turns(&self) -> u64 {
        let p = &self.params;
        // X and four cells around Y, each with the coefficients of its sources; or the directions of a batch.
        let plane = 5 * (1 + 3 * u64::from(p.source_coefficients)) + 16;
        plane.max(u64::from(p.batch) * 4 + 4)
    }
}

impl Kernel for Sweep {
    const NAME: &'static str = "sweep";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::read("optics", Some(self.optics)),
            Binding::read("directions", Some(self.directions)),
            Binding::read("sources", self.sources),
            Binding::read("source_weights", self.source_weights),
            Binding::read("weights", Some(self.weights)),
            Binding::read("obstructed", self.obstructed),
            Binding::write("radiance", Some(self.radiance)),
            Binding::write("moments", Some(self.moments)),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.directions.div_ceil(self.params.batch.max(1)).saturating_mul(self.params.batch_steps())
    }

    fn sequential(&self) -> Option<u32> {
        let p = &self.params;
        Some(p.batch.saturating_mul(p.plane).max(p.count().saturating_mul(p.coefficients)))
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let [cells @ .., longest] = p.cells;
        let count = cells.iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(count.is_some_and(|n| n > 0), "{cells:?} cells");
        let [x, y, z] = cells;
        require!(longest == x.max(y).max(z), "{cells:?} cells in {longest} planes");
        require!(p.plane == (y * z).max(x * z).max(x * y), "planes of {} cells of {cells:?}", p.plane);
        require!((1..=p.directions).contains(&p.batch), "{} directions in batches of {}", p.directions, p.batch);
        require!([1, 3].contains(&p.channels) && [1, 3].contains(&p.weight_channels), "channels must be 1 or 3");
        require!(p.coefficients > 0, "moments without coefficients");
        let (cells, n) = (u64::from(p.count()), u64::from(p.directions));
        let (k, s) = (u64::from(p.coefficients), u64::from(p.source_coefficients));
        // Kernels count items and values in 32 bits.
        let values = [cells * u64::from(p.batch) * u64::from(p.channels), cells * k * 3, cells * s * 3, n * k * 3];
        require!(values.iter().all(|v| u32::try_from(*v).is_ok()), "{values:?} values, more than 32 bits count");
        require!(self.optics.len >= cells * u64::from(Coarsen::PLANES), "optics of {} values", self.optics.len);
        require!(self.obstructed.is_none_or(|b| b.len >= cells), "obstructions of fewer than {cells} cells");
        require!(self.directions.len >= n, "{} directions for {n}", self.directions.len);
        require!(self.weights.len >= n * k * u64::from(p.weight_channels), "{} weights", self.weights.len);
        require!(self.radiance.len >= values[0], "{} places for {} of radiance", self.radiance.len, values[0]);
        let moments = cells * k * u64::from(p.moment_channels());
        require!(self.moments.len >= moments, "{} places for {moments} moments", self.moments.len);
        require!(
            s == 0 || self.sources.is_some_and(|b| b.len >= cells * s * u64::from(p.channels)),
            "sources are missing or too few"
        );
        require!(s == 0 || self.source_weights.is_some_and(|b| b.len >= n * s), "weights of sources are missing");
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let own = self.turns();
        require!(
            own <= turns,
            "a cell of a sweep takes up to {own} turns of loops, and {turns} are allowed: fewer bands or smaller batches \
             need less"
        );
        Ok(vec![self.clone()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3, UVec3};

    #[test]
    fn ways_lead_one_cell_on() {
        let linear = DMat3::from_cols(DVec3::X, DVec3::new(0.35, 1.0, 0.1), DVec3::new(-0.2, 0.25, 1.0)) * 0.1;
        let lattice = Lattice::new(UVec3::new(7, 5, 11), DAffine3::from_mat3(linear)).unwrap();
        let cells = [4u32, 3, 6];
        let side = lattice.dims().as_dvec3() / DVec3::from(cells.map(f64::from));
        for toward in crate::basis::healpix::directions(2) {
            let way = SweepDirection::new(toward, &lattice, cells);
            let [b, c] = SweepDirection::others(way.axis as usize);
            let mut on = DVec3::ZERO;
            for (a, by) in [(way.axis as usize, 1.0), (b, way.first), (c, way.second)] {
                assert!((0.0..=1.0).contains(&by), "{way:?}");
                on[a] = if way.down >> a & 1 == 1 { -f64::from(by) } else { f64::from(by) };
            }
            let metres = lattice.index_to_world().transform_vector3(on * side);
            assert!((metres - toward * f64::from(way.length)).length() < 1e-6 * metres.length(), "{toward}: {way:?}");
            // From the source's side on, each plane once.
            let planes: Vec<_> = (0..7).filter_map(|step| way.plane(cells, step)).collect();
            assert_eq!(planes.len(), cells[way.axis as usize] as usize);
            let rises = planes.last() >= planes.first();
            assert_eq!(rises, way.down >> way.axis & 1 == 1 || planes.len() == 1);
        }
    }
}
