//! The text of kernels in WGSL, put together by [`KernelText`] from the files of `kernels/` and from what is said here:
//! where a dispatch stands on its work axis, and how WGSL declares buffers and the textures of fields.

use std::fmt::Write as _;

use airlight_core::device::{FieldFormat, Helper, KernelElement, KernelFile, KernelLanguage, KernelScalar};
use airlight_core::device::{KernelStruct, Recipe};
use airlight_core::kernel_struct;
use airlight_core::stage::{Inject, Project, Stage};

pub(crate) use airlight_core::device::{KernelText as Text, Shape, ShapeKind};
pub(crate) use reads::{Fact, Place, TEXELS_ACROSS, words};
pub(crate) use sums::Sums;

pub(crate) mod order;
mod reads;
mod sums;
pub(crate) mod sweep;

const WGSL: KernelLanguage = KernelLanguage::Wgsl;

kernel_struct! {
    /// Where a dispatch stands on its stage's work axis.
    pub struct Launch {
        /// First unit.
        start: U32,
        /// Units; of a sequential stage the items of one unit.
        count: U32,
        /// First group of the buffers that are bound in parts.
        first: U32,
        /// Workgroups in a row of the dispatch.
        across: U32,
        /// Infinity, which WGSL has no way to write.
        infinity: F32,
        /// Threads of a driver that gives each of them as many workgroups in a row.
        threads: U32,
        /// The workgroups that each of them gets.
        share: U32,
        /// The unit past the last of those that a workgroup of a sweep takes in order, from `first` on.
        past: U32,
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

/// Number of a workgroup within its dispatch, which may be a plane of them.
const NUMBER: &str = "fn number(id: vec3<u32>) -> u32 {\n    return id.y * launch.across + id.x;\n}\n";

/// The same where workgroups are dealt out to the threads of a driver one by one.
const DEALT: &str = "\
fn number(id: vec3<u32>) -> u32 {
    let n = id.y * launch.across + id.x;
    let dealt = divide(n, max(launch.share, 1u));
    let turned = divide(dealt.x + countOneBits(dealt.y), launch.threads).y;
    return select(dealt.y * launch.threads + turned, n, n >= launch.threads * launch.share);
}
";

/// Quotient and rest of integers whose quotient is below 2²². Software drivers divide vectors of integers one by one, and
/// floats at once: their quotient is at most one off.
const DIVIDE: &str = "\
fn divide(a: u32, b: u32) -> vec2<u32> {
    let near = u32(f32(a) / f32(b));
    let rest = i32(a - near * b);
    let off = select(select(0, 1, rest >= i32(b)), -1, rest < 0);
    return vec2<u32>(u32(i32(near) + off), u32(rest - off * i32(b)));
}
";

/// Whole numbers from 0 to 2²³ as integers. Conversions of the language ask for what is out of range.
const WHOLE: &str = "\
fn whole(a: vec3<f32>) -> vec3<u32> {
    return bitcast<vec3<u32>>(a + 8388608.0) & vec3<u32>(0x7fffffu);
}
";

/// Four numbers from the one numbered `off` on, of those of two texels.
const FROM_TWO: &str = "\
fn from_two(a: vec4<f32>, b: vec4<f32>, off: u32) -> vec4<f32> {
    let two = (off & 2u) == 2u;
    let four = select(a, vec4<f32>(a.zw, b.xy), two);
    return select(four, vec4<f32>(four.yzw, select(b.x, b.z, two)), (off & 1u) == 1u);
}
";

/// The smaller and the larger of two numbers. Built-in functions know what is no number, for which software drivers take three
/// instructions in place of one.
fn ordered(compared: bool) -> String {
    let function = |name: &str, compares: &str, built_in: &str| {
        let body = if compared { format!("select(b, a, a {compares} b)") } else { format!("{built_in}(a, b)") };
        format!("fn {name}(a: f32, b: f32) -> f32 {{\n    return {body};\n}}\n")
    };
    function("smaller", "<", "min") + &function("larger", ">", "max")
}

macro_rules! file {
    ($name:literal) => {
        KernelFile { name: concat!("kernels/", $name), text: include_str!(concat!("../kernels/", $name)) }
    };
}

