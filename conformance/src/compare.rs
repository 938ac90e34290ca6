//! How far two sets of numbers are apart.

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
            assert_eq!(compare([bad], [1.0]).relative_l2, f64::INFINITY);
        }
        assert_eq!(compare([1.0], [1.0, 2.0]).relative_l2, f64::INFINITY);
        assert_eq!(compare([1e-30], [0.0]).relative_l2, f64::INFINITY);
    }
}
