//! Sixteen lanes side by side, by the operations of an instruction set.

use std::marker::PhantomData;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::simd::Simd;

/// Lanes of a packet.
pub(crate) const LANES: usize = 16;

/// Sixteen floats.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct F<S>(pub(crate) [f32; LANES], PhantomData<S>);

/// Sixteen integers.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct I<S>(pub(crate) [i32; LANES], PhantomData<S>);

/// Sixteen truths: all bits set, or none.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct M<S>(pub(crate) [u32; LANES], PhantomData<S>);

macro_rules! lanes {
    ($i:ident => $value:expr) => {{
        let mut out = [Default::default(); LANES];
        let mut $i = 0;
        while $i < LANES {
            out[$i] = $value;
            $i += 1;
        }
        out
    }};
}
pub(crate) use lanes;

/// The same expression for axes or channels 0, 1 and 2. Closures given to `array::map` are not always inlined, and
/// then run without the caller's instruction set.
macro_rules! triple {
    ($a:ident => $value:expr) => {
        [
            {
                let $a = 0usize;
                $value
            },
            {
                let $a = 1usize;
                $value
            },
            {
                let $a = 2usize;
                $value
            },
        ]
    };
}
pub(crate) use triple;

/// The same expression for each of `N` packets, which start as a value.
macro_rules! each {
    ($n:ident in $count:expr, $start:expr => $value:expr) => {{
        let mut out = [$start; $count];
        let mut $n = 0;
        while $n < $count {
            out[$n] = $value;
            $n += 1;
        }
        out
    }};
}
pub(crate) use each;

macro_rules! operator {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<S: Simd> $trait for F<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self::of(S::$operation(self.0, other.0))
            }
        }

        impl<S: Simd> $trait<f32> for F<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                Self::of(S::$operation(self.0, [other; LANES]))
            }
        }
    };
}
operator!(Add, add, add);
operator!(Sub, sub, sub);
operator!(Mul, mul, mul);
operator!(Div, div, div);

impl<S: Simd> Neg for F<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::of(S::negate(self.0))
    }
}

impl<S: Simd> F<S> {
    pub(crate) const ZERO: Self = Self([0.0; LANES], PhantomData);
    pub(crate) const ONE: Self = Self([1.0; LANES], PhantomData);

    /// A packet of these lanes.
    #[inline(always)]
    pub(crate) fn of(lanes: [f32; LANES]) -> Self {
        Self(lanes, PhantomData)
    }

    #[inline(always)]
    pub(crate) fn splat(v: f32) -> Self {
        Self::of([v; LANES])
    }