fn helper(helper: Helper) -> KernelFile {
    match helper {
        Helper::Field => file!("field.wgsl"),
        Helper::Maximum => file!("maximum.wgsl"),
        Helper::Sample => file!("sample.wgsl"),
        Helper::Angle => file!("angle.wgsl"),
        Helper::Phase => file!("phase.wgsl"),
        Helper::Harmonics => file!("harmonics.wgsl"),
        Helper::Segment => file!("segment.wgsl"),
        Helper::Noise => file!("noise.wgsl"),
        Helper::View => file!("view.wgsl"),
        Helper::Light => file!("light.wgsl"),
        Helper::Phong => file!("phong.wgsl"),
        Helper::Mesh => file!("mesh.wgsl"),
        Helper::Face => file!("face.wgsl"),
        Helper::Sky => file!("sky.wgsl"),
        Helper::Random => file!("random.wgsl"),
        Helper::Walk => file!("walk.wgsl"),
        Helper::Bend => file!("bend.wgsl"),
        Helper::Spot => file!("spot.wgsl"),
    }
}

/// Bindings of a stage, a bit each: what is read as storage textures, fields themselves and buffers from copies; of which
/// buffers of words a texel is four; and which buffers are written two words at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Fetched {
    all: u32,
    fours: u32,
    pairs: u32,
}

impl Fetched {
    /// With the binding `index` too.
    pub(crate) fn with(self, index: usize) -> Self {
        Self { all: self.all | 1 << index, ..self }
    }

    /// With the binding `index` too, four words at a time.
    pub(crate) fn with_fours(self, index: usize) -> Self {
        Self { fours: self.fours | 1 << index, ..self.with(index) }
    }

    /// With the buffer of the binding `index` written two words at once.
    pub(crate) fn with_pairs(self, index: usize) -> Self {
        Self { pairs: self.pairs | 1 << index, ..self }
    }

    /// Whether the buffer of the binding `index` is written two words at once.
    pub(crate) fn has_pairs(self, index: usize) -> bool {
        self.pairs >> index & 1 == 1
    }

    /// Whether the binding `index` is one of them.
    pub(crate) fn has(self, index: usize) -> bool {
        self.all >> index & 1 == 1
    }

    /// Whether the binding `index` is one of them, four words at a time.
    pub(crate) fn has_fours(self, index: usize) -> bool {
        self.fours >> index & 1 == 1
    }

    /// Words of a texel of the copy that the binding `index`, of such elements, is read from.
    pub(crate) fn words(self, index: usize, element: KernelElement) -> u32 {
        if self.has_fours(index) { 4 } else { words(element) }
    }
}

/// What a kernel is built for beside the shapes of its bindings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Variant<'p> {
    /// Invocations of a workgroup, where they do not work together.
    pub(crate) units: u32,
    pub(crate) fetched: Fetched,
    /// Whether texture units interpolate fields of one texture that are not fetched.
    pub(crate) filtered: bool,
    /// Of `sweep`: whether it adds moments, in place of finishing planes.
    pub(crate) gathers: bool,
    /// What is known of the parameters when it is built, where kernels copy them before all else and an invocation of `inject`
    /// takes samples that share exponentials: on drivers that run on processors.
    pub(crate) known: Option<&'p Numbers>,
}

impl Default for Variant<'_> {
    fn default() -> Self {
        Self { units: UNITS, fetched: Fetched::default(), filtered: false, gathers: false, known: None }
    }
}

/// Invocations of a workgroup on every device that the kernels run on.
pub(crate) const UNITS: u32 = 64;

/// Invocations of a workgroup that takes steps in order: a packet of Mesa's software driver, which has no other to wait for at barriers.
pub(crate) const ABREAST: u32 = 8;

/// Cells that a workgroup of `project` takes on drivers that run on processors, so that a packet of invocations marches from
/// neighbours along one direction.
const CELLS: u32 = 8;

/// Samples along each side of what an invocation of `inject` takes on those drivers.
const CUBE: u32 = 4;

/// Packs of voxels that a workgroup of `classify` takes: an invocation has a voxel of each in a vector.
const PACKS: u32 = 4;

/// Rays that an invocation of `trace` or `shadow` takes on drivers that run on processors, so that they share what they load of
/// boxes.
const RAYS: u32 = 4;

/// Steps of its walk that a path takes at a turn on those drivers.
const WALKED: u32 = 6;

