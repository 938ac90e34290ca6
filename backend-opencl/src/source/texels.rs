//! Texels of a field: where they lie and what they hold. Lookups of all fields stand on these (`kernels/field.cl`). Of
//! floats they take a texel a lane, of colours one.

use std::fmt::Write as _;

use airlight_core::device::FieldFormat;

use super::{OPENCL, Shape, ShapeKind, bricks};

/// The functions of a field in a kernel of so many lanes.
pub(super) fn texels(shape: &Shape, width: u32) -> String {
    let ShapeKind::Field { bricks, .. } = shape.kind else { return String::new() };
    let (name, value) = (shape.name, shape.element.name(OPENCL));
    let mut out = if bricks { bricks::places(shape) } else { places(shape) };
    out += &held(shape, width);
    let _ = writeln!(
        out,
        "{value} texel_{name}(const Bound *bound, int3 at, int3 size, int layer) {{
    TEXEL_{value} from =
        place_{name}(bound, (INDEX_{value})(at.x), (INDEX_{value})(at.y), (INDEX_{value})(at.z), size, layer);
    return one_{name}(bound, FIRST_{value}(from.slab), FIRST_{value}(from.place));
}}"
    );
    out += &if bricks { bricks::uniform(shape) } else { uniform(shape) };
    if value == "float" {
        out += &run(shape, width);
    }
    out
}

/// The function that reads a run of texels along x, from one on: zeros in lanes past its last.
fn run(shape: &Shape, width: u32) -> String {
    let ShapeKind::Field { slabs, layered, format, .. } = shape.kind else { return String::new() };
    let name = shape.name;
    let halves = matches!(format, FieldFormat::Half { .. });
    let found = match () {
        () if width > 1 && slabs == 1 && !layered && halves => {
            let bits =
                format!("to_uint(OF_WIDTH(vload, WIDTH)(0, (__global const ushort *)bound->{name}_0 + place)) << 16");
            OPENCL.scaled(format, &format!("from_half({bits})"))
        }
        () if width > 1 && slabs == 1 && !layered => format!("pack(bound->{name}_0 + place)"),
        () => {
            let hop = if layered { format!(" * bound->{name}_layers") } else { String::new() };
            format!("texels_{name}(bound, (TEXEL_float){{from.slab, from.place + min(lane, count - 1){hop}}})")
        }
    };
    format!(
        "INLINE F run_{name}(const Bound *bound, int3 at, int count, int3 size) {{
    I lane = as_signed(LANE);
    TEXEL_float from = place_{name}(bound, (I)(at.x), (I)(at.y), (I)(at.z), size, 0);
    int place = first_lane(from.place);
    F found = {found};
    return lane < count ? found : (F)(0.0f);
}}
"
    )
}

/// The functions that find a texel of a dense field, layer fastest, then x, y and z; the same texel a slice on, within the
/// field; and how far it is to the next along y and x, within the field.
fn places(shape: &Shape) -> String {
    let ShapeKind::Field { slabs, layered, .. } = shape.kind else { return String::new() };
    let (name, value) = (shape.name, shape.element.name(OPENCL));
    let layers = if layered { format!(" * bound->{name}_layers") } else { String::new() };
    let layer = if layered { " + layer" } else { "" };
    // All slabs but the last have the slices of the first.
    let (slab, z) = match slabs {
        1 => ("0".to_owned(), "z".to_owned()),
        _ => (format!("z / bound->{name}_per_slab"), format!("(z % bound->{name}_per_slab)")),
    };
    let next = |axis: &str, hop: &str| {
        format!("{axis} < size.{axis} - 1 ? (INDEX_{value})({hop}{layers}) : (INDEX_{value})(0)")
    };
    let behind = match slabs {
        1 => format!("at.place += {};\n    return at;", next("z", "size.x * size.y")),
        _ => format!("return place_{name}(bound, x, y, min(z + 1, (INDEX_{value})(size.z - 1)), size, layer);"),
    };
    let (below, beside) = (next("y", "size.x"), next("x", "1"));
    format!(
        "INLINE TEXEL_{value} place_{name}(const Bound *bound, INDEX_{value} x, INDEX_{value} y, INDEX_{value} z,
    int3 size, int layer) {{
    TEXEL_{value} at;
    at.slab = (INDEX_{value})({slab});
    at.place = (({z} * size.y + y) * size.x + x){layers}{layer};
    return at;
}}
INLINE TEXEL_{value} behind_{name}(const Bound *bound, TEXEL_{value} at, INDEX_{value} x, INDEX_{value} y, INDEX_{value} z,
    int3 size, int layer) {{
    {behind}
}}
INLINE INDEX_{value} below_{name}(const Bound *bound, INDEX_{value} y, int3 size) {{
    return {below};
}}
INLINE INDEX_{value} beside_{name}(const Bound *bound, INDEX_{value} x, int3 size) {{
    return {beside};
}}
"
    )
}

