//! Grids, dense or as the bricks and tiles of a sparse tree.

use glam::{DAffine3, DVec3, IVec3, UVec3};

use super::{Lattice, Medium, MediumError, in_range};
use crate::Version;

/// Voxels along each side of a [`Brick`].
pub const BRICK: i32 = 8;

/// A box of integer indices: the first index, and how many follow along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndexBox {
    /// The lowest index.
    pub min: IVec3,
    /// Indices along each axis.
    pub dims: UVec3,
}

impl IndexBox {
    /// The smallest box that holds both.
    pub fn union(self, other: Self) -> Self {
        let min = self.min.min(other.min);
        let end = |b: Self| b.min.as_i64vec3() + b.dims.as_i64vec3();
        let dims = (end(self).max(end(other)) - min.as_i64vec3()).as_uvec3();
        Self { min, dims }
    }

    /// The number of indices in the box.
    pub fn volume(self) -> u64 {
        u64::from(self.dims.x).saturating_mul(self.dims.y.into()).saturating_mul(self.dims.z.into())
    }
}

/// 8³ values of a sparse grid, x fastest; `origin` is a multiple of [`BRICK`] along each axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Brick {
    /// Index of the first voxel.
    pub origin: IVec3,
    /// The values, x fastest.
    pub values: Box<[f32; 512]>,
}

/// A cube of one value in a sparse grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Index of the first voxel.
    pub origin: IVec3,
    /// Voxels along each side.
    pub side: u32,
    /// The value of all of them.
    pub value: f32,
}

/// How the values of a [`Grid`] are held.
#[derive(Clone, Debug, PartialEq)]
pub enum Storage {
    /// One value a voxel, x fastest.
    Dense(Vec<f32>),
    /// Bricks and tiles over a background. What they leave out has the background's value.
    Sparse {
        /// The value of everything else.
        background: f32,
        /// 8³ blocks of values.
        bricks: Vec<Brick>,
        /// Cubes of one value.
        tiles: Vec<Tile>,
    },
}

/// A scalar field on integer indices with a map to the world, as files hold it. Values are not judged here:
/// a medium does that when it is made.
#[derive(Clone, Debug)]
pub struct Grid {
    bounds: IndexBox,
    index_to_world: DAffine3,
    storage: Storage,
}

impl Grid {
    /// A grid whose samples fill `bounds`; `index_to_world` takes a sample's integer index to its centre, in metres.
    ///
    /// # Errors
    /// Sides of zero or that overflow; for dense storage, a number of values that is not the number of voxels.
    pub fn new(bounds: IndexBox, index_to_world: DAffine3, storage: Storage) -> Result<Self, MediumError> {
        let end = bounds.min.as_i64vec3() + bounds.dims.as_i64vec3();
        if bounds.dims.min_element() == 0 || end.max_element() > i64::from(i32::MAX) {
            let d = bounds.dims;
            return Err(MediumError::Dims { x: d.x.into(), y: d.y.into(), z: d.z.into() });
        }
        if let Storage::Dense(values) = &storage
            && values.len() as u64 != bounds.volume()
        {
            return Err(MediumError::Length { expected: bounds.volume(), found: values.len() as u64 });
        }
        Ok(Self { bounds, index_to_world, storage })
    }

