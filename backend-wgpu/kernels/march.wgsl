// `march`: view rays through the medium. One workgroup a block of BLOCK×BLOCK pixels.

fn phase_value(i: u32) -> f32 {
    return tables[params.phase_at + i];
}

fn phase_size() -> u32 {
    return params.phase_size;
}

fn harmonics_value(i: u32) -> f32 {
    return tables[params.harmonics_at + i];
}

// One view ray.
struct Path {
    direction: vec3<f32>,
    ray: Ray,
    radiance: vec3<f32>,
    transmittance: vec3<f32>,
    // Light stopped so far, and the same weighed with its distance.
    stopped: f32,
    stopped_at: f32,
}

@compute @workgroup_size(BLOCK, BLOCK)
fn march(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_id) lane: vec3<u32>) {
    let n = number(id);
    if n >= launch.count {
        return;
    }
    let block = launch.start + n;
    let across = (params.width + BLOCK - 1u) / BLOCK;
    let x = block % across * BLOCK + lane.x;
    let y = block / across * BLOCK + lane.y;
    if x >= params.width || y >= params.height {
        return;
    }
    // The film and the surfaces are bound from a row of blocks on.
    let pixel = (y - launch.first * BLOCK) * params.width + x;
    // The same pixel of the full picture.
    let fx = min(x * params.scale + params.scale / 2u, params.full_width - 1u);
    let fy = min(y * params.scale + params.scale / 2u, params.full_height - 1u);
    let full = (fy - launch.first * BLOCK * params.scale) * params.full_width + fx;
    var limit = FAR;
    if has_surface {
        limit = min(surface[full].w, FAR);
    }
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
        let a = (f32(fx) + tables[2u * s]) * (2.0 / f32(params.full_width)) - 1.0;
        let b = 1.0 - (f32(fy) + tables[2u * s + 1u]) * (2.0 / f32(params.full_height));
        let toward = a * params.right.xyz + b * params.up.xyz + params.forward.xyz;
        let direction = toward / length(toward);
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
        if params.alone == 1u {
            behind = vec3<f32>(0.0);
        } else if limit < FAR {
            behind = surface[full].xyz;
        } else if has_environment {
            behind = sky(direction);
        }
        color += path.radiance + path.transmittance * behind;
        transmitted += path.transmittance;
        stopped += path.stopped;
        stopped_at += path.stopped_at;
    }
    if params.sample_end < params.samples {
        film[2u * pixel] = vec4<f32>(color, stopped);
        film[2u * pixel + 1u] = vec4<f32>(transmitted, stopped_at);
        return;
    }
    let scale = 1.0 / f32(params.samples);
    let mean = (transmitted.x + transmitted.y + transmitted.z) * (scale / 3.0);
    var depth = launch.infinity;
    if stopped > 0.0 {
        depth = stopped_at / stopped;
    }
    film[2u * pixel] = vec4<f32>(color * scale, select(1.0 - mean, limit, params.alone == 1u));
    film[2u * pixel + 1u] = vec4<f32>(transmitted * scale, depth);
}

// Where the samples of a sub-pixel position of a pixel lie within their steps.
fn jitter(x: u32, y: u32, s: u32) -> f32 {
    if params.jittered == 0u {
        return 0.5;
    }
    let at = params.jitter_at + params.samples + y % JITTER_SIDE * JITTER_SIDE + x % JITTER_SIDE;
    let place = tables[at] + tables[params.jitter_at + s] + params.jitter_offset;
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
    (*path).stopped_at = through.w;
}

// Leaves the path to the next pass.
fn keep(path: Path, pixel: u32) {
    paths[2u * pixel] = vec4<f32>(path.radiance, path.stopped);
    paths[2u * pixel + 1u] = vec4<f32>(path.transmittance, path.stopped_at);
}

