//! The text of kernels. OpenCL C has neither generic functions nor globals that point to buffers, so a kernel's text is
//! put together from its own file, the helpers it shares with others, helpers that stand once for each field, and what
//! is generated from Rust: structs, constants, the struct `Bound` of all that a stage binds, and the entry point that
//! fills it. `#line` directives lead a compiler's faults back to the files.

use std::fmt::Write as _;

use airlight_core::basis::SphericalHarmonics;
use airlight_core::device::{Binding, BindingAccess, DeviceError, FieldFormat, KernelStruct};
use airlight_core::kernel_struct;
use airlight_core::stage::{
    LightRecord, March, MarchParams, PhaseParams, ProjectParams, Reduce, ReduceParams, RelightParams, Stage,
    shadow_kind,
};

kernel_struct! {
    /// Where a dispatch stands on its stage's work axis.
    pub struct Launch {
        /// First unit.
        start: U32,
        /// Units.
        count: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
    }
}

/// A file of `kernels/`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct File {
    pub(crate) name: &'static str,
    pub(crate) text: &'static str,
}

macro_rules! file {
    ($name:literal) => {
        File { name: concat!("kernels/", $name), text: include_str!(concat!("../kernels/", $name)) }
    };
}

/// The most values of spherical harmonics that a kernel holds.
const MAX_HARMONICS: u32 = SphericalHarmonics::DEVICE_BANDS.pow(2);

const LAUNCH: File = file!("launch.cl");
const FIELD: File = file!("field.cl");
const SAMPLE: File = file!("sample.cl");
const ANGLE: File = file!("angle.cl");
const PHASE: File = file!("phase.cl");
const HARMONICS: File = file!("harmonics.cl");
const SEGMENT: File = file!("segment.cl");
const MAXIMUM: File = file!("maximum.cl");

/// What a kernel's text is put together from.
#[derive(Debug)]
pub(crate) struct Source {
    /// Name of the entry point.
    pub(crate) name: &'static str,
    /// Work-items of a unit of the work axis.
    pub(crate) items: u32,
    /// Name of the struct of parameters.
    params: &'static str,
    /// Text of the structs besides [`Launch`].
    structs: &'static [fn() -> String],
    /// Type of the elements of each buffer.
    elements: &'static [(&'static str, &'static str)],
    /// Helpers that stand once for each field.
    per_field: &'static [File],
    files: &'static [File],
}

static REDUCE: Source = Source {
    name: "reduce",
    items: 1,
    params: ReduceParams::NAME,
    structs: &[ReduceParams::opencl],
    elements: &[("reduced", "float2")],
    per_field: &[FIELD, MAXIMUM],
    files: &[LAUNCH, file!("reduce.cl")],
};

static PROJECT: Source = Source {
    name: "project",
    items: 1,
    params: ProjectParams::NAME,
    structs: &[ProjectParams::opencl],
    elements: &[
        ("occupancy", "float2"),
        ("directions", "float4"),
        ("weights", "float"),
        ("emission_weights", "float"),
        ("phase_table", "float"),
        ("records", "float"),
        ("emission_records", "float"),
    ],
    per_field: &[FIELD],
    files: &[LAUNCH, SAMPLE, ANGLE, PHASE, SEGMENT, file!("project.cl")],
};

static RELIGHT: Source = Source {
    name: "relight",
    items: 1,
    params: RelightParams::NAME,
    structs: &[RelightParams::opencl],
    elements: &[("records", "float"), ("emission_records", "float"), ("light", "float4"), ("in_scatter", "float4")],
    per_field: &[],
    files: &[LAUNCH, file!("relight.cl")],
};

static MARCH: Source = Source {
    name: "march",
    items: March::BLOCK * March::BLOCK,
    params: MarchParams::NAME,
    structs: &[MarchParams::opencl, LightRecord::opencl],
    elements: &[
        ("occupancy", "float2"),
        ("lights", "LightRecord"),
        ("tables", "float"),
        ("environment", "float4"),
        ("surface", "float4"),
        ("paths", "float4"),
        ("film", "float4"),
    ],
    per_field: &[FIELD],
    files: &[LAUNCH, SAMPLE, ANGLE, PHASE, HARMONICS, SEGMENT, file!("march.cl")],
};