    /// A dense grid whose first index is zero.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn dense(dims: UVec3, index_to_world: DAffine3, values: Vec<f32>) -> Result<Self, MediumError> {
        Self::new(IndexBox { min: IVec3::ZERO, dims }, index_to_world, Storage::Dense(values))
    }

    /// The integer indices that the grid covers.
    pub fn bounds(&self) -> IndexBox {
        self.bounds
    }

    /// Takes an integer index to the centre of its voxel, in metres.
    pub fn index_to_world(&self) -> DAffine3 {
        self.index_to_world
    }

    /// The same values, placed in the world by another map.
    pub fn placed_by(self, index_to_world: DAffine3) -> Self {
        Self { index_to_world, ..self }
    }

    /// The values as they are held.
    pub fn storage(&self) -> &Storage {
        &self.storage
    }

    /// Bytes of memory that the values take.
    pub fn bytes(&self) -> u64 {
        match &self.storage {
            Storage::Dense(v) => v.len() as u64 * 4,
            Storage::Sparse { bricks, tiles, .. } => (bricks.len() * 2080 + tiles.len() * size_of::<Tile>()) as u64,
        }
    }

    /// Visits every stored value with the index of (the first voxel of) it: each voxel of dense grids and bricks,
    /// each tile, and the background last, at the first index. Values outside the bounds are left out.
    pub(super) fn check(
        &self,
        mut visit: impl FnMut(IVec3, f32) -> Result<(), MediumError>,
    ) -> Result<(), MediumError> {
        let IndexBox { min, dims } = self.bounds;
        let inside = |p: IVec3| (p - min).cmpge(IVec3::ZERO).all() && (p - min).as_uvec3().cmplt(dims).all();
        match &self.storage {
            Storage::Dense(values) => {
                let row = dims.x as usize;
                for (n, line) in values.chunks_exact(row).enumerate() {
                    let (j, k) = ((n % dims.y as usize) as i32, (n / dims.y as usize) as i32);
                    for (i, &v) in line.iter().enumerate() {
                        visit(min + IVec3::new(i as i32, j, k), v)?;
                    }
                }
            }
            Storage::Sparse { background, bricks, tiles } => {
                for brick in bricks {
                    for (n, &v) in brick.values.iter().enumerate() {
                        let p = brick.origin + IVec3::new(n as i32 & 7, (n as i32 >> 3) & 7, n as i32 >> 6);
                        if inside(p) {
                            visit(p, v)?;
                        }
                    }
                }
                for tile in tiles {
                    visit(tile.origin, tile.value)?;
                }
                visit(min, *background)?;
            }
        }
        Ok(())
    }

    /// Writes the values of the `dims.x · dims.y` indices from (`window.min.x`, `window.min.y`, `z`) on, x fastest.
    /// Outside the bounds of a dense grid the value is zero, of a sparse one its background.
    pub fn write_slice(&self, window: IndexBox, z: i32, out: &mut [f32]) {
        let (w, h) = (window.dims.x as usize, window.dims.y as usize);
        assert_eq!(out.len(), w * h, "a slice holds one value for each index of the window");
        // The part of [origin, origin + side) that lies in the window, as offsets in the window.
        let clip = |origin: i32, side: i64, from: i32, n: usize| {
            let a = (i64::from(origin) - i64::from(from)).clamp(0, n as i64) as usize;
            let b = (i64::from(origin) + side - i64::from(from)).clamp(0, n as i64) as usize;
            a..b
        };
        let covers =
            |origin: i32, side: i64| i64::from(z) >= i64::from(origin) && i64::from(z) < i64::from(origin) + side;
        match &self.storage {
            Storage::Dense(values) => {
                out.fill(0.0);
                let (IndexBox { min, dims }, d) = (self.bounds, self.bounds.dims.as_i64vec3());
                if !covers(min.z, d.z) {
                    return;
                }
                let xs = clip(min.x, d.x, window.min.x, w);
                if xs.is_empty() {
                    return;
                }
                for y in clip(min.y, d.y, window.min.y, h) {
                    let j = (window.min.y - min.y) as i64 + y as i64;
                    let i = (window.min.x - min.x) as i64 + xs.start as i64;
                    let from = ((i64::from(z - min.z) * d.y + j) * d.x + i) as usize;
                    debug_assert!(j < i64::from(dims.y));
                    out[y * w..][xs.clone()].copy_from_slice(&values[from..][..xs.len()]);
                }
            }
            Storage::Sparse { background, bricks, tiles } => {
                out.fill(*background);
                for t in tiles.iter().filter(|t| covers(t.origin.z, t.side.into())) {
                    let xs = clip(t.origin.x, t.side.into(), window.min.x, w);
                    for y in clip(t.origin.y, t.side.into(), window.min.y, h) {
                        out[y * w..][xs.clone()].fill(t.value);
                    }
                }
                for b in bricks.iter().filter(|b| covers(b.origin.z, BRICK.into())) {
                    let xs = clip(b.origin.x, BRICK.into(), window.min.x, w);
                    if xs.is_empty() {
                        continue;
                    }
                    for y in clip(b.origin.y, BRICK.into(), window.min.y, h) {
                        let j = window.min.y + y as i32 - b.origin.y;
                        let i = window.min.x + xs.start as i32 - b.origin.x;
                        let from = (((z - b.origin.z) * BRICK + j) * BRICK + i) as usize;
                        out[y * w..][xs.clone()].copy_from_slice(&b.values[from..][..xs.len()]);
                    }
                }
            }
        }
    }
}

