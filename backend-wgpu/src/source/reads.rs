//! `read_NAME`, by which kernels read an element of a buffer that they do not write; `read_four_NAME`, by which they read four words; and
//! `read_along_NAME`, by which they read four floats wherever they begin; `put_NAME`, by which they write four.

use std::iter;
use std::ops::Range;

use airlight_core::device::{KernelElement, KernelScalar, Shape};

use super::{Fetched, WGSL, slab_binding};

/// Texels in a row of a buffer's copy; a power of two, whose rows of texels of any size a copy may begin at.
pub(crate) const TEXELS_ACROSS: u32 = 1 << 14;

/// Words of a texel of the copy that an element is read from, where kernels do not read four words at a time.
pub(crate) fn words(element: KernelElement) -> u32 {
    match element {
        // Two words are texels of their own: those that nobody asks for are not read, and words are gathered.
        KernelElement::Scalar(KernelScalar::F32 | KernelScalar::U32) | KernelElement::Atomic | KernelElement::F32x2 => {
            1
        }
        KernelElement::Scalar(KernelScalar::F32x4 | KernelScalar::U32x4) | KernelElement::Struct(_) => 4,
    }
}

/// Of a buffer of words: whether a texel is four of them; the function that reads four that follow each other; and of floats the one
/// that reads four from `n` floats after texel `i` on.
fn four(shape: &Shape, texel: bool, body: &str) -> String {
    let (name, element) = (shape.name, shape.element.name(WGSL));
    if !matches!(shape.element, KernelElement::Scalar(KernelScalar::F32 | KernelScalar::U32)) {
        return String::new();
    }
    let head = WGSL.truth(&format!("fours_{name}"), texel)
        + &format!("fn read_four_{name}(i: u32) -> vec4<{element}> {{\n    return {body};\n}}\n");
    if shape.element == KernelElement::Scalar(KernelScalar::U32) {
        return head;
    }
    let along = if texel {
        format!("from_two(read_four_{name}(i + n / 4u), read_four_{name}(i + n / 4u + 1u), n % 4u)")
    } else {
        let words = [0, 1, 2, 3].map(|word| format!("read_{name}(4u * i + n + {word}u)")).join(", ");
        format!("vec4<f32>({words})")
    };
    head + &format!("fn read_along_{name}(i: u32, n: u32) -> vec4<f32> {{\n    return {along};\n}}\n")
}

/// From memory: the buffer, and the functions that read an element, and four that follow each other.
pub(crate) fn memory(shape: &Shape, index: usize) -> String {
    let (name, element) = (shape.name, shape.element.name(WGSL));
    let words = [0, 1, 2, 3].map(|n| format!("{name}[4u * i + {n}u]")).join(", ");
    four(shape, false, &format!("vec4<{element}>({words})"))
        + &format!(
            "@group(1) @binding({index}) var<storage, read> {name}: array<{element}>;\nfn read_{name}(i: u32) -> {element} \
         {{\n    return {name}[i];\n}}\nfn length_{name}() -> u32 {{\n    return arrayLength(&{name});\n}}\n"
        )
}

/// Texels of four floats that a kernel writes, and may read.
pub(crate) fn held(shape: &Shape, index: usize) -> String {
    let (name, binding, at) = (shape.name, slab_binding(index, 0), place("i"));
    format!(
        "@group(2) @binding({binding}) var {name}: texture_storage_2d<rgba32uint, read_write>;\nfn read_{name}(i: u32) -> \
         vec4<f32> {{\n    return bitcast<vec4<f32>>(textureLoad({name}, {at}));\n}}\nfn write_{name}(i: u32, value: \
         vec4<f32>) {{\n    textureStore({name}, {at}, bitcast<vec4<u32>>(value));\n}}\n"
    )
}

