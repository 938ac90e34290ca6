//! Coarser copies of grids.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3, IVec3};
use rayon::iter::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};
use rayon::slice::ParallelSliceMut;

use super::MediumError;
use super::grid::{BRICK, Brick, Grid, IndexBox, Storage, Tile};

/// Values of a brick.
type Values = Box<[f32; 512]>;

impl Grid {
    /// Voxels along each axis that [`Grid::coarsened`] can make one of.
    pub const COARSER: [u32; 3] = [2, 4, 8];

    /// A copy in which `side` voxels along each axis are one, whose value is their mean. Voxel c of it covers the indices from
    /// c · `side` on, whatever the bounds, so that grids that shared a map still do. Where the bounds cut such a voxel, the mean
    /// is of what lies within: the new bounds reach up to `side` - 1 of the old voxels further. What is sparse stays sparse.
    ///
    /// # Errors
    /// A `side` that is none of [`Grid::COARSER`]; tiles of a sparse grid that begin or end within such a voxel (those of .vdb
    /// files do not).
    pub fn coarsened(&self, side: u32) -> Result<Self, MediumError> {
        if !Self::COARSER.contains(&side) {
            return Err(MediumError::Coarse(format!("{side} voxels cannot be made one; 2, 4 or 8 can")));
        }
        let side = side as i32;
        let IndexBox { min, dims } = self.bounds();
        let first = min.map(|i| i.div_euclid(side));
        let last = (min.as_i64vec3() + dims.as_i64vec3() - 1).map(|i| i.div_euclid(side.into()));
        let bounds = IndexBox { min: first, dims: (last - first.as_i64vec3() + 1).as_uvec3() };
        let middle = DAffine3::from_translation(DVec3::splat(0.5 * f64::from(side - 1)));
        let to_world = self.index_to_world() * middle * DAffine3::from_scale(DVec3::splat(side.into()));
        let storage = match self.storage() {
            Storage::Dense(values) => Storage::Dense(means(values, self.bounds(), bounds, side)),
            Storage::Sparse { background, bricks, tiles } => {
                let tiles = tiles.iter().map(|tile| coarse_tile(tile, side)).collect::<Result<Vec<_>, _>>()?;
                let bricks = coarse_bricks(*background, bricks, &tiles, side);
                Storage::Sparse { background: *background, bricks, tiles }
            }
        };
        Self::new(bounds, to_world, storage)
    }
}

/// Means of what lies within the grid.
fn means(values: &[f32], fine: IndexBox, coarse: IndexBox, side: i32) -> Vec<f32> {
    let [nx, ny, nz] = fine.dims.to_array().map(|n| n as usize);
    let [cx, cy, cz] = coarse.dims.to_array().map(|n| n as usize);
    let side = side as usize;
    // How many voxels of the first coarse one lie before the grid.
    let before = (fine.min - coarse.min * side as i32).as_uvec3().to_array().map(|n| n as usize);
    let within = |c: usize, axis: usize, n: usize| {
        (c * side).max(before[axis]) - before[axis]..((c + 1) * side - before[axis]).min(n)
    };
    let mut out = vec![0.0; cx * cy * cz];
    out.par_chunks_exact_mut(cx).enumerate().for_each(|(row, out)| {
        let (ys, zs) = (within(row % cy, 1, ny), within(row / cy, 2, nz));
        let mut sums = vec![0.0f64; cx];
        for z in zs.clone() {
            for y in ys.clone() {
                let line = &values[(z * ny + y) * nx..][..nx];
                for (c, sum) in sums.iter_mut().enumerate() {
                    *sum += line[within(c, 0, nx)].iter().map(|&v| f64::from(v)).sum::<f64>();
                }
            }
        }
        for (c, (out, sum)) in out.iter_mut().zip(&sums).enumerate() {
            *out = (sum / (within(c, 0, nx).len() * ys.len() * zs.len()) as f64) as f32;
        }
    });
    out
}