/// What is known of each [`Place`] of a kernel's parameters, in their order; nothing where it is left to the parameters.
pub(crate) type Numbers = Vec<Option<Fact>>;

/// The kernel of a stage.
#[derive(Debug)]
pub(crate) struct Source {
    /// Name of the entry point.
    pub(crate) name: &'static str,
    /// Whether an invocation takes a unit of the work axis, or an item of a unit where the stage is sequential; else a
    /// workgroup does, whose size is the stage's.
    pub(crate) alone: bool,
    /// Units that an invocation takes on drivers that run on processors, where it takes one elsewhere.
    each: u32,
    /// Buffers of words that it reads by four that follow each other.
    pub(crate) fours: &'static [&'static str],
    /// Buffers of floats that it writes by four.
    wide: &'static [&'static str],
    /// Whether it writes single floats of those.
    singly: bool,
    /// The buffer of floats that it reads and writes.
    pub(crate) rewritten: Option<&'static str>,
    /// Of `project`.
    pub(crate) sums: Sums,
    file: KernelFile,
    recipe: Recipe,
}

/// The kernel of a stage.
pub(crate) fn of(stage: &Stage) -> Source {
    let (file, alone) = match stage {
        Stage::Reduce(_) => (file!("reduce.wgsl"), true),
        Stage::Project(_) => (file!("project.wgsl"), false),
        Stage::Propagate(_) => (file!("propagate.wgsl"), true),
        Stage::Relight(_) => (file!("relight.wgsl"), true),
        Stage::March(_) => (file!("march.wgsl"), false),
        Stage::Inject(_) => (file!("inject.wgsl"), false),
        Stage::Trace(_) => (file!("trace.wgsl"), true),
        Stage::Shade(_) => (file!("shade.wgsl"), true),
        Stage::Shadow(_) => (file!("shadow.wgsl"), true),
        Stage::Upsample(_) => (file!("upsample.wgsl"), false),
        Stage::Accumulate(_) => (file!("accumulate.wgsl"), false),
        Stage::Coarsen(_) => (file!("coarsen.wgsl"), true),
        Stage::Illuminate(_) => (file!("illuminate.wgsl"), true),
        Stage::Sweep(_) => (file!("sweep.wgsl"), true),
        Stage::Obstruct(_) => (file!("obstruct.wgsl"), true),
        Stage::Path(_) => (file!("path.wgsl"), true),
        Stage::Evaluate(_) => (file!("evaluate.wgsl"), true),
        Stage::Reconstruct(_) => (file!("reconstruct.wgsl"), true),
        Stage::Photons(_) => (file!("photons.wgsl"), true),
        Stage::Classify(_) => (file!("classify.wgsl"), false),
    };
    let (each, fours): (u32, &[&str]) = match stage {
        // Folded ones take a row at a time.
        Stage::Evaluate(evaluate) => (if evaluate.params.folded == 0 { 2 } else { 1 }, &["matrices", "light"]),
        Stage::Reconstruct(reconstruct) if reconstruct.params.view == 0 => (1, &["rows", "weights"]),
        Stage::Reconstruct(_) => (1, &["weights"]),
        Stage::Relight(relight) if relight.params.layers == 1 => (1, &["records"]),
        Stage::Project(_) => (1, &["weights", "emission_weights"]),
        Stage::Trace(_) | Stage::Shadow(_) => (RAYS, &[]),
        _ => (1, &[]),
    };
    let wide: &[&str] = match stage {
        Stage::Relight(_) | Stage::Reconstruct(_) => &["in_scatter"],
        Stage::Classify(_) => &["classified"],
        Stage::Propagate(_) => &["light_depth"],
        _ => &[],
    };
    let singly = matches!(stage, Stage::Classify(classify) if classify.params.channels() == 1);
    let rewritten = matches!(stage, Stage::Propagate(_)).then_some("values");
    Source {
        name: stage.name(),
        alone,
        each,
        fours,
        wide,
        singly,
        rewritten,
        sums: Sums::of(stage),
        file,
        recipe: Recipe::of(stage),
    }
}

impl Source {
    /// What the kernel may know of its parameters.
    pub(crate) fn places(&self) -> Vec<Place> {
        let structs: String = self.recipe.structs.iter().map(|text| text(WGSL)).collect();
        places(&structs, self.recipe.params)
    }

