//! Sparse grids as devices hold them: bricks behind an index, made without laying the grid out.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{I64Vec3, IVec3, UVec3};
use rayon::prelude::*;

use super::{BRICK, Grid, IndexBox, Storage, Tile};
use crate::device::BrickLayout;

/// A sparse grid in the bricks of a [`BrickLayout`]. Blocks begin at the first voxel of the medium's box, whatever the
/// bricks of the grid begin at. What stored bricks and tiles touch is looked at, and nothing else; a block that holds one
/// value takes no brick of its own. Texels are made when they are asked for.
#[derive(Debug)]
pub struct Bricks {
    grid: Arc<Grid>,
    window: IndexBox,
    /// The brick of each block, x fastest.
    index: Vec<u32>,
    /// The values of the first bricks.
    constants: Vec<f32>,
    /// What the others hold.
    mixed: Vec<Mixed>,
    /// Which tiles reach into a block without filling it, by block and in the grid's order.
    reaching: Vec<(u32, u32)>,
    /// The stored bricks by origin.
    stored: HashMap<IVec3, u32>,
}

/// A block of more values than one: its number, and what lies under the tiles and bricks that reach into it.
#[derive(Clone, Copy, Debug)]
struct Mixed {
    block: u32,
    under: f32,
}

/// Blocks of a box of voxels.
#[derive(Clone, Copy)]
struct Blocks {
    dims: I64Vec3,
    blocks: I64Vec3,
}

impl Blocks {
    fn of(dims: UVec3) -> Self {
        let blocks = UVec3::from(BrickLayout::blocks(dims.to_array()));
        Self { dims: dims.as_i64vec3(), blocks: blocks.as_i64vec3() }
    }

    /// First and last voxel of a block's brick that the box holds.
    fn span(&self, at: I64Vec3) -> (I64Vec3, I64Vec3) {
        let first = at * i64::from(BrickLayout::BLOCK);
        (first, (first + i64::from(BrickLayout::BLOCK)).min(self.dims - 1))
    }

    fn place(&self, block: u32) -> I64Vec3 {
        let n = i64::from(block);
        let I64Vec3 { x, y, .. } = self.blocks;
        I64Vec3::new(n % x, n / x % y, n / x / y)
    }

    /// Visits every block whose brick a cube of voxels from `from` to before `end` touches, and whether it fills the
    /// brick.
    fn touched(&self, from: I64Vec3, end: I64Vec3, mut visit: impl FnMut(u32, bool)) {
        if from.cmpge(self.dims).any() || end.cmple(I64Vec3::ZERO).any() {
            return;
        }
        let block = i64::from(BrickLayout::BLOCK);
        let first = (from - 1).div_euclid(I64Vec3::splat(block)).max(I64Vec3::ZERO);
        let last = ((end - 1) / block).min(self.blocks - 1);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    let (low, high) = self.span(I64Vec3::new(x, y, z));
                    let fills = from.cmple(low).all() && end.cmpgt(high).all();
                    visit(((z * self.blocks.y + y) * self.blocks.x + x) as u32, fills);
                }
            }
        }
    }
}

/// Set in the state of a block of more values than one; the rest is the number of the constant under them.
const MIXED: u32 = 1 << 31;
/// The most blocks: an index of 256 MiB.
const MOST_BLOCKS: u64 = 1 << 26;

