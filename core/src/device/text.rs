//! The text of kernels in languages that have neither includes nor generic functions. A kernel's text is put together
//! from what is generated from Rust (structs, constants, what a stage binds), helpers that stand once for each field,
//! helpers that kernels share, and the kernel's own file. What goes into it is said here once for every language; a
//! backend brings its files and how its language declares what a stage binds.

use super::{Binding, BindingAccess, BrickLayout, FieldFormat, KernelElement, KernelStruct, Layout};
use crate::basis::SphericalHarmonics;
use crate::blue_noise;
use crate::media::{FractalNoise, LARGEST};
use crate::stage::{
    Accumulate, AccumulateParams, BlobRecord, Classify, ClassifyParams, CoarsenParams, ControlRecord, EvaluateParams,
    FAR, IlluminateParams, Inject, InjectParams, LightFace, LightPlace, LightRecord, March, MarchParams,
    MaterialRecord, MeshRecord, Obstruct, ObstructParams, Path, PathParams, PathRecord, PhaseParams, PhotonDirection,
    PhotonParams, Photons, Project, ProjectParams, PropagateParams, ReconstructParams, Reduce, ReduceParams,
    RelightParams, ShadeParams, ShadowParams, Stage, SweepDirection, SweepParams, TraceParams, Upsample,
    UpsampleParams, accumulate_mode, alone, classify_kind, inject_kind, path_mode, photon_counter, photon_deposit,
    propagate::scheme, shadow_kind, surface_shadow,
};

/// A language of kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KernelLanguage {
    /// WGSL.
    Wgsl,
    /// OpenCL C.
    Opencl,
}

impl KernelLanguage {
    /// A number that kernels know by name.
    pub fn integer(self, name: &str, value: u32) -> String {
        match self {
            Self::Wgsl => format!("const {name}: u32 = {value}u;\n"),
            Self::Opencl => format!("#define {name} {value}u\n"),
        }
    }

    /// A float that kernels know by name.
    pub fn float(self, name: &str, value: f32) -> String {
        match self {
            Self::Wgsl => format!("const {name}: f32 = {value:?};\n"),
            Self::Opencl => format!("#define {name} {value:?}f\n"),
        }
    }

    /// A texel's number in the text of an expression that reads it, times what its format says, exactly.
    pub fn scaled(self, format: FieldFormat, texel: &str) -> String {
        match format {
            // Hexadecimal floats are alike in both languages.
            FieldFormat::Half { exponent } if exponent != 0 => format!("{texel} * 0x1p{exponent:+}f"),
            FieldFormat::Half { .. } | FieldFormat::Scalar | FieldFormat::Rgba => texel.to_owned(),
        }
    }

    /// A truth that kernels know by name.
    pub fn truth(self, name: &str, value: bool) -> String {
        match self {
            Self::Wgsl => format!("const {name}: bool = {value};\n"),
            Self::Opencl => format!("#define {name} {}\n", u8::from(value)),
        }
    }
}

/// A file of a backend's `kernels/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelFile {
    /// Its path within the backend's folder, as faults name it.
    pub name: &'static str,
    /// What it holds.
    pub text: &'static str,
}

/// A file of helpers that kernels share. A backend matches it without a catch-all arm, so that a new one does not
/// compile until the backend has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Helper {
    /// Lookups of a field.
    Field,
    /// The maximum of a field over a coarse cell.
    Maximum,
    /// Rays through the box of the medium.
    Sample,
    /// Angles.
    Angle,
    /// Phase functions.
    Phase,
    /// Spherical harmonics of a direction.
    Harmonics,
    /// Light along a short piece of a ray.
    Segment,
    /// Fractal gradient noise.
    Noise,
    /// View rays.
    View,
    /// Light that arrives at a point of a view ray.
    Light,
    /// Light that is scattered as by a surface across the density's gradient.
    Phong,
    /// Rays through a mesh.
    Mesh,
    /// Faces of the maps of lights.
    Face,
    /// The environment as it is seen.
    Sky,
    /// Random numbers, and what is made of them.
    Random,
    /// Walks along rays from one tentative collision to the next.
    Walk,
    /// Directions in which scattering bends.
    Bend,
    /// Places where paths scatter.
    Spot,
}

