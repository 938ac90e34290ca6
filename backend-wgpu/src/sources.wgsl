// The source functions of the cells toward each direction of a batch of `sweep`, whose planes ask for each of them five
// times. One invocation a cell of a direction.

@compute @workgroup_size(UNITS)
fn sources_toward(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = number(id) * UNITS + lane;
    if item >= launch.count {
        return;
    }
    let cells = params.cells.x * params.cells.y * params.cells.z;
    let n = item / cells;
    let cell = item % cells;
    let first = (launch.first + n) * params.source_coefficients;
    for (var channel = 0u; channel < params.channels; channel++) {
        var sum = 0.0;
        for (var k = 0u; k < params.source_coefficients; k++) {
            sum += read_source_weights(first + k) * read_sources((k * params.channels + channel) * cells + cell);
        }
        toward[(n * params.channels + channel) * cells + cell] = sum * read_optics((3u + channel) * cells + cell);
    }
}
