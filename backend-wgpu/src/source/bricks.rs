//! Lookups of a field in bricks.

use airlight_core::device::{BrickLayout, FieldFormat, Shape};

use super::{WGSL, index_binding, scaled, slab_binding};
use crate::atlas::{CONSTANT, SLOT_BITS};

/// The textures of bricks and index, and the functions that look up: a texel; between texels, in one brick, by a texture unit
/// where `filtered`; whether all blocks from that of one texel to that of another are few and share a brick of one value; and how many
/// texels along x, from one on, lie in a block that holds zero.
pub(super) fn lookups(shape: &Shape, index: usize, format: FieldFormat, fetched: bool, filtered: bool) -> String {
    let (name, value) = (shape.name, shape.element.name(WGSL));
    let (bricks, indices) = (slab_binding(index, 0), index_binding(index));
    let most = BrickLayout::SAME;
    let (block, side) = (BrickLayout::BLOCK, BrickLayout::SIDE);
    let (shift, mask) = (block.trailing_zeros(), block - 1);
    let (along, twice) = ((1 << SLOT_BITS) - 1, 2 * SLOT_BITS);
    let (texels, words, level) = match fetched {
        true => ("texture_storage_3d<r32float, read>", "texture_storage_3d<r32uint, read>", ""),
        false => ("texture_3d<f32>", "texture_3d<u32>", ", 0"),
    };
    let load = |at: &str| format!("scaled_{name}(textureLoad({name}_0, {at}{level}).x)");
    let filter = if filtered {
        let dims = format!("vec3<f32>(textureDimensions({name}_0))");
        let sampled =
            WGSL.scaled(format, &format!("textureSampleLevel({name}_0, linear, (place + 0.5) / {dims}, 0.0).x"));
        format!("    let place = vec3<f32>(at) + f;\n    return {sampled};\n")
    } else {
        let row = |y: u32, z: u32| format!("row_brick_{name}(at + vec3<i32>(0, {y}, {z}), f.x)");
        format!(
            "    let a = {};
    let b = {};
    let c = {};
    let d = {};
    let near = a + (b - a) * f.y;
    let far = c + (d - c) * f.y;
    return near + (far - near) * f.z;
",
            row(0, 0),
            row(1, 0),
            row(0, 1),
            row(1, 1)
        )
    };
    let scaled = scaled(shape, format);
    format!(
        "{scaled}@group(2) @binding({bricks}) var {name}_0: {texels};
@group(2) @binding({indices}) var {name}_index: {words};
fn brick_{name}(block: vec3<i32>) -> u32 {{
    return textureLoad({name}_index, block{level}).x;
}}
fn slot_{name}(brick: u32) -> vec3<i32> {{
    return vec3<i32>(vec3<u32>(brick, brick >> {SLOT_BITS}u, brick >> {twice}u) & vec3<u32>({along}u)) * {side};
}}
fn texel_{name}(at: vec3<i32>, size: vec3<i32>, layer: i32) -> {value} {{
    let place = slot_{name}(brick_{name}(at >> vec3<u32>({shift}u))) + (at & vec3<i32>({mask}));
    return {};
}}
fn row_brick_{name}(at: vec3<i32>, f: f32) -> {value} {{
    let a = {};
    let b = {};
    return a + (b - a) * f;
}}
const filters_{name}: bool = true;
fn filter_{name}(p: vec3<f32>, size: vec3<i32>, layer: i32) -> {value} {{
    let lo = vec3<i32>(p);
    let f = p - vec3<f32>(lo);
    let at = slot_{name}(brick_{name}(lo >> vec3<u32>({shift}u))) + (lo & vec3<i32>({mask}));
{filter}}}
fn uniform_{name}(lo: vec3<i32>, hi: vec3<i32>) -> bool {{
    let first = lo >> vec3<u32>({shift}u);
    let last = hi >> vec3<u32>({shift}u);
    let brick = brick_{name}(first);
    let count = last - first + 1;
    var same = brick >= {CONSTANT}u && count.x * count.y * count.z <= {most};
    for (var k = first.z; same && k <= last.z; k++) {{
        for (var j = first.y; same && j <= last.y; j++) {{
            for (var i = first.x; same && i <= last.x; i++) {{
                same = brick_{name}(vec3<i32>(i, j, k)) == brick;
            }}
        }}
    }}
    return same;
}}
fn empty_{name}(at: vec3<i32>) -> i32 {{
    let brick = brick_{name}(at >> vec3<u32>({shift}u));
    if brick >= {CONSTANT}u && textureLoad({name}_0, slot_{name}(brick){level}).x == 0.0 {{
        return {block} - (at.x & {mask});
    }}
    return 0;
}}
",
        load("place"),
        load("at"),
        load("at + vec3<i32>(1, 0, 0)"),
    )
}
