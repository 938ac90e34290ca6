//! Directions in which scattering bends, and choices by weights.

use std::f32::consts::PI;

use airlight_core::glam::Vec3;
use airlight_core::stage::{Path, PhaseParams};

use super::angle::angle_of_cosine;
use super::phase::{Phase, phase};
use super::random::{Draws, circle, draw};
use crate::packet::F;
use crate::simd::Portable;

/// Values of an item of a choice.
const CHOICE: usize = Path::CHOICE as usize;

/// One of `count` items of a choice, in proportion to their weights.
#[inline]
pub(crate) fn choose(choice: &[f32], count: usize, draws: &mut Draws) -> usize {
    let place = ((draw(draws) * count as f32) as usize).min(count - 1);
    if draw(draws) < choice[CHOICE * place] { place } else { choice[CHOICE * place + 1] as usize }
}

/// The direction at cosine `c` to a unit `d`, so many turns around it (frame of Duff et al. 2017).
#[inline]
pub(crate) fn around(d: Vec3, c: f32, turn: f32) -> Vec3 {
    let s = if d.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + d.z);
    let b = d.x * d.y * a;
    let u = Vec3::new(1.0 + s * d.x * d.x * a, s * b, -s * d.x);
    let v = Vec3::new(b, s + d.y * d.y * a, -d.y);
    let planar = (1.0 - c * c).max(0.0).sqrt();
    let [x, y] = circle(turn);
    let found = planar * x * u + planar * y * v + c * d;
    found / found.dot(found).sqrt()
}

/// The cosine of a Henyey–Greenstein lobe below which a part `u` of it lies.
#[inline]
fn lobe(g: f32, u: f32) -> f32 {
    // The inverse of the distribution, without the quotient that vanishes with g.
    let x = 2.0 * u - 1.0;
    let square = x * x;
    let base = 1.0 + g * x;
    (x + 0.5 * g * (square + 3.0) + g * g * x + 0.5 * g * g * g * (square - 1.0)) / (base * base)
}

/// The same of Rayleigh's function: the root of c³ + 3c = 8u - 4.
#[inline]
fn rayleigh(u: f32) -> f32 {
    let q = 4.0 * u - 2.0;
    let cube = q.abs() + (q * q + 1.0).sqrt();
    let root = cube.powf(1.0 / 3.0);
    // One step of Newton's makes up for powers of few digits.
    let root = root - (root - cube / (root * root)) / 3.0;
    let c = root - 1.0 / root;
    if q < 0.0 { -c } else { c }
}

/// A cosine of scattering; `bends` is the choice among the pieces of the phase function's table.
#[inline]
pub(crate) fn bend(of: &Phase<'_>, bends: &[f32], draws: &mut Draws) -> f32 {
    let c = match of.kind {
        PhaseParams::HENYEY_GREENSTEIN => {
            let [forward, backward, weight, _] = of.lobes;
            let g = if weight == 1.0 || draw(draws) < weight { forward } else { backward };
            lobe(g, draw(draws))
        }
        PhaseParams::RAYLEIGH => rayleigh(draw(draws)),
        PhaseParams::TABLE => {
            let last = of.table.len() - 1;
            let piece = choose(bends, last, draws);
            let edge = |i: usize| circle(0.5 * i as f32 / last as f32)[0];
            edge(piece) + (edge(piece + 1) - edge(piece)) * draw(draws)
        }
        _ => 2.0 * draw(draws) - 1.0,
    };
    c.clamp(-1.0, 1.0)
}

/// The probability that scattering bends by cosine `c`, per steradian.
#[inline]
pub(crate) fn bend_density(of: &Phase<'_>, bends: &[f32], c: f32) -> f32 {
    if of.kind == PhaseParams::TABLE {
        let last = of.table.len() - 1;
        let piece = (angle_of_cosine(F::<Portable>::splat(c)).0[0] / PI * last as f32) as usize;
        return bends[CHOICE * piece.min(last - 1) + 2];
    }
    phase(of, F::<Portable>::splat(c)).0[0]
}
