// `march`: view rays through the medium. One workgroup a block of BLOCK×BLOCK pixels.

fn phase_value(i: u32) -> f32 {
    return read_tables(params.phase_at + i);
}

fn phase_size() -> u32 {
    return params.phase_size;
}

fn harmonics_value(i: u32) -> f32 {
    return read_tables(params.harmonics_at + i);
}

// One view ray.
struct Path {
    direction: vec3<f32>,
    ray: Ray,
    radiance: vec3<f32>,
    transmittance: vec3<f32>,
    // Light stopped so far, and the same weighed with the number of its step.
    stopped: f32,
    stopped_in: f32,
}

@compute @workgroup_size(BLOCK, BLOCK)
fn march(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_id) lane: vec3<u32>) {
    let n = number(id);
    if n >= launch.count {
        return;
    }
    let block = launch.start + n;
    let across = (params.width + BLOCK - 1u) / BLOCK;
    // Packets of eight invocations that follow each other take two rows of four pixels, whose rays lie closer than those of a row.
    const HALF: u32 = BLOCK / 2u;
    let x = block % across * BLOCK + lane.y % 2u * HALF + lane.x % HALF;
    let y = block / across * BLOCK + lane.y / 2u * 2u + lane.x / HALF;
    if x >= params.width || y >= params.height {
        return;
    }
    // The film and the surfaces are bound from a row of blocks on.
    let pixel = (y - launch.first * BLOCK) * params.width + x;
    if params.alone == ALONE_RIMS && !rim(x, y) {
        film[2u * pixel] = vec4<f32>(0.0, 0.0, 0.0, UNMARCHED);
        film[2u * pixel + 1u] = vec4<f32>(1.0, 1.0, 1.0, launch.infinity);
        return;
    }
    // The same pixel of the full picture.
    let fx = min(x * params.scale + params.scale / 2u, params.full_width - 1u);
    let fy = min(y * params.scale + params.scale / 2u, params.full_height - 1u);
    // Near rims all surfaces are bound.
    let above = select(launch.first * BLOCK * params.scale, 0u, params.alone == ALONE_RIMS);
    let full = (fy - above) * params.full_width + fx;
    var color = vec3<f32>(0.0);
    var transmitted = vec3<f32>(0.0);
    var stopped = 0.0;
    var stopped_at = 0.0;
    if params.sample_begin > 0u {
        // The sums of the passes before.
        let sums = film[2u * pixel];
        let more = film[2u * pixel + 1u];
        color = sums.xyz;
        stopped = sums.w;
        transmitted = more.xyz;
        stopped_at = more.w;
    }
    let ends = params.step_end == ALL_STEPS;
    for (var s = params.sample_begin; s < params.sample_end; s++) {
        let a = (f32(fx) + read_tables(2u * s)) * (2.0 / f32(params.full_width)) - 1.0;
        let b = 1.0 - (f32(fy) + read_tables(2u * s + 1u)) * (2.0 / f32(params.full_height));
        let toward = a * params.right.xyz + b * params.up.xyz + params.forward.xyz;
        let direction = toward / length(toward);
        var seen = vec4<f32>(0.0, 0.0, 0.0, FAR);
        if has_surface {
            seen = read_surface(full * params.surface_samples + s % params.surface_samples);
        }
        let limit = min(seen.w, FAR);
        var path = enter(direction, limit, jitter(x, y, s));
        if has_paths && params.step_begin > 0u {
            resume(&path, pixel);
        }
        walk(&path);
        if has_paths && !ends {
            keep(path, pixel);
            return;
        }
        var behind = vec3<f32>(0.0);
        if params.alone != ALONE_NO {
            behind = vec3<f32>(0.0);
        } else if limit < FAR {
            behind = seen.xyz;
        } else if has_environment {
            behind = sky(direction);
        }
        color += path.radiance + path.transmittance * behind;
        transmitted += path.transmittance;
        stopped += path.stopped;
        stopped_at += path.stopped * middle(path.ray, 0.0) + path.stopped_in * path.ray.step;
    }
    if params.sample_end < params.samples {
        film[2u * pixel] = vec4<f32>(color, stopped);
        film[2u * pixel + 1u] = vec4<f32>(transmitted, stopped_at);
        return;
    }
    let scale = 1.0 / f32(params.samples);
    var depth = launch.infinity;
    if stopped > 0.0 {
        depth = stopped_at / stopped;
    }
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    var last = (3.0 * f32(params.samples) - (transmitted.x + transmitted.y + transmitted.z)) * (scale / 3.0);
    if params.alone != ALONE_NO {
        last = FAR;
        if has_surface {
            last = min(read_surface(full * params.surface_samples).w, FAR);
        }
    }
    film[2u * pixel] = vec4<f32>(color * scale, last);
    film[2u * pixel + 1u] = vec4<f32>(transmitted * scale, depth);
}