fn coarse_tile(tile: &Tile, side: i32) -> Result<Tile, MediumError> {
    if tile.origin.map(|i| i.rem_euclid(side)) != IVec3::ZERO || !tile.side.is_multiple_of(side as u32) {
        let place = tile.origin.to_array();
        return Err(MediumError::Coarse(format!(
            "a tile of {} voxels a side at {place:?} does not divide into cubes of {side}",
            tile.side
        )));
    }
    Ok(Tile { origin: tile.origin / side, side: tile.side / side as u32, ..*tile })
}

/// A brick of the grid is whole voxels of one of these.
fn coarse_bricks(background: f32, bricks: &[Brick], tiles: &[Tile], side: i32) -> Vec<Brick> {
    let home = |p: IVec3| p.map(|i| i.div_euclid(BRICK) * BRICK);
    // By place, so that the order does not depend on a hash.
    let mut parts: BTreeMap<[i32; 3], Vec<&Brick>> = BTreeMap::new();
    for brick in bricks {
        parts.entry(home(brick.origin / side).to_array()).or_default().push(brick);
    }
    let parts: Vec<_> = parts.into_iter().collect();
    let all = parts.par_iter().map(|(origin, bricks)| {
        let origin = IVec3::from(*origin);
        let mut values: Values = Box::new([background; 512]);
        for tile in tiles {
            cover(&mut values, origin, tile);
        }
        for brick in bricks {
            shrink(&mut values, brick.origin / side - origin, brick, side);
        }
        Brick { origin, values }
    });
    all.collect()
}

/// Writes a tile's value where it lies in a brick.
fn cover(values: &mut Values, origin: IVec3, tile: &Tile) {
    let from = tile.origin.as_i64vec3() - origin.as_i64vec3();
    let within = |v: i64| v.clamp(0, BRICK.into()) as usize;
    let [xs, ys, zs] = from.to_array().map(|a| within(a)..within(a + i64::from(tile.side)));
    for z in zs {
        for y in ys.clone() {
            values[(z * 8 + y) * 8..][..8][xs.clone()].fill(tile.value);
        }
    }
}

