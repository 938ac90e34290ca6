//! Lookups of a field in bricks.

use airlight_core::device::{BrickLayout, FieldFormat};

use super::{OPENCL, Shape, ShapeKind, load};

/// The functions that find a block's brick, and read a texel of the field and of a brick.
pub(super) fn texel(shape: &Shape) -> String {
    let ShapeKind::Field { slabs, format, .. } = shape.kind else { return String::new() };
    let (name, value) = (shape.name, shape.element.name(OPENCL));
    let (block, side) = (BrickLayout::BLOCK, BrickLayout::SIDE);
    let (shift, mask) = (block.trailing_zeros(), block - 1);
    let texels = BrickLayout::brick_bytes(format) / format.bytes();
    // All slabs but the last have the bricks of the first.
    let within = if slabs == 1 { "brick".to_owned() } else { format!("(brick % bound->{name}_per_slab)") };
    let load = load(shape, &format!("brick / bound->{name}_per_slab"));
    format!(
        "int brick_{name}(const Bound *bound, int3 block, int3 size) {{
    int3 blocks = (size + {mask}) >> {shift};
    return (int)bound->{name}_index[(block.z * blocks.y + block.y) * blocks.x + block.x];
}}
{value} within_brick_{name}(const Bound *bound, int brick, int3 at) {{
    int place = {within} * {texels} + (at.z * {side} + at.y) * {side} + at.x;
{load}}}
{value} texel_{name}(const Bound *bound, int3 at, int3 size, int layer) {{
    return within_brick_{name}(bound, brick_{name}(bound, at >> {shift}, size), at & {mask});
}}
"
    )
}

/// The statements that find the `place` of each lane's texel of the only slab.
pub(super) fn places(name: &str, format: FieldFormat) -> String {
    let (block, side) = (BrickLayout::BLOCK, BrickLayout::SIDE);
    let (shift, mask) = (block.trailing_zeros(), block - 1);
    let texels = BrickLayout::brick_bytes(format) / format.bytes();
    format!(
        "    int3 blocks = (size + {mask}) >> {shift};
    INDEX_float word = ((z >> {shift}) * blocks.y + (y >> {shift})) * blocks.x + (x >> {shift});
    INDEX_float brick = as_signed(fetch_uint(bound->{name}_index, word));
    INDEX_float place = brick * {texels} + ((z & {mask}) * {side} + (y & {mask})) * {side} + (x & {mask});
"
    )
}

/// Whether all blocks from that of one texel to that of another are few and share a brick of one value; and how many texels along x,
/// from one on, lie in a block that holds zero.
pub(super) fn uniform(shape: &Shape) -> String {
    let name = shape.name;
    let (block, most) = (BrickLayout::BLOCK, BrickLayout::SAME);
    let (shift, mask) = (block.trailing_zeros(), block - 1);
    format!(
        "bool uniform_{name}(const Bound *bound, int3 lo, int3 hi, int3 size) {{
    int3 first = lo >> {shift};
    int3 last = hi >> {shift};
    int brick = brick_{name}(bound, first, size);
    int3 count = last - first + 1;
    bool same = brick < bound->{name}_constants && count.x * count.y * count.z <= {most};
    for (int k = first.z; same && k <= last.z; k++) {{
        for (int j = first.y; same && j <= last.y; j++) {{
            for (int i = first.x; same && i <= last.x; i++) {{
                same = brick_{name}(bound, (int3)(i, j, k), size) == brick;
            }}
        }}
    }}
    return same;
}}
int empty_{name}(const Bound *bound, int3 at, int3 size) {{
    int brick = brick_{name}(bound, at >> {shift}, size);
    if (brick < bound->{name}_constants && within_brick_{name}(bound, brick, (int3)(0)) == 0.0f) {{
        return {block} - (at.x & {mask});
    }}
    return 0;
}}
"
    )
}
