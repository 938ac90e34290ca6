//! AVX-512: a register a packet.

#![allow(unsafe_code)]

use std::arch::x86_64::*;
use std::mem::transmute;

use super::{Floats, Ints, Masks, Part, Simd};
use crate::isa::with_features;

/// AVX-512 F, BW, DQ and VL. Only kernels that [`compiled_for`](crate::isa::compiled_for) compiles for them may name it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Avx512 {}

/// Floats as a register.
#[inline(always)]
fn f(a: Floats) -> __m512 {
    // SAFETY: both are sixteen floats.
    unsafe { transmute(a) }
}

/// Integers or masks as a register.
#[inline(always)]
fn i<T>(a: [T; 16]) -> __m512i {
    const { assert!(size_of::<T>() == 4) };
    // SAFETY: both are sixteen words of four bytes.
    unsafe { std::mem::transmute_copy(&a) }
}

/// A register as floats, integers or masks.
#[inline(always)]
fn from<R, T: Copy>(a: R) -> [T; 16] {
    const { assert!(size_of::<R>() == 64 && size_of::<T>() == 4) };
    // SAFETY: both are sixteen words of four bytes, of which any bits are a float or an integer.
    unsafe { std::mem::transmute_copy(&a) }
}

/// A bit a lane as all bits of the lane.
#[inline(always)]
fn wide(m: __mmask16) -> Masks {
    // SAFETY: the kernel is compiled for AVX-512 DQ.
    from(unsafe { _mm512_movm_epi32(m) })
}

/// The lanes of a mask whose bits are set.
#[inline(always)]
fn narrow(m: Masks) -> __mmask16 {
    // SAFETY: the kernel is compiled for AVX-512 DQ.
    unsafe { _mm512_movepi32_mask(i(m)) }
}

// SAFETY of all that follows: kernels are compiled for the set, and nothing but `one`, `two` and `halves` touches memory.
impl Simd for Avx512 {
    #[inline(always)]
    fn add(a: Floats, b: Floats) -> Floats {
        from(unsafe { _mm512_add_ps(f(a), f(b)) })
    }

    #[inline(always)]
    fn sub(a: Floats, b: Floats) -> Floats {
        from(unsafe { _mm512_sub_ps(f(a), f(b)) })
    }

    #[inline(always)]
    fn mul(a: Floats, b: Floats) -> Floats {
        from(unsafe { _mm512_mul_ps(f(a), f(b)) })
    }

    #[inline(always)]
    fn div(a: Floats, b: Floats) -> Floats {
        from(unsafe { _mm512_div_ps(f(a), f(b)) })
    }

    #[inline(always)]
    fn min(a: Floats, b: Floats) -> Floats {
        from(unsafe { _mm512_min_ps(f(a), f(b)) })
    }

    #[inline(always)]
    fn max(a: Floats, b: Floats) -> Floats {
        from(unsafe { _mm512_max_ps(f(a), f(b)) })
    }

    #[inline(always)]
    fn abs(a: Floats) -> Floats {
        from(unsafe { _mm512_abs_ps(f(a)) })
    }

    #[inline(always)]
    fn negate(a: Floats) -> Floats {
        from(unsafe { _mm512_xor_si512(i(a), _mm512_set1_epi32(i32::MIN)) })
    }

    #[inline(always)]
    fn floor(a: Floats) -> Floats {
        from(unsafe { _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(f(a)) })
    }

    #[inline(always)]
    fn ceil(a: Floats) -> Floats {
        from(unsafe { _mm512_roundscale_ps::<{ _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC }>(f(a)) })
    }

    #[inline(always)]
    fn sqrt(a: Floats) -> Floats {
        from(unsafe { _mm512_sqrt_ps(f(a)) })
    }