impl Bricks {
    /// The bricks of what a grid says in a box. None of a grid that is stored dense, or whose stored bricks do not begin at
    /// multiples of their side, and of a box whose index alone would take more than 256 MiB.
    pub(super) fn of(grid: &Arc<Grid>, window: IndexBox) -> Option<Self> {
        let Storage::Sparse { background, bricks, tiles } = grid.storage() else { return None };
        let count = BrickLayout::index_bytes(window.dims.to_array()) / 4;
        if count > MOST_BLOCKS || bricks.iter().any(|b| b.origin.rem_euclid(IVec3::splat(BRICK)) != IVec3::ZERO) {
            return None;
        }
        let blocks = Blocks::of(window.dims);
        let mut constants = Constants::default();
        let mut states = vec![constants.number(*background); count as usize];
        let mut reaching = Vec::new();
        let within = |origin: IVec3| origin.as_i64vec3() - window.min.as_i64vec3();
        for (n, &Tile { origin, side, value }) in (0..).zip(tiles) {
            let (from, number) = (within(origin), constants.number(value));
            blocks.touched(from, from + i64::from(side), |block, fills| match &mut states[block as usize] {
                state if fills && *state & MIXED == 0 => *state = number,
                state => {
                    *state |= MIXED;
                    reaching.push((block, n));
                }
            });
        }
        for brick in bricks {
            let from = within(brick.origin);
            blocks.touched(from, from + i64::from(BRICK), |block, _| states[block as usize] |= MIXED);
        }
        reaching.sort_by_key(|&(block, _)| block);
        let under = |state: u32| constants.values[(state & !MIXED) as usize];
        let touched = (0..).zip(&states).filter(|(_, state)| *state & MIXED != 0);
        let touched: Vec<_> = touched.map(|(block, &state)| Mixed { block, under: under(state) }).collect();
        let stored = (0..).zip(bricks).map(|(n, brick)| (brick.origin, n)).collect();
        let mut made = Self {
            grid: Arc::clone(grid),
            window,
            index: states,
            constants: Vec::new(),
            mixed: Vec::new(),
            reaching,
            stored,
        };
        // Many a block that a stored brick touches holds nothing but its background.
        let single: Vec<Option<f32>> = touched.par_iter().map(|block| made.single(block)).collect();
        for (block, single) in touched.iter().zip(&single) {
            match single {
                Some(value) => made.index[block.block as usize] = constants.number(*value),
                None => made.mixed.push(*block),
            }
        }
        made.constants = constants.values;
        for (block, number) in made.mixed.iter().zip(made.constants.len() as u32..) {
            made.index[block.block as usize] = number;
        }
        Some(made)
    }

    /// How many bricks there are.
    pub fn layout(&self) -> BrickLayout {
        let constants = self.constants.len() as u32;
        BrickLayout { bricks: constants + self.mixed.len() as u32, constants }
    }

    /// The brick of each block, x fastest.
    pub fn index(&self) -> &[u32] {
        &self.index
    }

    /// Writes the 9³ texels of brick `number`, x fastest.
    pub fn fill(&self, number: u32, out: &mut [f32]) {
        match self.constants.get(number as usize) {
            Some(&value) => out.fill(value),
            None => self.fill_block(&self.mixed[number as usize - self.constants.len()], out),
        }
    }

    /// The value of a block that holds one.
    fn single(&self, block: &Mixed) -> Option<f32> {
        let mut texels = [0.0; BrickLayout::TEXELS];
        self.fill_block(block, &mut texels);
        texels.iter().all(|v| v.to_bits() == texels[0].to_bits()).then_some(texels[0])
    }