    /// Units of the work axis that a workgroup of so many invocations takes, which work alone or not; on drivers that run on
    /// processors, if that is what `known` says.
    pub(crate) fn taken(&self, units: u32, known: bool) -> u32 {
        match (self.alone, self.name) {
            (true, _) if known => units * self.each,
            (true, _) => units,
            (false, "project") if known => CELLS,
            (false, "classify") => PACKS,
            (false, _) => 1,
        }
    }

    /// The buffer of which an invocation takes as many units as texels are words: those that begin with a whole texel.
    pub(crate) fn by_texels(&self) -> Option<&'static str> {
        match self.name {
            "relight" => Some("records"),
            "reconstruct" => Some("rows"),
            _ => None,
        }
    }

    /// Buffers of floats that may be written two at once.
    pub(crate) fn pairs(&self) -> &'static [&'static str] {
        if self.singly { &[] } else { self.wide }
    }

    /// Whether it looks the field of that name up between texels, in place of loading texels (`reduce` of probes does, too).
    pub(crate) fn interpolates(&self, field: &str) -> bool {
        !matches!(self.name, "reduce" | "coarsen" | "classify" | "inject") && field != "environment"
    }

    /// Whether some workgroups are much longer work than others: rays that meet a mesh or a medium, or do not; cells that hold it, which
    /// are ordered to be first, or do not.
    fn uneven(&self) -> bool {
        self.name == "project" || self.recipe.helpers.contains(&Helper::Mesh)
    }

    /// The text for bindings of these shapes.
    pub(crate) fn text(&self, shapes: &[Shape], variant: Variant<'_>) -> Text {
        let Variant { units, fetched, filtered, gathers, known } = variant;
        let structs = self.recipe.prelude(WGSL, shapes);
        let mut prelude = structs.clone()
            + &uniforms(self.recipe.params, known.is_some() && self.uneven())
            + &kept(self.recipe.params, known)
            + &ordered(known.is_some())
            + &WGSL.integer("UNITS", units);
        prelude += &WGSL.truth("GATHERS", gathers);
        // On processors eight rows of `evaluate` share the light.
        prelude += &WGSL.truth("SHARES", known.is_some());
        prelude += &WGSL.integer("SHARED_SUMS", if known.is_some() { 24 * units } else { 1 });
        // On processors an invocation of `inject` takes a cube of samples, which share exponentials, elsewhere a column.
        let [wide, rows, tall] = if known.is_some() { [CUBE; 3] } else { [1, 1, Inject::BRICK] };
        prelude += &WGSL.truth("CUBES", known.is_some());
        prelude += &WGSL.integer("WIDE", wide);
        prelude += &WGSL.integer("ROWS", rows);
        prelude += &WGSL.integer("TALL", tall);
        // On processors an invocation of `project` takes a cell alone, elsewhere a workgroup does.
        let (invocations, shared) = if known.is_some() { (CELLS, 1) } else { (Project::LANES, Project::LANES) };
        prelude += &WGSL.truth("ALONE", known.is_some());
        prelude += &WGSL.integer("INVOCATIONS", invocations);
        prelude += &WGSL.integer("SHARED", shared);
        prelude += &WGSL.integer("PACKS", PACKS);
        prelude += &WGSL.integer("RAYS", if known.is_some() { RAYS } else { 1 });
        prelude += &WGSL.integer("WALKED", if known.is_some() { WALKED } else { 1 });
        prelude += &reads::greys(&structs, self.recipe.params, known.map_or(&[], |known| known));
        if fetched.pairs != 0 {
            prelude += reads::TWO;
        }
        if filtered {
            prelude += "@group(0) @binding(2) var linear: sampler;\n";
        }
        for (index, shape) in shapes.iter().enumerate() {
            let filtered = filtered && !fetched.has(index);
            prelude += &match shape.kind {
                ShapeKind::Read if fetched.has(index) => reads::texels(shape, index, fetched, &structs),
                ShapeKind::Read => reads::memory(shape, index),
                ShapeKind::Write if self.wide.contains(&shape.name) => {
                    reads::wide(shape, index, fetched.has_pairs(index))
                }
                ShapeKind::Write if self.rewritten == Some(shape.name) => {
                    reads::rewritten(shape, index, fetched.has(index))
                }
                ShapeKind::Write => buffer(shape, index),
                ShapeKind::Field { bricks: true, format, .. } => {
                    bricks::lookups(shape, index, format, fetched.has(index), filtered)
                }
                ShapeKind::Field { slabs, layered, format, .. } => {
                    WGSL.truth(&format!("layered_{}", shape.name), layered)
                        + &texel(shape, index, slabs, format, fetched.has(index))
                        + &filter(shape, format, filtered && slabs == 1)
                        + &uniform(shape)
                }
            };
        }
        if self.name == "project" {
            prelude += &self.sums.text();
        }
        if self.name == "project" && shapes.iter().all(|shape| shape.name != order::ORDER) {
            prelude += &order::none();
        }
        let text = Text::new(WGSL, &prelude, &self.recipe, shapes, helper, self.file);
        specialised(text, &structs, self.recipe.params, known)
    }
}

