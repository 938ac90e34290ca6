// `upsample`: the picture from a film of the medium alone. One workgroup a block of BLOCK×BLOCK pixels.

// Sums over pixels of a small film.
struct Medium {
    radiance: vec3<f32>,
    transmittance: vec3<f32>,
    // Light stopped, and the same weighed with its distance.
    stopped: f32,
    stopped_at: f32,
    weight: f32,
    // How much of the nearest pixels, by their bilinear weights, was marched.
    marched: f32,
}

// A film smaller than the picture: the one near rims, or the one of everything.
struct Small {
    scale: u32,
    width: u32,
    height: u32,
    rims: bool,
}

@compute @workgroup_size(BLOCK, BLOCK)
fn upsample(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_id) lane: vec3<u32>) {
    let n = number(id);
    if n >= launch.count {
        return;
    }
    let block = launch.start + n;
    let across = (params.full_width + BLOCK - 1u) / BLOCK;
    let x = block % across * BLOCK + lane.x;
    let y = block / across * BLOCK + lane.y;
    if x >= params.full_width || y >= params.full_height {
        return;
    }
    // The film and the surfaces are bound from a row of blocks on.
    let pixel = (y - launch.first * BLOCK) * params.full_width + x;
    let distance = min(seen(pixel, 0u).w, FAR);
    var found = Medium(vec3<f32>(0.0), vec3<f32>(0.0), 0.0, 0.0, 0.0, 0.0);
    if has_rims {
        found = around(x, y, small(params.scale / 2u, true), distance);
    }
    if found.marched < 1.0 {
        found = mixed(found, around(x, y, small(params.scale, false), distance));
    }
    let radiance = found.radiance / found.weight;
    let transmittance = found.transmittance / found.weight;
    var depth = launch.infinity;
    if found.stopped > 0.0 {
        depth = found.stopped_at / found.stopped;
    }
    let color = radiance + transmittance * behind(x, y, pixel);
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    let all = 3.0 * found.weight;
    let alpha = (all - (found.transmittance.x + found.transmittance.y + found.transmittance.z)) / all;
    film[2u * pixel] = vec4<f32>(color, alpha);
    film[2u * pixel + 1u] = vec4<f32>(transmittance, depth);
}

// A film of so many pixels of the picture along each side of one of its own.
fn small(scale: u32, rims: bool) -> Small {
    return Small(scale, (params.full_width + scale - 1u) / scale, (params.full_height + scale - 1u) / scale, rims);
}

// As much of one film as was marched of it, and the rest of another.
fn mixed(fine: Medium, whole: Medium) -> Medium {
    if fine.marched == 0.0 {
        return whole;
    }
    let a = fine.marched / fine.weight;
    let b = (1.0 - fine.marched) / whole.weight;
    let radiance = a * fine.radiance + b * whole.radiance;
    let transmittance = a * fine.transmittance + b * whole.transmittance;
    let stopped = a * fine.stopped + b * whole.stopped;
    return Medium(radiance, transmittance, stopped, a * fine.stopped_at + b * whole.stopped_at, 1.0, 1.0);
}

// The medium in a pixel whose surface is so far away; nothing where none of the nearest pixels was marched.
fn around(x: u32, y: u32, small: Small, distance: f32) -> Medium {
    let x0 = first(small, x);
    let y0 = first(small, y);
    let x1 = min(x0 + 1u, small.width - 1u);
    let y1 = min(y0 + 1u, small.height - 1u);
    let fx = part(x, stands(small, x0, params.full_width), stands(small, x1, params.full_width));
    let fy = part(y, stands(small, y0, params.full_height), stands(small, y1, params.full_height));
    let none = Medium(vec3<f32>(0.0), vec3<f32>(0.0), 0.0, 0.0, 0.0, 0.0);
    var sum = none;
    for (var i = 0u; i < 4u; i++) {
        let right = i % 2u == 1u;
        let below = i / 2u == 1u;
        let sx = select(x0, x1, right);
        let sy = select(y0, y1, below);
        let share = select(1.0 - fx, fx, right) * select(1.0 - fy, fy, below);
        let other = held(small, sx, sy, 0u).w;
        if other < 0.0 {
            continue;
        }
        sum.marched += share;
        add(&sum, small, sx, sy, share * fit(distance, other) * alike(x, y, small, sx, sy));
    }
    let marched = sum.marched;
    if marched == 0.0 || sum.weight >= UPSAMPLE_FIT {
        return sum;
    }
    var least = FAR;
    var at = vec2<u32>(x0, y0);
    for (var i = 0u; i < 16u; i++) {
        let sx = min(max(x0 + i % 4u, 1u) - 1u, small.width - 1u);
        let sy = min(max(y0 + i / 4u, 1u) - 1u, small.height - 1u);
        let other = held(small, sx, sy, 0u).w;
        let apart = abs(1.0 / clamp(distance, 1e-6, 1e30) - 1.0 / clamp(other, 1e-6, 1e30));
        if other >= 0.0 && apart < least {
            least = apart;
            at = vec2<u32>(sx, sy);
        }
    }
    sum = none;
    sum.marched = marched;
    add(&sum, small, at.x, at.y, 1.0);
    return sum;
}

