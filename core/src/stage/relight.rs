//! `relight`: in-scattered radiance from records and light.
//!
//! With one layer, the radiance J does not depend on the view and each cell's is the product of light and record
//! (Delalandre, Gautron and Marvie 2013, equation 4), plus the emission's share:
//!
//! J\[c\] = Σ_k `light`\[k\]\[c\] · D\[k\]\[c\] + `emission_weight` · E\[0\]\[c\].
//!
//! With as many layers as coefficients, layer k holds coefficient k of J(d) = Σ_k J_k Y_k(d):
//! J_k\[c\] = `light`\[k\]\[c\] · (D\[k\]\[c\] + E\[k\]\[c\]), where `light` holds the phase function's moments.
//!
//! A record of one channel serves all three. The output is laid out \[cell\]\[layer\] as RGBA (A unused), ready to be
//! published as a field. The work axis is the cells, x fastest.

use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// Parameters of `relight`.
    pub struct RelightParams {
        /// Cells.
        cells: U32,
        /// Coefficients of a record.
        coefficients: U32,
        /// Channels of a record: 1 or 3.
        channels: U32,
        /// Layers of the output: 1, or as many as coefficients.
        layers: U32,
        /// Coefficients of the emission's moments; 0 for none.
        emission_coefficients: U32,
        /// Weight of E\[0\] where there is one layer.
        emission_weight: F32,
        /// 1 where records are planes of a value a cell, as [`Sweep`](super::Sweep) may leave them; 0 where a cell's lie together.
        planar: U32,
        /// Unused.
        unused: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Relight {
    /// Parameters.
    pub params: RelightParams,
    /// D, laid out \[cell\]\[coefficient\]\[channel\], or \[coefficient\]\[channel\]\[cell\].
    pub records: Buf<f32>,
    /// E, laid out \[cell\]\[coefficient\]\[RGB\].
    pub emission_records: Option<Buf<f32>>,
    /// Light per coefficient, RGB; unused.
    pub light: Buf<[f32; 4]>,
    /// J, laid out \[cell\]\[layer\], RGB; unused.
    pub out: Buf<[f32; 4]>,
}

impl Kernel for Relight {
    const NAME: &'static str = "relight";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let p = &self.params;
        let record = u64::from(p.coefficients) * u64::from(p.channels);
        let emission = u64::from(p.emission_coefficients) * 3;
        vec![
            if p.planar == 1 {
                Binding::read("records", Some(self.records))
            } else {
                Binding::read("records", Some(self.records)).in_parts::<f32>(record)
            },
            Binding::read("emission_records", self.emission_records).in_parts::<f32>(emission),
            Binding::read("light", Some(self.light)),
            Binding::write("in_scatter", Some(self.out)).in_parts::<[f32; 4]>(p.layers.into()),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.cells
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let (cells, k, layers) = (u64::from(p.cells), u64::from(p.coefficients), u64::from(p.layers));
        require!(cells > 0 && k > 0, "{cells} cells of {k} coefficients");
        require!(layers == 1 || layers == k, "{layers} layers for {k} coefficients");
        require!([1, 3].contains(&p.channels), "records of {} channels", p.channels);
        require!(self.records.len >= cells * k * u64::from(p.channels), "{} record values", self.records.len);
        require!(self.light.len >= k, "light of {} coefficients for {k}", self.light.len);
        require!(self.out.len >= cells * layers, "{} places for {layers} layers of {cells} cells", self.out.len);
        let e = u64::from(p.emission_coefficients);
        require!(e == 0 || e == layers, "{e} emission coefficients for {layers} layers");
        require!(
            e == 0 || self.emission_records.is_some_and(|b| b.len >= cells * e * 3),
            "emission records are missing or too few"
        );
        Ok(())
    }

    fn passes(&self, _: u64) -> Result<Vec<Self>, String> {
        Ok(vec![self.clone()])
    }
}
