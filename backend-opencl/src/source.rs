//! The text of kernels in OpenCL C, put together by [`KernelText`] from the files of `kernels/` and from what is said
//! here: OpenCL C has no globals that point to buffers, so there is a struct `Bound` of all that a stage binds, which
//! the entry point fills.

use std::fmt::Write as _;
use std::ops::Range;

use airlight_core::device::{
    BrickLayout, DeviceError, FieldFormat, Helper, KernelFile, KernelLanguage, KernelStruct, KernelText, Recipe,
};
use airlight_core::kernel_struct;
use airlight_core::stage::{Classify, Coarsen, Inject, March, PropagateParams, Stage, SweepParams};
use bytemuck::Zeroable;

pub(crate) use airlight_core::device::{Shape, ShapeKind};

const OPENCL: KernelLanguage = KernelLanguage::Opencl;

kernel_struct! {
    /// Where a dispatch stands on its stage's work axis.
    pub struct Launch {
        /// First unit.
        start: U32,
        /// Units; of a sequential stage the items of one unit.
        count: U32,
        /// Units of a sequential stage that the dispatch runs one after the other.
        units: U32,
        /// Floats of the scratch memory that each of what shares it has, where the kernel has some.
        room: U32,
    }
}

/// Packets, of whatever width.
const PACKET: &str = include_str!("packet.cl");

/// How many lanes the packets of kernels have that work on packets: one on devices that run scalar work-items side by side,
/// as many as vector registers have elsewhere, or twice as many. Others have one on every device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lanes {
    /// Scalars.
    One,
    /// Vectors of eight.
    Eight,
    /// Vectors of sixteen in kernels that look up fields at every step, so that two registers' lookups are under way at a time,
    /// and of eight in those whose lanes part: walks through triangles above all.
    EightOrSixteen,
    /// Vectors of sixteen.
    Sixteen,
}

impl Lanes {
    /// Their number, where lanes may part.
    pub fn count(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Eight | Self::EightOrSixteen => 8,
            Self::Sixteen => 16,
        }
    }

    /// Their number, where each step looks up fields.
    pub fn looking_up(self) -> u32 {
        match self {
            Self::EightOrSixteen => 16,
            _ => self.count(),
        }
    }
}

macro_rules! file {
    ($name:literal) => {
        KernelFile { name: concat!("kernels/", $name), text: include_str!(concat!("../kernels/", $name)) }
    };
}

fn helper(helper: Helper) -> KernelFile {
    match helper {
        Helper::Field => file!("field.cl"),
        Helper::Maximum => file!("maximum.cl"),
        Helper::Sample => file!("sample.cl"),
        Helper::Angle => file!("angle.cl"),
        Helper::Phase => file!("phase.cl"),
        Helper::Harmonics => file!("harmonics.cl"),
        Helper::Segment => file!("segment.cl"),
        Helper::Noise => file!("noise.cl"),
        Helper::View => file!("view.cl"),
        Helper::Light => file!("light.cl"),
        Helper::Phong => file!("phong.cl"),
        Helper::Mesh => file!("mesh.cl"),
        Helper::Face => file!("face.cl"),
        Helper::Sky => file!("sky.cl"),
        Helper::Random => file!("random.cl"),
        Helper::Walk => file!("walk.cl"),
        Helper::Bend => file!("bend.cl"),
        Helper::Spot => file!("spot.cl"),
    }
}

/// The kernel of a stage.
#[derive(Debug)]
pub(crate) struct Source {
    /// Name of the stage.
    pub(crate) name: &'static str,
    /// Work-items of a unit of the work axis, or of an item of a unit where the stage is sequential: so many for so many.
    items: (u32, u32),
    /// Lanes of its packets.
    pub(crate) width: u32,
    file: KernelFile,
    recipe: Recipe,
}

/// The function of a stage's kernel. OpenCL C has functions of its own of the names of some stages.
pub(crate) fn entry_point(stage: &str) -> String {
    format!("stage_{stage}")
}

