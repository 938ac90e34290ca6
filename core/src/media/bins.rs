//! Which Gaussians reach where: lists over bins of a lattice.

use glam::{DVec3, UVec3};

use super::{Gaussian, Lattice};

/// Gaussians sorted into bins of a lattice as compressed rows: the list of bin b holds the numbers
/// `list[starts[b]..starts[b + 1]]`, rising. Bins are cubes of [`Bins::BRICK`] · 2^`shift` voxels, x fastest.
///
/// A Gaussian stands in the list of every bin that has a sample within its radius, so that the sum over a bin's list
/// is the whole sum but for what is cut off beyond the radii.
#[derive(Clone, Debug, PartialEq)]
pub struct Bins {
    /// A bin is 2^shift bricks wide: 0 unless the lists would be too long.
    pub shift: u32,
    /// Bins along x, y and z.
    pub dims: UVec3,
    /// Where each list begins, and the end of the last.
    pub starts: Vec<u32>,
    /// Numbers of Gaussians.
    pub list: Vec<u32>,
    /// Entries of the longest list.
    pub longest: u32,
}

impl Bins {
    /// Voxels along each side of a brick.
    pub const BRICK: u32 = 8;
    /// Entries of all lists, at the most (64 MiB), unless there are more Gaussians than this: bins are doubled until
    /// their lists keep to it.
    pub const ENTRIES: u64 = 1 << 24;

    /// The lists of Gaussians that end at so many metres each. A radius that is negative reaches nothing.
    pub fn new(lattice: &Lattice, blobs: &[Gaussian], radii: &[f64]) -> Self {
        Self::within(lattice, blobs, radii, Self::ENTRIES)
    }

    /// As [`Bins::new`], with bins as wide as `entries` in all ask for.
    pub fn within(lattice: &Lattice, blobs: &[Gaussian], radii: &[f64], entries: u64) -> Self {
        let reaches: Vec<Reach> =
            blobs.iter().zip(radii).map(|(blob, &radius)| Reach::new(lattice, blob, radius)).collect();
        let bricks = lattice.dims().map(|n| n.div_ceil(Self::BRICK));
        let mut shift = 0;
        // Beyond one bin nothing is gained.
        while (bricks.max_element() - 1) >> shift > 0 {
            let boxes = reaches.iter().filter_map(|r| r.bins(lattice.dims(), shift));
            let total = boxes.fold(0u64, |n, [low, high]| {
                let sides = (high - low + 1).as_u64vec3();
                n.saturating_add(sides.x.saturating_mul(sides.y).saturating_mul(sides.z))
            });
            if total <= entries {
                break;
            }
            shift += 1;
        }
        let dims = bricks.map(|n| ((n - 1) >> shift) + 1);
        let orthogonal = lattice.is_orthogonal().then(|| lattice.edges());
        let rows = |visit: &mut dyn FnMut(usize, usize, usize)| {
            for (number, reach) in reaches.iter().enumerate() {
                reach.rows(lattice.dims(), shift, dims, orthogonal, |first, last| visit(number, first, last));
            }
        };
        let mut counts = vec![0u32; dims.as_usizevec3().element_product() + 1];
        rows(&mut |_, first, last| counts[first..=last].iter_mut().for_each(|n| *n += 1));
        let longest = counts.iter().copied().max().unwrap_or(0);
        let mut end = 0;
        let starts: Vec<u32> = counts
            .into_iter()
            .map(|n| {
                end += n;
                end - n
            })
            .collect();
        let mut next = starts.clone();
        let mut list = vec![0; end as usize];
        rows(&mut |number, first, last| {
            for at in &mut next[first..=last] {
                list[*at as usize] = number as u32;
                *at += 1;
            }
        });
        Self { shift, dims, starts, list, longest }
    }
}

/// A Gaussian's sphere in index space.
struct Reach {
    center: DVec3,
    /// Half extents of the box around it, in voxels; negative where it reaches nothing.
    half: DVec3,
    radius: f64,
}

impl Reach {
    fn new(lattice: &Lattice, blob: &Gaussian, radius: f64) -> Self {
        let to_index = lattice.world_to_index();
        let m = to_index.matrix3;
        // Room for the rounding of these lines.
        let radius = radius * (1.0 + 1e-9);
        let half = DVec3::new(m.row(0).length(), m.row(1).length(), m.row(2).length()) * radius;
        Self { center: to_index.transform_point3(blob.center), half, radius }
    }

    /// The first and the last bin of the samples in its box.
    fn bins(&self, dims: UVec3, shift: u32) -> Option<[UVec3; 2]> {
        let [low, high] = self.samples(dims)?;
        let bin = |v: UVec3| v.map(|n| (n / Bins::BRICK) >> shift);
        Some([bin(low), bin(high)])
    }

    /// The first and the last sample in its box.
    fn samples(&self, dims: UVec3) -> Option<[UVec3; 2]> {
        let mut ends = [UVec3::ZERO; 2];
        for a in 0..3 {
            let (first, last) = span(self.center[a], self.half[a], dims[a])?;
            (ends[0][a], ends[1][a]) = (first, last);
        }
        Some(ends)
    }

