//! Lookups and nothing else: what memory and instructions allow a stage that looks up one field a sample.

use airlight_core::device::{FieldFormat, FieldSpec};
use rayon::prelude::*;

use crate::Isa;
use crate::isa::compiled_for;
use crate::kernels::field::Scalars;
use crate::packet::{F, LANES, lanes, triple};
use crate::simd::Simd;

/// Samples along a ray, in index space, where texel i lies at i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BareRay {
    /// The first sample.
    pub origin: [f32; 3],
    /// From each sample to the next.
    pub step: [f32; 3],
    /// Number of samples.
    pub samples: u32,
}

/// Packets that one task takes.
const TASK: usize = 16;

/// The sum of trilinear lookups at all samples, on all cores by the best instruction set of the machine. Sixteen rays in
/// turn make a packet; those that lie together read the same memory.
///
/// # Panics
/// Unless there is at least one float more than texels, x fastest, then y and z.
pub fn bare_lookups(texels: &[f32], dims: [u32; 3], rays: &[BareRay]) -> f32 {
    let isa = Isa::best();
    let field = Scalars::new(texels, &FieldSpec::dense(dims, 1, FieldFormat::Scalar));
    let sum = |rays: &[BareRay]| {
        let mut sum = 0.0;
        for rays in rays.chunks(LANES) {
            let out = &mut sum;
            compiled_for!(isa, bare<S>(field: Scalars<'_>, rays: &[BareRay], out: &mut f32));
        }
        sum
    };
    rays.par_chunks(TASK * LANES).map(sum).sum()
}

/// Adds the lookups of up to sixteen rays.
#[inline(always)]
fn bare<S: Simd>(field: Scalars<'_>, rays: &[BareRay], out: &mut f32) {
    let ray: [&BareRay; LANES] = std::array::from_fn(|i| &rays[i.min(rays.len() - 1)]);
    let origin = triple!(a => F::<S>::of(lanes!(i => ray[i].origin[a])));
    let step = triple!(a => F::of(lanes!(i => ray[i].step[a])));
    let count = F::of(lanes!(i => if i < rays.len() { ray[i].samples as f32 } else { 0.0 }));
    let last = count.max_lane();
    let (mut sum, mut k) = (F::<S>::ZERO, 0.0);
    while k < last {
        let at = triple!(a => origin[a] + step[a] * k);
        sum = F::splat(k).lt(count).select(sum + field.sample::<S>(at), sum);
        k += 1.0;
    }
    *out += sum.total();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_single_lookups() {
        let dims = [7, 5, 4];
        let texels: Vec<f32> = (0..7 * 5 * 4 + 1).map(|i| (i * 37 % 11) as f32).collect();
        let ray = |i: u32| BareRay {
            origin: [i as f32 * 0.3 - 0.5, 0.2, 3.9 - i as f32 * 0.1],
            step: [0.25, 0.1 * i as f32, -0.2],
            samples: i % 5,
        };
        let rays: Vec<BareRay> = (0..21).map(ray).collect();
        let field = Scalars::new(&texels, &FieldSpec::dense(dims, 1, FieldFormat::Scalar));
        let single = |r: &BareRay| {
            let at = |k: u32| [0, 1, 2].map(|a| r.origin[a] + r.step[a] * k as f32);
            (0..r.samples).map(|k| field.single(at(k))).sum::<f32>()
        };
        let expected = rays.iter().map(single).sum::<f32>();
        // Forty values up to 10, summed in another order.
        assert!((bare_lookups(&texels, dims, &rays) - expected).abs() < 1e-3);
    }
}