/// The kernel of a stage, on a device of so many lanes.
pub(crate) fn of(stage: &Stage, lanes: Lanes) -> Source {
    let (wide, looking_up) = (lanes.count(), lanes.looking_up());
    // A packet an item, of stages that work on packets.
    let packets = |elements: u32| ((elements, wide), wide);
    let looked_up = |elements: u32| ((elements, looking_up), looking_up);
    let scalars = |elements: u32| ((elements, 1), 1);
    // An item a unit, of stages whose packets are runs of texels.
    let rows = ((1, 1), wide.min(BrickLayout::BLOCK));
    let project_chunk = if looking_up > 1 { PROJECT_PACKETS * looking_up } else { 1 };
    let (file, (items, width)) = match stage {
        Stage::Reduce(_) => (file!("reduce.cl"), ((1, 1), wide)),
        Stage::Project(_) => (file!("project.cl"), ((1, project_chunk), looking_up)),
        Stage::Propagate(_) => (file!("propagate.cl"), ((1, 1), wide)),
        Stage::Relight(_) => (file!("relight.cl"), looked_up(1)),
        Stage::March(_) => (file!("march.cl"), looked_up(March::BLOCK * March::BLOCK)),
        Stage::Inject(_) => (
            file!("inject.cl"),
            match lanes {
                Lanes::One => scalars(Inject::BRICK * Inject::BRICK),
                // A brick an item.
                _ => ((1, 1), wide),
            },
        ),
        Stage::Trace(_) => (file!("trace.cl"), packets(1)),
        Stage::Shade(_) => (file!("shade.cl"), packets(1)),
        Stage::Shadow(_) => (file!("shadow.cl"), packets(1)),
        Stage::Upsample(_) => (
            file!("upsample.cl"),
            match lanes {
                Lanes::One => scalars(March::BLOCK * March::BLOCK),
                // A block an item.
                _ => ((1, 1), wide),
            },
        ),
        Stage::Accumulate(_) => (file!("accumulate.cl"), looked_up(March::BLOCK * March::BLOCK)),
        Stage::Coarsen(_) => (file!("coarsen.cl"), rows),
        Stage::Illuminate(_) => (file!("illuminate.cl"), looked_up(1)),
        Stage::Sweep(_) => (file!("sweep.cl"), ((1, 1), looking_up)),
        Stage::Obstruct(_) => (file!("obstruct.cl"), packets(1)),
        Stage::Path(_) => (file!("path.cl"), scalars(1)),
        Stage::Evaluate(evaluate) => (
            file!("evaluate.cl"),
            match lanes {
                Lanes::One => scalars(1),
                _ if evaluate.params.folded == 1 => ((1, 1), wide),
                // Rows of an item.
                _ => ((1, evaluate_rows(wide)), wide),
            },
        ),
        Stage::Reconstruct(_) => (file!("reconstruct.cl"), ((1, reconstruct_cells(lanes)), 1)),
        Stage::Photons(_) => (file!("photons.cl"), scalars(1)),
        Stage::Classify(_) => (file!("classify.cl"), looked_up(Classify::PACK)),
    };
    Source { name: stage.name(), items, width, file, recipe: Recipe::of(stage) }
}

/// A dispatch of a kernel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dispatch {
    pub(crate) launch: Launch,
    /// Units of the work axis that it runs.
    pub(crate) units: u32,
    /// Work-items, or workgroups where they are teams.
    pub(crate) items: u64,
    /// The most work-items of a workgroup, where they are a team.
    pub(crate) team: Option<u32>,
    /// Bytes of memory that the work-items share.
    pub(crate) scratch: u64,
}

/// Work-items of a team where each is a lane.
const TEAM: u32 = 256;

/// Rows that a work-item of `evaluate` goes through together: as many as leave its sums in registers.
fn evaluate_rows(lanes: u32) -> u32 {
    if lanes < 16 { 1 } else { 8 }
}

/// Cells that a work-item of `reconstruct` goes through: some where it is a core's, which keeps what they share.
fn reconstruct_cells(lanes: Lanes) -> u32 {
    if lanes == Lanes::One { 1 } else { 16 }
}

/// Packets of cells from which a work-item of `project` fills its own.
const PROJECT_PACKETS: u32 = 4;

/// Items of a light's step of `propagate` from which on cores share them: as long as the begin of a dispatch takes.
const PROPAGATE_MANY: u32 = 4096;

/// Coefficients that a work-item of `sweep` adds up side by side. As many as there are, a square, are some times four or one more.
const SWEEP_TAKEN: u32 = 4;

/// Values of a cell that are turned: those of optics and of sources.
fn turned_values(p: &SweepParams) -> u32 {
    Coarsen::PLANES + p.source_coefficients * p.channels
}

/// The most slabs of a field: each is an argument of its kernels.
pub(crate) const MAX_SLABS: u32 = 16;