// Whether a rim is near a pixel: of the surfaces of five by five pixels around, the nearest and the farthest.
fn rim(x: u32, y: u32) -> bool {
    var nearest = FAR;
    var farthest = 0.0;
    for (var i = 0u; i < 25u; i++) {
        let column = min(max(x + i % 5u, 2u) - 2u, params.width - 1u);
        let row = min(max(y + i / 5u, 2u) - 2u, params.height - 1u);
        let fx = min(column * params.scale + params.scale / 2u, params.full_width - 1u);
        let fy = min(row * params.scale + params.scale / 2u, params.full_height - 1u);
        var distance = FAR;
        if has_surface {
            distance = min(read_surface(fy * params.full_width + fx).w, FAR);
        }
        nearest = min(nearest, distance);
        farthest = max(farthest, distance);
    }
    return nearest < MARCH_RIM * farthest;
}

// Where the samples of a sub-pixel position of a pixel lie within their steps.
fn jitter(x: u32, y: u32, s: u32) -> f32 {
    if params.jittered == 0u {
        return 0.5;
    }
    let at = params.jitter_at + params.samples + y % JITTER_SIDE * JITTER_SIDE + x % JITTER_SIDE;
    let place = read_tables(at) + read_tables(params.jitter_at + s) + params.jitter_offset;
    return place - floor(place);
}

// The path along `direction` before its first step.
fn enter(direction: vec3<f32>, limit: f32, place: f32) -> Path {
    var ray = through(params.eye.xyz, to_index(direction), vec3<f32>(params.dims.xyz), limit, params.step);
    if params.steps > 0u {
        ray = in_steps(ray, f32(params.steps));
    }
    ray.place = place;
    return Path(direction, ray, vec3<f32>(0.0), vec3<f32>(1.0), 0.0, 0.0);
}

// The path as an earlier pass left it.
fn resume(path: ptr<function, Path>, pixel: u32) {
    let light = paths[2u * pixel];
    let through = paths[2u * pixel + 1u];
    (*path).radiance = light.xyz;
    (*path).stopped = light.w;
    (*path).transmittance = through.xyz;
    (*path).stopped_in = through.w;
}

// Leaves the path to the next pass.
fn keep(path: Path, pixel: u32) {
    paths[2u * pixel] = vec4<f32>(path.radiance, path.stopped);
    paths[2u * pixel + 1u] = vec4<f32>(path.transmittance, path.stopped_in);
}

