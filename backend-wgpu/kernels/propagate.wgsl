// `propagate`: columns or mean densities from every cell to each light. A dispatch is one step; one invocation an item.

@compute @workgroup_size(UNITS)
fn propagate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = number(id) * UNITS + lane;
    if item >= launch.count {
        return;
    }
    let each = params.items / params.lights;
    let light = item / each;
    let n = item % each;
    let step = launch.start;
    var at = vec3<i32>(-1);
    var value = 0.0;
    if params.scheme == SCHEME_SHORT_CHARACTERISTICS {
        let face = read_faces(step * params.lights + light);
        at = on_face(face, n);
        if !inside(at) {
            return;
        }
        value = mean(face, light, at);
    } else {
        at = in_shell(read_lights(light).first.xyz, step, n);
        if !inside(at) {
            return;
        }
        value = gathered(light, at);
    }
    let place = index(at, light);
    light_depth[place] = value;
    if light + 1u == params.lights {
        // The last light's items also write what lies beyond it in its layer.
        for (var k = 1u; k < 4u * params.cells.w - light; k++) {
            light_depth[place + k] = 0.0;
        }
    }
}

// Cell `n` of a face; negative where there is none.
fn on_face(face: LightFace, n: u32) -> vec3<i32> {
    if face.axis == NO_FACE || n >= face.count_0 * face.count_1 {
        return vec3<i32>(-1);
    }
    let first = face.first_0 + n % face.count_0;
    let second = face.first_1 + n / face.count_0;
    if face.axis == 0u {
        return vec3<i32>(vec3<u32>(face.plane, first, second));
    }
    if face.axis == 1u {
        return vec3<i32>(vec3<u32>(first, face.plane, second));
    }
    return vec3<i32>(vec3<u32>(first, second, face.plane));
}

// Item `n` of the shell `step` hops from the light's first cell: of a row along x, the cell on one side or the other.
// Negative where there is none.
fn in_shell(first: vec3<u32>, step: u32, n: u32) -> vec3<i32> {
    let y = i32(n / 2u % params.cells.y);
    let z = i32(n / 2u / params.cells.y);
    let left = i32(step) - abs(y - i32(first.y)) - abs(z - i32(first.z));
    // Where no hop is left, both sides are one cell.
    if left < 0 || (left == 0 && n % 2u == 1u) {
        return vec3<i32>(-1);
    }
    return vec3<i32>(i32(first.x) + select(left, -left, n % 2u == 1u), y, z);
}

// Mean density along the way within the box.
fn mean(face: LightFace, light: u32, at: vec3<i32>) -> f32 {
    let place = read_lights(light).place;
    let size = vec3<f32>(params.dims.xyz);
    let has_place = place.w == 1.0;
    var u = place.xyz;
    if has_place {
        u = place.xyz - vec3<f32>(at);
    }
    let origin = (vec3<f32>(at) + 0.5) * params.cell.xyz - 0.5;
    // At a light a way so short that nothing changes along it, and so long that its column is a normal number: devices
    // may take others for 0.
    let far = max(metres(u), 1e-30);
    let toward = u * params.cell.xyz / far;
    let way = through(origin, toward, size, select(FAR, far, has_place), params.cell.w);
    let extent = way.step * way.steps;
    if face.near == 1u {
        if way.steps > 0.0 {
            return column(way, vec4<u32>(0u)) / max(extent, 1e-30);
        }
        return sample_density(origin, vec3<i32>(params.dims.xyz), 0);
    }
    let longest = abs(u[face.axis]);
    let piece = through(origin, toward, size, far / longest, params.cell.w);
    let rest = extent - piece.step * piece.steps;
    var beyond = 0.0;
    if rest > 0.0 {
        beyond = interpolated(light, at, u, longest, face.axis);
    }
    return (column(piece, vec4<u32>(0u)) + beyond * rest) / extent;
}

