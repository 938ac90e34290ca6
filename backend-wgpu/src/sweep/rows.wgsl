// The planes of `sweep` by two rows of four cells, which share what they load of the plane upwind. One workgroup a direction; one
// invocation eight cells of a plane at a time. Planes and pairs of rows are counted the way that the direction leads, cells of a row
// from its begin on.

// A direction's way through the planes: along its axis, along their rows and across those.
struct Course {
    length: f32,
    // Cells, and texels of a row.
    size: vec3<u32>,
    fours: u32,
    // How many texels planes and rows lie apart the way that it leads, how many cells those and cells of a row, and what leads down.
    hop: vec2<i32>,
    pitch: vec3<i32>,
    falls: vec3<bool>,
    // Where the optics of its rows begin.
    optics: u32,
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

// Where four cells of a row upwind are, and the texel that the cell beside them the way that the direction leads is of; which of
// them are cells.
struct Places {
    four: u32,
    beside: u32,
    here: vec4<bool>,
    here_beside: bool,
}

// What four cells hold, and what those beside each of them do the way that the direction leads.
struct Row {
    four: vec4<f32>,
    next: vec4<f32>,
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
    // Found once: drivers take nothing out of loops.
    let course = through(read_directions(first + n));
    let items = course.fours * ((course.size.z + 1u) / 2u);
    // A number of a workgroup hides the end from drivers that build kernels for it.
    let past = launch.past + (id.x >> 31u);
    for (var step = launch.first; step < past; step++) {
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
    let row = rows(x);
    let far = i32(row.y * row.z);
    let apart = vec2<i32>(select(i32(row.z), far, z), select(far, i32(row.z), z));
    let slice = cells.x * cells.y;
    let pitch = vec3<i32>(vec3<u32>(select(select(cells.x, slice, z), 1u, x), select(1u, cells.x, x), select(slice, cells.x, z)));
    let down = vec3<u32>(way.down >> way.axis, way.down >> select(0u, 1u, x), way.down >> select(2u, 1u, z));
    let falls = (down & vec3<u32>(1u)) == vec3<u32>(1u);
    let across = vec4<f32>(1.0 - way.second, 1.0 - way.second, way.second, way.second);
    let weights = vec4<f32>(1.0 - way.first, way.first, 1.0 - way.first, way.first) * across;
    let turn = vec3<i32>(select(select(3, 9, z), 1, x), select(1, 3, x), select(9, 3, z));
    let on = select(turn, -turn, falls);
    let bits = vec4<u32>(13 + on.x + vec4<i32>(0, on.y, on.z, on.y + on.z));
    let hop = select(apart, -apart, falls.xz);
    return Course(way.length, size, row.z, hop, pitch, falls, select(0u, values() * texels(), x), weights, bits);
}

// Radiance of eight cells of the plane that a step finishes, of direction `n` of the batch.
fn advance(course: Course, n: u32, step: u32, item: u32) {
    let size = course.size;
    let hop = course.hop;
    if step >= size.x || item >= course.fours * ((size.z + 1u) / 2u) {
        return;
    }
    let within = divide(item, course.fours);
    // Along the axis the plane before lies the other way.
    let begin = vec2<u32>(size.x - 1u - step, 2u * within.x);
    let place = vec2<i32>(select(begin, size.xz - 1u - begin, course.falls.xz));
    let own = place.x * abs(hop.x) + place.y * abs(hop.y) + i32(within.y);
    let along = 4u * within.y;
    let left = size.y - along;
    // Beyond the last row a cell's place is that of this one, and beyond the box this plane's.
    let enters = step == 0u;
    let two = begin.y + 1u < size.z;
    let three = begin.y + 2u < size.z;
    let up = own + select(hop.x, 0, enters);
    let beyond = select(0, hop.y, two);
    let last = beyond + select(0, hop.y, three);
    let down = course.falls.y;
    // Which of them are cells.
    let here = vec4<bool>(!enters, !enters && left > 1u, !enters && left > 2u, !enters && left > 3u);
    let ends = select(left <= 4u, along == 0u, down);
    let beside = select(select(1, -1, down), 0, ends);
    let here_beside = !enters && !ends;
    let a = Places(u32(up), u32(up + beside), here, here_beside);
    let b = Places(u32(up + beyond), u32(up + beyond + beside), here & vec4<bool>(two), here_beside && two);
    let c = Places(u32(up + last), u32(up + last + beside), here & vec4<bool>(three), here_beside && three);
    var around = Around(course.weights, vec4<u32>(0u), course.bits);
    var around_beyond = around;
    if has_obstructed {
        let four = vec4<i32>(min(along + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(size.y - 1u))) * course.pitch.y;
        let cell = place.x * course.pitch.x + place.y * course.pitch.z + four;
        let across = select(0, select(course.pitch.z, -course.pitch.z, course.falls.z), two);
        around.words = four_obstructed(vec4<u32>(cell));
        around_beyond.words = four_obstructed(vec4<u32>(cell + across));
    }
    let count = texels();
    let half = 0.5 * course.length;
    let none = vec4<f32>(0.0);
    var rays = Rays(none, none, none);
    var rays_beyond = rays;
    for (var channel = 0u; channel < params.channels; channel++) {
        if channel == 0u || params.grey == 0u {
            let base = course.optics + channel * count;
            let middle = row_optics(base, b, down);
            let of_own = read_optics(base + u32(own));
            let of_beyond = read_optics(base + u32(own + beyond));
            rays = along_rays((of_own + between(around, row_optics(base, a, down), middle, of_own)) * half);
            rays_beyond = along_rays((of_beyond + between(around_beyond, middle, row_optics(base, c, down), of_beyond)) * half);
        }
        let base = (n * params.channels + channel) * count;
        let middle = row_radiance(base, b, down);
        var light = rays.passes * between(around, row_radiance(base, a, down), middle, none);
        var light_beyond = rays_beyond.passes * between(around_beyond, middle, row_radiance(base, c, down), none);
        if has_toward {
            let middle = row_toward(base, b, down, ends);
            let of_own = read_toward(base + u32(own));
            let of_beyond = read_toward(base + u32(own + beyond));
            let upwind = between(around, row_toward(base, a, down, ends), middle, of_own);
            let upwind_beyond = between(around_beyond, middle, row_toward(base, c, down, ends), of_beyond);
            light += scattered(rays, of_own, select(upwind, of_own, vec4<bool>(enters)));
            light_beyond += scattered(rays_beyond, of_beyond, select(upwind_beyond, of_beyond, vec4<bool>(enters)));
        }
        if params.emits == 1u {
            let plane = course.optics + (extinctions() + albedos() + channel) * count;
            let middle = row_optics(plane, b, down);
            let of_own = read_optics(plane + u32(own));
            let of_beyond = read_optics(plane + u32(own + beyond));
            light += rays.shines * half * (of_own + between(around, row_optics(plane, a, down), middle, of_own));
            light_beyond +=
                rays_beyond.shines * half * (of_beyond + between(around_beyond, middle, row_optics(plane, c, down), of_beyond));
        }
        write_radiance(base + u32(own), light);
        if two {
            write_radiance(base + u32(own + beyond), light_beyond);
        }
    }
}

// What stands where the rays of four cells meet the plane upwind: of two rows there, or a cell's own where one is
// behind a surface.
fn between(around: Around, near: Row, far: Row, own: vec4<f32>) -> vec4<f32> {
    let stands = vec4<u32>(1u);
    let w = around.weights;
    return w.x * select(near.four, own, (around.words >> around.bits.xxxx & stands) == stands)
        + w.y * select(near.next, own, (around.words >> around.bits.yyyy & stands) == stands)
        + w.z * select(far.four, own, (around.words >> around.bits.zzzz & stands) == stands)
        + w.w * select(far.next, own, (around.words >> around.bits.wwww & stands) == stands);
}

// Rays of these optical depths.
fn along_rays(tau: vec4<f32>) -> Rays {
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

// A row of four cells and the one beside the last of them, or the first where it leads down.
fn row(four: vec4<f32>, beside: f32, down: bool) -> Row {
    return Row(four, select(vec4<f32>(four.yzw, beside), vec4<f32>(beside, four.xyz), down));
}

// The cell of a texel that is next to those that it is beside of.
fn nearest(texel: vec4<f32>, down: bool) -> f32 {
    return select(texel.x, texel.w, down);
}

// Nothing where there is no cell.
fn row_optics(base: u32, at: Places, down: bool) -> Row {
    let beside = select(0.0, nearest(read_optics(base + at.beside), down), at.here_beside);
    return row(select(vec4<f32>(0.0), read_optics(base + at.four), at.here), beside, down);
}

fn row_radiance(base: u32, at: Places, down: bool) -> Row {
    let beside = select(params.boundary, nearest(read_radiance(base + at.beside), down), at.here_beside);
    return row(select(vec4<f32>(params.boundary), read_radiance(base + at.four), at.here), beside, down);
}

// The nearest cell where there is none.
fn row_toward(base: u32, at: Places, down: bool, ends: bool) -> Row {
    return row(read_toward(base + at.four), nearest(read_toward(base + at.beside), down != ends), down);
}