// The steps of this pass.
fn walk(path: ptr<function, Path>) {
    let size = vec3<i32>(params.dims.xyz);
    let direction = (*path).direction;
    let ray = (*path).ray;
    // Y_k of the direction, where the in-scatter has layers.
    var basis: array<f32, HARMONICS_MAX>;
    if max(params.cells.w, params.scattered_cells.w) > 1u {
        harmonics(direction, params.bands, &basis);
    }
    let scatters = params.albedo.x + params.albedo.y + params.albedo.z > 0.0;
    let way = samples(ray, blocks());
    let last = min(ray.steps, f32(params.step_end));
    var k = f32(params.step_begin);
    var radiance = (*path).radiance;
    var transmittance = (*path).transmittance;
    var stopped = (*path).stopped;
    var stopped_in = (*path).stopped_in;
    // One condition, and no other way out: software drivers keep a mask for each.
    while (k < last) & !(max(max(transmittance.x, transmittance.y), transmittance.z) < params.cut) {
        let at = sampled(way, k);
        if has_occupancy {
            let next = skip(way, at, k);
            if next >= 0.0 {
                k = next;
                continue;
            }
        }
        let here = optics(at, size);
        var light = vec3<f32>(0.0);
        if scatters && max(max(here.scattering.x, here.scattering.y), here.scattering.z) > 0.0 {
            light = gathered(at, &basis) + scattered_light(at, &basis) + direct(at, direction, middle(ray, k));
        }
        let tau = here.extinction * ray.step;
        let red = segment(tau.x);
        var green = red;
        var blue = red;
        if !grey_extinction {
            green = segment(tau.y);
            blue = segment(tau.z);
        }
        let pieces = vec3<f32>(red.y, green.y, blue.y);
        let sent = here.scattering * light + here.emission;
        let shares = transmittance * (tau * pieces);
        let share = shares.x + shares.y + shares.z;
        radiance += transmittance * ray.step * pieces * sent;
        transmittance *= vec3<f32>(red.x, green.x, blue.x);
        stopped += share;
        stopped_in += share * k;
        k += 1.0;
    }
    (*path).radiance = radiance;
    (*path).transmittance = transmittance;
    (*path).stopped = stopped;
    (*path).stopped_in = stopped_in;
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
fn blocks() -> vec4<u32> {
    if has_occupancy {
        return params.occupancy_cells;
    }
    return vec4<u32>(0u);
}

// J from the field of in-scattered radiance.
fn gathered(at: vec3<f32>, basis: ptr<function, array<f32, HARMONICS_MAX>>) -> vec3<f32> {
    if !has_in_scatter {
        return vec3<f32>(0.0);
    }
    let place = (at + 0.5) * params.cells_per_voxel.xyz - 0.5;
    if params.cells.w == 1u {
        return in_scatter_at(place, 0u);
    }
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < params.cells.w; k++) {
        sum += (*basis)[k] * in_scatter_at(place, k);
    }
    return sum;
}

fn in_scatter_at(place: vec3<f32>, layer: u32) -> vec3<f32> {
    let size = vec3<i32>(params.cells.xyz);
    if params.trilinear == 1u {
        return sample_in_scatter(place, size, i32(layer)).xyz;
    }
    return nearest_in_scatter(place, size, i32(layer)).xyz;
}

// J of light that was scattered before.
fn scattered_light(at: vec3<f32>, basis: ptr<function, array<f32, HARMONICS_MAX>>) -> vec3<f32> {
    if !has_scattered {
        return vec3<f32>(0.0);
    }
    let size = vec3<i32>(params.scattered_cells.xyz);
    let place = (at + 0.5) * params.scattered_cells_per_voxel.xyz - 0.5;
    if params.scattered_cells.w == 1u {
        return sample_scattered(place, size, 0).xyz;
    }
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < params.scattered_cells.w; k++) {
        sum += (*basis)[k] * sample_scattered(place, size, i32(k)).xyz;
    }
    return sum;
}

// J from each light.
fn direct(at: vec3<f32>, direction: vec3<f32>, t: f32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    if !has_lights {
        return sum;
    }
    var away = vec3<f32>(0.0);
    if params.phong.w > 0.0 {
        away = normal(at);
    }
    if layered_light_depth {
        // Layer by layer: drivers that run both sides of conditions would look the field up for each light.
        for (var first = 0u; first < params.lights; first += 4u) {
            let depths = light_depths(at, first / 4u);
            let past = min(first + 4u, params.lights);
            for (var i = first; i < past; i++) {
                sum += from_light(read_lights(i), depths[i % 4u], at, direction, away, t);
            }
        }
        return sum;
    }
    let depths = light_depths(at, 0u);
    for (var i = 0u; i < params.lights; i++) {
        sum += from_light(read_lights(i), depths[i % 4u], at, direction, away, t);
    }
    return sum;
}

