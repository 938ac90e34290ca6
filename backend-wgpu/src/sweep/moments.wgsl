// The moments of a batch of `sweep`. One invocation five coefficients of four by four cells, which share what they load: of three
// bands, which are nine, two invocations.

@compute @workgroup_size(UNITS)
fn sweep_moments(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    // Workgroups of the same cells follow each other, while the radiance is in caches.
    let group = number(id);
    let groups = (params.coefficients + 4u) / 5u;
    let at = vec2<u32>(group % groups, group / groups * UNITS + lane);
    if at.y >= tiles() {
        return;
    }
    let cells = tile(at.y);
    let first = launch.start / (params.cells.w + 1u) * params.batch;
    let taken = min(params.batch, params.directions - first);
    // The last five may be fewer: then the last of them is summed again.
    let last = params.coefficients - 1u;
    let k = min(5u * at.x + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(last));
    let fifth = min(5u * at.x + 4u, last);
    let channels = max(params.channels, params.weight_channels);
    for (var c = 0u; c < channels; c++) {
        var a = before(first, k.x, c, cells);
        var b = before(first, k.y, c, cells);
        var d = before(first, k.z, c, cells);
        var e = before(first, k.w, c, cells);
        var f = before(first, fifth, c, cells);
        let place = (first * params.coefficients + k) * params.weight_channels + min(c, params.weight_channels - 1u);
        let of_fifth = place.x + (fifth - k.x) * params.weight_channels;
        let channel = min(c, params.channels - 1u);
        for (var n = 0u; n < taken; n++) {
            let light = radiance_of(n, first + n, channel, cells);
            let on = n * params.coefficients * params.weight_channels;
            let at = place + on;
            a += read_weights(at.x) * light;
            // Where there is one coefficient, drivers that know it leave the others out.
            if params.coefficients > 1u {
                b += read_weights(at.y) * light;
                d += read_weights(at.z) * light;
                e += read_weights(at.w) * light;
                f += read_weights(of_fifth + on) * light;
            }
        }
        keep(k.x, c, cells, a);
        if 5u * at.x + 1u < params.coefficients {
            keep(k.y, c, cells, b);
        }
        if 5u * at.x + 2u < params.coefficients {
            keep(k.z, c, cells, d);
        }
        if 5u * at.x + 3u < params.coefficients {
            keep(k.w, c, cells, e);
        }
        if 5u * at.x + 4u < params.coefficients {
            keep(fifth, c, cells, f);
        }
    }
}

// The radiance of a tile's cells along direction `n` of the batch, in rows along x.
fn radiance_of(n: u32, direction: u32, channel: u32, cells: Tile) -> mat4x4<f32> {
    let turned = read_directions(direction).axis == 0u;
    let lies = laid(cells, turned);
    let base = (n * params.channels + channel) * texels() + lies.first;
    let light = mat4x4<f32>(
        read_radiance(base), read_radiance(base + lies.on.x), read_radiance(base + lies.on.y), read_radiance(base + lies.on.z),
    );
    return turned_if(light, turned);
}

// Where coefficient `k` of the cells of row `j` of a tile stands, or of the last cells again.
fn places(k: u32, c: u32, cells: Tile, j: u32) -> vec4<u32> {
    let channels = max(params.channels, params.weight_channels);
    let count = params.cells.x * params.cells.y * params.cells.z;
    let at = cells.first.xy + min(vec2<u32>(0u, j), cells.left - 1u);
    let on = min(vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(cells.left.x - 1u));
    let cell = (cells.first.z * params.cells.y + at.y) * params.cells.x + at.x + on;
    return select((cell * params.coefficients + k) * channels + c, (k * channels + c) * count + cell, vec4<bool>(params.planar == 1u));
}

// What the batches before left.
fn before(first: u32, k: u32, c: u32, cells: Tile) -> mat4x4<f32> {
    // Drivers run both sides of a condition; of this one they may know the answer.
    if params.batch >= params.directions || first == 0u {
        return mat4x4<f32>();
    }
    return mat4x4<f32>(
        row_before(places(k, c, cells, 0u)), row_before(places(k, c, cells, 1u)), row_before(places(k, c, cells, 2u)),
        row_before(places(k, c, cells, 3u)),
    );
}

fn row_before(at: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(moments[at.x], moments[at.y], moments[at.z], moments[at.w]);
}

fn keep(k: u32, c: u32, cells: Tile, value: mat4x4<f32>) {
    keep_row(k, c, cells, 0u, value[0]);
    keep_row(k, c, cells, 1u, value[1]);
    keep_row(k, c, cells, 2u, value[2]);
    keep_row(k, c, cells, 3u, value[3]);
}

fn keep_row(k: u32, c: u32, cells: Tile, j: u32, value: vec4<f32>) {
    if j < cells.left.y {
        let at = places(k, c, cells, j);
        let last = ended(value, cells.left.x);
        moments[at.x] = last.x;
        moments[at.y] = last.y;
        moments[at.z] = last.z;
        moments[at.w] = last.w;
    }
}
