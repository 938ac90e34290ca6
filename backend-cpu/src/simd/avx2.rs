//! AVX2: two registers a packet.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::{Floats, Ints, Masks, Part, Simd};
use crate::isa::with_features;

/// AVX2. Only kernels that [`compiled_for`](crate::isa::compiled_for) compiles for it may name it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Avx2 {}

/// Floats as registers.
#[inline(always)]
fn f(a: Floats) -> [__m256; 2] {
    // SAFETY: both are sixteen floats.
    unsafe { std::mem::transmute(a) }
}

/// Integers or masks as registers.
#[inline(always)]
fn i<T>(a: [T; 16]) -> [__m256i; 2] {
    const { assert!(size_of::<T>() == 4) };
    // SAFETY: both are sixteen words of four bytes.
    unsafe { std::mem::transmute_copy(&a) }
}

/// Registers as floats, integers or masks.
#[inline(always)]
fn from<R, T: Copy>(low: R, high: R) -> [T; 16] {
    const { assert!(size_of::<R>() == 32 && size_of::<T>() == 4) };
    // SAFETY: both are sixteen words of four bytes, of which any bits are a float or an integer.
    unsafe { std::mem::transmute_copy(&[low, high]) }
}

/// The same of both halves.
macro_rules! halves {
    ($operation:expr, $a:expr) => {{
        let [a, b] = $a;
        // SAFETY: the kernel is compiled for the set, and the operation touches no memory.
        unsafe { from($operation(a), $operation(b)) }
    }};
    ($operation:expr, $a:expr, $b:expr) => {{
        let ([a, b], [c, d]) = ($a, $b);
        // SAFETY: as above.
        unsafe { from($operation(a, c), $operation(b, d)) }
    }};
    ($operation:expr, $a:expr, $b:expr, $c:expr) => {{
        let ([a, b], [c, d], [e, g]) = ($a, $b, $c);
        // SAFETY: as above.
        unsafe { from($operation(a, c, e), $operation(b, d, g)) }
    }};
}

impl Simd for Avx2 {
    #[inline(always)]
    fn add(a: Floats, b: Floats) -> Floats {
        halves!(_mm256_add_ps, f(a), f(b))
    }

    #[inline(always)]
    fn sub(a: Floats, b: Floats) -> Floats {
        halves!(_mm256_sub_ps, f(a), f(b))
    }

    #[inline(always)]
    fn mul(a: Floats, b: Floats) -> Floats {
        halves!(_mm256_mul_ps, f(a), f(b))
    }

    #[inline(always)]
    fn div(a: Floats, b: Floats) -> Floats {
        halves!(_mm256_div_ps, f(a), f(b))
    }

    #[inline(always)]
    fn min(a: Floats, b: Floats) -> Floats {
        halves!(_mm256_min_ps, f(a), f(b))
    }

    #[inline(always)]
    fn max(a: Floats, b: Floats) -> Floats {
        halves!(_mm256_max_ps, f(a), f(b))
    }

    #[inline(always)]
    fn abs(a: Floats) -> Floats {
        halves!(_mm256_andnot_ps, f([-0.0; 16]), f(a))
    }

    #[inline(always)]
    fn negate(a: Floats) -> Floats {
        halves!(_mm256_xor_ps, f(a), f([-0.0; 16]))
    }

    #[inline(always)]
    fn floor(a: Floats) -> Floats {
        halves!(_mm256_floor_ps, f(a))
    }

    #[inline(always)]
    fn ceil(a: Floats) -> Floats {
        halves!(_mm256_ceil_ps, f(a))
    }

    #[inline(always)]
    fn sqrt(a: Floats) -> Floats {
        halves!(_mm256_sqrt_ps, f(a))
    }

    #[inline(always)]
    fn less(a: Floats, b: Floats) -> Masks {
        halves!(_mm256_cmp_ps::<_CMP_LT_OQ>, f(a), f(b))
    }

    #[inline(always)]
    fn at_least(a: Floats, b: Floats) -> Masks {
        halves!(_mm256_cmp_ps::<_CMP_GE_OQ>, f(a), f(b))
    }

    #[inline(always)]
    unsafe fn to_int(a: Floats) -> Ints {
        halves!(_mm256_cvttps_epi32, f(a))
    }