/// The most slabs of a field: the spacing of the numbers of texture bindings.
pub(crate) const MAX_SLABS: u32 = 16;

/// Number of a slab's texture in bind group 2, of the stage's binding `index`.
pub(crate) fn slab_binding(index: usize, slab: u32) -> u32 {
    index as u32 * MAX_SLABS + slab
}

/// Number of the texture of a field's index in bind group 2, of the stage's binding `index`; its bricks are one slab.
pub(crate) fn index_binding(index: usize) -> u32 {
    slab_binding(index, 1)
}

/// What kernels of a struct of parameters, of which `structs` is the text, may know of it.
pub(crate) fn places(structs: &str, params: &str) -> Vec<Place> {
    reads::places(structs, params).into_iter().map(|(_, place)| place).collect()
}

/// A kernel's text, with what is known of its parameters where it copies them. Lines stay where they are.
fn specialised(mut text: Text, structs: &str, params: &str, known: Option<&Numbers>) -> Text {
    if let Some(known) = known {
        let places = reads::places(structs, params).into_iter().zip(known);
        let facts: Vec<_> = places.filter_map(|((name, _), fact)| Some((name, fact.as_ref()?))).collect();
        text.whole = reads::kept(&text.whole, structs, params, &facts);
    }
    text
}

/// The parameters, and where the dispatch stands, whose workgroups are `dealt` out to threads, or in order.
pub(crate) fn uniforms(params: &str, dealt: bool) -> String {
    Launch::text(WGSL)
        + &format!("@group(0) @binding(0) var<uniform> params: {params};\n")
        + "@group(0) @binding(1) var<uniform> launch: Launch;\n"
        + if dealt { DEALT } else { NUMBER }
        + DIVIDE
        + WHOLE
        + FROM_TWO
}

/// Where kernels copy their parameters to, if they do.
fn kept(params: &str, known: Option<&Numbers>) -> String {
    known.map(|_| format!("var<private> kept_params: {params};\n")).unwrap_or_default()
}

fn buffer(shape: &Shape, index: usize) -> String {
    let (name, element) = (shape.name, shape.element.name(WGSL));
    format!("@group(1) @binding({index}) var<storage, read_write> {name}: array<{element}>;\n")
}

/// The function that gives a field's texel what its format says, exactly. Halves times a power of two are normal numbers, so that it
/// is added to their exponents: a product would have a factor that drivers take out of sums (Mesa makes s x + (s y + d) into
/// s (x + y) + d), which then round otherwise than those of 32-bit floats.
fn scaled(shape: &Shape, format: FieldFormat) -> String {
    let (name, value) = (shape.name, shape.element.name(WGSL));
    let number = match format {
        FieldFormat::Half { exponent } if exponent != 0 => {
            let added = (i32::from(exponent) << 23) as u32;
            format!("bitcast<f32>(select(0u, bitcast<u32>(stored) + {added}u, stored != 0.0))")
        }
        FieldFormat::Half { .. } | FieldFormat::Scalar | FieldFormat::Rgba => "stored".to_owned(),
    };
    format!("fn scaled_{name}(stored: {value}) -> {value} {{\n    return {number};\n}}\n")
}

