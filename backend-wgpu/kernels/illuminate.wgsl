// `illuminate`: moments of the unscattered light of analytic lights at the cells of a coarse grid. One invocation a cell.

@compute @workgroup_size(UNITS)
fn illuminate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let cell = launch.start + n;
    let cells = params.cells.xyz;
    let place = vec3<f32>(vec3<u32>(cell % cells.x, cell / cells.x % cells.y, cell / cells.x / cells.y));
    let index = (place + 0.5) * params.cell.xyz - 0.5;
    let v = index - (vec3<f32>(params.dims.xyz) - 1.0) * 0.5;
    let at = vec3<f32>(dot(params.world_x.xyz, v), dot(params.world_y.xyz, v), dot(params.world_z.xyz, v));
    let t = length(at);
    let d = at / max(t, 1.2e-38);
    let count = cells.x * cells.y * cells.z;
    let values = params.bands * params.bands * params.channels;
    if params.light_end == 0u {
        for (var value = 0u; value < values; value++) {
            moments[value * count + cell] = 0.0;
        }
    }
    var basis: array<f32, HARMONICS_MAX>;
    for (var i = params.light_begin; i < params.light_end; i++) {
        let record = read_lights(i);
        let light = incident(record, d, t);
        let power = arriving(record, light, at, index);
        // The first light is stored, not added to what is stored.
        let lit = max(power.x, max(power.y, power.z)) > 0.0;
        if !lit && i > 0u {
            continue;
        }
        harmonics(light.toward, params.bands, &basis);
        for (var value = 0u; value < values; value++) {
            let more = select(0.0, power[value % params.channels] * basis[value / params.channels], lit);
            if i == 0u {
                moments[value * count + cell] = more;
            } else {
                moments[value * count + cell] += more;
            }
        }
    }
}

// What a light brings to a place, `at` in metres from the box's centre.
fn arriving(record: LightRecord, light: Incident, at: vec3<f32>, index: vec3<f32>) -> vec3<f32> {
    if light.falloff <= 0.0 {
        return vec3<f32>(0.0);
    }
    if params.visibility == 1u {
        let margin = MESH_MARGIN * params.mesh_eye.w;
        if blocked(line(at + params.mesh_eye.xyz, light.toward), light.distance - margin, 0u, params.nodes) {
            return vec3<f32>(0.0);
        }
    }
    let size = vec3<f32>(params.dims.xyz);
    let way = through(index, to_index(light.toward), size, light.distance, params.cell.w);
    return light.falloff * record.power.xyz * exp(-column(way, blocks()) * params.extinction.xyz);
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
fn blocks() -> vec4<u32> {
    return select(vec4<u32>(0u), params.occupancy_cells, has_occupancy);
}

// Constant `i` of the spherical harmonics.
fn harmonics_value(i: u32) -> f32 {
    return read_tables(i);
}
