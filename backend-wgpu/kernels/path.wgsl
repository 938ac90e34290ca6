// `path`: unbiased paths of light through everything. One invocation a pixel.

fn phase_value(i: u32) -> f32 {
    return read_tables(params.phase_at + i);
}

fn phase_size() -> u32 {
    return params.phase_size;
}

// A path on its way, as PathRecord keeps it.
struct Way {
    mode: u32,
    place: vec3<f32>,
    direction: vec3<f32>,
    next: vec3<f32>,
    density: f32,
    weight: vec3<f32>,
    total: f32,
    light: vec3<f32>,
    chosen: f32,
    pending: vec3<f32>,
    stopped: f32,
    ratio: vec3<f32>,
    stopped_at: f32,
    through: vec3<f32>,
    surface: f32,
    depth: u32,
    triangle: u32,
}

// The turns of a pixel.
@compute @workgroup_size(UNITS)
fn path(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let pixel = launch.start + n;
    // What is bound in parts is bound from a pixel on.
    let here = pixel - launch.first;
    var light = vec4<f32>(0.0);
    var seen = vec4<f32>(0.0);
    var stop = vec4<f32>(0.0);
    var record: PathRecord;
    if params.fresh != 1u {
        light = sums[3u * here];
        seen = sums[3u * here + 1u];
        stop = sums[3u * here + 2u];
        record = paths[here];
    }
    var way = resume(record);
    var on = kept(record);
    var numbers = draws(pixel, u32(light.w), params.frame, record.count.y);
    // Loops turn once more than they have to, where drivers count.
    let taken = select(WALKED + 2u, 1u, WALKED == 1u);
    for (var turns = 0u; turns < params.turns; turns += taken) {
        var sets_out = true;
        if way.mode == PATH_IDLE || way.mode == PATH_DEPART {
            if way.mode == PATH_DEPART {
                way.direction = way.next;
                way.mode = PATH_FLIGHT;
            } else {
                if light.w >= f32(params.samples) {
                    break;
                }
                numbers = draws(pixel, u32(light.w), params.frame, 0u);
                way = begin(pixel, &numbers);
            }
            meet(&way);
        } else {
            sets_out = turn(here, &way, &on, &numbers, min(WALKED, params.turns - turns));
            if sets_out {
                sets_out = scatter(&way, &numbers);
            }
        }
        if sets_out {
            on = walk(placed(way.place), carried(way.direction), limit(way, here));
        }
        if way.mode == PATH_IDLE {
            let l = way.light;
            let mean = (l.x + l.y + l.z) * (1.0 / 3.0);
            light += vec4<f32>(l, 1.0);
            seen += vec4<f32>(way.through, mean * mean);
            stop += vec4<f32>(way.stopped, way.stopped_at, 0.0, 0.0);
        }
    }
    sums[3u * here] = light;
    sums[3u * here + 1u] = seen;
    sums[3u * here + 2u] = stop;
    paths[here] = keep(way, on, numbers);
    let share = 1.0 / max(light.w, 1.0);
    let transmitted = seen.xyz * share;
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    let stops = (3.0 * light.w - (seen.x + seen.y + seen.z)) * (share / 3.0);
    var depth = launch.infinity;
    if stop.x > 0.0 {
        depth = stop.y / stop.x;
    }
    film[2u * here] = vec4<f32>(light.xyz * share, stops);
    film[2u * here + 1u] = vec4<f32>(transmitted, depth);
}

// A place of the world, from the eye, in index space.
fn placed(x: vec3<f32>) -> vec3<f32> {
    return params.eye.xyz + to_index(x);
}

// The walk that a record keeps.
fn kept(record: PathRecord) -> Walk {
    let origin = placed(record.place.xyz);
    let direction = carried(record.way.xyz);
    let cell = vec3<i32>(record.cell.xyz);
    return Walk(origin, direction, record.place.w, record.way.w, cell, record.cell.w == 1u);
}

// The path that a record keeps.
fn resume(record: PathRecord) -> Way {
    return Way(
        record.count.x,
        record.place.xyz,
        record.way.xyz,
        record.next.xyz,
        record.next.w,
        record.weight.xyz,
        record.weight.w,
        record.light.xyz,
        record.light.w,
        record.pending.xyz,
        record.pending.w,
        record.ratio.xyz,
        record.ratio.w,
        record.through.xyz,
        record.through.w,
        record.count.z,
        record.count.w,
    );
}

// What a record keeps of a path.
fn keep(way: Way, on: Walk, numbers: Draws) -> PathRecord {
    return PathRecord(
        vec4<f32>(way.place, on.t),
        vec4<f32>(way.direction, on.far),
        vec4<f32>(way.next, way.density),
        vec4<f32>(way.weight, way.total),
        vec4<f32>(way.light, way.chosen),
        vec4<f32>(way.pending, way.stopped),
        vec4<f32>(way.ratio, way.stopped_at),
        vec4<f32>(way.through, way.surface),
        vec4<u32>(vec3<u32>(on.cell), u32(on.over)),
        vec4<u32>(way.mode, numbers.next, way.depth, way.triangle),
    );
}

