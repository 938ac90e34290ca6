//! Acceleration of a fixed-point iteration x = K(x).

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use super::vectors::{add, each, map, product};

/// Anderson's acceleration (Anderson 1965; Walker and Ni 2011): the next x is the combination of the last K(x) whose
/// residuals K(x) - x, combined with the same weights, are the least in the mean square. For a linear K it does as well as
/// GMRES over that many steps, and it needs K alone.
#[derive(Debug, Default)]
pub(super) struct Anderson {
    /// The last K(x) with their residuals, the newest at the end.
    known: VecDeque<(Vec<f32>, Vec<f32>)>,
    /// Products of the residuals with each other, in the same order.
    products: VecDeque<VecDeque<f64>>,
}

/// K(x) that are combined: more gain little in a few dozen steps, and each is kept twice.
pub(super) const DEPTH: usize = 6;

/// The share of the largest product that is added to the others' diagonal, so that residuals that are nearly alike, in
/// 32-bit floats, do not cancel: their squares are good to a few 10⁻⁷.
const RIDGE: f64 = 1e-10;

impl Anderson {
    /// Makes `x` the next one from x and `image` = K(x).
    pub(super) fn next(&mut self, x: &mut [f32], image: &[f32]) {
        // What is forgotten leaves its memory.
        let (mut kept, mut residual) = (Vec::new(), Vec::new());
        if self.known.len() == DEPTH {
            (kept, residual) = self.known.pop_front().unwrap_or_default();
            self.products.pop_front();
            for row in &mut self.products {
                row.pop_front();
            }
        }
        map(&mut residual, image, x, |y, x| y - x);
        map(&mut kept, image, x, |y, _| y);
        let mut row: VecDeque<f64> = self.known.iter().map(|(_, other)| product(other, &residual)).collect();
        self.products.iter_mut().zip(&row).for_each(|(known, &new)| known.push_back(new));
        row.push_back(product(&residual, &residual));
        self.products.push_back(row);
        self.known.push_back((kept, residual));
        let weights = self.weights();
        each(x, |_, x| x.fill(0.0));
        for ((image, _), weight) in self.known.iter().zip(weights) {
            add(x, weight as f32, image);
        }
    }

    /// Weights of sum 1 that make the combined residual least: the solution of G w = 1, scaled.
    fn weights(&self) -> Vec<f64> {
        let n = self.known.len();
        let largest = (0..n).map(|i| self.products[i][i]).fold(0.0, f64::max);
        let ridge = |i: usize, j: usize| if i == j { RIDGE * largest } else { 0.0 };
        let products = DMatrix::from_fn(n, n, |i, j| self.products[i][j] + ridge(i, j));
        let solved = products.cholesky().map(|c| c.solve(&DVector::from_element(n, 1.0)));
        let weights = solved.map(|w| &w / w.sum()).filter(|w| w.iter().all(|v| v.is_finite()));
        // Residuals that are all zero, or not numbers: the last K(x) alone.
        let last = || DVector::from_fn(n, |i, _| f64::from(u8::from(i + 1 == n)));
        weights.unwrap_or_else(last).iter().copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x = b + A x with a slow, lopsided A: plain iteration takes hundreds of steps.
    #[test]
    fn slow_iterations_become_fast() {
        let n = 40;
        let rate = |i: usize| 0.98 * (1.0 - (i as f64 / n as f64).powi(2)) as f32;
        let image = |x: &[f32]| -> Vec<f32> {
            (0..n).map(|i| 1.0 + rate(i) * (0.9 * x[i] + 0.1 * x[(i * 7 + 3) % n])).collect()
        };
        let residual = |x: &[f32], y: &[f32]| {
            let squares: f64 = x.iter().zip(y).map(|(x, y)| f64::from(y - x).powi(2)).sum();
            (squares / product(y, y)).sqrt()
        };
        let steps = |accelerated: bool| {
            let (mut x, mut anderson) = (vec![0.0; n], Anderson::default());
            for step in 1..2000 {
                let y = image(&x);
                if residual(&x, &y) < 1e-5 {
                    return step;
                }
                if accelerated {
                    anderson.next(&mut x, &y);
                } else {
                    x = y;
                }
            }
            2000
        };
        let (plain, fast) = (steps(false), steps(true));
        assert!(plain > 100 && fast * 4 < plain, "{plain} steps and {fast}");
    }

    #[test]
    fn what_rests_stays() {
        let mut anderson = Anderson::default();
        let x = vec![0.5f32; 9];
        for _ in 0..10 {
            let mut next = x.clone();
            anderson.next(&mut next, &x);
            assert_eq!(next, x);
        }
        // What is no number is not hidden.
        let mut next = vec![0.0; 9];
        anderson.next(&mut next, &[f32::NAN; 9]);
        assert!(next.iter().all(|v| v.is_nan()));
    }
}
