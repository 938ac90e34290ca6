//! `evaluate`: what clusters of transfer matrices make of light (Zhang, Dong and Ma 2013, equations 18 and 20).
//!
//! A transfer matrix M turns light, the coefficients s of `functions` functions, into moments of the radiance that
//! arrives at a place. Matrices are compressed by clusters: of each the mean and some components, its `per_cluster` units.
//! For unit u and moment j
//!
//! I\[u\]\[j\]\[c\] = Σ_k M\[u\]\[j\]\[k\] · s\[c\]\[k\].
//!
//! Where `folded`, each cluster is seen from one direction (early evaluation), and its moments are summed with what they
//! weigh there:
//!
//! I\[u\]\[c\] = Σ_j `views`\[u / per_cluster\]\[j\] · Σ_k M\[u\]\[j\]\[k\] · s\[c\]\[k\].
//!
//! Functions are counted in whole packs ([`EvaluateParams::packed`]): those past the light's own are zero in matrices and light.
//! So rows of all matrices begin at the same place of a vector, and none ends within one.
//!
//! The output is RGBA (A zero). The work axis is the moments of all units, or, where folded, the units. A pass takes some
//! of the moments of a folded unit: the first writes its sum, and each other adds to what the ones before left.

use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// Parameters of `evaluate`.
    pub struct EvaluateParams {
        /// Matrices of all clusters.
        units: U32,
        /// Matrices of a cluster: its mean and its components.
        per_cluster: U32,
        /// Moments of a matrix: its rows.
        coefficients: U32,
        /// Functions of the light: its columns, a multiple of [`EvaluateParams::PACK`].
        functions: U32,
        /// 1 to sum the moments of a unit.
        folded: U32,
        /// First moment of this pass; 0 unless folded.
        coefficient_begin: U32,
        /// One past the last moment of this pass; all unless folded.
        coefficient_end: U32,
        /// Unused.
        unused: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluate {
    /// Parameters.
    pub params: EvaluateParams,
    /// M, laid out \[unit\]\[moment\]\[function\].
    pub matrices: Buf<f32>,
    /// s, laid out \[RGB\]\[function\].
    pub light: Buf<f32>,
    /// What the moments of a cluster weigh, laid out \[cluster\]\[moment\]; read where folded.
    pub views: Option<Buf<f32>>,
    /// I, laid out \[unit\]\[moment\], or \[unit\] where folded: RGB; zero.
    pub out: Buf<[f32; 4]>,
}

impl EvaluateParams {
    /// Functions that a kernel may take at once.
    pub const PACK: u32 = 16;

    /// So many functions and what fills their last pack.
    pub fn packed(functions: u32) -> u32 {
        functions.div_ceil(Self::PACK).saturating_mul(Self::PACK)
    }

    /// Of `clusters` clusters of a mean and `components` components, as one pass.
    pub fn new(clusters: u32, components: u32, coefficients: u32, functions: u32, folded: bool) -> Self {
        let per_cluster = components.saturating_add(1);
        Self {
            units: clusters.saturating_mul(per_cluster),
            per_cluster,
            coefficients,
            functions,
            folded: folded.into(),
            coefficient_begin: 0,
            coefficient_end: coefficients,
            unused: 0,
        }
    }

    /// Values that the stage writes for each unit.
    pub fn outputs(&self) -> u32 {
        if self.folded == 1 { 1 } else { self.coefficients }
    }
}

impl Kernel for Evaluate {
    const NAME: &'static str = "evaluate";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let p = &self.params;
        let matrix = u64::from(p.coefficients) * u64::from(p.functions);
        vec![
            Binding::read("matrices", Some(self.matrices)).in_parts::<f32>(matrix),
            Binding::read("light", Some(self.light)),
            Binding::read("views", self.views),
            Binding::write("evaluated", Some(self.out)).in_parts::<[f32; 4]>(p.outputs().into()),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.units.saturating_mul(self.params.outputs())
    }

    fn group(&self) -> u32 {
        self.params.outputs()
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let (units, each) = (u64::from(p.units), u64::from(p.per_cluster));
        let (moments, functions) = (u64::from(p.coefficients), u64::from(p.functions));
        require!(units > 0 && each > 0 && units.is_multiple_of(each), "{units} matrices in clusters of {each}");
        require!(moments > 0 && functions > 0, "matrices of {moments} moments and {functions} functions");
        let pack = EvaluateParams::PACK;
        require!(p.functions.is_multiple_of(pack), "{functions} functions, which are no multiple of {pack}");
        // Kernels count values in 32 bits.
        let values = units.checked_mul(moments * functions).filter(|&n| u32::try_from(n).is_ok());
        require!(
            values.is_some_and(|n| self.matrices.len >= n),
            "{units} matrices of {moments} × {functions} in {} values, or more than 32 bits count",
            self.matrices.len
        );
        require!(self.light.len >= 3 * functions, "light of {} values for {functions} functions", self.light.len);
        require!(self.out.len >= self.axis().into(), "{} places for {}", self.out.len, self.axis());
        let pass = p.coefficient_begin..p.coefficient_end;
        require!(!pass.is_empty() && pass.end <= p.coefficients, "moments {pass:?} of {moments}");
        require!(p.folded == 1 || pass == (0..p.coefficients), "moments {pass:?} of {moments}, and none are summed");
        let views = units / each * moments;
        require!(
            p.folded == 0 || self.views.is_some_and(|b| b.len >= views),
            "views of clusters are missing or fewer than {views}"
        );
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let p = &self.params;
        // Kernels whose turns are counted take four functions at one.
        let each = u64::from(p.functions) / 4 + 1;
        require!(
            each <= turns,
            "a moment of {} functions takes {each} turns of loops, and {turns} are allowed: fewer functions need less",
            p.functions
        );
        if p.folded == 0 {
            return Ok(vec![self.clone()]);
        }
        let (begin, end) = (p.coefficient_begin, p.coefficient_end);
        let some = (turns / each).min(end.into()) as u32;
        let pass = |from: u32| {
            let mut pass = self.clone();
            (pass.params.coefficient_begin, pass.params.coefficient_end) = (from, from.saturating_add(some).min(end));
            pass
        };
        Ok((begin..end).step_by(some as usize).map(pass).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::ResourceId;

    /// Four clusters of three matrices, of 9 moments and 48 functions.
    fn evaluate(folded: bool) -> Evaluate {
        let params = EvaluateParams::new(4, 2, 9, 48, folded);
        Evaluate {
            params,
            matrices: Buf::new(ResourceId(0), 12 * 9 * 48),
            light: Buf::new(ResourceId(1), 144),
            views: folded.then(|| Buf::new(ResourceId(2), 36)),
            out: Buf::new(ResourceId(3), (12 * params.outputs()).into()),
        }
    }

    #[test]
    fn passes_take_every_moment_once_and_keep_to_their_turns() {
        for turns in [13, 26, 40, 1000] {
            let mut next = 0;
            for pass in evaluate(true).passes(turns).unwrap() {
                assert_eq!(pass.validate(), Ok(()));
                let (begin, end) = (pass.params.coefficient_begin, pass.params.coefficient_end);
                assert_eq!(begin, next);
                assert!(u64::from(end - begin) * 13 <= turns, "{turns} turns: {begin} to {end}");
                next = end;
            }
            assert_eq!(next, 9, "{turns} turns");
        }
        for folded in [false, true] {
            assert_eq!(evaluate(folded).passes(1000).unwrap(), [evaluate(folded)]);
            let error = evaluate(folded).passes(12).unwrap_err();
            assert!(error.contains("48 functions"), "{error}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        for folded in [false, true] {
            assert_eq!(evaluate(folded).validate(), Ok(()));
            let refused = |change: &dyn Fn(&mut Evaluate), what: &str| {
                let mut stage = evaluate(folded);
                change(&mut stage);
                let error = stage.validate().unwrap_err();
                assert!(error.contains(what), "{error}");
            };
            refused(&|s| s.params.units = 11, "clusters of 3");
            refused(&|s| s.params.per_cluster = 0, "clusters of 0");
            refused(&|s| s.params.functions = 0, "0 functions");
            refused(&|s| s.params.functions = 49, "no multiple of 16");
            refused(&|s| s.params.functions = 64, "64 in");
            refused(&|s| (s.params.units, s.params.functions) = (3 << 20, 1 << 20), "more than 32 bits");
            refused(&|s| s.light.len = 143, "light");
            refused(&|s| s.out.len -= 1, "places");
            refused(&|s| s.params.coefficient_end = 10, "moments 0..10");
        }
        let mut part = evaluate(false);
        part.params.coefficient_begin = 1;
        assert!(part.validate().unwrap_err().contains("none are summed"));
        let blind = Evaluate { views: None, ..evaluate(true) };
        assert!(blind.validate().unwrap_err().contains("views"));
    }
}
