//! Sums of Gaussians.

use std::sync::OnceLock;

use glam::{DVec3, UVec3};

use super::{Bins, DensitySource, Lattice, Medium, MediumError, demand, demand_density};
use crate::Version;

/// One Gaussian: β(x) = c exp(-a² |x - b|²) (Giroud and Biri 2011, equation 1; there the words for a and c are
/// exchanged).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// b, in metres.
    pub center: DVec3,
    /// Inverse width, 1/m: at a distance of 1/a the value has fallen to 1/e.
    pub a: f64,
    /// Value at the centre, in units of density.
    pub c: f64,
}

impl Gaussian {
    /// Inverse widths that f32 holds squared.
    const WIDTHS: std::ops::RangeInclusive<f64> = 1e-15..=1e15;

    /// The value at a point.
    pub fn at(&self, p: DVec3) -> f64 {
        self.c * (-(self.a * self.a) * (p - self.center).length_squared()).exp()
    }

    fn check(&self) -> Result<(), MediumError> {
        let off = self.center.to_array().into_iter().find(|v| !v.is_finite());
        demand("center", off.unwrap_or(0.0), "finite", off.is_none())?;
        demand("a", self.a, "from 1e-15 to 1e15 (1/m)", Self::WIDTHS.contains(&self.a))?;
        demand_density("c", self.c)
    }
}

/// A medium whose density is a sum of Gaussians (equation 2 of the paper), sampled on a lattice.
///
/// Every Gaussian is cut off where it has fallen to ε/N, with N their number: what is cut off at any point is less
/// than ε together. ε is [`Gaussians::CUT`] of the largest amplitude on devices, [`Gaussians::HOST_CUT`] of it in
/// [`Medium::density_slice`].
#[derive(Debug)]
pub struct Gaussians {
    lattice: Lattice,
    blobs: Vec<Gaussian>,
    bins: OnceLock<Bins>,
    version: Version,
}

impl Gaussians {
    /// ε on devices, as a share of the largest amplitude.
    pub const CUT: f64 = 1e-5;
    /// ε on the host, as a share of the largest amplitude: below the rounding of its output.
    pub const HOST_CUT: f64 = 1e-9;
    /// The most Gaussians.
    pub const MOST: usize = 1 << 24;

    /// The sum of `blobs` on `lattice`; none is a medium of density zero.
    ///
    /// # Errors
    /// More than [`Gaussians::MOST`]; a centre that is not finite, an a out of 10⁻¹⁵ to 10¹⁵ or a c that no density
    /// has, each with the number of the Gaussian; amplitudes whose sum no density has.
    pub fn new(blobs: Vec<Gaussian>, lattice: Lattice) -> Result<Self, MediumError> {
        let count = blobs.len();
        demand("a sum of Gaussians, whose number is", count as f64, "at most 16777216", count <= Self::MOST)?;
        for (number, blob) in blobs.iter().enumerate() {
            blob.check().map_err(|error| MediumError::Gaussian { number, error: Box::new(error) })?;
        }
        demand_density("the sum of all c,", blobs.iter().map(|b| b.c).sum())?;
        Ok(Self { lattice, blobs, bins: OnceLock::new(), version: Version::fresh() })
    }

    /// Other Gaussians on the same lattice, as when they move: a medium of a new version.
    ///
    /// # Errors
    /// As [`Gaussians::new`].
    pub fn with(&self, blobs: Vec<Gaussian>) -> Result<Self, MediumError> {
        Self::new(blobs, self.lattice.clone())
    }

    /// The Gaussians.
    pub fn blobs(&self) -> &[Gaussian] {
        &self.blobs
    }

    /// The whole sum at a point of the world, nothing cut off.
    pub fn at(&self, p: DVec3) -> f64 {
        self.blobs.iter().map(|b| b.at(p)).sum()
    }

