//! Memory that tasks write side by side.

#![allow(unsafe_code)]

use std::marker::PhantomData;

/// A slice of which tasks read and write elements that no other task touches.
pub(crate) struct Parts<'a, T> {
    first: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: what is shared is only reached through functions whose callers promise that tasks keep apart.
unsafe impl<T: Send> Sync for Parts<'_, T> {}

impl<'a, T: Copy> Parts<'a, T> {
    /// The elements of a slice.
    pub(crate) fn new(slice: &'a mut [T]) -> Self {
        Self { first: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// Element `i`.
    ///
    /// # Safety
    /// No other task writes it.
    pub(crate) unsafe fn get(&self, i: usize) -> T {
        assert!(i < self.len);
        // SAFETY: it lies in the slice, which is borrowed for as long as this lives, and the caller keeps others away.
        unsafe { self.first.add(i).read() }
    }

    /// Writes element `i`.
    ///
    /// # Safety
    /// No other task reads or writes it.
    pub(crate) unsafe fn set(&self, i: usize, value: T) {
        assert!(i < self.len);
        // SAFETY: as above.
        unsafe { self.first.add(i).write(value) }
    }
}