// A path at the eye.
fn begin(pixel: u32, numbers: ptr<function, Draws>) -> Way {
    let width = f32(params.width);
    let a = (f32(pixel % params.width) + draw(numbers)) * (2.0 / width) - 1.0;
    let b = 1.0 - (f32(pixel / params.width) + draw(numbers)) * (2.0 / f32(params.height));
    let toward = a * params.right.xyz + b * params.up.xyz + params.forward.xyz;
    var way: Way;
    way.mode = PATH_VIEW;
    way.direction = toward / sqrt(dot(toward, toward));
    way.ratio = vec3<f32>(1.0);
    way.through = vec3<f32>(1.0);
    return way;
}

// Where the ray meets a surface.
fn meet(way: ptr<function, Way>) {
    (*way).surface = FAR;
    if !has_mesh {
        return;
    }
    let hit = nearest(line(from_mesh((*way).place), (*way).direction), 0.0, FAR, 0u, params.nodes);
    if hit.distance < FAR {
        (*way).surface = hit.distance;
        (*way).triangle = hit.triangle;
    }
}

// A place from the mesh's origin.
fn from_mesh(place: vec3<f32>) -> vec3<f32> {
    return params.mesh_eye.xyz + place;
}

// What stands behind a pixel; nothing without a background.
fn behind(here: u32) -> vec4<f32> {
    if has_background {
        return read_background(here);
    }
    return vec4<f32>(0.0, 0.0, 0.0, FAR);
}

// Where the ray ends; that from the eye also at what stands behind everything.
fn limit(way: Way, here: u32) -> f32 {
    if way.mode == PATH_VIEW {
        return min(way.surface, behind(here).w);
    }
    return way.surface;
}

// A turn of a walk: some steps, and its end. Whether the path scatters where it now is. What else happens to paths takes longer
// than a step, and drivers that run both sides of every condition take that at every turn of any path.
fn turn(here: u32, way: ptr<function, Way>, on: ptr<function, Walk>, numbers: ptr<function, Draws>, steps: u32) -> bool {
    var scatters = false;
    for (var k = 0u; (k < steps) & !scatters & !(*on).over & ((*way).mode != PATH_IDLE); k++) {
        scatters = step(way, on, numbers);
    }
    if !scatters && (*on).over && (*way).mode != PATH_IDLE {
        return arrive(here, way, numbers);
    }
    return scatters;
}

// A step of a walk. Whether the path scatters where it now is.
fn step(way: ptr<function, Way>, on: ptr<function, Walk>, numbers: ptr<function, Draws>) -> bool {
    let rate = advance(on, numbers);
    if rate == 0.0 {
        return false;
    }
    let at = stands(*on);
    let stops = extinction(at, rate);
    if (*way).mode == PATH_SHADOW {
        (*way).ratio = faint((*way).ratio * (1.0 - stops), numbers);
        (*on).over = all((*way).ratio == vec3<f32>(0.0));
        return false;
    }
    let scatters = scattering(at, stops, rate);
    let shines = emission(at, rate);
    if (*way).mode == PATH_VIEW {
        (*way).light += (*way).ratio * shines;
        let stopped = dot((*way).ratio, stops);
        (*way).stopped += stopped;
        (*way).stopped_at += stopped * (*on).t;
        offer(way, (*way).ratio * tinted(at, scatters, rate), (*on).t, numbers);
        (*way).ratio = faint((*way).ratio * (1.0 - stops), numbers);
        (*on).over = all((*way).ratio == vec3<f32>(0.0));
        return false;
    }
    (*way).light += (*way).weight * shines;
    let whole = (*way).weight.x + (*way).weight.y + (*way).weight.z;
    let real = dot((*way).weight, stops) / whole;
    if draw(numbers) >= real {
        (*way).weight = (*way).weight * (1.0 - stops) / (1.0 - real);
        return false;
    }
    (*way).weight = (*way).weight * scatters / real;
    (*way).place += (*on).t * (*way).direction;
    if all((*way).weight == vec3<f32>(0.0)) || (*way).depth >= params.max_depth {
        (*way).mode = PATH_IDLE;
        return false;
    }
    (*way).surface = FAR;
    return true;
}

// σt/μ, at most 1: lookups are good to a rounding.
fn extinction(at: vec3<f32>, rate: f32) -> vec3<f32> {
    let density = sample_density(at, vec3<i32>(params.dims.xyz), 0);
    return min(density / rate * params.extinction.xyz, vec3<f32>(1.0));
}

