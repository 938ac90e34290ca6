//! What packets do, by instruction set.
//!
//! Sixteen values in a plain array become registers where the compiler sees operations on whole arrays; of loops over
//! lanes it makes what it will. So every operation is one function here, which an instruction set may give in its own
//! words. All give the same bits: nothing is contracted, and comparisons and minima treat what is not a number alike.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod sse2;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
#[cfg(target_arch = "x86_64")]
pub(crate) use sse2::Sse2 as Baseline;

use crate::held::half;
use crate::packet::{LANES, lanes};

pub(crate) type Floats = [f32; LANES];
type Ints = [i32; LANES];
/// All bits of a lane are set, or none.
type Masks = [u32; LANES];

const YES: u32 = u32::MAX;

/// A part of a kernel that stands by itself ([`Simd::by_itself`]): one that several places need and that is long. Where all is
/// one function, the time that LLVM takes for it grows faster than its length.
pub(crate) trait Part {
    /// What it makes.
    type Made;

    /// To be given with `#[inline(always)]`, as all of a kernel that is compiled for a set.
    fn make(self) -> Self::Made;
}

/// The operations of an instruction set on sixteen lanes; by default lane by lane.
pub(crate) trait Simd: Copy + Send + Sync {
    #[inline(always)]
    fn add(a: Floats, b: Floats) -> Floats {
        lanes!(i => a[i] + b[i])
    }

    #[inline(always)]
    fn sub(a: Floats, b: Floats) -> Floats {
        lanes!(i => a[i] - b[i])
    }

    #[inline(always)]
    fn mul(a: Floats, b: Floats) -> Floats {
        lanes!(i => a[i] * b[i])
    }

    #[inline(always)]
    fn div(a: Floats, b: Floats) -> Floats {
        lanes!(i => a[i] / b[i])
    }

    /// The lesser, and `b` where `a` is not a number.
    #[inline(always)]
    fn min(a: Floats, b: Floats) -> Floats {
        lanes!(i => if a[i] < b[i] { a[i] } else { b[i] })
    }

