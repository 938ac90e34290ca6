// `project`: records of directional light at the cells of a coarse grid. One workgroup CELLS cells, which follow each other in an order:
// the PARTS invocations of each first march along a batch of directions, then each sums its own values of the record over the
// batch, in the order of the directions.

const PARTS: u32 = LANES / CELLS;
// Values of a record and of the emission's moments that one invocation may have to sum.
const SLOTS: u32 = (6u * HARMONICS_MAX + PARTS - 1u) / PARTS;

var<workgroup> transmittances: array<vec3<f32>, LANES>;
var<workgroup> glows: array<vec3<f32>, LANES>;

fn phase_value(i: u32) -> f32 {
    return read_phase_table(i);
}

fn phase_size() -> u32 {
    return length_phase_table();
}

@compute @workgroup_size(LANES)
fn project(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let begin = number(id) * CELLS;
    if begin >= launch.count {
        return;
    }
    let part = lane / CELLS;
    let n = begin + lane % CELLS;
    let last = launch.count - 1u;
    let cell = taken(min(n, last));
    let place = cell - launch.first;
    let channels = max(params.channels, params.weight_channels);
    let values = params.coefficients * channels;
    let glow_values = params.emission_coefficients * 3u;
    let used = (values + glow_values + PARTS - 1u) / PARTS;
    var sums: array<f32, SLOTS>;
    if params.direction_begin > 0u {
        // The sums of the passes before.
        for (var slot = 0u; slot < SLOTS; slot++) {
            if slot >= used {
                break;
            }
            let v = slot * PARTS + part;
            if v < values {
                sums[slot] = records[place * values + v];
            } else if v < values + glow_values {
                sums[slot] = emission_records[place * glow_values + v - values];
            }
        }
    }
    var occupied = true;
    var any = true;
    if has_occupancy {
        occupied = read_occupancy(place).y > 0.0;
        any = false;
        for (var i = 0u; i < CELLS; i++) {
            any = any || read_occupancy(taken(min(begin + i, last)) - launch.first).y > 0.0;
        }
    }
    if any {
        let x = cell % params.cells.x;
        let y = cell / params.cells.x % params.cells.y;
        let z = cell / params.cells.x / params.cells.y;
        let side = params.cell.xyz;
        let origin = vec3<f32>(vec3<u32>(x, y, z)) * side + (0.5 * side - 0.5);
        for (var first = params.direction_begin; first < params.direction_end; first += PARTS) {
            let batch = min(PARTS, params.direction_end - first);
            if occupied && part < batch {
                gather(origin, read_directions(first + part).xyz, lane);
            }
            workgroupBarrier();
            for (var slot = 0u; slot < SLOTS; slot++) {
                if slot >= used {
                    break;
                }
                let v = slot * PARTS + part;
                if occupied && v < values {
                    sums[slot] = sum_record(sums[slot], v, channels, first, batch, lane % CELLS);
                } else if occupied && v < values + glow_values {
                    sums[slot] = sum_glow(sums[slot], v - values, first, batch, lane % CELLS);
                }
            }
            workgroupBarrier();
        }
    }
    if n > last {
        return;
    }
    for (var slot = 0u; slot < SLOTS; slot++) {
        if slot >= used {
            break;
        }
        let v = slot * PARTS + part;
        if v < values {
            records[place * values + v] = sums[slot];
        } else if v < values + glow_values {
            emission_records[place * glow_values + v - values] = sums[slot];
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

// Marches along a direction, and keeps what comes of it in the workgroup's memory.
fn gather(origin: vec3<f32>, direction: vec3<f32>, lane: u32) {
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
    transmittances[lane] = transmittance;
    glows[lane] = glow;
}

// Extinction of the three channels; where one channel serves, the first counts.
fn extinction() -> vec3<f32> {
    return select(params.extinction.xxx, params.extinction.xyz, params.channels == 3u);
}

// Value `v` of the record of one of the cells: its sum so far, and the directions of the batch.
fn sum_record(sum: f32, v: u32, channels: u32, first: u32, batch: u32, cell: u32) -> f32 {
    let k = v / channels;
    let c = v % channels;
    let stride = params.coefficients * params.weight_channels;
    let at = k * params.weight_channels + select(0u, c, params.weight_channels == 3u);
    let channel = select(0u, c, params.channels == 3u);
    var total = sum;
    for (var i = 0u; i < batch; i++) {
        total += transmittances[i * CELLS + cell][channel] * read_weights((first + i) * stride + at);
    }
    return total;
}

// Value `v` of the emission's moments of one of the cells: its sum so far, and the directions of the batch.
fn sum_glow(sum: f32, v: u32, first: u32, batch: u32, cell: u32) -> f32 {
    let k = v / 3u;
    let c = v % 3u;
    var total = sum;
    for (var i = 0u; i < batch; i++) {
        total += glows[i * CELLS + cell][c] * read_emission_weights((first + i) * params.emission_coefficients + k);
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