// σs/μ.
fn scattering(at: vec3<f32>, stops: vec3<f32>, rate: f32) -> vec3<f32> {
    if has_scattering {
        let density = sample_scattering(at, vec3<i32>(params.dims.xyz), 0).xyz;
        return density / rate * params.extinction.xyz * params.albedo.xyz;
    }
    return stops * params.albedo.xyz;
}

// σs/μ as the eye sees it.
fn tinted(at: vec3<f32>, scatters: vec3<f32>, rate: f32) -> vec3<f32> {
    if has_seen_scattering {
        let density = sample_seen_scattering(at, vec3<i32>(params.dims.xyz), 0).xyz;
        return density / rate * params.extinction.xyz * params.albedo.xyz;
    }
    return scatters;
}

// j/μ.
fn emission(at: vec3<f32>, rate: f32) -> vec3<f32> {
    if params.emission.x + params.emission.y + params.emission.z == 0.0 {
        return vec3<f32>(0.0);
    }
    let size = vec3<i32>(params.dims.xyz);
    var source = vec3<f32>(0.0);
    if has_emission_color {
        source = sample_emission_color(at, size, 0).xyz;
    } else if has_emission_density {
        source = vec3<f32>(sample_emission_density(at, size, 0));
    } else {
        source = vec3<f32>(sample_density(at, size, 0));
    }
    return source / rate * params.emission.xyz;
}

// T, or nothing by the chance that makes up for it where T is faint.
fn faint(ratio: vec3<f32>, numbers: ptr<function, Draws>) -> vec3<f32> {
    let most = max(max(ratio.x, ratio.y), ratio.z);
    if most >= PATH_FAINT {
        return ratio;
    }
    if draw(numbers) * PATH_FAINT < most {
        return ratio * (PATH_FAINT / most);
    }
    return vec3<f32>(0.0);
}

// A place on the eye's ray to scatter at, `t` metres along, with its weights.
fn offer(way: ptr<function, Way>, weights: vec3<f32>, t: f32, numbers: ptr<function, Draws>) {
    let weight = weights.x + weights.y + weights.z;
    if weight > 0.0 {
        (*way).total += weight;
        if draw(numbers) * (*way).total < weight {
            (*way).weight = weights / weight;
            (*way).chosen = t;
        }
    }
}

// The end of a walk. Whether the path scatters where it now is.
fn arrive(here: u32, way: ptr<function, Way>, numbers: ptr<function, Draws>) -> bool {
    if (*way).mode == PATH_SHADOW {
        (*way).light += (*way).pending * (*way).ratio;
        (*way).mode = select(PATH_DEPART, PATH_IDLE, all((*way).weight == vec3<f32>(0.0)));
        return false;
    }
    let d = (*way).direction;
    var t = (*way).surface;
    var goes_on = false;
    // What of the environment is seen.
    var share = vec3<f32>(0.0);
    if (*way).mode == PATH_VIEW {
        (*way).through = (*way).ratio;
        let back = behind(here);
        if (*way).surface < min(back.w, FAR) {
            offer(way, (*way).ratio, -1.0, numbers);
        } else if back.w < FAR {
            (*way).light += (*way).ratio * back.xyz;
        } else if params.visible == 1u {
            share = (*way).ratio;
        }
        goes_on = (*way).total > 0.0;
        (*way).weight *= (*way).total;
        if (*way).chosen >= 0.0 {
            t = (*way).chosen;
            (*way).surface = FAR;
        }
    } else if (*way).surface < FAR {
        goes_on = (*way).depth < params.max_depth;
    } else {
        share = (*way).weight * share_of_scattering(d, (*way).density);
    }
    if any(share != vec3<f32>(0.0)) {
        (*way).light += share * surroundings(d);
    }
    if goes_on {
        (*way).place += t * d;
    } else {
        (*way).mode = PATH_IDLE;
    }
    return goes_on;
}

// The environment's radiance; none without one.
fn surroundings(d: vec3<f32>) -> vec3<f32> {
    if has_environment {
        return sky(d);
    }
    return vec3<f32>(0.0);
}

// The share of scattering, of that density, in what is seen of the environment along `d` (balance heuristic).
fn share_of_scattering(d: vec3<f32>, density: f32) -> f32 {
    if !has_environment {
        return 1.0;
    }
    return density / (density + sky_density(d));
}

// The probability that the environment is chosen and drawn along `d`, per steradian.
fn sky_density(d: vec3<f32>) -> f32 {
    let u = angle(d.x, -d.z) / (2.0 * PI) + params.environment.w;
    let column = u32((u - floor(u)) * f32(params.sky_columns));
    let row = u32(angle_of_cosine(d.y) / PI * f32(params.sky_rows));
    let cell = min(row, params.sky_rows - 1u) * params.sky_columns + min(column, params.sky_columns - 1u);
    return read_tables(params.sky_at + CHOICE * cell + 2u) * chance(params.lights);
}

