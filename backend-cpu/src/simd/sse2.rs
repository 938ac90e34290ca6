//! SSE2, which every processor of x86-64 has: four registers a packet.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::{Floats, Ints, Masks, Simd};

/// SSE2. What it has no instruction for goes lane by lane.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Sse2 {}

/// Floats as registers.
#[inline(always)]
fn f(a: Floats) -> [__m128; 4] {
    // SAFETY: both are sixteen floats.
    unsafe { std::mem::transmute(a) }
}

/// Integers or masks as registers.
#[inline(always)]
fn i<T>(a: [T; 16]) -> [__m128i; 4] {
    const { assert!(size_of::<T>() == 4) };
    // SAFETY: both are sixteen words of four bytes.
    unsafe { std::mem::transmute_copy(&a) }
}

/// Registers as floats, integers or masks.
#[inline(always)]
fn from<R, T: Copy>(all: [R; 4]) -> [T; 16] {
    const { assert!(size_of::<R>() == 16 && size_of::<T>() == 4) };
    // SAFETY: both are sixteen words of four bytes, of which any bits are a float or an integer.
    unsafe { std::mem::transmute_copy(&all) }
}

/// The same of all four registers.
macro_rules! quarters {
    ($operation:expr, $a:expr) => {{
        let [a, b, c, d] = $a;
        // SAFETY: every processor has the set, and the operation touches no memory.
        from(unsafe { [$operation(a), $operation(b), $operation(c), $operation(d)] })
    }};
    ($operation:expr, $a:expr, $b:expr) => {{
        let ([a, b, c, d], [e, f, g, h]) = ($a, $b);
        // SAFETY: as above.
        from(unsafe { [$operation(a, e), $operation(b, f), $operation(c, g), $operation(d, h)] })
    }};
}

impl Simd for Sse2 {
    #[inline(always)]
    fn add(a: Floats, b: Floats) -> Floats {
        quarters!(_mm_add_ps, f(a), f(b))
    }

    #[inline(always)]
    fn sub(a: Floats, b: Floats) -> Floats {
        quarters!(_mm_sub_ps, f(a), f(b))
    }

    #[inline(always)]
    fn mul(a: Floats, b: Floats) -> Floats {
        quarters!(_mm_mul_ps, f(a), f(b))
    }

    #[inline(always)]
    fn div(a: Floats, b: Floats) -> Floats {
        quarters!(_mm_div_ps, f(a), f(b))
    }

    #[inline(always)]
    fn min(a: Floats, b: Floats) -> Floats {
        quarters!(_mm_min_ps, f(a), f(b))
    }

    #[inline(always)]
    fn max(a: Floats, b: Floats) -> Floats {
        quarters!(_mm_max_ps, f(a), f(b))
    }

    #[inline(always)]
    fn abs(a: Floats) -> Floats {
        quarters!(_mm_andnot_ps, f([-0.0; 16]), f(a))
    }

    #[inline(always)]
    fn negate(a: Floats) -> Floats {
        quarters!(_mm_xor_ps, f(a), f([-0.0; 16]))
    }

    #[inline(always)]
    fn sqrt(a: Floats) -> Floats {
        quarters!(_mm_sqrt_ps, f(a))
    }

    #[inline(always)]
    fn less(a: Floats, b: Floats) -> Masks {
        quarters!(_mm_cmplt_ps, f(a), f(b))
    }

    #[inline(always)]
    fn at_least(a: Floats, b: Floats) -> Masks {
        quarters!(_mm_cmpge_ps, f(a), f(b))
    }

    #[inline(always)]
    unsafe fn to_int(a: Floats) -> Ints {
        quarters!(_mm_cvttps_epi32, f(a))
    }

    #[inline(always)]
    fn to_float(a: Ints) -> Floats {
        quarters!(_mm_cvtepi32_ps, i(a))
    }

    #[inline(always)]
    fn plus(a: Ints, b: Ints) -> Ints {
        quarters!(_mm_add_epi32, i(a), i(b))
    }

    #[inline(always)]
    fn below(a: Ints, b: Ints) -> Masks {
        quarters!(_mm_cmplt_epi32, i(a), i(b))
    }

    #[inline(always)]
    fn equal(a: Ints, b: Ints) -> Masks {
        quarters!(_mm_cmpeq_epi32, i(a), i(b))
    }

    #[inline(always)]
    fn power_of_two(n: Ints) -> Floats {
        quarters!(_mm_slli_epi32::<23>, i(Self::plus(n, [127; 16])))
    }

    #[inline(always)]
    fn select(m: Masks, yes: Floats, no: Floats) -> Floats {
        let yes: Masks = quarters!(_mm_and_si128, i(m), i(yes));
        let no: Masks = quarters!(_mm_andnot_si128, i(m), i(no));
        quarters!(_mm_or_si128, i(yes), i(no))
    }

    #[inline(always)]
    fn choose(m: Masks, yes: Ints, no: Ints) -> Ints {
        let yes: Masks = quarters!(_mm_and_si128, i(m), i(yes));
        let no: Masks = quarters!(_mm_andnot_si128, i(m), i(no));
        quarters!(_mm_or_si128, i(yes), i(no))
    }

    #[inline(always)]
    fn and(a: Masks, b: Masks) -> Masks {
        quarters!(_mm_and_si128, i(a), i(b))
    }

    #[inline(always)]
    fn or(a: Masks, b: Masks) -> Masks {
        quarters!(_mm_or_si128, i(a), i(b))
    }

    #[inline(always)]
    fn not(a: Masks) -> Masks {
        quarters!(_mm_xor_si128, i(a), i([u32::MAX; 16]))
    }

    #[inline(always)]
    fn bits(a: Masks) -> u32 {
        let [a, b, c, d] = i(a);
        // SAFETY: every processor has the set.
        let bits = unsafe {
            [_mm_castsi128_ps(a), _mm_castsi128_ps(b), _mm_castsi128_ps(c), _mm_castsi128_ps(d)]
                .map(|part| _mm_movemask_ps(part) as u32)
        };
        bits[0] | bits[1] << 4 | bits[2] << 8 | bits[3] << 12
    }
}
