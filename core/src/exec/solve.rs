//! Light that is scattered again and again: x = K(b + x).

use super::anderson::{self, Anderson};
use super::vectors::{map, sum};
use crate::device::Buf;
use crate::scene::Orders;
use crate::stage::Stage;

/// The equation x = K(b + x), and where its solution goes. b is unscattered light, and K, which scatters light once more, is
/// a stage that reads `source` and writes `scattered`. The host sums, judges and accelerates; the device scatters.
pub struct Solve {
    /// K.
    pub stage: Stage,
    /// Parts of b, all of the same length.
    pub parts: Vec<Part>,
    /// What the stage reads: b + x.
    pub source: Buf<f32>,
    /// What the stage writes.
    pub scattered: Buf<f32>,
    /// x, and of each part its share.
    pub out: Buf<f32>,
    /// When it is solved.
    pub orders: Orders,
}

/// Light that does not change while an equation is solved.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// The light.
    pub light: Buf<f32>,
    /// How much of it is scattered.
    pub source: f32,
    /// How much of it counts as solution.
    pub out: f32,
}

/// How a [`Solve`] went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// How often light was scattered. Of plain iteration it is the orders of scattering that are there, beside the first.
    pub sweeps: u32,
    /// What the last time changed, as a share of all light, in the mean square.
    pub residual: f64,
    /// Whether that is what was asked for.
    pub converged: bool,
}

/// The most sweeps toward convergence.
const MAX_SWEEPS: u32 = 500;

/// The iteration, on the host.
pub(super) struct Iteration {
    orders: Orders,
    unscattered: Vec<f32>,
    x: Vec<f32>,
    /// b + x, once it was asked for.
    source: Vec<f32>,
    anderson: Anderson,
    sweeps: u32,
}

impl Solve {
    /// Bytes that the host takes.
    pub(super) fn host_bytes(&self) -> u64 {
        let vectors = 5 + match self.orders {
            Orders::Converged { .. } => 2 * anderson::DEPTH as u64,
            Orders::Count(_) => 0,
        };
        self.source.bytes().saturating_mul(vectors)
    }
}

impl Iteration {
    /// From nothing scattered yet.
    pub(super) fn new(orders: Orders, unscattered: Vec<f32>) -> Self {
        let x = vec![0.0; unscattered.len()];
        Self { orders, unscattered, x, source: Vec::new(), anderson: Anderson::default(), sweeps: 0 }
    }

    /// b + x.
    pub(super) fn source(&mut self) -> &[f32] {
        map(&mut self.source, &self.unscattered, &self.x, |b, x| b + x);
        &self.source
    }

    /// Takes K(b + x): how it went, where that is the solution.
    pub(super) fn take(&mut self, image: &[f32]) -> Option<Solved> {
        self.sweeps += 1;
        let changed = sum(image, &self.x, |y, x| (y - x) * (y - x));
        let whole = sum(image, &self.unscattered, |y, b| (y + b) * (y + b));
        let residual = if changed > 0.0 { (changed / whole).sqrt() } else { 0.0 };
        let (done, converged) = match self.orders {
            Orders::Count(orders) => (self.sweeps + 1 >= orders, true),
            Orders::Converged { tolerance } => {
                let converged = residual <= f64::from(tolerance);
                (converged || self.sweeps == MAX_SWEEPS || !residual.is_finite(), converged)
            }
        };
        if done {
            return Some(Solved { sweeps: self.sweeps, residual, converged });
        }
        match self.orders {
            Orders::Count(_) => self.x.copy_from_slice(image),
            Orders::Converged { .. } => self.anderson.next(&mut self.x, image),
        }
        None
    }
}