/// The kernel of a stage.
pub(crate) fn of(stage: &Stage) -> &'static Source {
    match stage {
        Stage::Reduce(_) => &REDUCE,
        Stage::Project(_) => &PROJECT,
        Stage::Relight(_) => &RELIGHT,
        Stage::March(_) => &MARCH,
    }
}

/// Whether a kernel's private memory holds what the stage needs there.
///
/// # Errors
/// Too many layers of in-scattered radiance.
pub(crate) fn check(stage: &Stage) -> Result<(), DeviceError> {
    match stage {
        Stage::March(March { params, in_scatter: Some(_), .. }) if params.cells[3] > MAX_HARMONICS => {
            Err(DeviceError::Limit {
                what: "the layers of in-scattered radiance",
                requested: params.cells[3].into(),
                limit: MAX_HARMONICS.into(),
            })
        }
        Stage::Reduce(_) | Stage::Project(_) | Stage::Relight(_) | Stage::March(_) => Ok(()),
    }
}

/// What a kernel's text depends on beyond its files, one for each binding of the stage.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Shape {
    pub(crate) name: &'static str,
    pub(crate) kind: ShapeKind,
    /// Whether the stage runs with it.
    pub(crate) present: bool,
}

/// Kind of a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum ShapeKind {
    Read,
    Write,
    /// A field in so many slabs, of one layer or of more.
    Field {
        format: FieldFormat,
        slabs: u32,
        layered: bool,
    },
}

impl Shape {
    /// Of a binding whose field, if it is one, has so many slabs and perhaps more than one layer.
    pub(crate) fn new(binding: &Binding, slabs: u32, layered: bool) -> Self {
        let kind = match binding.access {
            BindingAccess::Sample(spec) => ShapeKind::Field { format: spec.format, slabs, layered },
            BindingAccess::Read(_) => ShapeKind::Read,
            BindingAccess::Write(_) => ShapeKind::Write,
        };
        Self { name: binding.name, kind, present: binding.id.is_some() }
    }
}

/// The most slabs of a field: each is an argument of its kernels.
pub(crate) const MAX_SLABS: u32 = 16;

/// What a kernel takes of a binding: type and name of each member of `Bound`.
fn members(source: &Source, shape: &Shape) -> Vec<(String, String)> {
    let name = shape.name;
    let element = || source.elements.iter().find(|(of, _)| *of == name).map_or("float", |(_, element)| element);
    let mut members = Vec::new();
    match shape.kind {
        ShapeKind::Read => {
            members.push((format!("__global const {} *", element()), name.to_owned()));
            members.push(("uint ".to_owned(), format!("{name}_words")));
        }
        ShapeKind::Write => members.push((format!("__global {} *", element()), name.to_owned())),
        ShapeKind::Field { format, slabs, layered } => {
            let slab = |n| (format!("__global const {} *", value(format)), format!("{name}_{n}"));
            members.extend((0..slabs).map(slab));
            members.extend(layered.then(|| ("int ".to_owned(), format!("{name}_layers"))));
            members.extend((slabs > 1).then(|| ("int ".to_owned(), format!("{name}_per_slab"))));
        }
    }
    members
}

impl Source {
    /// The text for bindings of these shapes. The kernel's arguments are the constants, and of each binding that is
    /// present, in order: of a field its slabs, the number of its layers if there are several, and the slices of a
    /// slab if there are several; of a buffer itself, and its 4-byte words where it is read.
    pub(crate) fn text(&self, shapes: &[Shape]) -> String {
        let mut text = String::new();
        let mut push = |name: &str, part: &str| {
            // Writing to a String cannot fail.
            let _ = write!(text, "#line 1 \"{name}\"\n{part}");
        };
        push("generated", &self.prelude(shapes));
        for file in self.per_field {
            for (name, value) in fields(shapes) {
                push(file.name, &file.text.replace("FIELD", name).replace("VALUE", value));
            }
        }
        for file in self.files {
            push(file.name, file.text);
        }
        push("generated", &self.entry(shapes));
        text
    }

