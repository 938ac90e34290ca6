// `photons`: light that the medium scatters, left on the cells of a coarse grid. One invocation a photon.

fn phase_value(i: u32) -> f32 {
    return read_tables(params.phase_at + i);
}

fn phase_size() -> u32 {
    return params.phase_size;
}

fn harmonics_value(i: u32) -> f32 {
    return read_tables(i);
}

// A photon on its way.
struct Photon {
    on: Walk,
    way: vec3<f32>,
    weight: f32,
    // Scatterings before this flight.
    depth: u32,
    turns: u32,
    over: bool,
}

// A flight that leaves light: in index space from where; on its way through the world; metres of it, and light per metre or all
// of it.
struct Event {
    origin: vec3<f32>,
    length: f32,
    light: f32,
    way: vec3<f32>,
    depth: u32,
}

// What the cells get of a flight alike.
struct Cargo {
    moments: array<f32, HARMONICS_MAX>,
    rounding: Draws,
    // The weights of its direction: where they begin, and how many.
    weights: u32,
    count: u32,
}

// What a photon counts.
var<private> tally: array<i32, PHOTON_COUNTERS>;

// The photon of a unit.
@compute @workgroup_size(UNITS)
fn photons(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    let source = read_directions(unit % params.listed);
    let name = (params.round + unit / params.listed) * params.directions + source.number;
    var numbers = draws(name, 0u, params.seed, 0u);
    var photon = enter(source, &numbers);
    if params.begin == 1u {
        tally[PHOTON_PHOTONS] = 1;
    }
    var events: array<Event, PHOTON_EVENTS>;
    while !photon.over {
        let count = trace(&photon, &numbers, &events);
        for (var i = 0u; i < count; i++) {
            deposit(source, name, events[i]);
        }
    }
    for (var i = 0u; i < PHOTON_COUNTERS; i++) {
        if tally[i] > 0 {
            atomicAdd(&counters[i], tally[i]);
        }
    }
}

// A photon where it enters the box.
fn enter(source: PhotonDirection, numbers: ptr<function, Draws>) -> Photon {
    let way = -source.toward.xyz;
    let along_way = carried(way);
    let wall = draw(numbers);
    let a = draw(numbers);
    let b = draw(numbers);
    // The wall at the lower end lets in what goes up.
    let side = select(vec3<f32>(1.0), vec3<f32>(0.0), along_way > vec3<f32>(0.0));
    var at = vec3<f32>(a, b, side.z);
    if wall < source.first {
        at = vec3<f32>(side.x, a, b);
    } else if wall < source.second {
        at = vec3<f32>(a, side.y, b);
    }
    let origin = at * vec3<f32>(params.dims.xyz) - 0.5;
    return Photon(walk(origin, along_way, FAR), way, 1.0, 0u, 0u, false);
}

