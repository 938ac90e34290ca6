//! Twin of the stage [`Relight`](crate::stage::Relight).

use crate::stage::RelightParams;

/// What the bindings of [`Relight`](crate::stage::Relight) hold.
#[derive(Clone, Copy, Debug)]
pub struct RelightInputs<'a> {
    /// D, laid out \[cell\]\[coefficient\]\[channel\], or \[coefficient\]\[channel\]\[cell\].
    pub records: &'a [f32],
    /// E, laid out \[cell\]\[coefficient\]\[RGB\]; empty for none.
    pub emission_records: &'a [f32],
    /// Light per coefficient.
    pub light: &'a [[f32; 4]],
}

/// What [`Relight`](crate::stage::Relight) writes: J, laid out \[cell\]\[layer\]\[RGBA\], A zero.
pub fn relight(params: &RelightParams, inputs: &RelightInputs<'_>) -> Vec<f64> {
    let (coefficients, channels) = (params.coefficients as usize, params.channels as usize);
    let moments = params.emission_coefficients as usize;
    let record = |cell: usize, k: usize, c: usize| {
        let value = k * channels + c.min(channels - 1);
        f64::from(match params.planar {
            1 => inputs.records[value * params.cells as usize + cell],
            _ => inputs.records[cell * coefficients * channels + value],
        })
    };
    let emitted = |cell: usize, k: usize, c: usize| match moments {
        0 => 0.0,
        _ => f64::from(inputs.emission_records[(cell * moments + k) * 3 + c]),
    };
    let light = |k: usize, c: usize| f64::from(inputs.light[k][c]);
    let mut out = Vec::new();
    for cell in 0..params.cells as usize {
        for layer in 0..params.layers as usize {
            for c in 0..3 {
                out.push(if params.layers == 1 {
                    let scattered: f64 = (0..coefficients).map(|k| light(k, c) * record(cell, k, c)).sum();
                    scattered + f64::from(params.emission_weight) * emitted(cell, 0, c)
                } else {
                    light(layer, c) * (record(cell, layer, c) + emitted(cell, layer, c))
                });
            }
            out.push(0.0);
        }
    }
    out
}