/// What a kernel takes of a binding: type and name of each member of `Bound`.
fn members(shape: &Shape) -> Vec<(String, String)> {
    let (name, element) = (shape.name, shape.element.name(OPENCL));
    let pointer = |name| (format!("__global const {element} *"), name);
    match shape.kind {
        ShapeKind::Read => vec![pointer(name.to_owned()), ("uint ".to_owned(), format!("{name}_words"))],
        ShapeKind::Write => vec![(format!("__global {element} *"), name.to_owned())],
        ShapeKind::Field { slabs, layered, format, bricks } => {
            let held = if matches!(format, FieldFormat::Half { .. }) { "half" } else { element };
            let int = |name| ("int ".to_owned(), name);
            let mut members = Vec::new();
            members.extend(bricks.then(|| ("__global const uint *".to_owned(), format!("{name}_index"))));
            members.extend((0..slabs).map(|slab| (format!("__global const {held} *"), format!("{name}_{slab}"))));
            members.extend(bricks.then(|| int(format!("{name}_constants"))));
            members.extend(layered.then(|| int(format!("{name}_layers"))));
            members.extend((slabs > 1).then(|| int(format!("{name}_per_slab"))));
            members
        }
    }
}

impl Source {
    /// What the next dispatch runs of the units that are left.
    ///
    /// # Errors
    /// More scratch memory than kernels can index.
    pub(crate) fn next(&self, stage: &Stage, units: Range<u32>) -> Result<Dispatch, DeviceError> {
        let launch = Launch { start: units.start, units: 1, ..Launch::zeroed() };
        let ((of, each), sequential) = (self.items, stage.sequential());
        if let Stage::Sweep(sweep) = stage {
            return self.next_sweep(&sweep.params, launch, units.end);
        }
        if let Stage::Propagate(propagate) = stage {
            return Ok(self.next_propagate(&propagate.params, launch, units.end));
        }
        // Units of a sequential stage are dispatches of their own: the queue is in order.
        let count = sequential.unwrap_or(units.len() as u32);
        let items = (u64::from(count) * u64::from(of)).div_ceil(u64::from(each));
        let units = if sequential.is_some() { 1 } else { count };
        // An item of some packets is much work, and some are of empty cells: cores take them one by one.
        let team = (matches!(stage, Stage::Project(_)) && self.width > 1).then_some(1);
        Ok(Dispatch { launch: Launch { count, ..launch }, units, items, team, scratch: 0 })
    }

    /// Lights of which all cells are integrated in are a dispatch, and so is the last unit. Steps are dispatches of their own, of packets
    /// of items; or, where cores take packets and a step is few of them, one in which a work-item takes those of a light in order.
    fn next_propagate(&self, p: &PropagateParams, launch: Launch, end: u32) -> Dispatch {
        let (integrated, each) = (p.integrated(), p.items / p.lights);
        let of_items = |lights: u32, items: u32, units| {
            let launch = Launch { count: lights * items.div_ceil(self.width), ..launch };
            Dispatch { launch, units, items: launch.count.into(), team: None, scratch: 0 }
        };
        if launch.start < integrated {
            // Kernels count packets in 32 bits.
            let most = u32::MAX / p.count().div_ceil(self.width);
            let lights = (end.min(integrated) - launch.start).min(most);
            return of_items(lights, p.count(), lights);
        }
        if launch.start >= p.finished() {
            return of_items(1, p.count(), 1);
        }
        if self.width == 1 || each >= PROPAGATE_MANY {
            return of_items(p.lights, each, 1);
        }
        let units = end.min(p.finished()) - launch.start;
        Dispatch { launch: Launch { units, ..launch }, units, items: p.lights.into(), team: Some(1), scratch: 0 }
    }

    /// The steps of a batch follow each other within a dispatch, in which the work-items of a direction are a team; its
    /// moments are one of their own.
    fn next_sweep(&self, p: &SweepParams, launch: Launch, end: u32) -> Result<Dispatch, DeviceError> {
        let (batch, step) = (launch.start / p.batch_steps(), launch.start % p.batch_steps());
        let steps = p.cells[3];
        if step == steps {
            // Packets take all coefficients, so that radiance is read from memory once.
            let parts = if self.width > 1 { 1 } else { p.coefficients.div_ceil(SWEEP_TAKEN) };
            let count = p.count().div_ceil(self.width) * parts;
            return Ok(Dispatch {
                launch: Launch { count, ..launch },
                units: 1,
                items: count.into(),
                team: None,
                scratch: 0,
            });
        }
        let (units, width) = ((steps - step).min(end - launch.start), u64::from(self.width));
        let directions = p.batch.min(p.directions - batch * p.batch);
        let [x, y, z, _] = p.cells.map(u64::from);
        let plane = |across: u64, down: u64| (across.next_multiple_of(width) + 2 * width) * (down + 2);
        let size = plane(x, y).max(plane(x, z)).max(plane(y, z));
        // Radiance, extinction, source and emission of two planes.
        let floats = size * 4 * u64::from(p.channels);
        let room = u32::try_from(floats).map_err(|_| {
            let (what, limit) = ("the floats of a plane of `sweep`", u32::MAX.into());
            DeviceError::Limit { what, requested: floats, limit }
        })?;
        let launch = Launch { count: directions, units, room, ..launch };
        let turned = if self.width > 1 { u64::from(turned_values(p)) * u64::from(p.count()) } else { 0 };
        let scratch = (u64::from(p.batch) * 2 * floats + turned) * size_of::<f32>() as u64;
        let team = if self.width > 1 { 1 } else { TEAM };
        Ok(Dispatch { launch, units, items: directions.into(), team: Some(team), scratch })
    }

