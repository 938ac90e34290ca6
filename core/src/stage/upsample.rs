//! `upsample`: the picture from a film of the medium alone, which may be smaller.
//!
//! Pixel (x, y) of the full picture takes the radiance, transmittance and depth of the pixels of the small film around it,
//! which stand at (min(x'·`scale` + `scale`/2, `full_width` - 1), …): the two by two nearest, with their bilinear weights,
//! times how well their surfaces fit (joint bilateral upsampling: J. Kopf et al. 2007). With r the part
//! by which the nearer of both surfaces is nearer, the fit is 1 up to r = [`Upsample::NEAR`] and falls linearly to 0 at
//! twice that; where there are `normals`, times another that rises with their cosine from 0 at [`Upsample::COSINE`] to 1
//! at 1, unless one of the two has none. Where the weights add up to less than [`Upsample::FIT`], that pixel of the four by four nearest serves alone whose
//! inverse distance differs least. Depths are weighed with what is stopped, 1 - mean T.
//!
//! Where there are `rims`, a film of half the scale that [`March`] made near rims alone, it serves in the small film's
//! place by as much as those of its two by two nearest that were marched have of their bilinear weights; what was not
//! marched is passed over.
//!
//! Behind the medium lies, times T, the mean over the sub-pixel positions of the surface's radiance where there is one, else
//! of the visible environment. The surface that is fitted is that of the first position.
//!
//! The film is that of [`March`](crate::stage::March), and so is the work axis.

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::{Kernel, March, require};