    /// Visits the rows of bins that it reaches: numbers of the first and the last bin of each. With the edges of a
    /// lattice that is `orthogonal` they follow the sphere, else its box.
    fn rows(
        &self,
        dims: UVec3,
        shift: u32,
        bins: UVec3,
        orthogonal: Option<DVec3>,
        mut visit: impl FnMut(usize, usize),
    ) {
        let Some([low, high]) = self.bins(dims, shift) else { return };
        let side = f64::from(Bins::BRICK << shift);
        // Metres along axis `a` from the centre to the nearest sample of a bin.
        let apart = |a: usize, bin: u32, edge: f64| {
            let first = f64::from(bin) * side;
            let last = (first + side - 1.0).min(f64::from(dims[a] - 1));
            (first - self.center[a]).max(self.center[a] - last).max(0.0) * edge
        };
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let row = (z as usize * bins.y as usize + y as usize) * bins.x as usize;
                let xs = match orthogonal {
                    None => Some((low.x, high.x)),
                    Some(edge) => {
                        let (dy, dz) = (apart(1, y, edge.y), apart(2, z, edge.z));
                        let left = self.radius * self.radius - dy * dy - dz * dz;
                        let half = if left < 0.0 { -1.0 } else { left.sqrt() / edge.x };
                        span(self.center.x, half, dims.x)
                            .map(|(first, last)| ((first / Bins::BRICK) >> shift, (last / Bins::BRICK) >> shift))
                    }
                };
                if let Some((first, last)) = xs {
                    visit(row + first as usize, row + last as usize);
                }
            }
        }
    }
}

/// The samples 0 to n - 1 that lie within `half` of `center`: the first and the last.
fn span(center: f64, half: f64, n: u32) -> Option<(u32, u32)> {
    if half.is_nan() || half < 0.0 {
        return None;
    }
    let first = (center - half).ceil().max(0.0);
    let last = (center + half).floor().min(f64::from(n - 1));
    (first <= last).then_some((first as u32, last as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{hash, unit};
    use glam::{DAffine3, DMat3};

    fn random(n: u32, a: u32) -> f64 {
        unit(hash([n, a, 77])).into()
    }

    fn blobs(n: u32) -> Vec<Gaussian> {
        let center = |i| DVec3::new(random(i, 0), random(i, 1), random(i, 2)) * DVec3::new(5.0, 4.0, 6.0) - 1.0;
        (0..n).map(|i| Gaussian { center: center(i), a: 1.0, c: 1.0 }).collect()
    }

    fn lattices() -> [Lattice; 3] {
        let dims = UVec3::new(41, 20, 27);
        let turned = DMat3::from_rotation_y(0.4) * DMat3::from_diagonal(DVec3::new(0.07, 0.1, 0.15));
        let slanted = DMat3::from_cols(DVec3::new(0.08, 0.01, 0.0), DVec3::new(0.03, 0.1, 0.0), DVec3::Z * 0.12);
        [
            Lattice::in_box(dims, DVec3::ZERO, DVec3::new(3.0, 2.0, 4.0)).unwrap(),
            Lattice::new(dims, DAffine3::from_mat3_translation(turned, DVec3::new(0.1, 0.2, 3.0))).unwrap(),
            Lattice::new(dims, DAffine3::from_mat3(slanted)).unwrap(),
        ]
    }

    /// Whether some sample of a bin lies within the radius.
    fn reaches(lattice: &Lattice, bins: &Bins, bin: usize, blob: &Gaussian, radius: f64) -> bool {
        let d = bins.dims.as_usizevec3();
        let side = (Bins::BRICK << bins.shift) as usize;
        let at = [bin % d.x, bin / d.x % d.y, bin / d.x / d.y];
        let range = |a: usize| at[a] * side..((at[a] + 1) * side).min(lattice.dims()[a] as usize);
        range(2).any(|k| {
            range(1).any(|j| {
                range(0).any(|i| {
                    let p = DVec3::new(i as f64, j as f64, k as f64);
                    lattice.index_to_world().transform_point3(p).distance(blob.center) <= radius
                })
            })
        })
    }

    #[test]
    fn every_bin_lists_what_reaches_it() {
        let blobs = blobs(60);
        let radii: Vec<f64> = (0..60).map(|i| if i == 7 { -1.0 } else { 0.9 * random(i, 3).powi(2) }).collect();
        for (number, lattice) in lattices().iter().enumerate() {
            for entries in [Bins::ENTRIES, 60, 1] {
                let bins = Bins::within(lattice, &blobs, &radii, entries);
                assert!(bins.list.len() as u64 <= entries.max(60), "{} of {entries}", bins.list.len());
                // Without a limit bins are bricks, with room for no entry all is one bin.
                assert!(entries < Bins::ENTRIES || bins.shift == 0);
                assert!(entries > 1 || bins.starts.len() == 2);
                let mut needless = 0;
                for bin in 0..bins.dims.element_product() as usize {
                    let list = &bins.list[bins.starts[bin] as usize..bins.starts[bin + 1] as usize];
                    assert!(list.windows(2).all(|w| w[0] < w[1]));
                    assert!(list.len() <= bins.longest as usize);
                    for (i, blob) in blobs.iter().enumerate() {
                        let listed = list.contains(&(i as u32));
                        let needed = reaches(lattice, &bins, bin, blob, radii[i]);
                        assert!(listed || !needed, "lattice {number}, bin {bin}, blob {i}");
                        needless += usize::from(listed && !needed);
                    }
                }
                // Between samples, and where boxes stand for spheres.
                assert!(needless <= bins.list.len() / 2, "{needless} of {}", bins.list.len());
            }
        }
    }

    #[test]
    fn nothing_is_listed_where_nothing_reaches() {
        let [lattice, ..] = lattices();
        let far = Gaussian { center: DVec3::splat(1e300), a: 1.0, c: 1.0 };
        let bins = Bins::new(&lattice, &[far, far], &[2.0, f64::NAN]);
        assert_eq!((bins.list.len(), bins.longest, bins.starts.len()), (0, 0, 6 * 3 * 4 + 1));
        let bins = Bins::new(&lattice, &[], &[]);
        assert!(bins.starts.iter().all(|s| *s == 0));
    }
}