    /// What a run has to do once before `next`: packets of `sweep` take planes normal to x from copies that are turned.
    pub(crate) fn before(&self, stage: &Stage, next: &Dispatch) -> Option<Dispatch> {
        let Stage::Sweep(sweep) = stage else { return None };
        let p = &sweep.params;
        let count = turned_values(p) * p.cells[2];
        let launch = Launch { count, units: 0, ..next.launch };
        let wanted = self.width > 1 && next.scratch > 0;
        wanted.then_some(Dispatch { launch, units: 0, items: count.into(), team: None, ..*next })
    }

    /// The text for bindings of these shapes. The kernel's arguments are the constants, and of each binding that is
    /// present, in order: of a field its index if it is in bricks, its slabs, how many bricks hold one value if it is in
    /// bricks, the number of its layers if there are several, and the slices or bricks of a slab if there are several; of a
    /// buffer itself, and its 4-byte words where it is read.
    pub(crate) fn text(&self, shapes: &[Shape]) -> String {
        let prelude = self.prelude(shapes);
        let mut text = KernelText::new(OPENCL, &prelude, &self.recipe, shapes, helper, self.file);
        text.push("generated", &format!("#line 1 \"generated\"\n{}", self.entry(shapes)));
        text.whole
    }

    /// Whether the kernel has scratch memory, which is its last argument.
    pub(crate) fn shares(&self) -> bool {
        self.name == "sweep"
    }

    fn prelude(&self, shapes: &[Shape]) -> String {
        // A product and a sum stay two roundings, as on the other devices.
        let mut out = String::from("#pragma OPENCL FP_CONTRACT OFF\n");
        // Writing to a String cannot fail.
        out += &self.recipe.prelude(OPENCL, shapes);
        out += &Launch::text(OPENCL);
        for (name, value) in [
            ("EVALUATE_ROWS", evaluate_rows(self.width)),
            ("PROJECT_PACKETS", PROJECT_PACKETS),
            ("SWEEP_TAKEN", SWEEP_TAKEN),
            ("COARSEN_PLANES", Coarsen::PLANES),
        ] {
            let _ = writeln!(out, "#define {name} {value}u");
        }
        // Units of a work-item, where it takes several.
        let _ = writeln!(out, "#define EACH {}u", self.items.1);
        let _ = writeln!(out, "#define WIDTH {}\n{PACKET}", self.width);
        let params = self.recipe.params;
        let _ = writeln!(out, "typedef struct {{\n    {params} params;\n    Launch launch;\n}} Constants;");
        let _ = writeln!(out, "typedef struct {{\n    const {params} *params;");
        let _ = writeln!(out, "    const Launch *launch;");
        for (kind, name) in shapes.iter().flat_map(members) {
            let _ = writeln!(out, "    {kind}{name};");
        }
        if self.shares() {
            out += "    __global float *scratch;\n";
        }
        out += "} Bound;\n";
        for shape in shapes {
            out += &texels::texels(shape, self.width);
        }
        out
    }

    /// The kernel itself: it gathers its arguments and runs `run_NAME`.
    fn entry(&self, shapes: &[Shape]) -> String {
        let (mut arguments, mut filled) = (String::new(), String::new());
        for shape in shapes {
            for (kind, name) in members(shape) {
                if shape.present {
                    let restrict = if kind.ends_with('*') { "restrict " } else { "" };
                    let _ = write!(arguments, ",\n    {kind}{restrict}{name}");
                    let _ = writeln!(filled, "    bound.{name} = {name};");
                } else {
                    let _ = writeln!(filled, "    bound.{name} = 0;");
                }
            }
        }
        if self.shares() {
            arguments += ",\n    __global float *restrict scratch";
            filled += "    bound.scratch = scratch;\n";
        }
        let (name, entry) = (self.name, entry_point(self.name));
        format!(
            "__kernel void {entry}(const Constants constants{arguments}) {{\n    Bound bound;\n    \
             bound.params = &constants.params;\n    bound.launch = &constants.launch;\n{filled}    \
             run_{name}(&bound);\n}}\n"
        )
    }
}

mod bricks;
#[cfg(test)]
pub(crate) mod tests;
mod texels;
