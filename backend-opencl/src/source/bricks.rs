//! Fields in bricks.

use airlight_core::device::BrickLayout;

use super::{Shape, ShapeKind};

/// Bits of a coordinate within a block, and the bits themselves.
const SHIFT: u32 = BrickLayout::BLOCK.trailing_zeros();
const MASK: u32 = BrickLayout::BLOCK - 1;

/// The functions that find a texel in its block's brick, and its neighbours, which are in the same one.
pub(super) fn places(shape: &Shape) -> String {
    let ShapeKind::Field { slabs, format, .. } = shape.kind else { return String::new() };
    let (name, side) = (shape.name, BrickLayout::SIDE);
    let (slice, texels) = (side * side, BrickLayout::brick_bytes(format) / format.bytes());
    // All slabs but the last have the bricks of the first.
    let (slab, brick) = match slabs {
        1 => ("0".to_owned(), "brick".to_owned()),
        _ => (format!("brick / bound->{name}_per_slab"), format!("(brick % bound->{name}_per_slab)")),
    };
    format!(
        "INLINE TEXEL_float place_{name}(const Bound *bound, I x, I y, I z, int3 size, int layer) {{
    int3 blocks = (size + {MASK}) >> {SHIFT};
    I word = ((z >> {SHIFT}) * blocks.y + (y >> {SHIFT})) * blocks.x + (x >> {SHIFT});
    I brick = as_signed(fetch_uint(bound->{name}_index, word));
    TEXEL_float at;
    at.slab = (I)({slab});
    at.place = {brick} * {texels} + ((z & {MASK}) * {side} + (y & {MASK})) * {side} + (x & {MASK});
    return at;
}}
INLINE TEXEL_float behind_{name}(const Bound *bound, TEXEL_float at, I x, I y, I z, int3 size, int layer) {{
    at.place += {slice};
    return at;
}}
INLINE I below_{name}(const Bound *bound, I y, int3 size) {{
    return (I)({side});
}}
INLINE I beside_{name}(const Bound *bound, I x, int3 size) {{
    return (I)(1);
}}
"
    )
}

/// Whether all blocks from that of one texel to that of another are few and share a brick of one value; how many texels along x,
/// from one on, lie in a block that holds zero; and how many at the most lie one after the other.
pub(super) fn uniform(shape: &Shape) -> String {
    let (name, block, most) = (shape.name, BrickLayout::BLOCK, BrickLayout::SAME);
    format!(
        "int brick_{name}(const Bound *bound, int3 block, int3 size) {{
    int3 blocks = (size + {MASK}) >> {SHIFT};
    return (int)bound->{name}_index[(block.z * blocks.y + block.y) * blocks.x + block.x];
}}
bool uniform_{name}(const Bound *bound, int3 lo, int3 hi, int3 size) {{
    int3 first = lo >> {SHIFT};
    int3 last = hi >> {SHIFT};
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
    if (brick_{name}(bound, at >> {SHIFT}, size) < bound->{name}_constants && texel_{name}(bound, at, size, 0) == 0.0f) {{
        return {block} - (at.x & {MASK});
    }}
    return 0;
}}
int stretch_{name}(int i) {{
    return min((int)WIDTH, {block} - (i & {MASK}));
}}
"
    )
}
