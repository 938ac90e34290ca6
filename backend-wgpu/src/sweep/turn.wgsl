// What the cells do to light, by texels of four cells, in rows along x and again in rows along y. One invocation a texel.

@compute @workgroup_size(UNITS)
fn sweep_turn(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = number(id) * UNITS + lane;
    if item >= launch.count {
        return;
    }
    let at = divide(item, texels());
    let turned = at.x >= values();
    let row = rows(turned);
    let within = divide(at.y, row.z);
    let slice = divide(within.x, row.y);
    // Rows the other way may be more texels.
    if slice.x >= params.cells.z {
        return;
    }
    let pitch = select(vec2<u32>(1u, params.cells.x), vec2<u32>(params.cells.x, 1u), turned);
    let four = min(4u * within.y + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(row.x - 1u));
    let count = params.cells.x * params.cells.y * params.cells.z;
    let cell = slice.x * params.cells.x * params.cells.y + slice.y * pitch.y + four * pitch.x;
    let i = plane(at.x - select(0u, values(), turned)) * count + cell;
    write_turned(item, vec4<f32>(read_optics(i.x), read_optics(i.y), read_optics(i.z), read_optics(i.w)));
}

// Where value `n` stands among those of `coarsen`: three of extinction, of albedo and of emission.
fn plane(n: u32) -> u32 {
    if n < extinctions() {
        return n;
    }
    let scattered = n - extinctions();
    return select(6u + scattered - albedos(), 3u + scattered, scattered < albedos());
}