    fn prelude(&self, shapes: &[Shape]) -> String {
        // A product and a sum stay two roundings, as on the other devices.
        let mut out = String::from("#pragma OPENCL FP_CONTRACT OFF\n");
        out += &Launch::opencl();
        self.structs.iter().for_each(|text| out += &text());
        let params = self.params;
        let _ = writeln!(out, "typedef struct {{\n    {params} params;\n    Launch launch;\n}} Constants;");
        for (name, value) in [
            ("PHASE_HENYEY_GREENSTEIN", PhaseParams::HENYEY_GREENSTEIN),
            ("PHASE_RAYLEIGH", PhaseParams::RAYLEIGH),
            ("PHASE_TABLE", PhaseParams::TABLE),
            ("SHADOW_MARCH", shadow_kind::MARCH),
            ("BLOCK", March::BLOCK),
            ("ALL_STEPS", March::ALL_STEPS),
            ("HARMONICS_MAX", MAX_HARMONICS),
        ] {
            let _ = writeln!(out, "#define {name} {value}u");
        }
        let _ = writeln!(out, "#define REDUCE_SLACK {:?}f", Reduce::SLACK);
        for shape in shapes {
            let _ = writeln!(out, "#define has_{} {}", shape.name, u8::from(shape.present));
        }
        let _ = writeln!(out, "typedef struct {{\n    __constant const {params} *params;");
        let _ = writeln!(out, "    __constant const Launch *launch;");
        for (kind, name) in shapes.iter().flat_map(|shape| members(self, shape)) {
            let _ = writeln!(out, "    {kind}{name};");
        }
        out += "} Bound;\n";
        for shape in shapes {
            if let ShapeKind::Field { format, slabs, layered } = shape.kind {
                out += &texel(shape.name, format, slabs, layered);
            }
        }
        out
    }

    /// The kernel itself: it gathers its arguments and runs `run_NAME`.
    fn entry(&self, shapes: &[Shape]) -> String {
        let (mut arguments, mut filled) = (String::new(), String::new());
        for shape in shapes {
            for (kind, name) in members(self, shape) {
                if shape.present {
                    let restrict = if kind.ends_with('*') { "restrict " } else { "" };
                    let _ = write!(arguments, ",\n    {kind}{restrict}{name}");
                    let _ = writeln!(filled, "    bound.{name} = {name};");
                } else {
                    let _ = writeln!(filled, "    bound.{name} = 0;");
                }
            }
        }
        let name = self.name;
        format!(
            "__kernel void {name}(__constant const Constants *constants{arguments}) {{\n    Bound bound;\n    \
             bound.params = &constants->params;\n    bound.launch = &constants->launch;\n{filled}    \
             run_{name}(&bound);\n}}\n"
        )
    }
}

/// The fields among the bindings, and what their texels are in OpenCL C.
fn fields(shapes: &[Shape]) -> impl Iterator<Item = (&'static str, &'static str)> {
    shapes.iter().filter_map(|shape| match shape.kind {
        ShapeKind::Field { format, .. } => Some((shape.name, value(format))),
        ShapeKind::Read | ShapeKind::Write => None,
    })
}

fn value(format: FieldFormat) -> &'static str {
    match format {
        FieldFormat::Scalar => "float",
        FieldFormat::Rgba => "float4",
    }
}

/// The function that reads a texel of a field: layer fastest, then x, y and z.
fn texel(name: &str, format: FieldFormat, slabs: u32, layered: bool) -> String {
    let value = value(format);
    let place = |z: &str| {
        let texel = format!("({z} * size.y + at.y) * size.x + at.x");
        if layered { format!("({texel}) * bound->{name}_layers + layer") } else { texel }
    };
    let mut out = String::new();
    let _ = writeln!(out, "{value} texel_{name}(const Bound *bound, int3 at, int3 size, int layer) {{");
    if slabs == 1 {
        let _ = writeln!(out, "    return bound->{name}_0[{}];", place("at.z"));
    } else {
        // All slabs but the last have the slices of the first.
        let _ = writeln!(out, "    int place = {};", place(&format!("(at.z % bound->{name}_per_slab)")));
        let _ = writeln!(out, "    switch (at.z / bound->{name}_per_slab) {{");
        for slab in 0..slabs {
            let case = if slab + 1 == slabs { "default".to_owned() } else { format!("case {slab}") };
            let _ = writeln!(out, "        {case}: return bound->{name}_{slab}[place];");
        }
        let _ = writeln!(out, "    }}");
    }
    out + "}\n"
}

#[cfg(test)]
pub(crate) mod tests;