impl Helper {
    /// Every helper.
    pub const ALL: [Self; 18] = [
        Self::Field,
        Self::Maximum,
        Self::Sample,
        Self::Angle,
        Self::Phase,
        Self::Harmonics,
        Self::Segment,
        Self::Noise,
        Self::View,
        Self::Light,
        Self::Phong,
        Self::Mesh,
        Self::Face,
        Self::Sky,
        Self::Random,
        Self::Walk,
        Self::Bend,
        Self::Spot,
    ];

    /// Name of its file, without the language's ending.
    pub fn name(self) -> &'static str {
        match self {
            Self::Field => "field",
            Self::Maximum => "maximum",
            Self::Sample => "sample",
            Self::Angle => "angle",
            Self::Phase => "phase",
            Self::Harmonics => "harmonics",
            Self::Segment => "segment",
            Self::Noise => "noise",
            Self::View => "view",
            Self::Light => "light",
            Self::Phong => "phong",
            Self::Mesh => "mesh",
            Self::Face => "face",
            Self::Sky => "sky",
            Self::Random => "random",
            Self::Walk => "walk",
            Self::Bend => "bend",
            Self::Spot => "spot",
        }
    }
}

/// What the text of a stage's kernel is put together from, beside its own file.
#[derive(Clone, Copy, Debug)]
pub struct Recipe {
    /// Name of the struct of parameters.
    pub params: &'static str,
    /// Text of the structs.
    pub structs: &'static [fn(KernelLanguage) -> String],
    /// Helpers that stand once for each field of the stage.
    pub per_field: &'static [Helper],
    /// Helpers that stand once, each behind those that it uses.
    pub helpers: &'static [Helper],
}

const REDUCE: Recipe = Recipe {
    params: ReduceParams::NAME,
    structs: &[ReduceParams::text],
    per_field: &[Helper::Field, Helper::Maximum],
    helpers: &[],
};

const PROJECT: Recipe = Recipe {
    params: ProjectParams::NAME,
    structs: &[ProjectParams::text],
    per_field: &[Helper::Field],
    helpers: &[Helper::Sample, Helper::Angle, Helper::Phase, Helper::Segment],
};

const PROPAGATE: Recipe = Recipe {
    params: PropagateParams::NAME,
    structs: &[PropagateParams::text, LightPlace::text, LightFace::text],
    per_field: &[Helper::Field],
    helpers: &[Helper::Sample],
};

const RELIGHT: Recipe =
    Recipe { params: RelightParams::NAME, structs: &[RelightParams::text], per_field: &[], helpers: &[] };

const MARCH: Recipe = Recipe {
    params: MarchParams::NAME,
    structs: &[MarchParams::text, LightRecord::text, MeshRecord::text],
    per_field: &[Helper::Field],
    helpers: &[
        Helper::Sample,
        Helper::Angle,
        Helper::Phase,
        Helper::Harmonics,
        Helper::Segment,
        Helper::Light,
        Helper::Phong,
        Helper::Mesh,
        Helper::Face,
        Helper::Sky,
    ],
};

const TRACE: Recipe = Recipe {
    params: TraceParams::NAME,
    structs: &[TraceParams::text, MeshRecord::text],
    per_field: &[],
    helpers: &[Helper::View, Helper::Mesh],
};

const SHADE: Recipe = Recipe {
    params: ShadeParams::NAME,
    structs: &[ShadeParams::text, LightRecord::text, MeshRecord::text, MaterialRecord::text],
    per_field: &[Helper::Field],
    helpers: &[Helper::Sample, Helper::Angle, Helper::View, Helper::Light, Helper::Mesh],
};

const SHADOW: Recipe = Recipe {
    params: ShadowParams::NAME,
    structs: &[ShadowParams::text, LightRecord::text, MeshRecord::text],
    per_field: &[],
    helpers: &[Helper::Mesh, Helper::Face],
};

const INJECT: Recipe = Recipe {
    params: InjectParams::NAME,
    structs: &[InjectParams::text, BlobRecord::text],
    per_field: &[],
    helpers: &[Helper::Noise],
};

