// `project`: records of directional light at the cells of a coarse grid. Where a packet of invocations is eight cells each takes a
// cell alone. Elsewhere one workgroup a cell: its invocations first march along a batch of directions, then each sums its own values
// of the record over the batch. Both in the order of the directions.

// Values of a record and of the emission's moments that one invocation of a workgroup may have to sum.
const SLOTS: u32 = (6u * HARMONICS_MAX + LANES - 1u) / LANES;
// Values of a record that an invocation of a cell alone sums at a time: three texels of weights, or one that serves three channels.
const SUMMED: u32 = 12u;

// What comes along a direction: transmittance, and light that the medium sends.
struct Gathered {
    transmittance: vec3<f32>,
    glow: vec3<f32>,
}

var<workgroup> transmittances: array<vec3<f32>, AHEAD * INVOCATIONS>;
var<workgroup> glows: array<vec3<f32>, AHEAD * INVOCATIONS>;

fn phase_value(i: u32) -> f32 {
    return read_phase_table(i);
}

fn phase_size() -> u32 {
    return length_phase_table();
}

@compute @workgroup_size(INVOCATIONS)
fn project(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    if AHEAD > 1u {
        if n * INVOCATIONS + lane < launch.count {
            alone(taken(n * INVOCATIONS + lane), lane);
        }
    } else if n < launch.count {
        together(launch.start + n, lane);
    }
}

// A cell by the invocations of a workgroup.
fn together(cell: u32, lane: u32) {
    let place = cell - launch.first;
    let channels = max(params.channels, params.weight_channels);
    let values = params.coefficients * channels;
    let glow_values = params.emission_coefficients * 3u;
    let used = (values + glow_values + LANES - 1u) / LANES;
    var sums: array<f32, SLOTS>;
    if params.direction_begin > 0u {
        // The sums of the passes before.
        for (var slot = 0u; slot < SLOTS; slot++) {
            if slot >= used {
                break;
            }
            let v = slot * LANES + lane;
            if v < values {
                sums[slot] = records[place * values + v];
            } else if v < values + glow_values {
                sums[slot] = emission_records[place * glow_values + v - values];
            }
        }
    }
    if !has_occupancy || read_occupancy(place).y > 0.0 {
        let origin = middle_of(cell);
        for (var first = params.direction_begin; first < params.direction_end; first += LANES) {
            let batch = min(LANES, params.direction_end - first);
            if lane < batch {
                let seen = gather(origin, read_directions(first + lane).xyz);
                transmittances[lane] = seen.transmittance;
                glows[lane] = seen.glow;
            }
            workgroupBarrier();
            for (var slot = 0u; slot < SLOTS; slot++) {
                if slot >= used {
                    break;
                }
                let v = slot * LANES + lane;
                if v < values {
                    sums[slot] = sum_record(sums[slot], v, channels, first, batch);
                } else if v < values + glow_values {
                    sums[slot] = sum_glow(sums[slot], v - values, first, batch);
                }
            }
            workgroupBarrier();
        }
    }
    for (var slot = 0u; slot < SLOTS; slot++) {
        if slot >= used {
            break;
        }
        let v = slot * LANES + lane;
        if v < values {
            records[place * values + v] = sums[slot];
        } else if v < values + glow_values {
            emission_records[place * glow_values + v - values] = sums[slot];
        }
    }
}

// A cell by one invocation. What it sums stays in memory from batch to batch.
fn alone(cell: u32, lane: u32) {
    let place = cell - launch.first;
    let values = params.coefficients * max(params.channels, params.weight_channels);
    let glow_values = params.emission_coefficients * 3u;
    if params.direction_begin == 0u {
        for (var v = 0u; v < values; v++) {
            records[place * values + v] = 0.0;
        }
        for (var v = 0u; v < glow_values; v++) {
            emission_records[place * glow_values + v] = 0.0;
        }
    }
    if has_occupancy && !(read_occupancy(place).y > 0.0) {
        return;
    }
    let origin = middle_of(cell);
    for (var first = params.direction_begin; first < params.direction_end; first += AHEAD) {
        let batch = min(AHEAD, params.direction_end - first);
        for (var i = 0u; i < batch; i++) {
            let seen = gather(origin, read_directions(first + i).xyz);
            transmittances[i * INVOCATIONS + lane] = seen.transmittance;
            glows[i * INVOCATIONS + lane] = seen.glow;
        }
        for (var v = 0u; v < values; v += SUMMED) {
            sum_records(place * values, values, v, first, batch, lane);
        }
        for (var v = 0u; v < glow_values; v += SUMMED) {
            sum_glows(place * glow_values, glow_values, v, first, batch, lane);
        }
    }
}