// Follows a photon until it has made so many flights that leave light as are kept, or is no more. How many it made.
fn trace(
    photon: ptr<function, Photon>,
    numbers: ptr<function, Draws>,
    events: ptr<function, array<Event, PHOTON_EVENTS>>,
) -> u32 {
    var count = 0u;
    var on = (*photon).on;
    var turns = (*photon).turns;
    while !(*photon).over && count < PHOTON_EVENTS {
        let leaves = (*photon).depth >= params.begin;
        if turns >= params.turns {
            (*photon).over = true;
            if leaves || params.begin == 1u {
                tally[PHOTON_TRUNCATED] += 1;
            }
            break;
        }
        var light = 0.0;
        var at = on.origin;
        let rate = approach(&on, numbers, &turns);
        if rate == 0.0 {
            if !on.over || turns >= params.turns {
                continue;
            }
            turns += 1u;
            (*photon).over = true;
            if params.deposit == DEPOSIT_TRACK {
                light = (*photon).weight;
            }
        } else {
            at = stands(on);
            let density = sample_density(at, vec3<i32>(params.dims.xyz), 0);
            let extinction = min(density * params.densest, rate);
            if draw(numbers) * rate >= extinction {
                continue;
            }
            let scatters = albedo(at, density);
            if params.deposit == DEPOSIT_TRACK {
                light = (*photon).weight;
            } else if params.deposit == DEPOSIT_COLLISION {
                light = (*photon).weight / extinction;
            } else if draw(numbers) >= scatters {
                light = (*photon).weight / (extinction * (1.0 - scatters));
                (*photon).over = true;
            }
            if params.deposit != DEPOSIT_ABSORPTION {
                (*photon).weight *= scatters;
            }
        }
        if leaves && light > 0.0 {
            let origin = select(at, on.origin, params.deposit == DEPOSIT_TRACK);
            (*events)[count] = Event(origin, on.t, light, (*photon).way, (*photon).depth);
            count += 1u;
        }
        if (*photon).weight < PHOTON_WEAK && !(*photon).over {
            (*photon).over = draw(numbers) * PHOTON_WEAK >= (*photon).weight;
            (*photon).weight = PHOTON_WEAK;
        }
        if (*photon).over {
            break;
        }
        (*photon).depth += 1u;
        if (*photon).depth >= params.end {
            (*photon).over = true;
            if params.end > params.max_depth {
                tally[PHOTON_TRUNCATED] += 1;
            }
            break;
        }
        let c = bend(numbers);
        if params.phase_kind == PHASE_TABLE {
            (*photon).weight *= phase(c) / bend_density(c);
        }
        (*photon).way = around((*photon).way, c, draw(numbers));
        on = walk(at, carried((*photon).way), FAR);
    }
    (*photon).on = on;
    (*photon).turns = turns;
    return count;
}

// On to the next tentative collision, whose rate it gives, within as many turns as are taken at once; else 0.
fn approach(on: ptr<function, Walk>, numbers: ptr<function, Draws>, turns: ptr<function, u32>) -> f32 {
    var rate = step(0.0, on, numbers, turns);
    // Written out, for drivers count turns of loops.
    if WALKED > 1u {
        rate = step(rate, on, numbers, turns);
        rate = step(rate, on, numbers, turns);
        rate = step(rate, on, numbers, turns);
    }
    return rate;
}

// A turn of a walk that has met nothing yet.
fn step(rate: f32, on: ptr<function, Walk>, numbers: ptr<function, Draws>, turns: ptr<function, u32>) -> f32 {
    if rate > 0.0 || (*on).over || *turns >= params.turns {
        return rate;
    }
    *turns += 1u;
    return advance(on, numbers);
}

// The albedo at a place of index space, where there is some density.
fn albedo(at: vec3<f32>, density: f32) -> f32 {
    if has_scattering {
        return sample_scattering(at, vec3<i32>(params.dims.xyz), 0)[params.channel] / density * params.albedo;
    }
    return params.albedo;
}

// Leaves the light of a flight of a photon of that number.
fn deposit(source: PhotonDirection, name: u32, event: Event) {
    tally[PHOTON_DEPOSITS] += 1;
    let cells = vec3<i32>(params.cells.xyz);
    let ratio = vec3<f32>(cells) / vec3<f32>(params.dims.xyz);
    let origin = (event.origin + 0.5) * ratio;
    let light = event.light * source.toward.w / params.volume * params.scale;
    // Toward where the light comes from.
    var moments: array<f32, HARMONICS_MAX>;
    harmonics(-event.way, params.bands, &moments);
    var cargo = Cargo(moments, draws(name, event.depth, params.seed, 0u), source.weights, source.count);
    var received = false;
    if params.deposit == DEPOSIT_TRACK {
        received = along(&cargo, cells, origin, carried(event.way) * ratio, event.length, light);
    } else {
        received = spread(&cargo, cells, origin, light);
    }
    if !received {
        tally[PHOTON_LOST] += 1;
    }
}

