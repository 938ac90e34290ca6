//! The text of kernels. WGSL has no include and no generic functions, so a kernel's text is put together from its own
//! file, the helpers it shares with others, helpers that stand once for each field, and what is generated from Rust:
//! structs, constants and the fields' bindings. A map of lines leads errors back to the files.

use std::fmt::Write as _;

use airlight_core::basis::SphericalHarmonics;
use airlight_core::device::{Binding, BindingAccess, FieldFormat, KernelStruct};
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
        /// First group of the buffers that are bound in parts.
        first: U32,
        /// Workgroups in a row of the dispatch.
        across: U32,
        /// Infinity, which WGSL has no way to write.
        infinity: F32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

kernel_struct! {
    /// Parameters of `publish`.
    pub struct PublishParams {
        /// Texels of a layer along x, y, z; layers.
        dims: U32x4,
        /// First slice of the slab and the one past its end, counted through all layers; unused.
        slices: U32x4,
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
        File { name: $name, text: include_str!(concat!("../kernels/", $name)) }
    };
}

const LAUNCH: File = file!("launch.wgsl");
const FIELD: File = file!("field.wgsl");
const SAMPLE: File = file!("sample.wgsl");
const ANGLE: File = file!("angle.wgsl");
const PHASE: File = file!("phase.wgsl");
const HARMONICS: File = file!("harmonics.wgsl");
const SEGMENT: File = file!("segment.wgsl");
const MAXIMUM: File = file!("maximum.wgsl");

/// What a kernel's text is put together from.
#[derive(Debug)]
pub(crate) struct Source {
    /// Name of the entry point.
    pub(crate) name: &'static str,
    /// Units of the work axis that one workgroup takes.
    pub(crate) units: u32,
    /// Name of the struct of parameters.
    params: &'static str,
    /// Text of the structs besides [`Launch`].
    structs: &'static [fn() -> String],
    /// Helpers that stand once for each field.
    per_field: &'static [File],
    files: &'static [File],
}

static REDUCE: Source = Source {
    name: "reduce",
    units: 64,
    params: ReduceParams::NAME,
    structs: &[ReduceParams::wgsl],
    per_field: &[FIELD, MAXIMUM],
    files: &[LAUNCH, file!("reduce.wgsl")],
};

static PROJECT: Source = Source {
    name: "project",
    units: 1,
    params: ProjectParams::NAME,
    structs: &[ProjectParams::wgsl],
    per_field: &[FIELD],
    files: &[LAUNCH, SAMPLE, ANGLE, PHASE, SEGMENT, file!("project.wgsl")],
};

static RELIGHT: Source = Source {
    name: "relight",
    units: 64,
    params: RelightParams::NAME,
    structs: &[RelightParams::wgsl],
    per_field: &[],
    files: &[LAUNCH, file!("relight.wgsl")],
};

static MARCH: Source = Source {
    name: "march",
    units: 1,
    params: MarchParams::NAME,
    structs: &[MarchParams::wgsl, LightRecord::wgsl],
    per_field: &[FIELD],
    files: &[LAUNCH, SAMPLE, ANGLE, PHASE, HARMONICS, SEGMENT, file!("march.wgsl")],
};

static PUBLISH: Source = Source {
    name: "publish",
    units: 64,
    params: PublishParams::NAME,
    structs: &[PublishParams::wgsl],
    per_field: &[],
    files: &[LAUNCH, file!("publish.wgsl")],
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
    /// A field in so many slabs.
    Field {
        format: FieldFormat,
        slabs: u32,
    },
}

impl Shape {
    /// Of a binding whose field, if it is one, has so many slabs.
    pub(crate) fn new(binding: &Binding, slabs: u32) -> Self {
        let kind = match binding.access {
            BindingAccess::Sample(spec) => ShapeKind::Field { format: spec.format, slabs },
            BindingAccess::Read(_) => ShapeKind::Read,
            BindingAccess::Write(_) => ShapeKind::Write,
        };
        Self { name: binding.name, kind, present: binding.id.is_some() }
    }
}

/// The most slabs of a field: the spacing of the numbers of texture bindings.
pub(crate) const MAX_SLABS: u32 = 16;

/// Number of a slab's texture in bind group 2, of the stage's binding `index`.
pub(crate) fn slab_binding(index: usize, slab: u32) -> u32 {
    index as u32 * MAX_SLABS + slab
}

/// A kernel's whole text.
#[derive(Debug, Default)]
pub(crate) struct Text {
    pub(crate) wgsl: String,
    /// First line of each part (from 1), and its file.
    parts: Vec<(usize, &'static str)>,
}

impl Text {
    pub(crate) fn push(&mut self, name: &'static str, text: &str) {
        self.parts.push((self.wgsl.lines().count() + 1, name));
        self.wgsl.push_str(text);
        if !text.ends_with('\n') {
            self.wgsl.push('\n');
        }
    }

