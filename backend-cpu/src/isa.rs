//! Instruction sets, chosen at run time.

/// An instruction set that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// What every processor of the target has.
    Baseline,
    /// AVX2 with FMA and F16C.
    Avx2,
    /// AVX-512 F, BW, DQ and VL.
    Avx512,
}

impl Isa {
    /// The instruction sets of this machine, the best one last.
    pub fn available() -> Vec<Self> {
        #[cfg_attr(not(target_arch = "x86_64"), allow(unused_mut))]
        let mut all = vec![Self::Baseline];
        #[cfg(target_arch = "x86_64")]
        {
            let detected = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
                && is_x86_feature_detected!("f16c")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2");
            if detected {
                all.push(Self::Avx2);
                let wide = is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl");
                if wide {
                    all.push(Self::Avx512);
                }
            }
        }
        all
    }

    /// The best instruction set of this machine.
    pub fn best() -> Self {
        Self::available().into_iter().max().unwrap_or(Self::Baseline)
    }

    /// Name, as device features list it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

/// A function compiled for an instruction set: what [`Isa::available`] detects.
#[cfg(target_arch = "x86_64")]
macro_rules! with_features {
    (avx512, $($function:tt)*) => {
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c,bmi1,bmi2")]
        $($function)*
    };
    (avx2, $($function:tt)*) => {
        #[target_feature(enable = "avx2,fma,f16c,bmi1,bmi2")]
        $($function)*
    };
}
#[cfg(target_arch = "x86_64")]
pub(crate) use with_features;

/// Calls an `#[inline(always)]` function compiled for an instruction set; of one that is written `name<S>`, the type
/// parameter is the set's [`Simd`](crate::simd::Simd). The set must be one that [`Isa::available`] gave, which
/// [`CpuDevice`](crate::CpuDevice) sees to.
macro_rules! compiled_for {
    ($isa:expr, $function:ident<S>($($arg:ident: $ty:ty),* $(,)?)) => {
        $crate::isa::compiled_for!(
            $isa,
            [
                $function::<$crate::simd::Avx512>,
                $function::<$crate::simd::Avx2>,
                $function::<$crate::simd::Baseline>
            ],
            ($($arg: $ty),*)
        )
    };
    ($isa:expr, $function:ident($($arg:ident: $ty:ty),* $(,)?)) => {
        $crate::isa::compiled_for!($isa, [$function, $function, $function], ($($arg: $ty),*))
    };
    ($isa:expr, [$avx512:expr, $avx2:expr, $baseline:expr], ($($arg:ident: $ty:ty),*)) => {{
        #[cfg(target_arch = "x86_64")]
        $crate::isa::with_features!(avx512, fn avx512($($arg: $ty),*) {
            $avx512($($arg),*)
        });
        #[cfg(target_arch = "x86_64")]
        $crate::isa::with_features!(avx2, fn avx2($($arg: $ty),*) {
            $avx2($($arg),*)
        });
        match $isa {
            // SAFETY: a device holds only instruction sets that were detected on this machine.
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)]
            $crate::Isa::Avx512 => unsafe { avx512($($arg),*) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)]
            $crate::Isa::Avx2 => unsafe { avx2($($arg),*) },
            _ => $baseline($($arg),*),
        }
    }};
}
pub(crate) use compiled_for;
