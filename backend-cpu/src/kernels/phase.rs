//! Phase functions.

use airlight_core::stage::PhaseParams;

use crate::packet::F;

const FOUR_PI: f32 = 4.0 * std::f32::consts::PI;

/// A phase function with its table.
#[derive(Clone, Copy)]
pub(crate) struct Phase<'a> {
    pub(crate) kind: u32,
    pub(crate) lobes: [f32; 4],
    pub(crate) table: &'a [f32],
}

#[inline(always)]
fn henyey_greenstein(g: f32, c: F) -> F {
    let base = c * (-2.0 * g) + (1.0 + g * g);
    F::splat((1.0 - g * g) / FOUR_PI) / (base * base.sqrt())
}

fn lookup(table: &[f32], c: f32) -> f32 {
    let last = table.len() - 1;
    let at = c.clamp(-1.0, 1.0).acos() / std::f32::consts::PI * last as f32;
    let i = (at as usize).min(last - 1);
    table[i] + (table[i + 1] - table[i]) * (at - i as f32)
}

impl Phase<'_> {
    /// Value at cosine `c`, per steradian.
    #[inline(always)]
    pub(crate) fn eval(&self, c: F) -> F {
        match self.kind {
            PhaseParams::HENYEY_GREENSTEIN => {
                let [forward, backward, weight, _] = self.lobes;
                let first = henyey_greenstein(forward, c);
                if weight == 1.0 { first } else { first * weight + henyey_greenstein(backward, c) * (1.0 - weight) }
            }
            PhaseParams::RAYLEIGH => (c * c + 1.0) * (3.0 / (4.0 * FOUR_PI)),
            PhaseParams::TABLE => c.each(|c| lookup(self.table, c)),
            _ => F::splat(1.0 / FOUR_PI),
        }
    }
}