    /// The largest amplitude, or 0.
    pub fn largest(&self) -> f64 {
        self.blobs.iter().map(|b| b.c).fold(0.0, f64::max)
    }

    /// Distances in metres at which each Gaussian has fallen to `share` · the largest amplitude / N; negative where it
    /// is below that everywhere.
    pub fn radii(&self, share: f64) -> Vec<f64> {
        let least = share * self.largest() / self.blobs.len() as f64;
        let radius = |b: &Gaussian| if b.c > least { (b.c / least).ln().sqrt() / b.a } else { -1.0 };
        self.blobs.iter().map(radius).collect()
    }

    /// The lists that devices sum over: made when they are first asked for, and kept.
    pub fn bins(&self) -> &Bins {
        self.bins.get_or_init(|| Bins::new(&self.lattice, &self.blobs, &self.radii(Self::CUT)))
    }

    /// Adds a Gaussian to slice `k`, as far as its box reaches.
    fn add(&self, blob: &Gaussian, radius: f64, k: u32, sums: &mut [f64], orthogonal: bool) {
        let dims = self.lattice.dims();
        let to_index = self.lattice.world_to_index();
        let at = to_index.transform_point3(blob.center);
        let range = |axis: usize| {
            let half = to_index.matrix3.row(axis).length() * radius;
            let last = f64::from(dims[axis]);
            // Casting makes 0 of what is negative or not a number.
            (at[axis] - half).ceil().min(last) as u32..(at[axis] + half + 1.0).floor().min(last) as u32
        };
        if radius < 0.0 || !range(2).contains(&k) {
            return;
        }
        let place = |i: u32, j: u32| self.lattice.index_to_world().transform_point3(UVec3::new(i, j, k).as_dvec3());
        let columns = range(0);
        if orthogonal {
            // The exponential of a sum along three axes is a product of three.
            let edges = self.lattice.edges() * blob.a;
            let share = |axis: usize, n: u32| (-((f64::from(n) - at[axis]) * edges[axis]).powi(2)).exp();
            let across: Vec<f64> = columns.clone().map(|i| share(0, i)).collect();
            let level = blob.c * share(2, k);
            for j in range(1) {
                let height = level * share(1, j);
                let row = &mut sums[j as usize * dims.x as usize + columns.start as usize..];
                row.iter_mut().zip(&across).for_each(|(sum, e)| *sum += height * e);
            }
        } else {
            for j in range(1) {
                for i in columns.clone() {
                    sums[j as usize * dims.x as usize + i as usize] += blob.at(place(i, j));
                }
            }
        }
    }
}

