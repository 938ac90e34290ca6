//! Phase functions.

use std::f32::consts::PI;

use airlight_core::stage::PhaseParams;

use super::angle::angle_of_cosine;
use crate::packet::{F, LANES, lanes};
use crate::simd::Simd;

const FOUR_PI: f32 = 4.0 * PI;

/// A phase function with its table.
#[derive(Clone, Copy)]
pub(crate) struct Phase<'a> {
    pub(crate) kind: u32,
    pub(crate) lobes: [f32; 4],
    pub(crate) table: &'a [f32],
}

#[inline(always)]
fn henyey_greenstein<S: Simd>(g: f32, c: F<S>) -> F<S> {
    let base = c * (-2.0 * g) + (1.0 + g * g);
    F::splat((1.0 - g * g) / FOUR_PI) / (base * base.sqrt())
}

#[inline(always)]
fn phase_lookup<S: Simd>(table: &[f32], c: F<S>) -> F<S> {
    let last = table.len() - 1;
    let at = angle_of_cosine(c) / PI * last as f32;
    // What is not a number is the first entry.
    let i: [usize; LANES] = lanes!(l => (at.0[l] as usize).min(last - 1));
    F::of(lanes!(l => table[i[l]] + (table[i[l] + 1] - table[i[l]]) * (at.0[l] - i[l] as f32)))
}

/// Value at cosine `c`, per steradian.
#[inline(always)]
pub(crate) fn phase<S: Simd>(of: &Phase<'_>, c: F<S>) -> F<S> {
    match of.kind {
        PhaseParams::HENYEY_GREENSTEIN => {
            let [forward, backward, weight, _] = of.lobes;
            let first = henyey_greenstein(forward, c);
            if weight == 1.0 { first } else { first * weight + henyey_greenstein(backward, c) * (1.0 - weight) }
        }
        PhaseParams::RAYLEIGH => (c * c + 1.0) * (3.0 / (4.0 * FOUR_PI)),
        PhaseParams::TABLE => phase_lookup(of.table, c),
        _ => F::splat(1.0 / FOUR_PI),
    }
}
