// The source functions of the cells toward each direction of a batch of `sweep`, in rows that lie in the direction's planes. One
// invocation four by four cells of four directions, which share what they load.

@compute @workgroup_size(UNITS)
fn sweep_scatter(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = number(id) * UNITS + lane;
    if item >= launch.count {
        return;
    }
    let at = divide(item, tiles());
    let cells = tile(at.y);
    // The last four may be fewer: then the last of them is summed again.
    let taken = min(params.batch, params.directions - launch.first);
    let n = min(4u * at.x + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(taken - 1u));
    let first = (launch.first + n) * params.source_coefficients;
    let count = params.cells.x * params.cells.y * params.cells.z;
    for (var channel = 0u; channel < params.channels; channel++) {
        var a = mat4x4<f32>();
        var b = mat4x4<f32>();
        var c = mat4x4<f32>();
        var d = mat4x4<f32>();
        for (var k = 0u; k < params.source_coefficients; k++) {
            let moments = of_tile((k * params.channels + channel) * count, cells);
            a += read_source_weights(first.x + k) * moments;
            b += read_source_weights(first.y + k) * moments;
            c += read_source_weights(first.z + k) * moments;
            d += read_source_weights(first.w + k) * moments;
        }
        let albedo = albedo_of(channel, cells);
        keep(n.x, channel, cells, times(a, albedo));
        keep(n.y, channel, cells, times(b, albedo));
        keep(n.z, channel, cells, times(c, albedo));
        keep(n.w, channel, cells, times(d, albedo));
    }
}

// The moments of a tile's cells, from those of one coefficient and channel on: rows of four, of which the last stands again beyond
// the last one.
fn of_tile(base: u32, cells: Tile) -> mat4x4<f32> {
    let last = min(cells.left.y, 4u) - 1u;
    let at = base + (cells.first.z * params.cells.y + cells.first.y) * params.cells.x + cells.first.x;
    return mat4x4<f32>(
        of_row(at, cells.left.x),
        of_row(at + min(1u, last) * params.cells.x, cells.left.x),
        of_row(at + min(2u, last) * params.cells.x, cells.left.x),
        of_row(at + last * params.cells.x, cells.left.x),
    );
}

// Those of four cells from the one at `place` on: a whole texel of their copy where rows of cells are whole texels.
fn of_row(place: u32, left: u32) -> vec4<f32> {
    if params.cells.x % 4u == 0u {
        return read_four_sources(place / 4u);
    }
    return ended(read_along_sources(place / 4u, place % 4u), left);
}

// The albedos of a tile's cells.
fn albedo_of(channel: u32, cells: Tile) -> mat4x4<f32> {
    let lies = laid(cells, false);
    let base = (extinctions() + channel) * texels() + lies.first;
    return mat4x4<f32>(
        read_optics(base), read_optics(base + lies.on.x), read_optics(base + lies.on.y), read_optics(base + lies.on.z),
    );
}

fn times(a: mat4x4<f32>, b: mat4x4<f32>) -> mat4x4<f32> {
    return mat4x4<f32>(a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]);
}

fn keep(n: u32, channel: u32, cells: Tile, value: mat4x4<f32>) {
    let turned = read_directions(launch.first + n).axis == 0u;
    let lies = laid(cells, turned);
    let base = (n * params.channels + channel) * texels() + lies.first;
    let rows = turned_if(value, turned);
    write_toward(base, rows[0]);
    if lies.count > 1u {
        write_toward(base + lies.on.x, rows[1]);
    }
    if lies.count > 2u {
        write_toward(base + lies.on.y, rows[2]);
    }
    if lies.count > 3u {
        write_toward(base + lies.on.z, rows[3]);
    }
}
