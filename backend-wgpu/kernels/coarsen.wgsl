// `coarsen`: what a medium does to light, as means over the cells of a coarse grid. One invocation a cell.

@compute @workgroup_size(UNITS)
fn coarsen(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let index = launch.start + n;
    let cells = params.cells.xyz;
    let cell = vec3<u32>(index % cells.x, index / cells.x % cells.y, index / cells.x / cells.y);
    let begin = vec3<f32>(cell) * params.cell.xyz;
    let end = vec3<f32>(cell + 1u) * params.cell.xyz;
    let size = params.dims.xyz;
    let lo = min(vec3<u32>(floor(begin)), size - 1u);
    let hi = clamp(vec3<u32>(ceil(end)), vec3<u32>(1u), size) - 1u;
    var density = 0.0;
    var scatters = vec3<f32>(0.0);
    var shines = vec3<f32>(0.0);
    for (var k = lo.z; k <= hi.z; k++) {
        for (var j = lo.y; j <= hi.y; j++) {
            for (var i = lo.x; i <= hi.x; i++) {
                let at = vec3<i32>(vec3<u32>(i, j, k));
                // What holds zero alone adds nothing; only what shines by itself may be where there is no density.
                var zeros = empty_density(at);
                if has_emission_density {
                    zeros = min(zeros, empty_emission_density(at));
                }
                if zeros > 0 {
                    i += u32(zeros) - 1u;
                    continue;
                }
                let w = share(begin.x, end.x, i) * share(begin.y, end.y, j) * share(begin.z, end.z, k);
                let rho = texel_density(at, vec3<i32>(size), 0);
                var own = vec3<f32>(rho);
                var glow = vec3<f32>(rho);
                if has_scattering {
                    own = texel_scattering(at, vec3<i32>(size), 0).xyz;
                }
                if has_emission_color {
                    glow = texel_emission_color(at, vec3<i32>(size), 0).xyz;
                } else if has_emission_density {
                    glow = vec3<f32>(texel_emission_density(at, vec3<i32>(size), 0));
                }
                density += w * rho;
                scatters += w * own;
                shines += w * glow;
            }
        }
    }
    let within = max(min(end, vec3<f32>(size)) - begin, vec3<f32>(0.0));
    // A cell holds a part of a voxel at the least, but its sides are rounded.
    let volume = max(within.x * within.y * within.z, 1e-30);
    let go_on = params.emission.w;
    let scattering = scatters / volume * params.extinction.xyz * params.albedo.xyz;
    let extinction = max(density / volume * params.extinction.xyz - go_on * scattering, vec3<f32>(0.0));
    let thin = (1.0 - go_on) * params.albedo.xyz / (1.0 - go_on * params.albedo.xyz);
    let glow = shines / volume * params.emission.xyz;
    let count = cells.x * cells.y * cells.z;
    for (var c = 0u; c < 3u; c++) {
        var albedo = thin[c];
        if extinction[c] > 0.0 {
            albedo = (1.0 - go_on) * scattering[c] / extinction[c];
        }
        optics[c * count + index] = extinction[c];
        optics[(3u + c) * count + index] = albedo;
        optics[(6u + c) * count + index] = glow[c];
    }
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
fn share(begin: f32, end: f32, i: u32) -> f32 {
    return max(min(end, f32(i) + 1.0) - max(begin, f32(i)), 0.0);
}
