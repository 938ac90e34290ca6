// `accumulate`: the mean of the medium over the pictures of a sequence. One workgroup a block of BLOCK×BLOCK pixels.

// What is kept of a pixel.
struct Past {
    radiance: vec3<f32>,
    // Pictures that it is the mean of.
    count: f32,
    transmittance: vec3<f32>,
    depth: f32,
    surface: f32,
}

@compute @workgroup_size(BLOCK, BLOCK)
fn accumulate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_id) lane: vec3<u32>) {
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
    let at = y * params.width + x;
    let light = read_medium(2u * at);
    let through = read_medium(2u * at + 1u);
    var past: Past;
    if params.mode == ACCUMULATE_MOVED {
        past = clamped(followed(x, y, light, through), x, y);
    } else {
        past = recalled(at);
    }
    let count = min(past.count, params.most);
    var now = past;
    if params.mode != ACCUMULATE_AGAIN || past.count == 0.0 {
        let share = 1.0 / (count + 1.0);
        now.radiance = past.radiance + (light.xyz - past.radiance) * share;
        now.transmittance = past.transmittance + (through.xyz - past.transmittance) * share;
        let before = count * stopped(past.transmittance, past.depth);
        let added = stopped(through.xyz, through.w);
        now.depth = launch.infinity;
        if before > 0.0 && added > 0.0 {
            now.depth = past.depth + (through.w - past.depth) * (added / (before + added));
        } else if added > 0.0 {
            now.depth = through.w;
        } else if before > 0.0 {
            now.depth = past.depth;
        }
        now.count = count + 1.0;
    }
    if light.w < 0.0 {
        // It was not marched.
        now = Past(light.xyz, 0.0, through.xyz, through.w, FAR);
    }
    // What is written is bound from a row of blocks on.
    let place = at - launch.first * BLOCK * params.width;
    next[3u * place] = vec4<f32>(now.radiance, now.count);
    next[3u * place + 1u] = vec4<f32>(now.transmittance, now.depth);
    next[3u * place + 2u] = vec4<f32>(light.w, 0.0, 0.0, 0.0);
    mean[2u * place] = vec4<f32>(now.radiance, light.w);
    mean[2u * place + 1u] = vec4<f32>(now.transmittance, now.depth);
}

// The history of a pixel; none where it is not finite.
fn recalled(at: u32) -> Past {
    let a = read_last(3u * at);
    let b = read_last(3u * at + 1u);
    let c = read_last(3u * at + 2u);
    if !(finite(a.x) && finite(a.y) && finite(a.z) && finite(a.w) && finite(b.x) && finite(b.y) && finite(b.z)) {
        return Past(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), launch.infinity, FAR);
    }
    return Past(a.xyz, a.w, b.xyz, b.w, c.x);
}

// The history of what a pixel shows, where the last view saw it.
fn followed(x: u32, y: u32, light: vec4<f32>, through: vec4<f32>) -> Past {
    let none = Past(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), launch.infinity, FAR);
    let half_scale = params.scale / 2u;
    let fx = min(x * params.scale + half_scale, params.full_width - 1u);
    let fy = min(y * params.scale + half_scale, params.full_height - 1u);
    let a = (f32(fx) + 0.5) * (2.0 / f32(params.full_width)) - 1.0;
    let b = 1.0 - (f32(fy) + 0.5) * (2.0 / f32(params.full_height));
    let toward = a * params.right.xyz + b * params.up.xyz + params.forward.xyz;
    let direction = toward / length(toward);
    var point = direction;
    if through.w < FAR {
        point = params.moved.xyz + through.w * direction;
    } else if light.w < FAR {
        point = params.moved.xyz + light.w * direction;
    }
    let ahead = dot(point, params.last_forward.xyz);
    if ahead <= 0.0 {
        return none;
    }
    let px = (dot(point, params.last_right.xyz) / ahead + 1.0) * (0.5 * f32(params.full_width)) - 0.5;
    let py = (1.0 - dot(point, params.last_up.xyz) / ahead) * (0.5 * f32(params.full_height)) - 0.5;
    let u = (px - f32(half_scale)) / f32(params.scale);
    let v = (py - f32(half_scale)) / f32(params.scale);
    let right = f32(params.width) - 1.0;
    let bottom = f32(params.height) - 1.0;
    if !(u >= -0.5 && u <= right + 0.5 && v >= -0.5 && v <= bottom + 0.5) {
        return none;
    }
    var surface = FAR;
    if light.w < FAR {
        surface = length(params.moved.xyz + light.w * direction);
    }
    var sum = Past(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), 0.0, 0.0);
    var weights = 0.0;
    var stops = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let column = floor(u) + f32(i % 2u);
        let row = floor(v) + f32(i / 2u);
        let share = (1.0 - abs(u - column)) * (1.0 - abs(v - row));
        let at = u32(clamp(row, 0.0, bottom)) * params.width + u32(clamp(column, 0.0, right));
        let past = recalled(at);
        let weight = select(0.0, share * fit(past.surface, surface), past.count > 0.0);
        sum.radiance += weight * past.radiance;
        sum.transmittance += weight * past.transmittance;
        sum.count += weight * past.count;
        weights += weight;
        let stop = weight * stopped(past.transmittance, past.depth);
        if stop > 0.0 {
            stops += stop;
            sum.depth += stop * past.depth;
        }
    }
    if weights < ACCUMULATE_FIT {
        return none;
    }
    let depth = select(launch.infinity, sum.depth / max(stops, 1e-30), stops > 0.0);
    return Past(sum.radiance / weights, sum.count / weights, sum.transmittance / weights, depth, surface);
}

// A history within the range of the pixels around.
fn clamped(past: Past, x: u32, y: u32) -> Past {
    var least = vec3<f32>(FAR);
    var most = vec3<f32>(-FAR);
    var thinnest = vec3<f32>(FAR);
    var thickest = vec3<f32>(-FAR);
    for (var i = 0u; i < 9u; i++) {
        let column = min(max(x + i % 3u, 1u) - 1u, params.width - 1u);
        let row = min(max(y + i / 3u, 1u) - 1u, params.height - 1u);
        let at = 2u * (row * params.width + column);
        let light = read_medium(at);
        if light.w < 0.0 {
            continue;
        }
        let through = read_medium(at + 1u).xyz;
        least = min(least, light.xyz);
        most = max(most, light.xyz);
        thinnest = min(thinnest, through);
        thickest = max(thickest, through);
    }
    var found = past;
    found.radiance = clamp(past.radiance, least, most);
    found.transmittance = clamp(past.transmittance, thinnest, thickest);
    return found;
}

// Whether a value is neither infinite nor no number.
fn finite(v: f32) -> bool {
    return (bitcast<u32>(v) & 0x7f800000u) != 0x7f800000u;
}

// How well surfaces of two distances fit.
fn fit(a: f32, b: f32) -> f32 {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    let nearer = 1.0 - min(min(a, b), 1e30) / clamp(max(a, b), 1e-30, 1e30);
    return clamp(2.0 - nearer / ACCUMULATE_NEAR, 0.0, 1.0);
}

// What is stopped, with which a depth is weighed; nothing where there is no depth.
fn stopped(transmittance: vec3<f32>, depth: f32) -> f32 {
    if !finite(depth) {
        return 0.0;
    }
    return max((3.0 - (transmittance.x + transmittance.y + transmittance.z)) * (1.0 / 3.0), 1e-9);
}