/// A buffer of floats that a kernel reads and writes, or where `held` its copy: the functions that do, and the one that waits for what
/// others of a workgroup wrote.
pub(crate) fn rewritten(shape: &Shape, index: usize, held: bool) -> String {
    let (name, binding, at) = (shape.name, slab_binding(index, 0), place("i"));
    let (declared, read, write, wait) = if held {
        (
            format!("@group(2) @binding({binding}) var {name}: texture_storage_2d<r32uint, read_write>;\n"),
            format!("bitcast<f32>(textureLoad({name}, {at}).x)"),
            format!("textureStore({name}, {at}, vec4<u32>(bitcast<u32>(v)))"),
            "textureBarrier",
        )
    } else {
        (super::buffer(shape, index), format!("{name}[i]"), format!("{name}[i] = v"), "storageBarrier")
    };
    format!(
        "{declared}fn read_{name}(i: u32) -> f32 {{\n    return {read};\n}}\nfn write_{name}(i: u32, v: f32) {{\n    {write};\n}}\nfn \
         wait_{name}() {{\n    {wait}();\n}}\n"
    )
}

/// A buffer of floats that a kernel writes by four, or singly where it says so: the functions that do. Where `pairs` two floats are
/// an integer of 64 bits, which drivers that store one value of one invocation at a time store at once; that is not for kernels that
/// write single floats.
pub(crate) fn wide(shape: &Shape, index: usize, pairs: bool) -> String {
    let (name, element) = (shape.name, shape.element.name(WGSL));
    let single = shape.element == KernelElement::Scalar(KernelScalar::F32);
    let stored = if pairs { "vec2<u64>" } else { element };
    let put = match (pairs, single) {
        (true, _) => format!("{name}[i] = vec2<u64>(two(v.xy), two(v.zw));"),
        (false, true) => [0, 1, 2, 3].map(|n| format!("{name}[4u * i + {n}u] = v[{n}];")).join(" "),
        (false, false) => format!("{name}[i] = v;"),
    };
    let text = format!("@group(1) @binding({index}) var<storage, read_write> {name}: array<{stored}>;\n")
        + &format!("fn put_{name}(i: u32, v: vec4<f32>) {{\n    {put}\n}}\n");
    if !single {
        return text;
    }
    let write = if pairs { String::new() } else { format!("    {name}[i] = v;\n") };
    text + &format!("fn write_{name}(i: u32, v: f32) {{\n{write}}}\n")
}

/// Two floats as an integer, for [`wide`].
pub(crate) const TWO: &str = "fn two(v: vec2<f32>) -> u64 {\n    let words = bitcast<vec2<u32>>(v);\n    return u64(words.x) | (u64(words.y) << \
                              32u);\n}\n";

/// Where texel `n` of a copy is.
fn place(n: &str) -> String {
    let shift = TEXELS_ACROSS.trailing_zeros();
    format!("vec2<u32>({n} & {}u, {n} >> {shift}u)", TEXELS_ACROSS - 1)
}