const UPSAMPLE: Recipe = Recipe {
    params: UpsampleParams::NAME,
    structs: &[UpsampleParams::text],
    per_field: &[],
    helpers: &[Helper::Angle, Helper::Sky],
};

const ACCUMULATE: Recipe =
    Recipe { params: AccumulateParams::NAME, structs: &[AccumulateParams::text], per_field: &[], helpers: &[] };

const COARSEN: Recipe =
    Recipe { params: CoarsenParams::NAME, structs: &[CoarsenParams::text], per_field: &[Helper::Field], helpers: &[] };

const ILLUMINATE: Recipe = Recipe {
    params: IlluminateParams::NAME,
    structs: &[IlluminateParams::text, LightRecord::text, MeshRecord::text],
    per_field: &[Helper::Field],
    helpers: &[Helper::Sample, Helper::Angle, Helper::Harmonics, Helper::Light, Helper::Mesh],
};

const OBSTRUCT: Recipe = Recipe {
    params: ObstructParams::NAME,
    structs: &[ObstructParams::text, MeshRecord::text],
    per_field: &[],
    helpers: &[Helper::Mesh],
};

const SWEEP: Recipe = Recipe {
    params: SweepParams::NAME,
    structs: &[SweepParams::text, SweepDirection::text],
    per_field: &[],
    helpers: &[Helper::Segment],
};

const PATH: Recipe = Recipe {
    params: PathParams::NAME,
    structs: &[PathParams::text, PathRecord::text, LightRecord::text, MeshRecord::text],
    per_field: &[Helper::Field],
    helpers: &[
        Helper::Angle,
        Helper::Phase,
        Helper::Light,
        Helper::Mesh,
        Helper::Sky,
        Helper::Random,
        Helper::Walk,
        Helper::Bend,
        Helper::Spot,
    ],
};

const EVALUATE: Recipe =
    Recipe { params: EvaluateParams::NAME, structs: &[EvaluateParams::text], per_field: &[], helpers: &[] };

const RECONSTRUCT: Recipe = Recipe {
    params: ReconstructParams::NAME,
    structs: &[ReconstructParams::text],
    per_field: &[],
    helpers: &[Helper::Harmonics],
};

const PHOTONS: Recipe = Recipe {
    params: PhotonParams::NAME,
    structs: &[PhotonParams::text, PhotonDirection::text],
    per_field: &[Helper::Field],
    helpers: &[Helper::Angle, Helper::Phase, Helper::Harmonics, Helper::Random, Helper::Walk, Helper::Bend],
};

const CLASSIFY: Recipe = Recipe {
    params: ClassifyParams::NAME,
    structs: &[ClassifyParams::text, ControlRecord::text],
    per_field: &[],
    helpers: &[],
};

impl Recipe {
    /// Of a stage's kernel.
    pub fn of(stage: &Stage) -> Self {
        match stage {
            Stage::Reduce(_) => REDUCE,
            Stage::Project(_) => PROJECT,
            Stage::Propagate(_) => PROPAGATE,
            Stage::Relight(_) => RELIGHT,
            Stage::March(_) => MARCH,
            Stage::Inject(_) => INJECT,
            Stage::Trace(_) => TRACE,
            Stage::Shade(_) => SHADE,
            Stage::Shadow(_) => SHADOW,
            Stage::Upsample(_) => UPSAMPLE,
            Stage::Accumulate(_) => ACCUMULATE,
            Stage::Coarsen(_) => COARSEN,
            Stage::Illuminate(_) => ILLUMINATE,
            Stage::Sweep(_) => SWEEP,
            Stage::Obstruct(_) => OBSTRUCT,
            Stage::Path(_) => PATH,
            Stage::Evaluate(_) => EVALUATE,
            Stage::Reconstruct(_) => RECONSTRUCT,
            Stage::Photons(_) => PHOTONS,
            Stage::Classify(_) => CLASSIFY,
        }
    }

