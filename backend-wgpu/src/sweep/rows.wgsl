// The planes of `sweep` by two rows of four cells, which share what they load of the plane upwind. One workgroup a direction; one
// invocation eight cells of a plane at a time, counted the way that the direction leads.

// A direction's way through the planes: along its axis, along their rows and across those.
struct Course {
    length: f32,
    // Cells, how far apart neighbours lie the way that it leads, and whether that is down.
    size: vec3<u32>,
    hop: vec3<i32>,
    falls: vec3<bool>,
    // What four cells of the plane upwind weigh, and their bits in the word of a cell that stands among surfaces.
    weights: vec4<f32>,
    bits: vec4<u32>,
}

// The four cells of the plane upwind around the ray of each of four cells: what they weigh, and which stand behind surfaces.
struct Around {
    weights: vec4<f32>,
    // Of each cell the surfaces around it, and the bits of the four.
    words: vec4<u32>,
    bits: vec4<u32>,
}

// Where five cells of a row upwind are, and which of them are cells.
struct Places {
    four: vec4<u32>,
    end: u32,
    here: vec4<bool>,
    here_end: bool,
}

// What they hold.
struct Row {
    four: vec4<f32>,
    end: f32,
}

// The rays of four cells: their optical depths, and what those leave of light from upwind and of what shines along them.
struct Rays {
    tau: vec4<f32>,
    passes: vec4<f32>,
    shines: vec4<f32>,
}

@compute @workgroup_size(UNITS)
fn sweep_rows(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    let steps = params.cells.w + 1u;
    let first = launch.first / steps * params.batch;
    let cells = params.cells.xyz;
    // Found once: drivers take nothing out of loops.
    let course = through(read_directions(first + n));
    let items = (course.size.y + 3u) / 4u * ((course.size.z + 1u) / 2u);
    for (var step = launch.first; step < launch.past; step++) {
        if n < launch.count {
            var item = 0u;
            // Asked at its end: drivers run a loop once more after what is asked at its begin.
            loop {
                advance(course, n, step % steps, item + lane);
                continuing {
                    item += UNITS;
                    break if item >= items;
                }
            }
        }
        // Each plane sees the one before it.
        textureBarrier();
    }
}

// The way of a direction.
fn through(way: SweepDirection) -> Course {
    let x = way.axis == 0u;
    let z = way.axis == 2u;
    let cells = params.cells;
    let size = vec3<u32>(select(select(cells.y, cells.z, z), cells.x, x), select(cells.x, cells.y, x), select(cells.z, cells.y, z));
    let slice = cells.x * cells.y;
    let pitch = vec3<i32>(vec3<u32>(select(select(cells.x, slice, z), 1u, x), select(1u, cells.x, x), select(slice, cells.x, z)));
    let down = vec3<u32>(way.down >> way.axis, way.down >> select(0u, 1u, x), way.down >> select(2u, 1u, z));
    let falls = (down & vec3<u32>(1u)) == vec3<u32>(1u);
    let across = vec4<f32>(1.0 - way.second, 1.0 - way.second, way.second, way.second);
    let weights = vec4<f32>(1.0 - way.first, way.first, 1.0 - way.first, way.first) * across;
    let turn = vec3<i32>(select(select(3, 9, z), 1, x), select(1, 3, x), select(9, 3, z));
    let on = select(turn, -turn, falls);
    let bits = vec4<u32>(13 + on.x + vec4<i32>(0, on.y, on.z, on.y + on.z));
    return Course(way.length, size, select(pitch, -pitch, falls), falls, weights, bits);
}

