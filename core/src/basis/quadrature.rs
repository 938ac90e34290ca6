//! Gauss–Legendre quadrature.

use std::f64::consts::PI;

/// Nodes and weights on [-1, 1] that integrate polynomials up to degree 2n - 1 exactly. Newton's iteration on P_n.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = -((i as f64 + 0.75) / (n as f64 + 0.5) * PI).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut below, mut this) = (1.0, x);
                for k in 1..n {
                    let k = k as f64;
                    (below, this) = (this, ((2.0 * k + 1.0) * x * this - k * below) / (k + 1.0));
                }
                slope = n as f64 * (x * this - below) / (x * x - 1.0);
                let step = this / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_exact() {
        for n in [1, 2, 3, 4, 7, 16, 64] {
            let rule = gauss_legendre(n);
            for degree in 0..2 * n {
                let exact = if degree % 2 == 0 { 2.0 / (degree as f64 + 1.0) } else { 0.0 };
                let sum: f64 = rule.iter().map(|&(x, w)| w * x.powi(degree as i32)).sum();
                assert!((sum - exact).abs() < 1e-13, "n={n} degree={degree}: {sum} {exact}");
            }
        }
    }
}
