//! Films that tasks write side by side, a packet of pixels at a time.

#![allow(unsafe_code)]

use std::marker::PhantomData;

use crate::packet::{F, LANES};
use crate::simd::{Floats, Simd};

/// Pixels along each side of a packet.
pub(crate) const SIDE: usize = 4;

/// What is kept of sixteen pixels: the film, which holds sums between passes, and the path where rays are cut.
pub(crate) type Pixels = [[[Floats; 4]; 2]; 2];

/// Two vectors of a pixel: of the film, or of the path.
type Kept = [[f32; 4]; 2];

/// A film, and the paths of its pixels where rays are cut.
pub(crate) struct Film<'a> {
    parts: [Option<Parts<'a, Kept>>; 2],
    size: [usize; 2],
}

impl<'a> Film<'a> {
    /// Of so many pixels along x and y, in the bytes of buffers that hold as many.
    pub(crate) fn new(film: Option<&'a mut [u8]>, paths: Option<&'a mut [u8]>, size: [u32; 2]) -> Self {
        let parts = [film, paths].map(|bytes| bytes.map(|bytes| Parts::new(bytemuck::cast_slice_mut(bytes))));
        Self { parts, size: size.map(|n| n as usize) }
    }

    /// What earlier passes left of the packet whose first pixel is `corner`; zeros past the film's edge.
    ///
    /// # Safety
    /// No other task stores these pixels.
    pub(crate) unsafe fn load(&self, corner: [usize; 2]) -> Pixels {
        let mut pixels = Pixels::default();
        for (pixels, part) in pixels.iter_mut().zip(&self.parts) {
            let Some(part) = part else { continue };
            for (lane, at) in self.places(corner) {
                // SAFETY: the caller's.
                let value = unsafe { part.get(at) };
                (0..2).for_each(|half| (0..4).for_each(|c| pixels[half][c][lane] = value[half][c]));
            }
        }
        pixels
    }

    /// Stores the packet whose first pixel is `corner`; what lies past the film's edge is left out.
    ///
    /// # Safety
    /// No other task loads or stores these pixels.
    pub(crate) unsafe fn store(&self, corner: [usize; 2], pixels: &Pixels) {
        for (pixels, part) in pixels.iter().zip(&self.parts) {
            let Some(part) = part else { continue };
            let [[r, g, b, a], [x, y, z, w]] = pixels;
            for (i, at) in self.places(corner) {
                // SAFETY: the caller's.
                unsafe { part.set(at, [[r[i], g[i], b[i], a[i]], [x[i], y[i], z[i], w[i]]]) };
            }
        }
    }

    /// The lanes of a packet that lie on the film, and their pixels.
    fn places(&self, [x, y]: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
        let [width, height] = self.size;
        (0..LANES).filter_map(move |i| {
            let (x, y) = (x + i % SIDE, y + i / SIDE);
            (x < width && y < height).then_some((i, y * width + x))
        })
    }
}

/// Four packets of these lanes.
#[inline(always)]
pub(crate) fn packets<S: Simd>(lanes: &[Floats; 4]) -> [F<S>; 4] {
    [F::of(lanes[0]), F::of(lanes[1]), F::of(lanes[2]), F::of(lanes[3])]
}

/// The lanes of packets.
#[inline(always)]
pub(crate) fn lanes_of<S: Simd>([a, b]: [[F<S>; 4]; 2]) -> [[Floats; 4]; 2] {
    [[a[0].0, a[1].0, a[2].0, a[3].0], [b[0].0, b[1].0, b[2].0, b[3].0]]
}

/// A slice of which tasks read and write elements that no other task touches.
struct Parts<'a, T> {
    first: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: what is shared is only reached through functions whose callers promise that tasks keep apart.
unsafe impl<T: Send> Sync for Parts<'_, T> {}

impl<'a, T: Copy> Parts<'a, T> {
    /// The elements of a slice.
    fn new(slice: &'a mut [T]) -> Self {
        Self { first: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// Element `i`.
    ///
    /// # Safety
    /// No other task writes it.
    unsafe fn get(&self, i: usize) -> T {
        assert!(i < self.len);
        // SAFETY: it lies in the slice, which is borrowed for as long as this lives, and the caller keeps others away.
        unsafe { self.first.add(i).read() }
    }

    /// Writes element `i`.
    ///
    /// # Safety
    /// No other task reads or writes it.
    unsafe fn set(&self, i: usize, value: T) {
        assert!(i < self.len);
        // SAFETY: as above.
        unsafe { self.first.add(i).write(value) }
    }
}