// The cell of unit `n` of the dispatch.
fn taken(n: u32) -> u32 {
    if has_order {
        return read_order(n);
    }
    return launch.start + n;
}

// The centre of a cell in index space.
fn middle_of(cell: u32) -> vec3<f32> {
    let x = cell % params.cells.x;
    let y = cell / params.cells.x % params.cells.y;
    let z = cell / params.cells.x / params.cells.y;
    let side = params.cell.xyz;
    return vec3<f32>(vec3<u32>(x, y, z)) * side + (0.5 * side - 0.5);
}

// Marches along a direction.
fn gather(origin: vec3<f32>, direction: vec3<f32>) -> Gathered {
    let rows = array<vec3<f32>, 3>(params.index_x.xyz, params.index_y.xyz, params.index_z.xyz);
    let index = vec3<f32>(dot(rows[0], direction), dot(rows[1], direction), dot(rows[2], direction));
    let ray = through(origin, index, vec3<f32>(params.dims.xyz), FAR, params.cell.w);
    var transmittance: vec3<f32>;
    var glow = vec3<f32>(0.0);
    if params.emission_coefficients > 0u {
        transmittance = emission_along(ray, &glow);
    } else {
        transmittance = exp(-column(ray, vec4<u32>(0u)) * extinction());
    }
    if params.toward_eye == 1u {
        let p = phase(dot(direction, view_direction(origin)));
        transmittance *= p;
        glow *= p;
    }
    return Gathered(transmittance, glow);
}

// Extinction of the three channels; where one channel serves, the first counts.
fn extinction() -> vec3<f32> {
    return select(params.extinction.xxx, params.extinction.xyz, params.channels == 3u);
}

// Value `v` of the record: its sum so far, and the directions of the batch.
fn sum_record(sum: f32, v: u32, channels: u32, first: u32, batch: u32) -> f32 {
    let k = v / channels;
    let c = v % channels;
    let stride = params.coefficients * params.weight_channels;
    let at = k * params.weight_channels + select(0u, c, params.weight_channels == 3u);
    let channel = select(0u, c, params.channels == 3u);
    var total = sum;
    for (var i = 0u; i < batch; i++) {
        total += transmittances[i][channel] * read_weights((first + i) * stride + at);
    }
    return total;
}

// Value `v` of the emission's moments: its sum so far, and the directions of the batch.
fn sum_glow(sum: f32, v: u32, first: u32, batch: u32) -> f32 {
    let k = v / 3u;
    let c = v % 3u;
    var total = sum;
    for (var i = 0u; i < batch; i++) {
        total += glows[i][c] * read_emission_weights((first + i) * params.emission_coefficients + k);
    }
    return total;
}

// Adds the directions of a batch to the values of the record from `v` on, which begins at `begin`.
fn sum_records(begin: u32, values: u32, v: u32, first: u32, batch: u32, lane: u32) {
    let stride = params.coefficients * params.weight_channels;
    // One channel of weights serves three of transmittance.
    let serves = params.channels > params.weight_channels;
    let offset = select(v, v / 3u, serves);
    let end = begin + values;
    let place = begin + v;
    var sums = mat3x4<f32>(held_records(place, end), held_records(place + 4u, end), held_records(place + 8u, end));
    for (var i = 0u; i < batch; i++) {
        let at = (first + i) * stride + offset;
        let off = select(at % 4u, 0u, stride % 4u == 0u && !serves);
        let a = read_four_weights(at / 4u);
        let b = read_four_weights(at / 4u + 1u);
        let near = from_two(a, b, off);
        var weights = spread(near);
        if !serves {
            let c = read_four_weights(at / 4u + 2u);
            let d = read_four_weights(at / 4u + 3u);
            weights = mat3x4<f32>(near, from_two(b, c, off), from_two(c, d, off));
        }
        sums += products(weights, transmittances[i * INVOCATIONS + lane]);
    }
    keep_records(place, end, sums[0]);
    keep_records(place + 4u, end, sums[1]);
    keep_records(place + 8u, end, sums[2]);
}