/// From a copy: the texture, and the functions that put an element together, and four that follow each other. `structs` is the text
/// of the kernel's structs.
pub(crate) fn texels(shape: &Shape, index: usize, fetched: Fetched, structs: &str) -> String {
    let (name, element) = (shape.name, shape.element.name(WGSL));
    let binding = slab_binding(index, 0);
    let load = |n: &str| format!("textureLoad({name}, {})", place(n));
    let words = fetched.words(index, shape.element);
    let body = match shape.element {
        KernelElement::Scalar(KernelScalar::F32 | KernelScalar::U32) if words == 4 => format!(
            "    let four = read_four_{name}(i >> 2u);\n    let near = select(four.x, four.y, (i & 1u) == 1u);\n    let far = \
             select(four.z, four.w, (i & 1u) == 1u);\n    return select(near, far, (i & 2u) == 2u);\n"
        ),
        KernelElement::Scalar(KernelScalar::U32) => format!("    return {}.x;\n", load("i")),
        KernelElement::Scalar(KernelScalar::U32x4) => format!("    return {};\n", load("i")),
        KernelElement::Scalar(KernelScalar::F32) => format!("    return bitcast<f32>({}.x);\n", load("i")),
        KernelElement::Scalar(KernelScalar::F32x4) => format!("    return bitcast<vec4<f32>>({});\n", load("i")),
        KernelElement::F32x2 => {
            let (x, y) = (load("n"), load("(n + 1u)"));
            format!("    let n = 2u * i;\n    return bitcast<vec2<f32>>(vec2<u32>({x}.x, {y}.x));\n")
        }
        KernelElement::Atomic => format!("    return bitcast<i32>({}.x);\n", load("i")),
        KernelElement::Struct(of) => record(&fields(structs, of), of, load),
    };
    let format = if words == 1 { "r32uint" } else { "rgba32uint" };
    let of_four = if words == 1 {
        let words = [0, 1, 2, 3].map(|n| format!("read_{name}(4u * i + {n}u)")).join(", ");
        format!("vec4<{element}>({words})")
    } else {
        format!("bitcast<vec4<{element}>>({})", load("i"))
    };
    four(shape, words == 4, &of_four)
        + &format!(
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

/// A field of parameters of which kernels may know something when they are built.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// One integer or four, which say what a kernel has to do: which of the words.
    Integers(Range<usize>),
    /// Four floats.
    Floats(Range<usize>),
}

/// What is known of a field.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Fact {
    /// The words of integers.
    Words(Vec<u32>),
    /// Floats are zero: something that there is not.
    Zero,
    /// The first three of the floats are the same: a color that is grey.
    Grey,
    /// Floats are neither.
    Colored,
}

impl Place {
    /// What parameters tell of it.
    pub(crate) fn fact(&self, params: &[u32]) -> Fact {
        match self {
            Self::Integers(at) => Fact::Words(params[at.clone()].to_vec()),
            Self::Floats(at) => match params[at.clone()] {
                [0, 0, 0, 0] => Fact::Zero,
                [x, y, z, _] if x == y && y == z => Fact::Grey,
                _ => Fact::Colored,
            },
        }
    }
}

impl Fact {
    /// The statement by which a kernel learns it of the field `name`; nothing where it tells nothing.
    fn statement(&self, name: &str) -> Option<String> {
        match self {
            Self::Words(words) => Some(match &words[..] {
                [word] => format!(" kept_params.{name} = {word}u;"),
                words => {
                    let words: Vec<_> = words.iter().map(|word| format!("{word}u")).collect();
                    format!(" kept_params.{name} = vec4<u32>({});", words.join(", "))
                }
            }),
            Self::Zero => Some(format!(" kept_params.{name} = vec4<f32>();")),
            Self::Grey | Self::Colored => None,
        }
    }
}

/// What kernels may know of a struct of parameters: names of fields, and where they stand.
pub(crate) fn places<'t>(structs: &'t str, name: &str) -> Vec<(&'t str, Place)> {
    let (mut at, mut found) = (0, Vec::new());
    for (name, kind) in fields(structs, name) {
        let end = at + if word(kind) { 1 } else { 4 };
        if kind.contains("u32") {
            found.push((name, Place::Integers(at..end)));
        } else if !word(kind) {
            found.push((name, Place::Floats(at..end)));
        }
        at = end;
    }
    found
}

/// For each of the places of four floats of a struct of parameters, whether its first three are known to be the same. Only
/// kernels that say what follows give the same bits with and without it: drivers rearrange sums of what they see to be equal.
pub(crate) fn greys(structs: &str, name: &str, known: &[Option<Fact>]) -> String {
    let places = places(structs, name).into_iter().zip(known.iter().map(Option::as_ref).chain(iter::repeat(None)));
    let floats = places.filter(|((_, place), _)| matches!(place, Place::Floats(_)));
    let grey = floats
        .map(|((name, _), fact)| WGSL.truth(&format!("grey_{name}"), matches!(fact, Some(Fact::Zero | Fact::Grey))));
    grey.collect()
}