    #[inline(always)]
    fn to_float(a: Ints) -> Floats {
        halves!(_mm256_cvtepi32_ps, i(a))
    }

    #[inline(always)]
    fn plus(a: Ints, b: Ints) -> Ints {
        halves!(_mm256_add_epi32, i(a), i(b))
    }

    #[inline(always)]
    fn times(a: Ints, b: Ints) -> Ints {
        halves!(_mm256_mullo_epi32, i(a), i(b))
    }

    #[inline(always)]
    fn xor(a: Ints, b: Ints) -> Ints {
        halves!(_mm256_xor_si256, i(a), i(b))
    }

    #[inline(always)]
    fn lower<const N: u32>(a: Ints) -> Ints {
        halves!(_mm256_srlv_epi32, i(a), i([N; 16]))
    }

    #[inline(always)]
    fn below(a: Ints, b: Ints) -> Masks {
        halves!(_mm256_cmpgt_epi32, i(b), i(a))
    }

    #[inline(always)]
    fn equal(a: Ints, b: Ints) -> Masks {
        halves!(_mm256_cmpeq_epi32, i(a), i(b))
    }

    #[inline(always)]
    fn power_of_two(n: Ints) -> Floats {
        halves!(_mm256_slli_epi32::<23>, i(Self::plus(n, [127; 16])))
    }

    #[inline(always)]
    fn select(m: Masks, yes: Floats, no: Floats) -> Floats {
        halves!(_mm256_blendv_ps, f(no), f(yes), f(from_ints(m)))
    }

    #[inline(always)]
    fn choose(m: Masks, yes: Ints, no: Ints) -> Ints {
        halves!(_mm256_blendv_epi8, i(no), i(yes), i(m))
    }

    #[inline(always)]
    fn and(a: Masks, b: Masks) -> Masks {
        halves!(_mm256_and_si256, i(a), i(b))
    }

    #[inline(always)]
    fn or(a: Masks, b: Masks) -> Masks {
        halves!(_mm256_or_si256, i(a), i(b))
    }

    #[inline(always)]
    fn not(a: Masks) -> Masks {
        halves!(_mm256_xor_si256, i(a), i([u32::MAX; 16]))
    }

    #[inline(always)]
    unsafe fn two(memory: &[f32], at: Ints) -> [Floats; 2] {
        let [first, last] = i(at);
        // SAFETY: the offsets are the caller's.
        let [[a, b], [c, d]] = unsafe { [eight_pairs(memory, first), eight_pairs(memory, last)] };
        [from(a, c), from(b, d)]
    }

    #[inline(always)]
    unsafe fn halves(memory: &[f32], at: Ints) -> [Floats; 2] {
        // Eight pairs: the first of each, and the second.
        let eight = |at: __m256i| {
            // SAFETY: the kernel is compiled for AVX2 and F16C, and the offsets are the caller's.
            unsafe {
                let pairs = _mm256_i32gather_epi32::<2>(memory.as_ptr().cast(), at);
                let [low, high] = [_mm256_and_si256(pairs, _mm256_set1_epi32(0xffff)), _mm256_srli_epi32::<16>(pairs)];
                let sorted = _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_packus_epi32(low, high));
                let [low, high] = [_mm256_castsi256_si128(sorted), _mm256_extracti128_si256::<1>(sorted)];
                [_mm256_cvtph_ps(low), _mm256_cvtph_ps(high)]
            }
        };
        let [first, last] = i(at);
        let ([a, b], [c, d]) = (eight(first), eight(last));
        [from(a, c), from(b, d)]
    }

    #[inline(always)]
    fn bits(a: Masks) -> u32 {
        let [low, high] = f(from_ints(a));
        // SAFETY: the kernel is compiled for the set.
        let [low, high] = unsafe { [_mm256_movemask_ps(low), _mm256_movemask_ps(high)] };
        (low | high << 8) as u32
    }

    #[inline(always)]
    fn by_itself<P: Part>(part: P) -> P::Made {
        with_features! {
            avx2,
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
        // SAFETY: both are sixty-four floats.
        let v: [__m256; 8] = unsafe { std::mem::transmute(v) };
        let (a, b) = (eight_apart([v[0], v[1], v[2], v[3]]), eight_apart([v[4], v[5], v[6], v[7]]));
        [from(a[0], b[0]), from(a[1], b[1]), from(a[2], b[2]), from(a[3], b[3])]
    }

    #[inline(always)]
    fn together(v: [Floats; 4]) -> [[f32; 4]; 16] {
        let [x, y, z, w] = [f(v[0]), f(v[1]), f(v[2]), f(v[3])];
        // SAFETY: both are sixty-four floats.
        unsafe {
            std::mem::transmute([eight_together([x[0], y[0], z[0], w[0]]), eight_together([x[1], y[1], z[1], w[1]])])
        }
    }
}