kernel_struct! {
    /// Parameters of `upsample`.
    pub struct UpsampleParams {
        /// As in [`MarchParams`](crate::stage::MarchParams).
        forward: F32x4,
        /// See `forward`.
        right: F32x4,
        /// See `forward`.
        up: F32x4,
        /// Multiplies the environment, RGB; its rotation in turns.
        environment: F32x4,
        /// Texels of the environment's field along x, y, z; unused.
        environment_dims: U32x4,
        /// Columns of the environment.
        environment_width: U32,
        /// Rows of the environment.
        environment_height: U32,
        /// Columns of the small film.
        width: U32,
        /// Rows of the small film.
        height: U32,
        /// Columns of the full picture.
        full_width: U32,
        /// Rows of the full picture.
        full_height: U32,
        /// Pixels of the full picture along each side of one of the small film.
        scale: U32,
        /// Sub-pixel positions.
        samples: U32,
        /// Vectors of `surface` a pixel: 1, or one for each sub-pixel position.
        surface_samples: U32,
        /// Vectors of `normals` a pixel, of which the first is read.
        normals_each: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Upsample {
    /// Parameters.
    pub params: UpsampleParams,
    /// Two vectors a pixel of the small film, as [`March`] leaves the medium alone.
    pub medium: Buf<[f32; 4]>,
    /// The same of half the scale, where rims are near.
    pub rims: Option<Buf<[f32; 4]>>,
    /// Radiance of the surface behind each pixel of the full picture, or each of its sub-pixel positions, RGB, and its
    /// distance along the ray in metres (infinite for none).
    pub surface: Option<Buf<[f32; 4]>>,
    /// Unit normal of the surface in each pixel of the full picture, zero for none; unused. What else a pixel holds is
    /// not read.
    pub normals: Option<Buf<[f32; 4]>>,
    /// Texels of the environment as [`March`] takes them. None where it is not seen.
    pub environment: Option<Field>,
    /// Sub-pixel positions, two values each.
    pub subpixels: Buf<f32>,
    /// Two vectors a pixel of the full picture.
    pub film: Buf<[f32; 4]>,
}

impl Upsample {
    /// Surfaces whose distances differ by this part fit fully; by twice as much, not at all.
    pub const NEAR: f32 = 0.05;
    /// The cosine of two normals that do not fit.
    pub const COSINE: f32 = 0.5;
    /// The least sum of weights that is trusted.
    pub const FIT: f32 = 0.01;

    /// Blocks along x and y.
    pub fn blocks(&self) -> [u32; 2] {
        [self.params.full_width.div_ceil(March::BLOCK), self.params.full_height.div_ceil(March::BLOCK)]
    }
}

impl Kernel for Upsample {
    const NAME: &'static str = "upsample";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let row = u64::from(March::BLOCK) * u64::from(self.params.full_width);
        vec![
            Binding::read("medium", Some(self.medium)),
            Binding::read("rims", self.rims),
            Binding::read("surface", self.surface).in_parts::<[f32; 4]>(row * u64::from(self.params.surface_samples)),
            Binding::read("normals", self.normals),
            Binding::sample("environment", FieldFormat::Rgba, self.environment),
            Binding::read("subpixels", Some(self.subpixels)),
            Binding::write("film", Some(self.film)).in_parts::<[f32; 4]>(2 * row),
        ]
    }

    fn axis(&self) -> u32 {
        let [x, y] = self.blocks();
        x * y
    }

    fn group(&self) -> u32 {
        self.blocks()[0]
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_small([p.width, p.height], [p.full_width, p.full_height], p.scale)?;
        let full = u64::from(p.full_width) * u64::from(p.full_height);
        let small = 2 * u64::from(p.width) * u64::from(p.height);
        require!(self.medium.len >= small, "a film of {} vectors of the medium, not {small}", self.medium.len);
        if let Some(rims) = self.rims {
            let scale = p.scale / 2;
            require!(p.scale.is_multiple_of(2), "rims at half of scale {}", p.scale);
            let wanted = 2 * u64::from(p.full_width.div_ceil(scale)) * u64::from(p.full_height.div_ceil(scale));
            require!(rims.len >= wanted, "a film of {} vectors near rims, not {wanted}", rims.len);
        }
        require!(self.film.len >= 2 * full, "a film of {} vectors for {full} pixels", self.film.len);
        if let Some(surface) = self.surface {
            let each = p.surface_samples;
            require!(each == 1 || each == p.samples, "surfaces of {each} positions for {} samples", p.samples);
            require!(surface.len >= full.saturating_mul(each.into()), "surfaces of fewer than {full} pixels");
        }
        if let Some(normals) = self.normals {
            let each = p.normals_each;
            require!(each > 0 && normals.len >= full * u64::from(each), "normals of fewer than {full} pixels");
        }
        require!(
            p.samples > 0 && self.subpixels.len >= 2 * u64::from(p.samples),
            "{} values of {} sub-pixel positions",
            self.subpixels.len,
            p.samples
        );
        if let Some(environment) = self.environment {
            let size = [p.environment_width, p.environment_height];
            is_sky(&environment, p.environment_dims, size)?;
        }
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        // The pixels around in both films, and the sub-pixel positions.
        let needed = 64 + u64::from(self.params.samples);
        require!(
            needed <= turns,
            "a pixel takes up to {needed} turns of loops, and {turns} are allowed: fewer samples"
        );
        Ok(vec![self.clone()])
    }
}

/// Whether a film has a pixel for every `scale` × `scale` of a picture, and that has at most 2³² pixels.
pub(super) fn is_small(film: [u32; 2], full: [u32; 2], scale: u32) -> Result<(), String> {
    let ([width, height], [full_width, full_height]) = (film, full);
    let pixels = u64::from(full_width) * u64::from(full_height);
    require!(pixels > 0 && u32::try_from(pixels).is_ok(), "a picture of {full_width} × {full_height}");
    require!(
        scale > 0 && full.map(|side| side.div_ceil(scale)) == film,
        "a film of {width} × {height} for {full_width} × {full_height} pixels at scale {scale}"
    );
    Ok(())
}

/// Whether a field holds an environment of so many columns and rows.
pub(super) fn is_sky(environment: &Field, [x, y, z, _]: [u32; 4], size: [u32; 2]) -> Result<(), String> {
    let texels = u64::from(size[0]) * u64::from(size[1]);
    let spec = environment.spec;
    require!(spec.dims == [x, y, z] && spec.layers == 1, "an environment of {spec:?} for {x} × {y} × {z}");
    require!(spec.format == FieldFormat::Rgba, "an environment of {spec:?}");
    let range = 1..=spec.texels().min(i32::MAX as u64);
    require!(range.contains(&texels), "{texels} texels of the environment in {spec:?}");
    Ok(())
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::device::ResourceId;

    #[test]
    fn sizes_must_fit() {
        let mut params = UpsampleParams::zeroed();
        (params.width, params.height, params.full_width, params.full_height) = (3, 2, 9, 8);
        (params.scale, params.samples, params.normals_each) = (4, 1, 1);
        let stage = Upsample {
            params,
            medium: Buf::new(ResourceId(0), 12),
            rims: Some(Buf::new(ResourceId(4), 40)),
            surface: None,
            normals: None,
            environment: None,
            subpixels: Buf::new(ResourceId(1), 2),
            film: Buf::new(ResourceId(2), 144),
        };
        assert_eq!((stage.validate(), stage.axis(), stage.group()), (Ok(()), 2, 2));
        assert!(Upsample { medium: Buf::new(ResourceId(0), 11), ..stage.clone() }.validate().is_err());
        assert!(Upsample { rims: Some(Buf::new(ResourceId(4), 39)), ..stage.clone() }.validate().is_err());
        assert!(Upsample { normals: Some(Buf::new(ResourceId(3), 71)), ..stage.clone() }.validate().is_err());
        assert!(stage.passes(64).unwrap_err().contains("fewer samples"));
        let mut wide = stage;
        wide.params.full_width = 13;
        assert!(wide.validate().unwrap_err().contains("scale 4"));
    }
}