/// The textures of a field, and the function that reads a texel of one of its layers, which lie one behind the other.
fn texel(shape: &Shape, index: usize, slabs: u32, format: FieldFormat, fetched: bool) -> String {
    let (name, value) = (shape.name, shape.element.name(WGSL));
    let part = if shape.element == KernelElement::Scalar(KernelScalar::F32) { ".x" } else { "" };
    let stored = if part.is_empty() { "rgba32float" } else { "r32float" };
    let (texture, level) = match fetched {
        true => (format!("texture_storage_3d<{stored}, read>"), ""),
        false => ("texture_3d<f32>".to_owned(), ", 0"),
    };
    let mut out = scaled(shape, format);
    // Writing to a String cannot fail.
    for slab in 0..slabs {
        let binding = slab_binding(index, slab);
        let _ = writeln!(out, "@group(2) @binding({binding}) var {name}_{slab}: {texture};");
    }
    let _ = writeln!(out, "fn texel_{name}(at: vec3<i32>, size: vec3<i32>, layer: i32) -> {value} {{");
    let _ = writeln!(out, "    let slice = layer * size.z + at.z;");
    if slabs == 1 {
        let _ = writeln!(out, "    return scaled_{name}(textureLoad({name}_0, vec3<i32>(at.xy, slice){level}){part});");
    } else {
        // All slabs but the last have the slices of the first.
        let _ = writeln!(out, "    let per_slab = i32(textureDimensions({name}_0).z);");
        let _ = writeln!(out, "    let place = vec3<i32>(at.xy, slice % per_slab);");
        let _ = writeln!(out, "    switch slice / per_slab {{");
        for slab in 0..slabs {
            let case = if slab + 1 == slabs { "default".to_owned() } else { format!("case {slab}") };
            let load = format!("textureLoad({name}_{slab}, place{level}){part}");
            let _ = writeln!(out, "        {case}: {{ return scaled_{name}({load}); }}");
        }
        let _ = writeln!(out, "    }}");
    }
    out + "}\n"
}

/// Whether a texture unit interpolates a field, and the function by which it does.
fn filter(shape: &Shape, format: FieldFormat, filtered: bool) -> String {
    let (name, value) = (shape.name, shape.element.name(WGSL));
    let part = if shape.element == KernelElement::Scalar(KernelScalar::F32) { ".x" } else { "" };
    // Within [0, last] of a layer the next layer has no weight.
    let body = if filtered {
        let sampled =
            format!("textureSampleLevel({name}_0, linear, place / vec3<f32>(textureDimensions({name}_0)), 0.0){part}");
        let sampled = WGSL.scaled(format, &sampled);
        format!("    let place = vec3<f32>(p.xy, p.z + f32(layer * size.z)) + 0.5;\n    return {sampled};\n")
    } else {
        format!("    return texel_{name}(vec3<i32>(p), size, layer);\n")
    };
    let head = format!("fn filter_{name}(p: vec3<f32>, size: vec3<i32>, layer: i32) -> {value} {{\n");
    WGSL.truth(&format!("filters_{name}"), filtered) + &head + &body + "}\n"
}

/// What [`bricks::lookups`] says of blocks of one value, of a dense field: nothing.
fn uniform(shape: &Shape) -> String {
    let name = shape.name;
    format!(
        "fn uniform_{name}(lo: vec3<i32>, hi: vec3<i32>) -> bool {{\n    return false;\n}}\nfn empty_{name}(at: \
         vec3<i32>) -> i32 {{\n    return 0;\n}}\n"
    )
}

/// Software drivers divide texels by rows as floats where there are fewer rows than this ([`DIVIDE`]).
pub(crate) const FEW_ROWS: u32 = 1 << 22;

/// The kernel that makes a slab of a field of texels of a format from what stages wrote, in workgroups of so many invocations;
/// of fields of `few` rows, if they are divided as floats.
pub(crate) fn publish_text(format: FieldFormat, units: u32, few: bool) -> Text {
    let (texture, words) = match format {
        // Halves are not published.
        FieldFormat::Scalar | FieldFormat::Half { .. } => ("r32float", 1),
        FieldFormat::Rgba => ("rgba32float", 4),
    };
    let mut text = Text::default();
    let prelude = PublishParams::text(WGSL) + &uniforms(PublishParams::NAME, false);
    let prelude = prelude + &WGSL.integer("UNITS", units) + &WGSL.integer("WORDS", words);
    text.push("generated", &(prelude + &WGSL.truth("FEW", few)));
    text.push("src/publish.wgsl", &include_str!("publish.wgsl").replace("FORMAT", texture));
    text
}

mod bricks;
#[cfg(test)]
pub(crate) mod tests;
