//! Status codes that ocl does not know, at which it panics.

use std::cell::Cell;

use cl_sys::cl_int;

/// What stands for a code that ocl does not know: `CL_INVALID_OPERATION`.
pub const STAND_IN: i32 = -59;

thread_local! {
    static UNKNOWN: Cell<Option<cl_int>> = const { Cell::new(None) };
}

/// The code itself where ocl 0.19 knows it, else one that stands for it.
pub(crate) fn known(code: cl_int) -> cl_int {
    if matches!(code, -19..=0 | -70..=-30 | -1001..=-1000 | -9999) {
        return code;
    }
    UNKNOWN.set(Some(code));
    STAND_IN
}

/// The last code of this thread for which [`STAND_IN`] was given, once.
pub fn take_unknown() -> Option<i32> {
    UNKNOWN.take()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_that_ocl_does_not_know_are_kept_aside() {
        for code in [0, -1, -19, -30, -70, -1000, -1001, -9999] {
            assert_eq!((known(code), take_unknown()), (code, None));
        }
        for code in [1, -20, -29, -71, -72, -1002, -1093, -9998, i32::MIN, i32::MAX] {
            assert_eq!((known(code), take_unknown()), (STAND_IN, Some(code)));
        }
        assert_eq!(take_unknown(), None);
    }
}
