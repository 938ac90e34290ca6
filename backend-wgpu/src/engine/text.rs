//! The text of the kernels for engines.

use std::fmt::Write as _;

use airlight_core::device::{KernelLanguage, KernelStruct};
use airlight_core::kernel_struct;
use airlight_core::scene::Background;
use wgpu::TextureFormat;

use super::textures::{Kind, format_name};
use crate::source::{Text, uniforms};

kernel_struct! {
    /// Parameters of `import_surface`.
    pub struct ImportParams {
        /// Axis f of the camera, as `march` has it.
        forward: F32x4,
        /// Axis r.
        right: F32x4,
        /// Axis u.
        up: F32x4,
        /// Column of the inverse projection.
        inverse_x: F32x4,
        /// See `inverse_x`.
        inverse_y: F32x4,
        /// See `inverse_x`.
        inverse_z: F32x4,
        /// See `inverse_x`.
        inverse_w: F32x4,
        /// Columns of the picture.
        width: U32,
        /// Rows of the picture.
        height: U32,
        /// What the depth says: a constant of [`depth_kind`].
        kind: U32,
        /// Projected depth of no surface.
        empty: F32,
    }
}

kernel_struct! {
    /// Parameters of `export_film`.
    pub struct ExportParams {
        /// Columns of the picture.
        width: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

/// What the texels of a depth texture say.
pub(super) mod depth_kind {
    pub(crate) const DISTANCE: u32 = 0;
    pub(crate) const AXIS: u32 = 1;
    pub(crate) const PROJECTED: u32 = 2;
}

/// Pixels of a workgroup.
pub(super) const UNITS: u32 = 64;

const WGSL: KernelLanguage = KernelLanguage::Wgsl;

fn prelude<P: KernelStruct>() -> String {
    P::text(WGSL) + &uniforms(P::NAME, false)
}

fn whole(generated: &str, name: &'static str, text: &str) -> Text {
    let mut whole = Text::default();
    whole.push("generated", generated);
    whole.push(name, text);
    whole
}

/// `import_surface` of colour and depth, where they are there.
pub(super) fn import([color, depth]: [Option<Kind>; 2]) -> Text {
    let mut out = prelude::<ImportParams>();
    out += &WGSL.float("FAR", Background::FAR);
    out += &WGSL.truth("has_color", color.is_some());
    out += &WGSL.integer("DEPTH_DISTANCE", depth_kind::DISTANCE);
    out += &WGSL.integer("DEPTH_AXIS", depth_kind::AXIS);
    let mut binding = 0;
    let mut texture = |name: &str, kind: Option<Kind>, value: &str, load: &str, none: &str| {
        let mut body = none.to_owned();
        if let Some(kind) = kind {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "@group(2) @binding({binding}) var {name}: {};", kind.wgsl());
            binding += 1;
            body = format!("textureLoad({name}, at, 0){}", if kind == Kind::Depth { "" } else { load });
        }
        let _ = writeln!(out, "fn {name}_at(at: vec2<u32>) -> {value} {{\n    return {body};\n}}");
    };
    texture("color", color, "vec3<f32>", ".xyz", "vec3<f32>(0.0)");
    texture("depth", depth, "f32", ".x", "-1.0");
    whole(&out, "import.wgsl", include_str!("import.wgsl"))
}

/// `export_film` into textures of these formats: beauty and transmittance.
pub(super) fn export(formats: [Option<TextureFormat>; 2]) -> Text {
    let mut out = prelude::<ExportParams>();
    let mut binding = 0;
    for (name, format) in ["beauty", "transmittance"].into_iter().zip(formats) {
        let mut body = String::new();
        if let Some(format) = format {
            let texel = format_name(format);
            let _ = writeln!(out, "@group(2) @binding({binding}) var {name}: texture_storage_2d<{texel}, write>;");
            binding += 1;
            let value = if format == TextureFormat::Rgba16Float { "held(value)" } else { "value" };
            body = format!("    textureStore({name}, at, {value});\n");
        }
        let _ = writeln!(out, "fn store_{name}(at: vec2<u32>, value: vec4<f32>) {{\n{body}}}");
    }
    whole(&out, "export.wgsl", include_str!("export.wgsl"))
}
