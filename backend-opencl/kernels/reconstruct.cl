// `reconstruct`: in-scattered radiance from what clusters of transfer matrices make of light. One work-item EACH cells, one
// behind the other.

void whole(const Bound *bound, uint cell);
void singles(const Bound *bound, uint first, uint count);
float3 arriving(const Bound *bound, uint row, uint j);
float3 restored(const Bound *bound, uint channel, uint row, uint j);
float3 view_direction(const Bound *bound, uint cell);

void run_reconstruct(const Bound *bound) {
    size_t n = number() * EACH;
    if (n >= bound->launch->count) {
        return;
    }
    uint first = bound->launch->start + (uint)n;
    uint count = min(EACH, bound->launch->count - (uint)n);
    if (bound->params->view == 0u && bound->params->bands == 1u && bound->params->channels == 1u) {
        singles(bound, first, count);
        return;
    }
    for (uint i = 0u; i < count; i++) {
        whole(bound, first + i);
    }
}

// All layers of a cell.
void whole(const Bound *bound, uint cell) {
    uint row = min(bound->rows[cell], bound->params->rows);
    uint moments = bound->params->bands * bound->params->bands;
    if (bound->params->view == 0u) {
        for (uint j = 0u; j < moments; j++) {
            float3 light = (float3)(0.0f);
            if (row > 0u) {
                light = bound->tables[j] * arriving(bound, row - 1u, j);
            }
            bound->in_scatter[(size_t)cell * moments + j] = (float4)(light, 0.0f);
        }
        return;
    }
    float3 sum = (float3)(0.0f);
    if (row > 0u) {
        float basis[HARMONICS_MAX];
        harmonics(bound, view_direction(bound, cell), bound->params->bands, basis);
        for (uint j = 0u; j < moments; j++) {
            sum += bound->tables[j] * basis[j] * arriving(bound, row - 1u, j);
        }
    }
    bound->in_scatter[cell] = (float4)(sum, 0.0f);
}

// The layer of some cells where light has one moment, which is the same in all channels.
void singles(const Bound *bound, uint first, uint count) {
    uint rows = bound->params->rows;
    uint clusters = bound->params->clusters;
    uint components = bound->params->components;
    float beta = bound->tables[0];
    for (uint cell = first; cell < first + count; cell++) {
        uint row = min(bound->rows[cell], rows);
        if (row == 0u) {
            bound->in_scatter[cell] = (float4)(0.0f);
            continue;
        }
        uint cluster = min(bound->clusters[row - 1u], clusters - 1u);
        __global const float4 *radiance = bound->radiance + (size_t)cluster * (1u + components);
        __global const float *weights = bound->weights + (size_t)(row - 1u) * components;
        float4 sum = radiance[0];
        for (uint i = 0u; i < components; i++) {
            sum += weights[i] * radiance[i + 1u];
        }
        bound->in_scatter[cell] = (float4)(beta * sum.xyz, 0.0f);
    }
}

// Moment `j` of a row; a channel serves all of RGB, or each its own component.
float3 arriving(const Bound *bound, uint row, uint j) {
    float3 first = restored(bound, 0u, row, j);
    if (bound->params->channels == 1u) {
        return first;
    }
    return (float3)(first.x, restored(bound, 1u, row, j).y, restored(bound, 2u, row, j).z);
}

// Moment `j` of a row in a channel: its cluster's mean, and what it weighs the components.
float3 restored(const Bound *bound, uint channel, uint row, uint j) {
    uint moments = bound->params->bands * bound->params->bands;
    uint components = bound->params->components;
    uint place = channel * bound->params->rows + row;
    uint cluster = min(bound->clusters[place], bound->params->clusters - 1u);
    size_t at = ((size_t)channel * bound->params->clusters + cluster) * (1u + components) * moments + j;
    float3 sum = bound->radiance[at].xyz;
    for (uint i = 0u; i < components; i++) {
        at += moments;
        sum += bound->weights[(size_t)place * components + i] * bound->radiance[at].xyz;
    }
    return sum;
}

// Unit direction in the world from the eye to a cell's center; +Z where the cell is at the eye.
float3 view_direction(const Bound *bound, uint cell) {
    uint3 cells = bound->params->cells.xyz;
    float3 place = convert_float3((uint3)(cell % cells.x, cell / cells.x % cells.y, cell / cells.x / cells.y));
    float3 v = (place + 0.5f) * bound->params->cell.xyz - 0.5f - bound->params->eye.xyz;
    float3 x = bound->params->world_x.xyz;
    float3 y = bound->params->world_y.xyz;
    float3 z = bound->params->world_z.xyz;
    float3 w = (float3)(dot(x, v), dot(y, v), dot(z, v));
    float distance = length(w);
    return distance > 0.0f ? w / distance : (float3)(0.0f, 0.0f, 1.0f);
}

// Constant `i` of the spherical harmonics.
float harmonics_value(const Bound *bound, uint i) {
    return bound->tables[bound->params->bands * bound->params->bands + i];
}
