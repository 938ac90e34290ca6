//! How far two sets of numbers are apart.

use libtest_mimic::Failed;

/// How far found values are from expected ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// √(Σ (found - expected)² / Σ expected²); infinite where anything is not a number.
    pub relative_l2: f64,
    /// The largest difference of one value.
    pub max_abs: f64,
    /// The largest expected value.
    pub peak: f64,
    /// Where the largest difference is.
    pub worst: usize,
}

/// Compares value by value. Two infinities of one sign are equal; so are two empty sets.
pub fn compare(found: impl IntoIterator<Item = f64>, expected: impl IntoIterator<Item = f64>) -> Difference {
    let (mut error, mut norm) = (0.0f64, 0.0f64);
    let mut out = Difference { relative_l2: 0.0, max_abs: 0.0, peak: 0.0, worst: 0 };
    let (mut found, mut expected) = (found.into_iter(), expected.into_iter());
    for place in 0.. {
        let (found, expected) = match (found.next(), expected.next()) {
            (Some(found), Some(expected)) => (found, expected),
            (None, None) => break,
            // Sets of different sizes have nothing in common.
            _ => return Difference { relative_l2: f64::INFINITY, max_abs: f64::INFINITY, ..out },
        };
        if found == expected && found.is_infinite() {
            continue;
        }
        let difference = (found - expected).abs();
        let difference = if difference.is_nan() { f64::INFINITY } else { difference };
        if difference > out.max_abs {
            (out.max_abs, out.worst) = (difference, place);
        }
        out.peak = out.peak.max(expected.abs());
        error += difference * difference;
        norm += expected * expected;
    }
    out.relative_l2 = match (error, norm) {
        (0.0, _) => 0.0,
        (_, 0.0) => f64::INFINITY,
        _ => (error / norm).sqrt(),
    };
    out
}

impl Difference {
    /// Fails where the relative L2 error exceeds `relative_l2`, or the largest error `of_peak` of the largest value.
    pub(crate) fn within(&self, what: &str, relative_l2: f64, of_peak: f64) -> Result<(), Failed> {
        let Self { relative_l2: error, max_abs, peak, worst } = *self;
        // Not a number is not within.
        if error <= relative_l2 && max_abs <= of_peak * peak {
            return Ok(());
        }
        Err(format!(
            "{what}: relative L2 {error:.3e} (at most {relative_l2:.1e}), max-abs {max_abs:.3e} at value {worst} \
             (at most {of_peak:.1e} of {peak:.3e})"
        )
        .into())
    }
}

/// Fails where two buffers differ in a single bit.
pub(crate) fn same_bits(what: &str, a: &[f32], b: &[f32]) -> Result<(), Failed> {
    if a.len() != b.len() {
        return Err(format!("{what}: {} and {} values", a.len(), b.len()).into());
    }
    match a.iter().zip(b).position(|(a, b)| a.to_bits() != b.to_bits()) {
        Some(i) => {
            Err(format!("{what}: value {i} is {} ({:#x}) and {} ({:#x})", a[i], a[i].to_bits(), b[i], b[i].to_bits())
                .into())
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_seen() {
        let same = compare([1.0, f64::INFINITY], [1.0, f64::INFINITY]);
        assert_eq!((same.relative_l2, same.max_abs), (0.0, 0.0));
        let off = compare([3.0, 4.5], [3.0, 4.0]);
        assert_eq!((off.relative_l2, off.max_abs, off.worst), (0.1, 0.5, 1));
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(compare([bad], [1.0]).within("bad", 1e9, 1e9).is_err());
        }
        assert!(compare([1.0], [1.0, 2.0]).within("short", 1e9, 1e9).is_err());
        assert!(compare([1e-30], [0.0]).within("not zero", 1e9, 1e9).is_err());
        assert!(same_bits("zeros", &[0.0], &[-0.0]).is_err());
    }
}
