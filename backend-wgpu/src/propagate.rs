//! `propagate` by kernels that share its work axis: one integrates in all cells of some lights, others take the steps, and one lays the
//! output out. Where a dispatch costs more than a step, a workgroup takes the items of a light in order.

use std::ops::Range;

use airlight_core::stage::{PropagateParams, Stage};

use crate::WgpuDevice;
use crate::part::Part;
use crate::source::ABREAST;

/// The entry point that integrates.
pub(crate) const PIECES: &str = "propagate_pieces";
/// The entry point that takes steps in order.
pub(crate) const IN_ORDER: &str = "propagate_in_order";
/// The entry point that lays the output out.
pub(crate) const OUTPUT: &str = "propagate_output";

/// Items of a light's step from which on threads share them, in place of one of them that takes steps in order: then they are worth a
/// dispatch, and what lights hold leaves the caches of a core.
const MANY: u32 = 8192;

impl WgpuDevice {
    /// The parts of a range of units.
    pub(crate) fn propagate_parts(&self, stage: &Stage, p: &PropagateParams, range: Range<u32>) -> Vec<Part> {
        let step = |unit: u32| unit.clamp(p.integrated(), p.finished());
        let steps = step(range.start)..step(range.end);
        let lights = range.start..range.end.min(steps.start);
        let mut parts = Vec::new();
        // Kernels count the cells of lights in 32 bits.
        parts.extend(chunks(lights, (u32::MAX / p.count()).max(1)).map(|lights| pieces(stage, p, lights)));
        match self.steps_at_once(p) {
            Some(most) => parts.extend(chunks(steps, most).map(|steps| in_order(stage, p, steps))),
            None if steps.is_empty() => {}
            None => parts.push(Part::of(stage, steps)),
        }
        parts.extend((range.end > p.finished()).then(|| output(stage, p)));
        parts
    }

    /// Steps that a workgroup takes in order, on drivers that run on processors, where they are small: as many as the turns of loops
    /// allow for.
    fn steps_at_once(&self, p: &PropagateParams) -> Option<u32> {
        let items = p.items / p.lights;
        let turns = u64::from(items / ABREAST + 2);
        // Loops turn once more before they end.
        let most = self.info.limits.loop_turns.map_or(u64::MAX, |most| most.saturating_sub(1).into()) / turns;
        (self.texels && items < MANY && most > 0).then(|| most.try_into().unwrap_or(u32::MAX))
    }
}

/// A range cut into some of at most so many units.
fn chunks(range: Range<u32>, most: u32) -> impl Iterator<Item = Range<u32>> {
    let end = range.end;
    range.step_by(most as usize).map(move |start| start..end.min(start.saturating_add(most)))
}

fn pieces(stage: &Stage, p: &PropagateParams, lights: Range<u32>) -> Part {
    let mut part = Part::of(stage, 0..1);
    part.sequential = Some(p.count() * lights.len() as u32);
    (part.name, part.axis, part.steps) = (PIECES, 1, Some(lights));
    part
}

fn output(stage: &Stage, p: &PropagateParams) -> Part {
    let mut part = Part::of(stage, 0..1);
    part.sequential = Some(p.count() * p.cells[3]);
    (part.name, part.axis) = (OUTPUT, 1);
    part
}

fn in_order(stage: &Stage, p: &PropagateParams, steps: Range<u32>) -> Part {
    let mut part = Part::of(stage, 0..p.lights);
    (part.name, part.axis, part.steps, part.sequential) = (IN_ORDER, p.lights, Some(steps), None);
    part
}