/// A box of one density: a grid of a single voxel, whose clamped lookup is constant.
#[derive(Clone, Debug)]
pub struct Homogeneous {
    lattice: Lattice,
    density: f32,
    version: Version,
}

impl Homogeneous {
    /// Steps across the shortest side of the box that one `step` is measured against.
    const STEPS: f64 = 64.0;

    /// A box from `min` to `max` (metres) of constant `density`.
    ///
    /// # Errors
    /// A box without volume; a density that is negative, not finite or above [`LARGEST`](super::LARGEST).
    pub fn new(density: f32, min: DVec3, max: DVec3) -> Result<Self, MediumError> {
        if !in_range(density) {
            return Err(MediumError::Density { value: density, x: 0, y: 0, z: 0 });
        }
        Ok(Self { lattice: Lattice::in_box(UVec3::ONE, min, max)?, density, version: Version::fresh() })
    }
}

impl Medium for Homogeneous {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, _: u32, out: &mut [f32]) {
        out.fill(self.density);
    }

    fn voxel(&self) -> f64 {
        self.lattice.shortest_edge() / Self::STEPS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(dims: UVec3, min: IVec3) -> Grid {
        let n = dims.element_product();
        let values = (0..n).map(|i| i as f32).collect();
        Grid::new(IndexBox { min, dims }, DAffine3::IDENTITY, Storage::Dense(values)).unwrap()
    }

    #[test]
    fn a_window_cuts_and_pads() {
        let grid = ramp(UVec3::new(3, 2, 2), IVec3::new(-1, 5, 0));
        let window = IndexBox { min: IVec3::new(0, 4, 0), dims: UVec3::new(3, 3, 2) };
        let mut out = vec![9.0; 9];
        grid.write_slice(window, 1, &mut out);
        assert_eq!(out, [0.0, 0.0, 0.0, 7.0, 8.0, 0.0, 10.0, 11.0, 0.0]);
        grid.write_slice(window, 2, &mut out);
        assert_eq!(out, [0.0; 9]);
        let beside = IndexBox { min: IVec3::new(40, 5, 0), ..window };
        grid.write_slice(beside, 1, &mut out);
        assert_eq!(out, [0.0; 9]);
    }

    #[test]
    fn bricks_and_tiles_are_cut_to_the_window() {
        let mut values = Box::new([0.0f32; 512]);
        values[511] = 3.0;
        let storage = Storage::Sparse {
            background: 0.5,
            bricks: vec![Brick { origin: IVec3::new(-8, -8, -8), values }],
            tiles: vec![Tile { origin: IVec3::ZERO, side: 4096, value: 2.0 }],
        };
        let bounds = IndexBox { min: IVec3::splat(-2), dims: UVec3::splat(3) };
        let grid = Grid::new(bounds, DAffine3::IDENTITY, storage).unwrap();
        let mut out = vec![0.0; 9];
        grid.write_slice(bounds, -1, &mut out);
        assert_eq!(out, [0.0, 0.0, 0.5, 0.0, 3.0, 0.5, 0.5, 0.5, 0.5]);
        grid.write_slice(bounds, 0, &mut out);
        assert_eq!(out, [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 2.0]);
        let beside = IndexBox { min: IVec3::new(1, -2, -2), ..bounds };
        grid.write_slice(beside, -1, &mut out);
        assert_eq!(out, [0.5; 9]);
    }
}