/// The floats at eight offsets that are not negative, and those behind them, by one load of eight bytes each: this set's gathers take up
/// to twice as long, and of a loop over lanes the compiler makes two loads.
///
/// # Safety
/// Every offset and the one behind it lie within `memory`.
#[inline(always)]
unsafe fn eight_pairs(memory: &[f32], at: __m256i) -> [__m256; 2] {
    // Without closures: one that is not inlined is compiled for the baseline.
    // SAFETY: kernels are compiled for the set, and the offsets are the caller's.
    unsafe {
        let [low, high] = [_mm256_castsi256_si128(at), _mm256_extracti128_si256::<1>(at)];
        let [a, b] = [_mm_cvtsi128_si64(low), _mm_extract_epi64::<1>(low)];
        let [c, d] = [_mm_cvtsi128_si64(high), _mm_extract_epi64::<1>(high)];
        let left = _mm256_set_m128(two_pairs(memory, c), two_pairs(memory, a));
        let right = _mm256_set_m128(two_pairs(memory, d), two_pairs(memory, b));
        [_mm256_shuffle_ps::<0x88>(left, right), _mm256_shuffle_ps::<0xdd>(left, right)]
    }
}

/// The same at the two offsets of a word, pair by pair.
///
/// # Safety
/// As there.
#[inline(always)]
unsafe fn two_pairs(memory: &[f32], offsets: i64) -> __m128 {
    let memory = memory.as_ptr();
    let [a, b] = [offsets as u32 as usize, (offsets as u64 >> 32) as usize];
    // SAFETY: kernels are compiled for the set, and the offsets are the caller's; the bytes need no alignment.
    unsafe { _mm_castpd_ps(_mm_loadh_pd(_mm_load_sd(memory.add(a).cast()), memory.add(b).cast())) }
}

/// The components of eight vectors.
#[inline(always)]
fn eight_apart(v: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: kernels are compiled for the set, and nothing touches memory.
    unsafe {
        // Those that are four apart side by side.
        let [a, c] = [_mm256_permute2f128_ps::<0x20>(v[0], v[2]), _mm256_permute2f128_ps::<0x20>(v[1], v[3])];
        let [b, d] = [_mm256_permute2f128_ps::<0x31>(v[0], v[2]), _mm256_permute2f128_ps::<0x31>(v[1], v[3])];
        turned([a, b, c, d])
    }
}

/// The vectors of eight of each component.
#[inline(always)]
fn eight_together(v: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: as above.
    unsafe {
        let [a, b, c, d] = turned(v);
        [
            _mm256_permute2f128_ps::<0x20>(a, b),
            _mm256_permute2f128_ps::<0x20>(c, d),
            _mm256_permute2f128_ps::<0x31>(a, b),
            _mm256_permute2f128_ps::<0x31>(c, d),
        ]
    }
}

/// Four rows of four as columns, in both halves.
#[inline(always)]
fn turned([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: as above.
    unsafe {
        let [ab, cd] = [_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d)];
        let [ef, gh] = [_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d)];
        [
            _mm256_shuffle_ps::<0x44>(ab, cd),
            _mm256_shuffle_ps::<0xee>(ab, cd),
            _mm256_shuffle_ps::<0x44>(ef, gh),
            _mm256_shuffle_ps::<0xee>(ef, gh),
        ]
    }
}

/// Bits as floats.
#[inline(always)]
fn from_ints(a: Masks) -> Floats {
    // SAFETY: both are sixteen words of four bytes.
    unsafe { std::mem::transmute(a) }
}