// The probability that a light, or behind them all the environment, is chosen.
fn chance(item: u32) -> f32 {
    return read_tables(params.choices_at + CHOICE * item + 2u);
}

// A direction toward the environment.
fn toward_sky(numbers: ptr<function, Draws>) -> vec3<f32> {
    let cell = choose(params.sky_at, params.sky_columns * params.sky_rows, numbers);
    let u = (f32(cell % params.sky_columns) + draw(numbers)) / f32(params.sky_columns) - params.environment.w;
    let edge = params.edges_at + cell / params.sky_columns;
    let y = read_tables(edge) + (read_tables(edge + 1u) - read_tables(edge)) * draw(numbers);
    let p = circle(u - floor(u));
    let planar = sqrt(max(1.0 - y * y, 0.0));
    return vec3<f32>(planar * p.y, y, -planar * p.x);
}

// Draws where the path goes on, and looks at a light before; whether there is one to look at.
fn scatter(way: ptr<function, Way>, numbers: ptr<function, Draws>) -> bool {
    (*way).depth += 1u;
    let at = spot((*way).surface < FAR, from_mesh((*way).place), (*way).direction, (*way).triangle);
    let origin = (*way).direction;
    let margin = MESH_MARGIN * params.mesh_eye.w;
    (*way).place += margin * at.facet;
    let looks = look(way, at, numbers);
    onward(way, at, origin, numbers);
    if looks {
        (*way).mode = PATH_SHADOW;
    }
    return looks;
}

// Chooses a light and what comes from it but for the medium; whether anything does. The ray is then toward the light.
fn look(way: ptr<function, Way>, at: Spot, numbers: ptr<function, Draws>) -> bool {
    if params.choices == 0u {
        return false;
    }
    let item = choose(params.choices_at, params.choices, numbers);
    let origin = (*way).direction;
    var toward = vec3<f32>(0.0);
    var distance = FAR;
    var arriving = vec3<f32>(0.0);
    if item < params.lights {
        let record = read_lights(item);
        let light = incident(record, (*way).place, 1.0);
        toward = light.toward;
        distance = min(light.distance, FAR);
        arriving = light.falloff / chance(item) * record.power.xyz;
    } else {
        toward = toward_sky(numbers);
        let density = sky_density(toward) + scattered_density(at, origin, toward);
        if density > 0.0 {
            arriving = surroundings(toward) / density;
        }
    }
    (*way).pending = (*way).weight * scattered(at, origin, toward) * arriving;
    if all((*way).pending == vec3<f32>(0.0)) {
        return false;
    }
    if has_mesh {
        let free = distance - MESH_MARGIN * params.mesh_eye.w;
        if blocked(line(from_mesh((*way).place), toward), free, 0u, params.nodes) {
            return false;
        }
    }
    (*way).direction = toward;
    (*way).surface = distance;
    (*way).ratio = vec3<f32>(1.0);
    return true;
}

// Draws where the path goes on, or that it ends.
fn onward(way: ptr<function, Way>, at: Spot, origin: vec3<f32>, numbers: ptr<function, Draws>) {
    (*way).mode = PATH_DEPART;
    let shines = params.emission.x + params.emission.y + params.emission.z > 0.0;
    if (*way).depth >= params.max_depth && !has_environment && !shines {
        (*way).weight = vec3<f32>(0.0);
    } else {
        if !at.surface {
            let c = bend(numbers);
            (*way).next = around(origin, c, draw(numbers));
        } else if draw(numbers) < dull(at) {
            let c = sqrt(draw(numbers));
            (*way).next = around(at.normal, c, draw(numbers));
        } else {
            let mirrored = origin - 2.0 * dot(origin, at.normal) * at.normal;
            let c = pow(1.0 - draw(numbers), 1.0 / (at.exponent + 1.0));
            (*way).next = around(mirrored, c, draw(numbers));
        }
        (*way).density = scattered_density(at, origin, (*way).next);
        let share = scattered(at, origin, (*way).next);
        if (*way).density > 0.0 {
            (*way).weight = (*way).weight * share / (*way).density;
        } else {
            (*way).weight = vec3<f32>(0.0);
        }
        let most = max(max((*way).weight.x, (*way).weight.y), (*way).weight.z);
        var stays = min(most / PATH_WEAK, 1.0);
        if (*way).depth >= PATH_LONG {
            stays = min(stays, 1.0 - 1.0 / f32(PATH_LONG));
        }
        if stays < 1.0 {
            if draw(numbers) < stays {
                (*way).weight = (*way).weight / stays;
            } else {
                (*way).weight = vec3<f32>(0.0);
            }
        }
    }
    if all((*way).weight == vec3<f32>(0.0)) {
        (*way).mode = PATH_IDLE;
    }
}
