//! `read_NAME`, by which kernels read an element of a buffer that they do not write.

use std::ops::Range;

use airlight_core::device::{KernelElement, KernelScalar, Shape};

use super::{WGSL, slab_binding};

/// Texels in a row of a buffer's copy; a power of two, whose rows of texels of any size a copy may begin at.
pub(crate) const TEXELS_ACROSS: u32 = 1 << 14;

/// Words of a texel of the copy that an element is read from.
pub(crate) fn words(element: KernelElement) -> u32 {
    match element {
        KernelElement::Scalar(KernelScalar::F32 | KernelScalar::U32) | KernelElement::Atomic => 1,
        KernelElement::F32x2 => 2,
        KernelElement::Scalar(KernelScalar::F32x4 | KernelScalar::U32x4) | KernelElement::Struct(_) => 4,
    }
}

/// From memory: the buffer, and the function that reads an element.
pub(crate) fn memory(shape: &Shape, index: usize) -> String {
    let (name, element) = (shape.name, shape.element.name(WGSL));
    format!(
        "@group(1) @binding({index}) var<storage, read> {name}: array<{element}>;\nfn read_{name}(i: u32) -> {element} \
         {{\n    return {name}[i];\n}}\nfn length_{name}() -> u32 {{\n    return arrayLength(&{name});\n}}\n"
    )
}

/// From a copy: the texture, and the function that puts an element together. `structs` is the text of the kernel's structs.
pub(crate) fn texels(shape: &Shape, index: usize, structs: &str) -> String {
    let (name, element) = (shape.name, shape.element.name(WGSL));
    let binding = slab_binding(index, 0);
    let load = |n: &str| {
        let shift = TEXELS_ACROSS.trailing_zeros();
        format!("textureLoad({name}, vec2<u32>({n} & {}u, {n} >> {shift}u))", TEXELS_ACROSS - 1)
    };
    let body = match shape.element {
        KernelElement::Scalar(KernelScalar::U32) => format!("    return {}.x;\n", load("i")),
        KernelElement::Scalar(KernelScalar::U32x4) => format!("    return {};\n", load("i")),
        KernelElement::Scalar(KernelScalar::F32) => format!("    return bitcast<f32>({}.x);\n", load("i")),
        KernelElement::Scalar(KernelScalar::F32x4) => format!("    return bitcast<vec4<f32>>({});\n", load("i")),
        KernelElement::F32x2 => format!("    return bitcast<vec2<f32>>({}.xy);\n", load("i")),
        KernelElement::Atomic => format!("    return bitcast<i32>({}.x);\n", load("i")),
        KernelElement::Struct(of) => record(&fields(structs, of), of, load),
    };
    let format = ["r32uint", "rg32uint", "rgba32uint"][words(shape.element).ilog2() as usize];
    format!(
        "@group(2) @binding({binding}) var {name}: texture_storage_2d<{format}, read>;\nfn read_{name}(i: u32) -> {element} \
         {{\n{body}}}\nfn length_{name}() -> u32 {{\n    return textureDimensions({name}).x;\n}}\n"
    )
}

/// Names and types of a struct's fields, from its generated text: a line each.
fn fields<'t>(structs: &'t str, name: &str) -> Vec<(&'t str, &'t str)> {
    let text = structs.split(&format!("struct {name} {{\n")).nth(1).unwrap_or_default();
    let lines = text.lines().take_while(|line| *line != "}");
    lines.filter_map(|line| line.trim().trim_end_matches(',').split_once(": ")).collect()
}

/// Whether a field is a word, in place of a vector.
fn word(kind: &str) -> bool {
    matches!(kind, "f32" | "u32")
}

/// The integers of a struct of parameters, which say what a kernel has to do: their names, and which of its words they are.
pub(crate) fn integers<'t>(structs: &'t str, name: &str) -> Vec<(&'t str, Range<usize>)> {
    let (mut at, mut found) = (0, Vec::new());
    for (name, kind) in fields(structs, name) {
        let end = at + if word(kind) { 1 } else { 4 };
        if kind.contains("u32") {
            found.push((name, at..end));
        }
        at = end;
    }
    found
}