// Leaves light along a flight of so many metres, whose places are in cells. Whether any cell has a row.
fn along(
    cargo: ptr<function, Cargo>,
    cells: vec3<i32>,
    origin: vec3<f32>,
    direction: vec3<f32>,
    length: f32,
    light: f32,
) -> bool {
    var cell = vec3<i32>(clamp(floor(origin), vec3<f32>(0.0), vec3<f32>(cells - 1)));
    var t = 0.0;
    var received = false;
    let onward = vec3<i32>(select(vec3<i32>(0), vec3<i32>(1), direction > vec3<f32>(0.0)));
    for (var turns = 0; turns < cells.x + cells.y + cells.z + 3; turns++) {
        let leave = (vec3<f32>(cell + onward) - origin) / direction;
        var axis = 2u;
        if leave.x <= leave.y && leave.x <= leave.z {
            axis = 0u;
        } else if leave.y <= leave.z {
            axis = 1u;
        }
        let exit = min(leave[axis], length);
        if exit > t {
            if land(cargo, u32((cell.z * cells.y + cell.y) * cells.x + cell.x), light * (exit - t)) {
                received = true;
            }
            t = exit;
        }
        let beyond = cell[axis] + 2 * onward[axis] - 1;
        cell[axis] = beyond;
        if exit >= length || beyond < 0 || beyond >= cells[axis] {
            break;
        }
    }
    return received;
}

// Leaves light on the cells around a place in cells. Whether any has a row.
fn spread(cargo: ptr<function, Cargo>, cells: vec3<i32>, place: vec3<f32>, light: f32) -> bool {
    let reach = i32(ceil(params.radius));
    let side = 2 * reach + 1;
    let first = vec3<i32>(floor(place)) - reach;
    var sum = 0.0;
    for (var i = 0; i < side * side * side; i++) {
        sum += share(cells, first + vec3<i32>(i % side, i / side % side, i / (side * side)), place);
    }
    if sum <= 0.0 {
        return false;
    }
    for (var i = 0; i < side * side * side; i++) {
        let cell = first + vec3<i32>(i % side, i / side % side, i / (side * side));
        let part = share(cells, cell, place);
        if part > 0.0 {
            land(cargo, u32((cell.z * cells.y + cell.y) * cells.x + cell.x), light * (part / sum));
        }
    }
    return true;
}

// The part of a cell in what is left around a place in cells, but for a factor; 0 where it has no row.
fn share(cells: vec3<i32>, cell: vec3<i32>, place: vec3<f32>) -> f32 {
    if any(cell < vec3<i32>(0)) || any(cell >= cells) {
        return 0.0;
    }
    if read_rows(u32((cell.z * cells.y + cell.y) * cells.x + cell.x)) == 0u {
        return 0.0;
    }
    let way = vec3<f32>(cell) + 0.5 - place;
    let base = max(params.radius * params.radius - dot(way, way), 0.0);
    return base * base * base;
}

// Adds light to the moments of a cell. Whether it has a row.
fn land(cargo: ptr<function, Cargo>, cell: u32, light: f32) -> bool {
    let row = read_rows(cell);
    if row == 0u || row > params.rows {
        return false;
    }
    var rounding = (*cargo).rounding;
    rounding.next = cell;
    let up = draw(&rounding);
    let count = params.bands * params.bands;
    for (var i = 0u; i < (*cargo).count; i++) {
        let weight = read_weights((*cargo).weights + i);
        let light_number = u32(weight.x);
        if light_number < params.lights {
            let at = ((row - 1u) * params.lights + light_number) * count;
            let value = light * weight.y;
            // Some moments a turn: squares leave none or one over fours.
            for (var j = 0u; j < count; j += PHOTON_STRIDE) {
                add(at + j, floor(value * (*cargo).moments[j] + up));
                if j + 1u < count {
                    add(at + j + 1u, floor(value * (*cargo).moments[j + 1u] + up));
                    add(at + j + 2u, floor(value * (*cargo).moments[j + 2u] + up));
                    add(at + j + 3u, floor(value * (*cargo).moments[j + 3u] + up));
                }
            }
        }
    }
    return true;
}

// Adds to an integer, and counts what it does not hold.
fn add(place: u32, value: f32) {
    var held = false;
    // What is not a number is not held either.
    if abs(value) < 2147483648.0 {
        let more = i32(value);
        var before = 0;
        if more != 0 {
            before = atomicAdd(&deposits[place], more);
        }
        let after = before + more;
        held = ((before ^ after) & (more ^ after)) >= 0;
    }
    if !held {
        tally[PHOTON_OVERFLOWS] += 1;
    }
}
