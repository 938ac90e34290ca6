// `project`: records of directional light at the cells of a coarse grid. Where a packet of invocations is eight cells each takes a
// cell alone. Elsewhere one workgroup a cell: its invocations first march along a batch of directions, then each sums its own values
// of the record over the batch. Both in the order of the directions.

// Values of a record and of the emission's moments that one invocation of a workgroup may have to sum.
const SLOTS: u32 = (6u * HARMONICS_MAX + LANES - 1u) / LANES;

// What comes along a direction: transmittance, and light that the medium sends.
struct Gathered {
    transmittance: vec3<f32>,
    glow: vec3<f32>,
}

var<workgroup> transmittances: array<vec3<f32>, SHARED>;
var<workgroup> glows: array<vec3<f32>, SHARED>;

fn phase_value(i: u32) -> f32 {
    return read_phase_table(i);
}

fn phase_size() -> u32 {
    return length_phase_table();
}

@compute @workgroup_size(INVOCATIONS)
fn project(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    if ALONE {
        if n * INVOCATIONS + lane < launch.count {
            alone(taken(n * INVOCATIONS + lane), id.x >> 31u);
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

// A cell by one invocation. `none` is zero, which drivers cannot tell: loops over sums stay loops, which are built in less time.
fn alone(cell: u32, none: u32) {
    let place = cell - launch.first;
    let values = params.coefficients * max(params.channels, params.weight_channels);
    let glow_values = params.emission_coefficients * 3u;
    var record = RecordSums();
    var glow = GlowSums();
    if !has_occupancy || read_occupancy(place).y > 0.0 {
        if params.direction_begin > 0u {
            // The sums of the passes before.
            for (var n = none; n < RECORD_FOURS; n++) {
                turned_records(&record, held_records(place * values, values, 4u * n));
            }
            for (var n = none; n < GLOW_FOURS; n++) {
                turned_glows(&glow, held_glows(place * glow_values, glow_values, 4u * n));
            }
        }
        let stride = params.coefficients * params.weight_channels;
        let origin = middle_of(cell);
        for (var i = params.direction_begin; i < params.direction_end; i++) {
            let seen = gather(origin, read_directions(i).xyz);
            let at = i * stride;
            // Rows that begin with a texel all do.
            sum_records(&record, at / 4u, select(at % 4u, 0u, stride % 4u == 0u), seen.transmittance);
            if has_emission_weights {
                let glow_at = i * params.emission_coefficients;
                sum_glows(&glow, glow_at / 4u, glow_at % 4u, seen.glow);
            }
        }
    }
    for (var n = none; n < RECORD_FOURS; n++) {
        keep_records(place * values, values, 4u * n, turned_records(&record, vec4<f32>()));
    }
    for (var n = none; n < GLOW_FOURS; n++) {
        keep_glows(place * glow_values, glow_values, 4u * n, turned_glows(&glow, vec4<f32>()));
    }
}

// Four values of a record of so many, which begins at `begin`, from its value `v` on; past its end others, which nothing keeps.
fn held_records(begin: u32, values: u32, v: u32) -> vec4<f32> {
    let at = begin + min(v + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(values - 1u));
    return vec4<f32>(records[at.x], records[at.y], records[at.z], records[at.w]);
}

// Writes those of the record.
fn keep_records(begin: u32, values: u32, v: u32, four: vec4<f32>) {
    let at = begin + v;
    if v < values {
        records[at] = four.x;
    }
    if v + 1u < values {
        records[at + 1u] = four.y;
    }
    if v + 2u < values {
        records[at + 2u] = four.z;
    }
    if v + 3u < values {
        records[at + 3u] = four.w;
    }
}

// Four values of the emission's moments, as those of a record.
fn held_glows(begin: u32, values: u32, v: u32) -> vec4<f32> {
    let at = begin + min(v + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(values - 1u));
    return vec4<f32>(emission_records[at.x], emission_records[at.y], emission_records[at.z], emission_records[at.w]);
}

// Writes those of the moments.
fn keep_glows(begin: u32, values: u32, v: u32, four: vec4<f32>) {
    let at = begin + v;
    if v < values {
        emission_records[at] = four.x;
    }
    if v + 1u < values {
        emission_records[at + 1u] = four.y;
    }
    if v + 2u < values {
        emission_records[at + 2u] = four.z;
    }
    if v + 3u < values {
        emission_records[at + 3u] = four.w;
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