// Mean density where the way meets the next plane of centres along `axis`.
fn interpolated(light: u32, at: vec3<i32>, u: vec3<f32>, longest: f32, axis: u32) -> f32 {
    let far = read_lights(light).place.w == 0.0;
    let hop = select(vec3<i32>(1), vec3<i32>(-1), u < vec3<f32>(0.0));
    let b = select(0u, 1u, axis == 0u);
    let c = select(2u, 1u, axis == 2u);
    let along_b = nodes(at[b], i32(params.cells[b]), u[b], longest, far);
    let along_c = nodes(at[c], i32(params.cells[c]), u[c], longest, far);
    var sum = 0.0;
    for (var j = 0; j < 4; j++) {
        for (var i = 0; i < 4; i++) {
            let weight = along_b[i] * along_c[j];
            var cell = at;
            cell[axis] += hop[axis];
            cell[b] += hop[b] * (i - 1);
            cell[c] += hop[c] * (j - 1);
            // Cells without weight may not be known yet.
            if weight != 0.0 && inside(cell) {
                sum += weight * light_depth[index(cell, light)];
            }
        }
    }
    return max(sum, 0.0);
}

// Weights of the cells at -1, 0, 1 and 2 hops toward the light from cell `x` of `cells` along an axis.
fn nodes(x: i32, cells: i32, u: f32, longest: f32, far: bool) -> vec4<f32> {
    let hop = select(1, -1, u < 0.0);
    if !within(x + hop, cells) {
        return vec4<f32>(0.0, 1.0, 0.0, 0.0);
    }
    let way = abs(u);
    // A division may be off by more than rounding, and at 1 the cell itself must have no weight.
    let f = select(way / longest, 1.0, way >= longest);
    let g = 1.0 - f;
    let before = within(x - hop, cells) && (far || way + 1.0 < longest);
    let after = within(x + 2 * hop, cells) && (far || abs(way - 2.0) < longest);
    if before && after {
        return vec4<f32>(
            -f * g * (1.0 + g) / 6.0,
            (1.0 + f) * g * (1.0 + g) / 2.0,
            (1.0 + f) * f * (1.0 + g) / 2.0,
            -f * g * (1.0 + f) / 6.0,
        );
    }
    if after {
        return vec4<f32>(0.0, g * (1.0 + g) / 2.0, f * (1.0 + g), -f * g / 2.0);
    }
    if before {
        return vec4<f32>(-f * g / 2.0, g * (1.0 + f), f * (1.0 + f) / 2.0, 0.0);
    }
    return vec4<f32>(0.0, g, f, 0.0);
}

// Column gathered from the neighbours toward the light.
fn gathered(light: u32, at: vec3<i32>) -> f32 {
    let place = read_lights(light).place;
    var u = place.xyz;
    if place.w == 1.0 {
        u = place.xyz - vec3<f32>(at);
    }
    let local = read_occupancy(index(at, 0u) / (4u * params.cells.w)).x;
    let edges = vec3<f32>(
        metres(vec3<f32>(1.0, 0.0, 0.0)),
        metres(vec3<f32>(0.0, 1.0, 0.0)),
        metres(vec3<f32>(0.0, 0.0, 1.0)),
    );
    let published = params.scheme == SCHEME_PUBLISHED;
    let hops = abs(u.x) + abs(u.y) + abs(u.z);
    if hops == 0.0 {
        return select(0.0, local * (edges.x + edges.y + edges.z) / 3.0, published);
    }
    let extent = select(metres(u), abs(u.x) * edges.x + abs(u.y) * edges.y + abs(u.z) * edges.z, published);
    var sum = 0.0;
    for (var a = 0u; a < 3u; a++) {
        var next = at;
        next[a] += select(1, -1, u[a] < 0.0);
        if u[a] != 0.0 && inside(next) {
            sum += abs(u[a]) * light_depth[index(next, light)];
        }
    }
    return (local * extent + sum) / hops;
}

// Whether cell `x` is one of `cells` along an axis.
fn within(x: i32, cells: i32) -> bool {
    return x >= 0 && x < cells;
}

// Whether a cell lies in the grid.
fn inside(at: vec3<i32>) -> bool {
    return all(at >= vec3<i32>(0)) && all(at < vec3<i32>(params.cells.xyz));
}

// Where a cell's value for a light lies in the output.
fn index(at: vec3<i32>, light: u32) -> u32 {
    let cell = vec3<u32>(at);
    return ((cell.z * params.cells.y + cell.y) * params.cells.x + cell.x) * 4u * params.cells.w + light;
}

// Metres of a way in cell units.
fn metres(u: vec3<f32>) -> f32 {
    let v = u * params.cell.xyz;
    return length(vec3<f32>(dot(params.world_x.xyz, v), dot(params.world_y.xyz, v), dot(params.world_z.xyz, v)));
}
