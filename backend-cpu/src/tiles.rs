//! `march` over the cores: blocks of the film, and which packets of pixels they are.

use std::ops::Range;

use airlight_core::device::DeviceError;
use airlight_core::stage::March;
use rayon::prelude::*;

use crate::Isa;
use crate::device::Memory;
use crate::film::{Film, Pixels, SIDE};
use crate::inputs::Inputs;
use crate::isa::compiled_for;
use crate::kernels::march::march;

const BLOCK: usize = March::BLOCK as usize;
/// Blocks along each side of what a task takes, at the most.
const TILE: usize = 4;
/// Tasks of a thread from which on they are as large.
const TASKS: usize = 4;

/// Runs blocks of the stage.
pub(crate) fn run(stage: &March, range: Range<u32>, memory: &mut Memory<'_>, isa: Isa) -> Result<(), DeviceError> {
    memory.take(stage.film)?;
    if let Some(paths) = stage.paths {
        memory.take(paths)?;
    }
    let (out, read) = memory.split();
    let (inputs, p) = (Inputs::new(stage, read)?, &stage.params);
    let mut out = out.into_iter();
    let film = &Film::new(out.next(), out.next(), [p.width, p.height]);
    let [across, down] = [p.width, p.height].map(|n| (n as usize).div_ceil(BLOCK));
    // A task takes blocks that lie together: their rays see the same part of the medium.
    let tiles = |side| [across.div_ceil(side), down.div_ceil(side)];
    let enough = TASKS * rayon::current_num_threads();
    let side = (1..=TILE).rev().find(|&side| tiles(side).iter().product::<usize>() >= enough).unwrap_or(1);
    let [columns, rows] = tiles(side);
    (0..columns * rows).into_par_iter().for_each(|tile| {
        let corner = [tile % columns * side, tile / columns * side];
        for y in corner[1]..(corner[1] + side).min(down) {
            for x in corner[0]..(corner[0] + side).min(across) {
                if range.contains(&((y * across + x) as u32)) {
                    block(&inputs, isa, [x * BLOCK, y * BLOCK], film);
                }
            }
        }
    });
    Ok(())
}

/// Marches the pixels of a block whose first one is `corner`, into the film.
fn block(inputs: &Inputs<'_>, isa: Isa, corner: [usize; 2], film: &Film<'_>) {
    let more = inputs.p.sample_begin > 0 || inputs.p.step_begin > 0;
    for packet in 0..(BLOCK / SIDE) * (BLOCK / SIDE) {
        let place = [corner[0] + packet % (BLOCK / SIDE) * SIDE, corner[1] + packet / (BLOCK / SIDE) * SIDE];
        // SAFETY: every pixel is of one block, and every block of one task.
        #[allow(unsafe_code)]
        let mut pixels = if more { unsafe { film.load(place) } } else { Pixels::default() };
        let out = &mut pixels;
        compiled_for!(isa, march<S>(inputs: &Inputs<'_>, place: [usize; 2], out: &mut Pixels));
        // SAFETY: as above.
        #[allow(unsafe_code)]
        unsafe {
            film.store(place, &pixels);
        }
    }
}
