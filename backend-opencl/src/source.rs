//! The text of kernels in OpenCL C, put together by [`KernelText`] from the files of `kernels/` and from what is said
//! here: OpenCL C has no globals that point to buffers, so there is a struct `Bound` of all that a stage binds, which
//! the entry point fills.

use std::fmt::Write as _;

use airlight_core::device::{FieldFormat, Helper, KernelFile, KernelLanguage, KernelStruct, KernelText, Recipe};
use airlight_core::kernel_struct;
use airlight_core::stage::{Classify, Inject, March, Stage};

pub(crate) use airlight_core::device::{Shape, ShapeKind};

const OPENCL: KernelLanguage = KernelLanguage::Opencl;

kernel_struct! {
    /// Where a dispatch stands on its stage's work axis.
    pub struct Launch {
        /// First unit.
        start: U32,
        /// Units; of a sequential stage the items of one unit.
        count: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
    }
}

/// Number of a work-item within its dispatch.
const NUMBER: &str = "size_t number(void) {\n    return get_global_id(0);\n}\n";

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
    /// Work-items of a unit of the work axis, or of an item of a unit where the stage is sequential.
    pub(crate) items: u32,
    file: KernelFile,
    recipe: Recipe,
}

/// The function of a stage's kernel. OpenCL C has functions of its own of the names of some stages.
pub(crate) fn entry_point(stage: &str) -> String {
    format!("stage_{stage}")
}

/// The kernel of a stage.
pub(crate) fn of(stage: &Stage) -> Source {
    let (file, items) = match stage {
        Stage::Reduce(_) => (file!("reduce.cl"), 1),
        Stage::Project(_) => (file!("project.cl"), 1),
        Stage::Propagate(_) => (file!("propagate.cl"), 1),
        Stage::Relight(_) => (file!("relight.cl"), 1),
        Stage::March(_) => (file!("march.cl"), March::BLOCK * March::BLOCK),
        Stage::Inject(_) => (file!("inject.cl"), Inject::BRICK * Inject::BRICK),
        Stage::Trace(_) => (file!("trace.cl"), 1),
        Stage::Shade(_) => (file!("shade.cl"), 1),
        Stage::Shadow(_) => (file!("shadow.cl"), 1),
        Stage::Upsample(_) => (file!("upsample.cl"), March::BLOCK * March::BLOCK),
        Stage::Accumulate(_) => (file!("accumulate.cl"), March::BLOCK * March::BLOCK),
        Stage::Coarsen(_) => (file!("coarsen.cl"), 1),
        Stage::Illuminate(_) => (file!("illuminate.cl"), 1),
        Stage::Sweep(_) => (file!("sweep.cl"), 1),
        Stage::Obstruct(_) => (file!("obstruct.cl"), 1),
        Stage::Path(_) => (file!("path.cl"), 1),
        Stage::Evaluate(_) => (file!("evaluate.cl"), 1),
        Stage::Reconstruct(_) => (file!("reconstruct.cl"), 1),
        Stage::Photons(_) => (file!("photons.cl"), 1),
        Stage::Classify(_) => (file!("classify.cl"), Classify::PACK),
    };
    Source { name: stage.name(), items, file, recipe: Recipe::of(stage) }
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

    fn prelude(&self, shapes: &[Shape]) -> String {
        // A product and a sum stay two roundings, as on the other devices.
        let mut out = String::from("#pragma OPENCL FP_CONTRACT OFF\n");
        out += &self.recipe.prelude(OPENCL, shapes);
        out += &Launch::text(OPENCL);
        out += NUMBER;
        let params = self.recipe.params;
        // Writing to a String cannot fail.
        let _ = writeln!(out, "typedef struct {{\n    {params} params;\n    Launch launch;\n}} Constants;");
        let _ = writeln!(out, "typedef struct {{\n    __constant const {params} *params;");
        let _ = writeln!(out, "    __constant const Launch *launch;");
        for (kind, name) in shapes.iter().flat_map(members) {
            let _ = writeln!(out, "    {kind}{name};");
        }
        out += "} Bound;\n";
        for shape in shapes {
            if let ShapeKind::Field { bricks, .. } = shape.kind {
                out += &if bricks { bricks::texel(shape) } else { texel(shape) };
                out += &if bricks { bricks::uniform(shape) } else { uniform(shape) };
            }
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
        let (name, entry) = (self.name, entry_point(self.name));
        format!(
            "__kernel void {entry}(__constant const Constants *constants{arguments}) {{\n    Bound bound;\n    \
             bound.params = &constants->params;\n    bound.launch = &constants->launch;\n{filled}    \
             run_{name}(&bound);\n}}\n"
        )
    }
}

/// The statements that return the texel at `place`, an `int`, of slab `number`.
fn load(shape: &Shape, number: &str) -> String {
    let ShapeKind::Field { slabs, format, .. } = shape.kind else { return String::new() };
    let name = shape.name;
    let one = |slab: u32| {
        let texel = match format {
            FieldFormat::Half { .. } => format!("vload_half(place, bound->{name}_{slab})"),
            FieldFormat::Scalar | FieldFormat::Rgba => format!("bound->{name}_{slab}[place]"),
        };
        OPENCL.scaled(format, &texel)
    };
    if slabs == 1 {
        return format!("    return {};\n", one(0));
    }
    let case = |slab| if slab + 1 == slabs { "default".to_owned() } else { format!("case {slab}") };
    let cases: String = (0..slabs).map(|slab| format!("        {}: return {};\n", case(slab), one(slab))).collect();
    format!("    switch ({number}) {{\n{cases}    }}\n")
}

/// The function that reads a texel of a dense field: layer fastest, then x, y and z.
fn texel(shape: &Shape) -> String {
    let ShapeKind::Field { slabs, layered, .. } = shape.kind else { return String::new() };
    let (name, value) = (shape.name, shape.element.name(OPENCL));
    let place = |z: &str| {
        let texel = format!("({z} * size.y + at.y) * size.x + at.x");
        if layered { format!("({texel}) * bound->{name}_layers + layer") } else { texel }
    };
    let mut out = String::new();
    let _ = writeln!(out, "{value} texel_{name}(const Bound *bound, int3 at, int3 size, int layer) {{");
    // All slabs but the last have the slices of the first.
    let z = if slabs == 1 { "at.z".to_owned() } else { format!("(at.z % bound->{name}_per_slab)") };
    let _ = writeln!(out, "    int place = {};", place(&z));
    out + &load(shape, &format!("at.z / bound->{name}_per_slab")) + "}\n"
}

/// What [`bricks::uniform`] says, of a dense field: nothing.
fn uniform(shape: &Shape) -> String {
    let name = shape.name;
    format!(
        "bool uniform_{name}(const Bound *bound, int3 lo, int3 hi, int3 size) {{\n    return false;\n}}\nint \
         empty_{name}(const Bound *bound, int3 at, int3 size) {{\n    return 0;\n}}\n"
    )
}

mod bricks;
#[cfg(test)]
pub(crate) mod tests;