    /// The greater, and `b` where `a` is not a number.
    #[inline(always)]
    fn max(a: Floats, b: Floats) -> Floats {
        lanes!(i => if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn abs(a: Floats) -> Floats {
        lanes!(i => a[i].abs())
    }

    #[inline(always)]
    fn negate(a: Floats) -> Floats {
        lanes!(i => -a[i])
    }

    #[inline(always)]
    fn floor(a: Floats) -> Floats {
        lanes!(i => a[i].floor())
    }

    #[inline(always)]
    fn ceil(a: Floats) -> Floats {
        lanes!(i => a[i].ceil())
    }

    #[inline(always)]
    fn sqrt(a: Floats) -> Floats {
        lanes!(i => a[i].sqrt())
    }

    #[inline(always)]
    fn less(a: Floats, b: Floats) -> Masks {
        lanes!(i => if a[i] < b[i] { YES } else { 0 })
    }

    #[inline(always)]
    fn at_least(a: Floats, b: Floats) -> Masks {
        lanes!(i => if a[i] >= b[i] { YES } else { 0 })
    }

    /// The integers that the lanes hold.
    ///
    /// # Safety
    /// All lie in the range of `i32`.
    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn to_int(a: Floats) -> Ints {
        // SAFETY: the caller's.
        lanes!(i => unsafe { a[i].to_int_unchecked::<i32>() })
    }

    #[inline(always)]
    fn to_float(a: Ints) -> Floats {
        lanes!(i => a[i] as f32)
    }

    #[inline(always)]
    fn plus(a: Ints, b: Ints) -> Ints {
        lanes!(i => a[i].wrapping_add(b[i]))
    }

    #[inline(always)]
    fn times(a: Ints, b: Ints) -> Ints {
        lanes!(i => a[i].wrapping_mul(b[i]))
    }

    #[inline(always)]
    fn xor(a: Ints, b: Ints) -> Ints {
        lanes!(i => a[i] ^ b[i])
    }

    /// The bits of each lane `N` places lower, with zeros above.
    #[inline(always)]
    fn lower<const N: u32>(a: Ints) -> Ints {
        lanes!(i => (a[i] as u32 >> N) as i32)
    }

    #[inline(always)]
    fn below(a: Ints, b: Ints) -> Masks {
        lanes!(i => if a[i] < b[i] { YES } else { 0 })
    }

    #[inline(always)]
    fn equal(a: Ints, b: Ints) -> Masks {
        lanes!(i => if a[i] == b[i] { YES } else { 0 })
    }

    /// 2^n for n from -126 to 127.
    #[inline(always)]
    fn power_of_two(n: Ints) -> Floats {
        lanes!(i => f32::from_bits(((n[i] + 127) as u32) << 23))
    }

    #[inline(always)]
    fn select(m: Masks, yes: Floats, no: Floats) -> Floats {
        lanes!(i => f32::from_bits(m[i] & yes[i].to_bits() | !m[i] & no[i].to_bits()))
    }

    #[inline(always)]
    fn choose(m: Masks, yes: Ints, no: Ints) -> Ints {
        lanes!(i => (m[i] & yes[i] as u32 | !m[i] & no[i] as u32) as i32)
    }

    #[inline(always)]
    fn and(a: Masks, b: Masks) -> Masks {
        lanes!(i => a[i] & b[i])
    }

    #[inline(always)]
    fn or(a: Masks, b: Masks) -> Masks {
        lanes!(i => a[i] | b[i])
    }

    #[inline(always)]
    fn not(a: Masks) -> Masks {
        lanes!(i => !a[i])
    }

    /// A bit for each lane, the first one lowest.
    #[inline(always)]
    fn bits(a: Masks) -> u32 {
        let mut bits = 0;
        for i in 0..LANES {
            bits |= (a[i] & 1) << i;
        }
        bits
    }

    #[inline(always)]
    fn least(a: Floats) -> f32 {
        let mut least = a[0];
        for v in a {
            least = if v < least { v } else { least };
        }
        least
    }

    #[inline(always)]
    fn most(a: Floats) -> f32 {
        let mut most = a[0];
        for v in a {
            most = if v > most { v } else { most };
        }
        most
    }

    /// The float at each offset.
    ///
    /// # Safety
    /// Every offset lies within `from`.
    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn one(from: &[f32], at: Ints) -> Floats {
        // SAFETY: the caller's.
        lanes!(i => unsafe { *from.get_unchecked(at[i] as usize) })
    }

    /// The float at each offset and the one behind it.
    ///
    /// # Safety
    /// Every offset and the one behind it lie within `from`.
    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn two(from: &[f32], at: Ints) -> [Floats; 2] {
        // SAFETY: the caller's; the bytes need no alignment. Eight bytes at a time are half the loads.
        let pairs: [[f32; 2]; LANES] = lanes!(i => unsafe {
            from.as_ptr().add(at[i] as usize).cast::<[f32; 2]>().read_unaligned()
        });
        [lanes!(i => pairs[i][0]), lanes!(i => pairs[i][1])]
    }

    /// The half at each offset and the one behind it, in the bits of floats that hold two each; offsets count halves. Halves
    /// that are not numbers give anything.
    ///
    /// # Safety
    /// Every offset and the one behind it lie within `from`.
    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn halves(from: &[f32], at: Ints) -> [Floats; 2] {
        // SAFETY: the caller's; the bytes need no alignment.
        let pairs: [[u16; 2]; LANES] = lanes!(i => unsafe {
            from.as_ptr().cast::<u16>().add(at[i] as usize).cast::<[u16; 2]>().read_unaligned()
        });
        [lanes!(i => half(pairs[i][0])), lanes!(i => half(pairs[i][1]))]
    }

    /// Makes a part of a kernel in a function of its own, compiled for the set.
    #[inline(never)]
    fn by_itself<P: Part>(part: P) -> P::Made {
        part.make()
    }

    /// The components of vectors, sixteen of each.
    #[inline(always)]
    fn apart(v: [[f32; 4]; LANES]) -> [Floats; 4] {
        [lanes!(i => v[i][0]), lanes!(i => v[i][1]), lanes!(i => v[i][2]), lanes!(i => v[i][3])]
    }

    /// The vectors of which these are the components.
    #[inline(always)]
    fn together(v: [Floats; 4]) -> [[f32; 4]; LANES] {
        lanes!(i => [v[0][i], v[1][i], v[2][i], v[3][i]])
    }
}

/// Lane by lane: for packets of which one lane counts, and for other processors.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Portable {}

impl Simd for Portable {}

#[cfg(not(target_arch = "x86_64"))]
pub(crate) use Portable as Baseline;

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use crate::Isa;
    use crate::isa::compiled_for;

    /// Results of every operation, as bits.
    #[inline(always)]
    #[allow(unsafe_code)]
    fn all<S: Simd>(a: Floats, b: Floats, out: &mut Vec<u32>) {
        let n = lanes!(i => (i as i32 - 7) * 5);
        let m = lanes!(i => (i as i32 * 7) % 16);
        let memory: Vec<f32> = (0..17).map(|i| i as f32 * 1.5 - 3.0).collect();
        // Zero, subnormal halves, and normal ones of both signs.
        let halves: Vec<f32> = (0..9).map(|i| f32::from_bits(0x0a5f_0000 * i + 0x0003 * i)).collect();
        let less = S::less(a, b);
        for floats in [
            S::add(a, b),
            S::sub(a, b),
            S::mul(a, b),
            S::div(a, b),
            S::min(a, b),
            S::max(a, b),
            S::abs(a),
            S::negate(a),
            S::floor(a),
            S::ceil(a),
            S::sqrt(S::abs(a)),
            S::to_float(n),
            S::power_of_two(n),
            S::select(less, a, b),
        ] {
            out.extend(floats.map(f32::to_bits));
        }
        for masks in [less, S::at_least(a, b), S::below(n, m), S::equal(n, m), S::not(less)] {
            out.extend(masks);
        }
        out.extend(S::and(less, S::below(n, m)));
        out.extend(S::or(less, S::equal(n, m)));
        for ints in [S::plus(n, m), S::times(n, m), S::xor(n, m), S::lower::<3>(n), S::choose(less, n, m)] {
            out.extend(ints.map(|n| n as u32));
        }
        let finite = lanes!(i => if a[i].is_finite() { a[i] } else { 0.5 });
        // SAFETY: the values are small, and the offsets below 16 of 17 floats.
        unsafe {
            out.extend(S::to_int(finite).map(|n| n as u32));
            out.extend(S::one(&memory, m).map(f32::to_bits));
            out.extend(S::two(&memory, m).concat().iter().map(|v| v.to_bits()));
            out.extend(S::halves(&halves, m).concat().iter().map(|v| v.to_bits()));
        }
        let vectors = lanes!(i => [a[i], b[i], a[i] + 1.0, n[i] as f32]);
        out.extend(S::apart(vectors).concat().iter().map(|v| v.to_bits()));
        out.extend(S::together([a, b, finite, S::to_float(n)]).concat().iter().map(|v| v.to_bits()));
        out.extend([S::bits(less), S::least(finite).to_bits(), S::most(finite).to_bits()]);
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let odd = [
            0.0,
            -0.0,
            1.5,
            -2.5,
            f32::INFINITY,
            f32::NEG_INFINITY,
            3e-39,
            1e9,
            -7.25,
            0.1,
            2.0,
            -1e-3,
            5.5,
            6.0,
            0.5,
            1.0,
        ];
        let mut turned = odd;
        turned.rotate_left(5);
        let mut same = Vec::new();
        all::<Portable>(odd, turned, &mut same);
        for isa in Isa::available() {
            let mut found = Vec::new();
            let to = &mut found;
            compiled_for!(isa, all<S>(odd: Floats, turned: Floats, to: &mut Vec<u32>));
            assert_eq!(found, same, "{isa:?}");
        }
    }
}