    /// The lesser, and `other` where `self` is not a number.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self::of(S::min(self.0, other.0))
    }

    /// The greater, and `other` where `self` is not a number.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self::of(S::max(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self::of(S::abs(self.0))
    }

    #[inline(always)]
    pub(crate) fn floor(self) -> Self {
        Self::of(S::floor(self.0))
    }

    #[inline(always)]
    pub(crate) fn ceil(self) -> Self {
        Self::of(S::ceil(self.0))
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self::of(S::sqrt(self.0))
    }

    #[inline(always)]
    pub(crate) fn lt(self, other: Self) -> M<S> {
        M::of(S::less(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn ge(self, other: Self) -> M<S> {
        M::of(S::at_least(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn gt(self, other: Self) -> M<S> {
        other.lt(self)
    }

    /// The lanes, with what is nearer to zero than 1e-20 replaced by 1e-20: far enough to divide by.
    #[inline(always)]
    pub(crate) fn away_from_zero(self) -> Self {
        let near = Self::splat(1e-20);
        self.abs().lt(near).select(near, self)
    }

    #[inline(always)]
    pub(crate) fn min_lane(self) -> f32 {
        S::least(self.0)
    }

    #[inline(always)]
    pub(crate) fn max_lane(self) -> f32 {
        S::most(self.0)
    }

    /// The sum of all lanes: halves of them are added, then quarters and so on.
    #[inline(always)]
    pub(crate) fn total(self) -> f32 {
        let mut sums = self.0;
        let mut count = LANES / 2;
        while count > 0 {
            for i in 0..count {
                sums[i] += sums[i + count];
            }
            count /= 2;
        }
        sums[0]
    }

    /// The integers that the lanes hold; all must lie in the range of `i32`.
    #[inline(always)]
    pub(crate) fn to_int(self) -> I<S> {
        // SAFETY: callers pass lanes that `min` and `max` put between two representable integers; both replace what
        // is not a number.
        #[allow(unsafe_code)]
        I::of(unsafe { S::to_int(self.0) })
    }

    /// The bits of the lanes.
    #[inline(always)]
    pub(crate) fn bits(self) -> I<S> {
        I::of(lanes!(i => self.0[i].to_bits() as i32))
    }

    /// e^x for x ≤ 0, to two units in the last place; e^-87 and below is about 1e-38.
    #[inline(always)]
    pub(crate) fn exp_negative(self) -> Self {
        let [(n, rest)] = decay_parts([-self.max(Self::splat(-87.0))]);
        let [lost] = lost([rest]);
        n - n * lost
    }
}

/// 2ⁿ and the rest r of e^-x = 2ⁿ e^-r, for x from 0 to 87, of several packets.
#[inline(always)]
pub(crate) fn decay_parts<S: Simd, const N: usize>(x: [F<S>; N]) -> [(F<S>, F<S>); N] {
    const LOG2_E: f32 = std::f32::consts::LOG2_E;
    // ln 2 in two parts, the first exact in few bits so that n · first is exact.
    const LN2_HI: f32 = 0.693_359_4;
    const LN2_LO: f32 = -2.121_944_4e-4;
    /// 1.5 times 2²³: a sum with it is rounded to an integer, which is its last bits.
    const ROUND: f32 = 12_582_912.0;
    let shifted = each!(i in N, F::ZERO => x[i] * -LOG2_E + ROUND);
    let n = each!(i in N, F::ZERO => shifted[i] - ROUND);
    let rest = each!(i in N, F::ZERO => n[i] * LN2_HI + x[i] + n[i] * LN2_LO);
    each!(i in N, (F::ZERO, F::ZERO) => (F::of(S::power_of_two(shifted[i].bits().0)), rest[i]))
}

/// 1 - e^-x for |x| ≤ ln 2 / 2, of several packets.
#[inline(always)]
pub(crate) fn lost<S: Simd, const N: usize>(x: [F<S>; N]) -> [F<S>; N] {
    let bent = curvature(x);
    each!(i in N, F::ZERO => x[i] - x[i] * x[i] * bent[i])
}

/// b of 1 - e^-x = x - x² b for |x| ≤ ln 2 / 2, of several packets.
#[inline(always)]
pub(crate) fn curvature<S: Simd, const N: usize>(x: [F<S>; N]) -> [F<S>; N] {
    // x - x²/2 + … - c x⁶ whose largest error relative to e^-x is the least, 4e-9. In pairs, which wait less for each other.
    let square = each!(i in N, F::ZERO => x[i] * x[i]);
    let first = each!(i in N, F::ZERO => F::splat(0.5) - x[i] * 0.166_665_35);
    let second = each!(i in N, F::ZERO => F::splat(0.041_667_238) - x[i] * 0.008_367_497);
    let upper = each!(i in N, F::ZERO => second[i] + square[i] * 0.001_386_377_1);
    each!(i in N, F::ZERO => first[i] + square[i] * upper[i])
}

impl<S: Simd> I<S> {
    pub(crate) const ZERO: Self = Self([0; LANES], PhantomData);

    /// A packet of these lanes.
    #[inline(always)]
    pub(crate) fn of(lanes: [i32; LANES]) -> Self {
        Self(lanes, PhantomData)
    }

    #[inline(always)]
    pub(crate) fn splat(v: i32) -> Self {
        Self::of([v; LANES])
    }

    #[inline(always)]
    pub(crate) fn to_float(self) -> F<S> {
        F::of(S::to_float(self.0))
    }

    /// The floats whose bits the lanes are.
    #[inline(always)]
    pub(crate) fn as_bits(self) -> F<S> {
        F::of(lanes!(i => f32::from_bits(self.0[i] as u32)))
    }

    #[inline(always)]
    pub(crate) fn plus(self, other: Self) -> Self {
        Self::of(S::plus(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn times(self, other: i32) -> Self {
        Self::of(S::times(self.0, [other; LANES]))
    }

    #[inline(always)]
    pub(crate) fn xor(self, other: Self) -> Self {
        Self::of(S::xor(self.0, other.0))
    }

    /// The bits of each lane `N` places lower, with zeros above.
    #[inline(always)]
    pub(crate) fn lower<const N: u32>(self) -> Self {
        Self::of(S::lower::<N>(self.0))
    }

    /// Where the lanes are less than `value`.
    #[inline(always)]
    pub(crate) fn below(self, value: i32) -> M<S> {
        M::of(S::below(self.0, [value; LANES]))
    }

    /// Where the lanes are `value`.
    #[inline(always)]
    pub(crate) fn is(self, value: i32) -> M<S> {
        M::of(S::equal(self.0, [value; LANES]))
    }
}

impl<S: Simd> M<S> {
    /// Every lane.
    pub(crate) const ALL: Self = Self([u32::MAX; LANES], PhantomData);
    /// No lane.
    pub(crate) const NONE: Self = Self([0; LANES], PhantomData);

    /// A packet of these lanes, each all bits or none.
    #[inline(always)]
    pub(crate) fn of(lanes: [u32; LANES]) -> Self {
        Self(lanes, PhantomData)
    }

    #[inline(always)]
    pub(crate) fn select(self, yes: F<S>, no: F<S>) -> F<S> {
        F::of(S::select(self.0, yes.0, no.0))
    }

    /// `yes` where true, and `no` elsewhere.
    #[inline(always)]
    pub(crate) fn either(self, yes: I<S>, no: I<S>) -> I<S> {
        I::of(S::choose(self.0, yes.0, no.0))
    }

    /// `value` where true, and zero elsewhere.
    #[inline(always)]
    pub(crate) fn choose(self, value: i32) -> I<S> {
        I::of(S::choose(self.0, [value; LANES], [0; LANES]))
    }

    #[inline(always)]
    pub(crate) fn and(self, other: Self) -> Self {
        Self::of(S::and(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn or(self, other: Self) -> Self {
        Self::of(S::or(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn not(self) -> Self {
        Self::of(S::not(self.0))
    }

    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        self.bits() != 0
    }

    /// A bit for each lane, the first one lowest.
    #[inline(always)]
    pub(crate) fn bits(self) -> u32 {
        S::bits(self.0)
    }

    #[inline(always)]
    pub(crate) fn lane(self, i: usize) -> bool {
        self.0[i] != 0
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, value: bool) {
        self.0[i] = if value { u32::MAX } else { 0 };
    }
}

/// The sum of products of two triples of packets.
#[inline(always)]
pub(crate) fn dot<S: Simd>(a: [F<S>; 3], b: [F<S>; 3]) -> F<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a + (b - a) f.
#[inline(always)]
pub(crate) fn lerp<S: Simd>(a: F<S>, b: F<S>, f: F<S>) -> F<S> {
    a + (b - a) * f
}

/// The components of sixteen vectors.
#[inline(always)]
pub(crate) fn apart<S: Simd>(v: [[f32; 4]; LANES]) -> [F<S>; 4] {
    let v = S::apart(v);
    [F::of(v[0]), F::of(v[1]), F::of(v[2]), F::of(v[3])]
}

/// The sixteen vectors of which these are the components.
#[inline(always)]
pub(crate) fn together<S: Simd>(v: [F<S>; 4]) -> [[f32; 4]; LANES] {
    S::together([v[0].0, v[1].0, v[2].0, v[3].0])
}

#[cfg(test)]
mod tests {
    use crate::simd::Portable;

    type F = super::F<Portable>;

    #[test]
    fn exp_is_within_two_units_in_the_last_place() {
        let mut worst = 0.0f64;
        for i in 0..200_000 {
            let x = -87.0 * (i as f32 / 200_000.0).powi(2);
            let exact = f64::from(x).exp();
            let got = f64::from(F::splat(x).exp_negative().0[3]);
            worst = worst.max(((got - exact) / exact).abs());
        }
        // Two units in the last place of f32.
        assert!(worst < 2.4e-7, "{worst:e}");
        assert_eq!(F::splat(0.0).exp_negative().0[0], 1.0);
        assert!(F::splat(f32::NEG_INFINITY).exp_negative().0[0] < 2e-38);
    }
}
