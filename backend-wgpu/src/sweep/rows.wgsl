// The planes of `sweep` by rows of four cells, which share what they load of the plane upwind. One workgroup a direction; one
// invocation four cells of a plane at a time, counted the way that the direction leads.

// The four cells of the plane upwind around the ray of each of four cells: what they weigh, and which stand behind surfaces.
struct Around {
    weights: vec4<f32>,
    // Of each cell the surfaces around it, and the bits of the four.
    words: vec4<u32>,
    bits: vec4<u32>,
}

// Where four cells are, and the five of each of two rows upwind of them.
struct Places {
    own: vec4<u32>,
    near: vec4<u32>,
    near_end: u32,
    far: vec4<u32>,
    far_end: u32,
}

@compute @workgroup_size(UNITS)
fn sweep_rows(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    let steps = params.cells.w + 1u;
    let first = launch.first / steps * params.batch;
    let cells = params.cells.xyz;
    let fours = (cells + 3u) / 4u;
    let items = max(max(fours.x * cells.y, fours.x * cells.z), fours.y * cells.z);
    for (var step = launch.first; step < launch.past; step++) {
        if n < launch.count {
            for (var item = lane; item < items; item += UNITS) {
                advance(n, first, step % steps, item);
            }
        }
        // Each plane sees the one before it.
        textureBarrier();
    }
}

// Radiance of four cells of the plane that a step finishes, of direction `n` of the batch that begins with `first`.
fn advance(n: u32, first: u32, step: u32, item: u32) {
    let way = read_directions(first + n);
    // Along the axis, along rows and across them: cells, and how far apart neighbours lie.
    let x = way.axis == 0u;
    let z = way.axis == 2u;
    let cells = params.cells;
    let size = vec3<u32>(select(select(cells.y, cells.z, z), cells.x, x), select(cells.x, cells.y, x), select(cells.z, cells.y, z));
    let fours = (size.y + 3u) / 4u;
    if step >= size.x || item >= fours * size.z {
        return;
    }
    let slice = cells.x * cells.y;
    let pitch = vec3<i32>(vec3<u32>(select(select(cells.x, slice, z), 1u, x), select(1u, cells.x, x), select(slice, cells.x, z)));
    let down = vec3<u32>(way.down >> way.axis, way.down >> select(0u, 1u, x), way.down >> select(2u, 1u, z));
    let falls = (down & vec3<u32>(1u)) == vec3<u32>(1u);
    let hop = select(pitch, -pitch, falls);
    let within = divide(item, fours);
    let begin = 4u * within.y;
    let place = vec3<u32>(
        select(size.x - 1u - step, step, falls.x), select(begin, size.y - 1u - begin, falls.y), within.x,
    );
    let cell = i32(place.x) * pitch.x + i32(place.y) * pitch.y + i32(place.z) * pitch.z;
    // Beyond the end of its row a cell's place is that of the last one, beyond the last row that of this one, and beyond the
    // box this plane's.
    let left = i32(size.y - begin);
    let on = min(vec4<i32>(0, 1, 2, 3), vec4<i32>(left - 1)) * hop.y;
    let end = min(4, left - 1) * hop.y;
    let enters = step == 0u;
    let across = select(place.z + 1u < size.z, place.z > 0u, falls.z);
    let near = cell + select(hop.x, 0, enters);
    let far = near + select(0, hop.z, across);
    let places = Places(
        vec4<u32>(cell + on), vec4<u32>(near + on), u32(near + end), vec4<u32>(far + on), u32(far + end),
    );
    // Which of them are cells.
    let here = vec4<bool>(!enters, !enters && left > 1, !enters && left > 2, !enters && left > 3);
    let here_end = !enters && left > 4;
    let there = here & vec4<bool>(across);
    let there_end = here_end && across;
    let second = vec4<f32>(1.0 - way.second, 1.0 - way.second, way.second, way.second);
    var around = Around(vec4<f32>(1.0 - way.first, way.first, 1.0 - way.first, way.first) * second, vec4<u32>(0u), vec4<u32>(0u));
    if has_obstructed {
        let turn = vec3<i32>(select(select(3, 9, z), 1, x), select(1, 3, x), select(9, 3, z));
        let on = select(turn, -turn, falls);
        around.bits = vec4<u32>(13 + on.x + vec4<i32>(0, on.y, on.z, on.y + on.z));
        let own = places.own;
        around.words = vec4<u32>(read_obstructed(own.x), read_obstructed(own.y), read_obstructed(own.z), read_obstructed(own.w));
    }
    let count = slice * cells.z;
    var tau = vec4<f32>(0.0);
    var passes = vec4<f32>(0.0);
    var shines = vec4<f32>(0.0);
    for (var channel = 0u; channel < params.channels; channel++) {
        if channel == 0u || params.grey == 0u {
            let own = four_optics(channel * count, places.own);
            let near = select(vec4<f32>(0.0), four_optics(channel * count, places.near), here);
            let near_end = select(0.0, read_optics(channel * count + places.near_end), here_end);
            let far = select(vec4<f32>(0.0), four_optics(channel * count, places.far), there);
            let far_end = select(0.0, read_optics(channel * count + places.far_end), there_end);
            tau = (own + between(around, near, near_end, far, far_end, own)) * (0.5 * way.length);
            let a = segment(tau.x);
            let b = segment(tau.y);
            let c = segment(tau.z);
            let d = segment(tau.w);
            passes = vec4<f32>(a.x, b.x, c.x, d.x);
            shines = vec4<f32>(a.y, b.y, c.y, d.y);
        }
        let base = (n * params.channels + channel) * count;
        let near = select(vec4<f32>(params.boundary), four_radiance(base, places.near), here);
        let near_end = select(params.boundary, read_radiance(base + places.near_end), here_end);
        let far = select(vec4<f32>(params.boundary), four_radiance(base, places.far), there);
        let far_end = select(params.boundary, read_radiance(base + places.far_end), there_end);
        var light = passes * between(around, near, near_end, far, far_end, vec4<f32>(0.0));
        if has_toward {
            let own = four_toward(base, places.own);
            let upwind = between(
                around,
                four_toward(base, places.near), read_toward(base + places.near_end),
                four_toward(base, places.far), read_toward(base + places.far_end),
                own,
            );
            light += own * (tau * shines) + (select(upwind, own, vec4<bool>(enters)) - own) * leaning(tau, passes, shines);
        }
        if params.emits == 1u {
            let plane = (6u + channel) * count;
            let own = four_optics(plane, places.own);
            let near = select(vec4<f32>(0.0), four_optics(plane, places.near), here);
            let near_end = select(0.0, read_optics(plane + places.near_end), here_end);
            let far = select(vec4<f32>(0.0), four_optics(plane, places.far), there);
            let far_end = select(0.0, read_optics(plane + places.far_end), there_end);
            light += shines * (0.5 * way.length) * (own + between(around, near, near_end, far, far_end, own));
        }
        // Beyond the end of the row this is the last cell's again.
        write_radiance(base + places.own.x, light.x);
        if left > 1 {
            write_radiance(base + places.own.y, light.y);
        }
        if left > 2 {
            write_radiance(base + places.own.z, light.z);
        }
        if left > 3 {
            write_radiance(base + places.own.w, light.w);
        }
    }
}