    fn fill_block(&self, &Mixed { block, under }: &Mixed, out: &mut [f32]) {
        const SIDE: usize = BrickLayout::SIDE as usize;
        let Storage::Sparse { bricks, tiles, .. } = self.grid.storage() else { return };
        let blocks = Blocks::of(self.window.dims);
        let (first, last) = blocks.span(blocks.place(block));
        let min = self.window.min.as_i64vec3();
        let (low, high) = (first + min, last + min);
        out.fill(under);
        // Copies the rows that a cube from `origin` on shares with the brick.
        let mut lay = |origin: I64Vec3, side: i64, row: &dyn Fn(I64Vec3, &mut [f32])| {
            let (a, b) = (origin.max(low), (origin + side - 1).min(high));
            for z in a.z..=b.z {
                for y in a.y..=b.y {
                    let at = I64Vec3::new(a.x, y, z);
                    let I64Vec3 { x, y, z } = at - low;
                    let place = (z as usize * SIDE + y as usize) * SIDE + x as usize;
                    row(at - origin, &mut out[place..][..(b.x + 1 - a.x).max(0) as usize]);
                }
            }
        };
        let reaching = &self.reaching[self.reaching.partition_point(|(b, _)| *b < block)..];
        for &(_, tile) in reaching.iter().take_while(|(b, _)| *b == block) {
            let Tile { origin, side, value } = tiles[tile as usize];
            lay(origin.as_i64vec3(), side.into(), &|_, row| row.fill(value));
        }
        let brick = i64::from(BRICK);
        let start = low.div_euclid(I64Vec3::splat(brick)) * brick;
        for z in (start.z..=high.z).step_by(BRICK as usize) {
            for y in (start.y..=high.y).step_by(BRICK as usize) {
                for x in (start.x..=high.x).step_by(BRICK as usize) {
                    let origin = I64Vec3::new(x, y, z);
                    let Some(&n) = self.stored.get(&origin.as_ivec3()) else { continue };
                    let values = &bricks[n as usize].values;
                    lay(origin, brick, &|I64Vec3 { x, y, z }, row| {
                        let from = ((z * brick + y) * brick + x) as usize;
                        row.copy_from_slice(&values[from..][..row.len()]);
                    });
                }
            }
        }
        // What lies past the box repeats its last voxels.
        let held = (last - first).as_u64vec3();
        let [x, y, z] = held.to_array().map(|n| n as usize);
        for plane in out.chunks_exact_mut(SIDE * SIDE).take(z + 1) {
            for row in plane.chunks_exact_mut(SIDE).take(y + 1) {
                let edge = row[x];
                row[x..].fill(edge);
            }
            for past in y + 1..SIDE {
                plane.copy_within(y * SIDE..(y + 1) * SIDE, past * SIDE);
            }
        }
        for past in z + 1..SIDE {
            out.copy_within(z * SIDE * SIDE..(z + 1) * SIDE * SIDE, past * SIDE * SIDE);
        }
    }
}

/// Values that fill blocks, numbered as they come.
#[derive(Default)]
struct Constants {
    values: Vec<f32>,
    numbers: HashMap<u32, u32>,
}

