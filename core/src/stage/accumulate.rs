//! `accumulate`: the mean of the medium over the pictures of a sequence.
//!
//! Of each pixel the history keeps radiance and the number of pictures it is the mean of, transmittance and depth, and the
//! surface's distance. A picture adds to the mean with weight 1 / (n + 1), n the pictures so far but at most `most`.
//!
//! Where nothing moved ([`mode::STILL`]) that is the plain mean, pixel by pixel. Where something did ([`mode::MOVED`]) the
//! point that a pixel shows (at the depth, else on the surface, else infinitely far) is looked up where the last view saw
//! it, bilinearly between those of its pixels that fit: within the picture, with a history of finite values, and with a
//! surface whose distance is that of the pixel's own, seen from the eye of then, to [`Accumulate::NEAR`]. Their radiance and
//! transmittance are clamped to the range of the three by three pixels around in the picture that is added (B. Karis 2014,
//! High Quality Temporal Supersampling). A picture that was added already ([`mode::AGAIN`]) changes nothing.
//!
//! A pixel that was not marched ([`March::UNMARCHED`]) keeps no history and is passed over by the range around.
//!
//! A history that is not finite is left out wherever it is met. Depths are weighed with what is stopped, 1 - mean T.
//!
//! The work axis is the blocks of 8×8 pixels, row by row.

use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::stage::upsample::is_small;
use crate::stage::{Kernel, March, require};

kernel_struct! {
    /// Parameters of `accumulate`.
    pub struct AccumulateParams {
        /// As in [`MarchParams`](crate::stage::MarchParams).
        forward: F32x4,
        /// See `forward`.
        right: F32x4,
        /// See `forward`.
        up: F32x4,
        /// The eye's place seen from that of the last picture, metres; unused.
        moved: F32x4,
        /// Axis f of the last picture's camera; unused.
        last_forward: F32x4,
        /// Its axis r divided by its square, so that the product with a direction, over that with f, is a; unused.
        last_right: F32x4,
        /// Its axis u, likewise; unused.
        last_up: F32x4,
        /// Columns of the film.
        width: U32,
        /// Rows of the film.
        height: U32,
        /// Columns of the full picture.
        full_width: U32,
        /// Rows of the full picture.
        full_height: U32,
        /// Pixels of the full picture along each side of one of the film.
        scale: U32,
        /// A constant of [`mode`].
        mode: U32,
        /// The most pictures that a history counts for.
        most: F32,
        /// Unused.
        unused_0: U32,
    }
}

/// What happened since the last picture.
pub mod mode {
    /// Nothing.
    pub const STILL: u32 = 0;
    /// Something moved.
    pub const MOVED: u32 = 1;
    /// Nothing, and the picture is the last one itself.
    pub const AGAIN: u32 = 2;
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulate {
    /// Parameters.
    pub params: AccumulateParams,
    /// Two vectors a pixel, as [`March`] leaves the medium alone.
    pub medium: Buf<[f32; 4]>,
    /// Three vectors a pixel, as the last picture left them; zeros where there was none.
    pub last: Buf<[f32; 4]>,
    /// Three vectors a pixel: radiance RGB and the number of pictures; transmittance RGB and depth; the surface's distance
    /// and zeros.
    pub next: Buf<[f32; 4]>,
    /// The mean, in the form of `medium`.
    pub mean: Buf<[f32; 4]>,
}

impl Accumulate {
    /// The most pictures that a history counts for where nothing moves: as many as f32 counts.
    pub const STILL: f32 = 8_388_608.0;
    /// The same after the eye moved, or what stands behind the medium did.
    pub const MOVED: f32 = 15.0;
    /// The same after light or medium changed.
    pub const CHANGED: f32 = 3.0;
    /// How far surfaces of one point may differ in distance, as a part of it.
    pub const NEAR: f32 = 0.1;
    /// The least sum of bilinear weights of pixels that fit.
    pub const FIT: f32 = 0.01;

    /// Blocks along x and y.
    pub fn blocks(&self) -> [u32; 2] {
        [self.params.width.div_ceil(March::BLOCK), self.params.height.div_ceil(March::BLOCK)]
    }
}

impl Kernel for Accumulate {
    const NAME: &'static str = "accumulate";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let row = u64::from(March::BLOCK) * u64::from(self.params.width);
        vec![
            Binding::read("medium", Some(self.medium)),
            Binding::read("last", Some(self.last)),
            Binding::write("next", Some(self.next)).in_parts::<[f32; 4]>(3 * row),
            Binding::write("mean", Some(self.mean)).in_parts::<[f32; 4]>(2 * row),
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
        let pixels = u64::from(p.width) * u64::from(p.height);
        require!(pixels > 0 && u32::try_from(3 * pixels).is_ok(), "a film of {} × {}", p.width, p.height);
        is_small([p.width, p.height], [p.full_width, p.full_height], p.scale)?;
        for (what, len, each) in [
            ("medium", self.medium.len, 2),
            ("last", self.last.len, 3),
            ("next", self.next.len, 3),
            ("mean", self.mean.len, 2),
        ] {
            require!(len >= each * pixels, "{what} of {len} vectors, and {} are wanted", each * pixels);
        }
        require!(p.mode <= mode::AGAIN, "mode {}", p.mode);
        require!((0.0..=Self::STILL).contains(&p.most), "a history of at most {} pictures", p.most);
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        // The pixels around, and those of the history.
        require!(turns >= 16, "a pixel takes up to 16 turns of loops, and {turns} are allowed");
        Ok(vec![self.clone()])
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::device::ResourceId;

    #[test]
    fn sizes_must_fit() {
        let mut params = AccumulateParams::zeroed();
        (params.width, params.height, params.full_width, params.full_height, params.scale) = (3, 2, 5, 4, 2);
        let buf = |id, len| Buf::new(ResourceId(id), len);
        let stage = Accumulate { params, medium: buf(0, 12), last: buf(1, 18), next: buf(2, 18), mean: buf(3, 12) };
        assert_eq!((stage.validate(), stage.axis()), (Ok(()), 1));
        assert!(Accumulate { last: buf(1, 17), ..stage.clone() }.validate().unwrap_err().contains("last of 17"));
        let mut other = stage;
        other.params.mode = 3;
        assert!(other.validate().is_err());
    }
}