    /// File and line of line `line` (from 1) of the whole.
    pub(crate) fn place(&self, line: usize) -> (&'static str, usize) {
        let part = self.parts.iter().rev().find(|(first, _)| *first <= line);
        part.map_or(("generated", line), |(first, name)| (name, line - first + 1))
    }
}

impl Source {
    /// The text for bindings of these shapes.
    pub(crate) fn text(&self, shapes: &[Shape]) -> Text {
        let mut text = Text::default();
        text.push("generated", &self.prelude(shapes));
        for file in self.per_field {
            for (name, value) in fields(shapes) {
                text.push(file.name, &file.text.replace("FIELD", name).replace("VALUE", value));
            }
        }
        for file in self.files {
            text.push(file.name, file.text);
        }
        text
    }

    fn prelude(&self, shapes: &[Shape]) -> String {
        let mut out = Launch::wgsl();
        self.structs.iter().for_each(|text| out += &text());
        // Writing to a String cannot fail.
        let _ = writeln!(out, "@group(0) @binding(0) var<uniform> params: {};", self.params);
        let _ = writeln!(out, "@group(0) @binding(1) var<uniform> launch: Launch;");
        let harmonics = SphericalHarmonics::DEVICE_BANDS.pow(2);
        for (name, value) in [
            ("PHASE_HENYEY_GREENSTEIN", PhaseParams::HENYEY_GREENSTEIN),
            ("PHASE_RAYLEIGH", PhaseParams::RAYLEIGH),
            ("PHASE_TABLE", PhaseParams::TABLE),
            ("SHADOW_MARCH", shadow_kind::MARCH),
            ("BLOCK", March::BLOCK),
            ("ALL_STEPS", March::ALL_STEPS),
            ("HARMONICS_MAX", harmonics),
        ] {
            let _ = writeln!(out, "const {name}: u32 = {value}u;");
        }
        let _ = writeln!(out, "const REDUCE_SLACK: f32 = {:?};", Reduce::SLACK);
        for (index, shape) in shapes.iter().enumerate() {
            let _ = writeln!(out, "const has_{}: bool = {};", shape.name, shape.present);
            if let ShapeKind::Field { format, slabs } = shape.kind {
                out += &texel(shape.name, index, format, slabs);
            }
        }
        out
    }
}

/// The fields among the bindings, and what their texels are in WGSL.
fn fields(shapes: &[Shape]) -> impl Iterator<Item = (&'static str, &'static str)> {
    shapes.iter().filter_map(|shape| match shape.kind {
        ShapeKind::Field { format, .. } => Some((shape.name, value(format))),
        ShapeKind::Read | ShapeKind::Write => None,
    })
}

fn value(format: FieldFormat) -> &'static str {
    match format {
        FieldFormat::Scalar => "f32",
        FieldFormat::Rgba => "vec4<f32>",
    }
}

/// The textures of a field, and the function that reads a texel of one of its layers, which lie one behind the other.
fn texel(name: &str, index: usize, format: FieldFormat, slabs: u32) -> String {
    let part = match format {
        FieldFormat::Scalar => ".x",
        FieldFormat::Rgba => "",
    };
    let mut out = String::new();
    for slab in 0..slabs {
        let binding = slab_binding(index, slab);
        let _ = writeln!(out, "@group(2) @binding({binding}) var {name}_{slab}: texture_3d<f32>;");
    }
    let value = value(format);
    let _ = writeln!(out, "fn texel_{name}(at: vec3<i32>, size: vec3<i32>, layer: i32) -> {value} {{");
    let _ = writeln!(out, "    let slice = layer * size.z + at.z;");
    if slabs == 1 {
        let _ = writeln!(out, "    return textureLoad({name}_0, vec3<i32>(at.xy, slice), 0){part};");
    } else {
        // All slabs but the last have the slices of the first.
        let _ = writeln!(out, "    let per_slab = i32(textureDimensions({name}_0).z);");
        let _ = writeln!(out, "    let place = vec3<i32>(at.xy, slice % per_slab);");
        let _ = writeln!(out, "    switch slice / per_slab {{");
        for slab in 0..slabs {
            let case = if slab + 1 == slabs { "default".to_owned() } else { format!("case {slab}") };
            let _ = writeln!(out, "        {case}: {{ return textureLoad({name}_{slab}, place, 0){part}; }}");
        }
        let _ = writeln!(out, "    }}");
    }
    out + "}\n"
}

/// The kernel that makes a slab of a field of what stages wrote.
pub(crate) fn publish() -> &'static Source {
    &PUBLISH
}

/// Its text for texels of a format.
pub(crate) fn publish_text(format: FieldFormat) -> Text {
    let (texture, words) = match format {
        FieldFormat::Scalar => ("r32float", "1u"),
        FieldFormat::Rgba => ("rgba32float", "4u"),
    };
    let mut text = Text::default();
    text.push("generated", &(PUBLISH.prelude(&[]) + &format!("const WORDS: u32 = {words};\n")));
    for file in PUBLISH.files {
        text.push(file.name, &file.text.replace("FORMAT", texture));
    }
    text
}

#[cfg(test)]
mod tests;