/// A text with numbers in place of the fields `params.NAME`.
pub(crate) fn replaced(text: &str, known: &[(&str, &[u32])]) -> String {
    let mut parts = text.split("params.");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(part.len());
        match known.iter().find(|(name, _)| *name == &part[..end]) {
            Some((_, [value])) => out += &format!("{value}u{}", &part[end..]),
            Some((_, values)) => {
                let values: Vec<_> = values.iter().map(|value| format!("{value}u")).collect();
                out += &format!("vec4<u32>({}){}", values.join(", "), &part[end..]);
            }
            None => out = out + "params." + part,
        }
    }
    out
}

/// The body that puts a struct together from texels of four words, of which scalars take one each.
fn record(fields: &[(&str, &str)], name: &str, load: impl Fn(&str) -> String) -> String {
    let (mut words, mut values) = (0, Vec::new());
    for (_, kind) in fields {
        let texel = words / 4;
        let part = if word(kind) { [".x", ".y", ".z", ".w"][words % 4] } else { "" };
        let value = format!("bitcast<{kind}>(t{texel}{part})");
        words += if word(kind) { 1 } else { 4 };
        values.push(value);
    }
    let texels = words.div_ceil(4);
    let loads: String = (0..texels).map(|t| format!("    let t{t} = {};\n", load(&format!("(n + {t}u)")))).collect();
    format!("    let n = i * {texels}u;\n{loads}    return {name}({});\n", values.join(", "))
}

#[cfg(test)]
mod tests {
    use airlight_core::device::{KernelLanguage, KernelStruct as _};
    use airlight_core::stage::{BlobRecord, LightRecord};

    use super::*;

    #[test]
    fn fields_of_a_struct_are_those_of_rust() {
        let text = BlobRecord::text(KernelLanguage::Wgsl) + &LightRecord::text(KernelLanguage::Wgsl);
        for (name, expected) in [(BlobRecord::NAME, BlobRecord::FIELDS), (LightRecord::NAME, LightRecord::FIELDS)] {
            let expected: Vec<_> =
                expected.iter().map(|field| (field.name, field.scalar.name(KernelLanguage::Wgsl))).collect();
            assert_eq!(fields(&text, name), expected);
        }
    }

    #[test]
    fn integers_of_parameters_become_numbers_and_nothing_else_does() {
        let text = "struct P {\n    a: vec4<f32>,\n    some: u32,\n    b: f32,\n    some_more: u32,\n    c: u32,\n    d: vec4<u32>,\n}\n";
        assert_eq!(integers(text, "P"), [("some", 4..5), ("some_more", 6..7), ("c", 7..8), ("d", 8..12)]);
        let known: [(&str, &[u32]); 3] = [("some", &[7]), ("some_more", &[9]), ("d", &[1, 2, 3, 4])];
        let replaced =
            replaced("if params.some < params.some_more + params.b * my_params.somewhere + params.d.w {", &known);
        assert_eq!(replaced, "if 7u < 9u + params.b * my_params.somewhere + vec4<u32>(1u, 2u, 3u, 4u).w {");
    }

    #[test]
    fn scalars_share_a_texel_and_vectors_have_one() {
        let body =
            record(&[("", "f32"), ("", "u32"), ("", "f32"), ("", "f32"), ("", "vec4<f32>")], "A", |n| format!("at{n}"));
        let expected = "    let n = i * 2u;\n    let t0 = at(n + 0u);\n    let t1 = at(n + 1u);\n    return \
                        A(bitcast<f32>(t0.x), bitcast<u32>(t0.y), bitcast<f32>(t0.z), bitcast<f32>(t0.w), \
                        bitcast<vec4<f32>>(t1));\n";
        assert_eq!(body, expected);
    }
}