impl Medium for Gaussians {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        let mut sums = vec![0.0; out.len()];
        let orthogonal = self.lattice.is_orthogonal();
        for (blob, radius) in self.blobs.iter().zip(self.radii(Self::HOST_CUT)) {
            self.add(blob, radius, k, &mut sums, orthogonal);
        }
        out.iter_mut().zip(sums).for_each(|(place, sum)| *place = sum as f32);
    }

    fn source(&self) -> DensitySource<'_> {
        DensitySource::Gaussians(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3};
    use proptest::prelude::*;

    fn slanted() -> Lattice {
        let m = DMat3::from_cols(DVec3::new(0.08, 0.01, 0.0), DVec3::new(0.03, 0.1, 0.02), DVec3::Z * 0.12);
        Lattice::new(UVec3::new(9, 13, 7), DAffine3::from_mat3_translation(m, DVec3::new(-0.5, -0.4, -0.3))).unwrap()
    }

    fn straight() -> Lattice {
        let (min, max) = (DVec3::new(-0.5, -0.4, -0.3), DVec3::new(0.4, 0.8, 0.5));
        Lattice::in_box(UVec3::new(9, 13, 7), min, max).unwrap()
    }

    fn blob() -> impl Strategy<Value = Gaussian> {
        let coordinate = || -1.0..1.0f64;
        ((coordinate(), coordinate(), coordinate()), -1.0..4.0f64, -12.0..2.0f64)
            .prop_map(|((x, y, z), a, c)| Gaussian { center: DVec3::new(x, y, z), a: a.exp2(), c: c.exp2() })
    }

    proptest! {
        #[test]
        fn what_is_cut_off_is_less_than_said(blobs in prop::collection::vec(blob(), 1..40), which: bool) {
            let lattice = if which { slanted() } else { straight() };
            let medium = Gaussians::new(blobs, lattice.clone()).unwrap();
            let (d, bins, map) = (lattice.dims(), medium.bins(), lattice.index_to_world());
            let mut slice = vec![0.0; (d.x * d.y) as usize];
            for k in 0..d.z {
                medium.density_slice(k, &mut slice);
                for (n, &found) in slice.iter().enumerate() {
                    let index = UVec3::new(n as u32 % d.x, n as u32 / d.x, k);
                    let p = map.transform_point3(index.as_dvec3());
                    let whole = medium.at(p);
                    // Half a unit in the last place of f32 beside what is cut off.
                    let host = (f64::from(found) - whole).abs();
                    prop_assert!(host <= Gaussians::HOST_CUT * medium.largest() + 6e-8 * whole, "{host:e}");
                    let bin = index.map(|i| (i / Bins::BRICK) >> bins.shift);
                    let bin = ((bin.z * bins.dims.y + bin.y) * bins.dims.x + bin.x) as usize;
                    let list = &bins.list[bins.starts[bin] as usize..bins.starts[bin + 1] as usize];
                    let listed: f64 = list.iter().map(|&i| medium.blobs()[i as usize].at(p)).sum();
                    prop_assert!(whole - listed <= Gaussians::CUT * medium.largest(), "{:e}", whole - listed);
                    prop_assert!(whole - listed >= -1e-12 * whole);
                }
            }
        }
    }

    #[test]
    fn a_wide_blob_is_nowhere_cut_and_a_narrow_one_may_miss_every_sample() {
        let of = |a, c| Gaussian { center: DVec3::new(0.01, 0.02, 0.03), a, c };
        let medium = Gaussians::new(vec![of(1e-15, 2.0), of(1e15, 3.0)], straight()).unwrap();
        let mut slice = vec![0.0; 9 * 13];
        medium.density_slice(3, &mut slice);
        assert!(slice.iter().all(|v| *v == 2.0));
        assert_eq!(medium.bins().list, [0, 0, 0, 0]);
    }

    #[test]
    fn none_is_empty_and_other_blobs_are_another_version() {
        let none = Gaussians::new(Vec::new(), straight()).unwrap();
        let mut slice = vec![1.0; 9 * 13];
        none.density_slice(0, &mut slice);
        assert!(slice.iter().all(|v| *v == 0.0) && none.largest() == 0.0);
        let moved = none.with(vec![Gaussian { center: DVec3::ZERO, a: 3.0, c: 1.0 }]).unwrap();
        assert!(moved.version() != none.version() && moved.lattice() == none.lattice());
    }

    #[test]
    fn numbers_out_of_range_are_named_with_their_blob() {
        let good = Gaussian { center: DVec3::ZERO, a: 3.0, c: 1e14 };
        for (bad, what) in [
            (Gaussian { center: DVec3::new(0.0, f64::NAN, 0.0), ..good }, "Gaussian 1: center"),
            (Gaussian { a: 0.0, ..good }, "Gaussian 1: a 0"),
            (Gaussian { a: f64::INFINITY, ..good }, "Gaussian 1: a inf"),
            (Gaussian { c: -1.0, ..good }, "Gaussian 1: c -1"),
            (Gaussian { c: 1e15, ..good }, "the sum of all c,"),
        ] {
            let error = Gaussians::new(vec![good, bad], straight()).unwrap_err();
            assert!(error.to_string().starts_with(what), "{error}");
        }
    }
}