/// A kernel's text that copies its parameters, a struct of that `name`, into `kept_params` before all else, at each of its entry
/// points, and writes over them what is known. Lines stay where they are.
///
/// What is not known is joined with zeros that drivers cannot tell to be zero. Mesa's makes kernels anew for the values of uniforms
/// that alone decide a condition, with every dispatch for which they change: some ten milliseconds, or a whole compilation.
pub(crate) fn kept(text: &str, structs: &str, name: &str, known: &[(&str, &Fact)]) -> String {
    let mut parts = text.split("params.");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let within = out.ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_');
        out += if within { "params." } else { "kept_params." };
        out += part;
    }
    let fact = |name| known.iter().find(|(known, _)| *known == name).and_then(|(_, fact)| fact.statement(name));
    let copied = fields(structs, name).into_iter().map(|(name, kind)| fact(name).unwrap_or_else(|| hidden(name, kind)));
    let copied: String = copied.collect();
    let mut parts = out.split("@compute");
    let mut whole = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (head, body) = part.split_at(part.find(") {\n").map_or(0, |end| end + 3));
        whole += &format!("@compute{head} kept_params = params; let none = id.x >> 31u;{copied}{body}");
    }
    whole
}

/// The statement that hides a field of the copy from drivers, by the highest bit of a workgroup's number.
fn hidden(name: &str, kind: &str) -> String {
    match kind {
        "u32" => format!(" kept_params.{name} |= none;"),
        "vec4<u32>" => format!(" kept_params.{name} |= vec4<u32>(none);"),
        _ => {
            let bits = kind.replace("f32", "u32");
            format!(" kept_params.{name} = bitcast<{kind}>(bitcast<{bits}>(kept_params.{name}) | {bits}(none));")
        }
    }
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
    fn kernels_copy_their_parameters_and_what_is_known_of_them() {
        let structs = "struct P {\n    a: vec4<f32>,\n    some: u32,\n    b: f32,\n    c: u32,\n    d: vec4<u32>,\n    e: vec4<f32>,\n}\n";
        let found = places(structs, "P");
        let (floats, integers) = (Place::Floats, Place::Integers);
        let expected = [
            ("a", floats(0..4)),
            ("some", integers(4..5)),
            ("c", integers(6..7)),
            ("d", integers(7..11)),
            ("e", floats(11..15)),
        ];
        assert_eq!(found, expected);
        let mut words = [9, 9, 9, 4, 7, 1, 8, 1, 2, 3, 4, 0, 0, 0, 0];
        let facts: Vec<_> = found.iter().map(|(name, place)| (*name, place.fact(&words))).collect();
        let known: Vec<_> = facts.iter().filter(|(name, _)| *name != "c").map(|(name, fact)| (*name, fact)).collect();
        let text = "fn f() -> f32 { return params.b * my_params.c; }\n@compute\nfn k(id: u32) {\n    let x = params.some;\n}\n";
        let expected = "fn f() -> f32 { return kept_params.b * my_params.c; }\n@compute\nfn k(id: u32) { kept_params = params; \
                        let none = id.x >> 31u; \
                        kept_params.a = bitcast<vec4<f32>>(bitcast<vec4<u32>>(kept_params.a) | vec4<u32>(none)); \
                        kept_params.some = 7u; \
                        kept_params.b = bitcast<f32>(bitcast<u32>(kept_params.b) | u32(none)); kept_params.c |= none; \
                        kept_params.d = vec4<u32>(1u, 2u, 3u, 4u); \
                        kept_params.e = vec4<f32>();\n    let x = kept_params.some;\n}\n";
        assert_eq!(kept(text, structs, "P", &known), expected);
        words[2] = 8;
        assert_eq!(found[0].1.fact(&words), Fact::Colored);
        let known: Vec<_> = facts.into_iter().map(|(_, fact)| Some(fact)).collect();
        let grey = |a, e| format!("const grey_a: bool = {a};\nconst grey_e: bool = {e};\n");
        assert_eq!(greys(structs, "P", &known), grey(true, true));
        assert_eq!(greys(structs, "P", &[]), grey(false, false));
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