// What stands where the rays of four cells meet the plane upwind: of two rows of five cells there, or a cell's own where one is
// behind a surface.
fn between(around: Around, near: vec4<f32>, near_end: f32, far: vec4<f32>, far_end: f32, own: vec4<f32>) -> vec4<f32> {
    let stands = vec4<u32>(1u);
    let w = around.weights;
    return w.x * select(near, own, (around.words >> around.bits.xxxx & stands) == stands)
        + w.y * select(vec4<f32>(near.yzw, near_end), own, (around.words >> around.bits.yyyy & stands) == stands)
        + w.z * select(far, own, (around.words >> around.bits.zzzz & stands) == stands)
        + w.w * select(vec4<f32>(far.yzw, far_end), own, (around.words >> around.bits.wwww & stands) == stands);
}

// As `leaning` of kernels/sweep.wgsl, of four.
fn leaning(tau: vec4<f32>, passes: vec4<f32>, shines: vec4<f32>) -> vec4<f32> {
    let series = (((tau * (-1.0 / 30.0) + 1.0 / 8.0) * tau - 1.0 / 3.0) * tau + 0.5) * tau;
    return select(shines - passes, series, tau < vec4<f32>(0.05));
}

fn four_optics(base: u32, at: vec4<u32>) -> vec4<f32> {
    let i = base + at;
    return vec4<f32>(read_optics(i.x), read_optics(i.y), read_optics(i.z), read_optics(i.w));
}

fn four_radiance(base: u32, at: vec4<u32>) -> vec4<f32> {
    let i = base + at;
    return vec4<f32>(read_radiance(i.x), read_radiance(i.y), read_radiance(i.z), read_radiance(i.w));
}

// The source functions that `sweep_toward` summed.
fn four_toward(base: u32, at: vec4<u32>) -> vec4<f32> {
    let i = base + at;
    return vec4<f32>(read_toward(i.x), read_toward(i.y), read_toward(i.z), read_toward(i.w));
}
