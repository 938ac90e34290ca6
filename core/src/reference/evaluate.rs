//! Twin of the stage [`Evaluate`](crate::stage::Evaluate).

use crate::stage::EvaluateParams;

/// What the bindings of [`Evaluate`](crate::stage::Evaluate) hold.
#[derive(Clone, Copy, Debug)]
pub struct EvaluateInputs<'a> {
    /// M, laid out \[unit\]\[moment\]\[function\].
    pub matrices: &'a [f32],
    /// s, laid out \[RGB\]\[function\].
    pub light: &'a [f32],
    /// What the moments of a cluster weigh, laid out \[cluster\]\[moment\]; empty unless folded.
    pub views: &'a [f32],
}

/// What [`Evaluate`](crate::stage::Evaluate) writes: I, laid out \[unit\]\[moment\]\[RGBA\], or \[unit\]\[RGBA\] where
/// folded, A zero. Of passes, what the last one leaves.
pub fn evaluate(params: &EvaluateParams, inputs: &EvaluateInputs<'_>) -> Vec<f64> {
    let (moments, functions) = (params.coefficients as usize, params.functions as usize);
    let moment = |unit: usize, j: usize, c: usize| -> f64 {
        let row = &inputs.matrices[(unit * moments + j) * functions..][..functions];
        let light = &inputs.light[c * functions..][..functions];
        row.iter().zip(light).map(|(&m, &s)| f64::from(m) * f64::from(s)).sum()
    };
    let mut out = Vec::new();
    for unit in 0..params.units as usize {
        if params.folded == 1 {
            let views = &inputs.views[unit / params.per_cluster as usize * moments..];
            let passed = 0..params.coefficient_end as usize;
            let folded = |c| -> f64 { passed.clone().map(|j| f64::from(views[j]) * moment(unit, j, c)).sum() };
            out.extend([0, 1, 2].map(folded));
            out.push(0.0);
        } else {
            for j in 0..moments {
                out.extend([0, 1, 2].map(|c| moment(unit, j, c)));
                out.push(0.0);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_turn_light_into_moments_and_views_fold_them() {
        // Two clusters of a mean and a component, of two moments and three functions; the twin needs no whole packs.
        let matrices: Vec<f32> = (0..24u8).map(f32::from).collect();
        let light = [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.5, 0.5, 0.5];
        let inputs = EvaluateInputs { matrices: &matrices, light: &light, views: &[] };
        let plain = evaluate(&EvaluateParams::new(2, 1, 2, 3, false), &inputs);
        // Red takes the first function, green twice the second, blue half of all.
        assert_eq!(plain[..8], [0.0, 2.0, 1.5, 0.0, 3.0, 8.0, 6.0, 0.0]);
        assert_eq!(plain[24..], [18.0, 38.0, 28.5, 0.0, 21.0, 44.0, 33.0, 0.0]);
        let folded = EvaluateParams::new(2, 1, 2, 3, true);
        let found = evaluate(&folded, &EvaluateInputs { views: &[1.0, 10.0, 2.0, -1.0], ..inputs });
        assert_eq!(found[..4], [30.0, 82.0, 61.5, 0.0]);
        assert_eq!(found[12..], [15.0, 32.0, 24.0, 0.0]);
        let first = EvaluateParams { coefficient_end: 1, ..folded };
        let found = evaluate(&first, &EvaluateInputs { views: &[1.0, 10.0, 2.0, -1.0], ..inputs });
        assert_eq!(found[12..], [36.0, 76.0, 57.0, 0.0]);
    }
}
