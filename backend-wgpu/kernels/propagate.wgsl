// `propagate`: columns or mean densities from every cell to each light. Of short characteristics a dispatch integrates in the cells
// of some lights (`propagate_pieces`), an invocation a cell. After it a dispatch is one step, of which an invocation takes an item; or
// some steps, of which a workgroup takes the items of a light in order (`propagate_in_order`). The last one lays out what cells hold
// (`propagate_output`), an invocation a layer of a cell.

@compute @workgroup_size(UNITS)
fn propagate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = number(id) * UNITS + lane;
    if item >= launch.count {
        return;
    }
    let light = divide(item, params.items / params.lights);
    let step = launch.start - integrated();
    finish(face(light.x, step), read_lights(light.x), light.x, step, light.y);
}

@compute @workgroup_size(UNITS)
fn propagate_in_order(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let light = number(id);
    let place = read_lights(light);
    // A number of a workgroup hides the end from drivers that build kernels for it.
    let past = launch.past + (id.x >> 31u);
    for (var unit = launch.first; unit < past; unit++) {
        if light < launch.count {
            let step = unit - integrated();
            let face = face(light, step);
            let items = items(face);
            var item = 0u;
            // Asked at its end: drivers run a loop once more after what is asked at its begin.
            loop {
                finish(face, place, light, step, item + lane);
                continuing {
                    item += UNITS;
                    break if item >= items;
                }
            }
        }
        // Each step sees the one before it.
        wait_values();
    }
}

@compute @workgroup_size(UNITS)
fn propagate_pieces(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let light = divide(launch.first * counted() + n, counted());
    integrate(light.x, light.y);
}

@compute @workgroup_size(UNITS)
fn propagate_output(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let layer = divide(n, counted());
    lay_out(layer.x, layer.y);
}

// Units before the first step.
fn integrated() -> u32 {
    return select(0u, params.lights, params.scheme == SCHEME_SHORT_CHARACTERISTICS);
}

// The face of a step of a light, where there are faces.
fn face(light: u32, step: u32) -> LightFace {
    var face: LightFace;
    if params.scheme == SCHEME_SHORT_CHARACTERISTICS {
        face = read_faces(step * params.lights + light);
    }
    return face;
}

// Items of a step of a light, of which some may be no cells.
fn items(face: LightFace) -> u32 {
    return select(params.items / params.lights, face.count_0 * face.count_1, params.scheme == SCHEME_SHORT_CHARACTERISTICS);
}

// Integrates in a cell of a number.
fn integrate(light: u32, n: u32) {
    let slice = divide(n, params.cells.x * params.cells.y);
    let row = divide(slice.y, params.cells.x);
    let at = vec3<i32>(vec3<u32>(row.y, row.x, slice.x));
    write_values(slot(at, light), piece(way_to(read_lights(light).place, at)));
}

// Finishes item `n` of a step of a light.
fn finish(face: LightFace, place: LightPlace, light: u32, step: u32, n: u32) {
    var at = vec3<i32>(-1);
    var value = 0.0;
    if params.scheme == SCHEME_SHORT_CHARACTERISTICS {
        at = on_face(face, n);
        if !inside(at) {
            return;
        }
        value = mean(place.place, light, at);
    } else {
        at = in_shell(place.first.xyz, step, n);
        if !inside(at) {
            return;
        }
        value = gathered(place.place, light, at);
    }
    write_values(slot(at, light), value);
}

// Lays out what a cell of a number holds of a layer, with zeros beyond the last light.
fn lay_out(layer: u32, n: u32) {
    let first = 4u * layer;
    let four = vec4<f32>(known(first, n), known(first + 1u, n), known(first + 2u, n), known(first + 3u, n));
    put_light_depth(n * params.cells.w + layer, four);
}

// What a cell of a number holds for a light.
fn known(light: u32, n: u32) -> f32 {
    if light >= params.lights {
        return 0.0;
    }
    return read_values(light * counted() + n);
}

// Cell `n` of a face; negative where there is none.
fn on_face(face: LightFace, n: u32) -> vec3<i32> {
    if face.axis == NO_FACE || n >= face.count_0 * face.count_1 {
        return vec3<i32>(-1);
    }
    let row = divide(n, face.count_0);
    let first = face.first_0 + row.y;
    let second = face.first_1 + row.x;
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
    let row = divide(n / 2u, params.cells.y);
    let y = i32(row.y);
    let z = i32(row.x);
    let left = i32(step) - abs(y - i32(first.y)) - abs(z - i32(first.z));
    // Where no hop is left, both sides are one cell.
    if left < 0 || (left == 0 && n % 2u == 1u) {
        return vec3<i32>(-1);
    }
    return vec3<i32>(i32(first.x) + select(left, -left, n % 2u == 1u), y, z);
}