impl Constants {
    fn number(&mut self, value: f32) -> u32 {
        *self.numbers.entry(value.to_bits()).or_insert_with(|| {
            self.values.push(value);
            self.values.len() as u32 - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::media::Brick;

    /// A sparse grid whose bricks hold values of their own places.
    fn grid(background: f32, origins: &[[i32; 3]], tiles: Vec<Tile>, bounds: IndexBox) -> Arc<Grid> {
        let brick = |(n, &origin): (usize, &[i32; 3])| {
            let mut values = Box::new([0.0f32; 512]);
            values.iter_mut().enumerate().for_each(|(i, v)| *v = (n * 512 + i) as f32);
            Brick { origin: IVec3::from(origin), values }
        };
        let bricks = origins.iter().enumerate().map(brick).collect();
        Arc::new(Grid::new(bounds, DAffine3::IDENTITY, Storage::Sparse { background, bricks, tiles }).unwrap())
    }

    fn tile(origin: [i32; 3], side: u32, value: f32) -> Tile {
        Tile { origin: IVec3::from(origin), side, value }
    }

    /// Every texel of every brick is that of the grid laid out, clamped at the edge of the box.
    fn agree(grid: &Arc<Grid>, window: IndexBox) -> Bricks {
        let bricks = Bricks::of(grid, window).unwrap();
        let [nx, ny, nz] = window.dims.to_array().map(|d| d as usize);
        let mut dense = vec![0.0; nx * ny * nz];
        for (k, slice) in dense.chunks_exact_mut(nx * ny).enumerate() {
            grid.write_slice(window, window.min.z + k as i32, slice);
        }
        let [bx, by, bz] = BrickLayout::blocks(window.dims.to_array()).map(|b| b as usize);
        assert_eq!(bricks.index().len(), bx * by * bz);
        let mut texels = vec![f32::NAN; BrickLayout::TEXELS];
        for (n, &number) in bricks.index().iter().enumerate() {
            let (bi, bj, bk) = (n % bx, n / bx % by, n / bx / by);
            bricks.fill(number, &mut texels);
            for (at, &v) in texels.iter().enumerate() {
                let i = (bi * 8 + at % 9).min(nx - 1);
                let j = (bj * 8 + at / 9 % 9).min(ny - 1);
                let k = (bk * 8 + at / 81).min(nz - 1);
                assert_eq!(v, dense[(k * ny + j) * nx + i], "texel {at} of block {n}");
            }
        }
        bricks
    }

    #[test]
    fn bricks_are_the_grid_over_seams_and_edges() {
        let window = IndexBox { min: IVec3::new(-13, 3, -6), dims: UVec3::new(37, 21, 30) };
        // Beside each other, at the edge of the box, past it, and alone.
        let origins = [[-8, 8, 0], [0, 8, 0], [-8, 8, 8], [16, 16, 16], [-16, 0, -8], [24, 24, 24], [1 << 20, 0, 0]];
        let grid = grid(0.25, &origins, Vec::new(), window);
        let bricks = agree(&grid, window);
        let BrickLayout { bricks: count, constants } = bricks.layout();
        assert_eq!(bricks.constants, [0.25]);
        // 5 × 3 × 4 blocks, of which some are background alone.
        assert!(count - constants < 60 && bricks.index().contains(&0), "{count}");
    }

    #[test]
    fn boxes_of_a_few_voxels_fit_one_brick() {
        for dims in [UVec3::ONE, UVec3::new(8, 1, 3), UVec3::new(9, 2, 8), UVec3::new(1, 17, 2)] {
            let window = IndexBox { min: IVec3::new(3, -2, 5), dims };
            agree(&grid(0.0, &[[0, 0, 0], [8, 0, 0], [0, -8, 8]], Vec::new(), window), window);
        }
    }

    #[test]
    fn tiles_fill_blocks_and_share_constants() {
        let window = IndexBox { min: IVec3::new(-3, -3, -3), dims: UVec3::new(70, 40, 45) };
        let tiles = vec![
            tile([-128, -128, -128], 128, 2.0),
            tile([0, 0, 0], 32, 0.5),
            tile([8, 8, 8], 8, 0.0),
            tile([0, 0, 32], 128, 0.5),
            // Over what was mixed, and over a tile.
            tile([0, 0, 0], 24, 2.0),
        ];
        let grid = grid(0.0, &[[40, 16, 16], [16, 16, 32]], tiles, window);
        let bricks = agree(&grid, window);
        assert_eq!(bricks.constants, [0.0, 2.0, 0.5]);
        let shared = bricks.index().iter().filter(|&&n| n < 3).count();
        // Blocks within the large tiles and of the background share three bricks.
        assert!(shared > 100, "{shared}");
        assert_eq!(bricks.layout().bricks as usize, 3 + bricks.index().len() - shared);
    }

    #[test]
    fn a_brick_of_the_background_takes_none() {
        let bounds = IndexBox { min: IVec3::ZERO, dims: UVec3::splat(24) };
        let brick = Brick { origin: IVec3::splat(8), values: Box::new([0.5; 512]) };
        let storage = Storage::Sparse { background: 0.5, bricks: vec![brick], tiles: Vec::new() };
        let grid = Arc::new(Grid::new(bounds, DAffine3::IDENTITY, storage).unwrap());
        assert_eq!(agree(&grid, bounds).layout(), BrickLayout { bricks: 1, constants: 1 });
    }

    #[test]
    fn what_is_dense_or_off_its_places_or_too_wide_has_none() {
        let bounds = IndexBox { min: IVec3::ZERO, dims: UVec3::splat(9) };
        let dense = Grid::dense(UVec3::ONE, DAffine3::IDENTITY, vec![1.0]).unwrap();
        assert!(Bricks::of(&Arc::new(dense), bounds).is_none());
        assert!(Bricks::of(&grid(0.0, &[[4, 0, 0]], Vec::new(), bounds), bounds).is_none());
        let wide = IndexBox { dims: UVec3::splat(1 << 30), ..bounds };
        assert!(Bricks::of(&grid(0.0, &[[8, 0, 0]], Vec::new(), bounds), wide).is_none());
    }
}