    /// What is generated alike in every language: the structs, the constants that kernels share with Rust, and
    /// `has_NAME` for each binding.
    pub fn prelude(&self, language: KernelLanguage, shapes: &[Shape]) -> String {
        let mut out: String = self.structs.iter().map(|text| text(language)).collect();
        for (name, value) in [
            ("PHASE_HENYEY_GREENSTEIN", PhaseParams::HENYEY_GREENSTEIN),
            ("PHASE_RAYLEIGH", PhaseParams::RAYLEIGH),
            ("PHASE_TABLE", PhaseParams::TABLE),
            ("SHADOW_MARCH", shadow_kind::MARCH),
            ("SHADOW_COLUMN", shadow_kind::COLUMN),
            ("SHADOW_MEAN", shadow_kind::MEAN),
            ("SCHEME_SHORT_CHARACTERISTICS", scheme::SHORT_CHARACTERISTICS),
            ("SCHEME_PUBLISHED", scheme::PUBLISHED),
            ("NO_FACE", LightFace::NONE),
            ("SURFACE_SHADOW_MAP", surface_shadow::MAP),
            ("SURFACE_SHADOW_RAY", surface_shadow::RAY),
            ("MESH_COUNT_BITS", MeshRecord::COUNT_BITS),
            ("MESH_COUNT_MASK", MeshRecord::COUNT_MASK),
            ("BLOCK", March::BLOCK),
            ("ALONE_NO", alone::NO),
            ("ALONE_RIMS", alone::RIMS),
            ("JITTER_SIDE", blue_noise::SIDE),
            ("ALL_STEPS", March::ALL_STEPS),
            ("ALL_ROWS", Reduce::ALL_ROWS),
            ("TEXEL_BLOCK", BrickLayout::BLOCK),
            ("LANES", Project::LANES),
            ("NEIGHBORS", Obstruct::NEIGHBORS),
            ("BRICK", Inject::BRICK),
            ("ACCUMULATE_MOVED", accumulate_mode::MOVED),
            ("ACCUMULATE_AGAIN", accumulate_mode::AGAIN),
            ("INJECT_GAUSSIANS", inject_kind::GAUSSIANS),
            ("INJECT_HEIGHT_FOG", inject_kind::HEIGHT_FOG),
            ("NOISE_PERIOD", FractalNoise::PERIOD),
            ("PATH_IDLE", path_mode::IDLE),
            ("PATH_VIEW", path_mode::VIEW),
            ("PATH_SHADOW", path_mode::SHADOW),
            ("PATH_DEPART", path_mode::DEPART),
            ("PATH_FLIGHT", path_mode::FLIGHT),
            ("PATH_LONG", Path::LONG),
            ("CHOICE", Path::CHOICE),
            ("PHOTON_EVENTS", Photons::EVENTS),
            ("PHOTON_STRIDE", Photons::STRIDE),
            ("PHOTON_PHOTONS", photon_counter::PHOTONS),
            ("PHOTON_DEPOSITS", photon_counter::DEPOSITS),
            ("PHOTON_TRUNCATED", photon_counter::TRUNCATED),
            ("PHOTON_LOST", photon_counter::LOST),
            ("PHOTON_OVERFLOWS", photon_counter::OVERFLOWS),
            ("PHOTON_COUNTERS", photon_counter::COUNT),
            ("DEPOSIT_TRACK", photon_deposit::TRACK),
            ("DEPOSIT_COLLISION", photon_deposit::COLLISION),
            ("DEPOSIT_ABSORPTION", photon_deposit::ABSORPTION),
            ("PACK", Classify::PACK),
            ("CLASSIFY_REACH", classify_kind::REACH),
            ("CLASSIFY_COLOR", classify_kind::COLOR),
            ("CLASSIFY_SCATTERING", classify_kind::SCATTERING),
            ("CLASSIFY_SEEN", classify_kind::SEEN),
            ("HARMONICS_MAX", SphericalHarmonics::DEVICE_BANDS.pow(2)),
        ] {
            out += &language.integer(name, value);
        }
        for (name, value) in [
            ("FAR", FAR),
            ("REDUCE_SLACK", Reduce::SLACK),
            ("REDUCE_BEYOND", Reduce::BEYOND),
            ("INJECT_FAR", Inject::FAR),
            ("DENSITY_MAX", LARGEST),
            ("MESH_SLACK", MeshRecord::SLACK),
            ("MESH_MARGIN", MeshRecord::MARGIN),
            ("MARCH_RIM", March::RIM),
            ("PHONG_FLAT", March::FLAT),
            ("UNMARCHED", March::UNMARCHED),
            ("UPSAMPLE_NEAR", Upsample::NEAR),
            ("UPSAMPLE_COSINE", Upsample::COSINE),
            ("UPSAMPLE_FIT", Upsample::FIT),
            ("ACCUMULATE_NEAR", Accumulate::NEAR),
            ("ACCUMULATE_FIT", Accumulate::FIT),
            ("PATH_FAINT", Path::FAINT),
            ("PATH_WEAK", Path::WEAK),
            ("PHOTON_WEAK", Photons::WEAK),
        ] {
            out += &language.float(name, value);
        }
        for shape in shapes {
            out += &language.truth(&format!("has_{}", shape.name), shape.present);
        }
        out
    }
}