/// The functions that read a texel, what each lane's is, and the next along x with it: of floats that lie side by side by one
/// load a lane.
fn held(shape: &Shape, width: u32) -> String {
    let ShapeKind::Field { slabs, layered, format, .. } = shape.kind else { return String::new() };
    let (name, value) = (shape.name, shape.element.name(OPENCL));
    let one = format!(
        "INLINE {value} one_{name}(const Bound *bound, int slab, int place) {{\n{}}}\n",
        load(name, format, slabs)
    );
    let halves = matches!(format, FieldFormat::Half { .. });
    let found = match () {
        () if width == 1 || value != "float" => format!("    return one_{name}(bound, at.slab, at.place);\n"),
        () if slabs > 1 => format!(
            "    int slab[WIDTH];\n    int place[WIDTH];\n    float found[WIDTH];\n    unpack(at.slab, slab);\n    \
             unpack(at.place, place);\n    for (uint i = 0u; i < WIDTH; i++) {{\n        found[i] = one_{name}(bound, \
             slab[i], place[i]);\n    }}\n    return pack(found);\n"
        ),
        () if halves => {
            format!(
                "    return {};\n",
                OPENCL.scaled(format, &format!("from_half(fetch_ushort(bound->{name}_0, at.place) << 16)"))
            )
        }
        () => format!("    return fetch(bound->{name}_0, at.place);\n"),
    };
    let together = width > 1 && value == "float" && slabs == 1 && !layered;
    let both = match () {
        () if together && halves => {
            let scaled = |bits| OPENCL.scaled(format, &format!("from_half({bits})"));
            format!(
                "    U bits = fetch_halves(bound->{name}_0, at.place);\n    PAIR_{value} pair;\n    \
                 pair.near = {};\n    pair.far = {};\n    return pair;\n",
                scaled("bits << 16"),
                scaled("bits")
            )
        }
        () if together => format!("    return fetch_pair(bound->{name}_0, at.place);\n"),
        () => format!(
            "    PAIR_{value} pair;\n    pair.near = texels_{name}(bound, at);\n    at.place += beside;\n    \
             pair.far = texels_{name}(bound, at);\n    return pair;\n"
        ),
    };
    format!(
        "{one}INLINE FOUND_{value} texels_{name}(const Bound *bound, TEXEL_{value} at) {{\n{found}}}\n\
         INLINE PAIR_{value} pair_{name}(const Bound *bound, TEXEL_{value} at, INDEX_{value} beside) {{\n{both}}}\n"
    )
}

/// The statements that return the texel at `place` of slab `slab`.
fn load(name: &str, format: FieldFormat, slabs: u32) -> String {
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
    format!("    switch (slab) {{\n{cases}    }}\n")
}

/// What [`bricks::uniform`] says, of a dense field: nothing.
fn uniform(shape: &Shape) -> String {
    let name = shape.name;
    format!(
        "bool uniform_{name}(const Bound *bound, int3 lo, int3 hi, int3 size) {{\n    return false;\n}}\nint \
         empty_{name}(const Bound *bound, int3 at, int3 size) {{\n    return 0;\n}}\nint stretch_{name}(int i) {{\n    \
         return (int)WIDTH;\n}}\n"
    )
}