    #[inline(always)]
    fn less(a: Floats, b: Floats) -> Masks {
        wide(unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(f(a), f(b)) })
    }

    #[inline(always)]
    fn at_least(a: Floats, b: Floats) -> Masks {
        wide(unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(f(a), f(b)) })
    }

    #[inline(always)]
    unsafe fn to_int(a: Floats) -> Ints {
        from(unsafe { _mm512_cvttps_epi32(f(a)) })
    }

    #[inline(always)]
    fn to_float(a: Ints) -> Floats {
        from(unsafe { _mm512_cvtepi32_ps(i(a)) })
    }

    #[inline(always)]
    fn plus(a: Ints, b: Ints) -> Ints {
        from(unsafe { _mm512_add_epi32(i(a), i(b)) })
    }

    #[inline(always)]
    fn times(a: Ints, b: Ints) -> Ints {
        from(unsafe { _mm512_mullo_epi32(i(a), i(b)) })
    }

    #[inline(always)]
    fn xor(a: Ints, b: Ints) -> Ints {
        from(unsafe { _mm512_xor_si512(i(a), i(b)) })
    }

    #[inline(always)]
    fn lower<const N: u32>(a: Ints) -> Ints {
        from(unsafe { _mm512_srli_epi32::<N>(i(a)) })
    }

    #[inline(always)]
    fn below(a: Ints, b: Ints) -> Masks {
        wide(unsafe { _mm512_cmplt_epi32_mask(i(a), i(b)) })
    }

    #[inline(always)]
    fn equal(a: Ints, b: Ints) -> Masks {
        wide(unsafe { _mm512_cmpeq_epi32_mask(i(a), i(b)) })
    }

    #[inline(always)]
    fn power_of_two(n: Ints) -> Floats {
        from(unsafe { _mm512_slli_epi32::<23>(_mm512_add_epi32(i(n), _mm512_set1_epi32(127))) })
    }

    #[inline(always)]
    fn select(m: Masks, yes: Floats, no: Floats) -> Floats {
        from(unsafe { _mm512_mask_blend_ps(narrow(m), f(no), f(yes)) })
    }

    #[inline(always)]
    fn choose(m: Masks, yes: Ints, no: Ints) -> Ints {
        from(unsafe { _mm512_mask_blend_epi32(narrow(m), i(no), i(yes)) })
    }

    #[inline(always)]
    fn and(a: Masks, b: Masks) -> Masks {
        from(unsafe { _mm512_and_si512(i(a), i(b)) })
    }

    #[inline(always)]
    fn or(a: Masks, b: Masks) -> Masks {
        from(unsafe { _mm512_or_si512(i(a), i(b)) })
    }

    #[inline(always)]
    fn not(a: Masks) -> Masks {
        from(unsafe { _mm512_xor_si512(i(a), _mm512_set1_epi32(-1)) })
    }

    #[inline(always)]
    fn bits(a: Masks) -> u32 {
        narrow(a).into()
    }

    #[inline(always)]
    fn least(a: Floats) -> f32 {
        unsafe { _mm512_reduce_min_ps(f(a)) }
    }

    #[inline(always)]
    fn most(a: Floats) -> f32 {
        unsafe { _mm512_reduce_max_ps(f(a)) }
    }

    #[inline(always)]
    unsafe fn one(memory: &[f32], at: Ints) -> Floats {
        // SAFETY: the offsets are the caller's.
        from(unsafe { _mm512_i32gather_ps::<4>(i(at), memory.as_ptr()) })
    }

    #[inline(always)]
    unsafe fn two(memory: &[f32], at: Ints) -> [Floats; 2] {
        // Both floats of a lane by one load of eight bytes.
        const FIRST: [i32; 16] = [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30];
        const SECOND: [i32; 16] = [1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31];
        // SAFETY: the offsets are the caller's.
        unsafe {
            let (first, at) = (memory.as_ptr().cast(), i(at));
            let low = _mm512_i32gather_pd::<4>(_mm512_castsi512_si256(at), first);
            let high = _mm512_i32gather_pd::<4>(_mm512_extracti64x4_epi64::<1>(at), first);
            let (low, high) = (_mm512_castpd_ps(low), _mm512_castpd_ps(high));
            [from(_mm512_permutex2var_ps(low, i(FIRST), high)), from(_mm512_permutex2var_ps(low, i(SECOND), high))]
        }
    }

    #[inline(always)]
    unsafe fn halves(memory: &[f32], at: Ints) -> [Floats; 2] {
        // SAFETY: the offsets are the caller's.
        unsafe {
            let pairs = _mm512_i32gather_epi32::<2>(i(at), memory.as_ptr().cast());
            let [low, high] = [_mm512_cvtepi32_epi16(pairs), _mm512_cvtepi32_epi16(_mm512_srli_epi32::<16>(pairs))];
            [from(_mm512_cvtph_ps(low)), from(_mm512_cvtph_ps(high))]
        }
    }

    #[inline(always)]
    fn by_itself<P: Part>(part: P) -> P::Made {
        with_features! {
            avx512,
            #[inline(never)]
            fn compiled<P: Part>(part: P) -> P::Made {
                part.make()
            }
        }
        // SAFETY: the kernel is compiled for the set, so the processor has it.
        unsafe { compiled(part) }
    }

    #[inline(always)]
    fn apart(v: [[f32; 4]; 16]) -> [Floats; 4] {
        // Of eight vectors the first and second components, and the third and fourth.
        const FIRST: [i32; 16] = [0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29];
        const LAST: [i32; 16] = [2, 6, 10, 14, 18, 22, 26, 30, 3, 7, 11, 15, 19, 23, 27, 31];
        // SAFETY: both are sixty-four floats, and nothing touches memory.
        unsafe {
            let v: [__m512; 4] = transmute(v);
            let [a, b] = [_mm512_permutex2var_ps(v[0], i(FIRST), v[1]), _mm512_permutex2var_ps(v[2], i(FIRST), v[3])];
            let [c, d] = [_mm512_permutex2var_ps(v[0], i(LAST), v[1]), _mm512_permutex2var_ps(v[2], i(LAST), v[3])];
            [
                from(_mm512_shuffle_f32x4::<0x44>(a, b)),
                from(_mm512_shuffle_f32x4::<0xee>(a, b)),
                from(_mm512_shuffle_f32x4::<0x44>(c, d)),
                from(_mm512_shuffle_f32x4::<0xee>(c, d)),
            ]
        }
    }

    #[inline(always)]
    fn together(v: [Floats; 4]) -> [[f32; 4]; 16] {
        // The first four vectors of eight, and the last.
        const FIRST: [i32; 16] = [0, 8, 16, 24, 1, 9, 17, 25, 2, 10, 18, 26, 3, 11, 19, 27];
        const LAST: [i32; 16] = [4, 12, 20, 28, 5, 13, 21, 29, 6, 14, 22, 30, 7, 15, 23, 31];
        // SAFETY: as above.
        unsafe {
            let [x, y, z, w] = [f(v[0]), f(v[1]), f(v[2]), f(v[3])];
            let [a, b] = [_mm512_shuffle_f32x4::<0x44>(x, y), _mm512_shuffle_f32x4::<0x44>(z, w)];
            let [c, d] = [_mm512_shuffle_f32x4::<0xee>(x, y), _mm512_shuffle_f32x4::<0xee>(z, w)];
            transmute([
                _mm512_permutex2var_ps(a, i(FIRST), b),
                _mm512_permutex2var_ps(a, i(LAST), b),
                _mm512_permutex2var_ps(c, i(FIRST), d),
                _mm512_permutex2var_ps(c, i(LAST), d),
            ])
        }
    }
}