/// Writes the means of a brick at a place of a coarser one.
fn shrink(values: &mut Values, at: IVec3, brick: &Brick, side: i32) {
    let (at, side) = (at.to_array().map(|i| i as usize), side as usize);
    let count = 8 / side;
    for place in (0..count * count * count).map(|n| [n % count, n / count % count, n / count / count]) {
        let [x, y, z] = place.map(|c| c * side);
        let lines = (0..side * side).map(|r| ((z + r / side) * 8 + y + r % side) * 8 + x);
        let sum: f64 = lines.flat_map(|from| &brick.values[from..][..side]).map(|&v| f64::from(v)).sum();
        values[((at[2] + place[2]) * 8 + at[1] + place[1]) * 8 + at[0] + place[0]] =
            (sum / (side * side * side) as f64) as f32;
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;

    /// Means of the values that `grid` has within its bounds, of `side`³ voxels from `side` times each index of `bounds` on.
    fn by_definition(grid: &Grid, bounds: IndexBox, side: u32) -> Vec<f32> {
        let fine = grid.bounds();
        let slice = |z: i32| {
            let mut out = vec![0.0; (fine.dims.x * fine.dims.y) as usize];
            grid.write_slice(fine, z, &mut out);
            out
        };
        let slices: Vec<_> = (0..fine.dims.z as i32).map(|k| slice(fine.min.z + k)).collect();
        let d = bounds.dims;
        let mean = |n: u32| {
            let c = bounds.min + IVec3::new((n % d.x) as i32, (n / d.x % d.y) as i32, (n / d.x / d.y) as i32);
            let (mut sum, mut count) = (0.0, 0.0);
            for m in 0..side.pow(3) {
                let within = UVec3::new(m % side, m / side % side, m / side / side).as_ivec3();
                let p = c * side as i32 + within - fine.min;
                if p.cmpge(IVec3::ZERO).all() && p.as_uvec3().cmplt(fine.dims).all() {
                    sum += f64::from(slices[p.z as usize][(p.y * fine.dims.x as i32 + p.x) as usize]);
                    count += 1.0;
                }
            }
            (sum / count) as f32
        };
        (0..d.element_product()).map(mean).collect()
    }

    fn all(grid: &Grid) -> Vec<f32> {
        let bounds = grid.bounds();
        let mut out = vec![0.0; bounds.volume() as usize];
        let slice = (bounds.dims.x * bounds.dims.y) as usize;
        for (k, out) in out.chunks_exact_mut(slice).enumerate() {
            grid.write_slice(bounds, bounds.min.z + k as i32, out);
        }
        out
    }

    #[test]
    fn voxels_are_means_of_what_lies_in_them_and_stay_where_it_lay() {
        let bounds = IndexBox { min: IVec3::new(-3, 5, 0), dims: UVec3::new(7, 4, 9) };
        let values: Vec<f32> = (0..bounds.volume()).map(|i| ((i * 37) % 101) as f32).collect();
        let map =
            DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)) * DAffine3::from_scale(DVec3::new(0.5, 0.25, 2.0));
        let grid = Grid::new(bounds, map, Storage::Dense(values)).unwrap();
        for (side, min, dims) in [(2, [-2, 2, 0], [4, 3, 5]), (4, [-1, 1, 0], [2, 2, 3]), (8, [-1, 0, 0], [2, 2, 2])] {
            let coarse = grid.coarsened(side).unwrap();
            assert_eq!(coarse.bounds(), IndexBox { min: min.into(), dims: dims.into() });
            assert_eq!(all(&coarse), by_definition(&grid, coarse.bounds(), side));
            // The corner of a voxel is the corner of the first one in it.
            let corner = DVec3::splat(-0.5);
            let at = coarse.index_to_world().transform_point3(DVec3::new(3.0, -2.0, 1.0) + corner);
            let fine = grid.index_to_world().transform_point3(DVec3::new(3.0, -2.0, 1.0) * f64::from(side) + corner);
            assert!((at - fine).length() < 1e-12, "{at} {fine}");
        }
    }

    #[test]
    fn what_is_sparse_stays_sparse_and_says_the_same() {
        let values = |seed: usize| Box::new(std::array::from_fn(|i| ((i * 31 + seed) % 17) as f32));
        let brick = |seed: usize, origin: [i32; 3]| Brick { origin: origin.into(), values: values(seed) };
        let bricks = vec![brick(1, [-8, 0, 8]), brick(2, [0, 0, 8]), brick(3, [8, 16, -16]), brick(4, [120, 0, 0])];
        let tiles = vec![
            Tile { origin: IVec3::new(-8, 8, 8), side: 8, value: 5.0 },
            Tile { origin: IVec3::new(0, 0, 0), side: 128, value: 2.0 },
        ];
        let bounds = IndexBox { min: IVec3::new(-16, -16, -16), dims: UVec3::new(144, 40, 32) };
        let storage = Storage::Sparse { background: 0.5, bricks, tiles };
        let grid = Grid::new(bounds, DAffine3::IDENTITY, storage).unwrap();
        for side in Grid::COARSER {
            let coarse = grid.coarsened(side).unwrap();
            assert_eq!(all(&coarse), by_definition(&grid, coarse.bounds(), side), "{side}");
            let Storage::Sparse { bricks, tiles, .. } = coarse.storage() else { panic!("it was laid out") };
            assert!(bricks.len() <= 4 && tiles.len() == 2);
        }
    }

    #[test]
    fn what_cannot_be_divided_is_refused_with_words() {
        let grid = Grid::dense(UVec3::ONE, DAffine3::IDENTITY, vec![1.0]).unwrap();
        assert_eq!(grid.coarsened(3).unwrap_err().to_string(), "3 voxels cannot be made one; 2, 4 or 8 can");
        let tiles = vec![Tile { origin: IVec3::new(4, 0, -4), side: 4, value: 1.0 }];
        let storage = Storage::Sparse { background: 0.0, bricks: Vec::new(), tiles };
        let bounds = IndexBox { min: IVec3::ZERO, dims: UVec3::splat(8) };
        let grid = Grid::new(bounds, DAffine3::IDENTITY, storage).unwrap();
        assert!(grid.coarsened(4).is_ok());
        let told = grid.coarsened(8).unwrap_err().to_string();
        assert_eq!(told, "a tile of 4 voxels a side at [4, 0, -4] does not divide into cubes of 8");
    }
}