/// What a kernel's text depends on beyond its files, one for each binding of the stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Shape {
    /// Name in the kernels.
    pub name: &'static str,
    /// How it is bound.
    pub kind: ShapeKind,
    /// What a buffer's element or a field's texel is.
    pub element: KernelElement,
    /// Whether the stage runs with it.
    pub present: bool,
}

/// How a resource is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ShapeKind {
    /// A buffer that is read.
    Read,
    /// A buffer that is written.
    Write,
    /// A field.
    Field {
        /// Slabs that it is held in.
        slabs: u32,
        /// Whether it has more layers than one.
        layered: bool,
        /// What a texel holds.
        format: FieldFormat,
        /// Whether it is held in bricks.
        bricks: bool,
    },
}

impl Shape {
    /// Of a binding whose field, if it is one, is held in so many slabs.
    pub fn new(binding: &Binding, slabs: u32) -> Self {
        let kind = match binding.access {
            BindingAccess::Sample(spec) => {
                let bricks = spec.layout != Layout::Dense;
                ShapeKind::Field { slabs, layered: spec.layers > 1, format: spec.format, bricks }
            }
            BindingAccess::Read(_) => ShapeKind::Read,
            BindingAccess::Write(_) => ShapeKind::Write,
        };
        Self { name: binding.name, kind, element: binding.element, present: binding.id.is_some() }
    }
}

/// A kernel's whole text, which knows the files that its lines come from.
#[derive(Clone, Debug, Default)]
pub struct KernelText {
    /// The text.
    pub whole: String,
    /// First line of each part (from 1), and its file.
    parts: Vec<(usize, &'static str)>,
}

impl KernelText {
    /// The text of a stage's kernel: `prelude`, the helpers, and the kernel's own file. In helpers that stand once for
    /// each field, `FIELD` is the field's name and `VALUE` the type of its texels. OpenCL C gets a `#line` directive
    /// before each file, so that its compiler names the files itself.
    pub fn new(
        language: KernelLanguage,
        prelude: &str,
        recipe: &Recipe,
        shapes: &[Shape],
        helper: impl Fn(Helper) -> KernelFile,
        kernel: KernelFile,
    ) -> Self {
        let mut text = Self::default();
        let mut push = |name: &'static str, part: &str| {
            if language == KernelLanguage::Opencl {
                text.whole += &format!("#line 1 \"{name}\"\n");
            }
            text.push(name, part);
        };
        push("generated", prelude);
        for file in recipe.per_field.iter().map(|&of| helper(of)) {
            for field in shapes.iter().filter(|shape| matches!(shape.kind, ShapeKind::Field { .. })) {
                push(file.name, &file.text.replace("FIELD", field.name).replace("VALUE", field.element.name(language)));
            }
        }
        for file in recipe.helpers.iter().map(|&of| helper(of)).chain([kernel]) {
            push(file.name, file.text);
        }
        text
    }

    /// Adds the text of a file.
    pub fn push(&mut self, name: &'static str, text: &str) {
        self.parts.push((self.whole.lines().count() + 1, name));
        self.whole.push_str(text);
        if !text.ends_with('\n') {
            self.whole.push('\n');
        }
    }

    /// File and line of line `line` (from 1) of the whole.
    pub fn place(&self, line: usize) -> (&'static str, usize) {
        let part = self.parts.iter().rev().find(|(first, _)| *first <= line);
        part.map_or(("generated", line), |(first, name)| (name, line - first + 1))
    }
}

#[cfg(test)]
mod tests;