// The pixel of a small film at or before pixel `n` of the full picture, along one side; the first one before it.
fn first(small: Small, n: u32) -> u32 {
    return (max(n, small.scale / 2u) - small.scale / 2u) / small.scale;
}

// Where pixel `n` of a small film stands among `size` pixels.
fn stands(small: Small, n: u32, size: u32) -> u32 {
    return min(n * small.scale + small.scale / 2u, size - 1u);
}

// How far `n` is on its way from `a` to `b`.
fn part(n: u32, a: u32, b: u32) -> f32 {
    if n <= a || b <= a {
        return 0.0;
    }
    return f32(n - a) / f32(b - a);
}

// How well surfaces of two distances fit.
fn fit(a: f32, b: f32) -> f32 {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    let nearer = 1.0 - min(min(a, b), 1e30) / clamp(max(a, b), 1e-30, 1e30);
    return clamp(2.0 - nearer / UPSAMPLE_NEAR, 0.0, 1.0);
}

// How well the normals in a pixel and in one of a small film fit.
fn alike(x: u32, y: u32, small: Small, sx: u32, sy: u32) -> f32 {
    if !has_normals {
        return 1.0;
    }
    let other = stands(small, sy, params.full_height) * params.full_width + stands(small, sx, params.full_width);
    let here = read_normals((y * params.full_width + x) * params.normals_each).xyz;
    let there = read_normals(other * params.normals_each).xyz;
    if dot(here, here) == 0.0 || dot(there, there) == 0.0 {
        return 1.0;
    }
    return clamp((dot(here, there) - UPSAMPLE_COSINE) / (1.0 - UPSAMPLE_COSINE), 0.0, 1.0);
}

// One of the two vectors of a pixel of a small film.
fn held(small: Small, sx: u32, sy: u32, half: u32) -> vec4<f32> {
    let at = 2u * (sy * small.width + sx) + half;
    if has_rims && small.rims {
        return read_rims(at);
    }
    return read_medium(at);
}

// Adds a pixel of a small film.
fn add(sum: ptr<function, Medium>, small: Small, sx: u32, sy: u32, weight: f32) {
    let light = held(small, sx, sy, 0u);
    let through = held(small, sx, sy, 1u);
    (*sum).radiance += weight * light.xyz;
    (*sum).transmittance += weight * through.xyz;
    (*sum).weight += weight;
    if through.w < FAR {
        let stopped = weight * max((3.0 - (through.x + through.y + through.z)) * (1.0 / 3.0), 1e-9);
        (*sum).stopped += stopped;
        (*sum).stopped_at += stopped * through.w;
    }
}

// The mean radiance behind the medium over the sub-pixel positions of a pixel.
fn behind(x: u32, y: u32, pixel: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var s = 0u; s < params.samples; s++) {
        let before = seen(pixel, s);
        if before.w < FAR {
            sum += before.xyz;
        } else if has_environment {
            let a = (f32(x) + read_subpixels(2u * s)) * (2.0 / f32(params.full_width)) - 1.0;
            let b = 1.0 - (f32(y) + read_subpixels(2u * s + 1u)) * (2.0 / f32(params.full_height));
            let toward = a * params.right.xyz + b * params.up.xyz + params.forward.xyz;
            sum += sky(toward / length(toward));
        }
    }
    return sum * (1.0 / f32(params.samples));
}

// The surface behind a sub-pixel position of a pixel; as far as can be without any.
fn seen(pixel: u32, s: u32) -> vec4<f32> {
    if !has_surface {
        return vec4<f32>(0.0, 0.0, 0.0, FAR);
    }
    return read_surface(pixel * params.surface_samples + s % params.surface_samples);
}