// The way from a cell to a light.
struct Way {
    // In cell units.
    u: vec3<f32>,
    // Its longest component, and along which axis that is.
    longest: f32,
    axis: u32,
    // Whether the light is nearer than one cell.
    near: bool,
    // Metres of it within the box.
    extent: f32,
    // What is integrated of it.
    piece: Ray,
}

fn way_to(place: vec4<f32>, at: vec3<i32>) -> Way {
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
    let all = through(origin, toward, size, select(FAR, far, has_place), params.cell.w);
    // The first axis among equals.
    let sides = abs(u);
    let longest = max(max(sides.x, sides.y), sides.z);
    let axis = select(select(2u, 1u, sides.y == longest), 0u, sides.x == longest);
    let near = has_place && longest < 1.0;
    let next = through(origin, toward, size, far / longest, params.cell.w);
    let step = select(next.step, all.step, near);
    let steps = select(next.steps, all.steps, near);
    let piece = Ray(origin, all.direction, all.inverse, all.start, step, steps, all.place);
    return Way(u, longest, axis, near, all.step * all.steps, piece);
}

// What is integrated of a way: the mean density of all of it, or the column of a piece.
fn piece(way: Way) -> f32 {
    let column = column(way.piece, vec4<u32>(0u));
    if !way.near {
        return column;
    }
    if way.piece.steps > 0.0 {
        return column / max(way.extent, 1e-30);
    }
    return sample_density(way.piece.origin, vec3<i32>(params.dims.xyz), 0);
}

// Mean density along the way within the box.
fn mean(place: vec4<f32>, light: u32, at: vec3<i32>) -> f32 {
    let known = read_values(slot(at, light));
    let way = way_to(place, at);
    if way.near {
        return known;
    }
    let rest = way.extent - way.piece.step * way.piece.steps;
    var beyond = 0.0;
    if rest > 0.0 {
        beyond = interpolated(way, place.w == 0.0, light, at);
    }
    return (known + beyond * rest) / way.extent;
}

// Mean density where the way meets the next plane of centres along its axis.
fn interpolated(way: Way, far: bool, light: u32, at: vec3<i32>) -> f32 {
    let u = way.u;
    let longest = way.longest;
    let axis = way.axis;
    let hop = select(vec3<i32>(1), vec3<i32>(-1), u < vec3<f32>(0.0));
    let b = select(0u, 1u, axis == 0u);
    let c = select(2u, 1u, axis == 2u);
    let along_b = nodes(at[b], i32(params.cells[b]), u[b], longest, far);
    let along_c = nodes(at[c], i32(params.cells[c]), u[c], longest, far);
    var on = vec3<i32>(0);
    var up = vec3<i32>(0);
    on[b] = hop[b];
    up[c] = hop[c];
    var first = at;
    first[axis] += hop[axis];
    first -= up;
    // Without loops, whose turns some drivers count.
    var sum = row(0.0, light, first, on, along_b * along_c.x);
    sum = row(sum, light, first + up, on, along_b * along_c.y);
    sum = row(sum, light, first + 2 * up, on, along_b * along_c.z);
    sum = row(sum, light, first + 3 * up, on, along_b * along_c.w);
    return max(sum, 0.0);
}

// A sum with that of the cells at -1, 0, 1 and 2 hops from a cell.
fn row(sum: f32, light: u32, at: vec3<i32>, on: vec3<i32>, weights: vec4<f32>) -> f32 {
    let first = weighed(sum, light, at - on, weights.x);
    let second = weighed(first, light, at, weights.y);
    let third = weighed(second, light, at + on, weights.z);
    return weighed(third, light, at + 2 * on, weights.w);
}

// A sum with that of a cell.
fn weighed(sum: f32, light: u32, cell: vec3<i32>, weight: f32) -> f32 {
    // Cells without weight may not be known yet.
    if weight != 0.0 && inside(cell) {
        return sum + weight * read_values(slot(cell, light));
    }
    return sum;
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
fn gathered(place: vec4<f32>, light: u32, at: vec3<i32>) -> f32 {
    var u = place.xyz;
    if place.w == 1.0 {
        u = place.xyz - vec3<f32>(at);
    }
    let local = read_occupancy(index(at)).x;
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
            sum += abs(u[a]) * read_values(slot(next, light));
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

// Cells of the grid.
fn counted() -> u32 {
    return params.cells.x * params.cells.y * params.cells.z;
}

// The number of a cell.
fn index(at: vec3<i32>) -> u32 {
    let cell = vec3<u32>(at);
    return (cell.z * params.cells.y + cell.y) * params.cells.x + cell.x;
}

// Where a cell's value for a light lies.
fn slot(at: vec3<i32>, light: u32) -> u32 {
    return light * counted() + index(at);
}

// Metres of a way in cell units.
fn metres(u: vec3<f32>) -> f32 {
    let v = u * params.cell.xyz;
    return length(vec3<f32>(dot(params.world_x.xyz, v), dot(params.world_y.xyz, v), dot(params.world_z.xyz, v)));
}