// The steps of this pass.
fn walk(path: ptr<function, Path>) {
    let size = vec3<i32>(params.dims.xyz);
    let direction = (*path).direction;
    let ray = (*path).ray;
    // Y_k of the direction, where the in-scatter has layers.
    var basis: array<f32, HARMONICS_MAX>;
    if params.cells.w > 1u {
        harmonics(direction, params.bands, &basis);
    }
    let scatters = params.albedo.x + params.albedo.y + params.albedo.z > 0.0;
    let grid = blocks();
    let last = min(ray.steps, f32(params.step_end));
    var k = f32(params.step_begin);
    while k < last {
        let transmittance = (*path).transmittance;
        if max(max(transmittance.x, transmittance.y), transmittance.z) < params.cut {
            break;
        }
        let t = middle(ray, k);
        if has_occupancy {
            let next = skip(ray, t, k, grid);
            if next >= 0.0 {
                k = next;
                continue;
            }
        }
        let at = along(ray, t);
        let here = optics(at, size);
        var light = vec3<f32>(0.0);
        if scatters && max(max(here.extinction.x, here.extinction.y), here.extinction.z) > 0.0 {
            light = gathered(at, &basis) + direct(at, direction, t);
        }
        var share = 0.0;
        for (var c = 0u; c < 3u; c++) {
            let extinction = here.extinction[c];
            let piece = segment(extinction * ray.step);
            let sent = extinction * here.albedo[c] * light[c] + here.emission[c];
            (*path).radiance[c] += transmittance[c] * ray.step * piece.y * sent;
            share += transmittance[c] * (extinction * ray.step * piece.y);
            (*path).transmittance[c] = transmittance[c] * piece.x;
        }
        (*path).stopped += share;
        (*path).stopped_at += share * t;
        k += 1.0;
    }
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

// J from each light.
fn direct(at: vec3<f32>, direction: vec3<f32>, t: f32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    var depths = vec4<f32>(0.0);
    for (var i = 0u; i < params.lights; i++) {
        if i % 4u == 0u {
            depths = light_depths(at, i / 4u);
        }
        let record = lights[i];
        let light = incident(record, direction, t);
        if light.falloff <= 0.0 {
            continue;
        }
        let scale = phase(dot(light.toward, direction)) * light.falloff;
        var optical = depths[i % 4u];
        if params.shadow == SHADOW_MARCH || params.shadow == SHADOW_MEAN {
            let size = vec3<f32>(params.dims.xyz);
            let ray = through(at, to_index(light.toward), size, light.distance, params.step);
            if params.shadow == SHADOW_MARCH {
                optical = column(ray, blocks());
            } else {
                optical *= ray.step * ray.steps;
            }
        }
        let transmittance = exp(-optical * params.extinction.xyz);
        sum += scale * transmittance * record.power.xyz;
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

// What the medium does to light at a point, per channel: extinction in 1/m, emission in W m^-3 sr^-1.
struct Optics {
    extinction: vec3<f32>,
    albedo: vec3<f32>,
    emission: vec3<f32>,
}

// The optics at `at` in index space.
fn optics(at: vec3<f32>, size: vec3<i32>) -> Optics {
    let density = sample_density(at, size, 0);
    var source = density;
    if has_emission_density {
        source = sample_emission_density(at, size, 0);
    }
    return Optics(density * params.extinction.xyz, params.albedo.xyz, source * params.emission.xyz);
}

// A direction of the world in voxels per metre.
fn to_index(d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(d, params.index_x.xyz), dot(d, params.index_y.xyz), dot(d, params.index_z.xyz));
}

struct Incident {
    // Unit direction toward the light.
    toward: vec3<f32>,
    // Distance to it, metres.
    distance: f32,
    // What falloff and cone leave of its power.
    falloff: f32,
}

// The light `t` metres along the view ray.
fn incident(light: LightRecord, d: vec3<f32>, t: f32) -> Incident {
    if light.position.w == 0.0 {
        return Incident(light.position.xyz, FAR, 1.0);
    }
    let v = light.position.xyz - t * d;
    let square = dot(v, v);
    let distance = sqrt(square);
    let toward = v / max(distance, 1.2e-38);
    var falloff = 1.0 / max(square, params.light_floor);
    if light.cone.z == 1.0 {
        // A cone without a rim is a step at the cutoff.
        let rim = max(light.cone.y - light.cone.x, 1e-6);
        let angle = angle_of_cosine(dot(-light.axis.xyz, toward));
        falloff *= clamp((light.cone.y - angle) / rim, 0.0, 1.0);
    }
    return Incident(toward, distance, falloff);
}
