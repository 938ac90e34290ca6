//! What is worked out once.

use std::sync::OnceLock;

/// What `cell` holds, made outside of it where many threads make it: one that waits for the others of its pool takes up other
/// work, which may ask for the same and would wait for itself. Of what several make at a time one is kept.
pub(crate) fn once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    if let Some(known) = cell.get() {
        return known;
    }
    let made = make();
    cell.get_or_init(|| made)
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    #[test]
    fn work_that_asks_for_the_same_does_not_wait_for_itself() {
        let cell = OnceLock::new();
        let sum = || (0..1000).into_par_iter().map(|n| n % 7).sum::<u64>();
        let found: Vec<u64> = (0..64).into_par_iter().map(|_| *once(&cell, sum)).collect();
        assert_eq!(found, [once(&cell, || unreachable!()); 64].map(|n| *n));
    }
}