// Adds the directions of a batch to the values of the emission's moments from `v` on, which begin at `begin`.
fn sum_glows(begin: u32, values: u32, v: u32, first: u32, batch: u32, lane: u32) {
    let end = begin + values;
    let place = begin + v;
    var sums = mat3x4<f32>(held_emission_records(place, end), held_emission_records(place + 4u, end), held_emission_records(place + 8u, end));
    for (var i = 0u; i < batch; i++) {
        let at = (first + i) * params.emission_coefficients + v / 3u;
        let near = from_two(read_four_emission_weights(at / 4u), read_four_emission_weights(at / 4u + 1u), at % 4u);
        sums += products(spread(near), glows[i * INVOCATIONS + lane]);
    }
    keep_emission_records(place, end, sums[0]);
    keep_emission_records(place + 4u, end, sums[1]);
    keep_emission_records(place + 8u, end, sums[2]);
}

// Four values from a place on, of those before an end.
fn held_records(place: u32, end: u32) -> vec4<f32> {
    let at = min(place + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(end - 1u));
    return vec4<f32>(records[at.x], records[at.y], records[at.z], records[at.w]);
}

// Writes those before the end.
fn keep_records(place: u32, end: u32, four: vec4<f32>) {
    if place < end {
        records[place] = four.x;
    }
    if place + 1u < end {
        records[place + 1u] = four.y;
    }
    if place + 2u < end {
        records[place + 2u] = four.z;
    }
    if place + 3u < end {
        records[place + 3u] = four.w;
    }
}

// Four values from a place on, of those before an end.
fn held_emission_records(place: u32, end: u32) -> vec4<f32> {
    let at = min(place + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(end - 1u));
    return vec4<f32>(emission_records[at.x], emission_records[at.y], emission_records[at.z], emission_records[at.w]);
}

// Writes those before the end.
fn keep_emission_records(place: u32, end: u32, four: vec4<f32>) {
    if place < end {
        emission_records[place] = four.x;
    }
    if place + 1u < end {
        emission_records[place + 1u] = four.y;
    }
    if place + 2u < end {
        emission_records[place + 2u] = four.z;
    }
    if place + 3u < end {
        emission_records[place + 3u] = four.w;
    }
}

// Four weights, each for three values that follow each other.
fn spread(w: vec4<f32>) -> mat3x4<f32> {
    return mat3x4<f32>(w.xxxy, w.yyzz, w.zwww);
}

// Twelve values of which each has its weight, and is of each channel in turn.
fn products(weights: mat3x4<f32>, rgb: vec3<f32>) -> mat3x4<f32> {
    return mat3x4<f32>(weights[0] * rgb.xyzx, weights[1] * rgb.yzxy, weights[2] * rgb.zxyz);
}

// Unit direction in the world from the eye to a point of index space.
fn view_direction(at: vec3<f32>) -> vec3<f32> {
    let v = at - params.eye.xyz;
    let w = vec3<f32>(dot(params.world_x.xyz, v), dot(params.world_y.xyz, v), dot(params.world_z.xyz, v));
    // A cell at the eye has no direction; any will do.
    return w / max(length(w), 1.2e-38);
}

// Radiance that the medium sends along the ray to its origin, and the ray's transmittance.
fn emission_along(ray: Ray, glow: ptr<function, vec3<f32>>) -> vec3<f32> {
    let size = vec3<i32>(params.dims.xyz);
    let sigma = extinction();
    var transmittance = vec3<f32>(1.0);
    for (var k = 0.0; k < ray.steps; k += 1.0) {
        let at = along(ray, middle(ray, k));
        let density = sample_density(at, size, 0);
        var source = vec3<f32>(density);
        if has_emission_color {
            source = sample_emission_color(at, size, 0).xyz;
        } else if has_emission_density {
            source = vec3<f32>(sample_emission_density(at, size, 0));
        }
        let tau = density * ray.step * sigma;
        let x = segment(tau.x);
        let y = segment(tau.y);
        let z = segment(tau.z);
        *glow += transmittance * ray.step * vec3<f32>(x.y, y.y, z.y) * (source * params.emission.xyz);
        transmittance *= vec3<f32>(x.x, y.x, z.x);
    }
    return transmittance;
}
