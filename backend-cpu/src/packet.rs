//! Sixteen lanes side by side, as plain arrays that the compiler turns into vector registers.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Lanes of a packet.
pub(crate) const LANES: usize = 16;

/// Sixteen floats.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct F(pub(crate) [f32; LANES]);

/// Sixteen integers.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct I(pub(crate) [i32; LANES]);

/// Sixteen truths: all bits set, or none.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct M(pub(crate) [u32; LANES]);

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

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for F {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(lanes!(i => self.0[i] $op other.0[i]))
            }
        }

        impl $trait<f32> for F {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                Self(lanes!(i => self.0[i] $op other))
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Neg for F {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(lanes!(i => -self.0[i]))
    }
}

impl F {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);
    pub(crate) const ONE: Self = Self([1.0; LANES]);

    #[inline(always)]
    pub(crate) fn splat(v: f32) -> Self {
        Self([v; LANES])
    }

    /// The lesser, and `other` where `self` is not a number.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self(lanes!(i => if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
    }

    /// The greater, and `other` where `self` is not a number.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self(lanes!(i => if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self(lanes!(i => self.0[i].abs()))
    }

    #[inline(always)]
    pub(crate) fn floor(self) -> Self {
        Self(lanes!(i => self.0[i].floor()))
    }

    #[inline(always)]
    pub(crate) fn ceil(self) -> Self {
        Self(lanes!(i => self.0[i].ceil()))
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self(lanes!(i => self.0[i].sqrt()))
    }

    #[inline(always)]
    pub(crate) fn lt(self, other: Self) -> M {
        M(lanes!(i => if self.0[i] < other.0[i] { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    pub(crate) fn ge(self, other: Self) -> M {
        M(lanes!(i => if self.0[i] >= other.0[i] { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    pub(crate) fn gt(self, other: Self) -> M {
        other.lt(self)
    }

    /// The lanes, with what is nearer to zero than 1e-20 replaced by 1e-20: far enough to divide by.
    #[inline(always)]
    pub(crate) fn away_from_zero(self) -> Self {
        Self(lanes!(i => if self.0[i].abs() < 1e-20 { 1e-20 } else { self.0[i] }))
    }

    #[inline(always)]
    pub(crate) fn max_lane(self) -> f32 {
        let mut max = self.0[0];
        for v in self.0 {
            max = if v > max { v } else { max };
        }
        max
    }

    /// The integers that the lanes hold; all must lie in the range of `i32`.
    #[inline(always)]
    pub(crate) fn to_int(self) -> I {
        // SAFETY: callers pass lanes that `min` and `max` put between two representable integers; both replace what
        // is not a number.
        #[allow(unsafe_code)]
        I(lanes!(i => unsafe { self.0[i].to_int_unchecked::<i32>() }))
    }

    /// e^x for x ≤ 0, to two units in the last place; e^-87 and below is about 1e-38.
    #[inline(always)]
    pub(crate) fn exp_negative(self) -> Self {
        const LOG2_E: f32 = std::f32::consts::LOG2_E;
        // ln 2 in two parts, the first exact in few bits so that n · first is exact.
        const LN2_HI: f32 = 0.693_359_4;
        const LN2_LO: f32 = -2.121_944_4e-4;
        let x = self.max(Self::splat(-87.0)).min(Self::ZERO);
        let n = (x * LOG2_E + 0.5).floor();
        let r = x - n * LN2_HI - n * LN2_LO;
        // Taylor's series to r⁷ over |r| ≤ ln 2 / 2 ends below 1e-8.
        let mut p = Self::splat(1.0 / 5040.0);
        for c in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
            p = p * r + c;
        }
        let n = n.to_int();
        Self(lanes!(i => p.0[i] * f32::from_bits(((n.0[i] + 127) as u32) << 23)))
    }
}

impl I {
    #[inline(always)]
    pub(crate) fn plus(self, other: Self) -> Self {
        Self(lanes!(i => self.0[i] + other.0[i]))
    }
}

impl M {
    #[inline(always)]
    pub(crate) fn select(self, yes: F, no: F) -> F {
        F(lanes!(i => f32::from_bits(self.0[i] & yes.0[i].to_bits() | !self.0[i] & no.0[i].to_bits())))
    }

    #[inline(always)]
    pub(crate) fn and(self, other: Self) -> Self {
        Self(lanes!(i => self.0[i] & other.0[i]))
    }

    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        let mut all = 0;
        for m in self.0 {
            all |= m;
        }
        all != 0
    }

    #[inline(always)]
    pub(crate) fn or(self, other: Self) -> Self {
        Self(lanes!(i => self.0[i] | other.0[i]))
    }

    #[inline(always)]
    pub(crate) fn not(self) -> Self {
        Self(lanes!(i => !self.0[i]))
    }

    #[inline(always)]
    pub(crate) fn lane(self, i: usize) -> bool {
        self.0[i] != 0
    }
}

/// The sum of products of two triples of packets.
#[inline(always)]
pub(crate) fn dot(a: [F; 3], b: [F; 3]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a + (b - a) f.
#[inline(always)]
pub(crate) fn lerp(a: F, b: F, f: F) -> F {
    a + (b - a) * f
}

#[cfg(test)]
mod tests {
    use super::*;

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