// J from a light whose field holds `depth`.
fn from_light(record: LightRecord, depth: f32, at: vec3<f32>, direction: vec3<f32>, away: vec3<f32>, t: f32) -> vec3<f32> {
    let light = incident(record, direction, t);
    if light.falloff <= 0.0 {
        return vec3<f32>(0.0);
    }
    let seen = visibility(record, light, direction, t);
    if seen <= 0.0 {
        return vec3<f32>(0.0);
    }
    var scatters = 0.0;
    if params.phong.w > 0.0 {
        scatters = phong(away, light.toward, direction);
    } else {
        scatters = phase(dot(light.toward, direction));
    }
    let scale = scatters * light.falloff * seen;
    var optical = depth;
    let size = vec3<f32>(params.dims.xyz);
    if params.shadow == SHADOW_MARCH {
        optical = column(through(at, to_index(light.toward), size, light.distance, params.step), blocks());
    } else if params.shadow == SHADOW_MEAN {
        optical *= reach(at, to_index(light.toward), size, light.distance);
    }
    let transmittance = exp(-optical * params.light_extinction.xyz);
    return scale * transmittance * record.power.xyz;
}

// How much of the light passes by the surfaces, `t` metres along the view ray.
fn visibility(record: LightRecord, light: Incident, d: vec3<f32>, t: f32) -> f32 {
    let extent = params.mesh_eye.w;
    let at = params.mesh_eye.xyz + t * d;
    if has_mesh && params.surface_shadow == SURFACE_SHADOW_RAY {
        let free = light.distance - MESH_MARGIN * extent;
        return select(1.0, 0.0, blocked(line(at, light.toward), free, 0u, params.nodes));
    }
    if has_shadow_map && params.surface_shadow == SURFACE_SHADOW_MAP {
        return mapped(record, light, at);
    }
    return 1.0;
}

// The same by the light's map, at a point from the mesh's origin: four comparisons, interpolated.
fn mapped(record: LightRecord, light: Incident, at: vec3<f32>) -> f32 {
    var v = at;
    var n = 0u;
    if record.position.w != 0.0 {
        v = -light.distance * light.toward;
        if record.cone.w == 0.0 {
            n = side_of(v);
        }
    }
    let extent = params.mesh_eye.w;
    let plane = face(record, n, extent);
    var depth = dot(v, plane.forward);
    var place = vec2<f32>(dot(v, plane.right), dot(v, plane.up)) / plane.half_width;
    if record.position.w != 0.0 {
        place /= max(depth, 1e-30);
    } else {
        depth += extent;
        if max(abs(place.x), abs(place.y)) > 1.0 {
            return 1.0;
        }
    }
    let last = f32(params.map_side) - 1.0;
    let p = clamp((place * 0.5 + 0.5) * f32(params.map_side) - 0.5, vec2<f32>(0.0), vec2<f32>(last));
    let low = vec2<u32>(p);
    let f = p - vec2<f32>(low);
    let first = (u32(record.power.w) + n) * params.map_side;
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let high = vec2<u32>(k & 1u, k >> 1u);
        let weights = select(1.0 - f, f, high == vec2<u32>(1u));
        let texel = min(low + high, vec2<u32>(params.map_side - 1u));
        let held = read_shadow_map((first + texel.y) * params.map_side + texel.x);
        sum += select(0.0, weights.x * weights.y, depth <= held);
    }
    return sum;
}

// The field toward four lights; zero without one.
fn light_depths(at: vec3<f32>, layer: u32) -> vec4<f32> {
    if !has_light_depth || params.shadow < SHADOW_COLUMN {
        return vec4<f32>(0.0);
    }
    let place = (at + 0.5) * params.light_cells_per_voxel.xyz - 0.5;
    return sample_light_depth(place, vec3<i32>(params.light_cells.xyz), i32(layer));
}

// What the medium does to light at a point, per channel: extinction and scattering in 1/m, emission in W m^-3 sr^-1.
struct Optics {
    extinction: vec3<f32>,
    scattering: vec3<f32>,
    emission: vec3<f32>,
}

// The optics at `at` in index space.
fn optics(at: vec3<f32>, size: vec3<i32>) -> Optics {
    let density = sample_density(at, size, 0);
    var scatters = vec3<f32>(density);
    if has_scattering {
        scatters = sample_scattering(at, size, 0).xyz;
    }
    var source = vec3<f32>(density);
    if has_emission_color {
        source = sample_emission_color(at, size, 0).xyz;
    } else if has_emission_density {
        source = vec3<f32>(sample_emission_density(at, size, 0));
    }
    let scattering = scatters * params.extinction.xyz * params.albedo.xyz;
    return Optics(density * params.extinction.xyz, scattering, source * params.emission.xyz);
}