// Radiance of eight cells of the plane that a step finishes, of direction `n` of the batch.
fn advance(course: Course, n: u32, step: u32, item: u32) {
    let size = course.size;
    let hop = course.hop;
    let fours = (size.y + 3u) / 4u;
    if step >= size.x || item >= fours * ((size.z + 1u) / 2u) {
        return;
    }
    let within = divide(item, fours);
    // Along the axis the plane before lies the other way.
    let begin = vec3<u32>(size.x - 1u - step, 4u * within.y, 2u * within.x);
    let place = vec3<i32>(select(begin, size - 1u - begin, course.falls)) * abs(hop);
    let cell = place.x + place.y + place.z;
    // Beyond the end of its row a cell's place is that of the last one, beyond the last row that of this one, and beyond the
    // box this plane's.
    let left = i32(size.y - begin.y);
    let on = min(vec4<i32>(0, 1, 2, 3), vec4<i32>(left - 1)) * hop.y;
    let end = min(4, left - 1) * hop.y;
    let enters = step == 0u;
    let two = begin.z + 1u < size.z;
    let three = begin.z + 2u < size.z;
    let up = cell + select(hop.x, 0, enters);
    let beyond = select(0, hop.z, two);
    let last = beyond + select(0, hop.z, three);
    let own = vec4<u32>(cell + on);
    let beside = vec4<u32>(cell + beyond + on);
    // Which of them are cells.
    let here = vec4<bool>(!enters, !enters && left > 1, !enters && left > 2, !enters && left > 3);
    let here_end = !enters && left > 4;
    let a = Places(vec4<u32>(up + on), u32(up + end), here, here_end);
    let b = Places(vec4<u32>(up + beyond + on), u32(up + beyond + end), here & vec4<bool>(two), here_end && two);
    let c = Places(vec4<u32>(up + last + on), u32(up + last + end), here & vec4<bool>(three), here_end && three);
    var around = Around(course.weights, vec4<u32>(0u), course.bits);
    var around_beside = around;
    if has_obstructed {
        around.words = four_obstructed(own);
        around_beside.words = four_obstructed(beside);
    }
    let count = params.cells.x * params.cells.y * params.cells.z;
    let half = 0.5 * course.length;
    let none = vec4<f32>(0.0);
    var rays = Rays(none, none, none);
    var rays_beside = rays;
    for (var channel = 0u; channel < params.channels; channel++) {
        if channel == 0u || params.grey == 0u {
            let base = channel * count;
            let middle = row_optics(base, b);
            let of_own = four_optics(base, own);
            let of_beside = four_optics(base, beside);
            rays = along((of_own + between(around, row_optics(base, a), middle, of_own)) * half);
            rays_beside = along((of_beside + between(around_beside, middle, row_optics(base, c), of_beside)) * half);
        }
        let base = (n * params.channels + channel) * count;
        let middle = row_radiance(base, b);
        var light = rays.passes * between(around, row_radiance(base, a), middle, none);
        var light_beside = rays_beside.passes * between(around_beside, middle, row_radiance(base, c), none);
        if has_toward {
            let middle = row_toward(base, b);
            let of_own = four_toward(base, own);
            let of_beside = four_toward(base, beside);
            let upwind = between(around, row_toward(base, a), middle, of_own);
            let upwind_beside = between(around_beside, middle, row_toward(base, c), of_beside);
            light += scattered(rays, of_own, select(upwind, of_own, vec4<bool>(enters)));
            light_beside += scattered(rays_beside, of_beside, select(upwind_beside, of_beside, vec4<bool>(enters)));
        }
        if params.emits == 1u {
            let plane = (6u + channel) * count;
            let middle = row_optics(plane, b);
            let of_own = four_optics(plane, own);
            let of_beside = four_optics(plane, beside);
            light += rays.shines * half * (of_own + between(around, row_optics(plane, a), middle, of_own));
            light_beside += rays_beside.shines * half * (of_beside + between(around_beside, middle, row_optics(plane, c), of_beside));
        }
        // Beyond the end of the row this is the last cell's again.
        keep(base, own, light, left);
        keep(base, beside, light_beside, select(0, left, two));
    }
}

// What stands where the rays of four cells meet the plane upwind: of two rows of five cells there, or a cell's own where one is
// behind a surface.
fn between(around: Around, near: Row, far: Row, own: vec4<f32>) -> vec4<f32> {
    let stands = vec4<u32>(1u);
    let w = around.weights;
    return w.x * select(near.four, own, (around.words >> around.bits.xxxx & stands) == stands)
        + w.y * select(vec4<f32>(near.four.yzw, near.end), own, (around.words >> around.bits.yyyy & stands) == stands)
        + w.z * select(far.four, own, (around.words >> around.bits.zzzz & stands) == stands)
        + w.w * select(vec4<f32>(far.four.yzw, far.end), own, (around.words >> around.bits.wwww & stands) == stands);
}

// Rays of these optical depths.
fn along(tau: vec4<f32>) -> Rays {
    let a = segment(tau.x);
    let b = segment(tau.y);
    let c = segment(tau.z);
    let d = segment(tau.w);
    return Rays(tau, vec4<f32>(a.x, b.x, c.x, d.x), vec4<f32>(a.y, b.y, c.y, d.y));
}

// What four cells scatter along their rays, where it goes over into theirs from that upwind.
fn scattered(rays: Rays, own: vec4<f32>, upwind: vec4<f32>) -> vec4<f32> {
    return own * (rays.tau * rays.shines) + (upwind - own) * leaning(rays.tau, rays.passes, rays.shines);
}

// As `leaning` of kernels/sweep.wgsl, of four.
fn leaning(tau: vec4<f32>, passes: vec4<f32>, shines: vec4<f32>) -> vec4<f32> {
    let series = (((tau * (-1.0 / 30.0) + 1.0 / 8.0) * tau - 1.0 / 3.0) * tau + 0.5) * tau;
    return select(shines - passes, series, tau < vec4<f32>(0.05));
}

fn four_obstructed(at: vec4<u32>) -> vec4<u32> {
    return vec4<u32>(read_obstructed(at.x), read_obstructed(at.y), read_obstructed(at.z), read_obstructed(at.w));
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

// Nothing where there is no cell.
fn row_optics(base: u32, at: Places) -> Row {
    let four = select(vec4<f32>(0.0), four_optics(base, at.four), at.here);
    return Row(four, select(0.0, read_optics(base + at.end), at.here_end));
}

fn row_radiance(base: u32, at: Places) -> Row {
    let four = select(vec4<f32>(params.boundary), four_radiance(base, at.four), at.here);
    return Row(four, select(params.boundary, read_radiance(base + at.end), at.here_end));
}

fn row_toward(base: u32, at: Places) -> Row {
    return Row(four_toward(base, at.four), read_toward(base + at.end));
}

// Writes as many of four cells as there are.
fn keep(base: u32, at: vec4<u32>, light: vec4<f32>, count: i32) {
    let i = base + at;
    if count > 0 {
        write_radiance(i.x, light.x);
    }
    if count > 1 {
        write_radiance(i.y, light.y);
    }
    if count > 2 {
        write_radiance(i.z, light.z);
    }
    if count > 3 {
        write_radiance(i.w, light.w);
    }
}
